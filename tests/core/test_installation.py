"""What an installation of the library alone brings, and what it can do without the rest."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pipecore
from pipecore.simulate import save_scene
from tests.core.cli.test_cli_simulate import SCENE

ROOT = Path(__file__).parents[2]
NOT_IN_THE_LIBRARY = ("PySide6", "qtpy", "vtk", "vtkmodules", "pyvista", "pyvistaqt", "open3d")


def project(folder: str) -> dict:
    return tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["project"]


def run_without(packages: tuple[str, ...], code: str) -> subprocess.CompletedProcess[str]:
    """Run `code` where the import of any of `packages` fails as if it were not installed."""
    block = f"import sys; sys.modules.update(dict.fromkeys({packages}))\n"
    return subprocess.run(
        [sys.executable, "-c", block + code], capture_output=True, text=True, check=False
    )


def test_that_the_app_asks_for_the_library_of_its_own_version():
    assert project("")["version"] == pipecore.__version__
    assert f"pipegui-core=={pipecore.__version__}" in project("")["dependencies"]


def test_that_the_library_needs_no_window_and_no_open3d():
    needed = " ".join(project("core")["dependencies"]).lower()
    assert not [name for name in NOT_IN_THE_LIBRARY if name.lower() in needed]


def test_that_every_module_of_the_library_is_imported_without_window_and_open3d():
    # CloudCompare's modules are in its process only.
    code = (
        "import importlib, pkgutil, sys\n"
        "from unittest.mock import MagicMock\n"
        "import pipecore\n"
        "sys.modules.update(pycc=MagicMock(PythonPluginInterface=object), cccorelib=MagicMock())\n"
        "for m in pkgutil.walk_packages(pipecore.__path__, 'pipecore.'):\n"
        "    if not m.name.endswith('__main__'):\n"
        "        importlib.import_module(m.name)\n"
    )
    assert run_without(NOT_IN_THE_LIBRARY, code).stderr == ""


def test_that_simulating_without_open3d_says_how_to_get_it(tmp_path):
    save_scene(SCENE, tmp_path / "scene.toml")
    arguments = ["simulate", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "scan.laz")]
    code = f"from pipecore.cli import main; sys.exit(main({arguments}))"
    done = run_without(("open3d",), code)
    assert done.returncode == 1
    assert "pip install 'pipegui-core[open3d]'" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "scan.laz").exists()
