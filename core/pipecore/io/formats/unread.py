"""Formats that are not read: what they are, and what to do."""

import re
from pathlib import Path

from pipecore.errors import ReadError

_EXPORT = "E57, LAS, LAZ, PTX or PLY"

_PROGRAMS = {
    ".fls": "FARO SCENE",
    ".lsproj": "FARO SCENE",
    ".fws": "FARO SCENE",
    ".rcp": "Autodesk ReCap",
    ".rcs": "Autodesk ReCap",
    ".zfs": "Z+F LaserControl",
    ".zfprj": "Z+F LaserControl",
    ".rdbx": "RIEGL RiSCAN PRO",
    ".rdb": "RIEGL RiSCAN PRO",
    ".rxp": "RIEGL RiSCAN PRO",
    ".3dd": "RIEGL RiSCAN PRO",
    ".tzf": "Trimble RealWorks",
    ".rwp": "Trimble RealWorks",
    ".rwcx": "Trimble RealWorks",
    ".lgs": "Leica Cyclone or TruView",
    ".lgsx": "Leica Cyclone or TruView",
    ".imp": "Leica Cyclone",
    ".b2g": "Leica Cyclone REGISTER 360",
    ".blk": "Leica Cyclone REGISTER 360",
    ".ptg": "Leica Cyclone",
    ".cwprj": "Cintoo",
    ".pod": "Bentley Pointools or Descartes",
    ".cl3": "Topcon ScanMaster",
    ".clr": "Topcon ScanMaster",
    ".bin": "CloudCompare",
    ".pcg": "AutoCAD",
    ".isproj": "Autodesk ReCap",
    ".dwg": "AutoCAD",
}
_ARCHIVES = {
    b"PK\x03\x04": "ZIP",
    b"\x1f\x8b": "gzip",
    b"7z\xbc\xaf\x27\x1c": "7z",
    b"Rar!": "RAR",
    b"BZh": "bzip2",
    b"\xfd7zXZ": "xz",
    b"\x28\xb5\x2f\xfd": "Zstandard",
}
_SIGNATURES = {
    b"CCB": ".bin",
    b"<ReCap": ".rcp",
    b"AC10": ".dwg",
    b"RIEGL": ".rxp",
}
_MESHES = {".obj", ".stl", ".off", ".glb", ".gltf", ".3ds", ".fbx", ".dae", ".ifc", ".step", ".stp"}


def check_not_foreign(path: Path, head: bytes) -> None:
    """Raise `ReadError` with what to do, if a file is known not to be read.

    Parameters
    ----------
    path : Path
    head : bytes
        Its first bytes, which match no format that is read.
    """
    archive = next((kind for mark, kind in _ARCHIVES.items() if head.startswith(mark)), None)
    ending = path.suffix.lower()
    marked = next((e for mark, e in _SIGNATURES.items() if head.startswith(mark)), None)
    program = _PROGRAMS.get(marked or ending)
    if program is not None and (marked or not _may_be_text(head)):
        raise ReadError(
            "“{name}” is in a format that only its own program reads; export it from {program} as "
            "{formats}.",
            name=path.name,
            program=program,
            formats=_EXPORT,
        )
    if archive is not None:
        raise ReadError(
            "“{name}” is packed ({kind}); unpack it and open the scan in it.",
            name=path.name,
            kind=archive,
        )
    if ending in _MESHES or _is_mesh(head):
        raise mesh_error(path)


def mesh_error(path: Path) -> ReadError:
    """Return the error of a mesh, which is no scan."""
    return ReadError(
        "“{name}” is a mesh: its corners are not a scan. Sample points on it first, such as with "
        "open3d: read_triangle_mesh(…).sample_points_uniformly(1000000).",
        name=path.name,
    )


def _may_be_text(head: bytes) -> bool:
    return b"\0" not in head and re.search(rb"(?m)^\s*[-+\d.]+[ ,;\t]+[-+\d.]+", head) is not None


def _is_mesh(head: bytes) -> bool:
    is_off = re.match(rb"\s*(ST)?(C)?(N)?(4)?OFF\s", head)
    is_stl = re.match(rb"\s*solid\b.*?\bfacet\s+normal\b", head, re.DOTALL)
    is_obj = re.search(rb"(?m)^f\s+\d+", head) and re.search(rb"(?m)^v\s+[-+\d.]", head)
    is_obj_head = re.search(rb"(?m)^v\s+[-+\d.]+\s+[-+\d.]+\s+[-+\d.]+", head)
    return bool(is_off or is_stl or is_obj or is_obj_head)
