"""Sharpened creases: a block comes back whole, closed and manifold; what is smooth is left as it is."""

import numpy as np

import o3dleaf as o3l
import tolerances
from o3dleaf.mesh.arrays import triangle_areas
from o3dleaf.mesh.band import extract_band
from o3dleaf.mesh.sharpen import sharpen_creases
from o3dleaf.mesh.topology import EdgeTable, fans_per_vertex, label_fans


def test_the_chamfers_of_a_block_are_filled_to_its_edges_and_corners():
    block = o3l.samples.Block()
    mesh = sharpen_creases(extract_band(block, 0.043, block.sample(3000)[0]), block)
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    edges = EdgeTable.of(triangles)
    assert (edges.count == 2).all()
    assert (fans_per_vertex(triangles, label_fans(triangles, edges), len(vertices)) == 1).all()
    assert abs(triangle_areas(vertices, triangles).sum() / block.area - 1) < tolerances.SHARP_AREA


def test_a_smooth_surface_is_left_as_it_is():
    sphere = o3l.samples.Sphere()
    mesh = extract_band(sphere, 0.1, sphere.sample(3000)[0])
    same = sharpen_creases(mesh, sphere)
    assert np.array_equal(np.asarray(mesh.vertices), np.asarray(same.vertices))
    assert np.array_equal(np.asarray(mesh.triangles), np.asarray(same.triangles))
