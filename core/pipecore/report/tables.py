"""The tables of a report: elements, profiles, deformations, as columns and as CSV files.

Files are UTF-8 with comma, header row and decimal points; empty where nothing could be
measured or the column does not apply. Positions are world coordinates in the unit of the
input file. Columns may be added; these keep name and meaning.
"""

import csv
import io
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.formatting import format_clock, text_cell
from pipecore.geometry import ArcAxis
from pipecore.inspection.section import radius_is_measurable
from pipecore.io import write_file
from pipecore.progress import NoProgress, Progress, in_chunks
from pipecore.report.columns import angles, floats, integers, positions, texts
from pipecore.report.world import FileCoordinates
from pipecore.rules import depth_pct_od
from pipecore.table import Table
from pipecore.types import (
    Answers,
    DeformationKind,
    ElementKind,
    NominalSize,
    PointCloud,
    Result,
    Review,
)

ROWS_AT_A_TIME = 5_000
POINTS_AT_A_TIME = 1_000_000
FEWEST_SEEN = 0.01
"""A station has seen an element if at least this share of its points are from there."""
NOT_REVIEWED: Mapping[int, Review] = MappingProxyType({})
BLANK_WHERE_ZERO = {"fitting_id", "next_id"}
"""Columns of ids that may be of nothing: 0 in a table, empty in a file."""


def elements_table(result: Result, cloud: PointCloud | None = None) -> Table:
    """Return the elements of a result as columns, one row for each.

    Parameters
    ----------
    result : Result
    cloud : PointCloud, optional
        The cloud that `result` was detected in: says which stations saw each element.

    Returns
    -------
    Table
        The names and the values of ``elements.csv``.
    """
    place = FileCoordinates.of(result)
    elements = result.elements
    nominal = [e.nominal for e in elements]
    nominal_ods = [n.outside_diameter if n else np.nan for n in nominal]
    bends = [e.axis if isinstance(e.axis, ArcAxis) else None for e in elements]
    cone_ends = [e.radius_end if e.kind is ElementKind.CONE else np.nan for e in elements]
    n_deformations = [len(result.deformations_of(e.element_id)) for e in elements]
    gap_lengths = [sum(end - start for start, end in e.gaps) for e in elements]
    reasons = [_reasons(e.not_measurable) for e in elements]
    run_names = [result.run_names.get(e.run_id, "") for e in elements]
    return Table(
        [
            integers("element_id", [e.element_id for e in elements]),
            integers("run_id", [e.run_id for e in elements]),
            texts("kind", [str(e.kind) for e in elements]),
            floats("radius_mm", [e.radius for e in elements], 1e3, 2),
            floats("radius_sd_mm", [e.radius_sd for e in elements], 1e3, 3),
            floats("radius_end_mm", cone_ends, 1e3, 2),
            texts("nominal_size", [_name(n) for n in nominal]),
            floats("nominal_od_mm", nominal_ods, 1e3, 2),
            floats("bend_radius_mm", [b.bend_radius if b else np.nan for b in bends], 1e3, 2),
            angles("bend_angle_deg", [b.bend_angle if b else np.nan for b in bends]),
            floats("length_m", [e.axis.length for e in elements], 1, 4),
            *positions("start", [e.axis.start for e in elements], place),
            *positions("end", [e.axis.end for e in elements], place),
            *positions("centre", [e.centre for e in elements], place),
            integers("n_points", [e.n_points for e in elements]),
            integers("n_profiles", [e.n_profiles for e in elements]),
            angles("arc_deg", [e.arc for e in elements]),
            floats("rms_mm", [e.rms for e in elements], 1e3, 3),
            floats("ovality_pct", [e.ovality for e in elements], 100, 3),
            floats("ovality_sd_pct", [e.ovality_sd for e in elements], 100, 3),
            floats("straightness_mm", [e.straightness for e in elements], 1e3, 2),
            integers("n_deformations", n_deformations),
            integers("n_gaps", [len(e.gaps) for e in elements]),
            floats("gaps_m", gap_lengths, 1, 4),
            texts("not_measurable", reasons),
            texts("name", [e.name for e in elements]),
            texts("run_name", run_names),
            texts("stations", _stations(result, cloud)),
            texts("nominal_size_end", [_name(e.nominal_end) for e in elements]),
            texts("nominal_catalogue", [n.catalogue if n else "" for n in nominal]),
            texts("other_nominal_size", [_name(e.other_nominal) for e in elements]),
            texts("clad", ["yes" if e.is_clad else "" for e in elements]),
            texts("answers", [_answers(e.answers) for e in elements]),
            texts("accepted_by", [e.accepted_by for e in elements]),
        ]
    )


