"""``pipecore judge``: verdicts anew, without a detection."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from pipecore import load
from pipecore.cli import main
from pipecore.editing import judge_again
from pipecore.errors import SettingsError
from pipecore.report import write_report
from pipecore.types import Question, Verdict
from tests.factories import make_scan


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("judge") / "report"
    cloud, result = make_scan(3000)
    write_report(folder, cloud, result)
    return folder


def rows_of(folder):
    with (folder / "deformations.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_that_another_rule_changes_verdicts_and_no_measure(report, tmp_path, capsys):
    out = tmp_path / "anew"
    assert main(["judge", str(report), "-o", str(out), "--deformation-rule", "49cfr195-452h"]) == 0
    before, after = rows_of(report), rows_of(out)
    assert [r["depth_mm"] for r in after] == [r["depth_mm"] for r in before]
    assert any("49cfr195-452h" in r["rule"] for r in after)
    assert load(out).settings.deformation.rule == "49cfr195-452h"
    assert (out / "segments.laz").read_bytes() == (report / "segments.laz").read_bytes()
    assert "49 CFR 195.452" in (out / "report.html").read_text(encoding="utf-8")
    assert "dent" in capsys.readouterr().out


def test_that_answers_of_a_table_close_questions(report, tmp_path):
    out = tmp_path / "answered"
    asked = tmp_path / "first"
    assert main(["judge", str(report), "-o", str(asked), "--quiet"]) == 0
    dent = next(d for d in load(asked).deformations if d.kind == "dent")
    answers = tmp_path / "answers.csv"
    answers.write_text(
        f"deformation_id,weld,stress raiser\n{dent.deformation_id},no,yes\n", encoding="utf-8"
    )
    command = ["judge", str(report), "-o", str(out), "--answers", str(answers), "--quiet"]
    assert main(command) == 0
    told = load(out).deformation(dent.deformation_id)
    assert told.answers == {Question.WELD: False, Question.STRESS_RAISER: True}
    assert told.verdict is Verdict.REJECT
    row = next(r for r in rows_of(out) if r["deformation_id"] == str(dent.deformation_id))
    assert row["answers"] == "weld: no; stress raiser: yes"


def test_that_answers_for_elements_are_read_from_toml(report, tmp_path):
    out, answers = tmp_path / "clad", tmp_path / "answers.toml"
    number = load(report).deformations[0].element_id
    answers.write_text(f"[element.{number}]\nclad = true\n", encoding="utf-8")
    assert main(["judge", str(report), "-o", str(out), "--answers", str(answers), "--quiet"]) == 0
    result = load(out)
    assert result.element(number).is_clad
    assert all(d.verdict is Verdict.NOT_MEASURABLE for d in result.deformations_of(number))
    with (out / "elements.csv").open(encoding="utf-8") as file:
        assert [r["element_id"] for r in csv.DictReader(file) if r["clad"] == "yes"] == [
            str(number)
        ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("deformation_id,weld\n1,perhaps\n", "neither yes nor no"),
        ("deformation_id,wled\n1,yes\n", "wled"),
        ("number,weld\n1,yes\n", "no column deformation_id or element_id"),
        ("deformation_id,weld\n99,yes\n", "no deformation 99"),
        ("deformation_id,element_id,weld\n1,1,yes\n", "not of one deformation or element"),
    ],
)
def test_that_wrong_answers_are_one_clear_line(report, tmp_path, capsys, text, said):
    answers, out = tmp_path / "answers.csv", tmp_path / "out"
    answers.write_text(text, encoding="utf-8")
    assert main(["judge", str(report), "-o", str(out), "--answers", str(answers)]) == 1
    assert said in capsys.readouterr().err
    assert not out.exists()


def test_that_another_wall_takes_strains_away_with_a_word(report):
    result = load(report)
    strained = tuple(replace(d, strain=0.02, not_measurable={}) for d in result.deformations)
    result = replace(result, deformations=strained)
    same = judge_again(result, {"deformation.rule": "pdam"})
    assert [d.strain for d in same.deformations] == [0.02] * len(strained)
    for d in judge_again(result, {"deformation.wall_thickness_mm": 7.11}).deformations:
        assert np.isnan(d.strain)
        assert "another wall thickness" in d.not_measurable["strain"]
    with pytest.raises(SettingsError, match="needs a detection"):
        judge_again(result, {"stacks.width_mm": 9})


def test_that_other_catalogues_size_the_pipes_anew(report, tmp_path):
    out = tmp_path / "sized"
    command = ["judge", str(report), "-o", str(out), "--elements-catalogue", "EN 1057, EN 10220"]
    assert main([*command, "--quiet"]) == 0
    sizes = {e.nominal.catalogue for e in load(out).elements if e.nominal is not None}
    assert sizes
    assert sizes <= {"EN 1057", "EN 10220"}


def test_that_a_setting_that_needs_a_detection_is_no_flag(report, tmp_path):
    with pytest.raises(SystemExit) as error:
        main(["judge", str(report), "-o", str(tmp_path / "x"), "--stacks-width-mm", "9"])
    assert error.value.code == 2
