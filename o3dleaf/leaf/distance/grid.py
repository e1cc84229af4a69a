"""A regular grid of the world, written slab by slab: VTK ImageData (.vti) and NRRD (.nrrd).

Both keep one number a point, x fastest, behind a header in text. Nothing but one slab is ever in memory.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.atomic_files import require_free, require_writable, whole_file
from o3dleaf.core.checks import FloatArray, as_bounds, as_step, require_choice
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.leaf.distance.around import BoundingBalls
from o3dleaf.leaf.distance.solid import LeafSolid
from o3dleaf.leaf.textured_blade import TexturedBlade

SUFFIXES = (".vti", ".nrrd")
KINDS: dict[str, type[Any]] = {"field": np.float32, "distance": np.float32, "mask": np.uint8}
"""The values that can be written, and the numbers that they are kept in."""
SLAB = 1 << 18
"""Points asked for at once."""
BLOCK = 1 << 13
"""Points of a mask that a thread looks at together: empty air costs it nothing but the look."""
VTK_TYPES = {"float32": "Float32", "uint8": "UInt8"}
NRRD_TYPES = {"float32": "float", "uint8": "uint8"}

Shape: TypeAlias = tuple[int, int, int]
Sampler: TypeAlias = Callable[[FloatArray], npt.NDArray[Any]]
"""The values (n,) at (n, 3) points."""


@dataclass(frozen=True)
class GridFile:
    """A grid that is to be written: checked, not yet sampled.

    Attributes
    ----------
    path : Path
    what : {"field", "distance", "mask"}
    first, step : (3,) ndarrays
        The first point, in steps, and the step.
    shape : (3,) tuple of int
        Number of points along each axis.
    unit : str or None
        Unit of length.
    """

    path: Path
    what: str
    first: FloatArray
    step: FloatArray
    shape: Shape
    unit: str | None

    @classmethod
    def plan(
        cls,
        path: str | PathLike[str],
        spacing: float | npt.ArrayLike,
        bounds: npt.ArrayLike,
        what: str,
        unit: str | None,
    ) -> "GridFile":
        """Lay the whole multiples of `spacing` over a box (2, 3), or refuse what cannot be written.

        Raises
        ------
        InputError
            If the suffix is unknown, the folder cannot be written to, or an argument cannot be meant.
        O3DLeafError
            If the disk has no room for the grid.
        """
        target = require_writable(path, SUFFIXES)
        require_choice(what, KINDS, "what")
        step = as_step(spacing)
        box = as_bounds(bounds, 3)
        first, last = np.floor(box[0] / step + 1e-9), np.ceil(box[1] / step - 1e-9)
        counts = last - first + 1
        require_free(target, int(np.prod(counts, dtype=object)) * np.dtype(KINDS[what]).itemsize)
        return cls(target, what, first, step, (int(counts[0]), int(counts[1]), int(counts[2])), unit)

    def write(self, sampler: Sampler) -> None:
        """Write what a sampler says at the points of the grid, slab by slab, the file whole or not at all."""
        kind = np.dtype(KINDS[self.what])
        place = self.first * self.step, self.step
        header, footer = envelope(self.path.suffix.lower(), self.what, kind, self.shape, place, self.unit)
        with whole_file(self.path) as temporary, temporary.open("wb") as stream:
            stream.write(header)
            for points in self._slabs():
                values = sampler(points).astype(kind)
                stream.write((values if sys.byteorder == "little" else values.byteswap()).tobytes())
            stream.write(footer)

    def _slabs(self) -> Iterator[FloatArray]:
        """Yield the points (n, 3) of the grid, x fastest, and report those that are done."""
        total = int(np.prod(self.shape, dtype=object))
        for start, stop in blocks(total, SLAB):
            plane, i = np.divmod(np.arange(start, stop), self.shape[0])
            k, j = np.divmod(plane, self.shape[1])
            yield (self.first + np.stack([i, j, k], axis=1)) * self.step
            progress.report(stop, total)


def mask_sampler(leaf: TexturedBlade, solid: LeafSolid) -> Sampler:
    """Return the function that says of (n, 3) points whether they lie in a solid."""
    balls = BoundingBalls.of(leaf)

    def mask(points: FloatArray) -> npt.NDArray[np.bool_]:
        inside = np.zeros(len(points), dtype=bool)

        def task(start: int, stop: int) -> None:
            rows = start + balls.rows(points[start:stop])
            inside[rows] = solid.contains_points(leaf, points[rows])

        run_blocks(task, len(points), BLOCK)
        return inside

    return mask


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
