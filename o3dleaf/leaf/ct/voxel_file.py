"""The voxels of a volume as another process reads them: parts of the file that they lie in."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
import numpy.typing as npt

from o3dleaf.leaf.ct.formats.read import open_volume
from o3dleaf.leaf.ct.volume import slices_in


@dataclass(frozen=True)
class VoxelFile:
    """The file of a volume's voxels; it can be sent to another process.

    Attributes
    ----------
    path : str
        From the root on.
    layout : str or None
        As of `open_volume`.
    first, shape : (3,) tuple of int
        First voxel in the file, and their number along each axis: those of a crop are a part of all.
    name : str
        Of this reading: another one opens the file again.
    """

    path: str
    layout: str | None
    first: tuple[int, ...]
    shape: tuple[int, ...]
    name: str

    @classmethod
    def of(
        cls,
        path: Path,
        shape: tuple[int, ...],
        crop: npt.ArrayLike | None = None,
        *,
        layout: str | None = None,
        **lattice: Any,
    ) -> "VoxelFile":
        """Return the voxels of a file, or those in a box of it, with spacing and unit as of `open_volume`."""
        first = (0, 0, 0)
        if crop is not None:
            with open_volume(path, layout=layout, **lattice) as volume:
                first = tuple(each.start for each in slices_in(volume, crop)[0])
        return cls(str(path.absolute()), layout, first, shape, uuid4().hex)

    def __call__(self, slices: tuple[slice, ...]) -> npt.NDArray[Any]:
        """Read a part, (n, m, k) voxels along (x, y, z)."""
        places = (each.indices(count) for each, count in zip(slices, self.shape, strict=True))
        inside = tuple(slice(a + low, b + low) for (a, b, _), low in zip(places, self.first, strict=True))
        return np.asarray(_opened(self)[inside])


@lru_cache(maxsize=1)
def _opened(file: VoxelFile) -> Any:
    """Return all voxels of a file, which stays open; its spacing is not asked for."""
    return open_volume(file.path, spacing=1.0, layout=file.layout).voxels
