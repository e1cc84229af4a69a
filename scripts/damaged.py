"""Small whole files of every format that is read, and ways to damage them, for `fuzz.py` and tests/io/test_fuzzed.py.

An edit is three numbers (kind, place, value), so that the same list of edits damages a file in the same way anywhere.
"""

import gzip
import json
import struct
import zlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

Edit = tuple[int, int, int]
Arrays = list[np.ndarray[Any, Any]]

MOST_EDITS = 4
HEAD = 400
"""Bytes, as a rule the header, in which every other edit falls."""
WORDS = (
    b"0", b"-1", b"1", b"3", b"255", b"65536", b"1000000000", b"2147483647", b"4294967295", b"9223372036854775807",
    b"99999999999999999999", b"-9223372036854775808", b"1e9", b"1e308", b"-1e999", b"nan", b"inf", b"0x41", b"", b"abc",
    "٣".encode(), b"1_000", b"%s%n", b"../../../etc/passwd", b"/dev/zero", b"1.5", b"5e-324",
)  # fmt: skip
"""What takes the place of a number of a text."""
NUMBERS = (0, 1, 2, 3, 7, 255, 256, 65535, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**63, 2**64 - 1)
"""What takes the place of four or eight bytes."""
FLOATS = (np.nan, np.inf, -np.inf, 1e308, 5e-324, -0.0, 1e38)


def damaged(content: bytes, edits: Iterable[Edit], other: bytes = b"") -> bytes:
    """Return a file with all edits made; `other` is what ends of files are taken from."""
    data = bytearray(content)
    for kind, place, value in edits:
        EDITS[kind % len(EDITS)](data, place, value, other)
    return bytes(data)


def _at(data: bytearray, place: int) -> int:
    """Return a place in the file; every other one is in its head."""
    size = min(len(data), HEAD) if place & 1 else len(data)
    return (place >> 1) % size if size else 0


def _flip(data: bytearray, place: int, value: int, other: bytes) -> None:
    del other
    if data:
        data[_at(data, place)] ^= 1 << value % 8


def _put_byte(data: bytearray, place: int, value: int, other: bytes) -> None:
    del other
    if data:
        data[_at(data, place)] = value % 256


def _cut(data: bytearray, place: int, value: int, other: bytes) -> None:
    del value, other
    del data[_at(data, place) :]


def _drop(data: bytearray, place: int, value: int, other: bytes) -> None:
    del other
    start = _at(data, place)
    del data[start : start + value % 64]


def _repeat(data: bytearray, place: int, value: int, other: bytes) -> None:
    del other
    start = _at(data, place)
    data[start:start] = data[start : start + value % 256]


def _replace_word(data: bytearray, place: int, value: int, other: bytes) -> None:
    del other
    words, start = bytes(data).split(), 0
    if words and len(words) < 100_000:
        chosen = _at(bytearray(len(words)), place)
        for word in words[: chosen + 1]:
            start = data.index(word, start)
            end = start + len(word)
            start, last = end, start
        data[last:end] = WORDS[value % len(WORDS)]


def _put_number(data: bytearray, place: int, value: int, other: bytes) -> None:
    del other
    start, order, size = _at(data, place), "<>"[value & 1], (2, 4, 8)[(value >> 1) % 3]
    start -= start % size if value & 8 else 0
    number = NUMBERS[(value >> 4) % len(NUMBERS)] % (1 << 8 * size)
    data[start : start + size] = struct.pack(order + {2: "H", 4: "I", 8: "Q"}[size], number)


def _put_float(data: bytearray, place: int, value: int, other: bytes) -> None:
    del other
    start, order, size = _at(data, place), "<>"[value & 1], (4, 8)[(value >> 1) % 2]
    start -= start % 4
    with np.errstate(over="ignore"):
        data[start : start + size] = np.array(FLOATS[(value >> 2) % len(FLOATS)], f"{order}f{size}").tobytes()


def _move_line(data: bytearray, place: int, value: int, other: bytes) -> None:
    del other
    lines = bytes(data).split(b"\n")
    line = lines[_at(bytearray(len(lines)), place)]
    lines.insert(_at(bytearray(len(lines)), value), line)
    data[:] = b"\n".join(lines)


def _insert(data: bytearray, place: int, value: int, other: bytes) -> None:
    del other
    start = _at(data, place)
    data[start:start] = np.random.default_rng(value).bytes(value % 16) if value & 16 else bytes(value % 16)


