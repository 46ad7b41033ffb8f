"""Detections in the second world and of real scans: `python -m tools.world COMMAND`.

What has been measured is kept in out/world for the same sources, so that a run that was
stopped goes on where it was. Each process has one thread.
"""

import argparse
from pathlib import Path

from tests.conftest import SHARED_DATA
from tools.world import FAMILIES, invariance, real, scene, series, tables
from tools.world.pictures import picture
from tools.world.running import Job, measure_scene, run_all, seeds_of


def main() -> None:
    """Measure, and print tables."""
    args = _parser().parse_args()
    if args.command == "scenes":
        print(tables.summary(run_all(_scene_jobs(args.family, args.seeds), args.processes)))
    elif args.command == "ovality":
        print(series.ovality_table(run_all(series.ovality_jobs(), args.processes)))
    elif args.command == "damage":
        print(series.damage_table(run_all(series.damage_jobs(args.draws), args.processes)))
    elif args.command == "invariance":
        jobs = invariance.jobs(args.clouds, args.changes)
        print(invariance.summary(run_all(jobs, args.processes)))
    elif args.command == "real":
        print(real.summary(run_all(real.jobs(args.folder, args.scans), args.processes)))
    else:
        _draw(args.family, args.seeds, Path("out/world"))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tools.world", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    helps = {
        "scenes": "detect in scenes drawn by seed, and say what was found",
        "ovality": "lone pipes all round: ovality by size and noise",
        "damage": "lone pipes with the worst damage",
        "invariance": "is the same found in a cloud that is shifted, turned, mirrored?",
        "real": "detect in the scans of shared/data",
        "pictures": "draw scenes to out/world",
    }
    made = {name: commands.add_parser(name, help=text) for name, text in helps.items()}
    for name in ("scenes", "pictures"):
        made[name].add_argument(
            "--family", nargs="+", choices=list(FAMILIES), default=list(FAMILIES)
        )
        made[name].add_argument("--seeds", default="1-20", help="such as 7 or 100-119")
    for name in set(helps) - {"pictures"}:
        made[name].add_argument("--processes", type=int, default=2)
    made["damage"].add_argument("--draws", type=int, default=20, help="of each line")
    made["invariance"].add_argument(
        "--clouds",
        nargs="+",
        default=["pump", "plant:21", "plant:22", "maple"],
        help=f"{', '.join(invariance.SHARED)}, plant:SEED or FAMILY:SEED",
    )
    made["invariance"].add_argument("--changes", type=int, default=10, help="shifts, and turns")
    made["real"].add_argument("--folder", type=Path, default=SHARED_DATA)
    names = list(real.SCANS)
    made["real"].add_argument("--scans", nargs="+", choices=names, default=names)
    return parser


def _scene_jobs(families: list[str], seeds: str) -> list[Job]:
    return [
        (f"scene-{family}-{seed}", measure_scene, (seed, family))
        for family in families
        for seed in seeds_of(seeds)
    ]


def _draw(families: list[str], seeds: str, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for family in families:
        for seed in seeds_of(seeds):
            drawn = scene(seed, family)
            title = f"{family} {seed}: {', '.join(b.name for b in drawn.bodies[1:])}"
            picture(drawn, folder / f"{family}-{seed}.png", title)


if __name__ == "__main__":
    main()
