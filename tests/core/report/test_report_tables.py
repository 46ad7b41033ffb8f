import csv
import math
from dataclasses import replace

import numpy as np
import pytest

from pipecore.errors import WriteError
from pipecore.report import write_deformations_csv, write_elements_csv, write_profiles_csv
from pipecore.settings import Settings
from pipecore.types import (
    Deformation,
    DeformationKind,
    Element,
    NominalSize,
    Profiles,
    Review,
    ReviewState,
)
from tests.factories import make_result

ELEMENT_CONTRACT = (
    "element_id, run_id, kind, radius_mm, radius_sd_mm, radius_end_mm, nominal_size, "
    "nominal_od_mm, bend_radius_mm, bend_angle_deg, length_m, start_x, start_y, start_z, end_x, "
    "end_y, end_z, centre_x, centre_y, centre_z, n_points, n_profiles, arc_deg, rms_mm, "
    "ovality_pct, ovality_sd_pct, straightness_mm, n_deformations"
)
PROFILE_CONTRACT = (
    "element_id, stack_id, profile_index, chainage_m, centre_x, centre_y, centre_z, "
    "semi_minor_mm, semi_major_mm, flattening, radius_mm, radius_sd_mm, ovality_pct, "
    "centre_deviation_mm, radius_deviation_mm, arc_deg, n_points, rms_mm, aic_line, aic_ellipse"
)
DEFORMATION_CONTRACT = (
    "deformation_id, element_id, kind, chainage_m, chainage_start_m, chainage_end_m, clock, "
    "peak_x, peak_y, peak_z, depth_mm, depth_sd_mm, depth_pct_od, length_mm, width_mm, "
    "ovality_pct, strain_pct, n_points, rule, verdict"
)
WRITERS = {
    ELEMENT_CONTRACT: write_elements_csv,
    PROFILE_CONTRACT: write_profiles_csv,
    DEFORMATION_CONTRACT: write_deformations_csv,
}


def rows_of(writer, result, path):
    writer(path, result)
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def number(text: str) -> float:
    return float(text) if text else math.nan


def position(row, name: str):
    return np.array([number(row[f"{name}_{axis}"]) for axis in "xyz"])


@pytest.mark.parametrize("contract", WRITERS)
def test_that_the_columns_of_the_contract_are_there_in_order(contract, tmp_path):
    path = tmp_path / "table.csv"
    WRITERS[contract](path, make_result(2000))
    raw = path.read_bytes()
    header = raw.decode("utf-8").splitlines()[0].split(",")
    promised = contract.split(", ")
    assert [name for name in header if name in promised] == promised
    assert b"\r" not in raw
    assert not raw.startswith(b"\xef\xbb\xbf")


def test_that_gaps_are_counted_and_their_lengths_summed(tmp_path):
    result = make_result(2000)
    first, *others = result.elements
    gappy = replace(first, gaps=((0.2, 0.35), (0.5, 0.6)))
    result = replace(result, elements=(gappy, *others))
    rows = rows_of(write_elements_csv, result, tmp_path / "elements.csv")
    assert [int(row["n_gaps"]) for row in rows[:2]] == [2, len(others[0].gaps)]
    assert number(rows[0]["gaps_m"]) == pytest.approx(0.25)


def test_that_the_elements_table_gives_back_what_was_measured(tmp_path):
    result = make_result(2000)
    rows = rows_of(write_elements_csv, result, tmp_path / "elements.csv")
    assert [int(row["element_id"]) for row in rows] == [e.element_id for e in result.elements]
    for row, element in zip(rows, result.elements, strict=True):
        assert row["kind"] == element.kind
        assert int(row["run_id"]) == element.run_id
        assert number(row["radius_mm"]) == pytest.approx(1000 * element.radius, abs=0.005)
        assert number(row["radius_sd_mm"]) == pytest.approx(1000 * element.radius_sd, abs=0.0005)
        assert number(row["length_m"]) == pytest.approx(element.axis.length, abs=5e-5)
        assert position(row, "start") == pytest.approx(element.axis.start + result.origin, abs=6e-5)
        assert position(row, "end") == pytest.approx(element.axis.end + result.origin, abs=6e-5)
        assert number(row["arc_deg"]) == pytest.approx(np.rad2deg(element.arc), abs=0.005)
        assert int(row["n_points"]) == element.n_points
        assert int(row["n_deformations"]) == len(result.deformations_of(element.element_id))


