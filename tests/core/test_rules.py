from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipecore.errors import SettingsError
from pipecore.pipeline import judge_deformations
from pipecore.report import write_report
from pipecore.rules import (
    Criterion,
    Measure,
    Rule,
    dent_limit,
    judge,
    list_rules,
    load_rule,
    outside_diameter,
)
from pipecore.settings import Settings
from pipecore.types import DeformationKind, ElementKind, NominalSize, Verdict
from tests.factories import make_result, make_scan

RESULT = make_result(1000)
PIPE = RESULT.element(2)  # DN 150, outside diameter 168.3 mm
DENT = RESULT.deformation(1)
OVALITY = RESULT.deformation(2)


def dent(depth_mm: float, sd_mm: float = 0.1):
    return replace(DENT, depth=depth_mm / 1000, depth_sd=sd_mm / 1000)


def ovality(pct: float, sd_pct: float = 0.05, diameter: float = 0.1683):
    amplitude = pct / 100 * diameter / 4
    return replace(
        OVALITY, ovality=pct / 100, depth=amplitude, depth_sd=amplitude * sd_pct / pct, element_id=2
    )


def pipe(od_mm: float, kind: ElementKind = ElementKind.CYLINDER):
    return replace(
        PIPE, kind=kind, radius=od_mm / 2000, nominal=NominalSize(f"OD {od_mm}", od_mm / 1000)
    )


def verdict(deformation, element, rule):
    return judge(deformation, element, load_rule(rule))


def test_that_the_default_rule_is_there_and_all_name_their_source():
    names = [rule.name for rule in list_rules()]
    assert Settings().deformation.rule in names
    assert names == sorted(names)
    for rule in list_rules():
        assert rule.source
        assert "your edition" in rule.note
        assert rule.criteria
        assert load_rule(rule.name) == rule


@pytest.mark.parametrize(
    ("rule", "od_mm", "below_mm", "above_mm"),
    [
        ("asme-6pct", 168.3, 9.8, 10.4),  # 6 % of 168.3 is 10.1 mm
        ("asme-6pct", 60.3, 3.3, 3.9),  # 3.6 mm
        ("49cfr192-309", 168.3, 6.1, 6.7),  # 6.4 mm however small the pipe
        ("49cfr192-309", 323.9, 6.1, 6.7),
        ("49cfr192-309", 508.0, 9.8, 10.5),  # 2 % of 508 is 10.16 mm
        ("csa-z662", 168.3, 9.8, 10.4),
    ],
)
def test_that_dents_are_judged_by_the_limits_of_the_codes(rule, od_mm, below_mm, above_mm):
    assert verdict(dent(below_mm), pipe(od_mm), rule) is Verdict.ACCEPT
    assert verdict(dent(above_mm), pipe(od_mm), rule) is Verdict.REJECT


@pytest.mark.parametrize(
    ("rule", "element", "limit_pct"),
    [
        ("api-5l", pipe(168.3), 2.0),
        ("api-5l", pipe(610.0), 2.0),
        ("api-5l", pipe(711.0), 1.5),
        ("b31-3-bends", pipe(168.3, ElementKind.TORUS), 8.0),
        ("b31-3-bends-external", pipe(168.3, ElementKind.TORUS), 3.0),
        ("csa-z662", pipe(168.3, ElementKind.TORUS), 5.0),
    ],
)
def test_that_ovality_is_judged_by_the_limits_of_the_codes(rule, element, limit_pct):
    assert verdict(ovality(limit_pct - 0.15), element, rule) is Verdict.ACCEPT
    assert verdict(ovality(limit_pct), element, rule) is Verdict.REVIEW
    assert verdict(ovality(limit_pct + 0.15), element, rule) is Verdict.REJECT


def test_that_the_worst_of_several_criteria_counts():
    # 1.4 % of 1219 mm is below 1.5 %, but more than 15 mm.
    assert verdict(ovality(1.4, 0.005, 1.219), pipe(1219), "api-5l") is Verdict.REJECT
    assert verdict(ovality(1.2, 0.005, 1.219), pipe(1219), "api-5l") is Verdict.ACCEPT


def test_that_a_bow_is_judged_by_the_length_of_its_pipe():
    bow = replace(DENT, kind=DeformationKind.BOW, depth_sd=0.0001)
    limit = 0.002 * PIPE.axis.length
    assert verdict(replace(bow, depth=limit * 1.2), PIPE, "api-5l") is Verdict.REJECT
    assert verdict(replace(bow, depth=limit * 0.8), PIPE, "api-5l") is Verdict.ACCEPT


@pytest.mark.parametrize("sd_mm", [0.1, 0.5, 1.0])
def test_that_two_standard_deviations_around_the_limit_go_to_review(sd_mm):
    limit_mm = 0.06 * 168.3
    for offset, expected in [
        (-2.1, Verdict.ACCEPT),
        (-1.9, Verdict.REVIEW),
        (0.0, Verdict.REVIEW),
        (1.9, Verdict.REVIEW),
        (2.1, Verdict.REJECT),
    ]:
        assert verdict(dent(limit_mm + offset * sd_mm, sd_mm), PIPE, "asme-6pct") is expected


def test_that_what_was_not_measured_is_not_judged():
    for depth, sd in [(np.nan, 0.1), (20.0, np.nan)]:
        assert verdict(dent(depth, sd), PIPE, "asme-6pct") is Verdict.NOT_MEASURABLE
    unknown = replace(OVALITY, ovality=np.nan)
    assert verdict(unknown, PIPE, "api-5l") is Verdict.NOT_MEASURABLE


