"""Grouping items by a small integer label in one pass."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def group_by_label(labels, n_labels):
    """Indices of the items in order of their label, and where each label starts."""
    starts = np.zeros(n_labels + 1, np.int64)
    for label in labels:
        starts[label + 1] += 1
    for k in range(n_labels):
        starts[k + 1] += starts[k]
    place = starts[:-1].copy()
    members = np.empty(labels.shape[0], np.int64)
    for i in range(labels.shape[0]):
        members[place[labels[i]]] = i
        place[labels[i]] += 1
    return members, starts
