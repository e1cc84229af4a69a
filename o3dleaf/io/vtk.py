"""VTK PolyData (.vtp) for ParaView: XML in front, raw numbers behind it, little endian, nothing lost."""

from collections.abc import Mapping
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.atomic_files import claim
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.io.mesh_data import MeshData

TYPES = {"float64": "Float64", "int64": "Int64", "uint8": "UInt8"}
Table = Mapping[str, npt.NDArray[Any]]


def write_vtp(out: IO[bytes], mesh: MeshData, name: str, cells: Table | None = None) -> None:
    """Write a mesh: point data `Normals` and the other attributes, cell data `label` and `cells`."""
    count = len(mesh.triangles)
    points = {"Normals" if name == "normals" else name: values for name, values in mesh.attributes.items()}
    of_cells = dict(cells or {}) | ({} if mesh.labels is None else {"label": mesh.labels})
    connected = mesh.triangles.astype(np.int64).ravel(), np.arange(3, 3 * count + 1, 3, dtype=np.int64)
    numbered = ", ".join(f"{number} {label}" for number, label in enumerate(mesh.names))
    note = f"{name}, lengths in {mesh.unit or 'no stated unit'}, label: {numbered}"
    _write(out, mesh.vertices, ("Polys", *connected), points, of_cells, note)


def write_vtp_points(out: IO[bytes], points: FloatArray, table: Table, note: str) -> None:
    """Write particles: (n, 3) points with a table of what each of them carries."""
    connected = np.arange(len(points), dtype=np.int64), np.arange(1, len(points) + 1, dtype=np.int64)
    _write(out, points, ("Verts", *connected), table, {}, note)


def _write(
    out: IO[bytes],
    points: FloatArray,
    cells: tuple[str, npt.NDArray[np.int64], npt.NDArray[np.int64]],
    point_data: Table,
    cell_data: Table,
    note: str,
) -> None:
    kind, connectivity, offsets = cells
    sections: list[tuple[str, Table]] = [
        ("Points", {"Points": points}),
        (kind, {"connectivity": connectivity, "offsets": offsets}),
        ("PointData", point_data),
        ("CellData", cell_data),
    ]
    body, size = _declared(sections)
    numbers = f'NumberOfPoints="{len(points)}" NumberOf{kind}="{len(offsets)}"'
    header = (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f"<!-- o3dleaf: {note.replace('--', '- -')} -->\n<PolyData>\n<Piece {numbers}>\n"
        + body
        + '\n</Piece>\n</PolyData>\n<AppendedData encoding="raw">\n_'
    )
    claim(out, len(header) + size)
    out.write(header.encode("ascii", "replace"))
    for array in (array for _, table in sections for array in table.values()):
        out.write(array.nbytes.to_bytes(8, "little"))
        out.write(np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<"), copy=False).tobytes())
    out.write(b"\n</AppendedData>\n</VTKFile>\n")


def _declared(sections: list[tuple[str, Table]]) -> tuple[str, int]:
    """Return the lines that say which arrays there are, and where, and how many bytes all of them take."""
    place, lines = 0, []
    for section, table in sections:
        lines.append(f"<{section}>")
        for name, array in table.items():
            width = f' NumberOfComponents="{array.shape[1]}"' if array.ndim == 2 else ""
            kind = TYPES[array.dtype.name]
            lines.append(f'<DataArray type="{kind}" Name="{name}"{width} format="appended" offset="{place}"/>')
            place += 8 + array.nbytes
        lines.append(f"</{section}>")
    return "\n".join(lines), place
