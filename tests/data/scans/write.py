"""Writes the files beside it with libraries that PipeGUI does not use; see the README."""

from pathlib import Path

import copclib
import laspy
import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import LineAxis
from tests.core.io.copc import Tree, grow
from tests.core.shapes import plane, tube

HERE = Path(__file__).parent
SEED = 7
PLACE = np.array([691_204.0, 5_334_817.0, 512.0])
CRS = 'PROJCS["ETRS89 / UTM zone 32N",GEOGCS["ETRS89"]]'
POINTS_IN_NODE = 400
CHUNKS = 2000, 1, 777, 3500
"""Sizes of the first chunks of the file whose chunks are uneven."""


def make_points(point_format: int, version: str) -> laspy.LasData:
    """A pipe of 60 mm over a floor, coordinates in tenths of a millimetre."""
    rng = np.random.default_rng(SEED)
    axis = LineAxis(np.array([0.1, 0.2, 0.4]), np.array([0.8, 0.6, 0.0]), 0.9)
    pipe, _ = tube(rng, axis, 0.06, spacing=0.009, noise=0.001)
    floor, _ = plane(rng, np.zeros(3), [1, 0, 0], [0, 0.9, 0], 0.018, 0.001)
    xyz = np.concatenate([pipe, floor])
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = np.full(3, 1e-4), PLACE
    las = laspy.LasData(header)
    las.x, las.y, las.z = (xyz + PLACE).T
    las.intensity = 1000 + np.arange(len(xyz)) % 50
    las.classification = np.repeat([6, 2], [len(pipe), len(floor)])
    las.red = las.green = las.blue = 257 * np.asarray(las.classification, np.uint16)
    las.return_number = las.number_of_returns = np.ones(len(xyz), np.uint8)
    return las


def packed(points: laspy.LasData, rows: NDArray[np.intp]) -> copclib.VectorChar:
    """Points as copclib takes them."""
    return copclib.VectorChar(np.frombuffer(points.points.array[rows].tobytes(), np.int8))


def page_of(key: tuple[int, ...]) -> tuple[int, ...]:
    """The page that tells of a node: that of the root, or of the branch from level 2 on."""
    steps = key[0] - 2
    return (2, *(c >> steps for c in key[1:])) if steps >= 0 else (0, 0, 0, 0)


def vector(values: NDArray[np.float64]) -> copclib.Vector3:
    return copclib.Vector3(*values.tolist())


def write_copc(path: Path, las: laspy.LasData) -> None:
    """Write COPC by copclib."""
    tree: Tree = grow(np.asarray(las.xyz), POINTS_IN_NODE, np.random.default_rng(SEED))
    config = copclib.CopcConfigWriter(
        las.point_format.id, vector(las.header.scales), vector(las.header.offsets), CRS
    )
    config.las_header.min, config.las_header.max = (vector(f(las.xyz, 0)) for f in (np.min, np.max))
    info = config.copc_info
    info.center_x, info.center_y, info.center_z = tree.centre.tolist()
    info.halfsize, info.spacing = tree.half, tree.half / 64
    writer = copclib.FileWriter(str(path), config)
    for key in sorted(tree.rows):
        writer.AddNode(
            copclib.VoxelKey(*key),
            packed(las, tree.rows[key]),
            copclib.VoxelKey(*page_of(key)),
        )
    writer.Close()


def write_uneven(path: Path, las: laspy.LasData) -> None:
    """Write LAZ with chunks of different sizes by copclib."""
    config = copclib.LazConfigWriter(
        las.point_format.id, vector(las.header.scales), vector(las.header.offsets), CRS
    )
    config.las_header.min, config.las_header.max = (vector(f(las.xyz, 0)) for f in (np.min, np.max))
    writer = copclib.LazWriter(str(path), config)
    for rows in np.split(np.arange(len(las.points)), np.cumsum(CHUNKS)):
        writer.WritePoints(copclib.Points.Unpack(packed(las, rows), config.las_header))
    writer.Close()


if __name__ == "__main__":
    points = make_points(7, "1.4")
    write_copc(HERE / "copclib.copc.laz", points)
    write_uneven(HERE / "uneven.laz", points)
    make_points(3, "1.2").write(HERE / "laszip.laz", laz_backend=laspy.LazBackend.Laszip)
