"""Scenes as files: what goes in comes out, and mistakes are named where they are."""

from pathlib import Path

import pytest

from pipecore.errors import SceneError
from pipecore.simulate import find_scene, load_scene, random_pipe, random_scene, save_scene

GOOD = """
stations = [[0.0, -3.0, 1.5]]
[[runs]]
start = [0, 0, 1]
direction = [1, 0, 0]
radius = 0.1
pieces = [
    {kind = "straight", length = 2.0},
    {kind = "elbow", angle_deg = 90, bend_radius = 0.3, towards = [0, 0, 1]},
]
"""


def test_that_a_scene_survives_its_file(tmp_path: Path, seed: int) -> None:
    for scene in (random_scene(seed % 10_000), random_pipe(seed % 10_000, arc_deg=120.0)):
        save_scene(scene, tmp_path / "scene.toml")
        assert load_scene(tmp_path / "scene.toml") == scene


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (("radius = 0.1", ""), "lacks “radius”"),
        (("radius = 0.1", "radius = 0.1\ndiameter = 0.2"), "has no “diameter”"),
        (("radius = 0.1", "radius = 'thick'"), "must be a number"),
        (("radius = 0.1", "radius = nan"), "must be finite"),
        (("[0, 0, 1]\ndirection", "[0, 0]\ndirection"), "must have 3"),
        (('kind = "straight"', 'kind = "curly"'), "needs a “kind”: one of straight"),
        (("direction = [1, 0, 0]", "direction = [0, 0, 0]"), "direction has no length"),
        (("bend_radius = 0.3", "bend_radius = 0.05"), "bend radius is not larger"),
        (("towards = [0, 0, 1]", "towards = [2, 0, 0]"), "“towards” is along the pipe"),
        (("length = 2.0", "length = -2.0"), "length is not positive"),
        (("radius = 0.1", "radius = 0.1\nmaterial = 'cheese'"), "no material “cheese”"),
        (("[[runs]]", "[[runs"), "Cannot read"),
    ],
)
def test_that_a_mistake_is_named_with_its_file(
    tmp_path: Path, change: tuple[str, str], word: str
) -> None:
    text = GOOD.replace(*change)
    assert text != GOOD
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=word) as caught:
        load_scene(path)
    assert "scene.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("deformation", "word"),
    [
        ('{kind="dent", chainage=0.05, clock_deg=0, depth=0.01, length=0.2, width=0.1}', "over"),
        ('{kind="dent", chainage=1, clock_deg=0, depth=0.1, length=0.2, width=0.1}', "exceeds"),
        ('{kind="bulge", chainage=1, clock_deg=0, depth=0.01, length=0.2, width=0.7}', "wider"),
        ('{kind="ovality", ratio=0.9, clock_deg=0, chainage_start=0, chainage_end=1}', "ratio"),
        ('{kind="kink", chainage=1, angle_deg=50}', "angle"),
    ],
)
def test_that_a_deformation_must_fit_its_piece(tmp_path: Path, deformation: str, word: str) -> None:
    path = tmp_path / "scene.toml"
    piece = f"length = 2.0, deformations = [{deformation}]"
    path.write_text(GOOD.replace("length = 2.0", piece), encoding="utf-8")
    with pytest.raises(SceneError, match=word):
        load_scene(path)


def test_that_a_missing_file_is_a_scene_error(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"nowhere\.toml"):
        find_scene(str(tmp_path / "nowhere.toml"))


def test_that_random_scenes_have_names() -> None:
    assert find_scene("random:12") == random_scene(12)
    with pytest.raises(SceneError, match="no seed"):
        find_scene("random:x")


def test_that_clutter_without_extent_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    plain = GOOD.replace(
        "[[runs]]", "clutter = [{kind='beam', start=[0,0,0], end=[0,0,0]}]\n[[runs]]"
    )
    path.write_text(plain, encoding="utf-8")
    with pytest.raises(SceneError, match="same point"):
        load_scene(path)
