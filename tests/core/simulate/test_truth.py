"""Truth: what was seen of it, and its way through a file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipecore.errors import ReadError
from pipecore.geometry import ArcAxis
from pipecore.simulate import Scene, load_truth, random_pipe, scan
from pipecore.simulate.scene import (
    Box,
    Dent,
    Elbow,
    Flange,
    Ovality,
    Reducer,
    Run,
    Scanner,
    Sphere,
    Straight,
)

ORIGIN = (432_105.0, 6_201_877.0, 112.0)
RUN = Run(
    (-1.5, 0.0, 1.0),
    (1.0, 0.0, 0.0),
    0.1,
    (
        Straight(1.0, (Dent(0.5, 90.0, 0.01, 0.2, 0.15),)),
        Elbow(90.0, 0.3, (0.0, 1.0, 0.0)),
        Flange(0.2, 0.02),
        Straight(1.2, (Ovality(0.05, 0.0, 0.1, 1.1),)),
        Reducer(0.2, 0.06),
        Sphere(0.2),
    ),
    "line 7",
)


def test_that_truth_survives_its_file_in_world_coordinates(tmp_path: Path) -> None:
    scene = Scene((RUN,), ((0.0, -3.0, 1.5),), (), Scanner(spacing=0.02), ORIGIN)
    simulated = scan(scene)
    simulated.write_truth(tmp_path / "truth.json")
    read = load_truth(tmp_path / "truth.json")
    assert "432104" in (tmp_path / "truth.json").read_text(encoding="utf-8")
    assert len(read.elements) == len(simulated.truth.elements) == 6
    for a, b in zip(simulated.truth.elements, read.elements, strict=True):
        assert a.kind == b.kind
        assert a.run_name == b.run_name == "line 7"
        assert (a.radius, a.radius_end) == (b.radius, b.radius_end)
        s = np.linspace(0.0, a.axis.length, 7)
        assert np.abs(a.axis.at(s) - b.axis.at(s)).max() < 2e-6
        assert isinstance(a.axis, ArcAxis) == isinstance(b.axis, ArcAxis)
        assert np.allclose(a.visible_ranges(), b.visible_ranges())
    for d, e in zip(simulated.truth.deformations, read.deformations, strict=True):
        assert np.abs(d.peak - e.peak).max() < 2e-6
        assert np.isnan(d.ovality) == np.isnan(e.ovality)
        assert replace(d, peak=e.peak, ovality=0, angle=0, seen=0, clock=0) == replace(
            e, ovality=0, angle=0, seen=0, clock=0
        ) or (d.depth, d.length, d.width, d.kind) == (e.depth, e.length, e.width, e.kind)


def test_that_a_broken_truth_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "truth.json"
    path.write_text("{}", encoding="utf-8")
    with pytest.raises(ReadError, match=r"truth\.json"):
        load_truth(path)


@pytest.mark.parametrize("arc_deg", [90.0, 120.0, 150.0, 220.0, 360.0])
def test_that_a_pipe_is_seen_over_the_arc_asked_for(arc_deg: float, seed: int) -> None:
    scene = random_pipe(seed % 100_000, kind=None, arc_deg=arc_deg, radius=0.11)
    (element,) = scan(scene).truth.elements
    assert np.rad2deg(np.median(element.arc_seen)) == pytest.approx(arc_deg, abs=14.0)


def test_that_what_is_hidden_is_not_visible() -> None:
    pipe = Run((-1.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.1, (Straight(2.0),))
    hidden = Run((-1.0, 2.0, 1.0), (1.0, 0.0, 0.0), 0.05, (Straight(2.0),))
    wall = Box((0.0, 1.0, 1.0), (6.0, 0.1, 6.0))
    post = Box((0.0, -0.3, 1.0), (0.4, 0.1, 2.0))
    simulated = scan(Scene((pipe, hidden), ((0.0, -3.0, 1.0),), (wall, post)))
    seen, unseen = simulated.truth.elements
    assert unseen.visible_ranges() == ()
    (first, second) = seen.visible_ranges()
    # The post's shadow on the pipe's front, 2.9 m away, is 0.4 × 2.9 / 2.65 wide at least.
    assert first[0] == 0.0
    assert second[1] == pytest.approx(2.0)
    assert 0.36 < second[0] - first[1] < 0.52
    assert not seen.is_visible(np.array([1.0]))[0]
    assert seen.is_visible(np.array([0.3]))[0]


def test_that_a_dent_on_the_far_side_is_not_seen() -> None:
    def seen_share(clock_deg: float) -> float:
        dent = Dent(1.0, clock_deg, 0.01, 0.2, 0.1)
        run = Run((-1.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.1, (Straight(2.0, (dent,)),))
        (deformation,) = scan(Scene((run,), ((0.0, -3.0, 1.0),))).truth.deformations
        return deformation.seen

    assert seen_share(90.0) > 0.95
    assert seen_share(270.0) == 0.0
    assert 0.2 < seen_share(25.0) < 0.9
