"""Small whole files of every format that is read, and ways to damage them, for `fuzz.py` and tests/io/test_fuzzed.py.

An edit is three numbers (kind, place, value), so that the same list of edits damages a file in the same way anywhere.
"""

import gzip
import io
import json
import shutil
import struct
import tempfile
import zipfile
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

MAX_EDITS = 4
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
    from o3dleaf.io.models.model_file import PREFIX  # noqa: PLC0415 - heavy

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


def mended_zip(content: bytes, edits: Iterable[Edit], other: bytes = b"") -> bytes:
    """Damage an array in an archive and pack it anew, with a right sum, three times in four; or the archive."""
    edits = list(edits)
    if edits and edits[0][2] % 4 == 0:
        return damaged(content, edits, other)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = [(entry, archive.read(entry)) for entry in archive.infolist()]
    chosen = edits[0][2] // 4 % len(entries) if edits else 0
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for k, (entry, data) in enumerate(entries):
            archive.writestr(entry, damaged(data, edits) if k == chosen else data, entry.compress_type)
    return packed.getvalue()


PNG_START = 8
"""Bytes before the first chunk of a PNG."""


def mended_png(content: bytes, edits: Iterable[Edit], other: bytes = b"") -> bytes:
    """Damage chunks of a PNG, pixels as they are or before they are packed, and give them right sums; or the file."""
    edits = list(edits)
    if not edits or edits[0][2] % 4 == 0:
        return damaged(content, edits, other)
    chunks, at = [], PNG_START
    while at < len(content):
        (length,) = struct.unpack_from(">I", content, at)
        chunks.append((content[at + 4 : at + 8], content[at + 8 : at + 8 + length]))
        at += 12 + length
    chosen = edits[0][2] // 4 % len(chunks)
    name, data = chunks[chosen]
    if name == b"IDAT" and edits[0][2] & 64:
        data = zlib.compress(damaged(zlib.decompress(data), edits))
    else:
        data = damaged(data, edits)
    chunks[chosen] = name, data
    return content[:PNG_START] + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks
    )


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


def _scan() -> np.ndarray[Any, Any]:
    """Return (z, y, x) voxels, as a scanner stores them."""
    return _voxels().astype(np.int16)


def make_npz(folder: Path) -> None:
    """Write voxels as NPZ, packed and not, beside arrays that are none."""
    np.savez(folder / "plain.npz", scan=_scan(), log=np.arange(4))
    np.savez_compressed(folder / "packed.npz", scan=np.asfortranarray(_scan().astype(np.float32)))


def make_png(folder: Path) -> None:
    """Write a slice as PNG: of 8 and of 16 bits, of one bit, with chunks beside the pixels."""
    from PIL import Image  # noqa: PLC0415 - heavy

    page = np.random.default_rng(0).integers(0, 64, (24, 20)).astype(np.uint8) * 4
    for name, pixels in {"bytes.png": page, "words.png": page.astype(np.uint16) * 256}.items():
        Image.fromarray(pixels).save(folder / name)
    Image.fromarray(page > 100).save(folder / "bits.png")
    Image.fromarray(page).save(folder / "facts.png", dpi=(300, 300), icc_profile=b"none", transparency=3)


def make_hdf5(folder: Path) -> None:
    """Write voxels as HDF5: in one piece, in chunks, packed, of the newer layout."""
    import h5py  # noqa: PLC0415 - an extra

    chunked = {"chunks": (2, 3, 4), "compression": "gzip", "shuffle": True, "fletcher32": True}
    for name, newest, options in (
        ("whole.h5", False, {}),
        ("newer.h5", True, {}),
        ("compact.h5", True, {"compact": True}),
        ("packed.h5", False, chunked),
        ("chunks.h5", True, chunked | {"compression": "lzf"}),
        ("scaled.h5", True, {"chunks": (4, 5, 6), "scaleoffset": 0}),
    ):
        with h5py.File(folder / name, "w", libver="latest" if newest else "earliest") as file:
            place = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            if options.pop("compact", False):
                place.set_layout(h5py.h5d.COMPACT)
                scan = h5py.Dataset(
                    h5py.h5d.create(
                        file.id, b"scan", h5py.h5t.NATIVE_INT16, h5py.h5s.create_simple(_scan().shape), place
                    )
                )
                scan[...] = _scan()
            else:
                scan = file.create_dataset("scan", data=_scan(), **options)
            scan.attrs["element_size_um"] = [3.0, 2.0, 1.0]
            if name == "packed.h5":
                scan.attrs["note"] = "of the leaf"


