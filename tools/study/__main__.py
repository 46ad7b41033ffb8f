"""How accurate the detection is: `python -m tools.study [SECTION ...]`.

Measures on simulated scans with known truth and writes `docs/accuracy.md`, each section
apart. What has been measured is kept in out/study for the same sources, so that a run that
was stopped goes on where it was.
"""

import argparse
import shlex
import sys

from tools.study import deformations, fits, pipes, plants, pump
from tools.study.store import put_section, sources_digest

SECTIONS = ("fits", "pipes", "plants", "one-station", "deformations", "pump")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.study", description=__doc__)
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(SECTIONS))
    parser.add_argument("--plants", type=int, help="plants with four stations (default 20)")
    parser.add_argument("--one-station", type=int, help="plants with one station (default 20)")
    parser.add_argument(
        "--first-seed", type=int, default=1000, help="of the plants; 1 to 20 are for development"
    )
    parser.add_argument("--quick", action="store_true", help="few trials, two plants")
    args = parser.parse_args()
    unknown = set(args.sections) - set(SECTIONS)
    if unknown:
        parser.error(f"no section is called {', '.join(sorted(unknown))}")
    n_default = 2 if args.quick else 20
    n_plants = n_default if args.plants is None else args.plants
    n_one = n_default if args.one_station is None else args.one_station
    command = f"python -m tools.study {shlex.join(sys.argv[1:])}".strip()
    for section in args.sections or SECTIONS:
        if section == "fits":
            text = fits.write(args.quick)
        elif section == "pipes":
            text = pipes.write(args.quick)
        elif section == "deformations":
            text = deformations.write(args.quick)
        elif section == "plants":
            text = plants.write(4, args.first_seed, n_plants)
        elif section == "pump":
            text = pump.write()
        else:
            text = plants.write(1, args.first_seed, n_one)
        source = f"Measured by `{command}`; sources of the core {sources_digest()}."
        put_section(section, f"{source}\n{text}")


if __name__ == "__main__":
    main()
