"""Settings hold what was given, refuse what does not fit, and survive text and TOML."""

import dataclasses
import math
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipecore.errors import SettingsError
from pipecore.settings import (
    SCHEDULER,
    DeformationSettings,
    DirectionPreset,
    LengthUnit,
    ProfileMethod,
    Settings,
    SizeCatalogue,
    StackSettings,
    ThinningSettings,
    choices_of,
    iterate_fields,
)

FIELDS = dict(iterate_fields())
NUMBERS = [key for key, spec in FIELDS.items() if spec.kind is float]

component = st.floats(-10.0, 10.0).filter(lambda c: abs(c) > 1e-3)
stack = st.one_of(
    st.tuples(component, component, component),
    st.tuples(component, component, component, st.floats(0.0, 500.0)),
)


def values_of(key: str) -> st.SearchStrategy[Any]:
    """All that a setting may be."""
    spec = FIELDS[key]
    if key == "stacks.directions":
        return st.lists(stack, max_size=3).map(tuple)
    if choices := choices_of(spec.kind):
        return st.lists(st.sampled_from(list(choices)), min_size=1, unique=True).map(tuple)
    if spec.kind is float:
        return st.floats(spec.minimum, spec.maximum, allow_nan=False, allow_infinity=False)
    if issubclass(spec.kind, StrEnum):
        return st.sampled_from(list(spec.kind))
    return st.text(st.characters(codec="utf-8"))


any_settings = st.fixed_dictionaries({}, optional={key: values_of(key) for key in FIELDS}).map(
    Settings().replace
)


@given(any_settings)
def test_that_settings_survive_a_toml_file(
    tmp_path_factory: pytest.TempPathFactory, settings: Settings
) -> None:
    path = tmp_path_factory.mktemp("settings") / "settings.toml"
    path.write_text(settings.to_toml(), encoding="utf-8")
    assert Settings.from_toml(path) == settings.replace({SCHEDULER: ""})


@given(any_settings)
def test_that_settings_survive_the_text_of_flags(settings: Settings) -> None:
    def text(key: str, value: Any) -> str:
        if key == "elements.catalogue":
            return ", ".join(value)
        if isinstance(value, tuple):
            return "; ".join(", ".join(map(repr, vector)) for vector in value)
        return str(value)

    flags = {key: text(key, settings.get(key)) for key in FIELDS}
    assert Settings().replace(flags) == settings


def test_that_one_catalogue_of_an_older_file_is_read_and_several_keep_their_order() -> None:
    one = Settings.from_dict({"elements": {"catalogue": "EN 10220"}})
    assert one.elements.catalogue == (SizeCatalogue.EN_10220,)
    two = Settings().replace({"elements.catalogue": "JIS G3452/G3454 ,EN 10220,EN 10220"})
    assert two.elements.catalogue == (SizeCatalogue.JIS_G3454, SizeCatalogue.EN_10220)
    with pytest.raises(SettingsError, match="one or several of: ASME"):
        Settings().replace({"elements.catalogue": ""})


