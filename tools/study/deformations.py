"""Deformations of ray-cast pipes: how many are found, how well they are measured, false alarms.

Beside it, in the same run, a cylinder with the distances of the points from it.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipecore.types import DeformationKind
from tools.study.deformed import EXTENT, NOISE, SPACING, Pipe, Row, clean_plant
from tools.study.store import put_image, table

FIRST_SEEDS = {"patch": 12000, "oval": 13000, "line": 14000, "clean": 15000, "plant": 12001}
"""Seeds below 10,000 are for development."""

SMALL = 0.06
"""Radius of the small pipes, up to DN 100, metres."""

FULLY_SEEN = 0.9
DEEP = 0.005
Judge = Callable[[Row], bool]


def write(quick: bool) -> str:
    """Measure and return the section's text."""
    n = 24 if quick else 192
    cycle = (DeformationKind.DENT, DeformationKind.DENT, DeformationKind.BULGE)
    patches = [Pipe(s, cycle[i % 3]).row() for i, s in enumerate(_seeds("patch", n))]
    ovals = [Pipe(s, DeformationKind.OVALITY).row() for s in _seeds("oval", n // 2)]
    lines = [
        Pipe(s, (DeformationKind.BOW, DeformationKind.KINK)[i % 2]).row()
        for i, s in enumerate(_seeds("line", n // 12))
    ]
    clean = [Pipe(s, None).row() for s in _seeds("clean", n // 4)]
    plants = [clean_plant(s) for s in _seeds("plant", 1 if quick else 8)]
    pipes = [*patches, *ovals, *lines, *clean]
    few = " These are few: `--quick`." if quick else ""
    seen = [r for r in patches if r["seen"] >= FULLY_SEEN]
    judged = [r for r in seen if r["extent"] >= EXTENT - 1e-3]
    summary = table(["", "measured", "wanted", ""], _targets(seen, judged, ovals, pipes, plants))
    deep = [r for r in judged if r["depth"] >= DEEP]
    return f"""
{len(patches)} dents and bulges (smooth, flat and sharp; {len(judged)} of them at least
{EXTENT:g} OD long and wide and wholly in sight), {len(ovals)} oval, {len(lines)} bowed or
kinked and {len(clean)} clean pipes, DN 80 to DN 400, each scanned alone by one to three stations
that see 140 to 360° of it ({1e3 * NOISE:g} mm noise along the beam, {1e3 * SPACING:g} mm spacing,
ray-cast), and {len(plants)} plants without deformations, with flanges, posts, elbows, trays and
people, seen by two stations.{few} All went through `pipecore.detect` with its default settings.
Seeds from {min(FIRST_SEEDS.values())} on; development used those below 10,000.

{summary}

{put_image("deformations", _detection_figure(seen), "Share found against depth and extent")}

{put_image("depths", _depth_figure(seen), "Depth read against true depth, errors, calibration")}

By form of the dent, where it is at least 5 mm deep:

{_by_form(seen)}

**Cylinder and distances**: a cylinder by least squares on its inliers and the largest distance
of a point at the dent, as other programs offer it. It is told which points are the pipe's and
where the dent is, and counts as having found it if no point elsewhere lies further off. On the
same {len(deep)} dents of 5 mm and more it finds {_share(judged, DEEP, _by_plain)}
and reads {_plain_errors(deep)}; it knows no standard deviation and
cannot tell a dent from an oval or bowed pipe. It reads deep because the deepest of many noisy
points is taken.

Bows and kinks of 8 to 20 mm: {_lines(lines)}. Those missed or read far too small lie on pipes
that the detection took for two or more shorter ones.

{_false_alarms(pipes, plants)}
"""


def _seeds(what: str, n: int) -> range:
    return range(FIRST_SEEDS[what], FIRST_SEEDS[what] + n)


def _by_us(row: Row) -> bool:
    return "found" in row


def _by_plain(row: Row) -> bool:
    return bool(row["plain"]["is_found"])


def _share(rows: Sequence[Row], least: float, is_found: Judge = _by_us) -> str:
    deep = [r for r in rows if r["depth"] >= least]
    n = sum(map(is_found, deep))
    return f"{n} of {len(deep)} ({100 * n / max(len(deep), 1):.0f} %)"


def _measured(rows: Sequence[Row], least: float = DEEP) -> list[Row]:
    return [r for r in rows if r["depth"] >= least and _by_us(r) and r["found"]["depth"]]


def _errors(rows: Sequence[Row]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of the depths, the standard deviations given for them, and the true depths."""
    true = np.array([r["depth"] for r in rows])
    found = np.array([[r["found"]["depth"], r["found"]["depth_sd"]] for r in rows]).reshape(-1, 2)
    return found[:, 0] - true, found[:, 1], true


def _targets(
    seen: list[Row], judged: list[Row], ovals: list[Row], pipes: list[Row], plants: list[Row]
) -> list[list[str]]:
    measured = _measured(seen)
    error, sd, true = _errors(measured)
    score = np.abs(error) / sd
    off = {
        name: 100 * np.median(np.abs([r["found"][name] - 1 for r in measured]))
        for name in ("length_ratio", "width_ratio")
    }
    peak = 100 * np.array([r["found"]["position_error"] for r in measured])
    wide = [r for r in ovals if r["ovality"] >= 0.04 and r["arc"] >= np.deg2rad(235)]
    found = [r for r in wide if _by_us(r) and r["found"]["ovality"]]
    oval_error = 100 * np.array([r["found"]["ovality"] - r["ovality"] for r in found])
    length = sum(r["clean_length"] for r in [*pipes, *plants])
    alarms = sum(len(r["false"]) for r in [*pipes, *plants])
    small = [r for r in judged if r["radius"] < SMALL]
    lines: list[tuple[str, str, str, bool | None]] = []
    for least, wanted in ((0.008, 98), (0.005, 90)):
        deep = [r for r in judged if r["depth"] >= least]
        share = 100 * np.mean(list(map(_by_us, deep)))
        lines.append(
            (
                f"dents and bulges ≥ {1e3 * least:g} mm found",
                _share(judged, least),
                f"{wanted} %",
                share >= wanted,
            )
        )
        lines.append(("… of these on DN 80 and DN 100", _share(small, least), "", None))
    lines += [
        ("depth, median error", f"{100 * np.median(np.abs(error) / true):.1f} %", "≤ 8 %",
         100 * np.median(np.abs(error) / true) <= 8),
        ("depth, bias", f"{100 * np.mean(error / true):+.1f} %", "≤ 3 %",
         abs(100 * np.mean(error / true)) <= 3),
        ("depth within one reported SD", f"{100 * np.mean(score < 1):.0f} %", "60–76 %",
         60 <= round(100 * np.mean(score < 1)) <= 76),
        ("… within two", f"{100 * np.mean(score < 2):.0f} %", "≥ 90 %",
         100 * np.mean(score < 2) >= 90),
        ("length, median error", f"{off['length_ratio']:.0f} %", "≤ 20 %",
         off["length_ratio"] <= 20),
        ("width, median error", f"{off['width_ratio']:.0f} %", "≤ 20 %", off["width_ratio"] <= 20),
        ("position of the peak, 95 % within", f"{np.quantile(peak, 0.95):.1f} cm", "2 cm",
         bool(np.quantile(peak, 0.95) <= 2)),
        ("ovality ≥ 4 % over 1 m, arc ≥ 240°, found", f"{len(found)} of {len(wide)}", "95 %",
         len(found) >= 0.95 * len(wide)),
        ("… median error, percentage points", f"{np.median(np.abs(oval_error)):.2f}", "≤ 0.6",
         bool(np.median(np.abs(oval_error)) <= 0.6)),
        ("… mean error, percentage points", f"{np.mean(oval_error):+.2f}", "", None),
        ("false alarms", f"{alarms} in {length:.0f} m", "≤ 1 in 200 m",
         alarms <= length / 200),
    ]  # fmt: skip
    word = {True: "reached", False: "**falls short**", None: ""}
    return [[name, value, wanted, word[ok]] for name, value, wanted, ok in lines]


def _by_form(seen: list[Row]) -> str:
    rows = []
    for shape in ("smooth", "flat", "sharp"):
        form = [r for r in seen if r["shape"] == shape]
        measured = _measured(form)
        if not measured:
            continue
        error, sd, true = _errors(measured)
        score = np.abs(error) / sd
        rows.append(
            [
                shape,
                _share(form, 0.005),
                f"{100 * np.median(np.abs(error) / true):.1f} %",
                f"{100 * np.mean(error / true):+.1f} %",
                f"{100 * np.mean(score < 1):.0f} / {100 * np.mean(score < 2):.0f} %",
            ]
        )
    return table(["form", "found", "median error", "bias", "within 1 / 2 SD"], rows)


def _plain_errors(deep: list[Row]) -> str:
    rows = [r for r in deep if r["plain"]["depth"]]
    relative = np.array([r["plain"]["depth"] / r["depth"] - 1 for r in rows])
    return (
        f"depths with a median error of {100 * np.median(np.abs(relative)):.0f} % and a bias of "
        f"{100 * np.mean(relative):+.0f} %"
    )


def _lines(lines: list[Row]) -> str:
    parts = []
    for kind in (DeformationKind.BOW, DeformationKind.KINK):
        rows = [r for r in lines if r["kind"] == kind]
        found = [r for r in rows if _by_us(r)]
        taken = [r for r in rows if "taken_for" in r]
        if found:
            error, _, true = _errors(found)
            near = int(np.count_nonzero(np.abs(error) < 0.2 * true))
            parts.append(
                f"{len(found)} of {len(rows)} named a {kind}, {len(taken)} taken for another kind, "
                f"{near} read within 20 % (median {100 * np.median(error / true):+.0f} %)"
            )
    return "; ".join(parts)


def _false_alarms(pipes: list[Row], plants: list[Row]) -> str:
    alone = [f"pipe {r['seed']}: {text}" for r in pipes for text in r["false"]]
    among = [f"plant {r['seed']}: {text}" for r in plants for text in r["false"]]
    lengths = [sum(r["clean_length"] for r in rows) for rows in (pipes, plants)]
    head = (
        f"False alarms: {len(alone)} in {lengths[0]:.0f} m of pipe alone, {len(among)} in "
        f"{lengths[1]:.0f} m of pipes in plants"
    )
    if not alone and not among:
        return f"{head}."
    return f"{head}:\n\n" + "\n".join(f"- {text}" for text in (*alone, *among))


# Figures


def _rate(
    panel: Axes,
    rows: list[Row],
    key: str,
    edges: list[float],
    scale: float,
    judge: Judge,
    **style: object,
) -> None:
    x, y, low, high = [], [], [], []
    for a, b in pairwise(edges):
        inside = [judge(r) for r in rows if a <= scale * r[key] < b]
        if len(inside) < 3:
            continue
        n, k = len(inside), sum(inside)
        share = k / n
        # Wilson's interval at one standard deviation.
        centre = (share + 0.5 / n) / (1 + 1 / n)
        half = np.sqrt(share * (1 - share) / n + 0.25 / n**2) / (1 + 1 / n)
        x.append((a + b) / 2)
        y.append(100 * share)
        low.append(100 * max(share - (centre - half), 0))
        high.append(100 * max(centre + half - share, 0))
    panel.errorbar(x, y, yerr=[low, high], capsize=2, **style)


def _detection_figure(seen: list[Row]) -> Figure:
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    by_depth, by_extent = figure.subplots(1, 2, sharey=True)
    large = [r for r in seen if r["radius"] >= SMALL]
    small = [r for r in seen if r["radius"] < SMALL]
    ratio = [1, 1.5, 2, 2.5, 3, 4, 5, 6, 8]
    extents = [0.3, 0.45, 0.55, 0.7, 0.85, 1.0]
    deep = [r for r in seen if r["depth"] >= 0.004]
    _rate(by_depth, large, "depth", ratio, 1 / NOISE, _by_us, fmt="o-", label="DN 125 to 400")
    _rate(by_depth, small, "depth", ratio, 1 / NOISE, _by_us, fmt="s-", label="DN 80 and 100")
    _rate(by_depth, seen, "depth", ratio, 1 / NOISE, _by_plain, fmt="^:", color="0.5",
          label="cylinder and distances")  # fmt: skip
    _rate(by_extent, deep, "extent", extents, 1.0, _by_us, fmt="o-", label="depth ≥ 4 mm")
    _rate(by_extent, deep, "extent", extents, 1.0, _by_plain, fmt="^:", color="0.5",
          label="cylinder and distances")  # fmt: skip
    by_depth.set(xlabel="depth / noise of a point", ylabel="found, %", ylim=(-3, 103))
    by_extent.set(xlabel="length and width / outside diameter")
    for panel in (by_depth, by_extent):
        panel.grid(alpha=0.3)
        panel.legend(fontsize=8)
    return figure


def _depth_figure(seen: list[Row]) -> Figure:
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    reads, errors, scores = figure.subplots(1, 3)
    rows = _measured(seen, 0.0)
    error, sd, true = _errors(rows)
    plain = np.array([r["plain"]["depth"] or np.nan for r in rows])
    reads.plot(1e3 * true, 1e3 * plain, "^", color="0.6", ms=4, label="cylinder and distances")
    reads.errorbar(
        1e3 * true, 1e3 * (true + error), 1e3 * sd, fmt="o", ms=3.5, lw=0.8, label="ours"
    )
    top = 1e3 * float(np.nanmax([true.max(), plain.max()])) + 1
    reads.plot([0, top], [0, top], "k-", lw=0.8)
    reads.set(xlabel="true depth, mm", ylabel="depth read, mm")
    errors.plot(1e3 * true, 100 * (plain / true - 1), "^", color="0.6", ms=4)
    errors.plot(1e3 * true, 100 * error / true, "o", ms=3.5)
    errors.axhline(0, color="k", lw=0.8)
    errors.set(xlabel="true depth, mm", ylabel="error, %", ylim=(-60, 120))
    z = np.sort(error / sd)
    scores.plot(z, (np.arange(len(z)) + 0.5) / len(z), drawstyle="steps-mid", label="measured")
    grid = np.linspace(-4, 4, 200)
    normal = np.cumsum(np.exp(-(grid**2) / 2))
    scores.plot(grid, normal / normal[-1], "k-", lw=0.8, label="normal")
    scores.set(xlabel="error / reported SD", ylabel="share below", xlim=(-4, 4))
    for panel in (reads, errors, scores):
        panel.grid(alpha=0.3)
    reads.legend(fontsize=8)
    scores.legend(fontsize=8)
    return figure