def _stations(result: Result, cloud: PointCloud | None) -> list[str]:
    """Ids of the stations that saw each element, such as “1+3”; "" where they are not known."""
    if cloud is None or cloud.station is None:
        return [""] * len(result.elements)
    n_ids = 1 + max((e.element_id for e in result.elements), default=0)
    n_stations = 1 + int(cloud.station.max(initial=0))
    counts = np.zeros(n_ids * n_stations, np.int64)
    for start in range(0, len(cloud), POINTS_AT_A_TIME):
        rows = slice(start, start + POINTS_AT_A_TIME)
        pairs = result.element_id[rows].astype(np.int64) * n_stations + cloud.station[rows]
        counts += np.bincount(pairs, minlength=len(counts))[: len(counts)]
    seen = counts.reshape(n_ids, n_stations)
    least = np.maximum(1, FEWEST_SEEN * seen.sum(axis=1, keepdims=True))
    return [
        "+".join(map(str, np.flatnonzero(seen[e.element_id] >= least[e.element_id])))
        for e in result.elements
    ]


def profiles_table(result: Result) -> Table:
    """Return the profiles of all elements as columns, one row for each.

    Parameters
    ----------
    result : Result

    Returns
    -------
    Table
        The names and the values of ``profiles.csv``. The radius, its standard deviation and
        its deviation are nan where the radius is not the pipe's; see
        `pipecore.inspection.section.radius_is_measurable`.
    """
    p = result.profiles
    is_measurable = radius_is_measurable(p)
    radius, radius_sd, radius_deviation = (
        np.where(is_measurable, values, np.nan)
        for values in (p.radius, p.radius_sd, p.radius_deviation)
    )
    return Table(
        [
            integers("element_id", p.element_id),
            integers("stack_id", p.stack_id),
            integers("profile_index", p.profile_index),
            floats("chainage_m", p.chainage, 1, 4),
            *positions("centre", p.centre, FileCoordinates.of(result)),
            floats("semi_minor_mm", p.semi_minor, 1e3, 2),
            floats("semi_major_mm", p.semi_major, 1e3, 2),
            floats("flattening", p.flattening, 1, 5),
            floats("radius_mm", radius, 1e3, 2),
            floats("radius_sd_mm", radius_sd, 1e3, 3),
            floats("ovality_pct", p.ovality, 100, 3),
            floats("centre_deviation_mm", p.centre_deviation, 1e3, 2),
            floats("radius_deviation_mm", radius_deviation, 1e3, 2),
            angles("arc_deg", p.arc),
            integers("n_points", p.n_points),
            floats("rms_mm", p.rms, 1e3, 3),
            floats("aic_line", p.aic_line, 1, 2),
            floats("aic_ellipse", p.aic_ellipse, 1, 2),
            floats("semi_minor_sd_mm", p.semi_minor_sd, 1e3, 3),
            floats("semi_minor_drop_mm", p.minor_drop, 1e3, 2),
            floats("curvature_variation", p.curvature_variation, 1, 3),
        ]
    )