def test_that_what_a_rule_does_not_cover_is_for_a_person():
    assert verdict(ovality(9.0), PIPE, "asme-6pct") is Verdict.REVIEW
    assert verdict(dent(30.0), PIPE, "api-5l") is Verdict.REVIEW
    assert verdict(ovality(9.0), PIPE, "b31-3-bends") is Verdict.REVIEW  # no bend


def test_that_without_a_nominal_size_the_measured_diameter_counts():
    insulated = replace(PIPE, nominal=None, radius=0.125)
    assert verdict(dent(14.5), insulated, "asme-6pct") is Verdict.ACCEPT
    assert verdict(dent(15.5), insulated, "asme-6pct") is Verdict.REJECT


def test_that_a_user_can_write_an_own_rule(tmp_path):
    path = tmp_path / "our-plant.toml"
    path.write_text(
        'title = "Ours"\nsource = "Plant standard 7"\nnote = "2024"\n'
        '[[criteria]]\nkinds = ["dent", "bulge"]\nmeasure = "depth_mm"\nlimit = 5\n',
        encoding="utf-8",
    )
    rule = load_rule(str(path))
    assert rule.name == "our-plant"
    assert judge(dent(5.5), PIPE, rule) is Verdict.REJECT
    assert str(rule.criteria[0]) == "dent, bulge: depth at most 5 mm"


GOOD = (
    'title="t"\nsource="s"\nnote="n"\n[[criteria]]\nkinds=["dent"]\nmeasure="depth_mm"\nlimit=5\n'
)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("limit=5", "limit=-5", "not a positive number"),
        ("limit=5", "", "lacks 'limit'"),
        ("depth_mm", "depth_in", "depth_in"),
        ('"dent"', '"scratch"', "scratch"),
        ("limit=5", "limit=5\nod_below=3", "od_below"),
        ('title="t"', "", "title"),
        ('title="t"', "title=", "Cannot read the rule"),
        ("[[criteria]]", "[criterion]", "lacks 'criteria'"),
    ],
)
def test_that_a_broken_rule_is_named_with_its_mistake(tmp_path, old, new, said):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace(old, new), encoding="utf-8")
    with pytest.raises(SettingsError, match=said) as caught:
        load_rule(str(path))
    assert "mine.toml" in str(caught.value)


def test_that_a_missing_rule_is_named_with_the_choice_there_is(tmp_path):
    with pytest.raises(SettingsError, match=r"“asme-7pct”; choose one of .*asme-6pct"):
        load_rule("asme-7pct")
    with pytest.raises(SettingsError, match="no rule file"):
        load_rule(str(tmp_path / "gone.toml"))


def test_that_the_path_of_an_own_rule_in_the_settings_judges_and_stands_in_the_report(tmp_path):
    path = tmp_path / "our plant.toml"
    path.write_text(GOOD, encoding="utf-8")
    own = Settings().replace({"deformation.rule": str(path)})
    (tmp_path / "settings.toml").write_text(own.to_toml(), encoding="utf-8")
    settings = Settings.from_toml(tmp_path / "settings.toml")
    rule = load_rule(settings.deformation.rule)
    judged = judge_deformations((dent(5.5), dent(4.5)), RESULT.elements, rule)
    assert [d.verdict for d in judged] == [Verdict.REJECT, Verdict.ACCEPT]
    cloud, result = make_scan(1000)
    write_report(
        tmp_path / "report", cloud, replace(result, settings=settings, deformations=judged)
    )
    table = (tmp_path / "report" / "deformations.csv").read_text(encoding="utf-8")
    assert "our plant,reject" in table
    assert "depth at most 5 mm" in (tmp_path / "report" / "report.html").read_text("utf-8")


def test_that_every_rule_that_comes_with_the_program_is_told_in_the_documentation():
    page = (Path(__file__).parents[2] / "docs" / "rules.md").read_text(encoding="utf-8")
    for rule in list_rules():
        assert f"`{rule.name}`" in page
    for measure in Measure:
        assert f"`{measure}`" in page


DENTS = (DeformationKind.DENT,)


def rule_of(*criteria: Criterion) -> Rule:
    return Rule("own", "Own", "test", "", criteria)


@pytest.mark.parametrize("measure", [m for m in Measure if m.startswith("depth")])
def test_that_a_dent_is_rejected_just_beyond_the_limit_that_is_told(measure):
    """Whatever the limit refers to: the limit that is drawn is the one that judges."""
    element, rule = pipe(168.3), rule_of(Criterion(DENTS, measure, 2.0))
    limit = dent_limit(element, rule)
    for factor, expected in ((1.001, Verdict.REJECT), (0.999, Verdict.ACCEPT)):
        deformation = dent(1000 * factor * limit.depth, sd_mm=1e-6)
        assert judge(deformation, element, rule) is expected


def test_that_the_strictest_limit_for_dents_counts():
    element = pipe(168.3)
    loose, strict = (
        Criterion(DENTS, Measure.DEPTH_PCT_OD, 6.0),
        Criterion(DENTS, Measure.DEPTH_MM, 5),
    )
    limit = dent_limit(element, rule_of(loose, strict))
    assert limit.criterion is strict
    assert limit.depth == pytest.approx(0.005)
    assert dent_limit(element, rule_of(loose)).depth == 0.06 * outside_diameter(element)


def test_that_a_rule_about_something_else_sets_no_limit_for_dents():
    element = pipe(168.3)
    bow = Criterion((DeformationKind.BOW,), Measure.DEPTH_PCT_LENGTH, 0.2)
    assert dent_limit(element, rule_of(bow)) is None
    assert dent_limit(element, rule_of(Criterion(DENTS, Measure.OVALITY_PCT, 3.0))) is None
