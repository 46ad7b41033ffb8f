"""Dent strain after ASME B31.8, appendix R: indicative only."""

import numpy as np


def dent_strain(
    *,
    depth: float,
    length: float,
    curvature_along: float,
    curvature_around: float,
    radius: float,
    wall: float,
) -> float:
    """Return the larger of the equivalent strains at the inner and the outer surface.

    Strains are positive where the dent bends the outer surface inward: the circumferential
    curvature 1/R₁ is signed (negative where the section is re-entrant), the axial one
    counts as a magnitude.

    Parameters
    ----------
    depth, length : float
        Metres.
    curvature_along, curvature_around : float
        Second derivatives of the dent's surface at its bottom (magnitudes), 1/metres.
    radius, wall : float
        Outside radius of the undented pipe and wall thickness, metres.

    Notes
    -----
    ε₁ = (t/2)(1/R₀ − 1/R₁), ε₂ = t/(2 R₂), ε₃ = ½ (d/L)²;
    ε = 2/√3 · √(ε₁² + ε₁(ε₂ + ε₃) + (ε₂ + ε₃)²), outside with −ε₁ and −ε₂.
    1/R₁ from the polar section r(θ) = radius − depth + ½ r″θ², r′ = 0.
    """
    bottom = radius - depth
    second = curvature_around * radius**2
    bent = (bottom - second) / bottom**2
    around = wall / 2 * (1 / radius - bent)
    along = wall / 2 * curvature_along
    stretch = 0.5 * (depth / length) ** 2

    def equivalent(e1: float, e23: float) -> float:
        return float(2 / np.sqrt(3) * np.sqrt(e1**2 + e1 * e23 + e23**2))

    return max(equivalent(around, along + stretch), equivalent(-around, -along + stretch))
