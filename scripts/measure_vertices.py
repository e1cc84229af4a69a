"""Areas of blades of meshes' vertices and of clouds thinned to a point a voxel, or to a least distance: their errors.

python scripts/measure_vertices.py [--kinds ...] [--thinned ...] [--noise SPACINGS ...] [--occupancy K ...] [--seed N]
    [--held-out]

Points are the vertices of each leaf's mesh, and random samples of K spacings to a voxel's edge, or to the least
distance, noise along all axes in their spacings, as Open3D's `voxel_down_sample` and MeshLab's Poisson disk leave them.
"""

import argparse

import numpy as np
import open3d as o3d
import pymeshlab
from leaf_cases import HELD_OUT, KINDS, SPACING, SPACINGS

import o3dleaf as o3l

LEAVES = ("curled", "twisted", "lobed", "cupped", "eaten", "wavy")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=LEAVES)
    parser.add_argument("--thinned", nargs="+", choices=("voxels", "distance"), default=["voxels", "distance"])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.3], help="of samples, in their spacings")
    parser.add_argument(
        "--occupancy", type=float, nargs="+", default=[1.0, 2.0, 3.0], help="edge or distance in spacings"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--held-out", action="store_true", help="other leaves, to be run once, at the end")
    args = parser.parse_args()
    for name in args.kinds:
        parameters = dict((HELD_OUT if args.held_out else KINDS)[name])
        leaf = o3l.samples.leaf_shape(parameters.pop("kind", name), **parameters)
        edge = SPACINGS.get(name, SPACING)
        tell(name, "vertices", leaf, leaf.mesh(edge)[0])
        for share in args.occupancy:
            for noise in args.noise:
                scan = o3l.samples.scan_leaf(leaf, seed=args.seed, spacing=edge / share, noise=noise)
                for way in args.thinned:
                    said = f"{way} of {share:g} spacings, noise {noise:g}"
                    tell(name, said, leaf, (in_voxels if way == "voxels" else apart)(scan.cloud.points, edge))


def in_voxels(points, edge):
    """Return the averages of points in each voxel."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.asarray(points)))
    return np.asarray(cloud.voxel_down_sample(edge).points)


def apart(points, distance):
    """Return points that are no nearer to one another than a distance."""
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(np.asarray(points)))
    meshes.generate_simplified_point_cloud(radius=pymeshlab.PureValue(distance))
    return meshes.current_mesh().vertex_matrix()


def tell(name, said, leaf, points):
    """Print the error of the area of a blade."""
    blade = o3l.create_blade(points, unit="mm")
    area = o3l.FitQuality.of(blade, points).area[0]
    print(f"{name}, {said}: {len(points):,} points, area {area / leaf.area - 1:+.2%}", flush=True)


if __name__ == "__main__":
    main()
