"""Deformations of one element: found, measured against the undented contour, with their noise."""

from pipecore.deformation.deviation_map import DeviationMap, Grid
from pipecore.deformation.finding import DeformationFinding, find_deformations
from pipecore.deformation.mesh import SurfaceMesh, mesh_deformations, mesh_elements, mesh_surface
from pipecore.deformation.profile_signals import curvature_variations
from pipecore.deformation.relations import relate_deformations
from pipecore.deformation.section_curve import SectionCurve, fit_section

__all__ = [
    "DeformationFinding",
    "DeviationMap",
    "Grid",
    "SectionCurve",
    "SurfaceMesh",
    "curvature_variations",
    "find_deformations",
    "fit_section",
    "mesh_deformations",
    "mesh_elements",
    "mesh_surface",
    "relate_deformations",
]
