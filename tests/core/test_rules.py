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
    load_rules,
    outside_diameter,
)
from pipecore.settings import Settings
from pipecore.types import (
    Condition,
    DeformationKind,
    ElementKind,
    NominalSize,
    Question,
    Verdict,
)
from tests.factories import make_result, make_scan

RESULT = make_result(1000)
PIPE = RESULT.element(2)  # DN 150, outside diameter 168.3 mm
ALONE = {"interacts": False, "next_id": 0, "fitting_id": 0, "fitting_distance": np.nan}
PLAIN = {Question.WELD: False, Question.STRESS_RAISER: False}
DENT = replace(RESULT.deformation(1), **ALONE, answers=PLAIN)
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
        PIPE,
        kind=kind,
        radius=od_mm / 2000,
        radius_end=od_mm / 2000,
        nominal=NominalSize(f"OD {od_mm}", od_mm / 1000),
    )


def verdict(deformation, element, rule):
    return judge(deformation, element, load_rules(rule)).verdict


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
    element = replace(element, answers={Question.EXTERNAL_PRESSURE: False})
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
    joint = replace(PIPE, answers={Question.WHOLE_JOINT: True})
    piece = replace(PIPE, answers={Question.WHOLE_JOINT: False})
    for element in (PIPE, joint, piece):
        assert verdict(replace(bow, depth=limit * 1.2), element, "api-5l") is Verdict.REJECT
    straight = replace(bow, depth=limit * 0.8)
    assert verdict(straight, joint, "api-5l") is Verdict.ACCEPT
    # A piece of a joint is straighter than the joint may be.
    assert verdict(straight, PIPE, "api-5l") is Verdict.ACCEPT_IF
    assert verdict(straight, piece, "api-5l") is Verdict.REVIEW


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
    assert verdict(dent(30.0), PIPE, "b31-3-bends") is Verdict.REVIEW
    assert verdict(ovality(9.0), PIPE, "b31-3-bends") is Verdict.REVIEW  # no bend


def test_that_without_a_nominal_size_the_measured_diameter_counts():
    insulated = replace(PIPE, nominal=None, radius=0.125, radius_end=0.125)
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
    assert judge(dent(5.5), PIPE, [rule]).verdict is Verdict.REJECT
    assert str(rule.criteria[0]) == "dent, bulge: depth at most 5 mm"


GOOD = (
    'title="t"\nsource="s"\nnote="n"\n[[criteria]]\nkinds=["dent"]\nmeasure="depth_mm"\nlimit=5\n'
)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("limit=5", "limit=-5", "not a positive number"),
        ("limit=5", "limit=nan", "not a positive number"),
        ("limit=5", "limit=inf", "not a positive number"),
        ("limit=5", "limit='5'", "not a positive number"),
        ("limit=5", "limit=5\nod_above_mm='60'", "od_above_mm is '60'"),
        ("limit=5", "limit=5\nclock=['8:00']", "clock is not two times"),
        ("limit=5", "limit=5\nclock=['8:00', '4 pm']", "clock is not two times"),
        ("limit=5", "limit=5\nwhen={wled=true}", "wled"),
        ("limit=5", "limit=5\nwhen={weld='yes'}", "true or false"),
        ("limit=5", "limit=5\ncondition='soon'", "soon"),
        ("limit=5", "limit=5\nverdict='accept'", "reject or review"),
        ('note="n"', 'note="n"\ncertainty_pct=100', "certainty_pct is 100"),
        ('note="n"', "note=7", "note is not a text"),
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
    apart = replace(dent(4.5), chainage=DENT.chainage + 0.7)
    judged = judge_deformations((dent(5.5), apart), RESULT.elements, settings)
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
    for question in Question:
        assert f"`{question}`" in page


DENTS = (DeformationKind.DENT,)


def rule_of(*criteria: Criterion) -> Rule:
    return Rule("own", "Own", "test", "", criteria)


@pytest.mark.parametrize("measure", [m for m in Measure if m.startswith("depth")])
def test_that_a_dent_is_rejected_just_beyond_the_limit_that_is_told(measure):
    """Whatever the limit refers to: the limit that is drawn is the one that judges."""
    element, rule = pipe(168.3), rule_of(Criterion(DENTS, measure, 2.0))
    limit = dent_limit(element, [rule])
    for factor, expected in ((1.001, Verdict.REJECT), (0.999, Verdict.ACCEPT)):
        deformation = dent(1000 * factor * limit.depth, sd_mm=1e-6)
        assert judge(deformation, element, [rule]).verdict is expected


