"""A field over the plane as high as its patch, with air above and below: it falls there, as steeply as its data do."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.outside_loops import fall_outside
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.resources.scratch import made_by_rows
from o3dleaf.fitting.pu.blend import BATCH_SIZE, FOLD_BLOCK, Blended
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.evaluation_loops import jet_size
from o3dleaf.io.models.model_file import write_model

STEEPNESS = 2.0
"""The range of a patch's values is lost within this part, 1/2, of r N^(−1/d), the distance of its data but for a factor
of 1.6: a hair that the patch's top cuts ends a third of a voxel above it."""

PROBES = 12
"""Samples along each axis that the range of a patch's values is taken from."""
SLACK = 1e-6
"""Of a radius: rounding may put a probe on either side of a ball's border, where its weight is none."""


class LayerField(Blended):
    """A blend over the plane, within the height of its patches, as a solid's field: beyond it all is air.

    Above and below, F is the value at the nearest point less `fall` times the distance. What a patch would go on as
    there says nothing about a leaf, and the slope scales with the patch's values over its lengths, so that neither
    their units nor the scanner's matter: a hair that is cut by the top of a volume is closed there.
    """

    @property
    def patches(self) -> Sequence[PUInterpolant]:
        """The fitted patches that it is made of."""
        raise NotImplementedError

    @cached_property
    def fall(self) -> float:
        """Slope at which F falls above and below its patches: value over length, in `unit`."""
        return max(_steepness(patch) for patch in self.patches)

    @property
    def data_distance(self) -> float:
        """The distance of the patches' data, of the finest: the side of the cube that a point has to itself."""
        typical = (patch.cover.typical for patch in self.patches)
        return float(min(4.19 * radius**3 / max(count, 1.0) for radius, count in typical) ** (1 / 3))

    def stacked_jets(self, queries: FloatArray, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, to derivatives of `level` at checked (n, d) points."""
        low, high = self.index.domain
        if not any(
            (queries[:, axis] < low[axis]).any() or (queries[:, axis] > high[axis]).any() for axis in range(len(low))
        ):
            return super().stacked_jets(queries, level, dtype)
        jets = np.empty((jet_size(len(low), level), len(queries)))
        # Nearest points are held beside the jets: fewer at once keep to the memory that a blend promises.
        for first, last in blocks(len(queries), BATCH_SIZE >> (3 + level)):
            nearest = self.index.nearest(queries[first:last])
            jets[:, first:last] = super().stacked_jets(nearest, level, dtype)

        def task(start: int, stop: int) -> None:
            fall_outside(start, stop, jets, queries, self.index.bounds, self.index.period, self.fall)

        run_blocks(task, len(queries), FOLD_BLOCK)
        return jets

    @checked
    def save(self, path: str | PathLike[str]) -> None:
        """Write the texture as one model file, which `o3dleaf.load` reads."""
        write_model(self, path)


def _steepness(patch: PUInterpolant) -> float:
    """Return the range of a patch's values over the distance in which it is lost; of a constant one, its value's."""
    cover, (low, high) = patch.cover, patch.bounds
    ticks = [np.linspace(*ends, PROBES) for ends in zip(low, high, strict=True)]
    # Of the balls that hold one of the probes: a tree of all is as large as that of the tiles, and takes longer.
    index, step = patch.index, (high - low) / (PROBES - 1)

    def holding(start: int, stop: int) -> BoolArray:
        centers = index.centers[start:stop]
        nearest = low + step * np.clip(np.rint((centers - low) / step), 0, PROBES - 1)
        return np.asarray(np.linalg.norm(nearest - centers, axis=1) <= index.radii[start:stop] * (1 + SLACK))

    probed = replace(patch, index=index.only(made_by_rows(index.radii.shape, holding, np.bool_)))
    values = probed(np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, len(low)))
    radius, count = cover.typical
    distance = radius * count ** (-1.0 / len(low))
    lost = float(np.ptp(values)) or abs(float(values[0]))
    return float(STEEPNESS * lost / distance)
