"""Writing clouds as LAZ."""

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pipecore.errors import WriteError
from pipecore.io.atomic import write_file
from pipecore.io.source import CHUNK_POINTS
from pipecore.progress import NoProgress, Progress, in_chunks
from pipecore.types import PointCloud
from pipecore.units import FileUnit

POINTS_AT_A_TIME = 600_000
"""A dozen of LAZ's own chunks of 50,000, so that threads that compress them end together."""
FILLED_AT_ONCE = 40_000
"""Their values are put together for so many at once, which stay in a processor's own memory."""
FINEST = 1e-4
"""Step of the coordinates written, metres; half of it is lost at most."""


def write_laz(
    path: str | os.PathLike[str],
    cloud: PointCloud,
    extra: Mapping[str, NDArray[Any]] | None = None,
    *,
    factors: Mapping[str, float] | None = None,
    kinds: Mapping[str, DTypeLike] | None = None,
    unit: FileUnit | None = None,
    progress: Progress | None = None,
) -> None:
    """Write a cloud as LAZ (1.4, point format 6, or 7 with colours), whole or not at all.

    Parameters
    ----------
    path : path
    cloud : PointCloud
        Written in world coordinates in steps of 0.1 mm, at 10⁷ m too.
    extra : mapping of str to ndarray, optional
        More values of each point, integer, boolean or floating, shape (n,), by a name of
        up to 32 characters.
    factors : mapping of str to float, optional
        What some of the extra values are multiplied by when they are written.
    kinds : mapping of str to dtype, optional
        As what some of the extra values are written, where that is not what they are.
    unit : FileUnit, optional
        Unit of the coordinates written; by default that of the file the cloud came from.
    progress : Progress, optional
        Told about the stage "writing"; may cancel.

    Raises
    ------
    WriteError
        If the operating system refuses, or the cloud is too wide for LAS (214 km).
    CancelledError
        From `progress`.

    Notes
    -----
    LAS holds intensities as 0 to 65,535: others are stretched to that range.
    """
    import laspy  # noqa: PLC0415

    extra, kinds = extra or {}, kinds or {}
    for name, values in extra.items():
        if len(values) != len(cloud) or values.ndim != 1:
            raise ValueError(f"“{name}” has shape {values.shape}, not ({len(cloud)},).")
    header = laspy.LasHeader(version="1.4", point_format=6 if cloud.rgb is None else 7)
    header.global_encoding.wkt = True  # Asked for by these point formats.
    header.generating_software = "PipeGUI"
    header.system_identifier = "PipeGUI"
    # A power of ten, so that readers show round numbers.
    metres = (unit or cloud.unit).factors
    step = 10.0 ** np.floor(np.log10(FINEST / metres) + 1e-9)
    header.scales = step
    header.offsets = np.round(cloud.origin / metres)
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams(name, np.dtype(kinds.get(name, _storable(values[:0]).dtype)))
            for name, values in extra.items()
        ]
    )
    intensity = _LasIntensity(cloud)
    with (
        write_file(path) as temporary,
        temporary.open("wb") as file,
        laspy.LasWriter(file, header, do_compress=True, closefd=False) as writer,
    ):
        records = laspy.ScaleAwarePointRecord.zeros(
            min(len(cloud), POINTS_AT_A_TIME), header=header
        )
        for start, stop in in_chunks(
            len(cloud), POINTS_AT_A_TIME, "writing", progress or NoProgress()
        ):
            for first in range(start, stop, FILLED_AT_ONCE):
                rows = slice(first, min(first + FILLED_AT_ONCE, stop))
                points = records[first - start : rows.stop - start]
                world = cloud.world(cloud.xyz[rows].astype(np.float64)) / metres
                steps = np.round((world - header.offsets) / step)
                if np.abs(steps).max() > np.iinfo(np.int32).max:
                    raise WriteError(
                        "“{path}” cannot be written: the cloud is too wide for LAS.", path=path
                    )
                for axis, name in enumerate("XYZ"):
                    points[name] = steps[:, axis].astype(np.int32)
                if cloud.intensity is not None:
                    points["intensity"] = intensity.stretched(cloud.intensity[rows])
                if cloud.rgb is not None:
                    for colour, name in enumerate(("red", "green", "blue")):
                        points[name] = cloud.rgb[rows, colour].astype(np.uint16) * 257
                if cloud.classification is not None:
                    points["classification"] = cloud.classification[rows]
                for name, values in extra.items():
                    factor = (factors or {}).get(name)
                    own = values[rows] if factor is None else factor * values[rows]
                    points[name] = _storable(own)
            writer.write_points(records[: stop - start])


def _storable(values: NDArray[Any]) -> NDArray[Any]:
    return values.astype(np.uint8) if values.dtype == np.bool_ else values


def _has_fractions(values: NDArray[np.float32]) -> bool:
    return bool((values != np.trunc(values)).any())  # a tenth of the time of a remainder


class _LasIntensity:
    """Intensities as LAS holds them."""

    def __init__(self, cloud: PointCloud) -> None:
        self.low, self.factor = 0.0, 1.0
        values = cloud.intensity
        if values is None or not len(values):
            return
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        blocks = range(0, len(values), CHUNK_POINTS)
        if (
            low < 0
            or high > 65535
            or any(_has_fractions(values[b : b + CHUNK_POINTS]) for b in blocks)
        ):
            self.low = low
            self.factor = 65535 / (high - low) if high > low else 0.0

    def stretched(self, values: NDArray[np.float32]) -> NDArray[np.uint16]:
        scaled = np.nan_to_num((values.astype(np.float64) - self.low) * self.factor)
        return np.round(np.clip(scaled, 0, 65535)).astype(np.uint16)
