"""Elements of single pipes against spacing, noise, radius, arc and incidence."""

from dataclasses import dataclass, replace
from typing import Any

import cylinder_fitting
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from scipy.optimize import least_squares

from pipecore import detect
from pipecore.ellipses import radius_sd_factor
from pipecore.simulate import Scene, SimulatedScan, random_pipe, scan
from pipecore.simulate.scoring import score
from pipecore.types import ElementKind
from tools.study.store import measured, put_image, table

LENGTH, DISTANCE = 2.0, 4.0
N_PEER_POINTS = 300
"""Points given to the package cylinder-fitting, which takes seconds for a thousand."""
FIRST_SEED = 1000


@dataclass(frozen=True)
class Case:
    """A pipe as it is scanned: metres and degrees."""

    spacing: float = 0.01
    noise: float = 0.002
    radius: float = 0.08415
    arc: float = 140.0
    incidence: float = 0.0

    def scene(self, seed: int) -> Scene:
        scene = random_pipe(
            seed,
            kind=None,
            arc_deg=self.arc,
            radius=self.radius,
            length=LENGTH,
            spacing=self.spacing,
            noise=self.noise,
        )
        return _seen_obliquely(scene, self.incidence) if self.incidence else scene


@dataclass(frozen=True)
class Sweep:
    """One property of the base case after another is varied."""

    field: str
    values: tuple[float, ...]
    label: str
    factor: float = 1.0
    """From the field to the unit of the label."""
    is_log: bool = False


SWEEPS = (
    Sweep("spacing", (0.005, 0.01, 0.02, 0.05), "spacing, mm", 1e3, True),
    Sweep("noise", (0.0005, 0.001, 0.002, 0.003, 0.005), "noise, mm", 1e3, True),
    Sweep("radius", (0.02415, 0.04445, 0.08415, 0.1365, 0.2032), "radius, mm", 1e3, True),
    Sweep("arc", (90.0, 120.0, 140.0, 180.0, 240.0, 360.0), "arc, °"),
    Sweep("incidence", (0.0, 30.0, 45.0, 60.0), "incidence along the pipe, °"),
)


