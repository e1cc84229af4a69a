"""Numbers on a regular grid, written block by block: VTK ImageData (.vti), NRRD (.nrrd) and NumPy (.npy with .json).

One number a point, x fastest; of the whole grid nothing but a block is ever held.
"""

import json
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.atomic_files import require_free, require_writable, whole_file, write_text
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_bounds
from o3dleaf.core.checks.voxels import as_step
from o3dleaf.core.parallel import blocks

SUFFIXES = (".vti", ".nrrd", ".npy")
VTK_TYPES = {"float32": "Float32", "uint8": "UInt8"}
NRRD_TYPES = {"float32": "float", "uint8": "uint8"}


@dataclass(frozen=True, eq=False, repr=False)
class GridFile:
    """A grid that is to be written: checked, not yet sampled.

    Attributes
    ----------
    path : Path
    what : str
        Name of the numbers.
    first, step : (3,) ndarrays
        The first point, in steps, and the steps.
    shape : tuple of int
        Points along x, y and z.
    unit : str, optional
        Of length.
    dtype : dtype
        float32 or uint8.
    """

    path: Path
    what: str
    first: FloatArray
    step: FloatArray
    shape: tuple[int, int, int]
    unit: str | None
    dtype: np.dtype[Any]

    @classmethod
    def plan(
        cls,
        path: str | PathLike[str],
        spacing: float | npt.ArrayLike,
        bounds: npt.ArrayLike,
        what: str,
        unit: str | None = None,
        dtype: npt.DTypeLike = np.float32,
        *,
        suffixes: tuple[str, ...] = SUFFIXES,
    ) -> "GridFile":
        """Lay the whole multiples of `spacing` over a box (2, 3), or refuse what cannot be written.

        Raises
        ------
        InputError
            If the suffix is unknown, the folder cannot be written to, or an argument cannot be meant.
        O3DLeafError
            If the disk has no room for the grid.
        """
        target = require_writable(path, suffixes)
        step, box, kind = as_step(spacing), as_bounds(bounds, 3), np.dtype(dtype)
        with np.errstate(over="ignore", invalid="ignore"):
            first, last = np.floor(box[0] / step + 1e-9), np.ceil(box[1] / step - 1e-9)
            count = np.nan_to_num(last - first + 1, nan=np.inf)
            require_free(target, float(np.prod(count)) * kind.itemsize)
        return cls(target, what, first, step, (int(count[0]), int(count[1]), int(count[2])), unit, kind)

    def __repr__(self) -> str:
        unit = f", unit {self.unit}" if self.unit else ""
        return f"GridFile({self.what} at {' × '.join(map(str, self.shape))} points{unit})"

    @property
    def size(self) -> int:
        """Number of points."""
        return self.shape[0] * self.shape[1] * self.shape[2]

    @property
    def origin(self) -> FloatArray:
        """The first point."""
        return np.asarray(self.first * self.step)

    def points(self, count: int) -> Iterator[FloatArray]:
        """Yield the points in the order of the file, `count` at a time."""
        for start, stop in blocks(self.size, count):
            plane, i = np.divmod(np.arange(start, stop), self.shape[0])
            k, j = np.divmod(plane, self.shape[1])
            yield (self.first + np.stack([i, j, k], axis=1)) * self.step

    def write(self, parts: Iterable[npt.NDArray[Any]]) -> None:
        """Write the numbers, which come in parts, x fastest, then y, then z; the file appears whole or not at all."""
        suffix, done = self.path.suffix.lower(), 0
        with whole_file(self.path, self.size * self.dtype.itemsize) as temporary, temporary.open("wb") as out:
            if suffix == ".npy":
                header = {"descr": self.dtype.newbyteorder("<").str, "fortran_order": False, "shape": self.shape[::-1]}
                np.lib.format.write_array_header_1_0(out, header)
            elif suffix == ".nrrd":
                out.write(_nrrd_header(self).encode())
            else:
                out.write(_vti_header(self).encode())
                out.write((self.size * self.dtype.itemsize).to_bytes(8, "little"))
            for part in parts:
                values = part.astype(self.dtype)
                out.write((values if sys.byteorder == "little" else values.byteswap()).tobytes())
                done += part.size
                progress.report(done, self.size)
            if suffix == ".vti":
                out.write(b"\n</AppendedData>\n</VTKFile>\n")
        if suffix == ".npy":
            self._write_metadata()

    def _write_metadata(self) -> None:
        """Write what NPY has no place for into a file beside it."""
        meaning = {"distance": "signed distance, negative inside"}.get(self.what, self.what)
        content: dict[str, Any] = {"what": meaning, "axes": "[k, j, i]: z, y, x", "unit": self.unit}
        steps = self.step.tolist()
        content |= {"origin": self.origin.tolist(), "spacing": steps[0] if len(set(steps)) == 1 else steps}
        write_text(json.dumps(content, indent=1) + "\n", self.path.with_suffix(".json"))


def _words(numbers: FloatArray) -> list[str]:
    """Return every digit of numbers."""
    return [repr(float(number)) for number in numbers]


def _vti_header(grid: GridFile) -> str:
    """Return the XML before the numbers."""
    extent = " ".join(f"0 {count - 1}" for count in grid.shape)
    place = f'Origin="{" ".join(_words(grid.origin))}" Spacing="{" ".join(_words(grid.step))}"'
    return (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f"<!-- o3dleaf: {grid.what}, lengths in {grid.unit or 'no stated unit'} -->\n"
        f'<ImageData WholeExtent="{extent}" {place}>\n'
        f'<Piece Extent="{extent}">\n<PointData Scalars="{grid.what}">\n'
        f'<DataArray type="{VTK_TYPES[grid.dtype.name]}" Name="{grid.what}" format="appended" offset="0"/>\n'
        '</PointData>\n<CellData/>\n</Piece>\n</ImageData>\n<AppendedData encoding="raw">\n_'
    )


def _nrrd_header(grid: GridFile) -> str:
    """Return the header of a NRRD file; SimpleITK wants the space that directions are given in."""
    step = _words(grid.step)
    directions = [f"({','.join(step[axis] if axis == k else '0' for k in range(3))})" for axis in range(3)]
    lines = [
        "NRRD0004",
        f"type: {NRRD_TYPES[grid.dtype.name]}",
        "dimension: 3",
        "space dimension: 3",
        f"sizes: {' '.join(str(count) for count in grid.shape)}",
        f"space directions: {' '.join(directions)}",
        f"space origin: ({','.join(_words(grid.origin))})",
        "kinds: domain domain domain",
        "endian: little",
        "encoding: raw",
    ]
    if grid.unit:
        lines.append(f'space units: "{grid.unit}" "{grid.unit}" "{grid.unit}"')
    return "\n".join(lines) + "\n\n"