def test_that_what_a_file_leaves_out_keeps_its_default(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_text('[stacks]\npreset = "axes"\nwidth_mm = 20\n', encoding="utf-8")
    settings = Settings.from_toml(path)
    assert settings.stacks.preset is DirectionPreset.AXES
    assert settings.stacks.width_mm == 20.0
    assert settings == Settings().replace({"stacks.preset": "axes", "stacks.width_mm": 20})


@pytest.mark.parametrize("key", NUMBERS)
def test_that_bounds_are_inclusive_and_held(key: str) -> None:
    spec = FIELDS[key]
    for bound, outwards in ((spec.minimum, -1.0), (spec.maximum, 1.0)):
        if bound is None:
            continue
        assert Settings().replace({key: bound}).get(key) == bound
        with pytest.raises(SettingsError, match=f"“{key}” is .* must be at (least|most)"):
            Settings().replace({key: bound + outwards * max(1e-6, 1e-6 * abs(bound))})


@pytest.mark.parametrize("key", NUMBERS)
@pytest.mark.parametrize("value", [math.nan, math.inf, "nan", "wide", "", True, None, [1.0]])
def test_that_a_number_must_be_one(key: str, value: object) -> None:
    with pytest.raises(SettingsError, match=key):
        Settings().replace({key: value})


@pytest.mark.parametrize("key", [k for k, s in FIELDS.items() if s.kind is not float])
@pytest.mark.parametrize("value", [7, True, [7], None])
def test_that_a_choice_a_name_or_a_direction_is_not_a_number(key: str, value: object) -> None:
    with pytest.raises(SettingsError, match=key):
        Settings().replace({key: value})


@pytest.mark.parametrize(
    "text",
    ["0,0", "0,0,0", "0,0,1,-20", "0,0,1,20,5", "a,b,c", "0,0,inf", "0 0 1", ",,"],
)
def test_that_a_stack_needs_a_direction_and_at_most_a_width(text: str) -> None:
    with pytest.raises(SettingsError):
        Settings().replace({"stacks.directions": text})


def test_that_stacks_are_read_from_text_with_their_widths() -> None:
    settings = Settings().replace({"stacks.directions": "0,0,1; 1,-1,0,25; "})
    assert settings.stacks.directions == ((0.0, 0.0, 1.0), (1.0, -1.0, 0.0, 25.0))


@pytest.mark.parametrize(
    ("toml", "named"),
    [
        ("[stacks]\nwidht_mm = 20\n", "stacks.widht_mm"),
        ("[stack]\nwidth_mm = 20\n", "stack.width_mm"),
        ("width_mm = 20\n", "width_mm"),
        ("[profiles]\nmethod = 'guessing'\n", "profiles.method"),
        ("[stacks\n", "settings.toml"),
    ],
)
def test_that_a_wrong_file_is_named_with_what_is_wrong_in_it(
    tmp_path: Path, toml: str, named: str
) -> None:
    path = tmp_path / "settings.toml"
    path.write_text(toml, encoding="utf-8")
    with pytest.raises(SettingsError) as caught:
        Settings.from_toml(path)
    assert named in str(caught.value)
    assert str(path) in str(caught.value)


def test_that_a_missing_or_undecodable_file_is_a_settings_error(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"nowhere\.toml"):
        Settings.from_toml(tmp_path / "nowhere.toml")
    (tmp_path / "latin1.toml").write_bytes(b"[deformation]\nrule = '\xe9'\n")
    with pytest.raises(SettingsError, match=r"latin1\.toml"):
        Settings.from_toml(tmp_path / "latin1.toml")


def test_that_a_wrong_choice_is_answered_with_the_right_ones() -> None:
    with pytest.raises(SettingsError) as caught:
        Settings().replace({"profiles.method": "guessing"})
    assert all(method in str(caught.value) for method in ProfileMethod)


@pytest.mark.parametrize(
    ("group", "values"),
    [
        (ThinningSettings, {"voxel_mm": -1.0}),
        (ThinningSettings, {"voxel_mm": "20"}),
        (ThinningSettings, {"voxel_mm": None}),
        (StackSettings, {"preset": "sideways"}),
        (StackSettings, {"directions": ((0.0, 0.0, 0.0),)}),
        (DeformationSettings, {"rule": 6}),
    ],
)
def test_that_no_group_takes_a_wrong_value(group: type, values: dict[str, Any]) -> None:
    (name,) = values
    with pytest.raises(SettingsError, match="stack" if name == "directions" else name):
        group(**values)


@pytest.mark.parametrize("value", [5, None, {"width_mm": 20.0}, ThinningSettings()])
def test_that_a_group_is_given_as_one(value: Any) -> None:
    with pytest.raises(SettingsError, match="“stacks” must be StackSettings"):
        Settings(stacks=value)


def test_that_settings_by_attributes_are_those_by_keys() -> None:
    by_attributes = Settings(
        stacks=StackSettings(preset="axes", width_mm=20, directions=[[0, 0, 1, 15]]),  # type: ignore[arg-type]
        thinning=ThinningSettings(voxel_mm=np.float32(8)),  # type: ignore[arg-type]
    )
    by_keys = Settings().replace(
        {
            "stacks.preset": "axes",
            "stacks.width_mm": 20,
            "stacks.directions": "0,0,1,15",
            "thinning.voxel_mm": 8,
        }
    )
    assert by_attributes == by_keys
    assert by_attributes.stacks.preset is DirectionPreset.AXES
    assert type(by_attributes.stacks.width_mm) is type(by_attributes.thinning.voxel_mm) is float


def test_that_settings_show_what_differs_from_the_defaults() -> None:
    assert repr(Settings()) == "<Settings: all defaults>"
    changed = Settings(stacks=StackSettings(width_mm=20))
    assert repr(changed) == "<Settings: stacks.width_mm 20.0 mm>"
    assert "<td>20.0 mm</td>" in changed._repr_html_()


def test_that_replace_leaves_the_original_alone() -> None:
    before = Settings()
    after = before.replace({"elements.min_radius_mm": 30})
    assert before == Settings()
    assert after.elements == dataclasses.replace(before.elements, min_radius_mm=30.0)
    assert after.profiles is before.profiles


@pytest.mark.parametrize("key", FIELDS)
def test_that_a_form_can_show_every_setting(key: str) -> None:
    spec = FIELDS[key]
    assert spec.label[0].isupper()
    assert spec.help.endswith(".")
    assert spec.default == Settings().get(key)
    suffixes = {"_mm": "mm", "_deg": "°", "_pct": "%", "_gib": "GiB"}
    units = {unit for suffix, unit in suffixes.items() if spec.name.endswith(suffix)}
    assert units == ({spec.unit} if spec.unit else set())
    if spec.zero_means:
        assert spec.minimum == 0.0


def test_that_survey_feet_and_feet_differ_by_two_parts_in_a_million() -> None:
    ratio = LengthUnit.US_SURVEY_FOOT.metres / LengthUnit.FOOT.metres
    assert ratio - 1 == pytest.approx(2e-6, rel=1e-3)
    assert LengthUnit.FOOT.metres == pytest.approx(12 * 0.0254)
    assert LengthUnit.MILLIMETRE.metres * 1000 == LengthUnit.METRE.metres


class TestClusterAddress:
    """Whoever answers at it runs code here: no file may name one."""

    def test_that_a_settings_file_names_one_in_vain_and_is_told_off(self, tmp_path):
        path = tmp_path / "settings.toml"
        path.write_text(
            '[tiling]\nscheduler = "tcp://203.0.113.7:8786"\n[elements]\nmin_radius_mm = 40\n'
        )
        notes = []
        settings = Settings.from_toml(path, notes.append)
        assert settings == Settings().replace({"elements.min_radius_mm": 40})
        [note] = notes
        assert "names a dask scheduler, which is ignored" in str(note)

    def test_that_what_older_versions_wrote_says_nothing(self, tmp_path):
        path = tmp_path / "settings.toml"
        path.write_text('[tiling]\nscheduler = ""\n')
        notes = []
        assert Settings.from_toml(path, notes.append) == Settings()
        assert notes == []

    def test_that_one_that_was_typed_is_not_written(self):
        typed = Settings().replace({"tiling.scheduler": "tcp://10.0.0.5:8786"})
        assert typed.tiling.scheduler
        assert "10.0.0.5" not in typed.to_toml()
        named = {"tiling": {"scheduler": "tcp://10.0.0.5:8786"}}
        assert Settings.from_dict(named) == Settings()
