"""Sections fitted freely, profile by profile, to the rows of a deviation map.

The contour is smooth along the pipe, so that a dent cannot bend it. A section here knows
nothing of its neighbours: its radius, centre, semi-axes and curvature are those of its own
points, as those of the paper's ellipses are (section 3.3.6), and what they do against the
element's own pattern tells where the pipe is deformed.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipecore.deformation.contour import FLOOR, harmonics
from pipecore.deformation.deviation_map import DeviationMap, Flags, Grid
from pipecore.geometry import Array

ELLIPSE_TERMS = 5
"""Terms of an ellipse about its own centre: mean radius, centre, second harmonic."""

CURVE_ORDER = 6
CURVE_TERMS = 2 * CURVE_ORDER + 1
"""Terms of a curve whose curvature may vary more than an ellipse's does."""

ELLIPSE_ARC, CURVE_ARC = np.deg2rad([200.0, 300.0])
"""Arcs below which the points do not carry an ellipse, and a curve of that order."""

PRIOR = 0.5
"""Standard deviation of every term before any point is seen, fraction of the radius."""

MAX_OFFSET = 0.6
"""Further from the axis, in radii, a circle is no series of few harmonics about it."""

CALIPER_STEPS = 90


@dataclass(frozen=True, eq=False)
class FreeSections:
    """Normal equations of a Fourier series in each row of a grid.

    Parameters
    ----------
    grid : Grid
    normal : ndarray, shape (rows, terms, terms)
        Sums of the products of 1, cos θ, sin θ, cos 2θ …, over variances, 1/metres².
    moment : ndarray, shape (rows, terms)
        Sums of the products with the heights above the fitted surface, 1/metres.
    arc : ndarray, shape (rows,)
        Arc that is seen, radians.
    """

    grid: Grid
    normal: Array
    moment: Array
    arc: Array

    @classmethod
    def of(cls, cells: DeviationMap) -> "FreeSections":
        """Return the sections of a map of heights above an element's fitted surface.

        Parameters
        ----------
        cells : DeviationMap

        Returns
        -------
        FreeSections
        """
        grid = cells.grid
        used = (cells.count > 0) & ~cells.in_contact
        variance = cells.noise**2 / np.maximum(cells.count, 1) + FLOOR**2
        weight = np.where(used, 1.0 / variance, 0.0)
        phi = harmonics(grid.clocks, CURVE_TERMS)
        products = (phi[:, :, None] * phi[:, None, :]).reshape(grid.n_columns, -1)
        normal = (weight @ products).reshape(grid.n_rows, CURVE_TERMS, CURVE_TERMS)
        moment = (weight * np.where(used, cells.deviation, 0.0)) @ phi
        arc = np.count_nonzero(cells.covered & ~cells.in_contact, axis=1) * grid.column_angle
        return cls(grid, normal, moment, arc)

    def pooled(self, n_rows: int) -> "FreeSections":
        """Return sections of as many neighbouring rows together, an odd number.

        Parameters
        ----------
        n_rows : int

        Returns
        -------
        FreeSections
        """
        if n_rows == 1:
            return self

        def total(values: Array) -> Array:
            mean = ndimage.uniform_filter1d(values, n_rows, axis=0, mode="constant")
            return np.asarray(mean * n_rows)

        arc = ndimage.uniform_filter1d(self.arc, n_rows, mode="nearest")
        return FreeSections(self.grid, total(self.normal), total(self.moment), arc)

    def every_other(self, start: int) -> "FreeSections":
        """Return the sections with the equations of every other row left out.

        Parameters
        ----------
        start : int
            0 or 1.

        Returns
        -------
        FreeSections
        """
        stays = (np.arange(self.grid.n_rows) % 2 == start).astype(np.float64)
        normal, moment = self.normal * stays[:, None, None], self.moment * stays[:, None]
        return FreeSections(self.grid, normal, moment, self.arc)

    def centres(self, radius: Array) -> tuple[Array, Array]:
        """Fit the centre of each row, with the mean radius given where an arc is short.

        Parameters
        ----------
        radius : ndarray, shape (rows,)
            Height of the mean radius above the fitted surface, metres.

        Returns
        -------
        centre : ndarray, shape (rows, 2)
            Upwards and to the right of the axis, metres; nan in rows without points.
        covariance : ndarray, shape (rows, 2, 2)
        """
        terms, covariance = self.fit(ELLIPSE_TERMS)
        centre, spread = terms[:, 1:3], covariance[:, 1:3, 1:3]
        some = (self.normal[:, 0, 0] > 0) & ~np.isfinite(centre[:, 0])
        prior = np.eye(2) / (PRIOR * self.grid.radius) ** 2
        inverse = np.linalg.inv(self.normal[some, 1:3, 1:3] + prior)
        left = self.moment[some, 1:3] - self.normal[some, 1:3, 0] * radius[some, None]
        centre[some], spread[some] = np.einsum("rij,rj->ri", inverse, left), inverse
        return centre, spread

    def fit(self, n_terms: int) -> tuple[Array, Array]:
        """Fit the first terms of the series to each row.

        What a circle's offset adds to its second harmonic and takes from its mean radius
        (r = e cos θ + √(R² − e² sin² θ), to the second order) is no part of them.

        Parameters
        ----------
        n_terms : int

        Returns
        -------
        terms : ndarray, shape (rows, n_terms)
            Metres; nan in rows whose arc does not carry them.
        covariance : ndarray, shape (rows, n_terms, n_terms)
        """
        least = CURVE_ARC if n_terms > ELLIPSE_TERMS else ELLIPSE_ARC if n_terms > 1 else 0.0
        known = (self.arc >= least) & (
            self.normal[:, 0, 0] > 1e-9 * self.normal[:, 0, 0].max(initial=1e-9)
        )
        n_rows = len(self.arc)
        terms = np.full((n_rows, n_terms), np.nan)
        covariance = np.full((n_rows, n_terms, n_terms), np.nan)
        prior = np.eye(n_terms) / (PRIOR * self.grid.radius) ** 2
        inverse = np.linalg.inv(self.normal[known, :n_terms, :n_terms] + prior)
        covariance[known] = inverse
        terms[known] = np.einsum("rij,rj->ri", inverse, self.moment[known, :n_terms])
        if n_terms >= ELLIPSE_TERMS:
            offset = np.hypot(terms[:, 1], terms[:, 2])
            terms[offset > MAX_OFFSET * self.grid.radius] = np.nan
            terms[:, :ELLIPSE_TERMS] -= offset_terms(terms[:, 1], terms[:, 2], self.grid.radius)
        return terms, covariance


