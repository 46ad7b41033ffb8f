"""What was refused and is worth a look: near its limit, of no accepted element, each body once."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.gates.refusals import Shortfall
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.surface_fits import ArcSurface, LineSurface, SphereSurface
from pipecore.surface import Surface
from pipecore.types.candidate import Candidate
from pipecore.types.element import ElementKind

NEAR = 2.0
"""Refused by more than this many times a limit is nothing that a person would call a pipe."""
MIN_OWN_SHARE = 0.5
"""At least this share of its points is on no element, and on no candidate before it."""
MIN_POINTS = 15
"""As many points of its own as an element has at least."""
MOST = 50
"""So many are shown: a person looks through them in a few minutes. The others are counted."""


@dataclass(eq=False)
class NotAccepted:
    """Collects what is refused.

    Parameters
    ----------
    surface : Surface
        The downsampled points.
    is_free : ndarray of bool
        Downsampled points on no element; it is looked at when all are accepted.
    """

    surface: Surface
    is_free: NDArray[np.bool_]
    _refused: list[tuple[FittedElement, Shortfall]] = field(default_factory=list)

    def add(self, found: FittedElement, why: Shortfall) -> None:
        """Remember a refused element, if it is near its limit.

        Parameters
        ----------
        found : FittedElement
        why : Shortfall
        """
        if why.excess <= NEAR and len(found.inliers) >= MIN_POINTS:
            self._refused.append((found, why))

    def add_dropped(self, found: FittedElement, why: Shortfall) -> None:
        """Remember one that was accepted at first: its points are its own again.

        Parameters
        ----------
        found : FittedElement
        why : Shortfall
        """
        self.is_free[found.inliers] = True
        self.add(found, why)

    def candidates(self) -> tuple[tuple[Candidate, ...], int]:
        """Return those worth a look, the nearest to their limits first, and how many more.

        Of refusals of one body the one with most points stands for it.

        Returns
        -------
        candidates : tuple of Candidate
        n_more : int
        """
        is_open = self.is_free.copy()
        bodies = []
        # Position breaks ties, so that the order of the proposals is no matter.
        for found, why in sorted(
            self._refused,
            key=lambda r: (-len(r[0].inliers), r[1].excess, *np.round(r[0].axis.at(0.0), 6)),
        ):
            own = is_open[found.inliers]
            if own.sum() < MIN_POINTS or own.mean() < MIN_OWN_SHARE:
                continue
            is_open[found.inliers] = False
            bodies.append((found, why))
        bodies.sort(key=lambda r: r[1].excess / np.log1p(len(r[0].inliers)))
        shown = tuple(_candidate(i, *body) for i, body in enumerate(bodies[:MOST], start=1))
        return shown, max(len(bodies) - MOST, 0)


def _candidate(candidate_id: int, found: FittedElement, why: Shortfall) -> Candidate:
    model = found.fit.model
    start, end = found.radii
    kind = ElementKind.CYLINDER
    if isinstance(model, SphereSurface):
        kind = ElementKind.SPHERE
    elif isinstance(model, ArcSurface):
        kind = ElementKind.TORUS
    elif model.is_tapered:
        kind = ElementKind.CONE
    return Candidate(
        candidate_id=candidate_id,
        kind=kind,
        axis=found.axis,
        radius=float(start),
        radius_sd=found.radius_sd,
        radius_end=float(end),
        arc=found.extent.arc,
        rms=found.fit.sigma,
        n_points=len(found.inliers),
        reason=why.reason,
        value=why.value,
        limit=why.limit,
        unit=why.unit,
        centre=np.full(3, np.nan) if isinstance(model, LineSurface) else model.centre,
    )
