"""The compiled loops of a tile: runs of samples along columns, and edges of one period.

A column's samples are runs of one label, the first at k = 0. A tile's point (i, j, k) is number
(i ny + j) nz + k, its edges are named as in `o3dleaf.surface.isosurface.polygonize_loops`.
"""

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.isosurface.cell_loops import COUNTS, DIRECTIONS
from o3dleaf.surface.isosurface.polygonize_loops import corner_code
from o3dleaf.surface.mesh.adjacency_loops import find_root, join

INSIDE, ABOVE, BELOW = 0, 1, 2
"""Labels of samples: in the layer, in the air above it, in the air below it."""


@njit(nogil=True, cache=True)
def count_runs(inside, counts):
    """Write the number of runs of equal samples in each column of (m, nz) `inside`; its ends count as outside."""
    columns, nz = inside.shape
    for column in range(columns):
        counts[column] = 1
        for k in range(2, nz - 1):
            counts[column] += inside[column, k] != inside[column, k - 1]
        counts[column] += inside[column, 1]
        counts[column] += inside[column, nz - 2]


@njit(nogil=True, cache=True)
def fill_runs(inside, first, begin):
    """Write where the runs of each column begin, from row first[column] on: outside, inside, outside, ..."""
    columns, nz = inside.shape
    for column in range(columns):
        row, before = first[column], False
        begin[row] = 0
        for k in range(1, nz):
            here = inside[column, k] and k < nz - 1
            if here != before:
                row += 1
                begin[row] = k
            before = here


@njit(nogil=True, cache=True)
def unite_columns(one, other, first, begin, nz, parent, kind, main):
    """Unite the runs of two columns that overlap and are alike: of one `kind`, or neither of them the `main` one."""
    a, b = first[one], first[other]
    while a < first[one + 1] and b < first[other + 1]:
        end_a = begin[a + 1] if a + 1 < first[one + 1] else nz
        end_b = begin[b + 1] if b + 1 < first[other + 1] else nz
        if main < 0:
            alike = kind[a] == kind[b]
        else:
            alike = kind[a] != main and kind[b] != main
        if alike:
            join(parent, a, b)
        if end_a <= end_b:
            a += 1
        if end_b <= end_a:
            b += 1


@njit(nogil=True, cache=True)
def unite_all(shape, first, begin, parent, kind, main):
    """Unite alike runs of all neighboring columns of a period; with a `main` piece, those within columns too."""
    nx, ny, nz = shape
    for i in range(nx):
        for j in range(ny):
            here = i * ny + j
            unite_columns(here, (i + 1) % nx * ny + j, first, begin, nz, parent, kind, main)
            unite_columns(here, i * ny + (j + 1) % ny, first, begin, nz, parent, kind, main)
            if main >= 0:
                for run in range(first[here], first[here + 1] - 1):
                    if kind[run] != main and kind[run + 1] != main:
                        join(parent, run, run + 1)
    for run in range(len(parent)):
        parent[run] = find_root(parent, run)


@njit(nogil=True, cache=True)
def expand_runs(columns, first, begin, label, dense):
    """Write the labels of every sample of `columns` (m,) into `dense` (m, nz)."""
    nz = dense.shape[1]
    for row in range(len(columns)):
        column = columns[row]
        for run in range(first[column], first[column + 1]):
            end = begin[run + 1] if run + 1 < first[column + 1] else nz
            for k in range(begin[run], end):
                dense[row, k] = label[run]


@njit(nogil=True, cache=True)
def mark_crossed(method, inside, needed):
    """Mark the samples at the ends of crossed edges, all that the positions of vertices depend on."""
    nx, ny, nz = inside.shape
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                for direction in DIRECTIONS[method]:
                    u, v, w = i + (direction & 1), j + (direction >> 1 & 1), k + (direction >> 2)
                    if direction and u < nx and v < ny and w < nz and inside[i, j, k] != inside[u, v, w]:
                        needed[i, j, k] = True
                        needed[u, v, w] = True


@njit(nogil=True, cache=True)
def count_cells(method, inside, counts):
    """Count the triangles over each cell (i, j) of the plane into `counts` (nx − 1, ny − 1)."""
    nx, ny, nz = inside.shape
    for i in range(nx - 1):
        for j in range(ny - 1):
            for k in range(nz - 1):
                counts[i, j] += COUNTS[method, corner_code(inside, i, j, k)]


@njit(nogil=True, cache=True)
def name_in_tile(edges, slab, first, tile, names, shifts):
    """Write the names in a period of edges of a slab of it, and how many periods on they lie (bits: along, across).

    The slab begins at the column `first` (i, j).
    """
    _, slab_ny, slab_nz = slab
    nx, ny, nz = tile
    first_i, first_j = first
    for n in range(len(edges)):
        point, direction = edges[n] >> 3, edges[n] & 7
        i, j, k = first_i + point // (slab_ny * slab_nz), first_j + point // slab_nz % slab_ny, point % slab_nz
        shifts[n] = (i >= nx) + 2 * (j >= ny)
        names[n] = (((i % nx) * ny + j % ny) * nz + k) * 8 + direction
