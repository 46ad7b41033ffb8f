"""Random plants: plausible, repeatable, and nothing runs through anything."""

import itertools

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pipecore.errors import SceneError
from pipecore.simulate import random_pipe, random_scene
from pipecore.simulate.placing import PlacedElement, place_runs
from pipecore.simulate.scene import Scene
from pipecore.simulate.surface import KIND_OF_SPEC
from pipecore.types import DeformationKind, ElementKind


@pytest.fixture
def plant(seed: int) -> Scene:
    return random_scene(seed % 100_000)


def lateral_points(placed: PlacedElement, step: float) -> np.ndarray:
    length, radius = placed.element.axis.length, placed.element.radius
    chainage, clock = np.meshgrid(
        np.linspace(0.0, length, max(2, int(length / step))),
        np.linspace(0.0, 2 * np.pi, max(8, int(2 * np.pi * radius / step)), endpoint=False),
    )
    return placed.surface.points(chainage.ravel(), clock.ravel())


def test_that_a_seed_gives_one_plant(seed: int) -> None:
    assert random_scene(seed % 1000) == random_scene(seed % 1000)
    assert random_scene(seed % 1000) != random_scene(seed % 1000 + 1)
    assert random_pipe(seed % 1000) == random_pipe(seed % 1000)


def test_that_runs_do_not_penetrate_each_other(plant: Scene) -> None:
    by_run: dict[int, list[PlacedElement]] = {}
    for placed in place_runs(plant).elements:
        by_run.setdefault(placed.element.run_id, []).append(placed)
    points = {
        run: np.concatenate([lateral_points(p, 0.03) for p in elements])
        for run, elements in by_run.items()
    }
    for run, other in itertools.permutations(by_run, 2):
        for placed in by_run[other]:
            element = placed.element
            chainage, rho, clock = element.axis.pipe_coordinates(points[run])
            inside = (chainage > 0) & (chainage < element.axis.length)
            depth = placed.surface.radius(chainage[inside], clock[inside]) - rho[inside]
            # Two bows may lean on each other a little.
            assert depth.max(initial=0.0) < 0.011, (plant.seed, run, other)


def test_that_pipes_touch_and_nearly_touch_in_some_plants() -> None:
    gaps = []
    # Given plants: what is in one plant is chance.
    for k in range(6):
        placement = place_runs(random_scene(k, deformed=False))
        straights = [p for p in placement.elements if p.element.kind is ElementKind.CYLINDER]
        for a, b in itertools.combinations(straights, 2):
            if a.element.run_id == b.element.run_id:
                continue
            s = np.linspace(0, a.element.axis.length, 200)
            t = np.linspace(0, b.element.axis.length, 200)
            distance = cKDTree(b.element.axis.at(t)).query(a.element.axis.at(s))[0].min()
            gaps.append(distance - a.element.radius - b.element.radius)
    gaps = np.array(gaps)
    assert (gaps < 0.003).sum() >= 2
    assert ((gaps > 0.008) & (gaps < 0.014)).sum() >= 1
    assert (gaps > 0.1).sum() > 20


def test_that_plants_hold_all_kinds_of_elements_and_deformations() -> None:
    kinds, deformations, lengths = set(), set(), []
    for k in range(6):
        placement = place_runs(random_scene(k))
        kinds |= {p.element.kind for p in placement.elements}
        deformations |= {d.kind for d in placement.deformations()}
        lengths.append(sum(p.element.axis.length for p in placement.elements))
    assert kinds == set(ElementKind) - {ElementKind.OTHER}
    assert deformations == set(KIND_OF_SPEC.values()) - {DeformationKind.KINK}
    assert min(lengths) > 25.0


def test_that_stations_stand_clear_of_everything(plant: Scene) -> None:
    for station in plant.stations:
        for placed in place_runs(plant).elements:
            distance = np.linalg.norm(lateral_points(placed, 0.1) - station, axis=1).min()
            assert distance > 0.6


def test_that_options_are_kept() -> None:
    bare = random_scene(5, stations=1, deformed=False, clutter=False, spacing=0.02, noise=0.001)
    assert len(bare.stations) == 1
    assert bare.clutter == ()
    assert (bare.scanner.spacing, bare.scanner.noise) == (0.02, 0.001)
    assert place_runs(bare).deformations() == ()
    with pytest.raises(SceneError, match="stations"):
        random_scene(5, stations=9)


@pytest.mark.parametrize("kind", list(KIND_OF_SPEC.values()))
def test_that_a_random_pipe_has_the_deformation_asked_for(kind: DeformationKind, seed: int) -> None:
    scene = random_pipe(seed % 100_000, kind=kind, depth=0.012, ovality=0.05)
    placement = place_runs(scene)
    (deformation,) = placement.deformations()
    assert deformation.kind == kind
    if kind is DeformationKind.OVALITY:
        assert deformation.ovality == 0.05
    else:
        assert deformation.depth == pytest.approx(0.012)
    assert place_runs(random_pipe(seed % 100_000, kind=None)).deformations() == ()
