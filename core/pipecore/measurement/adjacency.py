"""Which elements lie so near to each other that their surfaces may touch."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipecore.types import Element

Array = NDArray[np.float64]

N_SAMPLES = 16
"""Points along an axis at which its distance from others is taken."""


def bounding_boxes(elements: Sequence[Element]) -> tuple[Array, Array, Array]:
    """Bounding boxes of the elements' axes, and the elements' largest radii.

    Parameters
    ----------
    elements : sequence of Element

    Returns
    -------
    low, high : ndarray, shape (n, 3)
        Corners, metres.
    radii : ndarray, shape (n,)
        Metres.
    """
    low, high = np.empty((2, len(elements), 3))
    for i, element in enumerate(elements):
        samples = element.axis.at(np.linspace(0.0, element.axis.length, N_SAMPLES))
        # Between its samples an arc leaves their box by less than half a step.
        half_step = 0.5 * element.axis.length / (N_SAMPLES - 1)
        low[i], high[i] = samples.min(axis=0) - half_step, samples.max(axis=0) + half_step
    return low, high, np.array([max(e.radius, e.radius_end) for e in elements])


def neighbours_of(
    element: Element, elements: Sequence[Element], boxes: tuple[Array, Array, Array]
) -> list[Element]:
    """Find the elements whose surfaces may touch that of another.

    Parameters
    ----------
    element : Element
    elements : sequence of Element
        `element` itself may be one of them.
    boxes : tuple of ndarray
        Theirs, as from `bounding_boxes`: most are too far off by them alone.

    Returns
    -------
    list of Element
        Those whose axes pass within 1.2 times both radii of the element's own.
    """
    samples = element.axis.at(np.linspace(0.0, element.axis.length, N_SAMPLES))
    step = element.axis.length / (N_SAMPLES - 1)
    radius = max(element.radius, element.radius_end)
    low, high, radii = boxes
    # Within reach of an end along the axis, and of the axis across it.
    furthest = (2.0 * (1.2 * (radius + radii) + step))[:, None]
    apart = (low - furthest > samples.max(axis=0)) | (high + furthest < samples.min(axis=0))
    near = []
    for i in np.flatnonzero(~apart.any(axis=1)).tolist():
        other = elements[i]
        if other is element:
            continue
        chainage, rho, _ = other.axis.pipe_coordinates(samples)
        reach = 1.2 * (radius + radii[i]) + step
        beside = (rho < reach) & (chainage > -reach) & (chainage < other.axis.length + reach)
        if beside.any():
            near.append(other)
    return near
