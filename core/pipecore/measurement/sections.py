"""Profiles of elements: the normal stack across each one's own axis, and the stacks' ellipses."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipecore._kernels.grouping import group_from
from pipecore._kernels.section_circles import empty_circles, fit_sections
from pipecore.ellipses import (
    CIRCLE_PARAMETERS,
    ELLIPSE_PARAMETERS,
    FREE_FIT_ARC,
    LINE_PARAMETERS,
    Ellipses,
    akaike,
    fit_free_ellipses,
    line_rss,
    radius_sd_factor,
)
from pipecore.geometry import offsets_from_chord
from pipecore.settings import EllipseFit
from pipecore.types import OWN_STACK, Element, Profiles

Array = NDArray[np.float64]

MIN_POINTS = 8
ELLIPSE_SD_FACTOR = 2.4
"""Standard deviation of a free ellipse's axis at 240° of arc, in units of σ/√n."""


def cut_normal_stack(
    element: Element,
    places: tuple[Array, Array, Array],
    width: float,
    spacing: float,
    fit: EllipseFit = EllipseFit.DIRECT,
    check: Callable[[], None] = lambda: None,
) -> Profiles:
    """Cut an element's points into profiles across its own axis and fit each.

    Parameters
    ----------
    element : Element
    places : tuple of ndarray
        Pipe coordinates (n,) of the points of its surface.
    width : float
        Profile width, metres.
    spacing : float
        Distance between neighbouring points, metres; wider gaps around the axis are not
        counted as seen.
    fit : EllipseFit
        How free ellipses are fitted.
    check : callable
        Called between slow fits; may raise to cancel.

    Returns
    -------
    Profiles
        One row per profile with at least eight points and a circle, `stack_id` is
        `OWN_STACK`. Semi-axes and ovality are those of the free ellipse where the points
        cover 240° or more and carry one. On shorter arcs that fit collapses and even a free
        circle follows a dent outwards, so there the ellipse is the circle about the
        element's axis, and the ovality not measurable.
    """
    axis = element.axis
    chainage, rho, clock = places
    index = np.where((chainage >= 0) & (chainage < axis.length), chainage / width, -1.0)
    n_rows = int(axis.length / width) + 1
    order, starts = group_from(index.astype(np.int32), 0, n_rows)
    counts = np.diff(starts)
    rows = np.flatnonzero(counts)
    starts = np.append(starts[rows], starts[-1])
    index = np.repeat(rows, counts[rows])
    # Up and right of the axis, scaled so that a cone's or sphere's taper within a profile
    # does not thicken the section.
    middle = np.asarray((index + 0.5) * width, np.float64)
    taper = element.radius_at(middle) - element.radius_at(chainage[order])
    rho, clock = rho[order] + taper, clock[order]
    up_right = np.stack([rho * np.cos(clock), rho * np.sin(clock)], axis=1)
    if len(rows) == 0:
        return Profiles.empty()
    circles = empty_circles(len(rows))
    fit_sections(
        np.ascontiguousarray(up_right[:, 0]), np.ascontiguousarray(up_right[:, 1]),
        starts, 4.0 * spacing, circles,
    )  # fmt: skip
    n_points = np.diff(starts)
    radius, rms, arc = circles.radius, circles.rms, circles.arc
    is_long = (arc >= FREE_FIT_ARC) & (n_points >= 12)
    free = fit_free_ellipses(up_right, starts, is_long, fit, check)
    is_free = is_long & np.isfinite(free.semi_minor)
    about_axis = np.add.reduceat(rho, starts[:-1]) / n_points
    semi_minor = np.where(is_free, free.semi_minor, about_axis)
    semi_major = np.where(is_free, free.semi_major, about_axis)
    angle = np.where(is_free, free.angle, 0.0)

    at = np.asarray((rows + 0.5) * width, np.float64)
    up, right = axis.frame(at)
    off_axis = np.stack([circles.centre_x, circles.centre_y], axis=1)
    # A sphere has no radius at its poles.
    nominal = np.maximum(element.radius_at(at), 1e-9)
    table = Profiles(
        element_id=np.full(len(rows), element.element_id, np.int32),
        stack_id=np.full(len(rows), OWN_STACK, np.int32),
        profile_index=rows.astype(np.int32),
        chainage=at,
        centre=axis.at(at) + circles.centre_x[:, None] * up + circles.centre_y[:, None] * right,
        normal=np.array(axis.tangent(at)),
        major_direction=np.cos(angle)[:, None] * up + np.sin(angle)[:, None] * right,
        semi_minor=semi_minor,
        semi_major=semi_major,
        semi_minor_sd=np.where(is_free, ELLIPSE_SD_FACTOR, 1.0) * rms / np.sqrt(n_points),
        radius=radius,
        radius_sd=rms * radius_sd_factor(arc) / np.sqrt(n_points),
        ovality=np.where(is_free, (semi_major - semi_minor) / nominal, np.nan),
        centre_deviation=np.hypot(*(off_axis + offsets_from_chord(axis, at)).T),
        radius_deviation=radius - nominal,
        arc=arc,
        n_points=n_points.astype(np.int32),
        rms=rms,
        aic_line=akaike(LINE_PARAMETERS, n_points, line_rss(up_right, starts)),
        aic_ellipse=np.where(
            is_free,
            akaike(ELLIPSE_PARAMETERS, n_points, free.rss),
            akaike(CIRCLE_PARAMETERS, n_points, rms**2 * n_points),
        ),
    )
    with np.errstate(invalid="ignore"):
        return table[(n_points >= MIN_POINTS) & (radius > 0) & (arc > np.deg2rad(40.0))]


