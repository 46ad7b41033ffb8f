"""Points whose truth is known, written in every format without the code under test."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import lazrs
import numpy as np
from numpy.typing import NDArray
from pye57 import libe57

from pipecore.types import PointCloud

FAR = np.array([10_000_000.0, 5_400_000.0, 120.0])


@dataclass(frozen=True)
class Points:
    """World coordinates in metres, whole tenths of a millimetre, and what goes with them."""

    xyz: NDArray[np.float64]
    intensity: NDArray[np.int64]
    rgb: NDArray[np.uint8]

    def hold(self, cloud: PointCloud, tolerance: float = 1e-4) -> bool:
        """Tell whether a cloud is these points, in their order."""
        world = cloud.world(cloud.xyz.astype(np.float64))
        return world.shape == self.xyz.shape and bool(np.abs(world - self.xyz).max() <= tolerance)

    def rows(self) -> list[tuple[Any, ...]]:
        """Return x, y, z, intensity, red, green, blue of each point."""
        return [
            (*p, i, *c)
            for p, i, c in zip(
                self.xyz.tolist(), self.intensity.tolist(), self.rgb.tolist(), strict=True
            )
        ]


def make_points(rng: np.random.Generator, n: int = 1000) -> Points:
    """Return points in a box of 60 m that is 10,000 km from zero."""
    return Points(
        np.round(FAR + rng.uniform(-30, 30, (n, 3)), 4),
        rng.integers(0, 65536, n),
        rng.integers(0, 256, (n, 3), dtype=np.uint8),
    )


def write_las(
    path: Path,
    points: Any,
    *,
    point_format: int = 7,
    colour_factor: int = 257,
    chunk_size: int = 50_000,
) -> Path:
    """Write points by laspy and lazrs alone."""
    header = laspy.LasHeader(point_format=point_format, version="1.4")
    header.scales = np.full(3, 1e-4)
    header.offsets = np.floor(points.xyz.min(axis=0))
    las = laspy.LasData(header)
    las.xyz = points.xyz
    las.intensity = points.intensity
    las.classification = points.intensity % 7
    if point_format in (3, 7):
        las.red, las.green, las.blue = points.rgb.T.astype(np.uint16) * colour_factor
    las.write(path)
    if path.suffix == ".laz" and chunk_size < 50_000:
        rewrite_in_chunks(path, las, chunk_size)
    return path


def rewrite_in_chunks(path: Path, las: Any, chunk_size: int) -> None:
    """Pack points anew, so many a chunk."""
    raw = path.read_bytes()
    with laspy.open(path) as reader:
        header = reader.header
        packing = bytearray(header.vlrs[header.vlrs.index("LasZipVlr")].record_data)
    at = raw.index(bytes(packing))
    packing[12:16] = chunk_size.to_bytes(4, "little")
    with path.open("wb") as file:
        file.write(raw[:at] + packing + raw[at + len(packing) : header.offset_to_point_data])
        packer = lazrs.LasZipCompressor(file, lazrs.LazVlr(bytes(packing)))
        packer.compress_many(np.frombuffer(las.points.array.tobytes(), np.uint8))
        packer.done()


def vertices(
    points: Any, kind: str = "f8", intensity: str = "scalar_Intensity"
) -> NDArray[np.void]:
    fields = [("x", kind), ("y", kind), ("z", kind), (intensity, "f4")]
    fields += [(colour, "u1") for colour in ("red", "green", "blue")]
    return np.array(points.rows(), dtype=fields)


PCD_HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z intensity rgb
SIZE 8 8 8 4 4
TYPE F F F F {kind}
COUNT 1 1 1 1 1
WIDTH {n}
HEIGHT 1
VIEWPOINT {station} 1 0 0 0
POINTS {n}
DATA {data}
"""


def literal_lzf(data: bytes) -> bytes:
    """Pack as literals only: valid LZF of the simplest kind."""
    parts = [data[i : i + 32] for i in range(0, len(data), 32)]
    return b"".join(bytes([len(part) - 1]) + part for part in parts)


def write_pcd(path: Path, points: Any, data: str, kind: str = "F", station: str = "0 0 0") -> Path:
    """Write points as the format's description has it."""
    red, green, blue = points.rgb.astype(np.uint32).T
    packed = red << 16 | green << 8 | blue
    fields = [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("i", "<f4"), ("rgb", "<u4")]
    records = np.empty(len(packed), dtype=fields)
    for axis, name in enumerate("xyz"):
        records[name] = points.xyz[:, axis]
    records["i"], records["rgb"] = points.intensity, packed
    header = PCD_HEADER.format(n=len(packed), data=data, kind=kind, station=station).encode()
    if data == "binary":
        body = records.tobytes()
    elif data == "binary_compressed":
        plain = b"".join(records[name].tobytes() for name, _ in fields)
        stream = literal_lzf(plain)
        body = np.array([len(stream), len(plain)], dtype="<u4").tobytes() + stream
    else:
        colours = packed.view(np.float32) if kind == "F" else packed
        lines = (
            f"{x:.4f} {y:.4f} {z:.4f} {i} {c!s}"
            for (x, y, z), i, c in zip(points.xyz, points.intensity, colours.tolist(), strict=True)
        )
        body = "\n".join(lines).encode()
    path.write_bytes(header + body)
    return path


CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")


def write_e57(path: Path, scans: list[dict[str, Any]], crs: str = "") -> Path:
    """Write scans by libE57 alone; columns as double, scaled integer or integer nodes.

    A scan has `columns` (name to values), and may have `nodes` (name to a function that
    makes its node), `rotation` (w, x, y, z), `translation` and `limits`.
    """
    image = libe57.ImageFile(str(path), "w")
    image.extensionsAdd("", libe57.E57_V1_0_URI)
    root = image.root()
    root.set("formatName", libe57.StringNode(image, "ASTM E57 3D Imaging Data File"))
    root.set("guid", libe57.StringNode(image, "{file}"))
    root.set("versionMajor", libe57.IntegerNode(image, 1))
    root.set("versionMinor", libe57.IntegerNode(image, 0))
    root.set("coordinateMetadata", libe57.StringNode(image, crs))
    data = libe57.VectorNode(image, True)
    root.set("data3D", data)
    for scan in scans:
        write_scan(image, data, **scan)
    image.close()
    return path


def write_scan(
    image: Any,
    data: Any,
    *,
    columns: dict[str, Any],
    nodes: dict[str, Any] | None = None,
    rotation: Any = None,
    translation: Any = None,
    limits: dict[str, float] | None = None,
) -> None:
    def floats(values: dict[str, float]) -> Any:
        node = libe57.StructureNode(image)
        for name, value in values.items():
            node.set(name, libe57.FloatNode(image, float(value)))
        return node

    scan = libe57.StructureNode(image)
    scan.set("guid", libe57.StringNode(image, "{scan}"))
    if rotation is not None or translation is not None:
        pose = libe57.StructureNode(image)
        scan.set("pose", pose)
        if rotation is not None:
            # In an order that is not w, x, y, z: names count, not places.
            pose.set("rotation", floats(dict(zip("xyzw", np.roll(rotation, -1), strict=True))))
        if translation is not None:
            pose.set("translation", floats(dict(zip("xyz", translation, strict=True))))
    if limits:
        scan.set("colorLimits", floats(limits))
    data.append(scan)
    prototype = libe57.StructureNode(image)
    buffers = libe57.VectorSourceDestBuffer()
    n = len(next(iter(columns.values())))
    kept = []
    for name, values in columns.items():
        make = (nodes or {}).get(name, libe57.FloatNode)
        prototype.set(name, make(image))
        kept.append(np.ascontiguousarray(values, dtype=np.float64))
        buffers.append(libe57.SourceDestBuffer(image, name, kept[-1], n, True, True))
    points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
    scan.set("points", points)
    writer = points.writer(buffers)
    writer.write(n)
    writer.close()


def cartesian(xyz: Any) -> dict[str, Any]:
    return dict(zip(CARTESIAN, np.asarray(xyz, dtype=float).T, strict=True))


def integers(low: int, high: int) -> Any:
    return lambda image: libe57.IntegerNode(image, low, low, high)


def lines(points: Any, form: str) -> str:
    return "".join(form.format(*row) + "\n" for row in points.rows())


FORMS = {
    "plain.xyz": ("", "{0:.4f} {1:.4f} {2:.4f} {3} {4} {5} {6}"),
    "wide.asc": ("", "  {0:.4f}\t {1:.4f}   {2:.4f} {3} {4} {5} {6}  "),
    "count.pts": ("1000\n", "{0:.4f} {1:.4f} {2:.4f} {3} {4} {5} {6}"),
    "excel.csv": ("X;Y;Z;Intensity;R;G;B\n", "{0:.4f};{1:.4f};{2:.4f};{3};{4};{5};{6}"),
    "english.csv": (
        "red,green,blue,reflectance,h,n,e\n",
        "{4},{5},{6},{3},{2:.4f},{1:.4f},{0:.4f}",
    ),
    "cc.txt": ("//X Y Z R G B Scalar_Intensity\n", "{0:.4f} {1:.4f} {2:.4f} {4} {5} {6} {3}"),
    "cc_bare.txt": ("", "{0:.4f} {1:.4f} {2:.4f} {4} {5} {6} {3}"),
    "units.csv": (
        '"Easting [m]","Northing [m]","Height [m]","i","r","g","b"\n',
        "{0:.4f}, {1:.4f}, {2:.4f}, {3}, {4}, {5}, {6}",
    ),
    "named.csv": (
        "name,x,y,z,intensity,r,g,b,note\n",
        "P{3},{0:.4f},{1:.4f},{2:.4f},{3},{4},{5},{6},wall",
    ),
    "remark.txt": ("# a remark\n\n# more\n", "{0:.4f} {1:.4f} {2:.4f} {3} {4} {5} {6}"),
    "spoken.txt": (
        "# a remark on x y z\n",
        "{0:.4f} {1:.4f} {2:.4f} {3} {4} {5} {6}",
    ),
    "trailing.csv": ("", "{0:.4f},{1:.4f},{2:.4f},{3},{4},{5},{6},"),
}