def test_that_the_strictest_limit_for_dents_counts():
    element = pipe(168.3)
    loose, strict = (
        Criterion(DENTS, Measure.DEPTH_PCT_OD, 6.0),
        Criterion(DENTS, Measure.DEPTH_MM, 5),
    )
    limit = dent_limit(element, [rule_of(loose, strict)])
    assert limit.criterion is strict
    assert limit.depth == pytest.approx(0.005)
    assert dent_limit(element, [rule_of(loose)]).depth == 0.06 * outside_diameter(element)


def test_that_a_rule_about_something_else_sets_no_limit_for_dents():
    element = pipe(168.3)
    bow = Criterion((DeformationKind.BOW,), Measure.DEPTH_PCT_LENGTH, 0.2)
    assert dent_limit(element, [rule_of(bow)]) is None
    assert dent_limit(element, [rule_of(Criterion(DENTS, Measure.OVALITY_PCT, 3.0))]) is None


@pytest.mark.parametrize(
    ("clock_h", "depth_mm", "od_mm", "condition"),
    [
        # The table of 49 CFR 195.452(h)(4): top from 8 to 4 o'clock, NPS 8 and NPS 16.
        (10, 10.1, 219.1, Condition.DAYS_60),
        (12, 13.5, 219.1, Condition.IMMEDIATE),
        (3.9, 6.6, 219.1, Condition.DAYS_60),
        (6, 6.6, 219.1, None),
        (6, 13.5, 219.1, Condition.DAYS_180),
        (12, 9.0, 406.4, Condition.DAYS_180),
        (12, 13.0, 406.4, Condition.DAYS_60),
        (8.1, 25.0, 406.4, Condition.IMMEDIATE),
        (7.9, 25.0, 406.4, Condition.DAYS_180),
        (5, 20.0, 406.4, None),
    ],
)
def test_that_the_liquid_rule_says_how_soon(clock_h, depth_mm, od_mm, condition):
    at = replace(dent(depth_mm), clock=clock_h % 12 / 12 * 2 * np.pi)
    said = judge(at, level(pipe(od_mm)), load_rules("49cfr195-452h"))
    assert said.condition == condition
    assert said.verdict is (Verdict.REJECT if condition else Verdict.ACCEPT)


def level(element):
    """The element, lying level."""
    axis = replace(element.axis, direction=np.array([1.0, 0.0, 0.0]))
    return replace(element, axis=axis)


def test_that_a_steep_pipe_has_no_top_and_a_person_looks():
    steep = pipe(219.1)
    steep = replace(steep, axis=replace(steep.axis, direction=np.array([0.0, 0.0, 1.0])))
    said = judge(replace(dent(8.0), clock=np.pi), steep, load_rules("49cfr195-452h"))
    assert said.verdict is Verdict.REVIEW
    assert "no top" in said.reason


def test_that_what_nobody_answered_is_asked_only_where_it_matters():
    rules = load_rules("asme-6pct")

    def said(depth_mm, answers):
        return judge(replace(dent(depth_mm), answers=answers), PIPE, rules)

    # 4 mm is 2.4 % of the diameter: beyond the 2 % for welds. 1 mm is not.
    both = {Question.WELD: False, Question.STRESS_RAISER: False}
    assert said(4.0, {}).verdict is Verdict.ACCEPT_IF
    assert said(4.0, {}).open_questions == both
    assert said(1.0, {}).open_questions == {Question.STRESS_RAISER: False}
    assert said(4.0, {Question.WELD: True}).verdict is Verdict.REJECT
    assert said(1.0, {Question.WELD: True, Question.STRESS_RAISER: False}).verdict is Verdict.ACCEPT
    assert said(4.0, both).verdict is Verdict.ACCEPT
    assert said(0.5, {Question.STRESS_RAISER: True}).verdict is Verdict.REJECT
    # What is rejected without any answer needs none.
    assert said(12.0, {}).verdict is Verdict.REJECT
    assert said(12.0, {}).open_questions == {}


def test_that_an_answer_for_a_place_goes_before_that_for_its_element():
    on_weld = replace(PIPE, answers={Question.WELD: True, Question.STRESS_RAISER: False})
    here = replace(dent(4.0), answers={Question.WELD: False})
    assert judge(here, on_weld, load_rules("asme-6pct")).verdict is Verdict.ACCEPT
    assert judge(replace(here, answers={}), on_weld, load_rules("asme-6pct")).verdict is (
        Verdict.REJECT
    )


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"interacts": True, "next_id": 7}, "interacts with deformation 7"),
        ({"fitting_id": 3, "fitting_distance": 0.1}, "fitting"),
    ],
)
def test_that_dents_near_others_or_fittings_are_for_a_person(change, why):
    shallow = replace(dent(2.0), **change)
    said = judge(shallow, PIPE, load_rules("asme-6pct"))
    assert said.verdict is Verdict.REVIEW
    assert why in said.reason
    far = replace(dent(2.0), fitting_id=3, fitting_distance=0.2)
    assert judge(far, PIPE, load_rules("asme-6pct")).verdict is Verdict.ACCEPT
    deep = replace(dent(12.0), **change)
    assert judge(deep, PIPE, load_rules("asme-6pct")).verdict is Verdict.REJECT


