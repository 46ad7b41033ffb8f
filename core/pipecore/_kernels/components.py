"""Connected components over groups of points."""

from numba import njit

from pipecore._kernels.profiles import find_root, unite


@njit(cache=True, nogil=True)
def unite_groups(points, starts, parents):
    """Unite all points of each group: rows starts[g] … starts[g + 1] of `points`."""
    for g in range(starts.shape[0] - 1):
        first = points[starts[g]]
        for k in range(starts[g] + 1, starts[g + 1]):
            unite(parents, first, points[k])


@njit(cache=True, nogil=True)
def unite_labelled(labels, start, first, parents):
    """Unite the points of each label, none if below 0; `labels` are those of points `start` on.

    `first` keeps the first point of each label from call to call, -1 before it is met.
    """
    for row in range(labels.shape[0]):
        label = labels[row]
        if label < 0:
            continue
        if first[label] < 0:
            first[label] = start + row
        else:
            unite(parents, first[label], start + row)


@njit(cache=True, nogil=True)
def flatten(parents):
    """Point every element at its root."""
    for i in range(parents.shape[0]):
        parents[i] = find_root(parents, i)


@njit(cache=True, nogil=True)
def count_members(roots, sizes):
    """Add the number of elements that point at each root."""
    for root in roots:
        sizes[root] += 1
