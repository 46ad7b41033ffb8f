import json
import re
import tomllib
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import laspy
import numpy as np
import pytest

import pipecore.report
import pipecore.report.html
from pipecore.editing import delete_elements
from pipecore.errors import CancelledError, SettingsError, WriteError
from pipecore.inspection.points import ElementPoints
from pipecore.report import by_verdict, result_to_dict, summarise, write_html, write_report
from pipecore.report.figures import broken_at_gaps, section_around
from pipecore.settings import Settings
from pipecore.types import NO_ID, DeformationKind, Profiles, Verdict
from tests.factories import make_scan

FILES = {
    "elements.csv",
    "profiles.csv",
    "deformations.csv",
    "candidates.csv",
    "result.json",
    "segments.laz",
    "report.html",
    "settings.toml",
}


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("reports") / "report"
    write_report(folder, *make_scan())
    return folder


@pytest.fixture(scope="module")
def page(report) -> str:
    return (report / "report.html").read_text(encoding="utf-8")


class CancelAt:
    """A progress whose user cancels at a stage."""

    def __init__(self, stage: str) -> None:
        self.stage = stage

    def update(self, stage: str, fraction: float) -> None:
        if stage == self.stage:
            raise CancelledError


def stages_of_a_report(tmp_path) -> list[str]:
    stages: dict[str, None] = {}

    class Note:
        def update(self, stage: str, fraction: float) -> None:
            assert 0.0 <= fraction <= 1.0
            stages[stage] = None

    write_report(tmp_path / "noted", *make_scan(2000), progress=Note())
    return list(stages)


def test_that_a_report_is_exactly_its_files(report):
    assert {p.name for p in report.iterdir()} == FILES


def test_that_a_report_is_not_written_over_files_unasked(tmp_path):
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(WriteError, match="not empty"):
        write_report(tmp_path, *make_scan(2000))
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]
    write_report(tmp_path, *make_scan(2000), overwrite=True)
    assert {p.name for p in tmp_path.iterdir()} == FILES | {"notes.txt"}


def test_that_cancelling_at_any_stage_leaves_nothing(tmp_path):
    stages = stages_of_a_report(tmp_path)
    assert len(stages) >= 3
    for stage in stages:
        with pytest.raises(CancelledError):
            write_report(tmp_path / "report", *make_scan(2000), progress=CancelAt(stage))
        assert [p.name for p in tmp_path.iterdir()] == ["noted"]


def test_that_an_error_in_the_middle_leaves_the_former_report(tmp_path, monkeypatch):
    folder = tmp_path / "report"
    write_report(folder, *make_scan(2000))
    before = {p.name: p.read_bytes() for p in folder.iterdir()}

    def full_disk(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pipecore.report, "write_laz", full_disk)
    with pytest.raises(WriteError, match="No space left"):
        write_report(folder, *make_scan(3000, seed=2), overwrite=True)
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before
    assert [p.name for p in tmp_path.iterdir()] == ["report"]


def test_that_a_rule_that_has_gone_leaves_nothing(tmp_path):
    cloud, result = make_scan(2000)
    settings = Settings().replace({"deformation.rule": str(tmp_path / "gone.toml")})
    with pytest.raises(SettingsError, match="gone"):
        write_report(tmp_path / "report", cloud, replace(result, settings=settings))
    assert list(tmp_path.iterdir()) == []


def test_that_the_settings_in_a_report_are_those_of_the_result(report):
    assert Settings.from_toml(report / "settings.toml") == make_scan()[1].settings


