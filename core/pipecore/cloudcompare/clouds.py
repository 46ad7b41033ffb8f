"""CloudCompare's clouds as ours: their points in place, with global shift, colours and fields."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pycc
from numpy.typing import NDArray

from pipecore.errors import PipecoreError
from pipecore.types import Array, Field, PointCloud

MAX_NAME = 60
"""Of a file, characters."""


def selected(app: Any) -> list[Any]:
    """Return the selected clouds that hold points.

    Parameters
    ----------
    app : pycc.ccPythonInstance

    Returns
    -------
    list of pycc.ccPointCloud

    Raises
    ------
    PipecoreError
        If none is selected.
    """
    clouds = [e for e in app.getSelectedEntities() if isinstance(e, pycc.ccPointCloud)]
    clouds = [cloud for cloud in clouds if cloud.size()]
    if not clouds:
        raise PipecoreError("Select one or more point clouds first.")
    return clouds


def joined(clouds: Sequence[Any]) -> PointCloud:
    """Return clouds as one; a single one that is not scaled keeps its points in place.

    CloudCompare shows p = scale · (world + shift): the origin of the local coordinates is
    minus the shift.

    Parameters
    ----------
    clouds : sequence of pycc.ccPointCloud

    Returns
    -------
    PointCloud
        In the order of the clouds, each a station of its own if there are several.

    Raises
    ------
    PipecoreError
        If coordinates are not numbers.
    """
    origin = -_shift(clouds[0])
    parts = [_local(cloud, origin) for cloud in clouds]
    for cloud, xyz in zip(clouds, parts, strict=True):
        if not np.isfinite(xyz).all():
            raise PipecoreError(
                "“{name}” holds coordinates that are not numbers: remove these points first.",
                name=cloud.getName(),
            )
    station = None
    names: tuple[str, ...] = ()
    if len(clouds) > 1:
        station = np.repeat(np.arange(1, len(clouds) + 1, dtype=np.uint16), [*map(len, parts)])
        names = tuple(str(cloud.getName()) for cloud in clouds)
    xyz = parts[0] if len(parts) == 1 else np.concatenate(parts)
    return PointCloud(origin=origin, xyz=xyz, station=station, station_names=names)


def with_fields(cloud: Any) -> PointCloud:
    """Return one cloud with its colours and scalar fields, to be written.

    Parameters
    ----------
    cloud : pycc.ccPointCloud

    Returns
    -------
    PointCloud
    """
    plain = joined([cloud])
    rgba = cloud.colors() if cloud.hasColors() else None
    fields, intensity = {}, None
    for index in range(cloud.getNumberOfScalarFields()):
        name = str(cloud.getScalarFieldName(index))
        values = _values(cloud.getScalarField(index))
        if name.lower() == "intensity":
            intensity = values.astype(np.float32)
        else:
            fields[name] = Field(values.astype(np.float32))
    return PointCloud(
        origin=plain.origin,
        xyz=plain.xyz,
        intensity=intensity,
        rgb=None if rgba is None else np.ascontiguousarray(rgba[:, :3]),
        fields=fields,
    )


def file_name(cloud: Any) -> str:
    """Return a cloud's name as a file may be called on any system.

    Parameters
    ----------
    cloud : pycc.ccPointCloud

    Returns
    -------
    str
        Without an ending.
    """
    name = re.sub(r"[^\w. -]+", "_", str(cloud.getName())).strip(" .")
    return name[:MAX_NAME] or "cloud"


def _shift(cloud: Any) -> Array:
    shift = cloud.getGlobalShift()
    return np.array([shift.x, shift.y, shift.z], np.float64)


def _local(cloud: Any, origin: Array) -> NDArray[np.float32]:
    """Coordinates about `origin`; the cloud's own array where they are the same."""
    points, scale = cloud.points(), float(cloud.getGlobalScale())
    offset = -_shift(cloud) - origin
    if scale == 1.0 and not offset.any():
        return np.asarray(points, np.float32)
    local: Array = points.astype(np.float64) / scale + offset
    return local.astype(np.float32)


def _values(field: Any) -> Array:
    try:
        return np.asarray(field.asArray(), np.float64)
    except AttributeError:
        return np.asarray(field, np.float64)
