"""Whatever is done to a file, reading it gives a cloud or one clear error."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipecore import io
from pipecore.errors import ReadError
from pipecore.types import Field
from tests.core.io.writers import (
    FORMS,
    Points,
    cartesian,
    integers,
    lines,
    make_points,
    vertices,
    write_e57,
    write_las,
    write_pcd,
)
from tests.ply import write_ply as write_elements

ROUNDS = int(os.environ.get("PIPEGUI_FUZZ_ROUNDS", "40"))


def write_ply(path: Path, points: Points, text: bool, byte_order: str = "<") -> Path:
    return write_elements(path, {"vertex": vertices(points)}, text=text, byte_order=byte_order)


def write_scan(path: Path, points: Points) -> Path:
    columns = cartesian(points.xyz) | {
        "intensity": points.intensity,
        "cartesianInvalidState": points.intensity % 2,
    }
    nodes = {"cartesianInvalidState": integers(0, 2)}
    scan = {"columns": columns, "nodes": nodes, "translation": (1, 2, 3)}
    return write_e57(path, [scan, scan])


def write_text(path: Path, points: Points, kind: str) -> Path:
    header, form = FORMS[kind]
    path.write_text(header.replace("1000", str(len(points.xyz))) + lines(points, form))
    return path


def write_whole(path: Path, points: Points) -> Path:
    """A file as this program writes it, with fields and stations."""
    cloud = io.read(write_scan(path.with_name("from.e57"), points))
    fields = {"width of echo": Field(np.arange(len(cloud)) % 9, 0.5, 1.0, 3.0, "said")}
    io.write(replace(cloud, fields=fields), path)
    return path


KINDS: dict[str, Callable[[Path, Points], Path]] = {
    "scan.las": write_las,
    "scan.laz": write_las,
    "grey.laz": lambda path, points: write_las(path, points, point_format=6),
    "old.laz": lambda path, points: write_las(path, points, point_format=3),
    "ascii.ply": lambda path, points: write_ply(path, points, text=True),
    "little.ply": lambda path, points: write_ply(path, points, False, "<"),
    "big.ply": lambda path, points: write_ply(path, points, False, ">"),
    "ascii.pcd": lambda path, points: write_pcd(path, points, "ascii"),
    "binary.pcd": lambda path, points: write_pcd(path, points, "binary"),
    "packed.pcd": lambda path, points: write_pcd(path, points, "binary_compressed"),
    "scan.e57": write_scan,
    "written.las": write_whole,
    "written.laz": write_whole,
    "written.ply": write_whole,
    "written.e57": write_whole,
    "scan.pts": lambda path, points: write_text(path, points, "count.pts"),
    "scan.csv": lambda path, points: write_text(path, points, "excel.csv"),
    "scan.xyz": lambda path, points: write_text(path, points, "plain.xyz"),
}


def damage(raw: bytes, rng: np.random.Generator) -> bytes:
    """Cut a file short, or flip some of its bytes, mostly near its beginning."""
    if rng.random() < 0.25:
        return raw[: rng.integers(0, len(raw))]
    data = np.frombuffer(raw, dtype=np.uint8).copy()
    reach = len(data) if rng.random() < 0.4 else min(len(data), 600)
    places = rng.integers(0, reach, rng.integers(1, 9))
    data[places] = rng.choice([0, 0x7F, 0xFF, *rng.integers(0, 256, 9)], len(places))
    return data.tobytes()


def damage_e57(raw: bytes, rng: np.random.Generator) -> bytes:
    """Damage the contents and make the checksums right again, page by page."""
    data = bytearray(damage(raw, rng))
    for start in range(0, len(data) - 1023, 1024):
        data[start + 1020 : start + 1024] = crc32c(data[start : start + 1020]).to_bytes(4, "big")
    return bytes(data)


_CRC_TABLE = []
for _value in range(256):
    for _ in range(8):
        _value = _value >> 1 ^ (0x82F63B78 if _value & 1 else 0)
    _CRC_TABLE.append(_value)


def crc32c(data: bytes) -> int:
    crc = 0xFFFFFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC_TABLE[(crc ^ byte) & 255]
    return crc ^ 0xFFFFFFFF


@pytest.mark.parametrize("name", KINDS)
def test_that_a_damaged_file_is_a_cloud_or_a_clear_error(
    tmp_path: Path, rng: np.random.Generator, seed: int, name: str
) -> None:
    print("seed", seed)
    path = tmp_path / name
    whole = KINDS[name](path, make_points(rng, 60)).read_bytes()
    assert len(io.read(path)) > 0
    messages = []
    for k in range(ROUNDS):
        change = damage_e57 if name.endswith(".e57") and rng.random() < 0.7 else damage
        path.write_bytes(change(whole, rng))
        try:
            cloud = io.read(path, has_fields=k % 2 == 1)
        except ReadError as error:
            messages.append(str(error))
        else:
            assert len(cloud) > 0
            assert np.isfinite(cloud.xyz).all()
    # Of LAS nearly anything can be read.
    assert messages or name.endswith(".las")
    for message in messages:
        assert name in message
        assert message.endswith(".")
        assert "\n" not in message
