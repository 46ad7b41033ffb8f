"""The views that come from elsewhere: 3D scene and plots, made when the window is."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipegui.plots.deviation_map import DeviationMapView
    from pipegui.plots.preview_view import PreviewView
    from pipegui.plots.radius_plot import RadiusPlot
    from pipegui.plots.section_view import SectionView
    from pipegui.scene.view import SceneView


@dataclass
class Parts:
    """The views of a window that draw points and curves.

    Each has `apply(state)` for its state in `pipegui.states.view_state`.
    """

    scene: "SceneView"
    radius_plot: "RadiusPlot"
    section: "SectionView"
    map: "DeviationMapView"
    preview: "PreviewView"


def make_parts() -> Parts:
    """Make the real views. Imported here, because VTK takes its time."""
    from pipegui.plots.deviation_map import DeviationMapView  # noqa: PLC0415
    from pipegui.plots.preview_view import PreviewView  # noqa: PLC0415
    from pipegui.plots.radius_plot import RadiusPlot  # noqa: PLC0415
    from pipegui.plots.section_view import SectionView  # noqa: PLC0415
    from pipegui.scene.view import SceneView  # noqa: PLC0415

    return Parts(SceneView(), RadiusPlot(), SectionView(), DeviationMapView(), PreviewView())
