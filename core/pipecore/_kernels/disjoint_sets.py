"""Disjoint sets (union-find), and connected components over groups of points."""

from numba import njit


@njit(cache=True, nogil=True)
def find_root(parents, i):
    """Return the root of an element, halving paths on the way.

    Parameters
    ----------
    parents (n,) : disjoint sets; changed
    i : the element
    """
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


@njit(cache=True, nogil=True)
def unite(parents, i, j):
    """Unite the sets of two elements; the smaller root stays.

    Parameters
    ----------
    parents (n,) : disjoint sets; changed
    i, j : the elements
    """
    a, b = find_root(parents, i), find_root(parents, j)
    if a < b:
        parents[b] = a
    elif b < a:
        parents[a] = b


@njit(cache=True, nogil=True)
def unite_groups(points, starts, parents):
    """Unite all points of each group.

    Parameters
    ----------
    points (k,), starts (g + 1,) : the points group by group, and where each begins
    parents (n,) : disjoint sets; changed
    """
    for g in range(starts.shape[0] - 1):
        first = points[starts[g]]
        for k in range(starts[g] + 1, starts[g + 1]):
            unite(parents, first, points[k])


@njit(cache=True, nogil=True)
def unite_labelled(labels, start, first, parents):
    """Unite the points of each label.

    Parameters
    ----------
    labels (m,) : of consecutive points; below 0 for none
    start : index of the first of these points
    first (labels,) : first point of each label, -1 before it is met; kept from call to call
    parents (n,) : disjoint sets; changed
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
    """Point every element at its root.

    Parameters
    ----------
    parents (n,) : disjoint sets; changed
    """
    for i in range(parents.shape[0]):
        parents[i] = find_root(parents, i)


@njit(cache=True, nogil=True)
def count_members(roots, sizes):
    """Add the number of elements of each root.

    Parameters
    ----------
    roots (m,) : root of each element
    sizes (n,) : added to
    """
    for root in roots:
        sizes[root] += 1
