"""What the user works on: scans, results, selection and view options, all immutable.

A command takes a `Document` and returns the next one; undo is going back to an
earlier one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

from pipecore.settings import InputSettings, Settings
from pipecore.types import NO_ID, OWN_STACK, PointCloud, Result, Review
from pipegui.model.fingerprint import Fingerprint


class Choice(StrEnum):
    """What the user chooses in the window: values are what is shown, files keep the names."""

    @classmethod
    def _missing_(cls, value: object) -> "Choice | None":
        return cls.__members__.get(str(value).upper())


class ColourBy(Choice):
    """What points are coloured by."""

    SEGMENT = "Segment"
    ELEMENT = "Element"
    KIND = "Kind"
    DEVIATION = "Deviation"
    HEIGHT = "Height"
    INTENSITY = "Intensity"
    RGB = "RGB"
    PROFILE = "Profiles of a stack"
    VERDICT = "Verdict"
    STATION = "Station"


class Background(Choice):
    """Background of the 3D view."""

    SYSTEM = "System"
    LIGHT = "Light"
    DARK = "Dark"
    WHITE = "White"
    BLACK = "Black"

    @classmethod
    def _missing_(cls, value: object) -> Choice | None:
        # As projects of version 0.1 have it.
        return cls.SYSTEM if value == "As the system" else super()._missing_(value)


class Tool(Choice):
    """What a click into the 3D view does."""

    SELECT = "Select"
    MEASURE = "Measure"
    COORDINATES = "Coordinates"


Point = tuple[float, float, float]
Limits = tuple[float, float]
"""The low and the high end of a range."""


@dataclass(frozen=True)
class Measurement:
    """One point whose coordinates were asked for, or two with the distance between them.

    Local coordinates of the active scan, metres.
    """

    start: Point
    end: Point | None = None


@dataclass(frozen=True)
class ProfileKey:
    """One profile of the selected element."""

    stack_id: int
    profile_index: int


@dataclass(frozen=True)
class Selection:
    """What is selected, with what contains it.

    A selected profile or deformation implies its element; a selected element its run.
    """

    run_id: int = NO_ID
    element_id: int = NO_ID
    deformation_id: int = NO_ID
    profile: ProfileKey | None = None
    others: frozenset[int] = frozenset()
    """More elements, for edits of several; plots and properties show `element_id`."""
    candidate_id: int = NO_ID
    """What was nearly accepted; then nothing else is selected."""

    @property
    def lead(self) -> "Selection":
        """The selection without the others."""
        return replace(self, others=frozenset())

    def parent(self) -> "Selection":
        """What Esc goes to: profile → deformation → element → run → nothing."""
        if self.others:
            return replace(self, others=frozenset())
        if self.profile is not None:
            return replace(self, profile=None)
        if self.deformation_id:
            return replace(self, deformation_id=NO_ID)
        if self.element_id:
            return replace(self, element_id=NO_ID)
        return Selection()


@dataclass(frozen=True)
class ClipBox:
    """An upright box in the local coordinates of the active scan, metres."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    is_inverted: bool = False
    """Whether what lies outside is meant, not what lies within."""


@dataclass(frozen=True)
class ViewOptions:
    """How things are shown."""

    colour_by: ColourBy = ColourBy.RGB
    deviation_limit_mm: float = 10.0
    hidden_elements: frozenset[int] = frozenset()
    show_points: bool = True
    show_axes: bool = True
    show_ellipses: bool = False
    show_surfaces: bool = False
    show_labels: bool = True
    shown_stack: int = NO_ID
    """The stack whose profiles are shown in colour, with `ColourBy.PROFILE`."""
    plot_stack: int = OWN_STACK
    """The stack that the radius plot shows while no profile is selected."""
    pinned_elements: tuple[int, ...] = ()
    """Elements that stay in the radius plot."""
    fly: bool = True
    clip_box: ClipBox | None = None
    """Only what lies within is shown, or without if it is inverted."""
    shown_profile: int | None = None
    """The one profile of `shown_stack` that is shown in colour; None: all."""
    point_size: float = 1.0
    """Times the size that suits the points' spacing."""
    is_parallel: bool = False
    """Whether the 3D view is drawn without perspective."""
    eye_dome: bool | None = None
    """Whether steps in depth are shaded; None: where the hardware draws that fast."""
    background: Background = Background.SYSTEM
    tool: Tool = Tool.SELECT
    measurements: tuple[Measurement, ...] = ()
    measuring_from: Point | None = None
    """The first of two points, while the second is still to be picked."""
    height_limits: Limits | None = None
    """Local heights at the ends of the colours, metres; None: the range of nearly all points."""
    intensity_limits: Limits | None = None
    """The same for intensities."""
    hidden_stations: frozenset[int] = frozenset()
    show_stations: bool = True
    """Whether it is marked where the scanner stood."""


@dataclass(frozen=True, eq=False)
class Scan:
    """A cloud with the result of its last detection, if any, and a person's reviews of it."""

    name: str
    cloud: PointCloud
    result: Result | None = None
    reviews: Mapping[int, Review] = field(default_factory=dict)
    """By the ids of the deformations; those without a review are not in it."""

    reading: InputSettings = field(default_factory=InputSettings)
    """Settings with which it was read."""

    fingerprint: Fingerprint | None = None
    """Of the file when the cloud was read, if it was taken."""

    others: tuple[Path, ...] = ()
    """More files of the same cloud, besides its source."""

    is_text: bool = False
    """Whether it was read from text."""

    guessed_columns: str = ""
    """What the columns of a text file were taken for, where nothing in it says so."""

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that the cloud was read from."""
        return () if self.cloud.source is None else (self.cloud.source, *self.others)

    def review(self, deformation_id: int) -> Review:
        """Return the review of a deformation, an open one if there is none."""
        return self.reviews.get(deformation_id, Review())


@dataclass(frozen=True, eq=False)
class Document:
    """All of the user's work."""

    scans: tuple[Scan, ...] = ()
    active: int = 0
    settings: Settings = field(default_factory=Settings)
    selection: Selection = Selection()
    view: ViewOptions = ViewOptions()

    @property
    def scan(self) -> Scan | None:
        """The active scan."""
        return self.scans[self.active] if self.scans else None

    @property
    def detection_settings(self) -> Settings:
        """The settings for a detection on the active scan: with those it was read with."""
        return replace(self.settings, input=self.scan.reading) if self.scan else self.settings

    @property
    def result(self) -> Result | None:
        """The result of the active scan."""
        return self.scan.result if self.scan else None
