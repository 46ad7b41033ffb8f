"""Settings by name, and back to the defaults one by one: files, form and window."""

import pytest
from PySide6.QtCore import Qt

from pipecore.errors import SettingsError
from pipecore.settings import Settings
from pipegui.model import commands
from pipegui.model.document import Document
from pipegui.model.presets import STANDARD, Presets, applied
from pipegui.panels.settings_form import SettingsForm

LEFT = Qt.MouseButton.LeftButton
OWN = Settings().replace(
    {
        "elements.min_radius_mm": 42.0,
        "input.length_unit": "mm",
        "stacks.directions": ((1.0, 0.0, 0.0),),
    }
)


@pytest.fixture
def presets(tmp_path):
    return Presets(tmp_path / "presets")


@pytest.fixture
def form(qtbot, no_leaks, presets):
    form = SettingsForm()
    qtbot.addWidget(form)
    form.resize(300, 700)
    with qtbot.waitActive(form):
        form.show()
        form.activateWindow()
    form.presets.use(presets)
    return form


def names(presets):
    return [preset.name for preset in presets.every()]


def test_that_every_preset_of_the_program_loads_and_says_what_it_is_for(presets):
    for preset in presets.every():
        assert preset.description, preset.name
        assert not preset.is_own
        assert (preset.load() == Settings()) == (preset.name == STANDARD)


def test_that_saved_settings_come_back_without_what_belongs_to_the_scan(presets):
    presets.save("Boiler house 3", OWN)
    back = Presets(presets.folder).every()[-1]
    assert (back.name, back.is_own) == ("Boiler house 3", True)
    assert back.load().elements.min_radius_mm == 42.0
    assert back.load().input == Settings().input
    other_scan = Settings().replace({"input.length_unit": "ft"})
    assert applied(other_scan, back.load()).get("input.length_unit") == "ft"
    assert applied(OWN, back.load()).stacks.directions == ((1.0, 0.0, 0.0),)


def test_that_the_preset_of_settings_is_recognised(presets):
    assert presets.matching(Settings()).name == STANDARD
    assert presets.matching(OWN) is None
    presets.save("mine", OWN)
    assert presets.matching(OWN).name == "mine"
    presets.delete(presets.matching(OWN))
    assert presets.matching(OWN) is None


@pytest.mark.parametrize(
    "name", ["", "  ", "a/b", "..", "a\\b", "Standard", "large pipes", ".x", "n."]
)
def test_that_names_that_will_not_do_are_refused(presets, name):
    assert presets.objection(name)
    with pytest.raises(SettingsError):
        presets.save(name, OWN)
    assert not presets.folder.exists()


def test_that_a_broken_file_harms_nothing_until_it_is_chosen(presets):
    presets.save("good", OWN)
    (presets.folder / "broken.toml").write_text("elements = 3")
    assert "broken" in names(presets)
    assert presets.matching(OWN).name == "good"
    with pytest.raises(SettingsError):
        next(p for p in presets.every() if p.name == "broken").load()


def test_that_settings_are_saved_by_name_chosen_and_deleted_in_the_form(form, qtbot, presets):
    bar = form.presets
    form.apply(OWN)
    assert bar.choice.currentText() == "Own settings"
    assert not bar.delete_button.isEnabled()
    qtbot.mouseClick(bar.save_button, LEFT)
    qtbot.waitUntil(bar.name.hasFocus)
    qtbot.keyClicks(bar.name, "Standard")
    assert not bar.accept.isEnabled()
    assert "comes with the program" in bar.objection.text()
    bar.name.selectAll()
    qtbot.keyClicks(bar.name, "Mine")
    qtbot.keyClick(bar.name, Qt.Key.Key_Return)
    assert not bar.name.isVisible()
    assert bar.choice.currentText() == "Mine"
    form.apply(Settings())
    assert bar.choice.currentText() == STANDARD
    bar.choice.setFocus()
    with qtbot.waitSignal(bar.chosen) as told:
        qtbot.keyClick(bar.choice, Qt.Key.Key_End)
    assert told.args[0].elements.min_radius_mm == 42.0
    form.apply(OWN)
    qtbot.mouseClick(bar.delete_button, LEFT)
    assert "Mine" not in names(presets)
    assert bar.choice.currentText() == "Own settings"


def test_that_a_preset_that_cannot_be_read_is_told(form, qtbot, presets):
    presets.folder.mkdir()
    (presets.folder / "broken.toml").write_text("elements = 3")
    form.presets.use(presets)
    row = form.presets.choice.findText("broken")
    with qtbot.waitSignal(form.presets.failed) as told:
        form.presets.choose(row)
    assert "broken" in told.args[0]
    assert form.presets.choice.currentText() == STANDARD


def test_that_one_setting_and_one_group_go_back_to_their_defaults(form, qtbot):
    settings = Settings().replace(
        {"elements.min_radius_mm": 40.0, "elements.min_length_mm": 55.0, "stacks.width_mm": 9.0}
    )
    form.apply(settings)
    assert form.resets["elements.min_radius_mm"].isVisible()
    assert not form.resets["elements.max_radius_mm"].isVisible()
    with qtbot.waitSignal(form.keys_reset) as told:
        qtbot.mouseClick(form.resets["elements.min_radius_mm"], LEFT)
    assert told.args == [["elements.min_radius_mm"]]
    document = commands.reset_keys(Document(settings=settings), told.args[0])
    assert document.settings.elements.min_radius_mm == Settings().elements.min_radius_mm
    assert document.settings.elements.min_length_mm == 55.0
    _, button = next(g for g in form.group_resets if "elements.min_radius_mm" in g[0])
    with qtbot.waitSignal(form.keys_reset) as told:
        qtbot.mouseClick(button, LEFT)
    document = commands.reset_keys(Document(settings=settings), told.args[0])
    assert document.settings.elements == Settings().elements
    assert document.settings.stacks.width_mm == 9.0
    form.apply(document.settings)
    assert not button.isVisible()


def test_that_fields_stay_where_they_are_when_one_is_changed(form):
    from PySide6.QtWidgets import QWidget

    field = form.findChild(QWidget, "elements.min_radius_mm")
    before = field.geometry()
    form.apply(Settings().replace({"elements.min_radius_mm": 40.0}))
    assert field.geometry() == before


def test_that_a_preset_in_the_window_is_one_step_that_can_be_undone(app, qtbot):
    app.window.panels.docks["Settings"].raise_()
    bar = app.window.panels.settings.presets
    row = bar.choice.findText("Large pipes")
    bar.choice.setCurrentIndex(row)
    bar.choose(row)
    assert app.session.document.settings.elements.min_radius_mm == 100.0
    app.window.actions_["undo"].trigger()
    assert app.session.document.settings == Settings()
    assert bar.choice.currentText() == STANDARD
