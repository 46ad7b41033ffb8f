"""What is installed: the lock carries what is asked for, the wheels bring all that they run on."""

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
APP, CORE = (
    tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for folder in (ROOT, ROOT / "core")
)
OWN = {APP["name"], CORE["name"]}
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")


def locked() -> list[tuple[Requirement, str]]:
    """Each locked requirement with the text of its hashes."""
    entries = re.findall(r"^([a-z0-9].*?)\s*\\\n((?:\s+--hash=.*\n)+)", LOCK, re.MULTILINE)
    return [(Requirement(requirement), hashes) for requirement, hashes in entries]


def test_that_every_line_of_the_lock_is_exact_and_hashed() -> None:
    names = re.findall(r"^[a-z0-9][a-z0-9._-]*", LOCK, re.MULTILINE)
    assert len(locked()) == len(names)
    assert all(str(r.specifier).startswith("==") and "sha256:" in h for r, h in locked())


def test_that_the_lock_names_no_address_and_no_folder() -> None:
    for told in ("://", "--index-url", "--find-links", "file:", str(Path.home()), str(ROOT)):
        assert told not in LOCK


def asked() -> list[Requirement]:
    """What both distributions ask for on this Python, with all extras; not each other."""
    texts = [
        text
        for project in (APP, CORE)
        for group in (project["dependencies"], *project["optional-dependencies"].values())
        for text in group
    ]
    wanted = [r for r in map(Requirement, texts) if r.marker is None or r.marker.evaluate()]
    return [r for r in wanted if r.name not in OWN]


@pytest.mark.parametrize("wanted", asked(), ids=lambda r: r.name)
def test_that_the_lock_has_what_the_project_asks_for(wanted: Requirement) -> None:
    versions = [
        str(r.specifier).removeprefix("==")
        for r, _ in locked()
        if canonicalize_name(r.name) == canonicalize_name(wanted.name)
        and (r.marker is None or r.marker.evaluate())
    ]
    assert len(versions) == 1
    assert wanted.specifier.contains(versions[0])


def build_wheel(folder: Path, target: Path) -> None:
    """Build the wheel of a distribution and unpack it."""
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(target)],
        cwd=folder,
        check=True,
        capture_output=True,
    )
    (wheel,) = target.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(target / "unpacked")


def test_that_the_wheel_of_the_library_brings_its_resources(tmp_path: Path) -> None:
    build_wheel(ROOT / "core", tmp_path)
    unpacked = tmp_path / "unpacked"
    ask = (
        f"import sys; sys.path.insert(0, {str(unpacked)!r})\n"
        "from pipecore.resources import resource; print(resource('sizes'))"
    )
    sizes = subprocess.run(
        [sys.executable, "-c", ask], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout.strip()
    assert Path(sizes).is_relative_to(unpacked)
    in_sources = {p.name for p in (ROOT / "resources" / "sizes").iterdir()}
    assert {p.name for p in Path(sizes).iterdir()} == in_sources
    assert (unpacked / "pipecore" / "py.typed").is_file()
    assert not (unpacked / "pipegui").exists()


def test_that_the_wheel_of_the_app_holds_the_app_alone(tmp_path: Path) -> None:
    build_wheel(ROOT, tmp_path)
    unpacked = tmp_path / "unpacked"
    assert (unpacked / "pipegui" / "window" / "main_window.py").is_file()
    assert not (unpacked / "pipecore").exists()


@pytest.mark.parametrize("folder", [ROOT, ROOT / "core"], ids=["app", "library"])
def test_that_every_wheel_brings_the_licence(folder: Path, tmp_path: Path) -> None:
    build_wheel(folder, tmp_path)
    (brought,) = (tmp_path / "unpacked").glob("*.dist-info/licenses/LICENSE")
    assert brought.read_bytes() == (ROOT / "LICENSE").read_bytes()
