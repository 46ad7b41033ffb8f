"""The paper's criteria: where the profiles of an element leave the element's own pattern.

Each row of the map is a profile across the axis. Its mean radius, centre, second harmonic
and curvature (section 3.3.6, figures 8 and 12 to 15) are held against what the whole element
does: a radius that is constant or linear, or a sphere's semicircle (figure 7; the fitted
surface has that already), and centres on a slow curve. Windows of several lengths pool
neighbouring profiles, so that what is weak but long is seen as well as what is short.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import special, stats

from pipecore.deformation.contour import Contour, fit_contour, inner_rows
from pipecore.deformation.deviation_map import DeviationMap, Flags, Grid
from pipecore.deformation.free_sections import (
    CURVE_TERMS,
    ELLIPSE_TERMS,
    FreeSections,
    diameters,
    n_rows_of,
    offset_terms,
)
from pipecore.geometry import Array
from pipecore.robust import TUKEY_REACH, robust_sd, tukey_weights
from pipecore.types import SeenBy

WINDOWS = (0.0, 0.5, 1.0, 2.0)
"""Lengths over which profiles are pooled, radii; the first is a single profile."""

CURVE_WINDOW = 0.5
"""The same for the curvature, which needs the most points."""

MIN_LINE_ROWS, LINE_ROUNDS = 10, 8
"""Fewest profiles that a line through the radii is fitted to, and how often it is reweighted."""


@dataclass(frozen=True, eq=False)
class ProfileCriteria:
    """What the profiles of an element show, row by row of its map.

    Parameters
    ----------
    sections : FreeSections
    pattern : Contour
        The element's own: a cubic over its whole length.
    significance : float
        How many standard deviations a single test has to show.
    """

    sections: FreeSections
    pattern: Contour
    significance: float
    _fits: dict[float, tuple[Array, Array]] = field(default_factory=dict)

    @classmethod
    def of(cls, cells: DeviationMap, significance: float) -> "ProfileCriteria":
        """Return the criteria of a map of heights above an element's fitted surface.

        Parameters
        ----------
        cells : DeviationMap
        significance : float

        Returns
        -------
        ProfileCriteria
        """
        some = (cells.count > 0) & ~cells.in_contact
        variance = np.where(some, cells.noise**2 / np.maximum(cells.count, 1), np.inf)
        whole = cells.grid.length / (2 * cells.grid.radius)
        pattern = fit_contour(cells.grid, cells.deviation, variance, 3, knot_diameters=whole)
        return cls(FreeSections.of(cells), pattern, significance)

    @property
    def grid(self) -> Grid:
        """The grid of the map."""
        return self.sections.grid

    @cached_property
    def _expected(self) -> Array:
        """Terms of the pattern, as `FreeSections.fit` gives them, shape (rows, 5)."""
        expected = np.zeros((self.grid.n_rows, ELLIPSE_TERMS))
        expected[:, :3] = self.pattern.terms
        offset = offset_terms(expected[:, 1], expected[:, 2], self.grid.radius)
        expected[:, 0] -= offset[:, 0]
        # A radius is constant or linear: a cubic would follow a deformation a little.
        size = n_rows_of(self.grid, CURVE_WINDOW * self.grid.radius)
        radius = self.sections.pooled(size).fit(ELLIPSE_TERMS)[0][:, 0]
        known = np.isfinite(radius) & inner_rows(self.grid)
        if np.count_nonzero(known) >= MIN_LINE_ROWS:
            expected[:, 0] = _robust_line(self.grid.chainages, radius, known)
        return expected

    def deviations(self, window: float) -> tuple[Array, Array]:
        """Return what the sections of a window differ from the pattern by.

        Parameters
        ----------
        window : float
            Radii.

        Returns
        -------
        deviations : ndarray, shape (rows, 5)
            Of mean radius, centre and second harmonic, metres; nan where not measurable.
        covariance : ndarray, shape (rows, 5, 5)
        """
        if window not in self._fits:
            pooled = self.sections.pooled(n_rows_of(self.grid, window * self.grid.radius))
            terms, covariance = pooled.fit(ELLIPSE_TERMS)
            self._fits[window] = terms - self._expected, covariance
        return self._fits[window]

    def every_other(self, start: int) -> "ProfileCriteria":
        """Return the same of every other profile only.

        Parameters
        ----------
        start : int
            0 or 1.

        Returns
        -------
        ProfileCriteria
        """
        return ProfileCriteria(self.sections.every_other(start), self.pattern, self.significance)

    def radius_deviation(self, window: float) -> tuple[Array, Array]:
        """Return how much larger the mean radius of a window is than the pattern, with its SD.

        Where the arc does not carry an ellipse, the centre is that of the pattern: what only
        part of the section shows is then told apart by nothing from a shift of the centre.

        Parameters
        ----------
        window : float
            Radii.

        Returns
        -------
        deviation, sd : ndarray, shape (rows,)
            Metres; nan where there are no points.
        """
        deviation, covariance = self.deviations(window)
        rows, terms = self.grid.n_rows, self.pattern.terms
        moment = self.sections.moment - np.einsum(
            "rij,rj->ri", self.sections.normal[:, :, :3], terms
        )
        about = FreeSections(self.grid, self.sections.normal, moment, self.sections.arc)
        narrow, variance = about.pooled(n_rows_of(self.grid, window * self.grid.radius)).fit(1)
        is_wide = np.isfinite(deviation[:, 0])
        value = np.where(is_wide, deviation[:, 0], narrow[:, 0])
        sd = np.sqrt(np.where(is_wide, covariance[:, 0, 0], variance[:, 0, 0]))
        assert value.shape == (rows,)
        return value, sd

    @cached_property
    def seen(self) -> dict[SeenBy, Flags]:
        """Rows where each criterion is significant, shape (rows,) each."""
        flags = {c: np.zeros(self.grid.n_rows, bool) for c in (SeenBy.CENTRES, SeenBy.AXES)}
        for window in WINDOWS:
            deviation, covariance = self.deviations(window)
            places = self._places(window)
            flags[SeenBy.AXES] |= self.significant_radius(window)
            flags[SeenBy.AXES] |= self.significant_ovality(window)
            centre = _quadratic_form(deviation[:, 1:3], covariance[:, 1:3, 1:3])
            flags[SeenBy.CENTRES] |= self._is_significant(centre, 2, places)
        pooled = self.sections.pooled(n_rows_of(self.grid, CURVE_WINDOW * self.grid.radius))
        terms, covariance = pooled.fit(CURVE_TERMS)
        # Harmonics above the second bend the section more than an ellipse is bent.
        bent = slice(ELLIPSE_TERMS, CURVE_TERMS)
        curve = _quadratic_form(terms[:, bent], covariance[:, bent, bent])
        n_bent = CURVE_TERMS - ELLIPSE_TERMS
        flags[SeenBy.CURVATURE] = self._is_significant(curve, n_bent, self._places(CURVE_WINDOW))
        return flags

    def significant_radius(self, window: float) -> Flags:
        """Return the rows whose mean radius is significantly off the pattern.

        Parameters
        ----------
        window : float
            Radii.

        Returns
        -------
        ndarray of bool, shape (rows,)
        """
        radius, sd = self.radius_deviation(window)
        return self._is_significant((radius / sd) ** 2, 1, self._places(window))

    def significant_ovality(self, window: float) -> Flags:
        """Return the rows whose second harmonic is significant.

        Parameters
        ----------
        window : float
            Radii.

        Returns
        -------
        ndarray of bool, shape (rows,)
        """
        deviation, covariance = self.deviations(window)
        oval = _quadratic_form(deviation[:, 3:5], covariance[:, 3:5, 3:5])
        return self._is_significant(oval, 2, self._places(window))

    def diameters(self, first: int, last: int, window: float = CURVE_WINDOW) -> tuple[float, float]:
        """Return the largest and smallest diameter among rows; nan if the arc is too short.

        Parameters
        ----------
        first, last : int
            Both included.
        window : float
            Over which profiles are pooled, radii.

        Returns
        -------
        largest, smallest : float
            Metres.
        """
        pooled = self.sections.pooled(n_rows_of(self.grid, window * self.grid.radius))
        rows = slice(first, last + 1)
        terms = np.zeros((last + 1 - first, CURVE_TERMS))
        terms[:, :ELLIPSE_TERMS] = pooled.fit(ELLIPSE_TERMS)[0][rows]
        if window >= CURVE_WINDOW:
            curve = pooled.fit(CURVE_TERMS)[0][rows]
            terms = np.where(np.isfinite(curve), curve, terms)
        terms = terms[np.isfinite(terms).all(axis=1)]
        if len(terms) == 0:
            return np.nan, np.nan
        largest, smallest = diameters(terms, self.grid.radius)
        return float(largest.max()), float(smallest.min())

    def _places(self, window: float) -> float:
        """How many windows of a length there are: each is another chance to be far off."""
        return max(1.0, self.grid.n_rows / n_rows_of(self.grid, window * self.grid.radius))

    def _is_significant(self, chi2: Array, n_free: int, places: float) -> Flags:
        """Whether χ² of each row is, given how many are looked at.

        The element's own scatter widens what its points' noise explains: half of its rows
        are taken to be sound.
        """
        known = np.isfinite(chi2) & inner_rows(self.grid)
        if not known.any():
            return known
        usual = float(np.median(chi2[known])) / float(stats.chi2.median(n_free))
        scaled = np.where(known, chi2, 0.0) / max(usual, 1.0)
        log_p = stats.chi2.logsf(scaled, n_free) - np.log(2.0)
        z = -special.ndtri_exp(np.minimum(log_p, np.log(0.5)))
        return np.asarray(z**2 - 2 * np.log(places) >= self.significance**2)


def _robust_line(s: Array, values: Array, known: Flags) -> Array:
    """Values of a straight line through most of the known ones (Tukey's weights), at all s."""
    line = np.full(len(s), np.median(values[known]))
    design = np.stack([np.ones_like(s), s - s.mean()], axis=1)
    for _ in range(LINE_ROUNDS):
        off = values[known] - line[known]
        scale = max(TUKEY_REACH * robust_sd(off), 1e-9)
        root = np.sqrt(tukey_weights(off / scale))
        solution, *_ = np.linalg.lstsq(design[known] * root[:, None], values[known] * root, None)
        line = np.asarray(design @ solution)
    return line


def _quadratic_form(values: Array, covariance: Array) -> Array:
    """χ² of vectors (rows, k) with covariances (rows, k, k); nan where either is."""
    known = np.isfinite(values).all(axis=1)
    chi2 = np.full(len(values), np.nan)
    solved = np.linalg.solve(covariance[known], values[known][:, :, None])[:, :, 0]
    chi2[known] = np.einsum("ri,ri->r", values[known], solved)
    return chi2