def _splice(data: bytearray, place: int, value: int, other: bytes) -> None:
    if other:
        data[_at(data, place) :] = other[_at(bytearray(other), value) :]


EDITS: tuple[Callable[[bytearray, int, int, bytes], None], ...] = (
    _flip, _put_byte, _cut, _drop, _repeat, _replace_word, _replace_word, _put_number, _put_number, _put_float,
    _move_line, _insert, _splice,
)  # fmt: skip
"""Kinds of edits; what finds most stands twice."""


# --- formats with sums, which hide most damage from what comes after: mended, every other time


def mended_model(content: bytes, edits: Iterable[Edit], other: bytes = b"") -> bytes:
    """Damage header or arrays of a model file, and make its sums right again."""
    from o3dleaf.io.model_file import PREFIX  # noqa: PLC0415 - heavy

    edits = list(edits)
    magic, length, _ = PREFIX.unpack(content[: PREFIX.size])
    text, data = content[PREFIX.size :][:length], content[PREFIX.size + length :]
    way = edits[0][2] % 4 if edits else 0
    if way == 0:
        return damaged(content, edits, other)
    if way == 1:
        text = damaged(text.rstrip(), edits)
    else:
        data = damaged(data, [edit for edit in edits if edit[0] % len(EDITS) in {0, 1, 7, 8, 9}])
        header = json.loads(text)
        for block in header["arrays"]:
            size = np.dtype(block["dtype"]).itemsize * int(np.prod(block["shape"]))
            block["crc"] = zlib.crc32(data[block["offset"] :][:size])
        text = json.dumps(header).encode()
    text += b" " * (-(PREFIX.size + len(text)) % 64)
    return PREFIX.pack(magic, len(text), zlib.crc32(text)) + text + data


def mended_gzip(content: bytes, edits: Iterable[Edit], other: bytes = b"") -> bytes:
    """Damage what is packed, every other time, or the pack."""
    edits = list(edits)
    if not content.startswith(b"\x1f\x8b") or (edits and edits[0][2] % 2):
        return damaged(content, edits, other)
    return gzip.compress(damaged(gzip.decompress(content), edits), mtime=0)


PAGE, PAGE_SUM = 1024, 4
"""Of E57: bytes of a page, and of the sum at its end."""


def mended_e57(content: bytes, edits: Iterable[Edit], other: bytes = b"") -> bytes:
    """Damage an E57 file, and give its pages the sums that they have now."""
    data = bytearray(damaged(content, edits, other))
    for start in range(0, len(data) - PAGE + 1, PAGE):
        end = start + PAGE - PAGE_SUM
        data[end : end + PAGE_SUM] = struct.pack(">I", _crc32c(bytes(data[start:end])))
    return bytes(data)


@cache
def _crc_table() -> tuple[int, ...]:
    rows = []
    for number in range(256):
        for _ in range(8):
            number = number >> 1 ^ (0x82F63B78 if number & 1 else 0)  # noqa: PLW2901
        rows.append(number)
    return tuple(rows)


def _crc32c(data: bytes) -> int:
    table, crc = _crc_table(), 0xFFFFFFFF
    for byte in data:
        crc = table[(crc ^ byte) & 0xFF] ^ crc >> 8
    return crc ^ 0xFFFFFFFF


# --- whole files

POINTS = np.random.default_rng(0).uniform(-1, 1, (24, 3)).round(4)


def _mesh() -> Any:
    import open3d as o3d  # noqa: PLC0415 - heavy

    mesh = o3d.geometry.TriangleMesh.create_octahedron()
    mesh.compute_vertex_normals()
    mesh.paint_uniform_color([0.2, 0.5, 0.1])
    return mesh


def _cloud(*, rich: bool = True) -> Any:
    import open3d as o3d  # noqa: PLC0415 - heavy

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    if rich:
        cloud.normals = o3d.utility.Vector3dVector(POINTS / np.linalg.norm(POINTS, axis=1)[:, np.newaxis])
        cloud.colors = o3d.utility.Vector3dVector(np.abs(POINTS))
    return cloud


def _labelled() -> Any:
    from o3dleaf.io.labelled_mesh import LabelledMesh  # noqa: PLC0415 - heavy

    return LabelledMesh(_mesh(), np.arange(8, dtype=np.uint8) % 3, unit="mm")


