"""Deformations of one element: found, measured against the undented contour, with their noise."""

from pipecore.deformation.deviation_map import DeviationMap, Grid
from pipecore.deformation.finding import DeformationFinding, find_deformations
from pipecore.deformation.section_curve import SectionCurve, fit_section

__all__ = [
    "DeformationFinding",
    "DeviationMap",
    "Grid",
    "SectionCurve",
    "find_deformations",
    "fit_section",
]
