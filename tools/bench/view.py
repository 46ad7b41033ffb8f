"""How smooth the 3D view is, and what memory it needs: `python -m tools.bench.view`.

One process for each size, with a real window: it needs a display, such as xvfb-run's.
Nothing is asserted about time. Writes its section of `docs/performance.md`.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

PAGE = Path(__file__).parents[2] / "docs" / "performance.md"
BEGIN, END = "<!-- view: begin -->", "<!-- view: end -->"
SIZE = (1000, 650)
N_MOVES = 60
CHUNK = 1_000_000


def resident_bytes() -> int:
    """Return what this process holds in memory now."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def make_cloud(n: int) -> Any:
    """Pipes side by side, one for each million points, with all that a LAZ file carries."""
    from pipecore.types import PointCloud

    rng = np.random.default_rng(1)
    cloud = PointCloud(
        np.array([432_100.0, 6_201_900.0, 100.0]),
        np.empty((n, 3), np.float32),
        np.empty(n, np.float32),
        np.empty((n, 3), np.uint8),
        np.zeros(n, np.uint8),
    )
    assert cloud.intensity is not None
    assert cloud.rgb is not None
    for start in range(0, n, CHUNK):
        at = slice(start, min(start + CHUNK, n))
        m = at.stop - at.start
        row, column = divmod(start // CHUNK, 8)
        angle = rng.uniform(0, 2 * np.pi, m)
        radius = rng.uniform(0.1, 0.4) + rng.normal(0, 0.002, m)
        cloud.xyz[at, 0] = rng.uniform(0, 20, m)
        cloud.xyz[at, 1] = 2.0 * column + radius * np.cos(angle)
        cloud.xyz[at, 2] = 1.5 * row + radius * np.sin(angle)
        cloud.intensity[at] = rng.random(m, np.float32)
        cloud.rgb[at] = rng.integers(0, 255, (1, 3), np.uint8)
    return cloud


def measure(n: int) -> dict[str, float]:
    """Show a cloud of `n` points and return what that takes."""
    from PySide6.QtCore import QPointF
    from PySide6.QtWidgets import QApplication

    from pipegui.model.document import ClipBox, ColourBy, Document, Scan, ViewOptions
    from pipegui.scene import clipping
    from pipegui.scene import pose as poses
    from pipegui.scene.picking import warm_up
    from pipegui.scene.view import SceneView
    from pipegui.states.view_state import resolve

    app = QApplication([])
    warm_up()
    scene = SceneView()
    scene.resize(*SIZE)
    scene.show()
    frames: list[float] = []
    scene.canvas.drawn.connect(frames.append)
    cloud = make_cloud(1000)

    def show(**view: Any) -> None:
        options = ViewOptions(**({"fly": False} | view))
        name = f"{len(cloud)} points"
        scene.apply(resolve(Document(scans=(Scan(name, cloud),), view=options)).scene)

    def until_drawn(act: Callable[[], object]) -> float:
        """Milliseconds from an act to the picture that shows it."""
        frames.clear()
        start = time.perf_counter()
        act()
        while not frames:
            app.processEvents()
        return 1000 * (time.perf_counter() - start)

    def rest() -> None:
        frames.clear()
        until = time.perf_counter() + 5
        while scene.canvas.is_moving or time.perf_counter() < until:
            app.processEvents()
            time.sleep(0.005)

    # What the window and the drawing need by themselves is not the points'.
    until_drawn(show)
    rest()
    before = resident_bytes()
    cloud = make_cloud(n)
    held = resident_bytes()
    found: dict[str, float] = {"first picture": until_drawn(show)}
    rest()
    shown = scene.points.n_shown

    def orbit() -> None:
        pose = scene.canvas.pose
        scene.canvas.move_to(poses.orbit(pose, 0.05, 0.01, pose.focus))

    # The first moves find out how fast this machine draws.
    for _ in range(N_MOVES // 4):
        until_drawn(orbit)
    computing = time.process_time()
    moves = np.array([until_drawn(orbit) for _ in range(N_MOVES)])
    computing = 1000 * (time.process_time() - computing) / N_MOVES
    found |= {
        "points moving": scene.points.n_shown,
        "move, median": float(np.median(moves)),
        "move, worst": float(moves.max()),
        "move, CPU": computing,
    }
    rest()
    found |= {"points at rest": shown, "memory, all": (resident_bytes() - before) / n}
    found["memory, cloud"] = (held - before) / n
    rng = np.random.default_rng(2)
    spots = rng.uniform(0.3, 0.7, (20, 2)) * SIZE
    times = []
    for x, y in spots:
        start = time.perf_counter()
        scene.pick(QPointF(x, y))
        times.append(1000 * (time.perf_counter() - start))
    found["pick"] = float(np.median(times))
    found["points picked from"] = sum(len(part) for part in scene.points.parts)
    computing = time.thread_time()
    found["recolour"] = until_drawn(lambda: show(colour_by=ColourBy.HEIGHT))
    found["recolour, CPU"] = 1000 * (time.thread_time() - computing)
    rest()
    low, high = cloud.xyz[:100_000].min(axis=0), cloud.xyz[:100_000].max(axis=0)
    box = ClipBox(tuple(low.tolist()), tuple(high.tolist()))
    computing = time.thread_time()
    found["clip"] = until_drawn(lambda: show(colour_by=ColourBy.HEIGHT, clip_box=box))
    found["clip, CPU"] = 1000 * (time.thread_time() - computing)
    rest()
    pixels, _ = scene.canvas.projection().to_screen(clipping.handles(box))
    at = QPointF(*pixels[clipping.MIDDLE])
    start = time.perf_counter()
    drag = scene.canvas.grab(at)
    found["take a handle"] = 1000 * (time.perf_counter() - start)
    assert drag is not None

    def pull(i: int) -> None:
        drag(at + QPointF(2 * i, i), False)
        scene.canvas.move_to(scene.canvas.pose)

    pulls = np.array([until_drawn(lambda i=i: pull(i)) for i in range(N_MOVES)])
    found["drag box, worst"] = float(pulls[N_MOVES // 4 :].max())
    scene.close()
    return found


def write_section(page: Path, text: str) -> None:
    """Put a text between this section's marks, or at the end of the page."""
    whole = page.read_text(encoding="utf-8") if page.exists() else ""
    section = f"{BEGIN}\n{text.strip()}\n{END}\n"
    if BEGIN in whole:
        pattern = re.escape(BEGIN) + ".*?" + re.escape(END) + "\n?"
        whole = re.sub(pattern, lambda _: section, whole, flags=re.DOTALL)
    else:
        whole = f"{whole.rstrip()}\n\n{section}"
    page.write_text(whole, encoding="utf-8")


def _section(rows: list[dict[str, float]], sizes: list[float]) -> str:
    lines = [
        f"| {million:g} | {r['first picture']:.0f} | {r['move, median']:.0f} "
        f"| {r['move, worst']:.0f} | {r['move, CPU']:.0f} | {r['points moving'] / 1e3:.0f} k "
        f"| {r['points at rest'] / 1e6:.1f} M | {r['pick']:.1f} | {r['recolour']:.0f} "
        f"({r['recolour, CPU']:.0f}) | {r['clip']:.0f} ({r['clip, CPU']:.0f}) "
        f"| {r['drag box, worst']:.0f} | {r['memory, cloud']:.1f} "
        f"| {r['memory, all']:.1f} |"
        for million, r in zip(sizes, rows, strict=True)
    ]
    points = " ".join(f"{s:g}" for s in sizes)
    return f"""## The 3D view

Measured by `python -m tools.bench.view --points {points}` under Xvfb, drawn by
software (Mesa llvmpipe) on {os.cpu_count()} cores, load average {os.getloadavg()[0]:.1f} at
the end; a view of {SIZE[0]} × {SIZE[1]} pixels.
Random points on pipes, with intensity, colour and class. Times are from what the user does
to the picture that shows it, in milliseconds; the worst is that of {N_MOVES} moves in a row
after {N_MOVES // 4} that find out how fast the machine draws. CPU is the time of all cores,
which does not count what else the machine does; in brackets, that of the window's thread.
Recolouring and clipping draw a part of the points first. Memory is in bytes a
point: the cloud's own, and with all that the view adds to it, resident after a rest; without
a graphics card, what that would hold is among it.

| million points | first picture | move, median | move, worst | move, CPU | points moving \
| points at rest | pick | recolour | clip | drag box, worst | memory: cloud | memory: all |
| --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: |
{chr(10).join(lines)}
"""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.bench.view", description=__doc__)
    parser.add_argument("--points", type=float, nargs="+", default=[5, 20, 44], metavar="MILLION")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(measure(args.one)))
        return
    rows = []
    for million in args.points:
        command = [sys.executable, "-m", "tools.bench.view", "--one", str(round(1e6 * million))]
        said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        rows.append(json.loads(said.splitlines()[-1]))
        print(million, rows[-1], flush=True)
    write_section(PAGE, _section(rows, args.points))


if __name__ == "__main__":
    main()
