"""One random pipe with one deformation, seen over a given arc: for studies of measures."""

from dataclasses import replace

import numpy as np

from pipecore.errors import SceneError
from pipecore.geometry import Array, Axis, surface_points, unit
from pipecore.simulate.placing import place_runs
from pipecore.simulate.scene import (
    Bow,
    Bulge,
    DeformationSpec,
    Dent,
    DentShape,
    Kink,
    Ovality,
    Plate,
    Run,
    Scanner,
    Scene,
    Straight,
    Vector,
)
from pipecore.simulate.sizes import SIZES
from pipecore.types import DeformationKind

STATION_DISTANCE = 4.0
HALF_VIEW = np.deg2rad(76.0)
"""Half the arc that one station sees well from afar; returns at more grazing rays are rare."""


def random_pipe(
    seed: int,
    *,
    kind: DeformationKind | None = DeformationKind.DENT,
    arc_deg: float = 150.0,
    radius: float | None = None,
    depth: float | None = None,
    extent: float | None = None,
    shape: DentShape | None = None,
    ovality: float | None = None,
    length: float = 2.0,
    spacing: float = 0.01,
    noise: float = 0.002,
    scanner: Scanner | None = None,
) -> Scene:
    """Return one straight pipe in a random direction with one deformation in the seen arc.

    What is None is drawn at random. The arc is reached with one screened station, one
    free station (about 150°), two or three.

    Parameters
    ----------
    seed : int
    kind : DeformationKind, optional
        One that scenes have (`KIND_OF_SPEC`); None for a clean pipe.
    arc_deg : float
        Arc that is seen, 60 to 360°.
    radius : float, optional
        Else that of a size from DN 80 to DN 400.
    depth : float, optional
        Of a dent or bulge, sag of a bow, offset of a kink; else 5 to 25 mm.
    extent : float, optional
        Length and width of a dent or bulge in outside diameters; else 0.5 to 1 each.
    shape : DentShape, optional
    ovality : float, optional
        As a ratio, over 1 m; else 0.02 to 0.08.
    length : float
        Of the pipe, metres.
    spacing, noise : float
        Here the noise is the same at all ranges and incidences.
    scanner : Scanner, optional
        All other properties of the scanner.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        If the arc is out of its bounds, or the pipe cannot have the deformation.
    """
    if not 60 <= arc_deg <= 360:
        raise SceneError(f"A pipe can be seen over 60 to 360°, not {arc_deg:g}°.")
    rng = np.random.default_rng(seed)
    sizes = [s.radius for s in SIZES if s.dn >= 80]
    radius = float(rng.choice(sizes)) if radius is None else radius
    direction = unit(rng.standard_normal(3))
    start = -length / 2 * direction
    # The stations look from around this clock angle, which becomes the middle of the arc.
    facing = float(rng.uniform(0.0, 2 * np.pi))
    arc = np.deg2rad(arc_deg)
    spec: DeformationSpec | None = None
    if kind is not None:
        depth = float(rng.uniform(0.005, 0.025)) if depth is None else depth
        extents = rng.uniform(0.5, 1.0, 2) if extent is None else np.full(2, extent)
        # Keep the middle of the deformation well inside the arc.
        aside = max(0.0, arc / 2 - extents[1] - np.deg2rad(20.0))
        clock_deg = float(np.rad2deg(facing + rng.uniform(-aside, aside)) % 360)
        if shape is None:
            shape = list(DentShape)[rng.integers(3)]
        ratio = float(rng.uniform(0.02, 0.08)) if ovality is None else ovality
        chainage = length / 2 + float(rng.uniform(-0.1, 0.1)) * length
        along, around = (float(e) for e in 2 * radius * extents)
        if kind is DeformationKind.DENT:
            spec = Dent(chainage, clock_deg, depth, along, around, shape)
        elif kind is DeformationKind.BULGE:
            spec = Bulge(chainage, clock_deg, depth, along, around, shape)
        elif kind is DeformationKind.OVALITY:
            half = min(0.5, 0.45 * length)
            spec = Ovality(ratio, clock_deg, length / 2 - half, length / 2 + half)
        elif kind is DeformationKind.BOW:
            spec = Bow(depth, clock_deg)
        elif kind is DeformationKind.KINK:
            angle = np.arctan(depth * length / (chainage * (length - chainage)))
            spec = Kink(chainage, float(np.rad2deg(angle)), clock_deg)
        else:
            raise SceneError(f"A scene’s pipe cannot have the deformation “{kind}”.")
    run = Run(
        _vector(start),
        _vector(direction),
        radius,
        (Straight(length, () if spec is None else (spec,)),),
        f"pipe {seed}",
    )
    stations, plates = _viewpoints(run, facing, arc)
    base = scanner or Scanner(noise_growth=0.0, incidence_growth=0.0, dropout=0.0)
    return Scene(
        (run,),
        stations,
        plates,
        replace(base, spacing=spacing, noise=noise, lowest_elevation_deg=-90.0),
        seed=seed,
        name=run.name,
    )


def _vector(values: Array) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z


def _viewpoints(
    run: Run, facing: float, arc: float
) -> tuple[tuple[Vector, ...], tuple[Plate, ...]]:
    """Stations that together see `arc` of the run about the clock angle `facing`."""
    axis = place_runs(Scene((run,), ())).elements[0].element.axis
    # From a finite distance a little less than half the pipe is seen.
    half_view = HALF_VIEW - np.arcsin(run.radius / STATION_DISTANCE)
    plates: tuple[Plate, ...] = ()
    if arc <= 2 * half_view:
        last = arc - half_view
        clocks = np.array([facing - (last - half_view) / 2])
        plates = (_screen(axis, run.radius, float(clocks[0]), last),)
    elif arc <= 4 * half_view:
        clocks = facing + (arc / 2 - half_view) * np.array([-1.0, 1.0])
    else:
        clocks = facing + np.deg2rad([0.0, 120.0, 240.0])
    middle = np.full(len(clocks), axis.length / 2)
    stations = surface_points(axis, middle, STATION_DISTANCE, clocks)
    return tuple(_vector(p) for p in stations), plates


def _screen(axis: Axis, radius: float, clock: float, last: float) -> Plate:
    """A plate that hides the pipe beyond `last` past the clock angle of the station."""
    up, right = axis.frame(axis.length / 2)
    towards = np.cos(clock) * up + np.sin(clock) * right
    aside = np.cos(clock) * right - np.sin(clock) * up
    height, width = radius + 0.3, 2 * radius + 0.1
    scale = (STATION_DISTANCE - height) / (STATION_DISTANCE - radius * np.cos(last))
    centre = axis.at(axis.length / 2) + height * towards
    centre = centre + (radius * np.sin(last) * scale + width / 2) * aside
    along = 1.5 * axis.length * axis.tangent(0.0)
    return Plate(_vector(centre), _vector(along), _vector(width * aside))
