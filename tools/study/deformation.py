"""How well deformations are found and measured: `python -m tools.study.deformation [n] [seed]`.

Random pipes of DN 80 to DN 400 with 2 mm noise and 1 cm spacing, seen over 140° and more,
in clutter: half of them with a dent or bulge, the others clean, and some oval or bowed.
"""

import sys
import time
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from pipecore.deformation import find_deformations
from pipecore.settings import DeformationSettings
from pipecore.types import DeformationKind
from tests.core.deformation.sampler import PipeScene, bump, oval

DIAMETERS = np.array([88.9, 114.3, 168.3, 219.1, 273.0, 323.8, 355.6, 406.4]) / 1000
PATCH = (DeformationKind.DENT, DeformationKind.BULGE)


def random_scene(rng: np.random.Generator) -> PipeScene:
    """A clean pipe among clutter."""
    arc = np.deg2rad(rng.uniform(140, 170))
    views: tuple[float, ...] = (rng.uniform(0, 2 * np.pi),)
    if rng.uniform() < 0.4:
        views += (views[0] + rng.uniform(np.pi / 2, np.pi),)
    radius = float(rng.choice(DIAMETERS)) / 2
    clutter = {
        name: bool(rng.uniform() < 0.3)
        for name in ("flanges", "elbow", "post", "crossing", "crossing_known", "mixed")
    }
    if clutter["flanges"]:
        clutter["elbow"] = False
    return PipeScene(
        radius=radius, length=float(rng.uniform(1.2, 3.5)), views=views, arc=arc, **clutter
    )


@dataclass
class Tally:
    """What was measured against what is true."""

    errors: list[tuple[float, ...]] = field(default_factory=list)
    missed: list[tuple[float, float]] = field(default_factory=list)
    false_alarms: list[str] = field(default_factory=list)
    clean_length: float = 0.0
    seconds: list[float] = field(default_factory=list)

    def search(self, scene: PipeScene, rng: np.random.Generator):
        scan = scene.scan(rng)
        begin = time.perf_counter()
        found = find_deformations(
            scan.element,
            scan.xyz,
            scan.normals,
            scan.neighbours,
            DeformationSettings(),
        )
        self.seconds.append(time.perf_counter() - begin)
        return found

    def bumps(self, seed: int, n: int) -> None:
        for i in range(n):
            rng = np.random.default_rng([seed, 1, i])
            scene = random_scene(rng)
            scene.elbow = False
            r, size = scene.radius, scene.radius  # 0.5 OD
            depth = rng.uniform(0.004, 0.016) * rng.choice([-1, -1, 1])
            off = scene.arc / 2 - size / 2 / r
            clock = scene.views[0] + rng.uniform(-off, off)
            s0 = rng.uniform(size, scene.length - size)
            if scene.post or scene.crossing:
                s0 = rng.uniform(size, 0.6 * scene.length - 2.0 * r - 0.05)
                if s0 < size:
                    scene.post = scene.crossing = False
            scene.shapes = [bump(s0, clock, depth, length=size, width=size, r=r)]
            finding = self.search(scene, rng)
            hit = None
            for d in finding.deformations:
                turn = np.mod(d.clock - clock + np.pi, 2 * np.pi) - np.pi
                near = np.hypot(d.chainage - s0, turn * r) < 0.6 * size
                right = d.kind is (PATCH[0] if depth < 0 else PATCH[1])
                if near and right:
                    hit = d
                    off_peak = float(np.hypot(d.chainage - s0, turn * r))
                else:
                    self.false_alarms.append(f"bump {i}: {describe(d)}")
            if hit is None:
                self.missed.append((abs(depth), r))
            else:
                self.errors.append(
                    (
                        abs(depth),
                        r,
                        hit.depth,
                        hit.depth_sd,
                        hit.length / size,
                        hit.width / size,
                        off_peak,
                        hit.significance,
                    )
                )

    def clean(self, seed: int, n: int) -> None:
        for i in range(n):
            rng = np.random.default_rng([seed, 2, i])
            scene = random_scene(rng)
            self.clean_length += scene.length
            for d in self.search(scene, rng).deformations:
                names = [
                    k
                    for k in ("flanges", "elbow", "post", "crossing", "mixed")
                    if getattr(scene, k)
                ]
                self.false_alarms.append(
                    f"clean {i} r {scene.radius:.3f} L {scene.length:.2f} "
                    f"{names} {len(scene.views)} views: {describe(d)}"
                )


def describe(d) -> str:
    return (
        f"{d.kind} at {d.chainage:.2f} m, {d.depth * 1e3:.1f} ± {d.depth_sd * 1e3:.1f} mm, "
        f"{d.length:.2f} × {d.width:.2f} m, z {d.significance:.1f}"
    )


