"""What is not read says what it is and what to do."""

import gzip
import zipfile
from pathlib import Path

import pytest

from pipecore import io
from pipecore.errors import ReadError

OBJ = "# corners\nv 1 2 3\nv 2 3 4\nv 3 4 5\nf 1 2 3\n"
STL = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\n"


@pytest.mark.parametrize(
    ("name", "program"),
    [
        ("scan.fls", "FARO SCENE"),
        ("scan.rcp", "ReCap"),
        ("scan.zfs", "LaserControl"),
        ("scan.rdbx", "RiSCAN"),
        ("scan.tzf", "RealWorks"),
        ("scan.rwcx", "RealWorks"),
        ("scan.lgs", "Leica"),
        ("scan.imp", "Cyclone"),
        ("scan.ptg", "Cyclone"),
        ("scan.bin", "CloudCompare"),
    ],
)
def test_that_formats_of_other_programs_name_them(tmp_path: Path, name: str, program: str) -> None:
    (tmp_path / name).write_bytes(b"\x01\x00\x80binary" * 50)
    for act in (io.read, io.info):
        with pytest.raises(ReadError, match=rf"{name}.*export it from .*{program}.*E57"):
            act(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "content"), [("a.obj", OBJ), ("a.txt", OBJ), ("a.stl", STL), ("a.off", "OFF\n3 1 0\n")]
)
def test_that_a_mesh_is_no_scan(tmp_path: Path, name: str, content: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(ReadError, match=r"is a mesh: .*open3d"):
        io.read(tmp_path / name)


def test_that_archives_are_to_be_unpacked(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "scan.zip", "w") as archive:
        archive.writestr("scan.xyz", "1 2 3\n")
    with gzip.open(tmp_path / "scan.xyz.gz", "w") as file:
        file.write(b"1 2 3\n")
    for name, kind in (("scan.zip", "ZIP"), ("scan.xyz.gz", "gzip")):
        with pytest.raises(ReadError, match=rf"packed \({kind}\)"):
            io.read(tmp_path / name)


def test_that_text_keeps_being_text_whatever_its_ending(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_text("1 2 3\n2 3 4\n")
    assert len(io.read(tmp_path / "a.bin")) == 2
