"""What the user can do to the 3D view, beside the commands on scans and results. Qt-free."""

import numpy as np

from pipegui.commands import set_view
from pipegui.document import Document

POINT_SIZES = (0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0, 4.0)
N_SAMPLED = 200_000


def set_point_size(document: Document, size: str) -> Document:
    """Draw points "larger", "smaller" or as large as "usual"."""
    step = {"larger": 1, "smaller": -1}.get(size)
    if step is None:
        return set_view(document, point_size=1.0)
    now = int(np.argmin(np.abs(np.array(POINT_SIZES) - document.view.point_size)))
    return set_view(document, point_size=POINT_SIZES[min(max(now + step, 0), len(POINT_SIZES) - 1)])


def fit_limits(document: Document) -> Document:
    """Choose deviation limits that hold 98 % of the points, in whole steps of 0.5 mm."""
    if document.result is None:
        return document
    deviation = document.result.deviation
    sample = np.abs(deviation[:: max(1, len(deviation) // N_SAMPLED)])
    sample = sample[np.isfinite(sample)]
    if not len(sample):
        return document
    limit_mm = 1000 * float(np.percentile(sample, 98))
    return set_view(document, deviation_limit_mm=max(np.ceil(2 * limit_mm) / 2, 0.5))
