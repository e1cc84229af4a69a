"""How far a mesh is from a surface that is known, or from a scan, and what kind of a mesh it is."""

import numpy as np
from scipy.spatial import KDTree

from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.core.parallel import get_num_threads
from o3dleaf.samples.meshed import draw_on_triangles
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import EdgeTable, fans_per_vertex, label_fans, label_triangles

SAMPLES = 200_000
FARTHEST = 10_000
"""Vertices that are asked for their exact distance: those that seem farthest, where tips of spikes are."""


def sample_triangles(vertices, triangles, count, rng):
    """Return `count` points of a mesh, uniform by area, and the unit normals of their triangles."""
    points, chosen = draw_on_triangles(vertices, triangles, count, rng)
    a, b, c = vertices[triangles[chosen]].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    return points, normals / np.linalg.norm(normals, axis=1)[:, np.newaxis]


def errors_to_truth(vertices, triangles, solid, threshold, *, samples=SAMPLES, seed=1):
    """Return the errors of a mesh against a `Solid`; distances are to the surface itself, not to a mesh of it.

    accuracy, completeness: mean distances from the mesh to the truth and back, over samples uniform by area.
    hausdorff95, hausdorff: the larger of the two directions' 95 % quantiles and of their largest, vertices included.
    normal_consistency: mean cosine between a triangle and the truth at the closest point, −1 if turned inside out.
    fscore: harmonic mean of the parts of either that are nearer than the threshold.
    """
    rng = np.random.default_rng(seed)
    places, facing = sample_triangles(vertices, triangles, samples, rng)
    feet = solid.closest(places)
    truth = solid.sample(samples, seed + 1)[0]
    used = vertices[np.unique(triangles)]
    seeming = KDTree(truth).query(used, workers=get_num_threads())[0]
    tips = used[np.argsort(seeming)[-FARTHEST:]]
    farthest = np.abs(solid.signed_distance(tips)).max()
    there, back = np.abs(feet.distance), distance_to_mesh(vertices, triangles, truth)
    return summary(there, back, farthest, (facing * feet.normals).sum(axis=1), threshold)


def errors_to_scan(vertices, triangles, scan, held_out, threshold, *, samples=SAMPLES, seed=1):
    """Return the same against a scan (points, normals): mesh to its points; completeness of points not given."""
    rng = np.random.default_rng(seed)
    points, normals = scan
    places, facing = sample_triangles(vertices, triangles, samples, rng)
    tree = KDTree(points)
    there, row = tree.query(places, workers=get_num_threads())
    farthest = tree.query(vertices[np.unique(triangles)], workers=get_num_threads())[0].max()
    back = distance_to_mesh(vertices, triangles, held_out)
    return summary(there, back, farthest, (facing * normals[row]).sum(axis=1), threshold)


def summary(there, back, farthest, cosines, threshold):
    """Return the figures of distances from the mesh and to it."""
    precision, recall = np.mean(there < threshold), np.mean(back < threshold)
    return {
        "accuracy": float(there.mean()),
        "completeness": float(back.mean()),
        "hausdorff95": float(max(np.quantile(there, 0.95), np.quantile(back, 0.95))),
        "hausdorff": float(max(there.max(), back.max(), farthest)),
        "normal_consistency": float(cosines.mean()),
        "fscore": float(2 * precision * recall / max(precision + recall, np.finfo(float).tiny)),
    }


def shape_of(vertices, triangles):
    """Return what kind of a mesh it is: pieces, manifold or not (edges, vertices), open edges, V − E + F, size."""
    edges = EdgeTable.of(triangles)
    fans = fans_per_vertex(triangles, label_fans(triangles, edges), len(vertices))
    return {
        "components": int(label_triangles(triangles, edges).max(initial=-1)) + 1,
        "manifold": bool((edges.count <= 2).all() and (fans <= 1).all()),
        "boundary_edges": int((edges.count == 1).sum()),
        "euler": len(np.unique(triangles)) - len(edges.count) + len(triangles),
        "triangles": len(triangles),
        "area": float(triangle_areas(vertices, triangles).sum()),
    }
