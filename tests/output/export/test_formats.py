"""What another program reads from our files is the mesh, its labels and its unit; what it cannot take is refused."""

import json
import re

import numpy as np
import open3d as o3d
import pytest

from mesh_fields import sphere
from o3dleaf.core.errors import InputError, UnitError
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays
from o3dleaf.io import obj, stl_text
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.io.triangle_mesh import read_mesh, write_mesh
from o3dleaf.output.export.consumers import export_mesh, vertex_normals
from o3dleaf.surface.isosurface.isosurface import extract_isosurface
from tolerances import SINGLE_LENGTH, SPHERE_NORMAL

NAMES = ("adaxial", "abaxial", "rim")
FAR = np.array([317.3, 727.1, -45.2])


@pytest.fixture(scope="module")
def ball():
    """A sphere far from the origin whose triangles are labelled by height, in no order."""
    vertices, triangles = mesh_arrays(extract_isosurface(sphere(), 0.2))
    height = vertices[triangles, 2].mean(axis=1)
    labels = np.where(height > 0.3, 0, np.where(height < -0.3, 1, 2))
    shuffled = np.random.default_rng(5).permutation(len(triangles))
    return LabelledMesh(build_mesh(vertices + FAR, triangles[shuffled]), labels[shuffled].astype(np.uint8), unit="mm")


def parse_solids(path):
    """Solids of an ASCII STL, word by word."""
    words = path.read_text(encoding="ascii").split()
    solids, place = {}, 0
    while place < len(words):
        assert words[place] == "solid"
        name, facets, place = words[place + 1], [], place + 2
        while words[place] == "facet":
            assert words[place + 1] == "normal"
            assert words[place + 5 : place + 7] == ["outer", "loop"]
            assert [words[place + 7 + 4 * k] for k in range(3)] == ["vertex"] * 3
            assert words[place + 19 : place + 21] == ["endloop", "endfacet"]
            rows = [words[place + 2 : place + 5], *(words[place + 8 + 4 * k : place + 11 + 4 * k] for k in range(3))]
            facets.append(np.array(rows, dtype=np.float64))
            place += 21
        assert words[place : place + 2] == ["endsolid", name]
        solids[name], place = np.array(facets), place + 2
    return solids


def test_solids_for_openfoam_are_named_in_metres_and_exact(ball, tmp_path, monkeypatch):
    monkeypatch.setattr(stl_text, "BLOCK", 50)
    export_mesh(ball, tmp_path / "ball.stl", consumer="openfoam")
    solids = parse_solids(tmp_path / "ball.stl")
    assert tuple(solids) == NAMES
    vertices, triangles = mesh_arrays(ball.mesh)
    for number, name in enumerate(NAMES):
        assert np.array_equal(solids[name][:, 1:], (vertices * 1e-3)[triangles[ball.labels == number]])
        outward = solids[name][:, 1:].mean(axis=1) - FAR * 1e-3
        assert (np.einsum("ij,ij->i", solids[name][:, 0], outward) > 0).all()
    assert len(o3d.io.read_triangle_mesh(tmp_path / "ball.stl").triangles) == len(triangles)


def test_numbers_of_any_size_keep_their_width():
    """Signs, exponents of one to three digits and zero: records are of one length, and read back bit for bit."""
    rows = np.array([[1.0, -1e-98, 0.0], [-9.5e98, 1e-7, 3.0], [1e-320, -2.5e10, -0.0]])
    lines = stl_text.number_lines(rows, stl_text.NUMBER, stl_text.WIDTH)
    expected = rows.copy()
    expected[2, 0] = 0.0
    assert np.array_equal(np.array([line.split() for line in lines], dtype=np.float64), expected)
    with pytest.raises(InputError, match="larger unit"):
        stl_text.number_lines(rows * 1e3, stl_text.NUMBER, stl_text.WIDTH)


def test_obj_has_groups_and_normals_and_every_digit(ball, tmp_path, monkeypatch):
    monkeypatch.setattr(obj, "BLOCK", 64)
    export_mesh(ball, tmp_path / "ball.obj")
    lines = [line.split() for line in (tmp_path / "ball.obj").read_text(encoding="ascii").splitlines()]
    assert [line[1] for line in lines if line[0] == "g"] == list(NAMES)
    vertices = np.array([line[1:] for line in lines if line[0] == "v"], dtype=np.float64)
    assert np.array_equal(vertices, np.asarray(ball.mesh.vertices))
    assert "mm" in (tmp_path / "ball.obj").read_text().splitlines()[0]
    again = o3d.io.read_triangle_mesh(tmp_path / "ball.obj")
    assert len(again.triangles) == len(ball.mesh.triangles)
    assert again.has_vertex_normals()


