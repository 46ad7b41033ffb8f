"""Dimensions of real pipes and fittings, for random scenes."""

from dataclasses import dataclass

INCH = 0.0254


@dataclass(frozen=True)
class PipeSize:
    """Outside diameters of an ASME B36.10 pipe and its EN 1092-1 PN 16 flange, metres."""

    dn: int
    inches: float
    outside_diameter: float
    flange_diameter: float
    flange_thickness: float
    n_bolts: int

    @property
    def radius(self) -> float:
        """Outside radius of the pipe."""
        return self.outside_diameter / 2

    def bend_radius(self, diameters: float) -> float:
        """Bend radius of an elbow of so many nominal diameters (1.5 is a long-radius one)."""
        return diameters * self.inches * INCH


SIZES = tuple(
    PipeSize(dn, inches, od / 1000, flange / 1000, thickness / 1000, n_bolts)
    for dn, inches, od, flange, thickness, n_bolts in (
        (40, 1.5, 48.3, 150, 18, 4),
        (50, 2, 60.3, 165, 18, 4),
        (80, 3, 88.9, 200, 20, 8),
        (100, 4, 114.3, 220, 20, 8),
        (125, 5, 141.3, 250, 22, 8),
        (150, 6, 168.3, 285, 22, 8),
        (200, 8, 219.1, 340, 24, 12),
        (250, 10, 273.0, 405, 26, 12),
        (300, 12, 323.8, 460, 28, 12),
        (350, 14, 355.6, 520, 30, 16),
        (400, 16, 406.4, 580, 32, 16),
    )
)
