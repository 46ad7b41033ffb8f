"""Deformations of one element: found, measured against the undented contour, with their noise."""

from pipecore.deformation.deviation_map import DeviationMap, Grid
from pipecore.deformation.finding import DeformationFinding, find_deformations

__all__ = ["DeformationFinding", "DeviationMap", "Grid", "find_deformations"]