def test_that_the_cloud_carries_ids_and_deviations_of_each_point(report):
    cloud, result = make_scan()
    las = laspy.read(report / "segments.laz")
    world = np.stack([las.x, las.y, las.z], axis=1)
    assert np.abs(world - cloud.world(cloud.xyz)).max() < 1e-4
    assert (las["segment_id"] == result.segment_id).all()
    assert (las["element_id"] == result.element_id).all()
    on_element = result.element_id != NO_ID
    assert np.isnan(las["deviation_mm"][~on_element]).all()
    assert las["deviation_mm"][on_element] == pytest.approx(
        1000 * result.deviation[on_element], abs=1e-3
    )
    assert (np.stack([las.red, las.green, las.blue], axis=1) // 257 == cloud.rgb).all()


def test_that_the_cloud_is_written_in_the_unit_of_the_file(tmp_path):
    cloud, result = make_scan(2000)
    settings = Settings().replace({"input.length_unit": "us-ft"})
    write_report(tmp_path / "report", cloud, replace(result, settings=settings))
    las = laspy.read(tmp_path / "report" / "segments.laz")
    world = np.stack([las.x, las.y, las.z], axis=1)
    assert np.abs(world * 1200 / 3937 - cloud.world(cloud.xyz)).max() < 1e-4


def test_that_the_json_carries_all_of_the_result_but_its_points(report):
    result = make_scan()[1]
    text = (report / "result.json").read_text(encoding="utf-8")
    data = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert (data["format"], data["format_version"]) == ("pipecore result", 1)
    assert Settings.from_dict(data["settings"]) == result.settings
    assert data["origin"] == result.origin.tolist()
    for written, element in zip(data["elements"], result.elements, strict=True):
        assert written["radius"] == element.radius
        assert written["kind"] == element.kind
        assert written["axis"]["kind"] == ("arc" if element.kind == "torus" else "line")
    assert data["elements"][-1]["ovality"] is None
    assert data["elements"][1]["nominal"] == {
        "name": "DN 150 / NPS 6",
        "outside_diameter": 0.1683,
        "catalogue": "",
    }
    assert data["profiles"]["semi_minor"] == pytest.approx(result.profiles.semi_minor, abs=1e-9)
    assert data["profiles"]["n_points"] == result.profiles.n_points.tolist()
    assert [d["verdict"] for d in data["deformations"]] == [d.verdict for d in result.deformations]
    assert "deviation" not in data


def test_that_the_json_names_the_file_but_not_its_folder():
    result = replace(make_scan(2000)[1], source=Path("/home/somebody/secret/plant.laz"))
    assert result_to_dict(result)["source"] == "plant.laz"


class Page(HTMLParser):
    """The visible words of a page, and whatever it would load from elsewhere."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.loads: list[str] = []
        self.tags: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            if name in ("src", "href", "xlink:href", "data", "srcset"):
                self.loads.append(value or "")

    def handle_data(self, data):
        self.words.append(data)


def test_that_the_page_needs_no_other_file(page):
    loads = [where for where in Page(page).loads if not where.startswith(("#", "data:"))]
    assert loads == []
    assert "@import" not in page
    assert "script" not in Page(page).tags


def test_that_the_page_states_what_its_numbers_mean(page):
    words = re.sub(r"\s+", " ", " ".join(Page(page).words))
    _, result = make_scan()
    for fact in (
        summarise(result),
        "plant.laz",
        "ETRS89 / UTM zone 32N",
        "Ovality = (D max − D min ) / D nom × 100 %",
        "ASME B31.4 and B31.8",
        "Check against your edition of the code",
        "dent: depth at most 6 % of the outside diameter",
        "with a probability of 97.7 %",
        "12.1 ± 0.3",
        "3.8 ± 0.5",
        "1:20",
        "not measurable",
        "Acceptance rule",
    ):
        assert fact in words


def test_that_the_page_shows_the_worst_first(page):
    tables = re.findall(r"<tbody>(.*?)</tbody>", page, re.DOTALL)
    for table in tables:
        verdicts = re.findall(r'class="verdict ([\w-]+)"', table)
        assert verdicts == sorted(verdicts, key=["reject", "review"].index)
        assert verdicts[0] == "reject"


def test_that_each_deformation_has_a_figure_that_is_whole(page):
    figures = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(figures) == len(make_scan()[1].deformations)
    for figure in figures:
        ET.fromstring(figure)


def test_that_figures_are_the_same_in_whatever_portions_points_are_looked_up(
    page, tmp_path, monkeypatch
):
    monkeypatch.setattr(pipecore.report.html, "POINTS_AT_ONCE", 1)
    monkeypatch.setattr(pipecore.report.html, "BLOCK", 333)
    write_html(tmp_path / "report.html", *make_scan())
    again = (tmp_path / "report.html").read_text(encoding="utf-8")
    for pattern in (r"<svg.*?</svg>", r"<figure.*?</figure>"):
        assert re.findall(pattern, again, re.DOTALL) == re.findall(pattern, page, re.DOTALL)


def test_that_names_cannot_put_anything_into_the_page(tmp_path):
    cloud, result = make_scan(2000)
    evil = "<img src=x onerror=alert(1)>&"
    cloud = replace(cloud, crs=evil)
    write_html(tmp_path / "report.html", cloud, replace(result, source=Path(evil)))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<img" not in text
    assert text.count("&lt;img src=x onerror=alert(1)&gt;&amp;") >= 3


def test_that_settings_that_were_changed_stand_out(tmp_path):
    cloud, result = make_scan(2000)
    settings = Settings().replace(
        {"stacks.width_mm": 15, "stacks.directions": "0,0,1;1,0,0,25", "deformation.rule": "api-5l"}
    )
    write_html(tmp_path / "report.html", cloud, replace(result, settings=settings))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    changed = re.findall(r'<tr class="changed"><td>(.*?)</td><td>(.*?)</td>', text)
    assert dict(changed) == {
        "Profile width": "15 mm",
        "Own stacks": "0,0,1; 1,0,0,25",
        "Acceptance rule": "api-5l",
    }
    assert "OD above 610 mm" in text


def test_that_the_page_says_where_a_rule_asks_for_more_than_was_looked_for(tmp_path):
    cloud, result = make_scan(2000)
    # 6 % of DN 80 is 5.3 mm, of DN 100 6.9 mm.
    settings = Settings().replace({"deformation.min_depth_mm": 6})
    write_html(tmp_path / "report.html", cloud, replace(result, settings=settings))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert re.search(r"On 1 element .*6 mm\): Pipe 9\.", text)


@pytest.mark.parametrize("kind", list(DeformationKind))
def test_that_every_kind_is_drawn_even_where_little_is_known(kind, tmp_path):
    cloud, result = make_scan(2000)
    unknown = replace(
        result.deformations[0],
        kind=kind,
        depth=np.nan,
        depth_sd=np.nan,
        clock=np.nan,
        ovality=np.nan,
        verdict=Verdict.NOT_MEASURABLE,
    )
    result = replace(
        result,
        deformations=(unknown,),
        profiles=Profiles.empty(),
        deviation=np.full(len(cloud), np.nan, np.float32),
    )
    write_html(tmp_path / "report.html", cloud, result)
    assert "not measurable" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_that_a_line_is_not_drawn_where_profiles_are_missing():
    chainage = np.array([0.01, 0.03, 0.05, 0.19, 0.21, 0.23])
    x, y = broken_at_gaps(chainage, np.arange(6.0))
    assert np.isnan(x).tolist() == np.isnan(y).tolist() == [False] * 3 + [True] + [False] * 3
    x, y = broken_at_gaps(chainage[:3], np.arange(3.0))
    assert np.isfinite([x, y]).all()


def test_that_the_section_of_an_oval_pipe_is_oval(rng):
    """Though its points deviate by nothing from the section's own curve."""
    result = make_scan()[1]
    ovality = result.deformations[0]
    element = result.element(ovality.element_id)
    chainage = ovality.chainage + rng.uniform(-0.005, 0.005, 20_000)
    clock = rng.uniform(0, 2 * np.pi, 20_000)
    height = 0.005 * np.cos(2 * clock)
    distance = element.radius_at(chainage) + height
    points = ElementPoints(np.arange(20_000), chainage, distance, clock, 0 * clock)
    angle, mean = section_around(ovality, element, points)
    assert mean == pytest.approx(0.005 * np.cos(2 * angle), abs=3e-4)


def test_that_nothing_found_is_a_report_too(tmp_path):
    cloud, result = make_scan(2000)
    nothing = replace(
        result,
        elements=(),
        deformations=(),
        profiles=Profiles.empty(),
        element_id=np.zeros(len(cloud), np.int32),
        segment_id=np.zeros(len(cloud), np.int32),
        deviation=np.full(len(cloud), np.nan, np.float32),
    )
    assert summarise(nothing) == "No pipes found"
    write_report(tmp_path / "report", cloud, nothing)
    assert {p.name for p in (tmp_path / "report").iterdir()} == FILES
    assert tomllib.loads((tmp_path / "report" / "settings.toml").read_text(encoding="utf-8"))


def test_that_the_summary_counts_what_a_surveyor_would():
    result = make_scan()[1]
    assert summarise(result) == "5 pipes in 3 runs, 4 deformations, 1 to reject, 3 to review"
    clean = replace(result, deformations=())
    assert summarise(clean) == "5 pipes in 3 runs, no deformations"


def test_that_the_deepest_of_equal_verdicts_comes_first_and_the_unknown_last():
    result = make_scan()[1]
    unknown = replace(result.deformations[3], deformation_id=5, depth=np.nan)
    accepted = replace(result.deformations[0], deformation_id=6, verdict=Verdict.ACCEPT)
    result = replace(result, deformations=(*result.deformations, unknown, accepted))
    assert [d.deformation_id for d in by_verdict(result)] == [1, 3, 4, 2, 5, 6]


def test_that_a_report_can_be_written_after_an_element_was_deleted(tmp_path):
    cloud, result = make_scan()
    left = delete_elements(result, [1])
    assert left.elements[-1].element_id > len(left.elements)
    write_report(tmp_path / "report", cloud, left)
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert page.count("<figure>") == len(left.deformations)
