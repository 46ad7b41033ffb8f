"""Connected components of linked elements: the runs."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pipecore.elements.runs.ends import Link


def number_runs(n_elements: int, links: list[Link]) -> NDArray[np.int32]:
    """Number the runs: the connected components of linked elements.

    Parameters
    ----------
    n_elements : int
    links : list of (int, int)
        Pairs of elements that belong together.

    Returns
    -------
    ndarray of int32, shape (n_elements,)
        Run of each element, from 0.
    """
    if not links:
        return np.arange(n_elements, dtype=np.int32)
    i, j = np.array(links).T
    graph = coo_array((np.ones(len(i), np.int8), (i, j)), shape=(n_elements, n_elements))
    _, label = connected_components(graph, directed=False)
    return np.asarray(label, np.int32)