def make_ply_points(folder: Path) -> None:
    """Write points as PLY, binary and as text, with and without normals."""
    import open3d as o3d  # noqa: PLC0415 - heavy

    o3d.io.write_point_cloud(folder / "binary.ply", _cloud())
    o3d.io.write_point_cloud(folder / "text.ply", _cloud(), write_ascii=True)
    o3d.io.write_point_cloud(folder / "bare.ply", _cloud(rich=False))
    (folder / "big.ply").write_bytes(
        b"ply\nformat binary_big_endian 1.0\nelement vertex 9\nproperty float x\nproperty float y\nproperty float z\n"
        b"property list uchar int more\nend_header\n"
        + b"".join(struct.pack(">fffBii", *point, 2, 5, 6) for point in POINTS[:9])
    )


def make_ply_meshes(folder: Path) -> None:
    """Write meshes as PLY: Open3D's, ours with labels, of quadrilaterals."""
    import open3d as o3d  # noqa: PLC0415 - heavy

    from o3dleaf.io.triangle_mesh import write_mesh  # noqa: PLC0415 - heavy

    o3d.io.write_triangle_mesh(folder / "binary.ply", _mesh())
    o3d.io.write_triangle_mesh(folder / "text.ply", _mesh(), write_ascii=True)
    write_mesh(_labelled(), folder / "labels.ply")
    (folder / "quads.ply").write_text(
        "ply\nformat ascii 1.0\ncomment unit mm\nelement vertex 4\nproperty double x\nproperty double y\n"
        "property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
    )


def make_obj(folder: Path) -> None:
    """Write meshes as OBJ."""
    import open3d as o3d  # noqa: PLC0415 - heavy

    from o3dleaf.io.triangle_mesh import write_mesh  # noqa: PLC0415 - heavy

    o3d.io.write_triangle_mesh(folder / "plain.obj", _mesh())
    write_mesh(_labelled(), folder / "labels.obj")
    (folder / "quads.obj").write_text(
        "mtllib quads.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 2 2\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n"
        "usemtl a\nf 1/1/1 2/2/1 3/3/1 4/4/1\nf -1 -2 -3\nf 1 2 3 4 5\ns off\ng one two\n"
    )


