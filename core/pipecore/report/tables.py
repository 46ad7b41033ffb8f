"""The CSV tables: elements, profiles, deformations.

UTF-8, comma, header row, decimal points; empty where nothing could be measured or the
column does not apply. Positions are world coordinates in the unit of the input file.
Columns may be added; these keep name and meaning.
"""

import csv
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from pipecore.formatting import cell, format_clock, text_cell
from pipecore.geometry import ArcAxis
from pipecore.io import write_file
from pipecore.progress import NoProgress, Progress, in_chunks
from pipecore.report.world import FileCoordinates
from pipecore.rules import outside_diameter
from pipecore.types import Array, Deformation, Element, ElementKind, Profiles, Result, Review

ELEMENT_COLUMNS = (
    "element_id",
    "run_id",
    "kind",
    "radius_mm",
    "radius_sd_mm",
    "radius_end_mm",
    "nominal_size",
    "nominal_od_mm",
    "bend_radius_mm",
    "bend_angle_deg",
    "length_m",
    "start_x",
    "start_y",
    "start_z",
    "end_x",
    "end_y",
    "end_z",
    "centre_x",
    "centre_y",
    "centre_z",
    "n_points",
    "n_profiles",
    "arc_deg",
    "rms_mm",
    "ovality_pct",
    "ovality_sd_pct",
    "straightness_mm",
    "n_deformations",
    "n_gaps",
    "gaps_m",
    "not_measurable",
    "name",
    "run_name",
)

PROFILE_COLUMNS = (
    "element_id",
    "stack_id",
    "profile_index",
    "chainage_m",
    "centre_x",
    "centre_y",
    "centre_z",
    "semi_minor_mm",
    "semi_major_mm",
    "flattening",
    "radius_mm",
    "radius_sd_mm",
    "ovality_pct",
    "centre_deviation_mm",
    "radius_deviation_mm",
    "arc_deg",
    "n_points",
    "rms_mm",
    "aic_line",
    "aic_ellipse",
    "semi_minor_sd_mm",
    "semi_minor_drop_mm",
    "curvature_variation",
)

DEFORMATION_COLUMNS = (
    "deformation_id",
    "element_id",
    "kind",
    "chainage_m",
    "chainage_start_m",
    "chainage_end_m",
    "clock",
    "peak_x",
    "peak_y",
    "peak_z",
    "depth_mm",
    "depth_sd_mm",
    "depth_pct_od",
    "length_mm",
    "width_mm",
    "ovality_pct",
    "strain_pct",
    "n_points",
    "rule",
    "verdict",
    "area_mm2",
    "volume_mm3",
    "fitting_id",
    "fitting_distance_m",
    "next_id",
    "next_distance_m",
    "interacts",
    "not_measurable",
    "review",
    "comment",
)

ROWS_AT_A_TIME = 5_000
NOT_REVIEWED: Mapping[int, Review] = MappingProxyType({})


def write_elements_csv(path: str | os.PathLike[str], result: Result) -> None:
    """Write the table of elements.

    Raises
    ------
    WriteError
        If the file cannot be written; what stood there before still does.
    """
    place = FileCoordinates.of(result)
    _write(path, ELEMENT_COLUMNS, (_element_row(e, result, place) for e in result.elements))


def write_profiles_csv(
    path: str | os.PathLike[str], result: Result, progress: Progress | None = None
) -> None:
    """Write the table of profiles; errors as for `write_elements_csv`."""
    with _table(path, PROFILE_COLUMNS) as file:
        file.writelines(_profile_lines(result, progress or NoProgress()))


def write_deformations_csv(
    path: str | os.PathLike[str], result: Result, reviews: Mapping[int, Review] = NOT_REVIEWED
) -> None:
    """Write the table of deformations with what a person said of them, by their ids.

    Errors as for `write_elements_csv`.
    """
    place = FileCoordinates.of(result)
    rows = (
        _deformation_row(d, result.element(d.element_id), place)
        + _review_cells(reviews.get(d.deformation_id, Review()))
        for d in result.deformations
    )
    _write(path, DEFORMATION_COLUMNS, rows)


def _write(
    path: str | os.PathLike[str], columns: Sequence[str], rows: Iterable[Sequence[str]]
) -> None:
    with _table(path, columns) as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


