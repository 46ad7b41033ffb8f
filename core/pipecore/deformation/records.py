"""Deformations as they are reported, made of what was fitted."""

import numpy as np

from pipecore.deformation.bump import Bump
from pipecore.deformation.centre_line import CentreLine
from pipecore.deformation.contour import Contour
from pipecore.deformation.element_surface import ElementSurface
from pipecore.deformation.ovality import OvalStretch
from pipecore.deformation.patches import Patch
from pipecore.deformation.profile_shapes import CrumpledStretch
from pipecore.deformation.strain import dent_strain
from pipecore.geometry import Array, surface_points
from pipecore.reasons import Reason
from pipecore.types import NO_ID, Deformation, DeformationKind, Element, SeenBy

STRAIN_SIGNIFICANCE = 5.0
"""Least depth over its standard deviation that a strain is given for."""


def describe_patch(
    element: Element,
    surface: ElementSurface,
    contour: Contour,
    patch: Patch,
    wall_thickness: float,
) -> Deformation:
    """Return a dent or bulge as it is reported.

    Parameters
    ----------
    element : Element
    surface : ElementSurface
    contour : Contour
        That it was measured against.
    patch : Patch
    wall_thickness : float
        Metres; 0 if not known.

    Returns
    -------
    Deformation
        What its points do not show is nan, with the reason.
    """
    grid, bump = surface.grid, patch.bump
    depth = abs(bump.height)
    radius = float(element.radius_at(patch.chainage))
    inside = patch.cells(grid).ravel()[surface.cell] & surface.belongs
    strain, why = _strain(bump, radius, wall_thickness)
    if not bump.is_peak_seen:
        why = dict.fromkeys(("depth", "volume", *why), Reason("too few points at its peak"))
    return Deformation(
        deformation_id=NO_ID,
        element_id=element.element_id,
        kind=DeformationKind.DENT if bump.height < 0 else DeformationKind.BULGE,
        seen_by=(SeenBy.MAP,),
        chainage=patch.chainage,
        chainage_start=max(patch.chainage - patch.span / 2, 0.0),
        chainage_end=min(patch.chainage + patch.span / 2, element.axis.length),
        clock=patch.clock,
        peak=_peak_point(element, contour, patch.chainage, patch.clock, bump.height),
        depth=depth if bump.is_peak_seen else np.nan,
        depth_sd=bump.height_sd if bump.is_peak_seen else np.nan,
        length=bump.length,
        width=bump.width,
        strain=strain if bump.is_peak_seen else np.nan,
        n_points=int(np.count_nonzero(inside)),
        significance=abs(patch.z),
        area=bump.area,
        volume=bump.volume if bump.is_peak_seen else np.nan,
        not_measurable=why,
    )


def describe_oval(
    element: Element,
    surface: ElementSurface,
    contour: Contour,
    oval: OvalStretch,
    *,
    is_twisted: bool,
) -> Deformation:
    """Return an oval stretch as it is reported; its depth is how far it leaves the circle.

    Parameters
    ----------
    element : Element
    surface : ElementSurface
    contour : Contour
        That it was measured on.
    oval : OvalStretch
    is_twisted : bool
        Whether its direction turns along it.

    Returns
    -------
    Deformation
    """
    grid = surface.grid
    row = surface.cell[surface.belongs] // grid.n_columns
    chainage = float(grid.chainages[oval.peak])
    return Deformation(
        deformation_id=NO_ID,
        element_id=element.element_id,
        kind=DeformationKind.TWIST if is_twisted else DeformationKind.OVALITY,
        seen_by=(SeenBy.AXES,),
        chainage=chainage,
        chainage_start=oval.first * grid.row_size,
        chainage_end=(oval.last + 1) * grid.row_size,
        clock=oval.clock,
        peak=_peak_point(element, contour, chainage, oval.clock, 0.0),
        depth=oval.ovality * grid.radius / 2,
        depth_sd=oval.ovality_sd * grid.radius / 2,
        length=(oval.last + 1 - oval.first) * grid.row_size,
        width=2 * np.pi * grid.radius,
        ovality=oval.ovality,
        n_points=int(np.count_nonzero((row >= oval.first) & (row <= oval.last))),
        significance=oval.z,
    )


