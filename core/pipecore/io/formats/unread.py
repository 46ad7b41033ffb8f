"""Formats that are not read: what they are, and what to do."""

import re
from pathlib import Path

from pipecore.errors import ReadError

_EXPORT = "E57, LAS, LAZ, PTX or PLY"

_PROGRAMS = {
    ".fls": ("a FARO scan", "FARO SCENE"),
    ".lsproj": ("a project of FARO SCENE", "FARO SCENE"),
    ".fws": ("a workspace of FARO SCENE", "FARO SCENE"),
    ".rcp": ("a ReCap project", "Autodesk ReCap"),
    ".rcs": ("a ReCap scan", "Autodesk ReCap"),
    ".zfs": ("a Z+F scan", "Z+F LaserControl"),
    ".zfprj": ("a project of Z+F LaserControl", "Z+F LaserControl"),
    ".rdbx": ("a RIEGL database", "RIEGL RiSCAN PRO"),
    ".rdb": ("a RIEGL database", "RIEGL RiSCAN PRO"),
    ".rxp": ("a RIEGL scan", "RIEGL RiSCAN PRO"),
    ".3dd": ("a RIEGL scan", "RIEGL RiSCAN PRO"),
    ".tzf": ("a Trimble scan", "Trimble RealWorks"),
    ".rwp": ("a RealWorks project", "Trimble RealWorks"),
    ".rwcx": ("a RealWorks scan", "Trimble RealWorks"),
    ".lgs": ("a LGSx project", "Leica Cyclone or TruView"),
    ".lgsx": ("a LGSx project", "Leica Cyclone or TruView"),
    ".imp": ("a Cyclone database", "Leica Cyclone"),
    ".b2g": ("a BLK2GO scan", "Leica Cyclone REGISTER 360"),
    ".blk": ("a BLK360 scan", "Leica Cyclone REGISTER 360"),
    ".ptg": ("a binary Leica scan", "Leica Cyclone"),
    ".cwprj": ("a project of Cintoo", "Cintoo"),
    ".pod": ("a Bentley point cloud", "Bentley Pointools or Descartes"),
    ".cl3": ("a Topcon scan", "Topcon ScanMaster"),
    ".clr": ("a Topcon scan", "Topcon ScanMaster"),
    ".bin": ("a file of CloudCompare", "CloudCompare"),
    ".pcg": ("a point cloud of AutoCAD", "AutoCAD"),
    ".isproj": ("a project of AutoCAD", "Autodesk ReCap"),
    ".dwg": ("a drawing", "the program that made it"),
    ".dxf": ("a drawing", "the program that made it"),
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
            "“{name}” is {what}, which only its own program reads; export it from {program} as "
            "{formats}.",
            name=path.name,
            what=program[0],
            program=program[1],
            formats=_EXPORT,
        )
    if archive is not None:
        raise ReadError(
            "“{name}” is packed ({kind}); unpack it and open the scan in it.",
            name=path.name,
            kind=archive,
        )
    if ending in _MESHES or _is_mesh(head):
        raise ReadError(
            "“{name}” is a mesh: its corners are not a scan. Sample points on it first, such as "
            "with open3d: read_triangle_mesh(…).sample_points_uniformly(1000000).",
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