def make_off(folder: Path) -> None:
    """Write meshes as OFF."""
    import open3d as o3d  # noqa: PLC0415 - heavy

    mesh = _mesh()
    o3d.io.write_triangle_mesh(folder / "colors.off", mesh)
    (folder / "quads.off").write_text("OFF\n# a comment\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    (folder / "plain.off").write_text("OFF\n3 1 3\n0 0 0\n1 0 0\n1 1 0\n3 0 1 2\n")
    (folder / "normals.off").write_text("NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n3 0 1 2\n")


def make_stl(folder: Path) -> None:
    """Write meshes as STL: binary, ours with labels, text."""
    import open3d as o3d  # noqa: PLC0415 - heavy

    from o3dleaf.io.mesh_data import MeshData  # noqa: PLC0415 - heavy
    from o3dleaf.io.stl_text import write_stl_text  # noqa: PLC0415 - heavy
    from o3dleaf.io.triangle_mesh import write_mesh  # noqa: PLC0415 - heavy

    o3d.io.write_triangle_mesh(folder / "binary.stl", _mesh())
    write_mesh(_labelled(), folder / "labels.stl")
    with (folder / "text.stl").open("wb") as out:
        write_stl_text(out, MeshData.of(_labelled()), "leaf")


def make_pcd(folder: Path) -> None:
    """Write points as PCD: text, binary, compressed."""
    import open3d as o3d  # noqa: PLC0415 - heavy

    o3d.io.write_point_cloud(folder / "text.pcd", _cloud(), write_ascii=True)
    o3d.io.write_point_cloud(folder / "binary.pcd", _cloud())
    o3d.io.write_point_cloud(folder / "compressed.pcd", _cloud(), compressed=True)
    o3d.io.write_point_cloud(folder / "bare.pcd", _cloud(rich=False))


def make_columns(folder: Path) -> None:
    """Write points as XYZ, XYZN, XYZRGB and PTS."""
    import open3d as o3d  # noqa: PLC0415 - heavy

    for suffix in ("xyz", "xyzn", "xyzrgb", "pts"):
        o3d.io.write_point_cloud(folder / f"points.{suffix}", _cloud())


def make_text(folder: Path) -> None:
    """Write points as TXT, CSV and ASC."""
    rows = [" ".join(map(str, row)) for row in POINTS]
    (folder / "plain.txt").write_text("\n".join(rows))
    (folder / "named.txt").write_text("// X Y Z Nx Ny Nz\n" + "\n".join(f"{row} 0 0 1" for row in rows))
    (folder / "comma.csv").write_text("x,y,z,r,g,b\n" + "\n".join(row.replace(" ", ",") + ",1,2,255" for row in rows))
    (folder / "decimal.asc").write_text("x;y;z\n" + "\n".join(row.replace(" ", ";").replace(".", ",") for row in rows))


def make_las(folder: Path) -> None:
    """Write points as LAS and LAZ, with colors and normals."""
    import laspy  # noqa: PLC0415 - an extra

    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales = np.full(3, 1e-4)
    header.add_extra_dims([laspy.ExtraBytesParams(name, "f4") for name in ("nx", "ny", "nz")])
    cloud = laspy.LasData(header)
    cloud.xyz = POINTS
    cloud.red, cloud.green, cloud.blue = (np.abs(POINTS) * 65535).astype(np.uint16).T
    cloud.nx, cloud.ny, cloud.nz = POINTS.T
    for name in ("points.las", "points.laz"):
        cloud.write(folder / name)
    newer = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    newer.xyz = POINTS
    newer.write(folder / "newer.las")


def make_e57(folder: Path) -> None:
    """Write points as E57."""
    import pye57  # noqa: PLC0415 - an extra

    file = pye57.E57(str(folder / "points.e57"), mode="w")
    axes = ("cartesianX", "cartesianY", "cartesianZ")
    file.write_scan_raw(dict(zip(axes, np.ascontiguousarray(POINTS.T), strict=True)))
    file.close()


def make_tiff(folder: Path) -> None:
    """Write voxels as TIFF: ImageJ's, OME's, compressed, of one page."""
    import tifffile  # noqa: PLC0415 - heavy

    voxels = _voxels().astype(np.uint8)
    tifffile.imwrite(folder / "imagej.tif", voxels, imagej=True, metadata={"spacing": 2.0, "unit": "um", "axes": "ZYX"})
    sizes = {f"PhysicalSize{axis}": 2.0 for axis in "XYZ"}
    tifffile.imwrite(folder / "ome.ome.tif", voxels, ome=True, metadata={"axes": "ZYX", **sizes})
    tifffile.imwrite(folder / "packed.tif", voxels, compression="zlib", photometric="minisblack")
    tifffile.imwrite(folder / "pages.tif", voxels.astype(np.uint16), photometric="minisblack", metadata=None)
    tifffile.imwrite(folder / "tiles.tif", voxels, tile=(16, 16), bigtiff=True, photometric="minisblack")


def _voxels() -> np.ndarray[Any, Any]:
    return (np.arange(4 * 5 * 6).reshape(4, 5, 6) * 2).astype(np.uint8)


def make_npy(folder: Path) -> None:
    """Write voxels as NPY."""
    np.save(folder / "bytes.npy", _voxels())
    np.save(folder / "floats.npy", np.asfortranarray(_voxels().astype(np.float32)))


def make_itk(folder: Path) -> None:
    """Write voxels as NRRD, MetaImage and NIfTI, and headers with their numbers in another file."""
    import SimpleITK  # noqa: PLC0415 - an extra

    image = SimpleITK.GetImageFromArray(_voxels())
    image.SetSpacing([0.1, 0.2, 0.3])
    for name in ("plain.nrrd", "plain.mha", "plain.nii", "packed.nii.gz"):
        SimpleITK.WriteImage(image, str(folder / name))
    for name in ("packed.nrrd", "packed.mha"):
        SimpleITK.WriteImage(image, str(folder / name), useCompression=True)
    (folder / "apart.mhd").write_text(
        "ObjectType = Image\nNDims = 3\nDimSize = 6 5 4\nElementType = MET_UCHAR\nElementSpacing = 0.1 0.1 0.1\n"
        "ElementDataFile = apart.raw\n"
    )
    (folder / "apart.nhdr").write_text(
        "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 6 5 4\nspacings: 0.1 0.1 0.1\nencoding: raw\n"
        "data file: apart.raw\n"
    )
    (folder / "apart.raw").write_bytes(_voxels().tobytes())


def make_models(folder: Path) -> None:
    """Save models: an interpolant of one ball, one of some balls, of moving least squares, of creases."""
    import o3dleaf as o3l  # noqa: PLC0415 - heavy

    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0, -1], [4, 3, 1], (60, 3))
    values = np.sin(points[:, 0]) - points[:, 2]
    normals = np.column_stack([-np.cos(points[:, 0]), np.zeros(60), np.ones(60)])
    normals /= np.linalg.norm(normals, axis=1)[:, np.newaxis]
    o3l.RBFInterpolant.fit(points[:20], values[:20]).save(folder / "single.o3l")
    o3l.PUInterpolant.fit(points, values, points_per_ball=(15, 30), unit="um").save(folder / "balls.o3l")
    o3l.PUInterpolant.fit_oriented(points, normals, local=o3l.MovingLeastSquares()).save(folder / "mls.o3l")
    o3l.PUInterpolant.fit_oriented(points, normals, local=o3l.CreasedSplines()).save(folder / "creases.o3l")


