"""Ending straights, bends and reducers where one takes over from the other."""

import numpy as np

from pipecore.geometry import AnyAxis, ArcAxis, CurveAxis, LineAxis

MIN_BEND_ANGLE = float(np.deg2rad(5.0))
"""A bend is never trimmed to less than this angle."""
MIN_LENGTH_SHARE = 0.1
"""A straight is never trimmed to less than this share of the reach."""
REACH_RADII = 2.0
"""Ends move by at most this many radii to a tangent point."""


def trim_to_fitting(straight: AnyAxis, fitting: AnyAxis) -> tuple[AnyAxis, AnyAxis]:
    """Trim a straight and the fitting at its nearer end to where they meet.

    Parameters
    ----------
    straight : LineAxis or ArcAxis
        Anything but a line stays as it is.
    fitting : LineAxis or ArcAxis
        A reducer or a bend that was fitted to the straight.

    Returns
    -------
    straight, fitting : LineAxis or ArcAxis
    """
    if isinstance(fitting, CurveAxis) or isinstance(straight, ArcAxis):
        return straight, fitting
    if isinstance(straight, CurveAxis):
        middle = fitting.at(fitting.length / 2)
        end = int(np.linalg.norm(straight.end - middle) < np.linalg.norm(straight.start - middle))
        line = _end_line(straight, end)
        trimmed, fitting = trim_to_fitting(line, fitting)
        assert isinstance(trimmed, LineAxis)
        return _as_far_as(straight, line, trimmed), fitting
    if isinstance(fitting, LineAxis):
        return trim_to_reducer(straight, fitting), fitting
    middle = fitting.at(fitting.length / 2)
    end = int(np.linalg.norm(straight.end - middle) < np.linalg.norm(straight.start - middle))
    corner = straight.at((fitting.centre - straight.start) @ straight.direction)
    arc_end = int(np.linalg.norm(fitting.end - corner) < np.linalg.norm(fitting.start - corner))
    return trim_to_tangent(straight, end, fitting, arc_end, 0.5 * straight.length)


def trim_to_each_other(
    a: AnyAxis, end_a: int, b: AnyAxis, end_b: int, radius: float
) -> tuple[AnyAxis, AnyAxis]:
    """Trim a straight and a bend whose ends meet to their tangent point.

    Parameters
    ----------
    a, b : LineAxis or ArcAxis
        In any order; two straights or two bends stay as they are.
    end_a, end_b : int
        Which ends meet: 0 for the start, 1 for the end.
    radius : float
        Of the pipe, metres.

    Returns
    -------
    a, b : LineAxis or ArcAxis
    """
    if isinstance(a, ArcAxis) and not isinstance(b, ArcAxis):
        straight, bend = trim_to_each_other(b, end_b, a, end_a, radius)
        return bend, straight
    if not isinstance(b, ArcAxis) or isinstance(a, ArcAxis):
        return a, b
    line = _end_line(a, end_a)
    trimmed, arc = trim_to_tangent(line, end_a, b, end_b, REACH_RADII * radius)
    return _as_far_as(a, line, trimmed), arc


def _end_line(axis: LineAxis | CurveAxis, end: int) -> LineAxis:
    """The straight line in which an axis ends, with the chainages of the axis."""
    if isinstance(axis, LineAxis):
        return axis
    tangent = axis.tangent(axis.length if end else 0.0)
    start = axis.end - axis.length * tangent if end else axis.start
    return LineAxis(start, tangent, axis.length)


def _as_far_as(
    axis: LineAxis | CurveAxis, line: LineAxis, trimmed: LineAxis
) -> LineAxis | CurveAxis:
    """The axis between the chainages to which the line in which it ends was trimmed."""
    if trimmed is line:
        return axis
    if isinstance(axis, LineAxis):
        return trimmed
    low = float((trimmed.start - line.start) @ line.direction)
    return axis.part(low, low + trimmed.length)


def trim_to_tangent(
    line: LineAxis, line_end: int, arc: ArcAxis, arc_end: int, reach: float
) -> tuple[LineAxis, ArcAxis]:
    """Trim a straight and a bend to where the bend's centre is abreast of the straight.

    Parameters
    ----------
    line : LineAxis
    line_end : int
        Its end at the bend: 0 for the start, 1 for the end.
    arc : ArcAxis
    arc_end : int
        Its end at the straight.
    reach : float
        Nothing changes if either end would move by more than this, metres.

    Returns
    -------
    line : LineAxis
    arc : ArcAxis
    """
    along = float((arc.centre - line.start) @ line.direction)
    corner = line.at(along)
    spoke = corner - arc.centre
    ahead = np.cross(arc.normal, arc.towards_start)
    angle = float(np.arctan2(spoke @ ahead, spoke @ arc.towards_start))
    half = arc.bend_angle / 2
    angle = half + np.mod(angle - half + np.pi, 2 * np.pi) - np.pi
    line_change = abs(along - (line.length if line_end else 0.0))
    arc_change = abs(angle - (arc.bend_angle if arc_end else 0.0)) * arc.bend_radius
    if line_change > reach or arc_change > reach:
        return line, arc
    low, high = (0.0, along) if line_end else (along, line.length)
    first, last = (0.0, angle) if arc_end else (angle, arc.bend_angle)
    if high - low < MIN_LENGTH_SHARE * reach or last - first < MIN_BEND_ANGLE:
        return line, arc
    turned = np.cos(first) * arc.towards_start + np.sin(first) * ahead
    return (
        LineAxis(line.at(low), line.direction, high - low),
        ArcAxis(arc.centre, arc.normal, turned, arc.bend_radius, last - first),
    )


def trim_to_reducer(line: LineAxis, reducer: LineAxis) -> LineAxis:
    """Trim a straight to where a reducer on its line begins.

    Parameters
    ----------
    line, reducer : LineAxis

    Returns
    -------
    LineAxis
        The straight as it was if its end would move by more than the reducer's length: what
        is hidden of the straight stays hidden.
    """
    low, high = sorted(
        float((end - line.start) @ line.direction) for end in (reducer.start, reducer.end)
    )
    is_ahead = low + high > line.length
    place = low if is_ahead else high
    change = abs(place - (line.length if is_ahead else 0.0))
    if change > reducer.length:
        return line
    first, last = (0.0, place) if is_ahead else (place, line.length)
    return LineAxis(line.at(first), line.direction, last - first) if last > first else line
