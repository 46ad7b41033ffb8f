from dataclasses import replace

import numpy as np
import pytest

from pipecore.deformation import mesh_deformations
from pipecore.errors import WriteError
from pipecore.report import write_deformation_mesh, write_element_mesh, write_report
from pipecore.report.meshes import write_meshes
from pipecore.report.world import FileCoordinates
from tests.factories import make_scan
from tests.ply import read_ply


@pytest.fixture(scope="module")
def scan():
    return make_scan(40_000)


def test_that_a_ply_holds_the_meshes_in_world_coordinates(scan, tmp_path):
    cloud, result = scan
    path = tmp_path / "deformations.ply"
    write_deformation_mesh(path, cloud, result)
    meshes = mesh_deformations(cloud, result)
    data, comments = read_ply(path)
    vertex, face = data["vertex"], data["face"]["vertex_indices"]
    world = np.concatenate([m.vertices for m in meshes]) + result.origin
    assert np.abs(np.stack([vertex[c] for c in "xyz"], axis=1) - world).max() < 1e-6
    deviation = np.concatenate([m.deviation for m in meshes])
    assert np.allclose(vertex["deviation_mm"], 1000 * deviation, atol=1e-4)
    assert len(face) == sum(len(m.faces) for m in meshes)
    assert (vertex["mesh"][face[:, 0]] == vertex["mesh"][face[:, 2]]).all()
    assert any("dent 1" in c for c in comments)
    # Inward is blue, outward orange.
    dented = np.argmin(vertex["deviation_mm"])
    assert vertex["blue"][dented] > vertex["red"][dented]


def test_that_an_obj_holds_the_same_surface(scan, tmp_path):
    cloud, result = scan
    write_deformation_mesh(tmp_path / "all.ply", cloud, result, [1])
    write_deformation_mesh(tmp_path / "all.obj", cloud, result, [1])
    vertex = read_ply(tmp_path / "all.ply")[0]["vertex"]
    lines = (tmp_path / "all.obj").read_text().splitlines()
    places = np.array([[float(t) for t in x.split()[1:]] for x in lines if x.startswith("v ")])
    faces = np.array([[int(t) for t in x.split()[1:]] for x in lines if x.startswith("f ")])
    assert np.abs(places - np.stack([vertex[c] for c in "xyz"], axis=1)).max() < 1e-4
    assert faces.min() == 1
    assert faces.max() <= len(places)


def test_that_other_endings_are_refused_and_leave_nothing(scan, tmp_path):
    _, result = scan
    with pytest.raises(WriteError, match=r"\.ply or \.obj"):
        write_meshes(tmp_path / "mesh.stl", [], FileCoordinates.of(result))
    with pytest.raises(WriteError):
        write_meshes(tmp_path / "missing" / "mesh.ply", [], FileCoordinates.of(result))
    assert list(tmp_path.iterdir()) == []


def test_that_an_element_is_written_whole(scan, tmp_path):
    cloud, result = scan
    write_element_mesh(tmp_path / "pipe.ply", cloud, result, [2, 3])
    assert set(read_ply(tmp_path / "pipe.ply")[0]["vertex"]["mesh"].tolist()) == {1, 2}


def test_that_a_report_has_a_mesh_if_the_settings_ask_for_one(scan, tmp_path):
    cloud, result = scan
    write_report(tmp_path / "plain", cloud, result)
    assert not (tmp_path / "plain" / "deformations.ply").exists()
    asked = result.settings.replace({"deformation.mesh_exaggeration": 5.0})
    write_report(tmp_path / "meshed", cloud, replace(result, settings=asked))
    assert (tmp_path / "meshed" / "deformations.ply").stat().st_size > 1000