def ovality(seed: int, n: int) -> None:
    rows, false = [], Counter()
    for i in range(n):
        rng = np.random.default_rng([seed, 3, i])
        scene = random_scene(rng)
        scene.post = scene.crossing = scene.mixed = False
        scene.views = (scene.views[0], scene.views[0] + rng.uniform(np.pi / 2, np.pi))
        scene.length = rng.uniform(2, 4)
        ratio, start = rng.uniform(0.03, 0.06), rng.uniform(0.2, scene.length - 1.3)
        scene.shapes = [oval(start, start + 1.1, ratio, rng.uniform(0, np.pi), scene.radius)]
        arc = min(scene.arc + (scene.views[1] - scene.views[0]), 2 * scene.arc)
        found = Tally().search(scene, rng).deformations
        hits = [d for d in found if d.kind is DeformationKind.OVALITY]
        false.update(d.kind for d in found if d.kind is not DeformationKind.OVALITY)
        best = max(hits, key=lambda d: d.significance, default=None)
        rows.append(
            (
                arc,
                ratio,
                *(
                    (best.ovality, best.depth_sd / best.depth * best.ovality, best.length)
                    if best
                    else (np.nan,) * 3
                ),
            )
        )
    t = np.array(rows)
    for low in (200, 240):
        some = (np.rad2deg(t[:, 0]) >= low) & (t[:, 1] >= 0.04)
        hit = some & np.isfinite(t[:, 2])
        e = t[hit, 2] - t[hit, 1]
        print(
            f"ovality ≥ 4 % over 1 m, arc ≥ {low}°: found {hit.sum()}/{some.sum()}, "
            f"error median {100 * np.median(np.abs(e)):.2f} "
            f"95 % {100 * np.quantile(np.abs(e), 0.95):.2f} "
            f"bias {100 * np.mean(e):.2f} points, in sd {np.std(e / t[hit, 3]):.2f}, "
            f"length {np.median(t[hit, 4]):.2f} m"
        )
    print("   other kinds reported on oval pipes:", dict(false))


def bow(seed: int, n: int) -> None:
    errors, found = [], Counter()
    for i in range(n):
        rng = np.random.default_rng([seed, 4, i])
        scene = random_scene(rng)
        scene.post = scene.crossing = scene.mixed = False
        length = scene.length = rng.uniform(2, 4)
        sag, kink = rng.uniform(0.008, 0.02), bool(i % 2)

        def offset(s, sag=sag, kink=kink, length=length):
            bowed = sag * (1 - np.cos(2 * np.pi * s / length)) / 2
            return np.interp(s, [0, length / 2, length], [0, sag, 0]) if kink else bowed

        scene.sag = offset
        found_ = Tally().search(scene, rng).deformations
        found.update(("kink" if kink else "bow") + " → " + d.kind for d in found_)
        errors += [d.depth - sag for d in found_ if d.kind not in PATCH and d.kind != "ovality"]
    print(
        f"bow and kink of 8-20 mm: {dict(found)} of {n}; error median "
        f"{1e3 * np.median(np.abs(errors)):.2f} mm, bias {1e3 * np.mean(errors):.2f} mm"
    )


def main(n: int, seed: int) -> None:
    print(f"seed {seed}, {n} pipes of each sort")
    tally = Tally()
    tally.bumps(seed, n)
    e, missed = np.array(tally.errors), np.array(tally.missed).reshape(-1, 2)
    for least in (0.005, 0.008):
        for low, high in ((0, 1), (0, 0.06), (0.06, 0.12), (0.12, 1)):

            def n_of(t, low=low, high=high, least=least):
                return (t[:, 0] >= least) & (t[:, 1] >= low) & (t[:, 1] < high)

            hit, lost = n_of(e), n_of(missed)
            print(
                f"≥ {least * 1e3:.0f} mm, r {low}-{high} m: "
                f"found {hit.sum()}/{hit.sum() + lost.sum()}"
            )
    some = e[e[:, 0] >= 0.005]
    error = some[:, 2] - some[:, 0]
    relative = error / some[:, 0]
    t = np.abs(error) / some[:, 3]
    print(
        f"depth (≥ 5 mm): median error {100 * np.median(np.abs(relative)):.1f} %, "
        f"bias {100 * np.mean(relative):.1f} % (median {100 * np.median(relative):.1f} %), "
        f"within 1 sd {100 * np.mean(t < 1):.0f} %, 2 sd {100 * np.mean(t < 2):.0f} %"
    )
    deep = e[e[:, 0] >= 0.008]
    rel = deep[:, 2] / deep[:, 0] - 1
    print(
        f"depth (≥ 8 mm): median error {100 * np.median(np.abs(rel)):.1f} %, "
        f"bias {100 * np.mean(rel):.1f} %"
    )
    for k, name in ((4, "length"), (5, "width")):
        off = some[:, k] - 1
        print(
            f"{name}: median error {100 * np.median(np.abs(off)):.1f} %, "
            f"bias {100 * np.median(off):.1f} %"
        )
    print(
        f"peak: median {100 * np.median(some[:, 6]):.1f} cm, "
        f"95 % {100 * np.quantile(some[:, 6], 0.95):.1f} cm"
    )
    tally.clean(seed, n)
    print(f"{len(tally.false_alarms)} false alarms; clean length {tally.clean_length:.0f} m")
    print(*tally.false_alarms, sep="\n")
    ovality(seed, n // 2)
    bow(seed, n // 4)
    print(
        f"seconds per pipe: median {np.median(tally.seconds):.2f}, worst {max(tally.seconds):.2f}"
    )


if __name__ == "__main__":
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 100, int(sys.argv[2]) if len(sys.argv) > 2 else 1
    )