def test_ply_has_normals_scalars_labels_and_unit(ball, tmp_path):
    vertices, triangles = mesh_arrays(ball.mesh)
    bent = np.sin(vertices[:, 0])
    export_mesh(ball, tmp_path / "ball.ply", scalars={"curvature": bent})
    again = o3d.io.read_triangle_mesh(tmp_path / "ball.ply")
    assert np.array_equal(np.asarray(again.vertices), vertices)
    assert np.array_equal(np.asarray(again.triangles), triangles)
    assert np.array_equal(np.asarray(again.vertex_normals), vertex_normals(vertices, triangles))
    cloud = o3d.t.io.read_point_cloud(str(tmp_path / "ball.ply"))
    assert np.array_equal(cloud.point["curvature"].numpy().ravel(), bent)
    found = read_mesh(tmp_path / "ball.ply")
    assert found.unit == "mm"
    assert np.array_equal(found.labels, ball.labels)


def test_normals_of_a_sphere_point_outwards():
    vertices, triangles = mesh_arrays(extract_isosurface(sphere(), 0.05))
    outward = vertices - vertices.mean(axis=0)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    normals = vertex_normals(vertices, triangles)
    assert np.einsum("ij,ij->i", normals, outward).min() > 1 - SPHERE_NORMAL
    # So small that squares of squares of lengths vanish, and a vertex that no triangle has.
    small = vertex_normals(np.vstack([vertices * 1e-90, [[9.0, 9.0, 9.0]]]), triangles)
    assert np.abs(small[:-1] - normals).max() < SINGLE_LENGTH
    assert small[-1].tolist() == [0.0, 0.0, 1.0]


