"""The first thing that a new user sees: the demo's deformations, all of them and no other."""

import pytest

from pipecore import detect, io
from pipecore.resources import resource
from pipecore.simulate import load_truth
from pipecore.simulate.scoring import score


def test_that_all_deformations_of_the_demo_are_found_and_no_other():
    result = detect(io.read(resource("demo", "demo.laz")))
    found = score(result, load_truth(resource("demo", "demo-truth.json")))
    assert found.missed_deformations == ()
    assert found.false_deformations == ()
    assert found.duplicate_deformations == ()
    for match in found.deformations:
        assert match.reported.kind is match.true.kind
        assert match.reported.depth == pytest.approx(match.true.depth, rel=0.08), match.true.kind
    assert found.recall > 0.97
    assert found.precision > 0.98
