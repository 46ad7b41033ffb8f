"""The German window: every text translated, nothing of the English left, English by default."""

import re
from dataclasses import replace

import pytest
from PySide6.QtGui import QAction
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSpinBox,
    QComboBox,
    QDockWidget,
    QLabel,
    QLineEdit,
    QMenu,
    QTabWidget,
    QWidget,
)

from pipegui.i18n import texts
from pipegui.model import commands, view_commands
from pipegui.model.document import Scan
from tests.factories import make_scan
from tools import translations as catalogue

TRANSLATED = [code for code in texts.LANGUAGES if code not in ("", "en")]


def forms(message):
    """Pairs of an English form and its translation."""
    ids, strings = message.id, message.string
    return [(ids, strings)] if isinstance(ids, str) else list(zip(ids, strings, strict=True))


@pytest.mark.parametrize("code", TRANSLATED)
def test_that_every_text_is_translated(code):
    messages = [m for m in catalogue.read(code) if m.id]
    assert len(messages) > 500
    assert [m.id for m in messages if not catalogue.is_translated(m)] == []


@pytest.mark.parametrize("code", TRANSLATED)
def test_that_a_translation_holds_the_same_fields(code):
    field = re.compile(r"\{[^}]*\}|</?\w+>")
    for message in catalogue.read(code):
        for english, other in forms(message) if message.id else ():
            assert sorted(field.findall(english)) == sorted(field.findall(other)), english


@pytest.mark.parametrize("code", TRANSLATED)
def test_that_an_ellipsis_and_outer_spaces_are_kept(code):
    for message in catalogue.read(code):
        for english, other in forms(message) if message.id else ():
            assert english.endswith("…") == other.endswith("…"), english
            assert english[:1].isspace() == other[:1].isspace(), english
            assert english[-1:].isspace() == other[-1:].isspace(), english


@pytest.mark.parametrize("code", TRANSLATED)
def test_that_the_catalogue_is_up_to_date(code):
    """Else run `make texts`."""
    kept = catalogue.read(code)
    assert {m.id for m in kept} - {""} == {m.id for m in catalogue.extract()} - {""}
    assert catalogue.path_of(code, "mo").read_bytes() == catalogue.compiled(kept)


def test_that_english_is_the_default():
    assert texts.language() == "en"
    assert texts.tr("Undo") == "Undo"


@pytest.mark.parametrize(
    ("chosen", "system", "spoken"),
    [
        ("", "de-AT", "de"),
        ("", "fr-FR", "en"),
        ("", "", "en"),
        ("en", "de-DE", "en"),
        ("de", "en-GB", "de"),
        ("xx", "de-DE", "en"),
    ],
)
def test_that_the_choice_goes_before_the_system(chosen, system, spoken):
    try:
        texts.use_language(chosen, system)
        assert texts.language() == spoken
    finally:
        texts.use_language("en")


def test_that_counts_take_their_form(german):
    pipes = [texts.count("{n:,} pipe", "{n:,} pipes", n) for n in (0, 1, 2)]
    assert pipes == ["0 Rohre", "1 Rohr", "2 Rohre"]


@pytest.mark.usefixtures("german")
def test_that_every_menu_has_a_key_of_its_own(make_app):
    titles = [a.text() for a in make_app().window.menuBar().actions()]
    keys = [title[title.index("&") + 1].lower() for title in titles]
    assert len(keys) == len(set(keys)), titles


def said(app):
    """All that a window says, with where it says it."""
    for action in app.window.findChildren(QAction):
        yield from ((action, text) for text in (action.text(), action.toolTip()))
    for widget in app.window.findChildren(QWidget):
        if widget.objectName().startswith("qt_"):  # Qt's own, with a catalogue of its own
            continue
        found = [widget.toolTip(), widget.accessibleName(), widget.statusTip()]
        match widget:
            case QLabel() | QAbstractButton():
                found.append(widget.text())
            case QLineEdit():
                found.append(widget.placeholderText())
            case QMenu():
                found.append(widget.title())
            case QDockWidget():
                found.append(widget.windowTitle())
            case QComboBox():
                found += [widget.itemText(i) for i in range(widget.count())]
            case QAbstractSpinBox():
                found.append(widget.specialValueText() if hasattr(widget, "minimum") else "")
            case QTabWidget():
                found += [widget.tabText(i) for i in range(widget.count())]
            case QAbstractItemView() if widget.model() is not None:
                found += cells(widget.model())
        yield from ((widget, text) for text in found)


def cells(model):
    from PySide6.QtCore import Qt

    for column in range(model.columnCount()):
        for role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.ToolTipRole):
            yield model.headerData(column, Qt.Orientation.Horizontal, role) or ""
        for row in range(model.rowCount()):
            for role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.ToolTipRole):
                yield model.data(model.index(row, column), role) or ""


def reader(known):
    """Whether a text is one of those that are known, with anything in its fields."""
    plain = {text.replace("&", "") for text in known}
    patterns = [
        re.compile(re.sub(r"\\\{.*?\\\}", ".+", re.escape(text)))
        for text in plain
        if re.search(r"[^\W\d]{3}", re.sub(r"\{.*?\}", "", text)) and "{" in text
    ]
    return lambda text: text in plain or any(p.fullmatch(text) for p in patterns)


def english_in(app):
    """Texts of the catalogue that a window says in English, with where."""
    kept = [pair for m in catalogue.read("de") if m.id for pair in forms(m)]
    is_english, is_german = (reader([pair[i] for pair in kept]) for i in (0, 1))
    left = []
    for place, text in said(app):
        for line in (text, *str(text).splitlines()):
            plain = re.sub(r" \([^()]*\)$", "", str(line)).replace("&", "").strip()
            if is_english(plain) and not is_german(plain):
                left.append(f"{type(place).__name__} {place.objectName()}: {line}")
    return sorted(set(left))


@pytest.mark.usefixtures("german")
def test_that_the_empty_window_is_german_too(make_app):
    assert not english_in(make_app())


@pytest.mark.usefixtures("german")
def test_that_nothing_english_is_left_in_the_german_window(make_app):
    from pipegui.plots.deviation_map_view import DeviationMapView
    from pipegui.plots.preview_view import PreviewView
    from pipegui.plots.radius_plot import RadiusPlot
    from pipegui.plots.section_view import SectionView
    from tests.gui.fakes import make_fake_views

    views = make_fake_views()
    views.radius_plot, views.section = RadiusPlot(), SectionView()
    views.map, views.preview = DeviationMapView(), PreviewView()
    app = make_app(views=views)
    cloud, result = make_scan()
    result = replace(result)  # What was told of a result is kept; of this one nothing was told.
    app.session.do(commands.open_scan, Scan("plant.laz", cloud))
    app.controllers.scans.on_detected(cloud, result)
    app.session.do(view_commands.clip_to_scan)
    assert not english_in(app)
    assert app.window.actions_["undo"].text() == "Rückgängig: Erkennen"
    assert app.window.panels.docks["Deformations"].windowTitle() == "Verformungen"
    assert app.window.panels.message.text.text().startswith("5 Rohre in 3 Rohrsträngen, 4 Verform")


def test_that_a_choice_is_kept_and_said(make_app):
    app = make_app()
    app.window.actions_["language_de"].trigger()
    assert app.session.stored.value("language") == "de"
    checked = [
        c for c in texts.LANGUAGES if app.window.actions_[f"language_{c or 'system'}"].isChecked()
    ]
    assert checked == ["de"]
    assert app.window.panels.message.text.text() == "The language changes at the next start."
    assert texts.language() == "en"
