"""A deformed section as a smooth curve: a Fourier series whose order Akaike's criterion chooses.

    r(θ) = c₀ + Σₖ aₖ cos kθ + bₖ sin kθ,    k = 1 … order

The curve is closed where points go all round. Where they do not, it stands for the arcs
that hold points only: elsewhere it is nan, since a series says nothing there. Its
curvature (paper, figures 14 and 15) is 1/r on a circle, less in a dent's bottom,
negative where the section is re-entrant, and more on a dent's shoulders.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pipecore._kernels import series as kernels
from pipecore.ellipses.nonlinear import NoFit
from pipecore.geometry import Array

MAX_ORDER = 10
"""Waves of a tenth of the circumference: shorter ones are noise in a terrestrial scan."""

MAX_GAP = np.deg2rad(18.0)
"""A wider gap between neighbouring points is a hole: half of the shortest wave."""

MIN_ARC = np.deg2rad(60.0)
POINTS_PER_PARAMETER = 3
MIN_POINTS = 12

TUKEY, OUTLYING, N_ROUNDS = 4.7, 4.0, 5
MAX_POINTS, N_CELLS = 1440, 720
"""More points are taken together in cells of half a degree: no wave is that short."""

STEP = np.deg2rad(2.0)


@dataclass(frozen=True, eq=False)
class SectionCurve:
    """A smooth curve through the points of one section, in polar form about the axis.

    Parameters
    ----------
    coefficients : ndarray, shape (2·order + 1,)
        c₀, a₁, b₁, a₂, b₂ … in metres.
    root : ndarray, shape (2·order + 1, 2·order + 1)
        A root of the coefficients' covariance: root · rootᵀ.
    order : int
        Chosen by the criterion among 0 … `len(aic_by_order) - 1`.
    aic_by_order : ndarray
        Akaike's criterion with its correction for small samples, per order.
    noise : float
        Standard deviation of one point about the curve, metres.
    spans : tuple of (float, float)
        Clock angles between which points are seen, radians, start in 0 … 2π and end
        beyond it; one span of a full turn if the curve is closed.
    n_points : int
    """

    coefficients: Array
    root: Array
    order: int
    aic_by_order: Array
    noise: float
    spans: tuple[tuple[float, float], ...]
    n_points: int

    @property
    def aic(self) -> float:
        """Akaike's criterion of the chosen order."""
        return float(self.aic_by_order[self.order])

    @property
    def is_closed(self) -> bool:
        """Whether points are seen all round."""
        return self.arc >= 2 * np.pi - 1e-9

    @property
    def arc(self) -> float:
        """Arc that holds points, radians."""
        return float(sum(end - start for start, end in self.spans))

    def is_seen(self, clock: ArrayLike) -> np.ndarray:
        """Whether the curve stands for points at clock angles of any shape."""
        theta = np.asarray(clock, dtype=np.float64)
        seen = np.zeros(theta.shape, dtype=bool)
        for start, end in self.spans:
            seen |= np.mod(theta - start, 2 * np.pi) <= end - start + 1e-12
        return seen

    def radius_at(self, clock: ArrayLike) -> Array:
        """Distance from the axis at clock angles of any shape, metres; nan where not seen."""
        theta = np.asarray(clock, dtype=np.float64)
        r = _basis(theta, self.order) @ self.coefficients
        return np.asarray(np.where(self.is_seen(theta), r, np.nan))

    def radius_sd_at(self, clock: ArrayLike) -> Array:
        """Standard deviation of `radius_at`, metres."""
        theta = np.asarray(clock, dtype=np.float64)
        sd = np.linalg.norm(_basis(theta, self.order) @ self.root, axis=-1)
        return np.asarray(np.where(self.is_seen(theta), sd, np.nan))

    def curvature_at(self, clock: ArrayLike) -> Array:
        """Signed curvature at clock angles of any shape, 1/metres; nan where not seen.

        Positive where the section bulges outward, as a circle does everywhere:
        (r² + 2r′² − r r″) / (r² + r′²)^{3/2}.
        """
        theta = np.asarray(clock, dtype=np.float64)
        r, slope, bend = (_basis(theta, self.order, k) @ self.coefficients for k in range(3))
        curvature = (r**2 + 2 * slope**2 - r * bend) / (r**2 + slope**2) ** 1.5
        return np.asarray(np.where(self.is_seen(theta), curvature, np.nan))

    def curvature_sd_at(self, clock: ArrayLike) -> Array:
        """Standard deviation of `curvature_at`, 1/metres.

        By far the most of it is that of r″, which alone is taken along: sd(r″) / r².
        """
        theta = np.asarray(clock, dtype=np.float64)
        r = _basis(theta, self.order) @ self.coefficients
        sd = np.linalg.norm(_basis(theta, self.order, 2) @ self.root, axis=-1) / r**2
        return np.asarray(np.where(self.is_seen(theta), sd, np.nan))

    def clocks(self, step: float = STEP) -> list[Array]:
        """Clock angles from end to end of every span, to draw the curve by."""
        return [
            np.linspace(start, end, max(2, int(np.ceil((end - start) / step)) + 1))
            for start, end in self.spans
        ]

    @property
    def curvature_variation(self) -> float:
        """How much the curvature varies, as a share of that of the circle: 0 if it is round.

        Standard deviation of curvature times mean radius over the arcs seen, each place
        weighted by how well it is known there, less what the noise alone makes of it.
        """
        theta = np.concatenate(self.clocks())
        value, variance = np.empty((2, len(theta)))
        radius = float(kernels.curvature(theta, self.coefficients, self.root, value, variance))
        weight = 1.0 / (variance + (0.05 / radius) ** 2)
        weight /= weight.sum()
        spread = float(weight @ (value - weight @ value) ** 2 - weight @ variance)
        return radius * float(np.sqrt(max(spread, 0.0)))