def write(quick: bool) -> str:
    """Measure and return the section's text."""
    n = 2 if quick else 8
    figure = Figure(figsize=(12, 6.4), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    tables = []
    for sweep, panel in zip(SWEEPS, axes, strict=False):
        cases = [replace(Case(), **{sweep.field: v}) for v in sweep.values]
        rows = [[_pipe(case, FIRST_SEED + i) for i in range(n)] for case in cases]
        _plot(panel, sweep, cases, rows)
        lines = [
            _line(sweep, v, case, row)
            for v, case, row in zip(sweep.values, cases, rows, strict=True)
        ]
        head = [sweep.label, "found", "radius: RMS error, mm", "mean error", "plain fit",
                "cylinder-fitting", "worst", "reported SD", "bound", "axis error, mm"]  # fmt: skip
        tables.append(table(head, lines))
    handles, labels = axes[0].get_legend_handles_labels()
    axes[-1].axis("off")
    axes[-1].legend(handles, labels, loc="center")
    image = put_image("pipes", figure, "Error of the detected pipe's radius and axis")
    return f"""
One straight pipe, {LENGTH:g} m long, in a random direction, {n} pipes a line (seeds
{FIRST_SEED} to {FIRST_SEED + n - 1}), found by `pipecore.detect` with its default settings. If
not varied: spacing 10 mm, noise 2 mm along the beam at every range, r = 84.15 mm, 140° of arc
seen by one station at {DISTANCE:g} m.
The bound is that of a circle fitted to all n points of the element, k·σ/√n, as if the noise
were the same across the whole surface; since it lies along the beam, points that are seen
obliquely err less across the surface, so a result may lie below. “Plain fit” is the mean
error of an orthogonal least-squares cylinder through just the pipe's own points, known from the
truth: what of a mean error it shares is not the detection's, but comes from orthogonal distances
meeting noise that lies along the beam. It grows with σ²/r, and
is larger than the spread where points are many and seen from one side.
“cylinder-fitting” is the RMS error of that package, given {N_PEER_POINTS} of the pipe's own
points, no others, and the true direction to start from.

{image}

""" + "\n\n".join(tables)


def _pipe(case: Case, seed: int) -> dict[str, Any]:
    key = f"{case.spacing:g}-{case.noise:g}-{case.radius:g}-{case.arc:g}-{case.incidence:g}"
    return measured(f"single-{key}-{seed}", lambda: _measure(case, seed))


def _measure(case: Case, seed: int) -> dict[str, Any]:
    scanned = scan(case.scene(seed))
    result = detect(scanned.cloud)
    s = score(result, scanned.truth)
    n_points = [e.n_points for e in result.elements if e.kind is ElementKind.CYLINDER]
    is_found = bool(s.radius_errors) and s.recall > 0.5
    return {
        "is_found": is_found,
        "radius_error": next(iter(s.radius_errors.values())) if is_found else None,
        "radius_sd": next(iter(s.radius_sds.values())) if is_found else None,
        "axis_error": s.median_axis_error if is_found else None,
        "plain_error": _plain_fit(scanned, case.radius) - case.radius,
        "peer_error": _peer_fit(scanned, seed) - case.radius,
        "n_points": max(n_points, default=0),
    }


def _own_points(scanned: SimulatedScan) -> np.ndarray:
    """The pipe's own points, known from the truth."""
    return scanned.cloud.xyz[scanned.truth_element == 1].astype(np.float64)


def _peer_fit(scanned: SimulatedScan, seed: int) -> float:
    """Radius by the package cylinder-fitting, which fits squared distances (Eberly)."""
    points = np.random.default_rng(seed).permutation(_own_points(scanned))[:N_PEER_POINTS]
    x, y, z = scanned.truth.elements[0].axis.tangent(0.0)
    start = (float(np.arccos(z)), float(np.arctan2(y, x)))
    return float(cylinder_fitting.fit(list(points), [start])[2])


def _plain_fit(scanned: SimulatedScan, radius: float) -> float:
    """Radius of the orthogonal least-squares cylinder of just the pipe's own points."""
    points = _own_points(scanned)
    axis = scanned.truth.elements[0].axis
    up, right = axis.frame(0.0)
    x, y, z = np.array([up, right, axis.tangent(0.0)]) @ (points - axis.at(LENGTH / 2)).T

    def distances(p: np.ndarray) -> np.ndarray:
        return np.hypot(x - p[0] - p[1] * z, y - p[2] - p[3] * z) - p[4]

    return float(least_squares(distances, [0.0, 0.0, 0.0, 0.0, radius]).x[4])


def _seen_obliquely(scene: Scene, incidence_deg: float) -> Scene:
    """The scene with its one station moved along the pipe, as far from its middle as before."""
    start, along = np.array(scene.runs[0].start), np.array(scene.runs[0].direction)
    middle = start + 0.5 * LENGTH * along
    offset = np.array(scene.stations[0]) - middle
    across = offset - (offset @ along) * along
    angle = np.deg2rad(incidence_deg)
    turned = np.cos(angle) * across / np.linalg.norm(across) + np.sin(angle) * along
    x, y, z = (float(v) for v in middle + DISTANCE * turned)
    return replace(scene, stations=((x, y, z),), clutter=())


def _column(rows: list[dict[str, Any]], key: str) -> np.ndarray:
    values = [r[key] for r in rows if r["is_found"]]
    return 1e3 * np.array(values or [np.nan])


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _bound(case: Case, rows: list[dict[str, Any]]) -> float:
    n_points = [r["n_points"] for r in rows if r["is_found"]]
    if not n_points:
        return np.nan
    factor = float(radius_sd_factor(np.deg2rad(case.arc)))
    return 1e3 * factor * case.noise / float(np.sqrt(np.median(n_points)))


def _plot(panel: Axes, sweep: Sweep, cases: list[Case], rows: list[list[dict[str, Any]]]) -> None:
    x = [sweep.factor * v for v in sweep.values]
    panel.plot(x, [_rms(_column(r, "radius_error")) for r in rows], "o-", label="radius: RMS error")
    panel.plot(
        x, [np.median(_column(r, "radius_sd")) for r in rows], "o:", mfc="none",
        label="radius: reported SD",
    )  # fmt: skip
    panel.plot(x, [np.median(_column(r, "axis_error")) for r in rows], "s-", label="axis: median")
    bounds = [_bound(c, r) for c, r in zip(cases, rows, strict=True)]
    panel.plot(x, bounds, "k-", lw=1.5, label="radius: bound")
    panel.set(xlabel=sweep.label, ylabel="mm", yscale="log")
    if sweep.is_log:
        panel.set_xscale("log")
    panel.minorticks_off()
    panel.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    panel.yaxis.set_major_formatter("{x:g}")
    panel.set_xticks(x, [f"{v:g}" for v in x], fontsize=8)
    panel.grid(alpha=0.3)


def _line(sweep: Sweep, value: float, case: Case, rows: list[dict[str, Any]]) -> list[str]:
    errors = _column(rows, "radius_error")
    numbers = [
        _rms(errors),
        float(errors.mean()),
        float(_column(rows, "plain_error").mean()),
        _rms(_column(rows, "peer_error")),
        float(np.abs(errors).max()),
        float(np.median(_column(rows, "radius_sd"))),
        _bound(case, rows),
        float(np.median(_column(rows, "axis_error"))),
    ]
    cells = [f"{v:.3f}" if np.isfinite(v) else "–" for v in numbers]
    cells[1:3] = [f"{v:+.3f}" if np.isfinite(v) else "–" for v in numbers[1:3]]
    n_found = sum(r["is_found"] for r in rows)
    return [f"{sweep.factor * value:g}", f"{n_found} of {len(rows)}", *cells]
