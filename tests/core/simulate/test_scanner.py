"""Scanning: errors have the size asked for, nothing is seen through things."""

from dataclasses import replace

import numpy as np
import pytest

from pipecore.errors import CancelledError, SceneError
from pipecore.simulate import Scanner, Scene, SimulatedScan, random_pipe, scan
from pipecore.simulate.scene import Box, Bulge, Dent, DentShape, Plate, Run, Straight
from pipecore.types import DeformationKind

IDEAL = Scanner(
    spacing=0.01,
    noise=0.0,
    noise_growth=0.0,
    incidence_growth=0.0,
    pointing_deg=0.0,
    beam_diameter=0.0,
    dropout=0.0,
)
WALL = Box((0.0, 3.0, 1.0), (4.0, 0.1, 4.0))
WALL_FACE = 2.95
PIPE = Run((-1.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.11, (Straight(2.0),))
STATION = (0.1, -3.0, 1.4)


def deviations(simulated: SimulatedScan) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Chainage, clock and radial deviation of the points on the first element."""
    element = simulated.truth.elements[0]
    points = simulated.cloud.xyz[simulated.truth_element == 1].astype(np.float64)
    chainage, rho, clock = element.axis.pipe_coordinates(points)
    return chainage, clock, rho - element.radius


def test_that_an_ideal_scanner_hits_the_surface_itself() -> None:
    _, _, deviation = deviations(scan(Scene((PIPE,), (STATION,), (), IDEAL)))
    assert len(deviation) > 1000
    assert np.abs(deviation).max() < 5e-5
    assert abs(deviation.mean()) < 1e-5


def test_that_spacing_on_the_pipe_is_about_what_was_asked() -> None:
    for spacing in (0.005, 0.01, 0.02):
        scanner = replace(IDEAL, spacing=spacing)
        chainage, clock, _ = deviations(scan(Scene((PIPE,), (STATION,), (), scanner)))
        # Where the surface faces the scanner, near the middle of the pipe.
        facing = np.deg2rad(np.arange(60, 120, 1.0))
        near = (np.abs(chainage - 1.1) < 0.2) & (clock > facing[0]) & (clock < facing[-1])
        area = 0.4 * 0.11 * (facing[-1] - facing[0])
        assert np.sqrt(area / near.sum()) == pytest.approx(spacing, rel=0.15)


def test_that_range_noise_has_the_size_asked_for(seed: int) -> None:
    scanner = replace(IDEAL, noise=0.003)
    simulated = scan(Scene((), (STATION,), (WALL,), scanner, seed=seed))
    xyz = simulated.cloud.xyz.astype(np.float64)
    offset = xyz - STATION
    distance = np.linalg.norm(offset, axis=1)
    true_distance = distance * (WALL_FACE - STATION[1]) / offset[:, 1]
    error = distance - true_distance
    n = len(error)
    assert n > 5000
    assert abs(error.mean()) < 5 * 0.003 / np.sqrt(n)
    assert error.std() == pytest.approx(0.003, rel=5 / np.sqrt(2 * n))


def test_that_noise_grows_with_range_and_incidence(seed: int) -> None:
    def spread(scanner: Scanner, station: tuple[float, float, float]) -> float:
        simulated = scan(Scene((), (station,), (WALL,), scanner, seed=seed))
        offset = simulated.cloud.xyz.astype(np.float64) - station
        distance = np.linalg.norm(offset, axis=1)
        return float(np.std(distance * (1 - (WALL_FACE - station[1]) / offset[:, 1])))

    plain = replace(IDEAL, noise=0.002)
    facing, far, aside = (0.0, -3.0, 1.0), (0.0, -15.0, 1.0), (12.0, 0.0, 1.0)
    growing = replace(plain, noise_growth=0.05)
    assert spread(growing, far) == pytest.approx(0.002 * (1 + 0.05 * 18.0), rel=0.1)
    assert spread(plain, far) == pytest.approx(0.002, rel=0.05)
    tilted = replace(plain, incidence_growth=0.5)
    assert spread(tilted, aside) > 1.5 * spread(tilted, facing)


def test_that_nothing_is_seen_inside_or_behind_what_hides_it() -> None:
    screen = Box((0.0, -1.0, 1.0), (0.6, 0.05, 0.6))
    simulated = scan(Scene((PIPE,), (STATION,), (screen, WALL), replace(IDEAL, noise=0.001)))
    xyz = simulated.cloud.xyz.astype(np.float64)
    axis = simulated.truth.elements[0].axis
    chainage, rho, _ = axis.pipe_coordinates(xyz)
    assert not ((rho < 0.1) & (chainage > 0.01) & (chainage < 1.99)).any()
    # Where the line of sight crosses the screen's face, nothing lies beyond it.
    offset = xyz - STATION
    share = (-1.025 - STATION[1]) / offset[:, 1]
    crossing = STATION + share[:, None] * offset
    is_behind = (share < 0.99) & (np.abs(crossing[:, 0]) < 0.29)
    is_behind &= np.abs(crossing[:, 2] - 1.0) < 0.29
    assert not is_behind.any()


def test_that_beams_on_edges_mix_foreground_and_background() -> None:
    # The plate's edge stands 0.3 m before a wall; some ranges must fall between.
    plate = Plate((0.0, 2.65, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    scene = Scene((), ((0.0, -1.0, 1.0),), (plate, WALL), replace(IDEAL, beam_diameter=0.006))
    y = scan(scene).cloud.xyz[:, 1]
    between = (y > 2.66) & (y < WALL_FACE - 0.01)
    assert between.sum() > 30
    sharp = scan(replace(scene, scanner=IDEAL)).cloud.xyz[:, 1]
    assert not ((sharp > 2.66) & (sharp < WALL_FACE - 0.01)).any()


def test_that_mixed_points_belong_to_no_element(seed: int) -> None:
    behind = Box((0.0, 0.4, 1.0), (4.0, 0.1, 4.0))
    scanner = replace(IDEAL, beam_diameter=0.006)
    _, _, deviation = deviations(scan(Scene((PIPE,), (STATION,), (behind,), scanner, seed=seed)))
    assert np.abs(deviation).max() < 0.0015


def test_that_returns_are_lost_at_grazing_incidence() -> None:
    _, clock, _ = deviations(scan(Scene((PIPE,), ((0.0, -30.0, 1.0),), (), IDEAL)))
    seen = np.mod(clock + np.pi, 2 * np.pi)
    assert np.rad2deg(seen.max() - seen.min()) < 176


@pytest.mark.parametrize("shape", list(DentShape))
@pytest.mark.parametrize(("kind", "sign"), [(Dent, -1), (Bulge, 1)])
def test_that_a_noiseless_scan_shows_the_depth_of_the_truth(kind, sign: int, shape) -> None:
    # Clock 90 of this pipe faces the station.
    spec = kind(1.1, 90.0, 0.015, 0.2, 0.16, shape)
    run = replace(PIPE, pieces=(Straight(2.0, (spec,)),))
    simulated = scan(Scene((run,), (STATION,), (), replace(IDEAL, spacing=0.003)))
    (true,) = simulated.truth.deformations
    assert true.kind == (DeformationKind.DENT if sign < 0 else DeformationKind.BULGE)
    chainage, clock, deviation = deviations(simulated)
    around = 0.11 * np.abs(clock - true.clock)
    at_peak = np.hypot(chainage - true.chainage, around) < 0.004
    reached = (sign * deviation[at_peak]).max()
    # A cone loses by its slope what the nearest point is off its tip.
    slack = 0.0004 if shape is not DentShape.SHARP else 0.004 * 0.015 / 0.08
    assert true.depth - slack < reached < true.depth + 1e-4
    outside = (np.abs(chainage - true.chainage) > 0.1) | (around > 0.08)
    assert np.abs(deviation[outside]).max() < 5e-5
    assert true.seen > 0.95


def test_that_the_same_scene_gives_the_same_scan(seed: int) -> None:
    scene = random_pipe(seed % 100_000, spacing=0.02)
    one, again = scan(scene), scan(scene)
    other = scan(replace(scene, seed=scene.seed + 1))
    assert np.array_equal(one.cloud.xyz, again.cloud.xyz)
    assert np.array_equal(one.cloud.rgb, again.cloud.rgb)
    assert np.array_equal(one.truth_element, again.truth_element)
    assert not np.array_equal(one.cloud.xyz[:100], other.cloud.xyz[:100])


def test_that_a_registration_error_moves_whole_stations(seed: int) -> None:
    scanner = replace(IDEAL, registration=0.01)
    scene = Scene((), ((0.0, -1.0, 1.0), (0.5, -1.0, 1.0)), (WALL,), scanner, seed=seed)
    simulated = scan(scene)
    y = simulated.cloud.xyz[:, 1].astype(np.float64)
    for station in (0, 1):
        mine = y[simulated.station == station]
        # A plane stays a plane: turned by milliradians, moved by centimetres.
        assert 1e-5 < abs(np.median(mine) - WALL_FACE) < 0.08
        assert mine.std() < 0.02


def test_that_a_cancelled_scan_stops() -> None:
    class Impatient:
        def update(self, stage: str, fraction: float) -> None:
            raise CancelledError

    with pytest.raises(CancelledError):
        scan(Scene((PIPE,), (STATION,), (), IDEAL), progress=Impatient())


def test_that_a_scan_of_nothing_is_refused() -> None:
    with pytest.raises(SceneError, match="station"):
        scan(Scene((PIPE,), ()))
    with pytest.raises(SceneError, match="Nothing"):
        scan(Scene((PIPE,), (STATION,), (), replace(IDEAL, max_range=1.0)))
