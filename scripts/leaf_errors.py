"""How a blade is judged: against a leaf that is known, or against the points of a real scan."""

from dataclasses import asdict, dataclass

import numpy as np
import shapely
from scipy.spatial import KDTree

import o3dleaf as o3l
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.samples.meshed import draw_on_triangles
from o3dleaf.surface.mesh.deviation import distance_to_mesh

SAMPLES = 40_000
NEAR = 0.6
"""Spacings within which a mesh and the truth must be, and `SIGMAS` deviations of the noise more."""
SIGMAS = 2.0
MARGIN = 1.0
"""Spacings within which margins must be."""
HELD = 0.99
"""Share that must be."""
AREA, AREA_HIDDEN = 0.01, 0.02
HIDDEN = 0.05
"""Share of a leaf from which on it counts as one of which a tenth is hidden."""
FINE = 0.25
"""Of the spacing: the step of the mesh of the truth, off by its square over eight radii of curvature."""


@dataclass
class Judgement:
    """A mesh of a blade against the truth; shares are of samples even by area or by length, areas relative."""

    step: float
    area: float
    there: float
    back: float
    margin_there: float
    margin_back: float
    components: int
    holes: int
    true_holes: int
    self_intersections: int
    area_limit: float

    def as_dict(self):
        """Return the figures and what holds."""
        return asdict(self) | {"holds": {name: bool(holds(self)) for name, holds in REQUIREMENTS.items()}}


REQUIREMENTS = {
    "area": lambda found: abs(found.area) <= found.area_limit,
    "mesh to truth": lambda found: found.there >= HELD,
    "truth to mesh": lambda found: found.back >= HELD,
    "margin to truth": lambda found: found.margin_there >= HELD,
    "truth to margin": lambda found: found.margin_back >= HELD,
    "one component": lambda found: found.components == 1,
    "holes": lambda found: found.holes == found.true_holes,
    "no self-intersection": lambda found: found.self_intersections == 0,
}


class Truth:
    """A leaf and its scan as judges need them, made once for all meshes of it."""

    def __init__(self, scan):
        leaf, self.scan = scan.truth, scan
        rng = np.random.default_rng(1)
        self.mesh = leaf.mesh(FINE * scan.spacing)
        hidden = scan.hidden.buffer(scan.spacing)
        places = o3l.samples.scan_leaf(leaf, spacing=float(np.sqrt(leaf.area / SAMPLES)), seed=1).places
        self.points = leaf.lift(places[~shapely.contains_xy(hidden, places)])
        rings = leaf.margin_places(scan.spacing / 10)
        rim = np.concatenate(rings)
        self.rim, self.rim_hidden = leaf.lift(rim), shapely.contains_xy(hidden, rim)
        self.rng = rng

    def judge(self, mesh, step):
        """Return the judgement of a mesh of a step."""
        scan, leaf = self.scan, self.scan.truth
        vertices, triangles = mesh_arrays(mesh)
        near = NEAR * scan.spacing + SIGMAS * scan.noise
        samples = draw_on_triangles(vertices, triangles, SAMPLES, self.rng)[0]
        there = distance_to_mesh(*self.mesh, samples)
        back = distance_to_mesh(vertices, triangles, self.points)
        rim = boundary_points(vertices, triangles, scan.spacing / 10)
        away, row = KDTree(self.rim).query(rim)
        away = away[~self.rim_hidden[row]]
        away_back = KDTree(rim).query(self.rim[~self.rim_hidden])[0]
        report = o3l.mesh_report(mesh)
        return Judgement(
            step=step,
            area=report.area / leaf.area - 1,
            there=float(np.mean(there <= near)),
            back=float(np.mean(back <= near)),
            margin_there=float(np.mean(away <= MARGIN * scan.spacing)),
            margin_back=float(np.mean(away_back <= MARGIN * scan.spacing)),
            components=report.components,
            holes=report.holes,
            true_holes=leaf.holes,
            self_intersections=report.self_intersections,
            area_limit=AREA_HIDDEN if scan.hidden_share >= HIDDEN else AREA,
        )


def boundary_points(vertices, triangles, step):
    """Return points (n, 3) of the edges of a mesh that belong to one triangle, about a step apart."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    a, b = vertices[edges[count == 1]].transpose(1, 0, 2)
    parts = np.maximum(np.ceil(np.linalg.norm(b - a, axis=1) / step).astype(int), 1)
    row = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts) + 0.5) / parts[row]
    return a[row] + share[:, np.newaxis] * (b - a)[row]


def spacing_of(points, neighbors=8):
    """Return 1/√density of a scan: a disc of n points around one has the area n s², π d²."""
    distance = KDTree(points).query(points, neighbors + 1)[0][:, -1]
    return float(np.median(distance) * np.sqrt(np.pi / neighbors))


def judge_scan(mesh, points):
    """Return the figures of a mesh of a real scan: shares within two median spacings, pieces, holes."""
    vertices, triangles = mesh_arrays(mesh)
    tree = KDTree(points)
    near = 2 * float(np.median(tree.query(points, 2)[0][:, 1]))
    samples = draw_on_triangles(vertices, triangles, SAMPLES, np.random.default_rng(1))[0]
    report = o3l.mesh_report(mesh)
    return {
        "recall": float(np.mean(distance_to_mesh(vertices, triangles, points) <= near)),
        "precision": float(np.mean(tree.query(samples)[0] <= near)),
        "area": report.area,
        "components": report.components,
        "holes": report.holes,
        "self_intersections": report.self_intersections,
    }
