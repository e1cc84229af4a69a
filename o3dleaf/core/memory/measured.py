"""Bytes that work holds at its peak, for each thing that it works on: what `scripts/measure_memory.py` measured.

The largest of its sizes and cases, rounded up, on two threads; `require_memory` asks for a third more. Of fits and
blades one size was measured, and what was held before was used again: theirs are guarded by twice as much.
"""

CLOUD_POINT = 100
"""Of a cloud that is read: coordinates, normals and colors, once as the file's and once as Open3D's."""
RECONSTRUCTED_POINT = 1900
"""Of a cloud whose surface is reconstructed, its mesh at the spacing that is chosen included."""
FITTED_POINT = 400
"""Of scattered data fitted in balls."""
LATTICE_POINT = 12
"""Of a lattice that is marched whole: a value, a sign, and what the surface takes."""
FOLLOWED_TRIANGLE = 170
"""Of a surface that is followed from seeds: its band of cells."""
FITTED_VOXEL = 80
"""Of a volume whose blade is fitted."""
BLADE_POINT = 2000
"""Of a scan that a blade is built from."""
TILE_COLUMN = 750
"""Of the lattice over one tile, which is polygonized: two faces, and hairs."""
SHEET_TRIANGLE = 800
"""Of a blade without micro-structure."""
TRIANGLE = 60
"""Of a mesh that is made or read: vertices, corners and labels, once as arrays and once as Open3D's."""
REMESHED_TRIANGLE = 650
"""Of a mesh before or after remeshing, whichever has more."""
FILED_TRIANGLE = 240
"""Of a mesh that is read from a file or written to one."""
PARTICLE = 65
"""Of particles that fill a solid."""
SAMPLE = 150
"""Of the samples that particles on a surface are chosen among."""
CROSSING = 100
"""Of a grid's columns through a closed mesh."""
REPORTED_TRIANGLE = 215
"""Of a mesh that is reported on."""
CLEANED_TRIANGLE = 400
"""Of a mesh that is cleaned."""
SIMPLIFIED_TRIANGLE = 545
"""Of a mesh that is simplified."""
DRAWN_TRIANGLE = 185
"""Of a mesh in a picture."""
DRAWN_POINT = 800
"""Of a synthetic scan whose points are drawn at random: tried, four to each."""
PLACE = 80
"""Of the lattice that the points of a synthetic scan are taken from."""
MADE_VOXEL = 16
"""Of a synthetic volume."""
SAMPLES = 60_000_000
"""Bytes of all of the samples together."""
PIXEL = 150
"""Of a picture, beside what is drawn."""
MEASURED_POINT = 155
"""Of a cloud of which `info` tells: read, and the distance of the nearest point to each."""
LOOKED_AT_VOXEL = 2
"""Of a volume of which `info` tells: mapped, and its histogram taken."""
