"""Meshes as binary records: STL in single precision, PLY in double precision with labels, normals and scalars."""

from typing import IO

import numpy as np
import numpy.typing as npt

from o3dleaf.core.parallel import Progress, blocks
from o3dleaf.leaf.instancing.stream import FACE, TRIANGLE
from o3dleaf.output.export.labelled_mesh import Surface, face_vectors, unit_rows

BLOCK = 1 << 17
STL_HEADER = 80


def write_stl(out: IO[bytes], surface: Surface, name: str, progress: Progress | None = None) -> None:
    """Write binary STL, float32 by the format's definition; a label is its triangle's attribute."""
    unit = surface.unit or "no stated unit"
    out.write(f"o3dleaf {name}, lengths in {unit}".encode("ascii", "replace")[:STL_HEADER].ljust(STL_HEADER))
    out.write(np.uint32(len(surface.triangles)).tobytes())
    for start, stop in blocks(len(surface.triangles), BLOCK):
        triangles = surface.triangles[start:stop]
        records = np.zeros(stop - start, dtype=TRIANGLE)
        records["normal"] = unit_rows(face_vectors(surface.vertices, triangles))
        records["corners"] = surface.vertices[triangles]
        if surface.labels is not None:
            records["label"] = surface.labels[start:stop]
        out.write(records.tobytes())
        if progress:
            progress(stop, len(surface.triangles))


def write_ply(out: IO[bytes], surface: Surface, name: str, progress: Progress | None = None) -> None:
    """Write binary PLY: vertices, normals and scalars in float64, the label as a property of the faces."""
    columns = [*"xyz", *(["nx", "ny", "nz"] if surface.normals is not None else []), *surface.scalars]
    face = FACE if surface.labels is not None else np.dtype([FACE.descr[0], FACE.descr[1]])
    out.write(ply_header(surface, name, columns).encode("ascii", "replace"))
    parts = [surface.vertices, *([surface.normals] if surface.normals is not None else [])]
    parts += [each[:, np.newaxis] for each in surface.scalars.values()]
    for start, stop in blocks(len(surface.vertices), BLOCK):
        out.write(np.hstack([part[start:stop] for part in parts]).astype("<f8").tobytes())
    for start, stop in blocks(len(surface.triangles), BLOCK):
        records: npt.NDArray[np.void] = np.empty(stop - start, dtype=face)
        records["count"], records["corners"] = 3, surface.triangles[start:stop]
        if surface.labels is not None:
            records["label"] = surface.labels[start:stop]
        out.write(records.tobytes())
        if progress:
            progress(stop, len(surface.triangles))


def ply_header(surface: Surface, name: str, columns: list[str]) -> str:
    """Return the header of a PLY file, with the unit and the names of the labels as comments."""
    numbered = ", ".join(f"{number} {label}" for number, label in enumerate(surface.names))
    lines = ["ply", "format binary_little_endian 1.0", f"comment o3dleaf {name}"]
    lines += [f"comment unit {surface.unit}"] if surface.unit else []
    lines += [f"comment label: {numbered}"] if surface.labels is not None else []
    lines += [f"element vertex {len(surface.vertices)}", *(f"property double {column}" for column in columns)]
    lines += [f"element face {len(surface.triangles)}", "property list uchar int vertex_indices"]
    lines += ["property uchar label"] if surface.labels is not None else []
    return "\n".join([*lines, "end_header", ""])
