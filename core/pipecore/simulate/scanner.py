"""Scanning a scene: rays from the stations, with the errors that scanners make."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.errors import MissingPackageError, SceneError
from pipecore.geometry import Array
from pipecore.progress import NoProgress, Progress, in_chunks
from pipecore.simulate.clutter import clutter_parts
from pipecore.simulate.materials import MATERIALS
from pipecore.simulate.parts import Part, pipe_parts
from pipecore.simulate.placing import Placement, place_runs
from pipecore.simulate.scene import Scanner, Scene
from pipecore.simulate.seen import with_coverage
from pipecore.simulate.truth import Truth
from pipecore.types import NO_ID, PointCloud

CHUNK = 100_000
"""Rays between two reports of progress. Part of what a seed means: it orders the random numbers."""
FULL_INTENSITY = 4095.0
LAMPS = np.array([[0.35, -0.5, 0.79], [-0.6, 0.45, 0.66]])
LAMP_POWER = np.array([0.42, 0.22])
AMBIENT = 0.45


@dataclass(frozen=True, eq=False)
class SimulatedScan:
    """A simulated scan with what is true about it.

    Parameters
    ----------
    cloud : PointCloud
    truth_element : ndarray of int32, shape (n,)
        The element on whose lateral surface the point lies; `NO_ID` for clutter, faces of
        flanges, ends and mixed pixels.
    station : ndarray of uint8, shape (n,)
        Index of the station that measured the point.
    truth : Truth
    """

    cloud: PointCloud
    truth_element: NDArray[np.int32]
    station: NDArray[np.uint8]
    truth: Truth

    def write_truth(self, path: Path) -> None:
        """Write the truth as JSON; see `pipecore.simulate.load_truth`.

        Parameters
        ----------
        path : Path
        """
        self.truth.save(path)


@dataclass(frozen=True, eq=False)
class _Points:
    xyz: NDArray[np.float32]
    part: NDArray[np.int32]
    is_mixed: NDArray[np.bool_]
    intensity: NDArray[np.float32]
    rgb: NDArray[np.uint8]


def scan(scene: Scene, *, progress: Progress | None = None) -> SimulatedScan:
    """Scan `scene` from all its stations. The same scene gives the same scan.

    Parameters
    ----------
    scene : Scene
    progress : Progress, optional
        May cancel.

    Returns
    -------
    SimulatedScan
        The cloud, with the element and the station of each point, and the truth.

    Raises
    ------
    SceneError
        If the scene cannot be built, or nothing in it is seen.
    CancelledError
        From `progress`.
    """
    progress = progress or NoProgress()
    placement = place_runs(scene)
    world = World(pipe_parts(placement) + clutter_parts(scene.clutter))
    if not scene.stations:
        raise SceneError("The scene has no station to scan from.")
    views: list[_Points] = []
    for i, position in enumerate(np.array(scene.stations, dtype=np.float64)):
        station = _Station(world, position, scene.scanner, np.random.default_rng([scene.seed, i]))
        step = angular_step(placement, position, scene.scanner.spacing)
        points = station.scan(step, f"station {i + 1}", progress)
        views.append(_registered(points, station))
    points = _joined(views)
    if len(points.xyz) == 0:
        raise SceneError("Nothing in the scene is seen from its stations.")
    element = np.where(points.is_mixed, NO_ID, world.element_id[points.part]).astype(np.int32)
    origin = np.array(scene.origin, dtype=np.float64)
    cloud = PointCloud(
        origin,
        points.xyz,
        points.intensity,
        points.rgb,
        stations=np.array(scene.stations, dtype=np.float64),
        crs=scene.crs,
    )
    truth = Truth(
        origin,
        tuple(p.element for p in placement.elements),
        placement.deformations(),
    )
    station_index = np.repeat(np.arange(len(views)), [len(v.xyz) for v in views])
    return SimulatedScan(
        cloud,
        element,
        station_index.astype(np.uint8),
        with_coverage(truth, points.xyz, element, scene.scanner.spacing),
    )


class World:
    """All parts of a scene, ready for rays."""

    def __init__(self, parts: list[Part]) -> None:
        try:
            import open3d as o3d  # noqa: PLC0415  (takes seconds; only simulations pay)
        except ModuleNotFoundError as error:
            raise MissingPackageError(
                "Simulating scans needs the package open3d: pip install 'pipegui-core[open3d]'."
            ) from error

        tensor: Any = o3d.core.Tensor
        self._tensor = tensor
        self._casting = o3d.t.geometry.RaycastingScene()
        for part in parts:
            self._casting.add_triangles(
                tensor(part.mesh.vertices.astype(np.float32)),
                tensor(part.mesh.triangles),
            )
        vertices = np.concatenate([p.mesh.vertices for p in parts])
        self._middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        self._reach = float(np.linalg.norm(vertices - self._middle, axis=1).max())
        materials = [MATERIALS[p.material] for p in parts]
        self.element_id = np.array([p.element_id for p in parts], dtype=np.int32)
        self.rgb = np.array([m.rgb for m in materials]) / 255.0
        self.reflectance = np.array([m.reflectance for m in materials])
        self.mottle = np.array([m.mottle for m in materials])

    def window(self, position: Array) -> tuple[Array, Array]:
        """Lowest and highest elevation, and azimuth, of anything as seen from `position`."""
        to_middle = self._middle - position
        distance = float(np.linalg.norm(to_middle))
        everything = np.array([-np.pi / 2, np.pi / 2]), np.array([-np.pi, np.pi])
        if distance <= 1.01 * self._reach:
            return everything
        half = np.arcsin(1.01 * self._reach / distance)
        elevations = np.arcsin(to_middle[2] / distance) + half * np.array([-1.0, 1.0])
        if np.abs(elevations).max() >= np.pi / 2:
            return np.clip(elevations, *everything[0]), everything[1]
        aside = np.arcsin(min(1.0, np.sin(half) / np.cos(elevations.mean())))
        return elevations, np.arctan2(to_middle[1], to_middle[0]) + aside * np.array([-1.0, 1.0])

    def cast(self, origins: Array, directions: Array) -> tuple[Array, NDArray[np.int32], Array]:
        """Range (inf for none), part and unit normal of what each ray hits first."""
        rays = np.empty((len(directions), 6), dtype=np.float32)
        rays[:, :3], rays[:, 3:] = origins, directions
        hits: dict[str, Any] = self._casting.cast_rays(self._tensor(rays))
        distance = hits["t_hit"].numpy().astype(np.float64)
        part = np.where(np.isfinite(distance), hits["geometry_ids"].numpy(), 0).astype(np.int32)
        return distance, part, hits["primitive_normals"].numpy().astype(np.float64)

    def openness(
        self, points: Array, normals: Array, n_rays: int, rng: np.random.Generator
    ) -> Array:
        """Share of `n_rays` random rays per point that meet nothing within half a metre."""
        n_free = np.zeros(len(points))
        for _ in range(n_rays):
            # A normal plus a unit vector is spread as light on a matt surface is.
            direction = normals + _unit_rows(rng.standard_normal(points.shape))
            distance, _, _ = self.cast(points + 1e-3 * normals, _unit_rows(direction))
            n_free += np.minimum(distance / 0.5, 1.0)
        return n_free / n_rays


def angular_step(placement: Placement, station: Array, spacing: float) -> float:
    """Angle between rays that gives `spacing` at the median distance of the pipes' axes."""
    if not placement.elements:
        return spacing / 5.0
    axes = [p.element.axis for p in placement.elements]
    weights = np.array([a.length for a in axes])
    distances = np.array([np.linalg.norm(a.at(a.length / 2) - station) for a in axes])
    order = np.argsort(distances)
    middle = np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2)
    return float(spacing / distances[order][middle])