def describe_crumple(
    element: Element, surface: ElementSurface, contour: Contour, stretch: CrumpledStretch
) -> Deformation:
    """Return a crumple as it is reported; its depth is that of its largest ring.

    Parameters
    ----------
    element : Element
    surface : ElementSurface
    contour : Contour
    stretch : CrumpledStretch

    Returns
    -------
    Deformation
    """
    grid = surface.grid
    chainage = float(grid.chainages[stretch.peak])
    row = surface.cell[surface.belongs] // grid.n_columns
    start, end = stretch.first * grid.row_size, (stretch.last + 1) * grid.row_size
    return Deformation(
        deformation_id=NO_ID,
        element_id=element.element_id,
        kind=DeformationKind.CRUMPLE,
        seen_by=(SeenBy.AXES,),
        chainage=chainage,
        chainage_start=start,
        chainage_end=end,
        clock=stretch.clock,
        peak=_peak_point(element, contour, chainage, stretch.clock, stretch.height),
        depth=abs(stretch.height),
        depth_sd=stretch.sd,
        length=end - start,
        width=2 * np.pi * grid.radius,
        n_points=int(np.count_nonzero((row >= stretch.first) & (row <= stretch.last))),
        significance=abs(stretch.height) / stretch.sd,
    )


def describe_bow(
    element: Element, surface: ElementSurface, contour: Contour, line: CentreLine
) -> Deformation:
    """Return a bow or kink as it is reported.

    Parameters
    ----------
    element : Element
    surface : ElementSurface
    contour : Contour
        Fitted with a constant radius.
    line : CentreLine

    Returns
    -------
    Deformation
    """
    grid = surface.grid
    return Deformation(
        deformation_id=NO_ID,
        element_id=element.element_id,
        kind=DeformationKind.KINK if line.is_kink else DeformationKind.BOW,
        seen_by=(SeenBy.CENTRES,),
        chainage=line.chainage,
        chainage_start=0.0,
        chainage_end=grid.length,
        clock=line.clock,
        peak=_peak_point(element, contour, line.chainage, line.clock, 0.0),
        depth=line.straightness,
        depth_sd=line.straightness_sd,
        length=grid.length,
        width=2 * grid.radius,
        n_points=int(np.count_nonzero(surface.belongs)),
        significance=line.straightness / line.straightness_sd,
    )


def _strain(bump: Bump, radius: float, wall: float) -> tuple[float, dict[str, Reason]]:
    """Strain of a dent, or why it is not measurable; neither for a bulge."""
    if bump.height > 0:
        return np.nan, {}
    if wall == 0:
        return np.nan, {"strain": Reason("the wall thickness is not set")}
    if abs(bump.height) < STRAIN_SIGNIFICANCE * bump.height_sd:
        why = Reason(
            "the depth is less than {least} standard deviations", least=f"{STRAIN_SIGNIFICANCE:g}"
        )
        return np.nan, {"strain": why}
    strain = dent_strain(
        depth=abs(bump.height),
        length=bump.length,
        curvature_along=bump.curvature_along,
        curvature_around=bump.curvature_around,
        radius=radius,
        wall=wall,
    )
    return strain, {}


def _peak_point(
    element: Element, contour: Contour, chainage: float, clock: float, height: float
) -> Array:
    """The point on the deformed surface at a place, shape (3,)."""
    undeformed = contour.grid.interpolate(contour.height, np.array([chainage]), np.array([clock]))
    radius = float(element.radius_at(chainage)) + float(undeformed[0]) + height
    return surface_points(element.axis, chainage, radius, clock)
