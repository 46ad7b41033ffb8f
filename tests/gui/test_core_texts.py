"""What the core says, errors and reasons, is said in the language of the window."""

import copy
import pickle
import re

import pytest

from pipecore import editing
from pipecore.errors import PipecoreError
from pipecore.io import read, write_laz
from pipecore.json_codec import from_plain
from pipecore.reasons import Reason
from pipecore.rules import load_rule
from pipecore.settings import Settings
from pipecore.types import ElementKind
from pipegui.i18n import texts
from pipegui.i18n.reason_texts import reason_text
from tests.factories import make_scan

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
def test_that_a_failed_reading_is_told_in_german(make_app, qtbot, tmp_path):
    app = make_app(read=lambda path, *_: read(path))
    app.controllers.scans.open_files([tmp_path / "none.laz"])
    qtbot.waitUntil(lambda: "Es gibt keine Datei" in app.window.panels.message.text.text())


@pytest.mark.usefixtures("german")
def test_that_an_error_within_an_error_is_said_in_german_too(tmp_path):
    path = tmp_path / "my.toml"
    path.write_text("[elements]\nmin_radius_mm = -3.0\n", encoding="utf-8")
    with pytest.raises(PipecoreError) as caught:
        Settings.from_toml(path)
    assert "sie muss mindestens" in texts.error_text(caught.value)


SHORT_ARC = Reason(
    "less than {needed}° of arc seen over {share} % of the length", needed="120", share="35"
)


@pytest.mark.usefixtures("german")
def test_that_reasons_are_said_in_german_with_their_numbers():
    text = reason_text(SHORT_ARC)
    assert "120° des Umfangs" in text
    assert "35 %" in text
    assert reason_text(Reason("too few points")) == "zu wenige Punkte"
    assert reason_text(Reason()) == ""


@pytest.mark.usefixtures("german")
def test_that_reasons_of_older_projects_stay_as_they_are_unless_they_have_no_numbers():
    assert reason_text(str(SHORT_ARC)) == SHORT_ARC
    assert reason_text("too few points") == "zu wenige Punkte"


@pytest.mark.parametrize("reason", [SHORT_ARC, Reason("too few points"), Reason()])
def test_that_a_reason_keeps_its_template_on_its_way_to_a_process(reason):
    for again in (pickle.loads(pickle.dumps(reason)), copy.deepcopy(reason)):
        assert (again, again.template, again.values) == (reason, reason.template, reason.values)


@pytest.mark.parametrize("plain", [3, {"template": "a"}, {"template": "{a}", "values": {"b": 1}}])
def test_that_what_is_no_reason_is_refused(plain):
    with pytest.raises(ValueError, match="is not a"):
        from_plain(Reason, plain)