def make_isq(folder: Path) -> None:
    """Write voxels as ISQ, whose header is described by Scanco."""
    voxels = _scan()
    head = np.zeros(128, dtype="<i4")
    head[:4] = np.frombuffer(b"CTDATA-HEADER_V1", dtype="<i4")
    head[4] = 3
    head[5] = head[6] = voxels.nbytes // 512 + 1
    head[11:14] = voxels.shape[::-1]
    head[14:17] = [60, 50, 40]
    (folder / "plain.isq").write_bytes(head.tobytes() + voxels.astype("<i2").tobytes())
    head[127] = 1  # one block of 512 bytes more before the voxels
    (folder / "offset.isq").write_bytes(head.tobytes() + bytes(512) + voxels.astype("<i2").tobytes())


def make_aim(folder: Path) -> None:
    """Write voxels as AIM: words, runs of bytes, words of the version before."""
    import py_aimio  # noqa: PLC0415 - for tests alone

    facts = {"element_size": (0.01, 0.02, 0.03), "dimensions": _scan().shape[::-1]}
    py_aimio.write_aim(str(folder / "words.aim"), _scan(), facts)
    py_aimio.write_aim(str(folder / "floats.aim"), _scan().astype(np.float32), facts)
    py_aimio.write_aim(str(folder / "runs.aim"), (_scan() // 40).astype(np.int8), facts)
    head = struct.pack("<6i", 16, 0, 0, 0, 0, 0x20002) + struct.pack("<12i", 1, 2, 3, *_scan().shape[::-1], *[0] * 6)
    head += bytes(36) + struct.pack("<3f", 0.01, 0.02, 0.03) + bytes(20)
    parts = struct.pack("<5i", 20, len(head), 0, _scan().nbytes, 0)
    (folder / "old.aim").write_bytes(parts + head + _scan().tobytes())


def _write_slice(path: Path, k: int, way: str | None = None) -> None:
    """Write a slice of a series as DICOM, packed in some way."""
    import SimpleITK  # noqa: PLC0415 - an extra

    pages = np.arange(2 * 24 * 20, dtype=np.int16).reshape(2, 24, 20) * 37 % 1001 - 200
    image = SimpleITK.GetImageFromArray(pages[k : k + 1])
    image.SetSpacing([0.1, 0.2, 0.3])
    facts = {
        "0008|0060": "CT", "0020|000e": "1.2.826.0.1.3680043.2.1125.1", "0020|0037": "1\\0\\0\\0\\1\\0",
        "0020|0032": f"0.5\\0.25\\{0.3 * k}", "0020|0013": str(k), "0018|0050": "0.3",
    }  # fmt: skip
    for key, value in facts.items():
        image.SetMetaData(key, value)
    writer = SimpleITK.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    if way is not None:
        writer.SetUseCompression(True)
        writer.SetCompressor(way)
    writer.SetFileName(str(path))
    writer.Execute(image)


def make_dicom(folder: Path) -> None:
    """Write a slice as DICOM, with and without the kinds of values and a sequence, and the next one, whole, beside."""
    _write_slice(folder / "plain.dcm", 0)
    _write_slice(folder / "next.dcm", 1)
    (folder / "next.dcm").rename(folder / "next.raw")

    def element(group: int, number: int, value: bytes, length: int | None = None) -> bytes:
        return struct.pack("<2HI", group, number, len(value) if length is None else length) + value

    def explicit(number: int, kind: bytes, value: bytes) -> bytes:
        return struct.pack("<2H2sH", 2, number, kind, len(value)) + value

    head = explicit(2, b"UI", b"1.2.840.10008.5.1.4.1.1.2\0") + explicit(3, b"UI", b"1.2.3.4\0")
    head += explicit(16, b"UI", b"1.2.840.10008.1.2\0")
    inner = element(8, 0x1155, b"1.2.3.9\0")
    items = element(0xFFFE, 0xE000, inner) + element(0xFFFE, 0xE000, inner + element(0xFFFE, 0xE00D, b""), 0xFFFFFFFF)
    counts = {2: 1, 0x10: 24, 0x11: 20, 0x100: 16, 0x101: 16, 0x102: 15, 0x103: 1}
    (folder / "implicit.dcm").write_bytes(
        bytes(128)
        + b"DICM"
        + explicit(0, b"UL", struct.pack("<I", len(head)))
        + head
        + element(8, 0x16, b"1.2.840.10008.5.1.4.1.1.2\0")
        + element(8, 0x18, b"1.2.3.4\0")
        + element(8, 0x60, b"CT")
        + element(8, 0x1140, items + element(0xFFFE, 0xE0DD, b""), 0xFFFFFFFF)
        + element(0x20, 0xE, b"1.2.826.0.1.3680043.2.1125.1")
        + element(0x20, 0x32, b"0.5\\0.25\\0 ")
        + element(0x20, 0x37, b"1\\0\\0\\0\\1\\0 ")
        + b"".join(element(0x28, number, struct.pack("<H", count)) for number, count in counts.items())
        + element(0x7FE0, 0x10, (np.arange(480) % 301).astype("<i2").tobytes())
    )


def make_packed_dicom(folder: Path) -> None:
    """Write a slice as DICOM, packed in two ways, and the next one, whole, beside."""
    _write_slice(folder / "lossless.dcm", 0, "JPEG")
    _write_slice(folder / "wavelet.dcm", 0, "JPEG2000")
    _write_slice(folder / "next.dcm", 1)
    (folder / "next.dcm").rename(folder / "next.raw")


def make_zarr(folder: Path) -> None:
    """Write voxels as OME-Zarr of both versions, of whose files one is damaged; all, whole, are in a zip beside."""
    import zarr  # noqa: PLC0415 - an extra

    scale = [{"type": "scale", "scale": [1.0, 3.0, 2.0, 1.0]}, {"type": "translation", "translation": [0, 1, 2, 3.0]}]
    axes = [{"name": "c", "type": "channel"}]
    axes += [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    image = {"axes": axes, "datasets": [{"path": "0", "coordinateTransformations": scale}]}
    for version, name in ((2, "v2"), (3, "v3")):
        with tempfile.TemporaryDirectory() as scratch:
            place = Path(scratch) / "a.zarr"
            group = zarr.create_group(place, zarr_format=version)
            voxels = np.random.default_rng(0).integers(0, 3000, (1, 12, 14, 16)).astype(np.int16)
            group.create_array("0", data=voxels, chunks=(1, 8, 14, 16))
            group.create_array("plain", data=voxels, chunks=(1, 8, 14, 16), compressors=None)
            group.attrs.update(
                {"ome": {"version": "0.5", "multiscales": [image]}} if version == 3 else {"multiscales": [image]}
            )
            files = sorted(file for file in place.rglob("*") if file.is_file())
            with zipfile.ZipFile(folder / f"{name}.raw", "w") as archive:
                for file in files:
                    archive.write(file, file.relative_to(place))
            for k, file in enumerate(files):
                (folder / f"{name}.{k}").write_bytes(file.read_bytes())


def make_lattice_points(folder: Path) -> None:
    """Write voxels as points with an intensity, as PLY of numbers and of text."""
    places = np.argwhere(np.ones((3, 4, 5))) * (0.5, 0.25, 0.125)
    head = f"element vertex {len(places)}\n" + "".join(f"property float {name}\n" for name in "xyzf") + "end_header\n"
    rows = np.column_stack([places, np.arange(len(places)) % 17]).astype("<f4")
    (folder / "binary.ply").write_bytes(f"ply\nformat binary_little_endian 1.0\n{head}".encode() + rows.tobytes())
    lines = "".join(" ".join(f"{number:g}" for number in row) + "\n" for row in rows[::-1])
    (folder / "text.ply").write_text(f"ply\nformat ascii 1.0\n{head}{lines}")


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
    from o3dleaf.io.clouds.counts import count_points  # noqa: PLC0415 - heavy
    from o3dleaf.io.point_cloud import read_point_cloud  # noqa: PLC0415 - heavy

    count_points(path)
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
    """Count the voxels of a volume, and read it."""
    from o3dleaf.core.errors import InputError  # noqa: PLC0415 - heavy
    from o3dleaf.leaf.ct.formats.counts import count_voxels  # noqa: PLC0415 - heavy
    from o3dleaf.leaf.ct.formats.read import read_volume  # noqa: PLC0415 - heavy

    count_voxels(path)
    volume = read_volume(path, spacing=1.0, unit="um")
    if path.suffix != ".npy":
        with suppress(InputError):
            read_volume(path)  # by the spacing that it states
    return [np.array(volume.data)]


def read_slices(path: Path) -> Arrays:
    """Read a slice in a folder of it and a copy."""
    folder = path.parent / "slices"
    folder.mkdir(exist_ok=True)
    for name in ("a_1", "a_2"):
        (folder / f"{name}{path.suffix}").write_bytes(path.read_bytes())
    return read_voxels(folder)


def read_dicom(path: Path) -> Arrays:
    """Read a slice, and a folder of it and the whole one that follows it."""
    from o3dleaf.core.errors import InputError  # noqa: PLC0415 - heavy

    folder = path.parent / "series"
    folder.mkdir(exist_ok=True)
    (folder / "a_1.dcm").write_bytes(path.read_bytes())
    (folder / "a_2.dcm").write_bytes((path.parent / "next.raw").read_bytes())
    arrays, refused = [], []
    for place in (path, folder):
        try:
            arrays += read_voxels(place)
        except InputError as error:
            refused.append(error)
    if len(refused) == 2:
        raise refused[0]
    return arrays


def read_zarr(path: Path) -> Arrays:
    """Read a Zarr folder of which one file is this one."""
    place = path.parent / "place.zarr"
    shutil.rmtree(place, ignore_errors=True)
    with zipfile.ZipFile(path.parent / f"{path.stem}.raw") as archive:
        archive.extractall(place)
        name = sorted(archive.namelist(), key=Path)[int(path.suffix[1:])]
    (place / name).write_bytes(path.read_bytes())
    from o3dleaf.leaf.ct.formats.read import read_volume  # noqa: PLC0415 - heavy

    wanted = "dataset=plain" if name.startswith("plain") else None
    return [np.array(read_volume(place, layout=wanted, spacing=1.0 if wanted else None, unit="um").data)]


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
    "dicom": Reader(make_dicom, read_dicom),
    "packed-dicom": Reader(make_packed_dicom, read_dicom),
    "isq": Reader(make_isq, read_voxels),
    "aim": Reader(make_aim, read_voxels),
    "hdf5": Reader(make_hdf5, read_voxels),
    "zarr": Reader(make_zarr, read_zarr),
    "npz": Reader(make_npz, read_voxels, mended_zip),
    "png": Reader(make_png, read_slices, mended_png),
    "lattice-points": Reader(make_lattice_points, read_voxels),
}
"""By the names that `fuzz.py` knows."""
