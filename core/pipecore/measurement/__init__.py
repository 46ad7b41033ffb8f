"""Measuring elements at full resolution: deviations, deformations and normal stacks."""

from pipecore.measurement.elements import MeasuredElements, MeasuringOptions, measure_elements
from pipecore.measurement.sections import cut_normal_stack, tabulate_ellipses

__all__ = [
    "MeasuredElements",
    "MeasuringOptions",
    "cut_normal_stack",
    "measure_elements",
    "tabulate_ellipses",
]
