"""What is found in a real scan, for the eye to judge: nobody knows its truth."""

import numpy as np
import pyvista as pv

from pipecore import detect, read
from pipecore.types import ElementKind, PointCloud, Result
from pipegui.scene.shapes import surfaces
from tests.conftest import SHARED_DATA
from tools.study.store import IMAGES, table

SCAN = "pump_visual_ref.e57"
KNOWN_MM = {"risers": (88.0, 2), "header": (115.0, 1), "casings": (375.0, 2)}
"""Radii known beforehand, and how many pipes have them."""
COLOURS = {
    ElementKind.CYLINDER: "#0072B2",
    ElementKind.TORUS: "#E69F00",
    ElementKind.CONE: "#009E73",
    ElementKind.SPHERE: "#CC79A7",
    ElementKind.FLANGE: "#D55E00",
    ElementKind.TEE: "#56B4E9",
    ElementKind.OTHER: "#999999",
}


def write() -> str:
    """Detect, picture and return the section's text."""
    path = SHARED_DATA / SCAN
    if not path.exists():
        raise SystemExit(f"the scan {SCAN} is not here; this section stays as it is")
    cloud = read(path)
    result = detect(cloud)
    image = _picture(cloud, result)
    known = [
        [name, f"{radius:g}", f"{n}", ", ".join(_nearest(result, radius, n))]
        for name, (radius, n) in KNOWN_MM.items()
    ]
    found = [
        [
            str(e.element_id),
            e.kind.value,
            f"{1e3 * e.radius:.1f} ± {1e3 * e.radius_sd:.1f}",
            f"{e.axis.length:.2f}",
            f"{np.rad2deg(e.arc):.0f}",
            e.nominal.name if e.nominal else "–",
        ]
        for e in result.elements
    ]
    dents = [
        f"{d.kind.value} of {1e3 * d.depth:.1f} ± {1e3 * d.depth_sd:.1f} mm on {d.element_id}"
        for d in result.deformations
    ]
    return f"""
`{SCAN}`: twin pumps scanned from one station, {len(cloud):,} points, spacing 4.6 mm, noise 1 to
4 mm. Left the scan, right what was found: cylinders blue, bends orange, flanges red, cones green.

{image}

{table(["known", "radius, mm", "pipes", "found, mm"], known)}

Deformations: {"; ".join(dents) or "none"}.

{table(["element", "kind", "radius, mm", "length, m", "arc, °", "nominal size"], found)}
"""


def _nearest(result: Result, radius_mm: float, n: int) -> list[str]:
    """The `n` cylinders longer than their radius whose radii are nearest."""
    long = [
        e for e in result.elements if e.kind is ElementKind.CYLINDER and e.axis.length > e.radius
    ]
    long.sort(key=lambda e: abs(1e3 * e.radius - radius_mm))
    return [f"{1e3 * e.radius:.1f} ± {1e3 * e.radius_sd:.1f}" for e in long[:n]]


def _picture(cloud: PointCloud, result: Result) -> str:
    plotter = pv.Plotter(off_screen=True, shape=(1, 2), window_size=(1800, 900), border=False)
    plotter.set_background("white")
    for column in (0, 1):
        plotter.subplot(0, column)
        grey = column == 1
        colours = {"color": "#b0b0b0"} if grey or cloud.rgb is None else {}
        points = pv.PolyData(np.asarray(cloud.xyz, np.float32))
        if not colours:
            points["rgb"] = cloud.rgb
            colours = {"scalars": "rgb", "rgb": True}
        plotter.add_mesh(points, point_size=2, **colours)
        if grey:
            for e in result.elements:
                plotter.add_mesh(surfaces((e,)), color=COLOURS[e.kind])
    plotter.link_views()
    plotter.camera_position = [(1.2, 2.6, 1.2), (-0.1, -2.9, -0.35), (0.0, 0.0, 1.0)]
    path = IMAGES / "accuracy-pump.png"
    plotter.screenshot(str(path))
    plotter.close()
    return f"![The pump scan and its elements](images/{path.name})"