def tabulate_ellipses(elements: tuple[Element, ...], ellipses: Ellipses) -> Profiles:
    """Tabulate the stacks' ellipses by the elements whose surfaces they cut.

    An ellipse belongs to an element if its centre is near the axis, its direction along it and
    its radius near the element's there.

    Parameters
    ----------
    elements : tuple of Element
    ellipses : Ellipses
        Of all stacks.

    Returns
    -------
    Profiles
        Element by element; of each in the order of stack and chainage.
    """
    tables = []
    free = np.ones(len(ellipses), np.bool_)
    tree = cKDTree(ellipses.centre) if len(ellipses) else None
    slack = 2 * ellipses.radius_sd
    most_slack = float(slack.max(initial=0.0))
    for element in elements:
        axis = element.axis
        near = _near_axis(tree, element, most_slack)
        near = near[free[near]]
        chainage, rho, _ = axis.pipe_coordinates(ellipses.centre[near])
        expected = element.radius_at(np.clip(chainage, 0.0, axis.length))
        along = np.abs(np.einsum("ij,ij->i", axis.tangent(chainage), ellipses.axis[near]))
        is_on = (
            (chainage >= 0)
            & (chainage <= axis.length)
            & (rho < 0.25 * expected + slack[near])
            & (np.abs(ellipses.radius[near] - expected) < 0.25 * expected + slack[near])
            & (along > np.cos(np.deg2rad(20.0)))
        )
        rows, at, rho, expected = near[is_on], chainage[is_on], rho[is_on], expected[is_on]
        free[rows] = False
        e = ellipses[rows]
        table = Profiles(
            element_id=np.full(len(rows), element.element_id, np.int32),
            stack_id=e.stack_id,
            profile_index=e.profile_index,
            chainage=at,
            centre=e.centre,
            normal=e.normal,
            major_direction=e.major_direction,
            semi_minor=e.semi_minor,
            semi_major=e.semi_major,
            semi_minor_sd=e.radius_sd,
            radius=e.radius,
            radius_sd=e.radius_sd,
            ovality=np.full(len(rows), np.nan),
            centre_deviation=rho,
            radius_deviation=e.radius - expected,
            arc=e.arc,
            n_points=e.n_points,
            rms=e.rms,
            aic_line=e.aic_line,
            aic_ellipse=e.aic_ellipse,
        )
        tables.append(table[np.lexsort((at, e.stack_id))])
    return Profiles.concatenate(tables)


def _near_axis(tree: cKDTree | None, element: Element, slack: float) -> NDArray[np.intp]:
    """Ellipses whose centres may be an element's, in order: in balls along its axis."""
    if tree is None:
        return np.empty(0, np.intp)
    axis = element.axis
    reach = 0.25 * max(element.radius, element.radius_end) + slack
    n = int(np.ceil(axis.length / (2 * reach))) + 1
    places = axis.at((np.arange(n) + 0.5) * axis.length / n)
    balls = tree.query_ball_point(places, reach + 0.5 * axis.length / n + 1e-9)
    return np.unique(np.concatenate([np.asarray(b, np.intp) for b in balls]))