def candidates_table(result: Result) -> Table:
    """Return what was nearly accepted as columns, one row for each.

    Parameters
    ----------
    result : Result

    Returns
    -------
    Table
        The names and the values of ``candidates.csv``.
    """
    place = FileCoordinates.of(result)
    found = result.candidates
    return Table(
        [
            integers("candidate_id", [c.candidate_id for c in found]),
            texts("kind", [str(c.kind) for c in found]),
            floats("radius_mm", [c.radius for c in found], 1e3, 2),
            floats("radius_sd_mm", [c.radius_sd for c in found], 1e3, 3),
            floats("length_m", [c.axis.length for c in found], 1, 4),
            angles("arc_deg", [c.arc for c in found]),
            integers("n_points", [c.n_points for c in found]),
            *positions("start", [c.axis.start for c in found], place),
            *positions("end", [c.axis.end for c in found], place),
            texts("reason", [str(c.reason) for c in found]),
            floats("value", [c.value for c in found], 1, 3),
            floats("limit", [c.limit for c in found], 1, 3),
            texts("unit", [c.unit for c in found]),
        ]
    )


def deformations_table(result: Result, reviews: Mapping[int, Review] = NOT_REVIEWED) -> Table:
    """Return the deformations of a result as columns, one row for each.

    Parameters
    ----------
    result : Result
    reviews : mapping of int to Review
        What a person said of the deformations, by their ids.

    Returns
    -------
    Table
        The names and the values of ``deformations.csv``.
    """
    place = FileCoordinates.of(result)
    found = result.deformations
    # Of an oval section the amplitude is no depth; `dmax_mm` and `dmin_mm` say its size.
    is_oval = np.array([d.kind is DeformationKind.OVALITY for d in found], np.bool_)
    depths, depth_sds = (
        np.where(is_oval, np.nan, np.array([getattr(d, name) for d in found]))
        for name in ("depth", "depth_sd")
    )
    shares = [depth_pct_od(d, result.element(d.element_id))[0] for d in found]
    said = [reviews.get(d.deformation_id, Review()) for d in found]
    interacts = [("yes" if d.interacts else "no") if d.next_id else "" for d in found]
    return Table(
        [
            integers("deformation_id", [d.deformation_id for d in found]),
            integers("element_id", [d.element_id for d in found]),
            texts("kind", [str(d.kind) for d in found]),
            floats("chainage_m", [d.chainage for d in found], 1, 4),
            floats("chainage_start_m", [d.chainage_start for d in found], 1, 4),
            floats("chainage_end_m", [d.chainage_end for d in found], 1, 4),
            texts("clock", [format_clock(d.clock) for d in found]),
            *positions("peak", [d.peak for d in found], place),
            floats("depth_mm", depths, 1e3, 2),
            floats("depth_sd_mm", depth_sds, 1e3, 3),
            floats("depth_pct_od", shares, 1, 3),
            floats("length_mm", [d.length for d in found], 1e3, 2),
            floats("width_mm", [d.width for d in found], 1e3, 2),
            floats("ovality_pct", [d.ovality for d in found], 100, 3),
            floats("strain_pct", [d.strain for d in found], 100, 3),
            integers("n_points", [d.n_points for d in found]),
            texts("rule", [d.rule for d in found]),
            texts("verdict", [str(d.verdict) for d in found]),
            floats("area_mm2", [d.area for d in found], 1e6, 0),
            floats("volume_mm3", [d.volume for d in found], 1e9, 0),
            integers("fitting_id", [d.fitting_id for d in found]),
            floats("fitting_distance_m", [d.fitting_distance for d in found], 1, 4),
            integers("next_id", [d.next_id for d in found]),
            floats("next_distance_m", [d.next_distance for d in found], 1, 4),
            texts("interacts", interacts),
            texts("seen_by", ["+".join(d.seen_by) for d in found]),
            floats("dmax_mm", [d.dmax for d in found], 1e3, 2),
            floats("dmin_mm", [d.dmin for d in found], 1e3, 2),
            texts("not_measurable", [_reasons(d.not_measurable) for d in found]),
            texts("review", [str(review.state) for review in said]),
            texts("comment", [" ".join(review.comment.split()) for review in said]),
            texts("condition", [str(d.condition or "") for d in found]),
            texts("open_questions", ["+".join(d.open_questions) for d in found]),
            texts("verdict_reason", [str(d.verdict_reason) for d in found]),
            texts("answers", [_answers(d.answers) for d in found]),
        ]
    )


