"""The undeformed contour: radius, centre and ovality as slow functions of the chainage.

The contour's height above the element's fitted surface is

    h(s, θ) = a₀(s) + a₁(s) cos θ + b₁(s) sin θ [+ a₂(s) cos 2θ + b₂(s) sin 2θ]

where every coefficient is a cubic spline with a knot each two diameters. A dent is
shorter than that, so it cannot bend the contour; taper, bow and ovality can. Where the
arc cannot separate two terms, a weak prior (a random walk along the knots) does.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import contour_fit as kernels
from pipecore._kernels.linear import inverse_by_band
from pipecore.deformation.deviation_map import Flags, Grid
from pipecore.geometry import Array

KNOT_DIAMETERS = 2.0
OVAL_KNOTS = 0.15
OVAL_KNOT_DIAMETERS = (0.35, 0.75)
"""Knots along elements that are oval somewhere, as ovality may set in at once: metres, and
the diameters that they are kept between."""

MAX_INTERVALS = 60
FLOOR = 2e-4
"""Cell means are not trusted below 0.2 mm, however many points they have."""

END_MARGIN = 0.3
"""Radii at either end that the contour is not fitted to: hubs and fillets begin there."""

LEVEL_PRIOR, WALK_PRIOR = 0.1, 0.02
"""How far a coefficient lies from zero, and changes over two diameters: shares of the radius."""

LOSS = kernels.RobustLoss(cauchy=2.4, tukey=4.7, n_rounds=6, tolerance=1e-6)


@dataclass(frozen=True, eq=False)
class Basis:
    """Cubic splines at the rows of a grid.

    Parameters
    ----------
    first : ndarray of int, shape (rows,)
        The first of the four splines that reach each row.
    values : ndarray, shape (rows, 4)
        Their values there.
    n_splines : int
    """

    first: NDArray[np.int64]
    values: Array
    n_splines: int

    @property
    def mean(self) -> Array:
        """Mean value of every spline over the rows, shape (splines,)."""
        total = np.zeros(self.n_splines)
        np.add.at(total, self.first[:, None] + np.arange(4), self.values)
        return total / len(self.first)


@dataclass(frozen=True, eq=False)
class Contour:
    """A fitted contour on a grid.

    Parameters
    ----------
    grid : Grid
    basis : Basis
    coefficients : ndarray, shape (splines, terms)
    factor : ndarray, shape (splines · terms, 4 · terms)
        Cholesky's factor of their normal equations, by columns from the diagonal down.
    """

    grid: Grid
    basis: Basis
    coefficients: Array
    factor: Array

    @property
    def n_terms(self) -> int:
        """Three, or five with ovality."""
        return int(self.coefficients.shape[1])

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the coefficients, shape (splines, terms, splines, terms)."""
        inverse = np.empty((len(self.factor), len(self.factor)))
        inverse_by_band(self.factor, inverse)
        return inverse.reshape(*self.coefficients.shape * 2)

    @cached_property
    def terms(self) -> Array:
        """Coefficients at every row, metres, shape (rows, terms)."""
        reached = self.coefficients[self.basis.first[:, None] + np.arange(4)]
        return np.asarray(np.einsum("ra,rak->rk", self.basis.values, reached))

    @cached_property
    def term_covariance(self) -> Array:
        """Covariance of the coefficients at every row, shape (rows, terms, terms)."""
        n = self.n_terms
        result = np.empty((len(self.basis.first), n, n))
        kernels.row_covariances(self.basis.first, self.basis.values, self.covariance, result)
        return result

    @cached_property
    def height(self) -> Array:
        """Height of the contour above the fitted surface per cell, metres."""
        result = np.empty(self.grid.shape)
        phi = harmonics(self.grid.clocks, self.n_terms)
        terms = kernels.ContourTerms(self.basis.first, self.basis.values, phi)
        kernels.heights(terms, self.coefficients, result)
        return result

    @cached_property
    def sd(self) -> Array:
        """Standard deviation of `height` per cell, metres."""
        result = np.empty(self.grid.shape)
        phi = harmonics(self.grid.clocks, self.n_terms)
        kernels.standard_deviations(phi, self.term_covariance, result)
        return result


