"""Texts of what is under the cursor: an element, a station. Qt-free."""

import math
from collections.abc import Iterator

import numpy as np

from pipecore.types import NO_ID, PointCloud
from pipegui.i18n.texts import count, label_of, tr
from pipegui.model.document import Scan
from pipegui.model.stations import Station, has_stations, stations_of
from pipegui.states.descriptions import coordinate_lines, radius_text


def hover_text(scan: Scan, point_index: int) -> str:
    """Return name, radius, deviation and station under the cursor; "" where none is known."""
    return "\n".join((*_element_lines(scan, point_index), *_station_lines(scan, point_index)))


def _element_lines(scan: Scan, point_index: int) -> list[str]:
    result = scan.result
    element_id = NO_ID if result is None else int(result.element_id[point_index])
    if result is None or element_id == NO_ID:
        return []
    element = result.element(element_id)
    deviation = 1000 * float(result.deviation[point_index])
    lines = [label_of(element), tr("radius {radius}").format(radius=radius_text(element))]
    if math.isfinite(deviation):
        side = tr("outward") if deviation > 0 else tr("inward")
        lines.append(f"{abs(deviation):.1f} mm {side}")
    return lines


def _station_lines(scan: Scan, point_index: int) -> Iterator[str]:
    cloud = scan.cloud
    if cloud.station is not None and has_stations(cloud):
        station_id = int(cloud.station[point_index])
        yield from (station_label(s) for s in stations_of(cloud) if s.station_id == station_id)


def station_label(station: Station) -> str:
    """Return what a station is called in the window: its name, or its number."""
    name = station.name or str(station.station_id)
    return tr("Station {name}").format(name=name) if name.isdigit() else name


def station_text(station: Station, cloud: PointCloud) -> str:
    """Return what is known of a station: its name, points and the scanner's position."""
    lines = [station_label(station)]
    if station.n_points:
        lines.append(count("{n:,} point", "{n:,} points", station.n_points))
    if station.position is not None:
        lines += coordinate_lines(cloud, np.array(station.position))
    return "\n".join(lines)
