"""What the core says, errors and reasons, is said in the language of the window."""

import pickle
import re

import pytest

from pipecore import editing
from pipecore.errors import PipecoreError
from pipecore.io import read, write_laz
from pipecore.rules import load_rule
from pipecore.settings import Settings
from pipecore.types import ElementKind
from pipegui.i18n import texts
from pipegui.i18n.reason_texts import REASONS, _pattern, reason_text
from tests.factories import make_scan
from tools import translations as catalogue

ERRORS = (
    lambda folder: read(folder / "none.laz"),
    read,
    lambda folder: Settings().replace({"elements.min_radius_mm": -1.0}),
    lambda folder: Settings().replace({"stacks.preset": "sideways"}),
    lambda folder: load_rule("no such rule"),
    lambda folder: write_laz(folder / "none" / "a.laz", make_scan()[0]),
    lambda folder: editing.merge_elements(*make_scan(), [2]),
    lambda folder: editing.merge_elements(*make_scan(), [2, 9]),
    lambda folder: editing.split_element(*make_scan(), 2, 99.0),
    lambda folder: editing.change_kind(*make_scan(), 2, ElementKind.TORUS),
)


@pytest.mark.usefixtures("german")
@pytest.mark.parametrize("act", ERRORS)
def test_that_errors_of_the_core_are_said_in_german(act, tmp_path):
    with pytest.raises(PipecoreError) as caught:
        act(tmp_path)
    english, german = str(caught.value), texts.error_text(caught.value)
    assert german != english
    # In quotation marks stand names and paths.
    words = re.findall(r"\w+", re.sub(r"„.*?“", "", german))
    assert not set(words) & {"the", "is", "are", "of", "no", "and", "Pipe", "cylinder"}, german


def test_that_errors_keep_what_they_say_on_their_way_between_processes():
    with pytest.raises(PipecoreError) as caught:
        load_rule("no such rule")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.template, again.values) == (
        str(caught.value),
        caught.value.template,
        caught.value.values,
    )


@pytest.mark.usefixtures("german")
def test_that_a_failed_reading_is_told_in_german(make_window, qtbot, tmp_path):
    window = make_window(read=lambda path, *_: read(path))
    window.open_files([tmp_path / "none.laz"])
    qtbot.waitUntil(lambda: "Es gibt keine Datei" in window.panels.message.text.text())


@pytest.mark.usefixtures("german")
def test_that_an_error_within_an_error_is_said_in_german_too(tmp_path):
    path = tmp_path / "my.toml"
    path.write_text("[elements]\nmin_radius_mm = -3.0\n", encoding="utf-8")
    with pytest.raises(PipecoreError) as caught:
        Settings.from_toml(path)
    assert "sie muss mindestens" in texts.error_text(caught.value)


@pytest.mark.usefixtures("german")
def test_that_reasons_are_said_in_german_with_their_numbers():
    assert "120° des Umfangs" in reason_text("less than 120° of arc seen over 35 % of the length")
    assert reason_text("the noise allows no better than ± 1.4 %").endswith("± 1.4 %")
    assert reason_text("something new") == "something new"


def test_that_every_reason_the_core_gives_is_known():
    """The sentences stand in the core's sources, with their numbers as fields."""
    source = (catalogue.CORE / "deformation" / "finding.py").read_text(encoding="utf-8")
    source += (catalogue.CORE / "deformation" / "section_curve.py").read_text(encoding="utf-8")
    for reason in REASONS:
        words = max(re.split(r"\{\w+\}", reason), key=len).strip()
        assert words.removesuffix("standard deviations").strip() in source, reason
    for text in re.findall(r'NoFit\(f?"([^"]*)"', source) + re.findall(
        r'why = f?"([^"]*)"', source
    ):
        sample = re.sub(r"\{[^}]*\}", "7", text)
        assert not sample or any(_pattern(reason).fullmatch(sample) for reason in REASONS), text