def harmonics(clock: Array, n_terms: int) -> Array:
    """Return 1, cos θ, sin θ, cos 2θ, sin 2θ … at clock angles.

    Parameters
    ----------
    clock : ndarray, shape (n,)
        Radians.
    n_terms : int
        How many of them, an odd number.

    Returns
    -------
    ndarray, shape (n, n_terms)
    """
    angle = clock[:, None] * np.arange(1, n_terms // 2 + 1)
    columns = np.empty((len(clock), n_terms))
    columns[:, 0] = 1.0
    columns[:, 1::2], columns[:, 2::2] = np.cos(angle), np.sin(angle)
    return columns


def oval_knot_diameters(grid: Grid) -> float:
    """Return the distance between knots for an oval element, in diameters.

    Parameters
    ----------
    grid : Grid

    Returns
    -------
    float
    """
    return float(np.clip(OVAL_KNOTS / (2 * grid.radius), *OVAL_KNOT_DIAMETERS))


def spline_basis(grid: Grid, knot_diameters: float) -> Basis:
    """Return cubic splines with equally spaced knots at the rows of a grid.

    Parameters
    ----------
    grid : Grid
    knot_diameters : float
        Largest distance between knots, in diameters.

    Returns
    -------
    Basis
    """
    wanted = grid.length / (2 * grid.radius * knot_diameters)
    intervals = int(np.clip(np.ceil(wanted), 1, MAX_INTERVALS))
    step = grid.length / intervals
    first = (grid.chainages / step).astype(np.int64)
    t = grid.chainages / step - first
    values = [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]
    return Basis(first, np.stack(values, axis=1) / 6, intervals + 3)


def fit_contour(
    grid: Grid,
    height: Array,
    variance: Array,
    n_terms: int,
    *,
    knot_diameters: float = KNOT_DIAMETERS,
    constant_radius: bool = False,
) -> Contour:
    """Fit a contour to cell means, robustly (Cauchy's weights, then Tukey's).

    Parameters
    ----------
    grid : Grid
    height, variance : ndarray, shape (rows, columns)
        Mean heights and the variances of these means; inf where not to be used.
    n_terms : int
        3 (round) or 5 (with the second harmonic).
    constant_radius : bool
        Whether the radius is the same along the whole length.
    """
    basis = spline_basis(grid, knot_diameters)
    phi = harmonics(grid.clocks, n_terms)
    prior = _prior_band(grid, basis.n_splines, n_terms, knot_diameters, constant_radius)
    cells = kernels.list_cells(height, variance, inner_rows(grid), FLOOR)
    band, coefficients = np.empty_like(prior), np.empty((basis.n_splines, n_terms))
    kernels.fit_robustly(
        kernels.ContourTerms(basis.first, basis.values, phi), cells, prior, LOSS, band, coefficients
    )
    return Contour(grid, basis, coefficients, band)


def _prior_band(
    grid: Grid, n_splines: int, n_terms: int, knot_diameters: float, constant_radius: bool
) -> Array:
    """Inverse variances of the levels and of the steps from knot to knot, as a lower band.

    By columns from the diagonal down.
    """
    interval = grid.length / (n_splines - 3)
    walk = WALK_PRIOR * grid.radius * np.sqrt(interval / (4 * grid.radius))
    n_steps = np.full(n_splines, 2.0)
    n_steps[[0, -1]] = 1.0
    band = np.zeros((n_splines * n_terms, 4 * n_terms))
    for k in range(n_terms):
        # A radius held constant leaves the centre well known: it needs no prior to speak of.
        freedom = (1e-3 if k == 0 else 10.0) if constant_radius else 1.0
        precision = 1.0 / (walk * freedom) ** 2
        band[k::n_terms, 0] = n_steps * precision
        band[k::n_terms, 0] += 1.0 / (n_splines * (LEVEL_PRIOR * grid.radius) ** 2)
        band[k : -n_terms or None : n_terms, n_terms] = -precision
    return band


def inner_rows(grid: Grid) -> Flags:
    """Return which rows lie away from the ends, or all of a short element.

    Parameters
    ----------
    grid : Grid

    Returns
    -------
    ndarray of bool, shape (rows,)
    """
    margin = END_MARGIN * grid.radius if grid.length > 2 * grid.radius else 0.0
    return (grid.chainages >= margin) & (grid.chainages <= grid.length - margin)


def usable_arc(grid: Grid, covered: Flags) -> float:
    """Return the arc that a surface is seen over: the median over rows that are seen.

    Parameters
    ----------
    grid : Grid
    covered : ndarray of bool, shape (rows, columns)
        Cells with points.

    Returns
    -------
    float
        Radians.
    """
    seen = np.count_nonzero(covered, axis=1) * grid.column_angle
    seen = seen[seen > 0]
    return float(np.median(seen)) if len(seen) else 0.0
