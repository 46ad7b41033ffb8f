"""What is scanned: pipe runs, clutter, the stations and their scanner.

A scene is plain frozen data, so that it can be written down, compared and repeated.
Coordinates are local; `Scene.origin` takes them to the world. Lengths are metres;
angles are degrees and say so in their names, as people write scene files.
"""

from dataclasses import dataclass, field
from enum import StrEnum

Vector = tuple[float, float, float]


class DentShape(StrEnum):
    """Form of a dent or bulge over its elliptical footprint."""

    SMOOTH = "smooth"
    """A cosine bell."""
    FLAT = "flat"
    """A flat bottom over half the footprint, straight flanks."""
    SHARP = "sharp"
    """A cone with its tip at the peak."""


@dataclass(frozen=True)
class Dent:
    """A place pushed in; `length` and `width` (around) are those of its whole footprint."""

    chainage: float
    clock_deg: float
    depth: float
    length: float
    width: float
    shape: DentShape = DentShape.SMOOTH


@dataclass(frozen=True)
class Bulge:
    """A place pushed out; the counterpart of `Dent`."""

    chainage: float
    clock_deg: float
    depth: float
    length: float
    width: float
    shape: DentShape = DentShape.SMOOTH


@dataclass(frozen=True)
class Ovality:
    """A stretch with (Dmax - Dmin) / Dnom = `ratio`, its long diameter at `clock_deg`.

    It rises and falls smoothly over `taper` inside both ends of the stretch.
    """

    ratio: float
    clock_deg: float
    chainage_start: float
    chainage_end: float
    taper: float = 0.1


@dataclass(frozen=True)
class Bow:
    """The axis leaves its chord by `sag` in the middle, towards `clock_deg`."""

    sag: float
    clock_deg: float = 180.0


@dataclass(frozen=True)
class Kink:
    """The axis turns by `angle_deg` at `chainage`, which goes off towards `clock_deg`.

    The ends of the piece stay where they are.
    """

    chainage: float
    angle_deg: float
    clock_deg: float = 180.0


DeformationSpec = Dent | Bulge | Ovality | Bow | Kink


@dataclass(frozen=True)
class Straight:
    """A straight pipe."""

    length: float
    deformations: tuple[DeformationSpec, ...] = ()


@dataclass(frozen=True)
class Elbow:
    """A bend by `angle_deg` on `bend_radius`, turning towards the vector `towards`."""

    angle_deg: float
    bend_radius: float
    towards: Vector
    deformations: tuple[Dent | Bulge | Ovality, ...] = ()


@dataclass(frozen=True)
class Reducer:
    """A concentric cone to `radius_end`, with which the run goes on."""

    length: float
    radius_end: float
    deformations: tuple[Dent | Bulge, ...] = ()


@dataclass(frozen=True)
class Flange:
    """A pair of flange discs with a gasket between them and bolts through them."""

    radius: float
    thickness: float
    n_bolts: int = 8


@dataclass(frozen=True)
class Branch:
    """The chain that leaves a tee from the middle of its axis."""

    direction: Vector
    radius: float
    pieces: tuple["Piece", ...]


@dataclass(frozen=True)
class Tee:
    """A tee fitting of `length` along the run, with its branch."""

    length: float
    branch: Branch


@dataclass(frozen=True)
class Sphere:
    """A sphere of `radius` that the run enters and leaves through its centre."""

    radius: float


@dataclass(frozen=True)
class Cap:
    """A domed (ellipsoidal, 2:1) end; as a first or last piece. Other ends are flat."""


Piece = Straight | Elbow | Reducer | Flange | Tee | Sphere | Cap


@dataclass(frozen=True)
class Run:
    """A chain of pieces from `start` towards `direction`; a vessel is a run between caps.

    `radius` is the outside radius at the start; 0 for a sphere that stands alone.
    """

    start: Vector
    direction: Vector
    radius: float
    pieces: tuple[Piece, ...]
    name: str = ""
    material: str = "galvanised"


@dataclass(frozen=True)
class Box:
    """A block: floor slab, wall, post, plinth or cabinet; `centre` is that of its volume."""

    centre: Vector
    size: Vector
    yaw_deg: float = 0.0
    material: str = "concrete"


