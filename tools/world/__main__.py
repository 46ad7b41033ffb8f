"""Detections in the second world: `python -m tools.world COMMAND`.

What has been measured is kept in out/study for the same sources, so that a run that was
stopped goes on where it was. Each process has one thread.
"""

import argparse
from pathlib import Path

from tools.world import FAMILIES, scene
from tools.world.pictures import picture
from tools.world.running import Job, measure_scene, run_all, seeds_of
from tools.world.tables import summary


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.world", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    scenes = commands.add_parser("scenes", help="detect in scenes, and say what was found")
    pictures = commands.add_parser("pictures", help="draw scenes to out/world")
    for command in (scenes, pictures):
        command.add_argument("--family", nargs="+", choices=list(FAMILIES), default=list(FAMILIES))
        command.add_argument("--seeds", default="1-20", help="such as 7 or 100-119")
    for command in (scenes,):
        command.add_argument("--processes", type=int, default=2)
    args = parser.parse_args()
    if args.command == "scenes":
        print(summary(run_all(_scene_jobs(args.family, args.seeds), args.processes)))
    else:
        folder = Path("out/world")
        folder.mkdir(parents=True, exist_ok=True)
        for family in args.family:
            for seed in seeds_of(args.seeds):
                drawn = scene(seed, family)
                title = f"{family} {seed}: {', '.join(b.name for b in drawn.bodies[1:])}"
                picture(drawn, folder / f"{family}-{seed}.png", title)


def _scene_jobs(families: list[str], seeds: str) -> list[Job]:
    return [
        (f"scene-{family}-{seed}", measure_scene, (seed, family))
        for family in families
        for seed in seeds_of(seeds)
    ]


if __name__ == "__main__":
    main()
