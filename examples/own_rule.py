"""Judge deformations by a rule of your own, written in a TOML file.

    python examples/own_rule.py resources/demo/demo.laz

docs/rules.md says what a rule may hold. A verdict respects the measurement's uncertainty:
within two standard deviations of the limit it is "review".
"""

import sys
from pathlib import Path

import pipecore

RULE = Path(__file__).with_name("own_rule.toml")


def main(scan: str) -> None:
    """Detect a scan and print each verdict with the limit that it comes from."""
    settings = pipecore.Settings().replace({"deformation.rule": str(RULE)})
    result = pipecore.detect(pipecore.read(scan), settings)

    rule = pipecore.rules.load_rule(str(RULE))
    print(rule.title)
    for d in result.deformations:
        element = result.element(d.element_id)
        depth = f"{1000 * d.depth:.1f} ± {1000 * d.depth_sd:.1f} mm"
        verdict = pipecore.rules.verdict_words(d)
        print(f"{d.kind} {d.deformation_id} on {element.label}: {depth}: {verdict}")
        limit = pipecore.rules.dent_limit(element, [rule])
        if d.kind == pipecore.DeformationKind.DENT and limit is not None:
            print(f"    limit for dents there: {1000 * limit.depth:.1f} mm")


if __name__ == "__main__":
    main(*sys.argv[1:])