# --- readers


def read_cloud(path: Path) -> Arrays:
    """Read points."""
    from o3dleaf.io.point_cloud import read_point_cloud  # noqa: PLC0415 - heavy

    cloud = read_point_cloud(path, least=1, finite=False)
    return [np.asarray(cloud.points), np.asarray(cloud.normals), np.asarray(cloud.colors)]


def read_meshes(path: Path) -> Arrays:
    """Read a mesh in both ways."""
    from o3dleaf.core.errors import InputError  # noqa: PLC0415 - heavy
    from o3dleaf.io.triangle_mesh import read_mesh, read_triangle_mesh  # noqa: PLC0415 - heavy

    arrays, refused = [], []
    for read in (lambda: read_mesh(path).mesh, lambda: read_triangle_mesh(path)):
        try:
            mesh = read()
        except InputError as error:
            refused.append(error)
            continue
        vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
        if not (len(triangles) and triangles.min() >= 0 and triangles.max() < len(vertices)):
            raise AssertionError("triangles lead out of the vertices")
        arrays += [vertices, triangles]
    if len(refused) == 2:
        raise refused[0]
    return arrays


def read_voxels(path: Path) -> Arrays:
    """Read a volume."""
    from o3dleaf.core.errors import InputError  # noqa: PLC0415 - heavy
    from o3dleaf.leaf.ct.formats.read import read_volume  # noqa: PLC0415 - heavy

    volume = read_volume(path, spacing=1.0, unit="um")
    if path.suffix != ".npy":
        with suppress(InputError):
            read_volume(path)  # by the spacing that it states
    return [np.array(volume.data)]


def read_models(path: Path) -> Arrays:
    """Load a model and ask it for values."""
    from o3dleaf.core.errors import O3DLeafError  # noqa: PLC0415 - heavy
    from o3dleaf.leaf.saved.models import load  # noqa: PLC0415 - heavy

    model = load(path)
    queries = np.random.default_rng(1).uniform(0, 3, (5, 3))
    try:
        with np.errstate(all="ignore"):
            return [np.asarray(model(queries)), np.asarray(model.gradient(queries))]
    except O3DLeafError:
        return []


@dataclass(frozen=True)
class Reader:
    """What makes whole files, reads a file, and damages its content."""

    make: Callable[[Path], None]
    read: Callable[[Path], Arrays]
    damage: Callable[..., bytes] = damaged


READERS = {
    "model": Reader(make_models, read_models, mended_model),
    "ply-points": Reader(make_ply_points, read_cloud),
    "ply-mesh": Reader(make_ply_meshes, read_meshes),
    "obj": Reader(make_obj, read_meshes),
    "off": Reader(make_off, read_meshes),
    "stl": Reader(make_stl, read_meshes),
    "pcd": Reader(make_pcd, read_cloud),
    "columns": Reader(make_columns, read_cloud),
    "text": Reader(make_text, read_cloud),
    "las": Reader(make_las, read_cloud),
    "e57": Reader(make_e57, read_cloud, mended_e57),
    "tiff": Reader(make_tiff, read_voxels),
    "npy": Reader(make_npy, read_voxels),
    "itk": Reader(make_itk, read_voxels, mended_gzip),
}
"""By the names that `fuzz.py` knows."""
