"""The views that draw points and curves: 3D scene and plots."""

from dataclasses import dataclass

from pipegui.plots.deviation_map_view import DeviationMapView
from pipegui.plots.preview_view import PreviewView
from pipegui.plots.radius_plot import RadiusPlot
from pipegui.plots.section_view import SectionView
from pipegui.scene.view import SceneView


@dataclass
class Views:
    """The 3D scene and the plots of a window.

    Each has `apply(state)` for its state in `pipegui.states.view_state`.
    """

    scene: SceneView
    radius_plot: RadiusPlot
    section: SectionView
    map: DeviationMapView
    preview: PreviewView


def make_views() -> Views:
    """Make the views of a new window."""
    return Views(SceneView(), RadiusPlot(), SectionView(), DeviationMapView(), PreviewView())