@dataclass(frozen=True)
class Plate:
    """A thin sheet in any attitude, its edges given as vectors."""

    centre: Vector
    along: Vector
    across: Vector
    thickness: float = 0.002
    material: str = "grey"


@dataclass(frozen=True)
class Beam:
    """An I-beam between two points of the middle of its top, with its web upright."""

    start: Vector
    end: Vector
    height: float = 0.16
    width: float = 0.09
    material: str = "red oxide"


class TrayStyle(StrEnum):
    """How the bottom of a cable tray is made."""

    LADDER = "ladder"
    PERFORATED = "perforated"


@dataclass(frozen=True)
class Tray:
    """A cable tray between two points of the middle of its bottom, with some cables."""

    start: Vector
    end: Vector
    width: float = 0.3
    height: float = 0.06
    style: TrayStyle = TrayStyle.LADDER
    n_cables: int = 4
    material: str = "galvanised"


@dataclass(frozen=True)
class Wire:
    """A thin tube, rod or cable through points."""

    points: tuple[Vector, ...]
    radius: float = 0.005
    material: str = "rubber"


@dataclass(frozen=True)
class Valve:
    """A valve body with bonnet, stem and handwheel; hides the pipe it sits on."""

    centre: Vector
    pipe_direction: Vector
    stem_direction: Vector
    pipe_radius: float
    material: str = "blue"


@dataclass(frozen=True)
class Person:
    """Someone standing in the scan at `foot`."""

    foot: Vector
    height: float = 1.78
    yaw_deg: float = 0.0
    material: str = "orange"


Clutter = Box | Plate | Beam | Tray | Wire | Valve | Person


@dataclass(frozen=True)
class Scanner:
    """How the scanner measures.

    Parameters
    ----------
    spacing : float
        Point spacing asked for on the pipes, across the beam; sets each station's
        angular step from its median distance to them.
    noise : float
        Standard deviation of a range at no distance and perpendicular incidence.
    noise_growth : float
        By what share the noise grows per metre of range.
    incidence_growth : float
        By what share the noise grows per unit of 1/cos(incidence) - 1.
    pointing_deg : float
        Standard deviation of the angles reported against the true ones.
    beam_diameter, beam_divergence : float
        Diameter at the scanner in metres; growth of the diameter per metre of range.
    pulse_length : float
        Surfaces in one beam mix into one range when closer than this; beyond, the
        nearer one is returned.
    dropout : float
        Share of returns lost anywhere; more are lost near grazing incidence and far off.
    max_range : float
    lowest_elevation_deg : float
        The tripod hides what is below.
    registration : float
        Standard deviation of each coordinate of a station's position after
        registration, in metres; its attitude errs by as much at 10 m.
    ambient_rays : int
        Rays per point that darken the colour in corners; 0 leaves it out.
    """

    spacing: float = 0.01
    noise: float = 0.002
    noise_growth: float = 0.01
    incidence_growth: float = 0.1
    pointing_deg: float = 0.002
    beam_diameter: float = 0.004
    beam_divergence: float = 0.0003
    pulse_length: float = 0.5
    dropout: float = 0.003
    max_range: float = 60.0
    lowest_elevation_deg: float = -62.0
    registration: float = 0.0
    ambient_rays: int = 0


@dataclass(frozen=True)
class Scene:
    """Everything that a simulated scan depends on.

    Parameters
    ----------
    runs : tuple of Run
        The pipes.
    stations : tuple of (float, float, float)
        Scanner positions in local coordinates, metres.
    clutter : tuple of Clutter
        What else stands there.
    scanner : Scanner
        Spacing, noise and errors of the scanner.
    origin : (float, float, float)
        World coordinates of the local zero, metres.
    crs : str
        Name of the coordinate reference system, or "".
    seed : int
        Of the scan's errors.
    name : str
    """

    runs: tuple[Run, ...]
    stations: tuple[Vector, ...]
    clutter: tuple[Clutter, ...] = ()
    scanner: Scanner = field(default_factory=Scanner)
    origin: Vector = (0.0, 0.0, 0.0)
    crs: str = ""
    seed: int = 0
    name: str = ""