def fit_section(
    clock: ArrayLike, rho: ArrayLike, *, max_order: int = MAX_ORDER, max_gap: float = MAX_GAP
) -> SectionCurve | NoFit:
    """Fit a smooth curve to the points of a section.

    Points far off the curve, as Tukey's weights at the highest order tell them, are left out.

    Parameters
    ----------
    clock, rho : array_like, shape (n,)
        Clock angle and distance from the axis of each point, radians and metres.
    max_order : int
        Highest order that the criterion may choose.
    max_gap : float
        Radians; a wider gap between neighbouring points is left open.

    Returns
    -------
    SectionCurve or NoFit
        `NoFit`, which is false, tells why the points carry no curve.
    """
    theta = np.mod(np.asarray(clock, dtype=np.float64), 2 * np.pi)
    r = np.asarray(rho, dtype=np.float64)
    if theta.shape != r.shape or theta.ndim != 1:
        raise ValueError("clock and rho must be one-dimensional and of one length")
    known = np.isfinite(theta) & np.isfinite(r)
    theta, r = theta[known], r[known]
    n = len(theta)
    if n < MIN_POINTS:
        return NoFit(f"only {n} points, {MIN_POINTS} are needed")
    spans = _spans(theta, max_gap)
    arc = sum(end - start for start, end in spans)
    if arc < MIN_ARC:
        return NoFit(f"{np.rad2deg(arc):.0f}° of arc, {np.rad2deg(MIN_ARC):.0f}° are needed")
    order = min(max_order, (n // POINTS_PER_PARAMETER - 1) // 2)
    if n > MAX_POINTS:
        theta, r, weight, within = _in_cells(theta, r)
    else:
        weight, within = np.ones(n), 0.0

    basis = _basis(theta, order)
    residual, scale = kernels.find_strays(basis, r, weight, N_ROUNDS, TUKEY)
    # Weights that bend the tails of the noise would make it look smaller: all or nothing.
    inside = residual < OUTLYING * scale
    theta, r, weight = theta[inside], r[inside], weight[inside]
    return _by_criterion(basis[inside], r, weight, within, spans)


def _by_criterion(
    basis: Array,
    r: Array,
    weight: Array,
    within: float,
    spans: tuple[tuple[float, float], ...],
) -> SectionCurve:
    """The order with the least criterion: all of them from one orthogonal decomposition."""
    root, n = np.sqrt(weight), int(np.sum(weight))
    upper, parts = _orthogonalise(basis * root[:, None], r * root)
    max_order = (basis.shape[1] - 1) // 2
    # Sum of squares that is left with the first 2k + 1 terms.
    left = float(np.sum((r * root) ** 2)) - np.cumsum(parts**2)[::2] + within
    left = np.maximum(left, n * 1e-18)
    p = 2.0 * np.arange(max_order + 1) + 2.0  # the noise is one more
    aic = n * np.log(left / n) + 2 * p + 2 * p * (p + 1) / np.maximum(n - p - 1, 1)
    order = int(np.argmin(aic))
    size = 2 * order + 1
    noise = float(np.sqrt(left[order] / max(n - size, 1)))
    inverse = _inverted(upper[:size, :size])
    return SectionCurve(
        coefficients=inverse @ parts[:size],
        root=noise * inverse,
        order=order,
        aic_by_order=aic,
        noise=noise,
        spans=spans,
        n_points=n,
    )


def _orthogonalise(a: Array, b: Array) -> tuple[Array, Array]:
    """Triangle R of a = Q R, and Qᵀ b: modified Gram-Schmidt, stable with b taken along.

    The library's routines start threads even for so few columns, and wait for them longer
    than they compute.
    """
    upper = np.empty((a.shape[1], a.shape[1] + 1))
    kernels.orthogonalise(np.column_stack([a, b]), upper)
    return upper[:, :-1], upper[:, -1]


def _inverted(upper: Array) -> Array:
    """Inverse of a triangle, from its last row up."""
    inverse = np.zeros_like(upper)
    for i in range(len(upper) - 1, -1, -1):
        inverse[i] = -upper[i, i + 1 :] @ inverse[i + 1 :]
        inverse[i, i] += 1.0
        inverse[i] /= upper[i, i]
    return inverse


def _basis(theta: Array, order: int, derivative: int = 0) -> Array:
    """Terms of the series, or of its derivative, at angles of any shape, one more axis."""
    k = np.arange(1, order + 1)
    phase = theta[..., None] * k + derivative * np.pi / 2
    terms = np.empty((*np.shape(theta), 2 * order + 1))
    terms[..., 0] = 0.0 if derivative else 1.0
    terms[..., 1::2] = k**derivative * np.cos(phase)
    terms[..., 2::2] = k**derivative * np.sin(phase)
    return terms


def _spans(theta: Array, max_gap: float) -> tuple[tuple[float, float], ...]:
    """Arcs between gaps wider than `max_gap`."""
    ordered = np.sort(theta)
    gap = np.diff(ordered, append=ordered[0] + 2 * np.pi)
    last = np.flatnonzero(gap > max_gap)
    if len(last) == 0:
        return ((0.0, 2 * np.pi),)
    first = np.roll((last + 1) % len(ordered), 1)
    starts, ends = ordered[first], ordered[last]
    ends = np.where(ends < starts, ends + 2 * np.pi, ends)
    # A lone point between two holes is no arc.
    return tuple((float(a), float(b)) for a, b in zip(starts, ends, strict=True) if b - a > STEP)


def _in_cells(theta: Array, r: Array) -> tuple[Array, Array, Array, float]:
    """Mean angle and radius of cells of half a degree, their counts, and what they hide."""
    index = np.minimum((theta * (N_CELLS / (2 * np.pi))).astype(np.intp), N_CELLS - 1)
    count = np.bincount(index, minlength=N_CELLS)
    some = count > 0
    n = count[some].astype(np.float64)
    middle = np.bincount(index, theta, minlength=N_CELLS)[some] / n
    mean = np.bincount(index, r, minlength=N_CELLS)[some] / n
    hidden = float(np.sum(r**2) - np.sum(n * mean**2))
    return middle, mean, n, max(hidden, 0.0)
