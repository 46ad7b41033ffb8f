"""What each part of the window shows: `resolve` turns a document into frozen states.

One class per consumer. A consumer's state equals the one before if nothing that it
shows has changed; then nobody bothers the consumer. Arrays, clouds and results are
compared by identity, so cuts out of a result are made once and kept.
Nothing here knows Qt or VTK.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.inspection.points import ElementPoints
from pipecore.inspection.section import Section, cut_section
from pipecore.rules import DentLimit
from pipecore.settings import ProfileSettings, Settings, StackSettings
from pipecore.types import (
    NO_ID,
    OWN_STACK,
    Deformation,
    Element,
    PointCloud,
    Profiles,
    Result,
    Review,
    Stack,
)
from pipegui.model import colour_limits, result_queries
from pipegui.model.cache import cached_with_owner
from pipegui.model.document import (
    ClipBox,
    ColourBy,
    Document,
    Limits,
    Measurement,
    ProfileKey,
    Scan,
    Selection,
    ViewOptions,
)
from pipegui.model.selection import shown_profile
from pipegui.states.preview_state import PlanningState

Array = NDArray[np.float64]

NO_PROFILES = Profiles.empty()
NO_INDICES = np.empty(0, np.int32)
NO_POINTS = np.empty((0, 3))
NO_ELEMENT_POINTS = ElementPoints(np.empty(0, np.intp), *np.empty((4, 0)))


class _ComparedByParts:
    """Equality that takes arrays by identity and everything else by value."""

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return False
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))  # type: ignore[arg-type]
        return all(a is b or (not isinstance(a, np.ndarray) and a == b) for a, b in pairs)

    def __hash__(self) -> int:
        return hash(type(self))


@dataclass(frozen=True, eq=False)
class SceneState(_ComparedByParts):
    """The parts of the document that the 3D view shows.

    `scan_key` differs between scans: a new one is fitted into the view. `profile` is
    the selected profile as a table of one row, or None; `profile_xyz` are its points,
    shape (n, 3).
    """

    scan_key: str = ""
    cloud: PointCloud | None = None
    result: Result | None = None
    selection: Selection = Selection()
    view: ViewOptions = ViewOptions()
    profile: Profiles | None = None
    profile_xyz: Array = field(default_factory=lambda: NO_POINTS)


@dataclass(frozen=True, eq=False)
class Pinned(_ComparedByParts):
    """An element that stays in the radius plot, with the profiles shown of it."""

    element: Element
    profiles: Profiles


@dataclass(frozen=True, eq=False)
class RadiusPlotState(_ComparedByParts):
    """The radius-against-profile plot of the selected element.

    Parameters
    ----------
    element : Element, optional
    profiles : Profiles
        All rows of the element, of every stack; see `shown`.
    stack_id : int
        The stack whose profiles are plotted.
    stacks : tuple of (int, str, int)
        Id, name and number of profiles of the stacks to choose from.
    selected_index : int, optional
        `profile_index` of the profile whose section is shown, if it is of this stack.
    deformations : tuple of Deformation
        Those of the element.
    selected_deformation : int
    pinned : tuple of Pinned
        Elements to compare with, the present one not among them.
    is_pinned : bool
        Whether the present element stays in the plot when another is selected.
    dent_limit : DentLimit, optional
        How deep a dent of the element may be by the rule of the settings.
    """

    element: Element | None = None
    profiles: Profiles = NO_PROFILES
    stack_id: int = OWN_STACK
    stacks: tuple[tuple[int, str, int], ...] = ()
    selected_index: int | None = None
    deformations: tuple[Deformation, ...] = ()
    selected_deformation: int = NO_ID
    pinned: tuple[Pinned, ...] = ()
    is_pinned: bool = False
    dent_limit: DentLimit | None = None

    @property
    def shown(self) -> Profiles:
        """The rows of the chosen stack, in order of chainage."""
        return self.profiles[self.profiles.stack_id == self.stack_id]


@dataclass(frozen=True, eq=False)
class SectionState(_ComparedByParts):
    """The section view: the selected profile, or the one at the peak of the deformation.

    Parameters
    ----------
    element : Element, optional
    profile : Profiles, optional
        A table of one row, or None if no profile is selected.
    section : Section, optional
        The profile in its own plane.
    position, count : int
        This is profile `position` (from 1) of `count` in its stack.
    stack_name : str
    deformations : tuple of Deformation
        Those that the profile passes through.
    """

    element: Element | None = None
    profile: Profiles | None = None
    section: Section | None = None
    position: int = 0
    count: int = 0
    stack_name: str = ""
    deformations: tuple[Deformation, ...] = ()


@dataclass(frozen=True, eq=False)
class MapState(_ComparedByParts):
    """The unrolled deviation map of the selected element, and its points."""

    element: Element | None = None
    points: ElementPoints = NO_ELEMENT_POINTS
    deformations: tuple[Deformation, ...] = ()
    selected_deformation: int = NO_ID
    selected_chainage: float | None = None
    """Of the profile whose section is shown."""
    limit_mm: float = 10.0
    """The colours span ± this."""


@dataclass(frozen=True)
class TreeState:
    """The project tree."""

    scans: tuple[Scan, ...] = ()
    active: int = 0
    selection: Selection = Selection()
    hidden_elements: frozenset[int] = frozenset()
    hidden_stations: frozenset[int] = frozenset()


@dataclass(frozen=True)
class StacksState:
    """The stacks panel: what to cut next, and what the last detection cut."""

    settings: StackSettings = StackSettings()
    profiles: ProfileSettings = ProfileSettings()
    stacks: tuple[Stack, ...] = ()
    n_profiles: tuple[int, ...] = ()
    """Profiles with an accepted ellipse, per stack."""
    shown_stack: int = NO_ID
    measured: Measurement | None = None
    """The last distance that was measured: two points give a direction."""


@dataclass(frozen=True)
class TableState:
    """The deformation table."""

    result: Result | None = None
    selected: int = NO_ID
    reviews: Mapping[int, Review] = field(default_factory=dict)
    """By the ids of the deformations; those that are open without a word are not in it."""


@dataclass(frozen=True)
class PropertiesState:
    """The properties of the selection."""

    scan: Scan | None = None
    selection: Selection = Selection()
    profile: Profiles | None = None


@dataclass(frozen=True, eq=False)
class ProfileBarState(_ComparedByParts):
    """The profiles of the stack that is shown: those with an accepted ellipse, in order."""

    indices: NDArray[np.int32] = field(default_factory=lambda: NO_INDICES)
    shown: int | None = None
    name: str = ""


@dataclass(frozen=True)
class ClipState:
    """The clip box in numbers."""

    box: ClipBox | None = None
    cloud: PointCloud | None = None
    has_selection: bool = False


@dataclass(frozen=True)
class WindowState:
    """Title, status bar and which actions make sense."""

    scan: Scan | None = None
    view: ViewOptions = ViewOptions()
    has_selection: bool = False
    limits: Limits | None = None
    """Ends of the colours of heights (world) or intensities, where these are shown."""


@dataclass(frozen=True)
class ViewState:
    """Everything that the window shows."""

    window: WindowState = WindowState()
    scene: SceneState = SceneState()
    tree: TreeState = TreeState()
    stacks: StacksState = StacksState()
    planning: PlanningState = PlanningState()
    settings: Settings = Settings()
    table: TableState = TableState()
    clip: ClipState = ClipState()
    profile_bar: ProfileBarState = ProfileBarState()
    properties: PropertiesState = PropertiesState()
    radius_plot: RadiusPlotState = RadiusPlotState()
    section: SectionState = SectionState()
    map: MapState = MapState()


def resolve(document: Document) -> ViewState:
    """Return what each part of the window shows for `document`."""
    scan, result = document.scan, document.result
    selection, view = document.selection, document.view
    profile, profile_xyz, shown = None, NO_POINTS, None
    if scan is not None and result is not None:
        if selection.profile is not None:
            profile = result_queries.profile_at(result, selection.element_id, selection.profile)
            if profile is not None:
                args = result, scan.cloud, selection.element_id, selection.profile
                profile_xyz = result_queries.points_of_profile(*args)
        shown = shown_profile(result, selection)
    return ViewState(
        window=WindowState(
            scan,
            view,
            selection != Selection(),
            colour_limits.shown_limits(scan.cloud, view) if scan else None,
        ),
        scene=SceneState(
            scan_key=str(id(scan.cloud)) if scan else "",
            cloud=scan.cloud if scan else None,
            result=result,
            selection=selection,
            view=view,
            profile=profile,
            profile_xyz=profile_xyz,
        ),
        tree=TreeState(
            document.scans,
            document.active,
            selection,
            view.hidden_elements,
            view.hidden_stations,
        ),
        stacks=StacksState(
            document.settings.stacks,
            document.settings.profiles,
            result.stacks if result else (),
            result_queries.count_profiles(result) if result else (),
            view.shown_stack,
            next((m for m in reversed(view.measurements) if m.end is not None), None),
        ),
        planning=PlanningState(scan.cloud if scan else None, document.settings),
        settings=document.settings,
        table=TableState(result, selection.deformation_id, scan.reviews if scan else {}),
        clip=ClipState(view.clip_box, scan.cloud if scan else None, selection != Selection()),
        properties=PropertiesState(scan, selection, profile),
        profile_bar=_profile_bar(result, view),
        **_element_states(scan, selection, view, shown),
    )


def _profile_bar(result: Result | None, view: ViewOptions) -> ProfileBarState:
    if result is None or view.colour_by is not ColourBy.PROFILE or not view.shown_stack:
        return ProfileBarState()
    indices = result_queries.profile_indices(result, view.shown_stack)
    return ProfileBarState(
        indices, view.shown_profile, result_queries.stack_name(result, view.shown_stack)
    )


def _element_states(
    scan: Scan | None, selection: Selection, view: ViewOptions, shown: ProfileKey | None
) -> dict[str, Any]:
    """States of the three views of the selected element; `shown` is the profile they mark."""
    if scan is None or scan.result is None or not selection.element_id:
        return {}
    result = scan.result
    element = result.element(selection.element_id)
    deformations = result_queries.deformations_of(result, element.element_id)
    stack_id = selection.profile.stack_id if selection.profile else view.plot_stack
    profile = result_queries.profile_at(result, element.element_id, shown) if shown else None
    choices = result_queries.stack_choices(result, element.element_id)
    if stack_id not in {choice[0] for choice in choices}:
        stack_id = choices[0][0] if choices else OWN_STACK
    radius_plot = RadiusPlotState(
        element=element,
        profiles=result_queries.profiles_of(result, element.element_id),
        stack_id=stack_id,
        stacks=choices,
        selected_index=shown.profile_index if shown and shown.stack_id == stack_id else None,
        deformations=deformations,
        selected_deformation=selection.deformation_id,
        pinned=tuple(
            Pinned(result.element(i), result_queries.plotted_profiles(result, i))
            for i in view.pinned_elements
            if i != element.element_id and any(e.element_id == i for e in result.elements)
        ),
        is_pinned=element.element_id in view.pinned_elements,
        dent_limit=result_queries.dent_limit(result, element.element_id),
    )
    if profile is None or shown is None:
        section = SectionState(element=element)
    else:
        section = _section(result, scan.cloud, element.element_id, shown)
    deviation_map = MapState(
        element=element,
        points=result_queries.points_of(result, scan.cloud, element.element_id),
        deformations=deformations,
        selected_deformation=selection.deformation_id,
        selected_chainage=None if profile is None else float(profile.chainage[0]),
        limit_mm=view.deviation_limit_mm,
    )
    return {"radius_plot": radius_plot, "section": section, "map": deviation_map}


@cached_with_owner(maxsize=8)
def _section(result: Result, cloud: PointCloud, element_id: int, key: ProfileKey) -> SectionState:
    """Return the section of a profile of the element."""
    profile = result_queries.profile_at(result, element_id, key)
    assert profile is not None
    element, chainage = result.element(element_id), float(profile.chainage[0])
    xyz = result_queries.points_of_profile(result, cloud, element_id, key)
    siblings = result_queries.profiles_of(result, element_id)
    siblings = siblings[siblings.stack_id == key.stack_id]
    return SectionState(
        element=element,
        profile=profile,
        section=cut_section(element, profile, xyz),
        position=1 + int(np.flatnonzero(siblings.profile_index == key.profile_index)[0]),
        count=len(siblings),
        stack_name=result_queries.stack_name(result, key.stack_id),
        deformations=tuple(
            d
            for d in result_queries.deformations_of(result, element_id)
            if d.chainage_start <= chainage <= d.chainage_end
        ),
    )