def _unit_rows(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


@dataclass(frozen=True, eq=False)
class _Station:
    """A scanner at its place in the world."""

    world: World
    position: Array
    scanner: Scanner
    rng: np.random.Generator

    def scan(self, step: float, stage: str, progress: Progress) -> _Points:
        """Measure along a whole grid of rays `step` apart, chunk by chunk."""
        elevations, first_azimuth, counts = self._rows(step)
        row_start = np.concatenate([[0], np.cumsum(counts)])
        chunks = []
        for start, stop in in_chunks(int(row_start[-1]), CHUNK, stage, progress):
            rays = np.arange(start, stop)
            row = np.searchsorted(row_start, rays, side="right") - 1
            along = (rays - row_start[row]) * step / np.cos(elevations[row])
            chunks.append(self.measure(_directions(elevations[row], first_azimuth[row] + along)))
        return _joined(chunks)

    def _rows(self, step: float) -> tuple[Array, Array, NDArray[np.int64]]:
        """Elevation, first azimuth and number of rays of each row of the grid.

        Rows have fewer rays towards the zenith, so that all are as dense.
        """
        elevation_range, azimuth_range = self.world.window(self.position)
        lowest = max(elevation_range[0], np.deg2rad(self.scanner.lowest_elevation_deg))
        elevations = np.arange(lowest, elevation_range[1], step)
        width = float(np.ptp(azimuth_range))
        counts = np.floor(width * np.cos(elevations) / step).astype(np.int64)
        first = azimuth_range[0] + self.rng.uniform(0.0, 1.0, len(elevations)) * step
        return elevations, first, counts

    def measure(self, reported: Array) -> _Points:
        """Measure along the given directions; rays without a return are left out."""
        pointing = np.deg2rad(self.scanner.pointing_deg)
        true = _unit_rows(reported + pointing * self.rng.standard_normal(reported.shape))
        distance, part, normal = self.world.cast(self.position, true)
        cosine = np.einsum("ij,ij->i", true, normal)
        chance = _return_probability(distance, np.abs(cosine), self.scanner)
        keep = self.rng.uniform(size=len(distance)) < chance
        reported, true, distance, part = reported[keep], true[keep], distance[keep], part[keep]
        # Normals look at the scanner, whichever way the facet is turned.
        normal = -np.sign(cosine[keep])[:, None] * normal[keep]
        cosine = np.abs(cosine[keep])

        shift, is_mixed = self._mixing(true, distance, part)
        measured = distance + shift + self._range_noise(distance, cosine)
        return _Points(
            (self.position + measured[:, None] * reported).astype(np.float32),
            part,
            is_mixed,
            self._intensities(distance, cosine, part),
            self._colours(self.position + distance[:, None] * true, normal, part),
        )

    def _range_noise(self, distance: Array, cosine: Array) -> Array:
        s = self.scanner
        growth = 1 + s.noise_growth * distance
        growth *= 1 + s.incidence_growth * (1 / np.maximum(cosine, 0.1) - 1)
        return np.asarray(s.noise * growth * self.rng.standard_normal(len(distance)))

    def _mixing(
        self, direction: Array, distance: Array, part: NDArray[np.int32]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """How far a second surface in the beam pulls each range, and which points it spoils."""
        s = self.scanner
        shift = np.zeros(len(distance))
        if s.beam_diameter <= 0:
            return shift, np.zeros(len(distance), dtype=np.bool_)
        # One more ray anywhere in the footprint meets the other side of an edge as often
        # as that side takes its share of the footprint.
        across = self.rng.standard_normal(direction.shape)
        across -= np.einsum("ij,ij->i", across, direction)[:, None] * direction
        footprint = (s.beam_diameter + s.beam_divergence * distance) / 2
        offset = footprint * np.sqrt(self.rng.uniform(size=len(distance)))
        aside = direction + (offset / distance)[:, None] * _unit_rows(across)
        other, other_part, _ = self.world.cast(self.position, _unit_rows(aside))
        step = np.where(np.isfinite(other), other - distance, np.inf)
        is_edge = (np.abs(step) < s.pulse_length) & (np.abs(step) > 0.002)
        is_edge &= (other_part != part) | (np.abs(step) > 0.05)
        shift[is_edge] = self.rng.uniform(size=int(is_edge.sum())) * step[is_edge]
        return shift, np.abs(shift) > max(s.noise, 0.001)

    def _intensities(
        self, distance: Array, cosine: Array, part: NDArray[np.int32]
    ) -> NDArray[np.float32]:
        value = self.world.reflectance[part] * np.sqrt(cosine) / (1 + (distance / 12.0) ** 2)
        value *= 1 + self.world.mottle[part] * self.rng.standard_normal(len(distance))
        return (FULL_INTENSITY * np.clip(value, 0.0, 1.0)).round().astype(np.float32)

    def _colours(self, points: Array, normal: Array, part: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Colours as a camera on the scanner would see them under two lamps."""
        ambient = np.full(len(points), AMBIENT)
        if self.scanner.ambient_rays:
            openness = self.world.openness(points, normal, self.scanner.ambient_rays, self.rng)
            ambient *= 0.35 + 0.9 * openness
        light = ambient + np.maximum(normal @ _unit_rows(LAMPS).T, 0.0) @ LAMP_POWER
        light *= 1 + self.world.mottle[part] * self.rng.standard_normal(len(points))
        rgb = 255 * np.clip(self.world.rgb[part] * light[:, None], 0.0, 1.0)
        return np.asarray(rgb.round().astype(np.uint8))


def _directions(elevation: Array, azimuth: Array) -> Array:
    return np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ],
        axis=1,
    )


def _return_probability(distance: Array, cosine: Array, scanner: Scanner) -> Array:
    # Nothing comes back beyond 87 degrees of incidence; nothing is lost for it below 80.
    grazing = np.clip((cosine - 0.05) / (0.17 - 0.05), 0.0, 1.0)
    far = np.clip((scanner.max_range - distance) / (0.3 * scanner.max_range), 0.0, 1.0)
    return np.asarray((1 - scanner.dropout) * grazing * far)


def _registered(points: _Points, station: _Station) -> _Points:
    """Move a station's points by its registration error."""
    error, rng = station.scanner.registration, station.rng
    if error <= 0:
        return points
    rotation = error / 10.0 * rng.standard_normal(3)
    offset = points.xyz - station.position
    moved = points.xyz + np.cross(rotation, offset) + error * rng.standard_normal(3)
    return replace(points, xyz=moved.astype(np.float32))


def _joined(chunks: list[_Points]) -> _Points:
    return _Points(
        np.concatenate([c.xyz for c in chunks]),
        np.concatenate([c.part for c in chunks]),
        np.concatenate([c.is_mixed for c in chunks]),
        np.concatenate([c.intensity for c in chunks]),
        np.concatenate([c.rgb for c in chunks]),
    )
