"""Files with quirks that surveyors bring, written by hand: one sound pipe in each.

Each stands for a kind of public complaint; the names are those of ``shared/cases``, which
holds files of the same kinds.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from numpy.typing import NDArray

from tests.core.io.writers import PCD_HEADER
from tests.ply import write_ply

US_FOOT = 1200 / 3937
START = np.array([10.0, 20.0, 3.0])
RADIUS, LENGTH = 0.05715, 1.5


def pipe(n: int = 2000) -> NDArray[np.float64]:
    """Points of a sound pipe, rounded to 0.1 mm."""
    rng = np.random.default_rng(7)
    axis = np.array([0.9, 0.4, 0.15])
    axis /= np.linalg.norm(axis)
    across = np.linalg.svd(axis[None])[2][1:]
    angle, along = rng.uniform(0, 2 * np.pi, n), rng.uniform(0, LENGTH, n)
    round_it = np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]
    return np.round(START + along[:, None] * axis + RADIUS * round_it, 4)


def las_with(
    path: Path,
    xyz: NDArray[np.float64],
    *,
    point_format: int = 0,
    scales: Any = 1e-4,
    vlrs: tuple[tuple[int, bytes], ...] = (),
    **values: Any,
) -> Path:
    version = "1.4" if point_format >= 6 else "1.2"
    header = laspy.LasHeader(point_format=point_format, version=version)
    header.scales = np.full(3, scales) if np.isscalar(scales) else np.array(scales)
    header.offsets = np.floor(xyz.min(axis=0))
    las = laspy.LasData(header)
    las.xyz = xyz
    for name, value in values.items():
        setattr(las, name, value)
    las.vlrs += [laspy.VLR("LASF_Projection", number, "", data) for number, data in vlrs]
    las.write(path)
    return path


def patched(path: Path, at: int, data: bytes) -> Path:
    raw = bytearray(path.read_bytes())
    raw[at : at + len(data)] = data
    path.write_bytes(raw)
    return path


def keys(*entries: tuple[int, int, int, int]) -> bytes:
    return struct.pack("<4H", 1, 1, 0, len(entries)) + b"".join(
        struct.pack("<4H", *entry) for entry in entries
    )


WKT_FEET = (
    'PROJCS["NAD83 / New York Long Island (ftUS)",GEOGCS["NAD83",DATUM["North_American_Datum_1983",'
    'SPHEROID["GRS 1980",6378137,298.257222101]],PRIMEM["Greenwich",0],UNIT["degree",'
    '0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic_2SP"],UNIT["US survey foot",'
    '0.304800609601219],AXIS["X",EAST],AXIS["Y",NORTH],AUTHORITY["EPSG","2263"]]'
)
WKT_UTM = (
    'PROJCS["NAD83 / UTM zone 10N",GEOGCS["NAD83",DATUM["North_American_Datum_1983",SPHEROID['
    '"GRS 1980",6378137,298.257222101]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],'
    'PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER['
    '"central_meridian",-123],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],'
    'PARAMETER["false_northing",0],UNIT["metre",1],AXIS["Easting",EAST],AXIS["Northing",NORTH]]'
)
WKT_HEIGHT = (
    'VERT_CS["NAVD88 height (ftUS)",VERT_DATUM["North American Vertical Datum 1988",2005],'
    'UNIT["US survey foot",0.304800609601219],AXIS["Gravity-related height",UP]]'
)
WKT_MIXED = f'COMPD_CS["UTM 10N + NAVD88 (ftUS)",{WKT_UTM},{WKT_HEIGHT}]'
WKT_DEGREES = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM['
    '"Greenwich",0],UNIT["degree",0.0174532925199433],AUTHORITY["EPSG","4326"]]'
)
DEGREES = np.array([1.5e-5, 9e-6, 1.0])


def zeroed_table(path: Path, xyz: Any) -> Path:
    las_with(path, xyz)
    raw = path.read_bytes()
    with laspy.open(path) as reader:
        start = reader.header.offset_to_point_data
    (table,) = struct.unpack_from("<q", raw, start)
    return patched(path, table, bytes(len(raw) - table))


def version_4(path: Path, xyz: Any) -> Path:
    las_with(path, xyz, point_format=6)
    raw = path.read_bytes()
    at = raw.index(b"laszip encoded") + 52 + 34
    return patched(path, at + 4, b"\4\0")


def twice_named(path: Path, xyz: Any) -> Path:
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales = np.full(3, 1e-4)
    las = laspy.LasData(header)
    las.add_extra_dims([laspy.ExtraBytesParams(n, "f4") for n in ("Scalar field", "Scalar fielD")])
    las.xyz = xyz
    las.write(path)
    path.write_bytes(path.read_bytes().replace(b"Scalar fielD", b"Scalar field"))
    return path


def latin(path: Path, xyz: Any) -> Path:
    las_with(path, xyz, vlrs=((7, b"x"),))
    raw = path.read_bytes()
    return patched(path, raw.index(b"LASF_Projection"), "Grün".encode("latin-1").ljust(16, b"\0"))


def text(path: Path, rows: Any, form: str, header: str = "") -> Path:
    path.write_text(header + "".join(form.format(*row) + "\n" for row in rows), encoding="utf-8")
    return path


def ptx(path: Path, xyz: Any, columns: str = " 0.5 10 20 30") -> Path:
    rotation = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    local = (xyz - START) @ rotation.T
    head = "100\n25\n10 20 3\n0 1 0\n-1 0 0\n0 0 1\n"
    head += "".join(" ".join(f"{v:g}" for v in row) + " 0\n" for row in rotation) + "10 20 3 1\n"
    lines = [f"{x:.4f} {y:.4f} {z:.4f}{columns}\n" for x, y, z in local]
    lines += ["0 0 0" + columns + "\n"] * (2500 - len(lines))
    path.write_text(head + "".join(lines))
    return path


def padded_pcd(path: Path, xyz: Any) -> Path:
    header = PCD_HEADER.format(n=len(xyz), data="binary", kind="F", station="0 0 0")
    header = header.replace("FIELDS x y z intensity rgb", "FIELDS x y z _ intensity noise _")
    header = header.replace("SIZE 8 8 8 4 4", "SIZE 4 4 4 1 4 2 1").replace(
        "TYPE F F F F F", "TYPE F F F U F U U"
    )
    header = header.replace("COUNT 1 1 1 1 1", "COUNT 1 1 1 4 1 0 15")
    kinds = [("xyz", "<f4", 3), ("a", "u1", 4), ("intensity", "<f4"), ("b", "u1", 15)]
    rows = np.zeros(len(xyz), kinds)
    rows["xyz"], rows["intensity"] = xyz, 7
    path.write_bytes(header.encode() + rows.tobytes())
    return path


def columns_of(xyz: Any, kind: str = "f8", **more: Any) -> NDArray[Any]:
    fields = [(axis, kind) for axis in "xyz"] + [(n, v.dtype, v.shape[1:]) for n, v in more.items()]
    rows = np.zeros(len(xyz), fields)
    for i, axis in enumerate("xyz"):
        rows[axis] = xyz[:, i]
    for name, values in more.items():
        rows[name] = values
    return rows


def faces_first(path: Path, xyz: Any) -> Path:
    faces = np.array([([0, 1, 2],)] * 20, dtype=[("vertex_indices", "i4", (3,))])
    return write_ply(path, {"face": faces, "vertex": columns_of(xyz)})


def listed(path: Path, xyz: Any) -> Path:
    rows = columns_of(xyz, "f4", view=np.zeros((len(xyz), 2), np.int32))
    return write_ply(path, {"vertex": rows})


def many_points(path: Path, xyz: Any) -> Path:
    """More points than `info` once looked at, and a header without an extent."""
    las_with(path, np.tile(xyz, (260, 1)))
    return patched(path, 179, bytes(48))


def header_then_count(path: Path, xyz: Any) -> Path:
    head = f"//X Y Z R G B Intensity\n{len(xyz)}\n"
    return text(path, xyz, "{:.4f} {:.4f} {:.4f} 10 20 30 0.5", head)


def legacy_count(path: Path, xyz: Any) -> Path:
    """LAS 1.4 that counts its points only where older versions do."""
    header = laspy.LasHeader(point_format=3, version="1.4")
    header.scales = np.full(3, 1e-4)
    las = laspy.LasData(header)
    las.xyz = xyz
    las.write(path)
    patched(path, 107, struct.pack("<I", len(xyz)))
    return patched(path, 247, bytes(8))


def nan_word(path: Path, xyz: Any) -> Path:
    text(path, xyz, "{:.4f} {:.4f} {:.4f}")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:900], "-nan(ind) 20.0 3.0\n", *lines[900:]]))
    return path


def class_7(path: Path, xyz: Any) -> Path:
    both = np.vstack([xyz, xyz + np.array([0, 0, 0.5])])
    classes = np.repeat([2, 7], len(xyz)).astype(np.uint8)
    return las_with(path, both, classification=classes)


def withheld(path: Path, xyz: Any, point_format: int = 6) -> Path:
    both = np.vstack([xyz, xyz + np.array([0, 0, 0.5])])
    return las_with(path, both, point_format=point_format, withheld=np.repeat([0, 1], len(xyz)))


def far_points(path: Path, xyz: Any) -> Path:
    n = len(xyz) // 100
    return write_ply(path, {"vertex": columns_of(np.vstack([[[3e10, -2e10, 5e9]] * n, xyz]))})


def plus_zero(path: Path, xyz: Any) -> Path:
    path.write_text("0 0 0\n")
    utm = xyz + np.array(UTM)
    lines = "".join(f"{x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in utm)
    path.write_text("0 0 0\n" + lines)
    return path


def quoted(path: Path, xyz: Any) -> Path:
    lines = (",".join(f'"{v:.4f}"'.replace(".", ",") for v in row) + "\n" for row in xyz)
    path.write_text("".join(lines))
    return path


@dataclass(frozen=True)
class Case:
    """A kind of file.

    `write` makes one of the pipe; `notes` are patterns of what must be said of it, in order.
    """

    name: str
    write: Callable[[Path, NDArray[np.float64]], Path]
    notes: tuple[str, ...] = ()
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tolerance: float = 1e-4
    intensity: float | None = None
    rgb: tuple[int, int, int] | None = None
    crs: str = ""


UTM = (500_000.0, 5_700_000.0, 0.0)
COLOURS = (10, 20, 30)
FEET = "taken as US survey feet"

CASES = (
    Case("base.las", las_with),
    Case(
        "las_scale_1cm.las",
        lambda p, x: las_with(p, x, scales=0.01),
        ("rounded to 10 mm.* 2.9 mm",),
        tolerance=5.1e-3,
    ),
    Case(
        "det_two_decimals.xyz",
        lambda p, x: text(p, x, "{:.2f} {:.2f} {:.2f}"),
        ("rounded to 10 mm.* 2.9 mm",),
        tolerance=5.1e-3,
    ),
    Case(
        "las_usft_wkt.las",
        lambda p, x: las_with(
            p, x / US_FOOT, point_format=6, vlrs=((2112, WKT_FEET.encode() + b"\0"),)
        ),
        (FEET,),
        crs="NAD83 / New York Long Island (ftUS)",
    ),
    Case(
        "las_metre_plan_ftus_height.las",
        lambda p, x: las_with(
            p, x / [1, 1, US_FOOT], point_format=6, vlrs=((2112, WKT_MIXED.encode()),)
        ),
        ("metres in plan and US survey feet in height",),
        crs="UTM 10N + NAVD88 (ftUS)",
    ),
    Case(
        "las_geotiff_citation_unknown.las",
        lambda p, x: las_with(
            p,
            x / US_FOOT,
            vlrs=(
                (
                    34735,
                    keys(
                        (1024, 0, 1, 1), (1026, 34737, 8, 0), (3072, 0, 1, 2903), (3076, 0, 1, 9003)
                    ),
                ),
                (34737, b"unknown|\0"),
            ),
        ),
        (FEET,),
        crs="EPSG:2903",
    ),
    Case("det_class7.las", class_7, ("2,000 of its points, which it classes as noise",)),
    Case("det_withheld_14.las", withheld, ("2,000 of its points, which it marks as withheld",)),
    Case("det_utm_plus_zero.xyz", plus_zero, (": 1 of its points, at 0, 0, 0",), shift=UTM),
    Case(
        "cc_header_then_count.asc",
        header_then_count,
        intensity=0.5,
        rgb=COLOURS,
    ),
    Case("leica.ptx", ptx, ("500 of its directions",), intensity=0.5, rgb=COLOURS),
    Case(
        "faro_row_col.xyz",
        lambda p, x: text(
            p,
            [(i // 50, i % 50, *row) for i, row in enumerate(x)],
            "{} {} {:.4f} {:.4f} {:.4f} 10 20 30",
        ),
        rgb=COLOURS,
    ),
    Case("quoted_decimal_comma_nohead.csv", quoted),
    Case(
        "xyzrgbn.txt",
        lambda p, x: text(p, x, "{:.4f} {:.4f} {:.4f} 10 20 30 0.1 0.2 0.3"),
        rgb=COLOURS,
    ),
    Case("txt_nan_ind.xyz", nan_word, ("1 of its points, whose coordinates are no numbers",)),
    Case("las_eb_dup_names.las", twice_named),
    Case("las_latin1_vlr.las", latin),
    Case("las14_legacy_count_only.las", legacy_count),
    Case("laz_chunktable_zeroed.laz", zeroed_table, ("table of chunks.*in order",)),
    Case("laz14_items_v4.laz", version_4),
    Case("laz_header_box_zero_600k.laz", many_points, ("gives a wrong extent",)),
    Case("ply_vertex_list_bin.ply", listed, tolerance=2e-6),
    Case(
        "ply_int64.ply",
        lambda p, x: write_ply(p, {"vertex": columns_of(x, id=np.arange(len(x)))}),
    ),
    Case("pcd_count0_padding.pcd", padded_pcd, intensity=7, tolerance=2e-6),
    Case("ply_absurd_1percent.ply", far_points, ("20 of its points.*beyond any map",)),
    Case("ply_bin_faces_first.ply", faces_first, ("20 faces",)),
    Case(
        "xyz_rgba.xyz",
        lambda p, x: text(p, x, "{:.4f} {:.4f} {:.4f} 200.0 100.0 50.0 255.0"),
        rgb=(200, 100, 50),
    ),
)
