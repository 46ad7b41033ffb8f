"""A deformed section as a smooth curve: a Fourier series whose order Akaike's criterion chooses.

    r(θ) = c₀ + Σₖ aₖ cos kθ + bₖ sin kθ,    k = 1 … order

The curve is closed where points go all round. Where they do not, it stands for the arcs
that hold points only: elsewhere it is nan, since a series says nothing there. Its
curvature (paper, figures 14 and 15) is 1/r on a circle, less in a dent's bottom,
negative where the section is re-entrant, and more on a dent's shoulders.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipecore._kernels import fourier_series as kernels
from pipecore.ellipses.nonlinear import NoFit
from pipecore.geometry import Array
from pipecore.reasons import Reason

MAX_ORDER = 10
"""Waves of a tenth of the circumference: shorter ones are noise in a terrestrial scan."""

MAX_GAP = np.deg2rad(18.0)
"""A wider gap between neighbouring points is a hole: half of the shortest wave."""

MIN_ARC = np.deg2rad(60.0)
MIN_POINTS = 12

STEP = np.deg2rad(2.0)
LIMITS = kernels.SeriesLimits(
    points_per_parameter=3,
    min_span=STEP,  # A lone point between two holes is no arc.
    min_arc=MIN_ARC,
    max_points=1440,
    n_cells=720,  # More points are averaged in cells of half a degree: no wave is that short.
    n_rounds=5,
    tukey=4.7,
    outlying=4.0,
)


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
        """Return whether the curve is defined at clock angles.

        Parameters
        ----------
        clock : array_like
            Radians, any shape.

        Returns
        -------
        ndarray of bool, shape of clock
        """
        theta = np.asarray(clock, dtype=np.float64)
        seen = np.zeros(theta.shape, dtype=bool)
        for start, end in self.spans:
            seen |= np.mod(theta - start, 2 * np.pi) <= end - start + 1e-12
        return seen

    def radius_at(self, clock: ArrayLike) -> Array:
        """Return the distance from the axis at clock angles.

        Parameters
        ----------
        clock : array_like
            Radians, any shape.

        Returns
        -------
        ndarray, shape of clock
            Metres; nan where not seen.
        """
        theta = np.asarray(clock, dtype=np.float64)
        r = _basis(theta, self.order) @ self.coefficients
        return np.asarray(np.where(self.is_seen(theta), r, np.nan))

    def radius_sd_at(self, clock: ArrayLike) -> Array:
        """Return the standard deviation of `radius_at`.

        Parameters
        ----------
        clock : array_like
            Radians, any shape.

        Returns
        -------
        ndarray, shape of clock
            Metres; nan where not seen.
        """
        theta = np.asarray(clock, dtype=np.float64)
        sd = np.linalg.norm(_basis(theta, self.order) @ self.root, axis=-1)
        return np.asarray(np.where(self.is_seen(theta), sd, np.nan))

    def curvature_at(self, clock: ArrayLike) -> Array:
        """Return the signed curvature at clock angles, (r² + 2r′² − r r″) / (r² + r′²)^{3/2}.

        Positive where the section bulges outward, as a circle does everywhere.

        Parameters
        ----------
        clock : array_like
            Radians, any shape.

        Returns
        -------
        ndarray, shape of clock
            1/metres; nan where not seen.
        """
        theta = np.asarray(clock, dtype=np.float64)
        r, slope, bend = (_basis(theta, self.order, k) @ self.coefficients for k in range(3))
        curvature = (r**2 + 2 * slope**2 - r * bend) / (r**2 + slope**2) ** 1.5
        return np.asarray(np.where(self.is_seen(theta), curvature, np.nan))

    def curvature_sd_at(self, clock: ArrayLike) -> Array:
        """Return the standard deviation of `curvature_at`.

        Of r″ only, sd(r″) / r², which is by far the largest part.

        Parameters
        ----------
        clock : array_like
            Radians, any shape.

        Returns
        -------
        ndarray, shape of clock
            1/metres; nan where not seen.
        """
        theta = np.asarray(clock, dtype=np.float64)
        r = _basis(theta, self.order) @ self.coefficients
        sd = np.linalg.norm(_basis(theta, self.order, 2) @ self.root, axis=-1) / r**2
        return np.asarray(np.where(self.is_seen(theta), sd, np.nan))

    def clocks(self, step: float = STEP) -> list[Array]:
        """Return clock angles from end to end of every span, to draw the curve by.

        Parameters
        ----------
        step : float
            Largest distance between them, radians.

        Returns
        -------
        list of ndarray
            Radians, one array for each span.
        """
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
        return float(kernels.curvature_variation(theta, self.coefficients, self.root))


def fit_section(
    clock: ArrayLike, rho: ArrayLike, *, max_order: int = MAX_ORDER, max_gap: float = MAX_GAP
) -> SectionCurve | NoFit:
    """Fit a smooth curve to the points of a section.

    Points far off the curve, by Tukey's weights at the highest order, are left out.

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
        `NoFit`, which is false and gives the reason, where the points do not define a curve.
    """
    theta = np.mod(np.asarray(clock, dtype=np.float64), 2 * np.pi)
    r = np.asarray(rho, dtype=np.float64)
    if theta.shape != r.shape or theta.ndim != 1:
        raise ValueError("clock and rho must be one-dimensional and of one length")
    known = np.isfinite(theta) & np.isfinite(r)
    theta, r = theta[known], r[known]
    n = len(theta)
    if n < MIN_POINTS:
        return NoFit(Reason("only {n} points, {needed} are needed", n=n, needed=MIN_POINTS))
    spans, n_points, aic, noise, coefficients, root = kernels.fit_series(
        theta, r, max_order, max_gap, LIMITS
    )
    if len(coefficients) == 0:
        arc = float((spans[:, 1] - spans[:, 0]).sum())
        return NoFit(
            Reason(
                "{seen}° of arc, {needed}° are needed",
                seen=f"{np.rad2deg(arc):.0f}",
                needed=f"{np.rad2deg(MIN_ARC):.0f}",
            )
        )
    return SectionCurve(
        coefficients=coefficients,
        root=root,
        order=len(coefficients) // 2,
        aic_by_order=aic,
        noise=noise,
        spans=tuple((float(a), float(b)) for a, b in spans),
        n_points=int(n_points),
    )


def curvature_variations(
    clock: Array, rho: Array, first: NDArray[np.intp], last: NDArray[np.intp]
) -> Array:
    """`SectionCurve.curvature_variation` of many sections, nan where points carry no curve.

    Parameters
    ----------
    clock, rho : ndarray, shape (n,)
        As for `fit_section`, all finite.
    first, last : ndarray of int, shape (m,)
        The points of each section.
    """
    variation = np.empty(len(first))
    kernels.variations(
        np.mod(clock, 2 * np.pi), np.ascontiguousarray(rho), first, last,
        MIN_POINTS, MAX_ORDER, MAX_GAP, LIMITS, STEP, variation,
    )  # fmt: skip
    return variation


def _basis(theta: Array, order: int, derivative: int = 0) -> Array:
    """Terms of the series, or of its derivative, at angles of any shape, one more axis."""
    k = np.arange(1, order + 1)
    phase = theta[..., None] * k + derivative * np.pi / 2
    terms = np.empty((*np.shape(theta), 2 * order + 1))
    terms[..., 0] = 0.0 if derivative else 1.0
    terms[..., 1::2] = k**derivative * np.cos(phase)
    terms[..., 2::2] = k**derivative * np.sin(phase)
    return terms
