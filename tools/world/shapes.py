"""What makes a pipe's surface differ from a cylinder: metres added to its radius.

A shape is a callable of chainage (metres) and angle (radians), each of shape (n,).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tools.world.surfaces import Array

Shape = Callable[[Array, Array], Array]


def smooth_window(s: Array, start: float, end: float, ramp: float) -> Array:
    """Return 1 between `start` and `end`, 0 outside, with cosine ramps inside the ends."""
    inside = np.clip(np.minimum(s - start, end - s) / ramp, 0.0, 1.0)
    return (1.0 - np.cos(np.pi * inside)) / 2


@dataclass(frozen=True)
class Oval:
    """Harmonics 2 and 3 of the section.

    Parameters
    ----------
    radius : float
    ovality : float
        (Dmax − Dmin) / Dnom of harmonic 2, which alone changes diameters.
    three_lobed : float
        Amplitude of harmonic 3 as a share of that of harmonic 2.
    phase, turn : float
        Angle of the widest diameter at the start, radians, and its change per metre.
    start, end, ramp : float
        Where it is, metres; everywhere by default.
    """

    radius: float
    ovality: float
    three_lobed: float = 0.0
    phase: float = 0.0
    turn: float = 0.0
    start: float = -np.inf
    end: float = np.inf
    ramp: float = 1.0

    def __call__(self, s: Array, theta: Array) -> Array:
        angle = theta - self.phase - self.turn * s
        wave = np.cos(2 * angle) + self.three_lobed * np.cos(3 * angle)
        amplitude = self.radius * self.ovality / 2
        return amplitude * wave * smooth_window(s, self.start, self.end, self.ramp)


@dataclass(frozen=True, eq=False)
class Waves:
    """A random correlated surface: cosines around and along.

    It holds neither the mean nor harmonics 0 to 3 of the section, which are the pipe's own.

    Parameters
    ----------
    sd : float
        Standard deviation, metres.
    around : ndarray of int
        Numbers of waves around.
    along, phase : ndarray
        Radians per metre along, and phases.
    """

    sd: float
    around: Array
    along: Array
    phase: Array

    @classmethod
    def draw(
        cls,
        rng: np.random.Generator,
        sd: float,
        around: tuple[int, int],
        wavelength: tuple[float, float],
        n: int = 24,
    ) -> "Waves":
        """Draw `n` waves with numbers around and wavelengths (metres) within bounds."""
        low, high = np.log(wavelength)
        return cls(
            sd,
            rng.integers(around[0], around[1] + 1, n).astype(np.float64),
            2 * np.pi / np.exp(rng.uniform(low, high, n)),
            rng.uniform(0, 2 * np.pi, n),
        )

    def __call__(self, s: Array, theta: Array) -> Array:
        total = np.zeros(np.broadcast(s, theta).shape)
        for m, k, phase in zip(self.around, self.along, self.phase, strict=True):
            total += np.cos(m * theta + k * s + phase)
        return total * self.sd * np.sqrt(2 / len(self.around))


@dataclass(frozen=True)
class Steps:
    """Cladding: sheets of `pitch` metres that overlap, every other one `height` higher."""

    height: float
    pitch: float

    def __call__(self, s: Array, theta: Array) -> Array:
        return self.height * (np.mod(np.floor(s / self.pitch), 2) - 0.5) + 0.0 * theta


@dataclass(frozen=True)
class Bands:
    """Straps of `width` metres about an insulation, one each `pitch` metres."""

    height: float
    pitch: float
    width: float

    def __call__(self, s: Array, theta: Array) -> Array:
        return np.where(np.mod(s, self.pitch) < self.width, self.height, 0.0) + 0.0 * theta


@dataclass(frozen=True)
class Crumple:
    """Rings of alternating sign, `amplitude` metres, over a stretch."""

    amplitude: float
    wavelength: float
    start: float
    end: float

    def __call__(self, s: Array, theta: Array) -> Array:
        wave = np.sin(2 * np.pi * (s - self.start) / self.wavelength)
        window = smooth_window(s, self.start, self.end, (self.end - self.start) / 4)
        return self.amplitude * wave * window + 0.0 * theta


def _rim(rho: Array) -> Array:
    return np.exp(-4 * rho**2) - 0.2 * np.exp(-(((rho - 1) / 0.25) ** 2))


DENT_PROFILES: dict[str, Callable[[Array], Array]] = {
    "cosine": lambda rho: np.where(rho < 1, np.cos(np.pi * np.minimum(rho, 1) / 2) ** 2, 0.0),
    "gauss": lambda rho: np.exp(-4 * rho**2),
    "sech": lambda rho: 1 / np.cosh(np.minimum(4.6 * rho, 300)),
    "lorentz": lambda rho: 1 / (1 + (2.46 * rho) ** 2) ** 2,
    "parabola": lambda rho: np.maximum(1 - rho**2, 0.0),
    "vee": lambda rho: np.maximum(1 - rho, 0.0),
    "rim": _rim,
    "skew": lambda rho: np.where(rho < 1, np.cos(np.pi * np.minimum(rho, 1) / 2) ** 2, 0.0),
}
"""Depth over the largest depth, by distance from the peak over half of the footprint.

The ones that have no edge have fallen to 2 % at 1; a "skew" dent's peak lies off its middle.
"""
_SKEW = 0.5


@dataclass(frozen=True)
class Dent:
    """A dent with an elliptical footprint.

    Parameters
    ----------
    depth, length, width : float
        Metres; `length` along the pipe and `width` around it are the whole footprint's.
    chainage, angle : float
        Of its peak.
    radius : float
        Of the pipe.
    profile : str
        A key of `DENT_PROFILES`.
    """

    depth: float
    length: float
    width: float
    chainage: float
    angle: float
    radius: float
    profile: str = "cosine"

    @property
    def start(self) -> float:
        share = (1 - _SKEW) / 2 if self.profile == "skew" else 0.5
        return self.chainage - share * self.length

    @property
    def end(self) -> float:
        return self.start + self.length

    def __call__(self, s: Array, theta: Array) -> Array:
        offset = s - self.chainage
        half = np.where(offset < 0, self.chainage - self.start, self.end - self.chainage)
        turn = np.mod(theta - self.angle + np.pi, 2 * np.pi) - np.pi
        rho = np.hypot(offset / half, turn * self.radius / (self.width / 2))
        return -self.depth * DENT_PROFILES[self.profile](rho)
