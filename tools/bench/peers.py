"""Other programs on the same cloud, where they are installed.

None of them measures deformations; CGAL and CloudCompare look for cylinders: what each does is told
beside its time. Their files are made before and not counted.
"""

import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from tools.bench.watching import Cost, run

SOURCE = Path(__file__).parent / "programs" / "cgal_ransac.cpp"
CGAL_HEADER = Path("/usr/include/CGAL/Shape_detection/Efficient_RANSAC.h")
VOXEL, REACH = "0.01", "0.028"

TO_RAW = """
import sys, laspy, numpy as np
las = laspy.read(sys.argv[1])
(las.xyz - las.header.mins).astype(np.float32).tofile(sys.argv[2])
"""
TO_PCD = """
import sys, numpy as np
xyz = np.fromfile(sys.argv[1], np.float32).reshape(-1, 3)
with open(sys.argv[2], "wb") as f:
    f.write(
        f"VERSION .7\\nFIELDS x y z\\nSIZE 4 4 4\\nTYPE F F F\\nCOUNT 1 1 1\\nWIDTH {len(xyz)}\\n"
        f"HEIGHT 1\\nVIEWPOINT 0 0 0 1 0 0 0\\nPOINTS {len(xyz)}\\nDATA binary\\n".encode()
    )
    xyz.tofile(f)
"""
TO_PLY = """
import sys, numpy as np
xyz = np.fromfile(sys.argv[1], np.float32).reshape(-1, 3)
with open(sys.argv[2], "wb") as f:
    f.write(
        f"ply\\nformat binary_little_endian 1.0\\nelement vertex {len(xyz)}\\n"
        "property float x\\nproperty float y\\nproperty float z\\nend_header\\n".encode()
    )
    xyz.tofile(f)
"""
OPEN3D = """
import sys, laspy, open3d as o3d
las = laspy.read(sys.argv[1])
cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(las.xyz - las.header.mins))
cloud = cloud.voxel_down_sample(float(sys.argv[2]))
cloud.estimate_normals(o3d.geometry.KDTreeSearchParamRadius(float(sys.argv[3])))
"""


class NotThereError(Exception):
    """A peer is not installed; the text says what is missing."""


def open3d(cloud: Path, _: Path) -> Cost:
    """Thin and estimate normals, no more."""
    if find_spec("open3d") is None:
        raise NotThereError("the package open3d")
    return run([sys.executable, "-c", OPEN3D, str(cloud), VOXEL, REACH])


def cgal(cloud: Path, folder: Path) -> Cost:
    """Find planes, cylinders, tori and spheres by Efficient RANSAC."""
    compiler = shutil.which("g++")
    if compiler is None or not CGAL_HEADER.exists():
        raise NotThereError("g++ or libcgal-dev")
    program = folder / "cgal_ransac"
    if not program.exists():
        libraries = ["-lgmp", "-lmpfr"]
        flags = ["-O3", "-march=native", "-DNDEBUG", "-std=c++17"]
        subprocess.run([compiler, *flags, str(SOURCE), "-o", str(program), *libraries], check=True)
    return run([str(program), str(_raw(cloud, folder)), "0.005", "0.03", "500"])


def pcl(cloud: Path, folder: Path) -> Cost:
    """Thin and estimate normals, no more: PCL's tools fit no cylinders."""
    if shutil.which("pcl_voxel_grid") is None or shutil.which("pcl_normal_estimation") is None:
        raise NotThereError("pcl-tools")
    pcd, thinned, out = (folder / f"{cloud.stem}{end}.pcd" for end in ("", "-thin", "-normals"))
    if not pcd.exists():
        subprocess.run(
            [sys.executable, "-c", TO_PCD, str(_raw(cloud, folder)), str(pcd)], check=True
        )
    first = run(["pcl_voxel_grid", str(pcd), str(thinned), "-leaf", f"{VOXEL},{VOXEL},{VOXEL}"])
    second = run(["pcl_normal_estimation", str(thinned), str(out), "-radius", REACH])
    return Cost(first.wall + second.wall, first.cpu + second.cpu, max(first.memory, second.memory))


def cloudcompare(cloud: Path, folder: Path) -> Cost:
    """Find planes, cylinders, tori and spheres by its RANSAC (Schnabel's)."""
    program = shutil.which("CloudCompare")
    if program is None:
        raise NotThereError("cloudcompare")
    ply = folder / f"{cloud.stem}.ply"
    if not ply.exists():
        subprocess.run(
            [sys.executable, "-c", TO_PLY, str(_raw(cloud, folder)), str(ply)], check=True
        )
    primitives = ["PLANE", "CYLINDER", "TORUS", "SPHERE"]
    ransac = ["-RANSAC", "EPSILON_ABSOLUTE", "0.005", "BITMAP_EPSILON_ABSOLUTE", "0.02"]
    ransac += ["SUPPORT_POINTS", "500", "ENABLE_PRIMITIVE", *primitives]
    command = [program, "-SILENT", "-AUTO_SAVE", "OFF", "-NO_TIMESTAMP", "-O", str(ply), *ransac]
    return run(command, QT_QPA_PLATFORM="offscreen")


PEERS: dict[str, Callable[[Path, Path], Cost]] = {
    "open3d: read, thin, normals": open3d,
    "PCL’s tools: thin, normals": pcl,
    "CGAL: normals, Efficient RANSAC": cgal,
    "CloudCompare: normals, RANSAC": cloudcompare,
}


def _raw(cloud: Path, folder: Path) -> Path:
    raw = folder / f"{cloud.stem}.xyz32"
    if not raw.exists():
        subprocess.run([sys.executable, "-c", TO_RAW, str(cloud), str(raw)], check=True)
    return raw
