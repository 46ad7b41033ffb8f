"""Grouping items by a small integer label, and sorting them by a large one, in few passes."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def group_into(labels, n_labels, members):
    """Write the indices of items in the order of their label; return where each label begins.

    Parameters
    ----------
    labels (n,) : 0 … n_labels - 1
    n_labels : number of labels
    members (n,) : filled
    """
    starts = np.zeros(n_labels + 1, np.int64)
    for label in labels:
        starts[label + 1] += 1
    for k in range(n_labels):
        starts[k + 1] += starts[k]
    place = starts[:-1].copy()
    for i in range(labels.shape[0]):
        members[place[labels[i]]] = i
        place[labels[i]] += 1
    return starts


@njit(cache=True, nogil=True)
def group_by_label(labels, n_labels):
    """Return the indices of items in the order of their label, and where each label begins.

    Parameters
    ----------
    labels (n,) : 0 … n_labels - 1
    n_labels : number of labels
    """
    members = np.empty(labels.shape[0], np.int64)
    return members, group_into(labels, n_labels, members)


@njit(cache=True, nogil=True)
def spread_to_members(values, members, starts, first, last, spread_out):
    """Write the value of each of some groups to all of its members.

    Parameters
    ----------
    values (groups,) : one for each group
    members (n,), starts (groups + 1,) : the members group by group, and where each begins
    first, last : range of groups
    spread_out (n,) : filled at the members
    """
    for k in range(first, last):
        for m in range(starts[k], starts[k + 1]):
            spread_out[members[m]] = values[k]


@njit(cache=True, nogil=True)
def group_from(labels, first, n_labels):
    """Return the indices of items in the order of their label, of labels from `first` on.

    Parameters
    ----------
    labels (n,) : below first + n_labels
    first : items of smaller labels are left out
    n_labels : number of labels

    Returns
    -------
    Indices, and where each label begins, counted from `first`.
    """
    starts = np.zeros(n_labels + 1, np.int64)
    for label in labels:
        if label >= first:
            starts[label - first + 1] += 1
    for k in range(n_labels):
        starts[k + 1] += starts[k]
    place = starts[:-1].copy()
    members = np.empty(starts[n_labels], np.int32)
    for i in range(labels.shape[0]):
        label = labels[i]
        if label >= first:
            members[place[label - first]] = i
            place[label - first] += 1
    return members, starts


@njit(cache=True, nogil=True)
def group_large(labels, n_labels, min_size):
    """Return the members of groups of at least a given size, and where each group begins.

    Parameters
    ----------
    labels (n,) : 0 … n_labels - 1
    n_labels : number of labels
    min_size : least number of items
    """
    place = np.zeros(n_labels, np.int64)
    for label in labels:
        place[label] += 1
    n_groups = n_members = 0
    for k in range(n_labels):
        if place[k] >= min_size:
            n_groups += 1
            n_members += place[k]
    starts = np.empty(n_groups + 1, np.int64)
    n_groups = n_members = 0
    for k in range(n_labels):
        size = place[k]
        place[k] = -1
        if size >= min_size:
            starts[n_groups] = n_members
            place[k] = n_members
            n_groups += 1
            n_members += size
    starts[n_groups] = n_members
    members = np.empty(n_members, np.int64)
    for i in range(labels.shape[0]):
        at = place[labels[i]]
        if at >= 0:
            members[at] = i
            place[labels[i]] += 1
    return members, starts


DIGIT_BITS = 11


@njit(cache=True, nogil=True)
def argsort_keys(keys):
    """Return the stable order of keys, by a radix sort from the lowest digits up.

    Parameters
    ----------
    keys (n,) : int64, none negative
    """
    n = keys.shape[0]
    largest = np.int64(0)
    for key in keys:
        largest = max(largest, key)
    order, other = np.arange(n), np.empty(n, np.int64)
    n_digits = 1 << DIGIT_BITS
    place = np.empty(n_digits, np.int64)
    shift = 0
    while largest >> shift > 0:
        place[:] = 0
        for key in keys:
            place[(key >> shift) & (n_digits - 1)] += 1
        total = 0
        for digit in range(n_digits):
            count = place[digit]
            place[digit] = total
            total += count
        for k in range(n):
            i = order[k]
            digit = (keys[i] >> shift) & (n_digits - 1)
            other[place[digit]] = i
            place[digit] += 1
        order, other = other, order
        shift += DIGIT_BITS
    return order
