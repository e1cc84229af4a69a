"""The leaf on a regular grid of the world, written slab by slab: VTK ImageData (.vti) and NRRD (.nrrd).

Both keep one number a point, x fastest, behind a header in text. Nothing but one slab is ever held.
"""

import sys
from collections.abc import Callable
from os import PathLike
from typing import IO, TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.atomic_files import require_free, require_writable, whole_file
from o3dleaf.core.checks import FloatArray, as_bounds, as_step, require_choice
from o3dleaf.core.parallel import Progress, blocks, run_blocks
from o3dleaf.leaf.distance.around import Around
from o3dleaf.leaf.distance.distance import signed_distance
from o3dleaf.leaf.distance.solid import Solid

if TYPE_CHECKING:
    from o3dleaf.leaf.multiscale import MultiscaleLeaf

SUFFIXES = (".vti", ".nrrd")
KINDS: dict[str, type[Any]] = {"field": np.float32, "distance": np.float32, "mask": np.uint8}
"""What can be written, and the numbers that it is kept in."""
SLAB = 1 << 18
"""Points asked for at once."""
BLOCK = 1 << 13
"""Points of a mask that a thread looks at together: empty air costs it nothing but telling that it is."""
VTK_TYPES = {"float32": "Float32", "uint8": "UInt8"}
NRRD_TYPES = {"float32": "float", "uint8": "uint8"}

Shape = tuple[int, int, int]


def write_grid(
    leaf: "MultiscaleLeaf",
    path: str | PathLike[str],
    spacing: float | npt.ArrayLike,
    bounds: npt.ArrayLike | None = None,
    *,
    what: str = "field",
    closed: bool = False,
    progress: Progress | None = None,
) -> None:
    """Sample the leaf on a regular grid and write it as one file; see `MultiscaleLeaf.write_grid`."""
    target = require_writable(path, SUFFIXES)
    require_choice(what, KINDS, "what")
    step = as_step(spacing)
    box = leaf.bounds if bounds is None else as_bounds(bounds, 3)
    first, last = np.floor(box[0] / step + 1e-9), np.ceil(box[1] / step - 1e-9)
    counts = last - first + 1
    kind = np.dtype(KINDS[what])
    require_free(target, int(np.prod(counts, dtype=object)) * kind.itemsize)
    shape, sampler = (int(counts[0]), int(counts[1]), int(counts[2])), _sampler(leaf, what, closed=closed)
    header, footer = envelope(target.suffix.lower(), what, kind, shape, (first * step, step), leaf.unit)
    with whole_file(target) as temporary, temporary.open("wb") as stream:
        stream.write(header)
        _write_values(stream, sampler, first, step, shape, kind, progress)
        stream.write(footer)


def _sampler(leaf: "MultiscaleLeaf", what: str, *, closed: bool) -> Callable[[FloatArray], npt.NDArray[Any]]:
    if what == "field":
        return leaf
    if what == "distance":
        leaf.index_of(closed=closed)  # refused here where it cannot be, not in the middle of a file
        return lambda points: signed_distance(leaf, points, closed=closed)
    solid = leaf.index_of(closed=True).solid if closed else Solid(leaf.blade.outline.polygon, None)
    around = Around.of(leaf)

    def mask(points: FloatArray) -> npt.NDArray[np.bool_]:
        held = np.zeros(len(points), dtype=bool)

        def task(start: int, stop: int) -> None:
            rows = start + around.rows(points[start:stop])
            held[rows] = solid.holds(leaf, points[rows])

        run_blocks(task, len(points), BLOCK)
        return held

    return mask


def _write_values(  # noqa: PLR0917 - a grid is where it starts, its step and its shape
    stream: IO[bytes],
    sampler: Callable[[FloatArray], npt.NDArray[Any]],
    first: FloatArray,
    step: FloatArray,
    shape: Shape,
    kind: np.dtype[Any],
    progress: Progress | None,
) -> None:
    """Write the values at the points first·step + (i, j, k)·step, i fastest."""
    total = int(np.prod(shape, dtype=object))
    for start, stop in blocks(total, SLAB):
        number = np.arange(start, stop)
        plane, i = np.divmod(number, shape[0])
        k, j = np.divmod(plane, shape[1])
        points = (first + np.stack([i, j, k], axis=1)) * step
        values = sampler(points).astype(kind)
        stream.write((values if sys.byteorder == "little" else values.byteswap()).tobytes())
        if progress:
            progress(stop, total)


def envelope(
    suffix: str, what: str, kind: np.dtype[Any], shape: Shape, place: tuple[FloatArray, FloatArray], unit: str | None
) -> tuple[bytes, bytes]:
    """Return what stands before and after the numbers."""
    origin, step = ([repr(float(value)) for value in part] for part in place)
    if suffix == ".nrrd":
        return _nrrd_header(kind, shape, origin, step, unit).encode(), b""
    extent = " ".join(f"0 {count - 1}" for count in shape)
    size = int(np.prod(shape, dtype=object)) * kind.itemsize
    header = (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f"<!-- o3dleaf: {what}, lengths in {unit or 'no stated unit'} -->\n"
        f'<ImageData WholeExtent="{extent}" Origin="{" ".join(origin)}" Spacing="{" ".join(step)}">\n'
        f'<Piece Extent="{extent}">\n<PointData Scalars="{what}">\n'
        f'<DataArray type="{VTK_TYPES[kind.name]}" Name="{what}" format="appended" offset="0"/>\n'
        '</PointData>\n<CellData/>\n</Piece>\n</ImageData>\n<AppendedData encoding="raw">\n_'
    )
    return header.encode() + size.to_bytes(8, "little"), b"\n</AppendedData>\n</VTKFile>\n"


def _nrrd_header(kind: np.dtype[Any], shape: Shape, origin: list[str], step: list[str], unit: str | None) -> str:
    """Return the header of a NRRD file; SimpleITK wants the space that directions are given in."""
    directions = [f"({','.join(step[axis] if axis == k else '0' for k in range(3))})" for axis in range(3)]
    lines = [
        "NRRD0004",
        f"type: {NRRD_TYPES[kind.name]}",
        "dimension: 3",
        "space dimension: 3",
        f"sizes: {' '.join(str(count) for count in shape)}",
        f"space directions: {' '.join(directions)}",
        f"space origin: ({','.join(origin)})",
        "kinds: domain domain domain",
        "endian: little",
        "encoding: raw",
    ]
    if unit:
        lines.append(f'space units: "{unit}" "{unit}" "{unit}"')
    return "\n".join(lines) + "\n\n"