def parse_glb(path):
    """The scene and its arrays, by the letter of glTF 2.0."""
    data = path.read_bytes()
    magic, version, size, length, kind = np.frombuffer(data[:20], "<u4").tolist()
    assert (magic, version, size, kind) == (0x46546C67, 2, len(data), 0x4E4F534A)
    assert length % 4 == 0
    scene = json.loads(data[20 : 20 + length])
    body_size, body_kind = np.frombuffer(data[20 + length : 28 + length], "<u4").tolist()
    body = data[28 + length :]
    assert (body_size, body_kind) == (len(body), 0x004E4942)
    assert body_size == scene["buffers"][0]["byteLength"]
    arrays = []
    for accessor in scene["accessors"]:
        view = scene["bufferViews"][accessor["bufferView"]]
        width = {"VEC3": 3, "SCALAR": 1}[accessor["type"]]
        part = body[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        arrays.append(np.frombuffer(part, {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]).reshape(-1, width))
        assert len(arrays[-1]) == accessor["count"]
    return scene, arrays


def test_glb_is_in_metres_with_y_up(ball, tmp_path):
    export_mesh(ball, tmp_path / "ball.glb", consumer="web")
    scene, arrays = parse_glb(tmp_path / "ball.glb")
    node = scene["nodes"][0]
    x, y, z, w = node["rotation"]
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    ours = np.asarray(ball.mesh.vertices) * 1e-3
    shown = arrays[0] @ turn.T + node["translation"]
    assert np.abs(shown - ours[:, [0, 2, 1]] * [1, 1, -1]).max() < SINGLE_LENGTH * np.ptp(ours)
    assert scene["accessors"][0]["min"] == arrays[0].min(axis=0).tolist()
    assert scene["accessors"][0]["max"] == arrays[0].max(axis=0).tolist()
    assert np.abs(np.linalg.norm(arrays[1], axis=1) - 1).max() < SINGLE_LENGTH
    triangles = np.asarray(ball.mesh.triangles)
    for number, primitive in enumerate(scene["meshes"][0]["primitives"]):
        indices = arrays[primitive["indices"]].reshape(-1, 3)
        assert np.array_equal(indices, triangles[ball.labels == number])
        assert scene["materials"][primitive["material"]]["name"] == NAMES[number]
    assert len(o3d.io.read_triangle_mesh(tmp_path / "ball.glb").triangles) == len(triangles)


def parse_vtp(path):
    """Arrays by section and name, by the letter of VTK's format."""
    data = path.read_bytes()
    start = data.index(b'<AppendedData encoding="raw">\n_') + 31
    header = data[:start].decode()
    # VTK refuses any other spelling.
    assert 'byte_order="LittleEndian" header_type="UInt64"' in header
    found = {}
    for section, body in re.findall(r"<(Points|Polys|Verts|PointData|CellData)>(.*?)</\1>", header, re.DOTALL):
        for kind, name, rest in re.findall(r'<DataArray type="(\w+)" Name="(\w+)"(.*?)/>', body):
            offset = start + int(re.search(r'offset="(\d+)"', rest)[1])
            size = int.from_bytes(data[offset : offset + 8], "little")
            array = np.frombuffer(data[offset + 8 : offset + 8 + size], np.dtype(kind.lower()))
            width = re.search(r'NumberOfComponents="(\d+)"', rest)
            found[section, name] = array.reshape(-1, int(width[1])) if width else array
            end = offset + 8 + size
    assert data[end:] == b"\n</AppendedData>\n</VTKFile>\n"
    return found, header


def test_vtp_holds_all_there_is(ball, tmp_path):
    heights = np.asarray(ball.mesh.vertices)[:, 2]
    export_mesh(ball, tmp_path / "ball.vtp", consumer="paraview", scalars={"height": heights})
    found, header = parse_vtp(tmp_path / "ball.vtp")
    vertices, triangles = mesh_arrays(ball.mesh)
    assert f'NumberOfPoints="{len(vertices)}" NumberOfPolys="{len(triangles)}"' in header
    assert "lengths in mm" in header
    assert np.array_equal(found["Points", "Points"], vertices)
    assert np.array_equal(found["Polys", "connectivity"].reshape(-1, 3), triangles)
    assert np.array_equal(found["Polys", "offsets"], 3 * np.arange(1, len(triangles) + 1))
    assert np.array_equal(found["CellData", "label"], ball.labels)
    assert np.array_equal(found["PointData", "height"], heights)
    assert np.array_equal(found["PointData", "Normals"], vertex_normals(vertices, triangles))


@pytest.mark.parametrize(
    ("name", "consumer", "grouped"),
    [("a.ply", None, False), ("a.stl", None, False), ("a.stl", "openfoam", True), ("a.obj", None, True)],
)
def test_labels_read_back(ball, tmp_path, monkeypatch, name, consumer, grouped):
    monkeypatch.setattr(stl_text, "READ_SIZE", 1000)
    export_mesh(ball, tmp_path / name, consumer=consumer)
    found = read_mesh(tmp_path / name)
    assert found.names == NAMES
    assert len(found.mesh.vertices) == len(ball.mesh.vertices)
    order = np.argsort(ball.labels, kind="stable") if grouped else np.arange(len(ball.labels))
    assert np.array_equal(found.labels, ball.labels[order])
    vertices, triangles = mesh_arrays(ball.mesh)
    scale = 1e-3 if consumer else 1.0
    expected = (vertices * scale)[triangles[order]]
    seen = np.asarray(found.mesh.vertices)[np.asarray(found.mesh.triangles)]
    if (name, consumer) == ("a.stl", None):
        assert np.abs(seen - expected).max() < SINGLE_LENGTH * np.abs(FAR).max()
    else:
        assert np.array_equal(seen, expected)


def test_labels_of_a_written_leaf_read_back(ball, tmp_path):
    leaf = LabelledMesh(ball.mesh, ball.labels)
    for name in ("l.ply", "l.stl", "l.obj"):
        write_mesh(leaf, tmp_path / name)
        found = read_mesh(tmp_path / name)
        assert np.bincount(found.labels).tolist() == np.bincount(ball.labels).tolist()
        tops = np.asarray(found.mesh.vertices)[np.asarray(found.mesh.triangles)[found.labels == 0], 2]
        assert tops.mean(axis=1).min() > FAR[2] + 0.3 - SINGLE_LENGTH * np.abs(FAR).max()


def test_solids_and_groups_of_others_keep_their_names(tmp_path):
    facet = "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 {}\n endloop\nendfacet\n"
    (tmp_path / "a.stl").write_text(f"solid inlet x\n{facet.format(0)}endsolid inlet\nsolid wall\n{facet.format(1)}")
    found = read_mesh(tmp_path / "a.stl")
    assert (found.names, found.labels.tolist(), len(found.mesh.vertices)) == (("inlet", "wall"), [0, 1], 4)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ng rim\nf 1 2 3\ng hair\nf 1/1 2/2 4/3\n")
    found = read_mesh(tmp_path / "a.obj")
    assert (found.names, found.labels.tolist()) == ((*NAMES, "hair"), [2, 3])


def test_files_without_labels_are_read_as_meshes(ball, tmp_path):
    for name in ("b.ply", "b.obj", "b.stl"):
        write_mesh(ball.mesh, tmp_path / name)
        found = read_mesh(tmp_path / name)
        assert found.labels is None
        assert len(found.mesh.triangles) == len(ball.mesh.triangles)


def test_units_are_converted_or_asked_for(ball, tmp_path):
    export_mesh(ball, tmp_path / "um.ply", to_unit="um")
    found = read_mesh(tmp_path / "um.ply")
    assert found.unit == "um"
    assert np.array_equal(np.asarray(found.mesh.vertices), np.asarray(ball.mesh.vertices) * (1e-3 / 1e-6))
    with pytest.raises(UnitError, match="not known"):
        export_mesh(ball.mesh, tmp_path / "x.glb")
    with pytest.raises(UnitError, match="meters"):
        export_mesh(ball, tmp_path / "x.glb", to_unit="mm")
    with pytest.raises(UnitError, match="not known"):
        export_mesh(ball.mesh, tmp_path / "x.stl", consumer="openfoam")
    assert [path.name for path in tmp_path.iterdir()] == ["um.ply"]


def hair_thin():
    """A closed tetrahedron half a metre away, one side of which single precision cannot resolve."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1e-6]]) + [500.0, 500.0, 500.0]
    return corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]


@pytest.mark.parametrize(
    ("name", "change", "how", "words"),
    [
        ("a.stl", lambda v, t: (v, t[1:]), {"consumer": "dualsphysics"}, "closed"),
        ("a.stl", lambda v, t: (v, t[:, ::-1]), {"consumer": "dualsphysics"}, "inward"),
        ("a.stl", lambda v, t: (v, np.vstack([t[:1, ::-1], t[1:]])), {"consumer": "gmsh"}, "inconsistent"),
        ("a.stl", lambda *_: hair_thin(), {"consumer": "openfoam"}, "2 triangles collapse in single"),
        ("a.glb", lambda v, t: (v, t), {"consumer": "openfoam"}, "unknown suffix"),
        ("a.ply", lambda v, t: (v, t), {"consumer": "excel"}, "unknown 'excel'"),
        ("a.ply", lambda v, t: (v, t), {"labels": [0, 1]}, "one whole number per triangle"),
        ("a.ply", lambda v, t: (v, t), {"labels": np.full(1000, 7)}, "0 to 2"),
        ("a.ply", lambda v, t: (v, t), {"scalars": {"depth": [1.0]}}, "depth"),
        ("a.ply", lambda v, t: (v, t), {"scalars": {"nx": [1.0]}}, "second column"),
        ("a.ply", lambda v, _: (v, np.empty((0, 3))), {}, "no triangles"),
    ],
)
def test_what_a_program_cannot_take_is_refused_and_leaves_nothing(ball, tmp_path, name, change, how, words):
    vertices, triangles = mesh_arrays(ball.mesh)
    if np.shape(how.get("labels")) == (1000,):
        how = {"labels": np.full(len(triangles), 7)}
    with pytest.raises(InputError, match=words):
        export_mesh(change(vertices, triangles), tmp_path / name, unit="mm", **how)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.stl", b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nendloop\nendfacet\n", "three corners"),
        ("a.stl", b"solid x\nendsolid x\n", "no triangle"),
        (
            "a.ply",
            b"ply\nformat ascii 1.0\nelement vertex 0\nelement face 0\nproperty uchar label\nend_header\n",
            "x, y and z",
        ),
    ],
)
def test_damaged_files_are_refused(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_mesh(tmp_path / name)


def test_a_labelled_ply_that_was_cut_off_is_refused(ball, tmp_path):
    export_mesh(ball, tmp_path / "a.ply")
    (tmp_path / "a.ply").write_bytes((tmp_path / "a.ply").read_bytes()[:-5])
    with pytest.raises(InputError, match="cut off"):
        read_mesh(tmp_path / "a.ply")
