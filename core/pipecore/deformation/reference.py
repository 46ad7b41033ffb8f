"""The undeformed contour: radius, centre and ovality as slow functions of the chainage.

The contour's height above the element's fitted surface is

    h(s, θ) = a₀(s) + a₁(s) cos θ + b₁(s) sin θ [+ a₂(s) cos 2θ + b₂(s) sin 2θ]

where every coefficient is a cubic spline with a knot each two diameters. A dent is
shorter than that, so it cannot bend the contour; taper, bow and ovality can. Where the
arc cannot tell two terms apart, a weak prior (a random walk along the knots) does.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_factor, cho_solve

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

CAUCHY, TUKEY = 2.4, 4.7


@dataclass(frozen=True, eq=False)
class Contour:
    """A fitted contour on a grid.

    Parameters
    ----------
    grid : Grid
    basis : ndarray, shape (rows, splines)
    coefficients : ndarray, shape (splines, terms)
    covariance : ndarray, shape (splines, terms, splines, terms)
    """

    grid: Grid
    basis: Array
    coefficients: Array
    covariance: Array

    @property
    def n_terms(self) -> int:
        """Three, or five with ovality."""
        return int(self.coefficients.shape[1])

    @property
    def terms(self) -> Array:
        """Coefficients at every row, metres, shape (rows, terms)."""
        return np.asarray(self.basis @ self.coefficients)

    @property
    def term_covariance(self) -> Array:
        """Covariance of the coefficients at every row, shape (rows, terms, terms)."""
        n = self.n_terms
        result = np.empty((len(self.basis), n, n))
        for k in range(n):
            for m in range(n):
                half = self.basis @ self.covariance[:, k, :, m]
                result[:, k, m] = np.sum(half * self.basis, axis=1)
        return result

    @property
    def height(self) -> Array:
        """Height of the contour above the fitted surface per cell, metres."""
        return np.asarray(self.terms @ harmonics(self.grid.clocks, self.n_terms).T)

    @property
    def sd(self) -> Array:
        """Standard deviation of `height` per cell, metres."""
        phi = harmonics(self.grid.clocks, self.n_terms)
        pairs = (phi[:, :, None] * phi[:, None, :]).reshape(len(phi), -1)
        variance = self.term_covariance.reshape(len(self.basis), -1) @ pairs.T
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def harmonics(clock: Array, n_terms: int) -> Array:
    """Values of the terms at clock angles (n,), shape (n, n_terms)."""
    columns = [np.ones_like(clock), np.cos(clock), np.sin(clock), np.cos(2 * clock)]
    return np.stack([*columns, np.sin(2 * clock)][:n_terms], axis=1)


def oval_knot_diameters(grid: Grid) -> float:
    """Distance between knots for an oval element, in diameters."""
    return float(np.clip(OVAL_KNOTS / (2 * grid.radius), *OVAL_KNOT_DIAMETERS))


def spline_basis(grid: Grid, knot_diameters: float) -> Array:
    """Cubic splines with equal knots at the rows of a grid, shape (rows, splines)."""
    wanted = grid.length / (2 * grid.radius * knot_diameters)
    intervals = int(np.clip(np.ceil(wanted), 1, MAX_INTERVALS))
    step = grid.length / intervals
    knots = np.arange(-3, intervals + 4) * step
    return np.asarray(BSpline.design_matrix(grid.chainages, knots, 3).toarray())


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
    n_splines = basis.shape[1]
    phi = harmonics(grid.clocks, n_terms)
    pairs = (phi[:, :, None] * phi[:, None, :]).reshape(len(phi), -1)
    prior = _prior_precision(grid, n_splines, n_terms, knot_diameters, constant_radius)
    used = np.isfinite(variance) & np.isfinite(height)
    used &= inner_rows(grid)[:, None]
    y = np.where(used, height, 0.0)
    base = np.where(used, 1.0 / (np.where(used, variance, 1.0) + FLOOR**2), 0.0)

    weight = base
    for loss in [*[_cauchy] * 6, *[_tukey] * 6, None]:
        moments = (weight @ pairs).reshape(-1, n_terms, n_terms)
        right = (weight * y) @ phi
        normal = _normal_matrix(basis, moments) + prior
        size = n_splines * n_terms
        factor = cho_factor(normal.reshape(size, size))
        solution = cho_solve(factor, (basis.T @ right).ravel()).reshape(n_splines, n_terms)
        if loss is None:
            break
        residual = (y - basis @ solution @ phi.T) * np.sqrt(base)
        spread = 1.4826 * float(np.median(np.abs(residual[used]))) if used.any() else 1.0
        weight = base * loss(residual / max(spread, 1.0))
    covariance = cho_solve(factor, np.eye(size)).reshape(n_splines, n_terms, n_splines, n_terms)
    return Contour(grid, basis, solution, covariance)


def _normal_matrix(basis: Array, moments: Array) -> Array:
    """Σ over rows of splines ⊗ splines ⊗ moments, shape (splines, terms, splines, terms)."""
    n_splines, n_terms = basis.shape[1], moments.shape[1]
    normal = np.empty((n_splines, n_terms, n_splines, n_terms))
    # One product of matrices per pair of terms is far quicker than one einsum over all.
    for k in range(n_terms):
        for m in range(n_terms):
            normal[:, k, :, m] = basis.T @ (moments[:, k, m, None] * basis)
    return normal


def _cauchy(residual: Array) -> Array:
    return 1.0 / (1.0 + (residual / CAUCHY) ** 2)


def _tukey(residual: Array) -> Array:
    return np.clip(1.0 - (residual / TUKEY) ** 2, 0.0, None) ** 2


def _prior_precision(
    grid: Grid, n_splines: int, n_terms: int, knot_diameters: float, constant_radius: bool
) -> Array:
    """Inverse variances of the levels and of the steps from knot to knot."""
    interval = grid.length / (n_splines - 3)
    walk = WALK_PRIOR * grid.radius * np.sqrt(interval / (4 * grid.radius))
    steps = np.diff(np.eye(n_splines), axis=0)
    precision = np.zeros((n_splines, n_terms, n_splines, n_terms))
    for k in range(n_terms):
        # A radius held constant leaves the centre well known: it needs no prior to speak of.
        freedom = (1e-3 if k == 0 else 10.0) if constant_radius else 1.0
        precision[:, k, :, k] = steps.T @ steps / (walk * freedom) ** 2
        precision[:, k, :, k] += np.eye(n_splines) / (n_splines * (LEVEL_PRIOR * grid.radius) ** 2)
    return precision


def inner_rows(grid: Grid) -> Flags:
    """Rows away from the ends, or all of a short element."""
    margin = END_MARGIN * grid.radius if grid.length > 2 * grid.radius else 0.0
    return (grid.chainages >= margin) & (grid.chainages <= grid.length - margin)


def usable_arc(grid: Grid, covered: Flags) -> float:
    """Arc that the surface is seen over, radians: the median over rows that are seen."""
    seen = np.count_nonzero(covered, axis=1) * grid.column_angle
    seen = seen[seen > 0]
    return float(np.median(seen)) if len(seen) else 0.0
