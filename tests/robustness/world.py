"""Small good arguments, each made once: what the rows of the table spoil."""

import os
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import o3dleaf as o3l
from o3dleaf import samples, view


def single(array: Any) -> np.ndarray:
    """Return an array rounded to what single precision holds, so that all forms of it are equal."""
    return np.asarray(array, dtype=np.float32).astype(np.float64)


class World:
    """Good arguments of all kinds; files lie in `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    ball = samples.Sphere()

    @cached_property
    def points(self) -> np.ndarray:
        """On a sphere, 300."""
        return single(self.ball.sample(300)[0])

    @cached_property
    def normals(self) -> np.ndarray:
        return single(self.ball.sample(300)[1])

    @cached_property
    def values(self) -> np.ndarray:
        return single(np.sin(3 * self.points[:, 0]) + self.points[:, 1])

    queries = single(np.random.default_rng(1).uniform(-0.4, 0.4, (20, 3)))
    plane = single(np.random.default_rng(2).uniform([1.0, -2.0], [8.0, 2.0], (20, 2)))
    flat = single(np.random.default_rng(3).uniform([1.0, -2.0, -0.1], [8.0, 2.0, 0.1], (20, 3)))

    @cached_property
    def cloud(self) -> Any:
        return o3l.OrientedCloud.of(self.points, self.normals)

    @cached_property
    def mesh(self) -> tuple[np.ndarray, np.ndarray]:
        import open3d as o3d

        made = o3d.geometry.TriangleMesh.create_sphere(0.5, resolution=8)
        return single(made.vertices), np.asarray(made.triangles).astype(np.int64)

    @cached_property
    def legacy(self) -> Any:
        from o3dleaf.core.mesh_arrays import build_mesh

        return build_mesh(*self.mesh)

    @cached_property
    def report(self) -> Any:
        return o3l.mesh_report(self.mesh)

    @cached_property
    def support(self) -> Any:
        return o3l.vertex_support(self.mesh, self.points)

    @cached_property
    def rbf(self) -> Any:
        return o3l.RBFInterpolant.fit(self.points[:80], self.values[:80])

    @cached_property
    def pu(self) -> Any:
        return o3l.PUInterpolant.fit(self.points, self.values, points_per_ball=(40, 80))

    @cached_property
    def lattice(self) -> np.ndarray:
        return single(0.3 - np.abs(np.linspace(-1, 1, 9)) + np.zeros((9, 9, 1)))

    @cached_property
    def volume(self) -> Any:
        x, y, z = np.meshgrid(*[np.arange(14.0)] * 2, np.linspace(-1, 1, 11), indexing="ij")
        sheet = 100 * (np.abs(z) < 0.55) + 5 * np.sin(x) + 3 * np.cos(2 * y + z)
        return o3l.Volume(single(sheet), 0.1, unit="mm")

    @cached_property
    def texture(self) -> Any:
        from leaf_fields import texture

        return texture(lambda x, y, z: 0.2 - np.abs(z) + 0.02 * np.sin(np.pi * x), n=9)

    @cached_property
    def leaf(self) -> Any:
        from leaf_fields import leaf_of

        return leaf_of(self.texture, bend=20.0, length=9.0)[0]

    @cached_property
    def paper_leaf(self) -> Any:
        from leaf_fields import leaf_of

        return leaf_of(self.texture, bend=20.0, length=9.0, frame="paper")[0]

    @cached_property
    def strip(self) -> np.ndarray:
        """A bent strip, 9 by 6, such as the leaf."""
        rng = np.random.default_rng(4)
        along, across = rng.uniform(0, 9, 700), rng.uniform(-3, 3, 700)
        return single(np.column_stack([20 * np.sin(along / 20), across, 20 * np.cos(along / 20) - 20]))

    @cached_property
    def long_strip(self) -> np.ndarray:
        """As the strip, a sixth as wide."""
        return single(self.strip * [1.0, 1 / 6, 1.0])

    @cached_property
    def midrib(self) -> np.ndarray:
        along = np.linspace(0, 9, 15)
        return single(np.column_stack([20 * np.sin(along / 20), 0 * along, 20 * np.cos(along / 20) - 20]))

    @cached_property
    def leaf_points(self) -> np.ndarray:
        """In leaf coordinates: along, across, up."""
        return single(self.paper_leaf.blade.frame.to_leaf(self.strip))

    @cached_property
    def on_leaf(self) -> np.ndarray:
        return self.strip[:20]

    @cached_property
    def pieces(self) -> Any:
        return o3l.find_pieces(self.strip)

    @cached_property
    def fit_quality(self) -> Any:
        return o3l.FitQuality.of(self.leaf.blade, self.strip)

    @cached_property
    def particles(self) -> Any:
        return o3l.sample_particles(self.mesh, 0.2)

    @cached_property
    def leaf_shape(self) -> Any:
        return samples.leaf_shape("twisted")

    @cached_property
    def wheat(self) -> Any:
        return samples.WheatBlade()

    @cached_property
    def patch(self) -> Any:
        return samples.wheat_ct(spacing=60.0, size=(600.0, 600.0, 480.0))[1]

    @cached_property
    def camera(self) -> Any:
        return view.Camera.framing(*self.mesh, view.View())

    def file(self, name: str) -> Path:
        """Return a good file of that name."""
        path = self.folder / name
        if not path.is_file():
            _write(self, path)
        self.spoiled(path.suffix)
        return path

    def target(self, name: str) -> Path:
        """Return a file that could be written."""
        path = self.folder / name
        self.spoiled(path.suffix)
        return path

    def spoiled(self, suffix: str) -> None:
        """Make files of that suffix which are none, and what is in the way of outputs."""
        folder = self.folder
        if (folder / f"pipe{suffix}").exists():
            return
        (folder / f"empty{suffix}").touch()
        for link, target in (("loop", "loop"), ("nowhere", "is not there")):
            (folder / f"{link}{suffix}").symlink_to(f"{target}{suffix}")
        (folder / f"words{suffix}").write_text("Not what the suffix says, but a sentence or two.\n" * 20)
        (folder / f"noise{suffix}").write_bytes(np.random.default_rng(5).bytes(3000))
        (folder / f"folder{suffix}").mkdir(exist_ok=True)
        (folder / f"read only{suffix}").write_text("mine")
        (folder / f"read only{suffix}").chmod(0o444)
        os.mkfifo(folder / f"pipe{suffix}")
        (folder / "a file").touch()
        (folder / "words").write_text("words")
        good = next((each for each in folder.glob(f"*{suffix}") if each.stem.startswith("good")), None)
        content = b"" if good is None else good.read_bytes()
        (folder / f"cut{suffix}").write_bytes(content[: 2 * len(content) // 3] or b"\x00")


def _write(world: World, path: Path) -> None:
    """Write a good file of the kind that its name says."""
    import open3d as o3d

    match path.name:
        case "good cloud.ply":
            cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(world.points))
            cloud.normals = o3d.utility.Vector3dVector(world.normals)
            o3d.io.write_point_cloud(str(path), cloud)
        case "good.xyz":
            np.savetxt(path, world.points)
        case "good.o3l":
            world.pu.save(path)
        case "good.tif":
            o3l.write_volume(world.volume, path)
        case _:
            o3l.write_mesh(world.mesh, path)