def test_that_cladding_gets_no_verdict():
    clad = replace(PIPE, answers={Question.CLAD: True})
    said = judge(dent(30.0), clad, load_rules("asme-6pct"))
    assert said.verdict is Verdict.NOT_MEASURABLE
    assert "cladding" in said.reason


def test_that_a_dent_on_a_reducer_is_judged_by_the_diameter_where_it_is():
    # 13 mm are 5.9 % of 219.1 mm, and 6.3 % where the reducer has 207 mm.
    cone = replace(pipe(219.1, ElementKind.CONE), radius_end=0.100)
    share = (0.10955 - 0.1035) / (0.10955 - 0.100)
    place = replace(dent(13.0, 0.01), chainage=share * cone.axis.length)
    assert outside_diameter(cone, place.chainage) == pytest.approx(0.207)
    assert verdict(place, cone, "asme-6pct") is Verdict.REJECT
    assert verdict(replace(place, chainage=0.0), cone, "asme-6pct") is Verdict.REVIEW  # a fitting


def test_that_no_tolerance_moves_a_verdict_but_a_confirmed_size_does():
    # 207 mm measured; a loose tolerance calls it 219.1. 12.8 mm are 6.2 % and 5.8 %.
    loose = replace(pipe(207.0), nominal=NominalSize("DN 200", 0.2191))
    assert verdict(dent(12.8), loose, "asme-6pct") is Verdict.REJECT
    confirmed = replace(loose, is_nominal_confirmed=True)
    assert verdict(dent(12.8), confirmed, "asme-6pct") is Verdict.ACCEPT


def test_that_a_diameter_at_the_end_of_a_range_is_judged_by_the_stricter_limit():
    # 323.9 mm measured ± 0.5 without a nominal size: on either side of 324.
    near = replace(pipe(323.9), nominal=None, radius_sd=0.00025)
    assert verdict(dent(6.6), near, "49cfr192-309") is Verdict.REJECT
    assert verdict(dent(6.1), near, "49cfr192-309") is Verdict.ACCEPT


def test_that_several_rules_judge_what_each_is_about():
    rules = load_rules("asme-6pct, b31-3-bends")
    bend = replace(pipe(168.3, ElementKind.TORUS), answers={Question.EXTERNAL_PRESSURE: False})
    assert judge(ovality(9.0), bend, rules).verdict is Verdict.REJECT
    assert judge(ovality(9.0), bend, rules).rule == "b31-3-bends"
    assert judge(dent(12.0), PIPE, rules).rule == "asme-6pct"
    assert judge(dent(12.0), PIPE, rules).verdict is Verdict.REJECT
    with pytest.raises(SettingsError, match="b31-4"):
        load_rules("asme-6pct, b31-4")


def test_that_a_fitting_is_not_judged_as_bent_pipe():
    elbow = replace(pipe(168.3, ElementKind.TORUS), answers={Question.BENT_PIPE: False})
    assert verdict(ovality(9.0), elbow, "b31-3-bends") is Verdict.REVIEW
    bend = replace(elbow, answers={})
    assert verdict(ovality(5.0), bend, "b31-3-bends") is Verdict.ACCEPT_IF
    outside = replace(bend, answers={Question.EXTERNAL_PRESSURE: True})
    assert verdict(ovality(5.0), outside, "b31-3-bends") is Verdict.REJECT


def test_that_a_limit_by_wall_asks_for_it(tmp_path):
    path = tmp_path / "thin.toml"
    path.write_text(GOOD + "d_over_t_above=50\n", encoding="utf-8")
    rules = load_rules(str(path))
    deep = dent(8.0)
    asked = judge(deep, PIPE, rules)
    assert (asked.verdict, asked.open_questions) == (Verdict.ACCEPT_IF, {Question.WALL: True})
    assert judge(deep, PIPE, rules, 0.002).verdict is Verdict.REJECT  # D/t 84
    # D/t 17: the rule says nothing of it.
    assert judge(deep, PIPE, rules, 0.010).verdict is Verdict.REVIEW


def test_that_a_rule_says_how_certain_it_wants_to_be(tmp_path):
    path = tmp_path / "bold.toml"
    path.write_text(GOOD.replace('note="n"', 'note="n"\ncertainty_pct=50'), encoding="utf-8")
    # Half certain: no band, and so no review.
    assert judge(dent(5.1, 1.0), PIPE, load_rules(str(path))).verdict is Verdict.REJECT
    assert judge(dent(4.9, 1.0), PIPE, load_rules(str(path))).verdict is Verdict.ACCEPT