def offset_terms(up: Array, right: Array, radius: float) -> Array:
    """Return what a circle's offset alone adds to mean radius and second harmonic.

    Parameters
    ----------
    up, right : ndarray, shape (n,)
        Of its centre from the axis, metres.
    radius : float
        Metres.

    Returns
    -------
    ndarray, shape (n, 5)
        Metres; the first harmonic is the offset itself, and 0 here.
    """
    added = np.zeros((len(up), ELLIPSE_TERMS))
    added[:, 0] = -(up**2 + right**2) / (4 * radius)
    added[:, 3] = (up**2 - right**2) / (4 * radius)
    added[:, 4] = up * right / (2 * radius)
    return added


def diameters(terms: Array, radius: float) -> tuple[Array, Array]:
    """Return the largest and smallest caliper diameter of sections, from their even harmonics.

    Parameters
    ----------
    terms : ndarray, shape (n, terms)
        Metres.
    radius : float
        That they are added to, metres.

    Returns
    -------
    largest, smallest : ndarray, shape (n,)
        Metres; nan where the terms are.
    """
    n_terms = terms.shape[1]
    order = np.arange(n_terms) + 1 >> 1
    clock = np.asarray(np.arange(CALIPER_STEPS) * (np.pi / CALIPER_STEPS), np.float64)
    even = order % 2 == 0
    caliper = 2 * (radius + np.dot(terms[:, even], harmonics(clock, n_terms)[:, even].T))
    return caliper.max(axis=1), caliper.min(axis=1)


def n_rows_of(grid: Grid, length: float) -> int:
    """Return the odd number of rows that is nearest to a length.

    Parameters
    ----------
    grid : Grid
    length : float
        Metres.

    Returns
    -------
    int
    """
    return 2 * int(length / grid.row_size / 2) + 1


def joined(flags: Flags, reach: int) -> Flags:
    """Return flags with gaps of at most `reach` rows between true ones closed.

    Parameters
    ----------
    flags : ndarray of bool, shape (rows,)
    reach : int

    Returns
    -------
    ndarray of bool, shape (rows,)
    """
    rows: NDArray[np.intp] = np.flatnonzero(flags)
    closed = flags.copy()
    for a, b in pairwise(rows):
        if b - a <= reach + 1:
            closed[a:b] = True
    return closed
