"""OFF: vertices with normals and colors, faces of any number of corners."""

from pathlib import Path

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.io.mesh_data import MeshData
from o3dleaf.io.polygons.numbers import floats_of, integers_of
from o3dleaf.io.polygons.triangulation import triangulate

KINDS = {b"OFF": (), b"COFF": ("colors",), b"NOFF": ("normals",), b"CNOFF": ("normals", "colors")}
"""What vertices carry beside their positions, by the first word."""


def read_off(file: Path) -> MeshData:
    """Return the mesh of an OFF file.

    Raises
    ------
    InputError
        If it is no OFF, was cut off, or is damaged.
    """
    with file.open("rb") as stream:
        lines = [words for line in stream if (words := line.split(b"#", 1)[0].split())]
    if not lines or lines[0][0] not in KINDS:
        raise InputError(f"{file}: does not begin with {', '.join(kind.decode() for kind in KINDS)}; export it again")
    counts = integers_of((lines[0][1:] or (lines[1] if len(lines) > 1 else []))[:2], file)
    body = lines[1 if len(lines[0]) > 1 else 2 :]
    if len(counts) < 2 or counts.min() < 0:
        raise InputError(f"{file}: does not say how many vertices and faces it has; export it again")
    vertex_count, face_count = map(int, counts)
    if len(body) < vertex_count + face_count:
        raise InputError(
            f"{file}: has {len(body):,} of the {vertex_count:,} vertices and {face_count:,} faces that it names; "
            "it was cut off, copy it again"
        )
    carried = KINDS[lines[0][0]]
    vertices, attributes = _vertices(body[:vertex_count], carried, file)
    faces = body[vertex_count:][:face_count]
    sizes = integers_of((words[0] for words in faces), file)
    if any(len(words) <= size for words, size in zip(faces, sizes, strict=True)):
        raise InputError(f"{file}: a face has fewer corners than it says; it was cut off, copy it again")
    corners = (word for words, size in zip(faces, sizes.tolist(), strict=True) for word in words[1 : 1 + size])
    triangles, _ = triangulate(vertices, sizes, integers_of(corners, file), file)
    return MeshData(vertices, triangles, attributes=attributes)


def _vertices(
    rows: list[list[bytes]], carried: tuple[str, ...], file: Path
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return positions, and what vertices carry; colors are shares of 1, or of 255 where one is above 1."""
    width = 3 * (1 + len(carried))
    if any(len(words) < width for words in rows):
        raise InputError(f"{file}: a vertex has fewer than {width} numbers; it was cut off, copy it again")
    numbers = floats_of((word for words in rows for word in words[:width]), file).reshape(-1, width)
    parts = dict(zip(("points", *carried), np.split(numbers, 1 + len(carried), axis=1), strict=True))
    vertices = parts.pop("points")
    if "colors" in parts:
        parts["colors"] = np.clip(parts["colors"] / (255.0 if parts["colors"].max(initial=0.0) > 1 else 1.0), 0.0, 1.0)
    return vertices, parts
