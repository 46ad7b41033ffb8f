"""States of the look at stacks and profiles before a detection. Qt-free."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pipecore.settings import Settings
from pipecore.types import PointCloud

if TYPE_CHECKING:
    from pipecore.preview import Plan, ProfilePreview


@dataclass(frozen=True)
class PlanningState:
    """What stacks and profiles are previewed of; clouds are compared by identity."""

    cloud: PointCloud | None = None
    settings: Settings = Settings()


@dataclass(frozen=True)
class PlanState:
    """What a detection would cut, or why it is not known."""

    plan: "Plan | None" = None
    message: str = ""


@dataclass(frozen=True, eq=False)
class PreviewState:
    """A profile of the plan's stack `row`, not yet cut while `preview` is None."""

    plan: "Plan | None" = None
    row: int = 0
    index: int = 0
    preview: "ProfilePreview | None" = None
    message: str = ""