def test_that_columns_that_do_not_apply_or_were_not_measurable_are_empty(tmp_path):
    rows = {
        row["kind"]: row
        for row in rows_of(write_elements_csv, make_result(2000), tmp_path / "elements.csv")
    }
    assert number(rows["torus"]["bend_radius_mm"]) == pytest.approx(229.0)
    assert number(rows["torus"]["bend_angle_deg"]) == pytest.approx(90.0)
    assert np.isfinite(position(rows["torus"], "centre")).all()
    assert number(rows["cone"]["radius_end_mm"]) == pytest.approx(57.15)
    assert number(rows["sphere"]["centre_x"]) == pytest.approx(432100.6)
    one_sided = rows["cylinder"]  # the last one, seen over 140°
    empty = ("bend_radius_mm", "bend_angle_deg", "radius_end_mm", "centre_x", "ovality_pct")
    assert [one_sided[name] for name in empty] == [""] * len(empty)
    assert "nan" not in (tmp_path / "elements.csv").read_text(encoding="utf-8")


def test_that_the_profiles_table_gives_back_what_was_measured(tmp_path):
    result = make_result(2000)
    p = result.profiles
    rows = rows_of(write_profiles_csv, result, tmp_path / "profiles.csv")
    assert len(rows) == len(p)

    def column(name: str):
        return np.array([number(row[name]) for row in rows])

    for name in ("element_id", "stack_id", "profile_index", "n_points"):
        assert (column(name) == getattr(p, name)).all()
    for name in ("semi_minor", "semi_major", "radius", "centre_deviation", "radius_deviation"):
        assert column(f"{name}_mm") == pytest.approx(1000 * getattr(p, name), abs=0.0051)
    assert column("chainage_m") == pytest.approx(p.chainage, abs=5.1e-5)
    assert column("flattening") == pytest.approx(p.flattening, abs=5.1e-6)
    assert column("arc_deg") == pytest.approx(np.rad2deg(p.arc), abs=0.0051)
    assert column("ovality_pct") == pytest.approx(100 * p.ovality, abs=5.1e-4, nan_ok=True)
    centres = np.stack([column(f"centre_{axis}") for axis in "xyz"], axis=1)
    assert np.abs(centres - (p.centre + result.origin)).max() < 6e-5


def test_that_the_radius_of_a_circle_beside_the_pipe_is_in_no_table(tmp_path):
    result = make_result(2000)
    p = result.profiles
    # Every third profile sees 90°, and its circle lies half a radius off the axis.
    is_beside = np.arange(len(p)) % 3 == 0
    p = replace(
        p,
        arc=np.where(is_beside, np.pi / 2, p.arc),
        centre_deviation=np.where(is_beside, 0.5 * p.semi_minor, p.centre_deviation),
    )
    rows = rows_of(write_profiles_csv, replace(result, profiles=p), tmp_path / "profiles.csv")
    for name in ("radius_mm", "radius_sd_mm", "radius_deviation_mm"):
        assert [row[name] == "" for row in rows] == is_beside.tolist()
    assert all(row["semi_minor_mm"] and row["centre_deviation_mm"] for row in rows)


def test_that_the_deformations_table_gives_back_what_was_measured(tmp_path):
    result = make_result(2000)
    rows = rows_of(write_deformations_csv, result, tmp_path / "deformations.csv")
    for row, d in zip(rows, result.deformations, strict=True):
        assert (row["kind"], row["verdict"], row["rule"]) == (d.kind, d.verdict, d.rule)
        if d.kind == "ovality":
            assert (row["depth_mm"], row["depth_sd_mm"], row["depth_pct_od"]) == ("", "", "")
        else:
            assert number(row["depth_mm"]) == pytest.approx(1000 * d.depth, abs=0.005)
            assert number(row["depth_sd_mm"]) == pytest.approx(1000 * d.depth_sd, abs=0.0005)
        assert position(row, "peak") == pytest.approx(d.peak + result.origin, abs=6e-5)
        assert row["strain_pct"] == ""
        assert number(row["area_mm2"]) == pytest.approx(1e6 * d.area, abs=0.5, nan_ok=True)
        assert number(row["volume_mm3"]) == pytest.approx(1e9 * d.volume, abs=0.5, nan_ok=True)
        assert row["fitting_id"] == (str(d.fitting_id) if d.fitting_id else "")
        assert number(row["fitting_distance_m"]) == pytest.approx(
            d.fitting_distance, abs=5.1e-5, nan_ok=True
        )
        assert row["interacts"] == ("" if not d.next_id else "yes" if d.interacts else "no")
    dent, ovality = rows[0], rows[1]
    assert dent["clock"] == "1:20"  # 40°
    assert number(dent["depth_pct_od"]) == pytest.approx(100 * 12.1 / 168.3, abs=5e-4)
    assert dent["ovality_pct"] == ""
    assert number(ovality["ovality_pct"]) == pytest.approx(100 * 4 * 1.6 / 168.3, abs=5e-4)