@contextmanager
def _table(path: str | os.PathLike[str], columns: Sequence[str]) -> Iterator[TextIO]:
    """Open a table that has its first line and takes the place of `path` when whole."""
    with (
        write_file(path) as temporary,
        Path(temporary).open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(",".join(columns) + "\n")
        yield file


def _mm(metres: float) -> str:
    return cell(1000 * metres, 2)


def _sd_mm(metres: float) -> str:
    return cell(1000 * metres, 3)


def _pct(ratio: float) -> str:
    return cell(100 * ratio, 3)


def _deg(radians: float) -> str:
    return cell(float(np.rad2deg(radians)), 2)


def _element_row(element: Element, result: Result, place: FileCoordinates) -> list[str]:
    axis = element.axis
    is_cone = element.kind is ElementKind.CONE
    bend = axis if isinstance(axis, ArcAxis) else None
    return [
        str(element.element_id),
        str(element.run_id),
        element.kind,
        _mm(element.radius),
        _sd_mm(element.radius_sd),
        _mm(element.radius_end) if is_cone else "",
        text_cell(element.nominal.name) if element.nominal else "",
        _mm(element.nominal.outside_diameter) if element.nominal else "",
        _mm(bend.bend_radius) if bend else "",
        _deg(bend.bend_angle) if bend else "",
        cell(axis.length, 4),
        *place.cells(axis.start),
        *place.cells(axis.end),
        *place.cells(element.centre),
        str(element.n_points),
        str(element.n_profiles),
        _deg(element.arc),
        _sd_mm(element.rms),
        _pct(element.ovality),
        _pct(element.ovality_sd),
        _mm(element.straightness),
        str(len(result.deformations_of(element.element_id))),
        str(len(element.gaps)),
        cell(sum(end - start for start, end in element.gaps), 4),
        _reasons(element.not_measurable),
        text_cell(element.name),
        text_cell(result.run_names.get(element.run_id, "")),
    ]


def _deformation_row(
    deformation: Deformation, element: Element, place: FileCoordinates
) -> list[str]:
    return [
        str(deformation.deformation_id),
        str(deformation.element_id),
        deformation.kind,
        cell(deformation.chainage, 4),
        cell(deformation.chainage_start, 4),
        cell(deformation.chainage_end, 4),
        format_clock(deformation.clock),
        *place.cells(deformation.peak),
        _mm(deformation.depth),
        _sd_mm(deformation.depth_sd),
        _pct(deformation.depth / outside_diameter(element)),
        _mm(deformation.length),
        _mm(deformation.width),
        _pct(deformation.ovality),
        _pct(deformation.strain),
        str(deformation.n_points),
        text_cell(deformation.rule),
        deformation.verdict,
        cell(1e6 * deformation.area, 0),
        cell(1e9 * deformation.volume, 0),
        str(deformation.fitting_id or ""),
        cell(deformation.fitting_distance, 4),
        str(deformation.next_id or ""),
        cell(deformation.next_distance, 4),
        ("yes" if deformation.interacts else "no") if deformation.next_id else "",
        _reasons(deformation.not_measurable),
    ]


def _reasons(reasons: Mapping[str, str]) -> str:
    return text_cell("; ".join(f"{name}: {why}" for name, why in reasons.items()))


def _review_cells(review: Review) -> list[str]:
    return [review.state, text_cell(" ".join(review.comment.split()))]


def _profile_lines(result: Result, progress: Progress) -> Iterator[str]:
    place = FileCoordinates.of(result)
    stage = "writing profiles"
    for start, stop in in_chunks(len(result.profiles), ROWS_AT_A_TIME, stage, progress):
        # A row at once by one template takes a third of the time of value by value.
        formats, columns = zip(
            *_profile_columns(result.profiles[slice(start, stop)], place), strict=True
        )
        template = ",".join(formats) + "\n"
        for row in zip(*columns, strict=True):
            yield (template % row).replace("nan", "")


def _profile_columns(p: Profiles, place: FileCoordinates) -> Iterator[tuple[str, list[Any]]]:
    """How the values of each column are written, and the values."""

    def column(values: Array, scale: float, decimals: int) -> tuple[str, list[float]]:
        # Adding zero takes the sign off a zero.
        rounded = np.round(scale * values, decimals) + 0.0
        return f"%.{decimals}f", np.where(np.isfinite(rounded), rounded, np.nan).tolist()

    def whole(values: NDArray[np.int32]) -> tuple[str, list[int]]:
        return "%d", values.tolist()

    centre = place.of_local(p.centre)
    yield whole(p.element_id)
    yield whole(p.stack_id)
    yield whole(p.profile_index)
    yield column(p.chainage, 1, 4)
    yield from (column(centre[:, i], 1, place.decimals) for i in range(3))
    yield column(p.semi_minor, 1000, 2)
    yield column(p.semi_major, 1000, 2)
    yield column(p.flattening, 1, 5)
    yield column(p.radius, 1000, 2)
    yield column(p.radius_sd, 1000, 3)
    yield column(p.ovality, 100, 3)
    yield column(p.centre_deviation, 1000, 2)
    yield column(p.radius_deviation, 1000, 2)
    yield column(np.rad2deg(p.arc), 1, 2)
    yield whole(p.n_points)
    yield column(p.rms, 1000, 3)
    yield column(p.aic_line, 1, 2)
    yield column(p.aic_ellipse, 1, 2)
    yield column(p.semi_minor_sd, 1000, 3)
    yield column(p.minor_drop, 1000, 2)
    yield column(p.curvature_variation, 1, 3)