def _name(size: NominalSize | None) -> str:
    return size.name if size else ""


def _answers(answers: Answers) -> str:
    return "; ".join(f"{question}: {'yes' if yes else 'no'}" for question, yes in answers.items())


def _reasons(reasons: Mapping[str, str]) -> str:
    return "; ".join(f"{name}: {why}" for name, why in reasons.items())


def write_elements_csv(
    path: str | os.PathLike[str], result: Result, cloud: PointCloud | None = None
) -> None:
    """Write the table of elements.

    Parameters
    ----------
    path : path
    result : Result
    cloud : PointCloud, optional
        The cloud that `result` was detected in: says which stations saw each element.

    Raises
    ------
    WriteError
        If the file cannot be written; what stood there before still does.
    """
    write_csv(path, elements_table(result, cloud))


def write_profiles_csv(
    path: str | os.PathLike[str], result: Result, progress: Progress | None = None
) -> None:
    """Write the table of profiles.

    Parameters
    ----------
    path : path
    result : Result
    progress : Progress, optional
        May cancel; then nothing was written.

    Raises
    ------
    WriteError
        If the file cannot be written; what stood there before still does.
    CancelledError
        From `progress`.
    """
    write_csv(path, profiles_table(result), "writing profiles", progress)


def write_deformations_csv(
    path: str | os.PathLike[str], result: Result, reviews: Mapping[int, Review] = NOT_REVIEWED
) -> None:
    """Write the table of deformations.

    Parameters
    ----------
    path : path
    result : Result
    reviews : mapping of int to Review
        What a person said of the deformations, by their ids.

    Raises
    ------
    WriteError
        If the file cannot be written; what stood there before still does.
    """
    write_csv(path, deformations_table(result, reviews))


def write_csv(
    path: str | os.PathLike[str],
    table: Table,
    stage: str = "writing table",
    progress: Progress | None = None,
) -> None:
    """Write a table as CSV.

    Parameters
    ----------
    path : path
    table : Table
    stage : str
        Name of the stage in the updates of `progress`.
    progress : Progress, optional
        May cancel; then nothing was written.

    Raises
    ------
    WriteError
        If the file cannot be written; what stood there before still does.
    CancelledError
        From `progress`.
    """
    with (
        write_file(path) as temporary,
        Path(temporary).open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(",".join(table) + "\n")
        for start, stop in in_chunks(table.n_rows, ROWS_AT_A_TIME, stage, progress or NoProgress()):
            rows = slice(start, stop)
            columns = [
                _cells(name, values[rows], table.decimals.get(name))
                for name, values in table.items()
            ]
            file.writelines(",".join(row) + "\n" for row in zip(*columns, strict=True))


def _cells(name: str, values: NDArray[Any], decimals: int | None) -> list[str]:
    """How the values of a column stand in a file."""
    if decimals is not None:
        # A column at once takes a third of the time of value by value.
        text = f"%.{decimals}f\n" * len(values) % tuple(values.tolist())
        return text.replace("nan", "").split("\n")[:-1]
    if values.dtype == object:
        return [_quoted(text_cell(text)) for text in values]
    if name in BLANK_WHERE_ZERO:
        return [str(value or "") for value in values.tolist()]
    return list(map(str, values.tolist()))


def _quoted(text: str) -> str:
    """Text as a CSV cell: in quotes where it has a comma, a quote or a line's end in it."""
    if not any(c in text for c in ',"\r\n'):
        return text
    line = io.StringIO()
    csv.writer(line, lineterminator="").writerow([text])
    return line.getvalue()
