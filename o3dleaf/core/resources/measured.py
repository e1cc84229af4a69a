"""Bytes that work holds at its peak, and processor time, for each thing that it works on.

As `scripts/measure_costs.py` measured it: the largest of its sizes and cases, rounded up, on two threads;
`require_resources` asks for a third more. Of fits and blades one size was measured, and what was held before was used
again: theirs are guarded by twice as much.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Cost:
    """What some work takes: bytes at its peak, and seconds of processor time, 0 where they are not known."""

    bytes: float
    seconds: float = 0.0

    def __add__(self, other: "Cost") -> "Cost":
        """Return what both take, held at once."""
        return Cost(self.bytes + other.bytes, self.seconds + other.seconds)


@dataclass(frozen=True)
class Each:
    """What work takes for each thing: bytes, and microseconds; times a number of things it is their `Cost`."""

    bytes: float
    microseconds: float = 0.0

    def __mul__(self, count: float) -> Cost:
        """Return what so many things take."""
        return Cost(self.bytes * count, 1e-6 * self.microseconds * count)


CLOUD_POINT = Each(100)
"""Of a cloud that is read: coordinates, normals and colors, once as the file's and once as Open3D's."""
RECONSTRUCTED_POINT = Each(1900, 150)
"""Of a cloud whose surface is reconstructed, its mesh at the spacing that is chosen included."""
FITTED_POINT = Each(400, 75)
"""Of scattered data fitted in balls."""
LATTICE_POINT = Each(12, 0.12)
"""Of a lattice that is marched whole: a value, a sign, and what the surface takes."""
FOLLOWED_TRIANGLE = Each(170, 1.0)
"""Of a surface that is followed from seeds: its band of cells."""
DUAL_TRIANGLE = Each(320, 1.5)
"""Of a surface that is followed on the leaves of an octree: twice as much, of half as many."""
VOLUME = Cost(60_000_000)
"""Of a volume that is fitted, whatever its size: the systems of the balls that are solved for at once."""
FITTED_VOXEL = Each(36, 0.75)
"""Of a volume that is fitted: all of it, or the narrow band around its surface. Four fifths are coefficients; all of it
lies in files where it would take much."""
LEFT_VOXEL = Each(0.3, 0.1)
"""Of a volume that is fitted in a narrow band: of all of it, to find the band, and for what lies beside it."""
CORRECTED_VOXEL = Each(12, 0.7)
"""Of a volume whose drift and rings are removed: one copy made of another, and what is held at once."""
BLADE = Cost(0, 20.0)
"""Of a blade, whatever its scan: beyond some 20,000 points more are thinned."""
BLADE_POINT = Each(2000, 65)
"""Of a scan that a blade is built from."""
TILE_COLUMN, TILE_SAMPLE = Each(750), Each(0, 1.3)
"""Of the lattice over one tile, which is polygonized: of its columns two faces, and hairs; of its points values."""
TILE, FILED_COLUMN = Cost(100_000_000), Each(12)
"""Of such a lattice where edges, runs of columns, triangles and lists of balls lie in files, as they would take much:
slabs of samples, whatever the size of the tile, and what is left of its columns. By `scripts/measure_growth.py` under
400 MB, tiles of 0.1 to 1 million columns."""
SHEET_TRIANGLE = Each(800, 6.5)
"""Of a blade without micro-structure."""
TRIANGLE = Each(60, 1.4)
"""Of a mesh that is made or read: vertices, corners and labels, once as arrays and once as Open3D's."""
REMESHED_TRIANGLE = Each(650, 165)
"""Of a mesh before or after remeshing, whichever has more."""
FILED_TRIANGLE = Each(240, 0.5)
"""Of a mesh that is read from a file or written to one."""
PARTICLE = Each(65, 0.2)
"""Of particles that fill a solid."""
SAMPLE = Each(150, 2.0)
"""Of the samples that particles on a surface are chosen among."""
CROSSING = Each(100)
"""Of a grid's columns through a closed mesh."""
REPORTED_TRIANGLE = Each(215, 3.0)
"""Of a mesh that is reported on."""
CHECKED_MESH = Cost(20_000_000)
"""Of a surface that is made and reported on, whatever its size: compiled code that is loaded on the way."""
CHECKED_TRIANGLE = Each(275, 4.4)
"""Of it as much as `TRIANGLE` and `REPORTED_TRIANGLE`: the mesh is held while it is reported on."""
CLEANED_TRIANGLE = Each(400, 5.5)
"""Of a mesh that is cleaned."""
SIMPLIFIED_TRIANGLE = Each(545, 7.0)
"""Of a mesh that is simplified."""
DRAWN_TRIANGLE = Each(185, 5.0)
"""Of a mesh in a picture."""
DRAWN_POINT = Each(800)
"""Of a synthetic scan whose points are drawn at random: tried, four to each."""
PLACE = Each(80)
"""Of the lattice that the points of a synthetic scan are taken from."""
MADE_VOXEL = Each(16)
"""Of a synthetic volume."""
SAMPLES = Cost(60_000_000)
"""Of all of the samples together."""
SOLVER = Cost(130_000_000)
"""Of a run of OpenFOAM, whatever its mesh."""
SOLVED_CELL, SOLVED_STEP = Each(2500), Each(0, 6.0)
"""Of the cells of a run, and of each in each of its steps; as the logs of `interFoam` had it."""
PIXEL = Each(150)
"""Of a picture, beside what is drawn."""
MEASURED_POINT = Each(155)
"""Of a cloud of which `info` tells: read, and the distance of the nearest point to each."""
LOOKED_AT_VOXEL = Each(2)
"""Of a volume of which `info` tells: mapped, and its histogram taken."""