@pytest.mark.parametrize("kind", ["bow", "kink", "ovality", "twist"])
def test_that_what_is_no_share_of_the_diameter_has_no_percentage(kind, tmp_path):
    result = make_result(2000)
    first = replace(result.deformations[0], kind=DeformationKind(kind))
    rows = rows_of(
        write_deformations_csv, replace(result, deformations=(first,)), tmp_path / "d.csv"
    )
    assert rows[0]["depth_pct_od"] == ""
    assert (rows[0]["depth_mm"] == "") == (kind == "ovality")


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("ft", 0.3048), ("us-ft", 1200 / 3937)])
def test_that_positions_are_those_of_the_file_to_a_tenth_of_a_millimetre(unit, metres, tmp_path):
    far = np.array([9_876_543.0, 9_999_999.0, 110.0])
    result = replace(
        make_result(2000),
        origin=far,
        settings=Settings().replace({"input.length_unit": unit}),
    )
    rows = rows_of(write_elements_csv, result, tmp_path / "elements.csv")
    for row, element in zip(rows, result.elements, strict=True):
        true = element.axis.start + far
        assert np.abs(position(row, "start") * metres - true).max() < 1e-4
        assert number(row["radius_mm"]) == pytest.approx(1000 * element.radius, abs=0.005)


def test_that_a_name_that_is_a_formula_stays_text(tmp_path):
    result = make_result(2000)
    size = NominalSize('=HYPERLINK("x")', 0.1683)
    elements = (replace(result.elements[0], nominal=size), *result.elements[1:])
    rows = rows_of(
        write_elements_csv, replace(result, elements=elements), tmp_path / "elements.csv"
    )
    assert rows[0]["nominal_size"] == '\'=HYPERLINK("x")'


def test_that_an_empty_result_gives_tables_with_a_header_alone(tmp_path):
    no_elements: tuple[Element, ...] = ()
    no_deformations: tuple[Deformation, ...] = ()
    result = replace(
        make_result(2000),
        elements=no_elements,
        deformations=no_deformations,
        profiles=Profiles.empty(),
    )
    for contract, writer in WRITERS.items():
        assert rows_of(writer, result, tmp_path / "table.csv") == []
        assert contract.split(", ")[0] in (tmp_path / "table.csv").read_text(encoding="utf-8")


def test_that_a_table_that_cannot_be_written_says_where(tmp_path):
    with pytest.raises(WriteError, match="gone"):
        write_elements_csv(tmp_path / "gone" / "elements.csv", make_result(2000))


def test_that_reviews_stand_beside_the_verdicts(tmp_path):
    path = tmp_path / "deformations.csv"
    reviews = {3: Review(ReviewState.REJECTED, "=1+1\nsee photo, 12"), 1: Review(comment="?")}
    write_deformations_csv(path, make_result(2000), reviews)
    with path.open(encoding="utf-8", newline="") as file:
        rows = {int(row["deformation_id"]): row for row in csv.DictReader(file)}
    assert [rows[i]["review"] for i in (1, 2, 3, 4)] == ["open", "open", "rejected", "open"]
    assert rows[1]["comment"] == "?"
    assert rows[2]["comment"] == ""
    assert rows[3]["comment"] == "'=1+1 see photo, 12"


def test_that_items_keep_their_ids_when_others_are_gone():
    result = make_result(2000)
    fewer = replace(result, elements=(result.elements[0], *result.elements[3:]))
    assert fewer.element(4) is result.elements[3]
    with pytest.raises(KeyError):
        fewer.element(2)
    with pytest.raises(KeyError):
        result.element(0)
