"""Every input can be named, explained and reached without a mouse."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QHeaderView,
    QLabel,
    QLineEdit,
    QMenu,
    QScrollBar,
    QTabBar,
    QWidget,
)

from pipegui.model import commands, view_commands
from pipegui.model.document import Scan
from pipegui.panels.deformation_columns import INDEX
from tests.factories import make_scan

CLOUD, RESULT = make_scan()
INPUTS = (QAbstractSpinBox, QAbstractSlider, QComboBox, QLineEdit, QAbstractItemView)


def is_inside_another(widget):
    """Parts that Qt makes of its own: a spin box's line, a combo's list, scroll bars."""
    parent = widget.parentWidget()
    own = (QScrollBar, QMenu, QHeaderView)
    makers = (QAbstractSpinBox, QComboBox, QLineEdit, QTabBar)
    while parent is not None:
        if isinstance(parent, makers):
            return True
        parent = parent.parentWidget()
    return isinstance(widget, own) or widget.objectName().startswith("qt_")


def inputs(app):
    return [w for w in app.window.findChildren(QWidget) if isinstance(w, INPUTS)]


def has_label(widget):
    labels = widget.window().findChildren(QLabel)
    return any(label.buddy() is widget for label in labels)


def named(widget):
    return f"{type(widget).__name__} {widget.objectName()} in {type(widget.parent()).__name__}"


@pytest.fixture
def whole(make_app, qtbot):
    """A window with the real plots beside a fake 3D view."""
    from pipegui.plots.deviation_map_view import DeviationMapView
    from pipegui.plots.preview_view import PreviewView
    from pipegui.plots.radius_plot import RadiusPlot
    from pipegui.plots.section_view import SectionView
    from tests.gui.fakes import make_fake_views

    views = make_fake_views()
    views.radius_plot, views.section = RadiusPlot(), SectionView()
    views.map, views.preview = DeviationMapView(), PreviewView()
    app = make_app(views=views)
    app.session.do(commands.open_scan, Scan("plant.laz", CLOUD))
    app.controllers.scans.on_detected(CLOUD, RESULT)
    app.session.do(view_commands.clip_to_scan)
    return app


def test_that_every_input_has_a_name(whole):
    nameless = [
        named(widget)
        for widget in inputs(whole)
        if not is_inside_another(widget) and not widget.accessibleName() and not has_label(widget)
    ]
    assert not nameless, "\n".join(nameless)


def test_that_every_button_without_words_has_a_name_and_a_tip(whole):
    silent = [
        named(button)
        for button in whole.window.findChildren(QAbstractButton)
        if not is_inside_another(button)
        and not button.text()
        and not (button.accessibleName() and button.toolTip())
        and type(button).__name__ != "QTableCornerButton"
        and button.parent().metaObject().className() != "QDockWidget"
    ]
    assert not silent, "\n".join(silent)


def test_that_every_choice_and_number_explains_itself(whole):
    silent = [
        named(widget)
        for widget in inputs(whole)
        if isinstance(widget, QComboBox | QAbstractSpinBox | QAbstractSlider)
        and not is_inside_another(widget)
        and not widget.toolTip()
    ]
    assert not silent, "\n".join(silent)


def test_that_tab_goes_down_the_settings(whole, qtbot):
    form = whole.window.panels.settings
    whole.window.panels.docks["Settings"].raise_()
    form.presets.choice.setFocus()
    places = []
    for _ in range(40):
        qtbot.keyClick(whole.window.focusWidget(), Qt.Key.Key_Tab)
        focused = whole.window.focusWidget()
        if not form.isAncestorOf(focused) or focused in (form.reset, form.advanced.button):
            break
        places.append(focused.mapTo(form.widget(), focused.rect().topLeft()).y())
    assert len(places) > 10
    assert places == sorted(places)


def test_that_f6_goes_from_panel_to_panel_and_back(whole, qtbot):
    docks = whole.window.panels.docks

    def panel_of(widget):
        return next((t for t, dock in docks.items() if dock.isAncestorOf(widget)), "centre")

    visited = []
    for _ in range(6):
        qtbot.keyClick(whole.window.focusWidget() or whole.window, Qt.Key.Key_F6)
        visited.append(panel_of(whole.window.focusWidget()))
    assert len(set(visited)) >= 4
    qtbot.keyClick(whole.window.focusWidget(), Qt.Key.Key_F6, Qt.KeyboardModifier.ShiftModifier)
    assert panel_of(whole.window.focusWidget()) == visited[-2]


def test_that_the_list_of_keys_names_all_of_them(whole, qtbot):
    from PySide6.QtWidgets import QDialog, QDialogButtonBox

    from pipegui.window.action_table import SPECS

    qtbot.keyClick(whole.window, Qt.Key.Key_F1)
    dialog = whole.window.findChild(QDialog, "shortcuts")
    text = " ".join(label.text() for label in dialog.findChildren(QLabel))
    for spec in SPECS:
        if spec.shortcut:
            key = whole.window.actions_[spec.name].shortcut()
            assert key.toString(key.SequenceFormat.NativeText) in text
    for words in ("Ctrl+C", "Page Up", "F2"):
        assert words in text
    assert dialog.height() <= 768
    close = dialog.findChild(QDialogButtonBox).buttons()[0]
    qtbot.keyClick(close, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: whole.window.findChild(QDialog, "shortcuts") is None)


def test_that_f2_in_the_table_writes_a_comment_and_renames_nothing(whole, qtbot):
    table = whole.window.panels.table
    table.view.setFocus()
    table.view.setCurrentIndex(table.proxy.index(0, INDEX["comment"]))
    qtbot.keyClick(table.view, Qt.Key.Key_F2)
    editor = table.view.findChild(QLineEdit)
    assert editor is not None
    qtbot.keyClicks(editor, "f is no shortcut here")
    with qtbot.waitSignal(table.commented):
        qtbot.keyClick(editor, Qt.Key.Key_Return)
    chosen = whole.session.document.selection.deformation_id
    assert whole.session.document.scan.review(chosen).comment == "f is no shortcut here"
    whole.window.actions_["undo"].trigger()
    assert whole.session.document.scan.review(chosen).comment == ""


def test_that_after_a_click_on_its_tab_the_arrows_step_through_the_sections(whole, qtbot):
    tabs, section = whole.window.panels.plots, whole.window.views.section
    place = tabs.tabBar().tabRect(tabs.indexOf(section)).center()
    qtbot.mouseClick(tabs.tabBar(), Qt.MouseButton.LeftButton, pos=place)
    qtbot.waitUntil(section.isVisible)
    shown = section.title.text()
    qtbot.keyClick(whole.window.focusWidget(), Qt.Key.Key_Right)
    assert tabs.currentWidget() is section
    assert section.title.text() != shown
    assert whole.session.document.selection.profile is not None


def test_that_tab_never_leads_where_nothing_is_seen(detected, qtbot):
    detected.window.panels.tree.view.setFocus()
    passed = set()
    for _ in range(60):
        qtbot.waitUntil(lambda: QApplication.focusWidget() is not None)
        focused = QApplication.focusWidget()
        qtbot.waitUntil(lambda w=focused: not w.visibleRegion().isEmpty() or w.height() == 0)
        passed |= {
            name for name, d in detected.window.panels.docks.items() if d.isAncestorOf(focused)
        }
        qtbot.keyClick(focused, Qt.Key.Key_Tab)
    assert passed == set(detected.window.panels.docks)
