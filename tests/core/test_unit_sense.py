"""Radii that are of nominal sizes in another unit only are said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pipecore
from pipecore import io
from pipecore.catalogues import sizes_of
from pipecore.cli import main
from pipecore.settings import LengthUnit, Settings
from pipecore.types import ElementKind, PointCloud
from pipecore.unit_sense import unit_notes
from pipecore.units import FileUnit
from tests.core.io.cases import pipe, text
from tests.factories import make_result

SIZES = [s.outside_diameter for s in sizes_of("ASME B36.10")]
FIVE = [SIZES[k] / 2 for k in (5, 8, 10, 12, 13)]
ODD = [0.0313, 0.0641, 0.0966, 0.1224, 0.1503]


def notes(radii, cloud=None, settings=None):
    element = next(e for e in make_result(2000).elements if e.kind is ElementKind.CYLINDER)
    elements = [replace(element, radius=r) for r in radii]
    cloud = cloud or PointCloud.from_points(np.zeros((1, 3)))
    return unit_notes(cloud, elements, settings or Settings())


@pytest.mark.parametrize("unit", [LengthUnit.FOOT, LengthUnit.INCH, LengthUnit.MILLIMETRE])
def test_that_nominal_sizes_in_another_unit_are_said(unit: LengthUnit) -> None:
    (note,) = notes([r / unit.metres for r in FIVE])
    assert f"in {unit} all have" in note


@pytest.mark.parametrize("radii", [[], [np.nan], FIVE, ODD, [ODD[1]], [*FIVE, *ODD]])
def test_that_nothing_is_said_of_nominal_sizes_and_of_odd_ones(radii: list[float]) -> None:
    assert notes(radii) == ()


def test_that_one_nominal_size_among_others_is_enough() -> None:
    in_feet = [r / 0.3048 for r in FIVE]
    assert notes([*in_feet, FIVE[2]]) == ()


def test_that_pipes_of_one_size_count_once() -> None:
    # A single size is of another unit's by chance too, unless it is met very closely.
    once = FIVE[3] / 0.3048
    assert notes([once * 1.004] * 9) == ()
    assert len(notes([once, once * 1.001])) == 1


def test_that_a_unit_that_is_named_is_not_doubted() -> None:
    in_feet = [r / 0.3048 for r in FIVE]
    cloud = PointCloud.from_points(np.zeros((1, 3)))
    assert notes(in_feet, replace(cloud, crs="ETRS89 / UTM zone 32N")) == ()
    assert notes(in_feet, replace(cloud, unit=FileUnit.of(LengthUnit.FOOT))) == ()
    assert notes(in_feet, settings=Settings().replace({"input.length_unit": "m"})) == ()


def test_that_a_scan_in_feet_is_doubted_in_result_report_and_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = text(tmp_path / "feet.xyz", pipe() / 0.3048, "{0:.5f} {1:.5f} {2:.5f}")
    said = "in ft all have: check the length unit"
    result = pipecore.detect(io.read(path))
    assert len(result.elements) == 1
    assert said in result.notes[-1]
    assert main(["detect", str(path), "-o", str(tmp_path / "report")]) == 0
    assert said in capsys.readouterr().err
    assert said in (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    metres = text(tmp_path / "metres.xyz", pipe(), "{0:.5f} {1:.5f} {2:.5f}")
    assert pipecore.detect(io.read(metres)).notes == ()


def test_that_points_too_far_apart_are_doubted_where_nothing_names_the_unit(tmp_path: Path) -> None:
    inches = text(tmp_path / "inches.xyz", pipe() / 0.0254, "{0:.5f} {1:.5f} {2:.5f}")
    for notes_of in (io.read(inches).notes, io.info(inches).notes):
        assert any("choose another length unit" in note for note in notes_of)
    assert io.read(inches, length_unit=LengthUnit.INCH).unit.metres == 0.0254
