"""Binary STL: single precision by the format's definition, a label in its triangle's attribute; corners joined."""

from pathlib import Path
from typing import IO

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.atomic_files import claim
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, build_mesh, mesh_arrays
from o3dleaf.core.parallel import blocks
from o3dleaf.io.labelled_mesh import name_labels
from o3dleaf.io.mesh_data import MeshBlocks, MeshData, face_vectors, unit_rows

TRIANGLE = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("label", "<u2")])
"""A triangle, packed."""
HEADER = 80
"""Bytes for words."""
START = HEADER + 4
"""Offset of the first triangle, behind their number."""
OURS = b"o3dleaf"
"""First word of files whose attributes are labels."""
BLOCK = 1 << 17
"""Triangles written at once."""


def write_stl(out: IO[bytes], mesh: MeshBlocks, words: bytes) -> None:
    """Write a mesh with the normals of its triangles; `words` are cut off or filled up with blanks."""
    total = mesh.triangle_count
    claim(out, START + TRIANGLE.itemsize * total)
    out.write(words[:HEADER].ljust(HEADER))
    out.write(np.uint32(total).tobytes())
    for start, stop in blocks(total, BLOCK):
        triangles, labels = mesh.triangle_block(start, stop)
        corners = mesh.corners(triangles)
        records = np.zeros(stop - start, dtype=TRIANGLE)
        records["normal"], records["corners"] = unit_rows(face_vectors(corners)), corners
        if labels is not None:
            records["label"] = labels
        out.write(records.tobytes())
        progress.report(stop, total)


def is_binary(file: Path) -> bool:
    """Return whether an STL has the size that a binary one of its triangles has."""
    with file.open("rb") as stream:
        head = stream.read(START)
    count = int.from_bytes(head[HEADER:], "little")
    return len(head) == START and file.stat().st_size == START + TRIANGLE.itemsize * count


def read_stl(file: Path) -> MeshData:
    """Return a binary STL, with its labels if o3dleaf wrote it."""
    with file.open("rb") as stream:
        ours = stream.read(HEADER).startswith(OURS)
    records = np.fromfile(file, TRIANGLE, offset=START)
    vertices, triangles = join_corners(records["corners"].astype(np.float64))
    if not ours:
        return MeshData(vertices, triangles)
    labels = records["label"].astype(np.uint8)
    return MeshData(vertices, triangles, labels, name_labels(labels))


def join_corners(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles with the (m, 3, 3) corners, exactly equal ones as one vertex."""
    mesh = build_mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    return mesh_arrays(mesh.remove_duplicated_vertices())
