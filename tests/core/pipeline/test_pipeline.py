"""The whole detection on small simulated plants, on odd clouds, and on a real scan."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore import parallel
from pipecore.elements.refinement.sampled_fits import MAX_FIT_POINTS
from pipecore.errors import CancelledError, SettingsError
from pipecore.geometry import LineAxis
from pipecore.io import read
from pipecore.pipeline import STAGES, detect
from pipecore.settings import Settings
from pipecore.simulate import Scanner, Scene, SimulatedScan, scan
from pipecore.simulate.scene import Box, Elbow, Flange, Reducer, Run, Straight
from pipecore.simulate.scoring import score
from pipecore.types import NO_ID, ElementKind, PointCloud, Result
from tests.core.shapes import cloud_of, plane, random_rotation, tube

ORIGIN = (432_100.0, 6_201_870.0, 110.0)
RADIUS, RADIUS_END = 0.084, 0.057


def plant(seed: int) -> Scene:
    """One run with a bend and a reducer, a floor, a wall behind and a post touching the run."""
    rng = np.random.default_rng(seed)
    length, height = rng.uniform(1.0, 1.4), rng.uniform(0.7, 1.2)
    run = Run(
        (0.0, 0.0, height),
        (1.0, 0.0, 0.0),
        RADIUS,
        (
            Straight(length),
            Elbow(90.0, 0.25, (0.0, rng.choice([-1.0, 1.0]), 0.0)),
            Straight(0.5),
            Reducer(0.2, RADIUS_END),
            Straight(0.8),
        ),
    )
    post_height = height - RADIUS
    return Scene(
        (run,),
        ((0.3, -2.8, 1.4), (3.4, 0.5, 1.8), (0.2, 2.6, 2.0)),
        (
            Box((0.8, 0.0, -0.05), (5.0, 5.0, 0.1)),
            Box((0.5, 0.0, post_height / 2), (0.1, 0.1, post_height)),
        ),
        Scanner(spacing=0.012, noise=0.0015),
        ORIGIN,
        seed=seed,
    )


@pytest.fixture(scope="module")
def simulated(session_seed) -> SimulatedScan:
    return scan(plant(session_seed))


@pytest.fixture(scope="module")
def result(simulated) -> Result:
    return detect(simulated.cloud)


class StopAt:
    """Cancels once a stage has begun."""

    def __init__(self, stage: str) -> None:
        self.stage = stage

    def update(self, stage: str, fraction: float) -> None:
        if stage == self.stage:
            raise CancelledError


def assert_same(a: Result, b: Result) -> None:
    """Bit for bit."""
    assert len(a.elements) == len(b.elements) > 0
    for x, y in zip(a.elements, b.elements, strict=True):
        assert (x.kind, x.run_id, x.n_points, x.n_profiles) == (
            y.kind,
            y.run_id,
            y.n_points,
            y.n_profiles,
        )
        assert_array_equal([x.radius, x.radius_sd, x.rms, x.ovality], [
            y.radius, y.radius_sd, y.rms, y.ovality,
        ])  # fmt: skip
        assert_array_equal(x.axis.start, y.axis.start)
        assert_array_equal(x.axis.end, y.axis.end)
    assert len(a.deformations) == len(b.deformations)


def test_that_a_run_is_found_with_its_kinds_and_radii(simulated, result):
    figures = score(result, simulated.truth)
    print(figures)
    assert figures.recall > 0.85
    assert figures.precision > 0.95
    assert figures.kind_share() == 1.0
    assert figures.median_axis_error < 0.001
    for element in result.elements:
        if element.kind in (ElementKind.CYLINDER, ElementKind.TORUS):
            off = min(abs(element.radius - r) for r in (RADIUS, RADIUS_END))
            assert off < max(3 * element.radius_sd, 0.0005)
    assert {e.run_id for e in result.elements} == {1}
    assert sorted(e.kind for e in result.elements) == sorted(
        [ElementKind.CYLINDER] * 3 + [ElementKind.TORUS, ElementKind.CONE]
    )


def test_that_elements_are_where_they_were_built_in_world_coordinates(simulated, result):
    built = simulated.truth.elements[0].axis
    # Of its first straight the scene says: from x = 0 along +X, in front of the origin.
    assert_allclose(built.start + simulated.truth.origin - ORIGIN, [0.0, 0.0, built.start[2]])
    start = built.start + simulated.truth.origin
    assert np.hypot(*result.origin[:2]) > 1e6
    ends = [end + result.origin for e in result.elements for end in (e.axis.start, e.axis.end)]
    # The scan shows the pipe's end to within its spacing and a downsampled point.
    assert np.linalg.norm(np.array(ends) - start, axis=1).min() < 0.03


def test_that_points_and_their_elements_belong_together(simulated, result):
    assert len(result.element_id) == len(result.segment_id) == len(simulated.cloud)
    for element in result.elements:
        own = result.element_id == element.element_id
        assert own.sum() > 100
        _, rho, _ = element.axis.pipe_coordinates(simulated.cloud.xyz[own].astype(float))
        assert np.median(np.abs(result.deviation[own])) < 0.003
        assert np.median(rho) < 1.3 * max(element.radius, element.radius_end)
    assert np.isnan(result.deviation[result.element_id == NO_ID]).all()


def test_that_any_number_of_threads_gives_the_same_bits(simulated, result):
    before = parallel.threads()
    try:
        parallel.set_threads(1 if before > 1 else 2)
        assert_same(detect(simulated.cloud), result)
    finally:
        parallel.set_threads(before)


def test_that_shuffled_points_give_the_same_elements(simulated, result, rng):
    cloud = simulated.cloud
    shuffled = rng.permutation(len(cloud))
    again = detect(PointCloud(cloud.origin, np.ascontiguousarray(cloud.xyz[shuffled])))
    assert_same(again, result)
    same = again.segment_id == result.segment_id[shuffled]
    assert same.all()


def test_that_elements_of_very_many_points_do_not_depend_on_threads_or_order(rng):
    # More points than an element is fitted to: the sample of them must not depend on either.
    axis = LineAxis(np.zeros(3), random_rotation(rng)[0], 0.8)
    cloud = cloud_of(tube(rng, axis, 0.09, spacing=0.002, noise=0.001))
    assert len(cloud) > 1.5 * MAX_FIT_POINTS
    settings = Settings().replace({"thinning.voxel_mm": 8.0})
    result = detect(cloud, settings)
    assert max(e.n_points for e in result.elements) > MAX_FIT_POINTS
    shuffled = rng.permutation(len(cloud))
    mixed = PointCloud(cloud.origin, np.ascontiguousarray(cloud.xyz[shuffled]))
    assert_same(detect(mixed, settings), result)
    before = parallel.threads()
    try:
        parallel.set_threads(1 if before > 1 else 2)
        assert_same(detect(cloud, settings), result)
    finally:
        parallel.set_threads(before)


def small_pipe(rng) -> PointCloud:
    d = random_rotation(rng)[0]
    return cloud_of(tube(rng, LineAxis(np.zeros(3), d, 0.6), 0.08, noise=0.001))


@pytest.mark.parametrize("stage", list(STAGES))
def test_that_a_detection_can_be_cancelled_in_every_stage(rng, stage):
    with pytest.raises(CancelledError):
        detect(small_pipe(rng), progress=StopAt(stage))


def test_that_progress_runs_through_the_stages_in_their_order(rng):
    told = []

    class Listener:
        def update(self, stage, fraction):
            told.append((stage, fraction))

    detect(small_pipe(rng), progress=Listener())
    assert list(dict.fromkeys(stage for stage, _ in told)) == list(STAGES)
    assert all(0.0 <= fraction <= 1.0 for _, fraction in told)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 7, 30])
def test_that_a_tiny_cloud_has_no_elements(rng, n):
    result = detect(PointCloud(np.array(ORIGIN), rng.uniform(0, 0.3, (n, 3))))
    assert result.elements == ()
    assert len(result.profiles.chainage) == 0
    assert len(result.element_id) == n


@pytest.mark.parametrize("kind", ["one place", "line", "noise"])
def test_that_points_without_a_surface_have_no_elements(rng, kind):
    xyz = {
        "one place": np.zeros((500, 3)),
        "line": np.outer(np.linspace(0, 1, 500), [1.0, 2.0, 3.0]),
        "noise": rng.uniform(0, 1, (3000, 3)),
    }[kind]
    assert detect(PointCloud(np.array(ORIGIN), xyz)).elements == ()


def test_that_a_plane_has_no_elements(rng):
    q = random_rotation(rng)
    wall = plane(rng, np.zeros(3), 1.5 * q[0], 1.0 * q[1], noise=0.002)
    assert detect(cloud_of(wall)).elements == ()


def test_that_a_box_has_no_elements(rng):
    q = random_rotation(rng)
    size = np.array([0.25, 0.3, 0.8])
    sides = [
        plane(rng, corner, size[i] * q[i], size[j] * q[j], noise=0.001)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        for corner in (np.zeros(3), size[k] * q[k])
    ]
    assert detect(cloud_of(*sides)).elements == ()


def test_that_asking_for_no_stacks_is_an_error_that_says_so(rng):
    settings = Settings().replace({"stacks.preset": "none"})
    with pytest.raises(SettingsError, match="no stacks"):
        detect(small_pipe(rng), settings)


def test_that_own_stacks_alone_are_enough(rng):
    settings = Settings().replace({"stacks.preset": "none", "stacks.directions": "1,2,3"})
    result = detect(small_pipe(rng), settings)
    names = [s.name for s in result.stacks]
    assert names[0] == "(0.27, 0.53, 0.80)"
    assert all(name.startswith(names[0]) for name in names)


def pump(seed: int) -> Scene:
    """A pump as the real one: one station, short pipes between flanges, vessels seen over 70°."""
    along = (-0.61, -0.79, 0.0)
    flange = Flange(0.14, 0.04)
    risers = [
        Run(foot, (0.0, 0.0, 1.0), 0.088, (flange, Straight(0.94), flange))
        for foot in ((-1.1, -1.95, 0.1), (0.35, -3.5, 0.1))
    ]
    header = Run((-0.25, -3.01, 1.55), along, 0.115, (Flange(0.17, 0.06), Straight(1.7)))
    vessels = [
        Run(end, along, 0.375, (Straight(0.7),))
        for end in ((0.8, -3.48, -1.08), (-0.91, -2.2, -1.08))
    ]
    small = [
        Run((-0.52 - 0.1 * i, -2.49, 1.35), along, radius, (Straight(2.0),))
        for i, radius in enumerate((0.031, 0.022))
    ]
    return Scene(
        (*risers, header, *vessels, *small),
        ((0.0, 0.0, 0.0),),
        (Box((-0.5, -3.0, -1.8), (4.6, 4.5, 0.1)),),
        Scanner(spacing=0.012, noise=0.0015),
        ORIGIN,
        seed=seed,
    )


def assert_that_it_has_the_sizes_of_the_pump(result: Result) -> None:
    pipes = [e for e in result.elements if e.kind is ElementKind.CYLINDER]
    upright = [e for e in pipes if abs(e.axis.tangent(0.0)[2]) > 0.97]
    assert sum(abs(e.radius - 0.088) < 0.003 for e in upright) >= 2
    assert any(abs(e.radius - 0.115) < 0.003 for e in pipes)
    assert sum(abs(e.radius - 0.375) < 0.003 for e in pipes) >= 2


def test_that_the_pipes_of_a_real_pump_have_their_sizes(shared_data):
    assert_that_it_has_the_sizes_of_the_pump(detect(read(shared_data / "pump_visual_ref.e57")))


def test_that_the_pipes_of_a_pump_seen_from_one_station_have_their_sizes(session_seed):
    assert_that_it_has_the_sizes_of_the_pump(detect(scan(pump(session_seed)).cloud))
