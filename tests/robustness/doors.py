"""The table of public callables: what kind each argument of each is."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

import o3dleaf as o3l
from o3dleaf import samples, view
from o3dleaf.leaf.chart.petiole import Petiole
from robustness.kinds import (
    BOX,
    CALLABLE,
    CLOUD,
    FIELD,
    FLAG,
    LENGTH,
    MESH,
    MORE_VALUES,
    NORMALS,
    NUMBER,
    OBJECT,
    QUERIES,
    SIZE,
    STEP,
    TITLE,
    UNIT,
    VALUES,
    VECTOR,
    WHOLE,
    WORD,
    Kind,
    folder_at,
    named,
    read_from,
    tuple_of,
    with_normals,
    written_to,
)


@dataclass(frozen=True)
class Door:
    """A public callable and its arguments.

    Attributes
    ----------
    find : callable
        ``find(world)`` is what is called.
    arguments : dict of str to Kind
        In the order of the signature.
    slow : bool
        Whether an answer takes so long that only what is refused is tried every time.
    lacks : bool
        Whether NaN in an answer stands for what it lacks.
    """

    find: Callable[[Any], Callable[..., Any]]
    arguments: dict[str, Kind]
    slow: bool = False
    lacks: bool = False


def door(thing: Callable[..., Any], *, slow: bool = False, lacks: bool = False, **arguments: Kind) -> Door:
    """Return the door that is `thing`."""
    return Door(lambda _: thing, arguments, slow, lacks)


def method(of: Callable[[Any], Any], name: str, *, slow: bool = False, **arguments: Kind) -> Door:
    """Return the door that is a method of an object of the world."""
    return Door(lambda w: getattr(of(w), name), arguments, slow)


def one_of(*words: str) -> Kind:
    """Return the kind of some words, the first of them a good one."""
    return WORD.like(words[0])


FINITE = replace(
    NUMBER,
    bad={**NUMBER.bad, **{name: NUMBER.odd[name] for name in ("infinity", "minus infinity", "1e308", "huge whole")}},
    odd={k: v for k, v in NUMBER.odd.items() if k not in {"infinity", "minus infinity", "1e308", "huge whole"}},
)
"""A number that is not too large to calculate with."""
ROW = VALUES.like([1.0, 2.0, 3.0]).but("a scalar", "one less", "none", "one dimension more").without("by columns")
SAVED = written_to("out.o3l").but("strange suffix", "without a suffix")
LIMIT = LENGTH.but("infinity")
TABLE = OBJECT.without("a list").but("an array")
maybe_unit = UNIT.optional
maybe_length = LENGTH.optional
maybe_field = FIELD.optional
maybe_cloud = CLOUD.optional
smoothing = SIZE.optional
ORIENTED = with_normals(CLOUD)
SITES = CLOUD.but("a column more", "a column less")
KERNEL = one_of("cubic")
LATER = one_of("quintic").but("text", "empty text", "upper case")
"""A word that is looked up where it is used: which kernels there are depends on the dimension."""
DEGREE = WHOLE.like(1).optional
BALL = WHOLE.like(60).optional
OVERLAP = NUMBER.like(1.1)
scan = CLOUD.like(lambda w: w.strip)
midrib = CLOUD.like(lambda w: w.midrib)
MEASURE_OPTIONAL = one_of("auto").optional
PLACES = QUERIES.like(lambda w: w.plane)
FLAT = QUERIES.like(lambda w: w.flat)
ON_LEAF = QUERIES.like(lambda w: w.on_leaf)
REGION = BOX.like(lambda w: np.array([[2.0, -1.0], [4.0, 1.0]]))
FACTORS = VALUES.like([[1.0, 0.5], [0.75, 1.25]]).but("one less", "none")
"""A table."""
SHARES = VALUES.like([[1.0, 0.5], [0.25, 0.0]]).but("one less", "none")
SIDE = tuple_of(200, 120, whole=True)
VIEW = OBJECT.like(lambda w: view.View())
EXTENT = tuple_of(1.0, 0.7, 0.4).without("an array")
blade = OBJECT.like(lambda w: w.leaf.blade)
leaf = lambda w: w.leaf  # noqa: E731
out_mesh, out_picture = written_to("out.ply"), written_to("out.png")


def entered(size: Any) -> None:
    """Hold to a limit of memory; what it is is looked at where the block begins."""
    with o3l.memory_limit(size):
        pass


def entered_in_time(duration: Any) -> None:
    """Hold to a limit of time; as `entered`."""
    with o3l.time_limit(duration):
        pass


def set_for_a_moment(size: Any) -> None:
    """Set the limit of the process, and take it back."""
    try:
        o3l.set_memory_limit(size)
    finally:
        o3l.set_memory_limit(None)


MEMORY = WORD.like("100GB").without("None").but("a number")


def _fields() -> dict[str, Door]:
    """What is called with points, of every class that has it."""
    made = {}
    for name, of, where in (
        ("PUInterpolant", lambda w: w.pu, QUERIES),
        ("RBFInterpolant", lambda w: w.rbf, QUERIES),
        ("TiledField", lambda w: w.texture, QUERIES),
        ("PatchBlend", patch_blend, QUERIES),
        ("WangField", wang_tiles, QUERIES),
        ("ThinnedField", thinned, QUERIES),
        ("MultiscaleLeaf", leaf, ON_LEAF),
        ("samples.Sphere", lambda w: samples.Sphere(), QUERIES),
        ("samples.Torus", lambda w: samples.Torus(), QUERIES),
        ("samples.Block", lambda w: samples.Block(), QUERIES),
        ("samples.Wires", lambda w: samples.Wires(), QUERIES),
        ("samples.MeshSolid", lambda w: samples.MeshSolid.of(w.mesh), QUERIES),
        ("samples.LeafShape", lambda w: w.leaf_shape, ON_LEAF),
        ("samples.WheatBlade", lambda w: w.wheat, QUERIES),
        ("samples.WheatPatch", lambda w: w.patch, QUERIES),
    ):
        for called in ("__call__", "gradient"):
            made[f"{name}.{called}"] = method(of, called, **{"x" if of is leaf else "points": where})
    return made


def patch_blend(w: Any) -> Any:
    """Return a blend of two textures."""
    return o3l.PatchBlend([w.texture, w.texture], [4.0])


def thickness_map() -> Any:
    """Return a map of thickness over the world's plane."""
    return o3l.ThicknessMap([[1.0, 0.5], [0.8, 1.2]], [[0.0, -1.0], [10.0, 1.0]])


@cache
def wang_tiles(w: Any) -> Any:
    """Return tiles cut out of a patch."""
    return o3l.WangField(w.texture.field)


@cache
def thinned(w: Any) -> Any:
    """Return a texture with fewer hairs."""
    return o3l.ThinnedField(w.texture, [[0.5]], [[0.0, 0.0], [8.0, 2.0]])


def on_disk(w: Any) -> Any:
    """Return a volume that is read by parts."""
    return o3l.VolumeOnDisk(w.volume.data, w.volume.spacing, w.volume.origin, w.volume.unit)


PU = {
    "kernel": KERNEL,
    "degree": DEGREE,
    "smoothing": smoothing,
    "rho": smoothing,
    "points_per_ball": BALL,
    "overlap": OVERLAP,
}
REPORT = {"field": maybe_field, "cloud": maybe_cloud, "unit": maybe_unit}
MESHING = {
    "spacing": LENGTH.like(0.1),
    "region": REGION.optional,
    "closed": FLAG,
    "method": one_of("cubes"),
}

DOORS: dict[str, Door] = {
    "AlphaShape": door(o3l.AlphaShape, points=CLOUD.like(lambda w: w.plane), alpha=maybe_length),
    "AlphaShape.contains": method(lambda w: w.paper_leaf.blade.outline, "contains", points=PLACES),
    "Facets.moved": method(lambda w: o3l.facets_of(w.mesh), "moved", origin=VECTOR),
    "Blade.window": method(lambda w: w.leaf.blade, "window", x=VECTOR.like(lambda w: w.strip[0]), size=LENGTH),
    "Blade.distortion": method(lambda w: w.leaf.blade, "distortion", plane=PLACES.optional),
    "BladeOptions": door(
        o3l.BladeOptions,
        lacks=True,
        frame=one_of("surface").later,
        smoothing=smoothing,
        up=VECTOR.later.optional,
        base=VECTOR.later.optional,
        piece=WHOLE.like(1).optional,
        one_sheet=FLAG,
        keep_petiole=FLAG,
        fill_holes=SIZE.optional,
        complete_margin=maybe_length,
        rim_radius=maybe_length,
        thickness=FACTORS.later.optional,
        hair_density=SHARES.later.optional,
        hair_seed=WHOLE.like(0),
        alpha=maybe_length,
        offset=one_of("up").later,
    ),
    "ChartSurface.fit": door(
        o3l.ChartSurface.fit,
        parameters=CLOUD.like(lambda w: w.leaf_points[:, :2]),
        points=CLOUD.like(lambda w: w.strip),
        smoothing=SIZE.like(1e-3),
        weights=VALUES.like(lambda w: np.ones(len(w.strip))).optional,
        unit=maybe_unit,
        bounds=BOX.like(lambda w: np.array([[-1.0, -4.0], [10.0, 4.0]])).optional,
        points_per_ball=BALL,
    ),
    "ChartSurface.jet": method(lambda w: w.leaf.blade.surface, "jet", uv=PLACES, order=WHOLE.like(1)),
    "ChartSurface.normals": method(lambda w: w.leaf.blade.surface, "normals", uv=PLACES),
    "ChartSurface.metric": method(lambda w: w.leaf.blade.surface, "metric", uv=PLACES),
    "ChartSurface.curvatures": method(lambda w: w.leaf.blade.surface, "curvatures", uv=PLACES),
    "ChartSurface.feet": method(
        lambda w: w.leaf.blade.surface, "feet", x=ON_LEAF, start=PLACES.optional, samples=OBJECT.optional
    ),
    "CreasedSplines": door(
        o3l.CreasedSplines,
        angle=NUMBER.like(40.0),
        kernel=LATER,
        degree=DEGREE,
        smoothing=smoothing,
        rho=smoothing,
        points_per_ball=BALL,
    ),
    "CurlFree": door(
        o3l.CurlFree,
        kernel=LATER,
        degree=DEGREE,
        smoothing=SIZE,
        exact=FLAG,
        points_per_ball=WHOLE.like(50),
    ),
    "FitQuality.of": door(o3l.FitQuality.of, blade=blade, scan=scan, slow=True),
    "HeightMap.fit": door(
        o3l.HeightMap.fit,
        slow=True,
        leaf_points=CLOUD.like(lambda w: w.leaf_points),
        **{name: kind for name, kind in PU.items() if name != "degree"},
        unit=maybe_unit,
    ),
    "HeightMap.__call__": method(lambda w: w.paper_leaf.blade.height_map, "__call__", plane=PLACES),
    "HeightMap.gradient": method(lambda w: w.paper_leaf.blade.height_map, "gradient", plane=PLACES),
    "HeightMap.jet": method(lambda w: w.paper_leaf.blade.height_map, "jet", plane=PLACES, order=WHOLE.like(1)),
    "HeightMapBlade": door(
        o3l.HeightMapBlade,
        frame=OBJECT.like(lambda w: w.paper_leaf.blade.frame),
        height_map=OBJECT.like(lambda w: w.paper_leaf.blade.height_map),
        outline=OBJECT.like(lambda w: w.paper_leaf.blade.outline),
        offset=one_of("up"),
    ),
    "HeightMapBlade.flatten": method(lambda w: w.paper_leaf.blade, "flatten", x=ON_LEAF),
    "HeightMapBlade.lift": method(lambda w: w.paper_leaf.blade, "lift", flat=FLAT),
    "HeightMapBlade.frame_quality": method(lambda w: w.paper_leaf.blade, "frame_quality", points=scan),
    "HeightMapBlade.extract_mesh": method(
        lambda w: w.paper_leaf.blade, "extract_mesh", spacing=LENGTH.like(0.4), region=REGION.optional
    ),
    "Hermite": door(
        o3l.Hermite,
        kernel=LATER,
        degree=DEGREE,
        smoothing=SIZE,
        step=LENGTH.like(1.0),
        points_per_ball=WHOLE.like(50),
    ),
    "LeafFrame.fit": door(
        o3l.LeafFrame.fit,
        points=scan,
        midrib=midrib,
        radius=maybe_length,
        up=VECTOR.optional,
        base=VECTOR.optional,
        degree=WHOLE.like(3),
        unit=maybe_unit,
    ),
    "LeafFrame.stations": method(lambda w: w.paper_leaf.blade.frame, "stations", t=ROW),
    "LeafFrame.to_leaf": method(lambda w: w.paper_leaf.blade.frame, "to_leaf", x=ON_LEAF),
    "LeafFrame.to_world": method(lambda w: w.paper_leaf.blade.frame, "to_world", y=FLAT),
    "LeafFrame.jacobian": method(lambda w: w.paper_leaf.blade.frame, "jacobian", y=FLAT),
    "LeafFrame.quality": method(lambda w: w.paper_leaf.blade.frame, "quality", points=scan),
    "Margin": door(
        o3l.Margin,
        points=CLOUD.like(lambda w: w.plane),
        ring=CLOUD.like(lambda w: np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]])),
        hole_rings=TABLE.like(()),
        spacing=LENGTH.like(0.5),
        holes=TABLE.like(()),
        notes=TABLE.like(()),
        unit=maybe_unit,
    ),
    "Margin.fit": door(
        o3l.Margin.fit,
        slow=True,
        uv=CLOUD.like(lambda w: w.leaf_points[:, :2]),
        spacing=maybe_length,
        fill_holes=SIZE.optional,
        noise=SIZE.like(0.0),
        thinned_to=SIZE.optional,
        lift=OBJECT.optional,
        unit=maybe_unit,
    ),
    "Margin.contains": method(lambda w: w.leaf.blade.outline, "contains", points=PLACES),
    "MovingLeastSquares": door(
        o3l.MovingLeastSquares, degree=WHOLE.like(3), step=LENGTH.like(1.0), points_per_ball=WHOLE.like(50)
    ),
    "MultiscaleLeaf": door(
        o3l.MultiscaleLeaf,
        texture=OBJECT.like(lambda w: w.texture),
        frame=OBJECT.like(lambda w: w.paper_leaf.blade.frame),
        height_map=OBJECT.like(lambda w: w.paper_leaf.blade.height_map),
        outline=OBJECT.like(lambda w: w.paper_leaf.blade.outline),
        offset=one_of("up"),
        blade=OBJECT.like(lambda w: w.leaf.blade).optional,
    ),
    "MultiscaleLeaf.save": method(leaf, "save", path=SAVED),
    "MultiscaleLeaf.plan_mesh": method(
        leaf, "plan_mesh", **MESHING, simplify=NUMBER.like(0.5).optional, remesh_tile=maybe_length, slow=True
    ),
    "MultiscaleLeaf.extract_mesh": method(leaf, "extract_mesh", **MESHING, remesh=maybe_length, slow=True),
    "MultiscaleLeaf.write_mesh": method(leaf, "write_mesh", path=out_mesh, **MESHING, remesh=maybe_length, slow=True),
    "MultiscaleLeaf.extract_tile": method(leaf, "extract_tile", spacing=LENGTH.like(0.2)),
    "MultiscaleLeaf.extract_levels": method(
        leaf,
        "extract_levels",
        spacing=LENGTH.like(0.2),
        levels=OBJECT.like([([[2.0, -1.0], [4.0, 1.0]], 0.1)]).without("a list"),
        closed=FLAG,
        slow=True,
    ),
    "MultiscaleLeaf.signed_distance": method(leaf, "signed_distance", x=ON_LEAF, closed=FLAG, slow=True),
    "MultiscaleLeaf.closest_points": method(leaf, "closest_points", x=ON_LEAF, closed=FLAG, slow=True),
    "MultiscaleLeaf.project": method(leaf, "project", x=ON_LEAF, slow=True),
    "MultiscaleLeaf.mean_curvature": method(leaf, "mean_curvature", x=ON_LEAF, slow=True),
    "MultiscaleLeaf.write_grid": method(
        leaf,
        "write_grid",
        path=written_to("out.vti"),
        spacing=STEP,
        bounds=BOX.optional,
        what=one_of("field"),
        closed=FLAG,
        slow=True,
    ),
    "OrientedCloud.of": door(
        o3l.OrientedCloud.of,
        cloud=CLOUD,
        normals=NORMALS.optional,
        weights=VALUES.like(lambda w: np.ones(300)).optional,
        spacing=STEP.optional,
    ),
    "PUInterpolant.fit": door(
        o3l.PUInterpolant.fit,
        points=SITES,
        values=MORE_VALUES,
        **PU,
        weights=VALUES.like(lambda w: np.ones(300)).optional,
        groups=VALUES.like(lambda w: np.arange(300)).optional,
        share=FINITE.like(0.0),
        normals=NORMALS.optional,
        local=OBJECT.without("a function", "its class").optional,
        unit=maybe_unit,
        bounds=BOX.optional,
    ),
    "PUInterpolant.fit_oriented": door(
        o3l.PUInterpolant.fit_oriented,
        points=CLOUD,
        normals=NORMALS,
        local=one_of("hermite"),
        points_per_ball=BALL,
        overlap=OVERLAP,
        unit=maybe_unit,
        bounds=BOX.optional,
    ),
    "PUInterpolant.fit_lattice": door(
        o3l.PUInterpolant.fit_lattice,
        values=VALUES.like(lambda w: w.lattice)
        .without("one less", "backwards twice", "a list", "single precision", "long double")
        .but("one dimension more"),
        spacing=STEP.like(0.25),
        origin=VECTOR.optional,
        transform=BOX.like(np.eye(4)).without("upside down").optional,
        isovalue=NUMBER.like(0.0),
        mask=VALUES.like(lambda w: np.ones((9, 9, 9), bool)).without("all equal").optional,
        band=FLAG,
        **PU,
        unit=maybe_unit,
        bounds=BOX.optional,
    ),
    "PUInterpolant.rough": method(lambda w: w.pu, "rough", points=QUERIES),
    "PUInterpolant.diagnostics": method(
        lambda w: w.pu, "diagnostics", balls=VALUES.like(lambda w: np.array([0, 1])).without("one less").optional
    ),
    "PUInterpolant.on_lattice": method(lambda w: w.pu, "on_lattice", bounds=BOX, spacing=STEP),
    "PUInterpolant.save": method(lambda w: w.pu, "save", path=SAVED),
    "PUInterpolant.hessian": method(lambda w: w.pu, "hessian", points=QUERIES),
    "ParametricBlade": door(
        o3l.ParametricBlade,
        surface=OBJECT.like(lambda w: w.leaf.blade.surface),
        outline=OBJECT.like(lambda w: w.leaf.blade.outline).later,
        rim_radius=maybe_length,
        notes=TABLE.like(()),
        thickness=OBJECT.like(lambda w: thickness_map()).optional,
        petiole=OBJECT.like(lambda w: Petiole(9.0, 1.0, 9.0, (0, 0, 0), (9, 0, 0), (1, 0, 0))).optional,
        other_pieces=QUERIES.optional,
        several_pieces=FLAG,
    ),
    "ThicknessMap": door(o3l.ThicknessMap, factors=FACTORS, bounds=REGION),
    "ThicknessMap.values": Door(lambda _: thickness_map().values, {"uv": PLACES}),
    "ThicknessMap.jet": Door(lambda _: thickness_map().jet, {"uv": PLACES}),
    "ParametricBlade.flatten": method(lambda w: w.leaf.blade, "flatten", x=ON_LEAF),
    "ParametricBlade.lift": method(lambda w: w.leaf.blade, "lift", flat=FLAT),
    "ParametricBlade.extract_mesh": method(
        lambda w: w.leaf.blade, "extract_mesh", spacing=LENGTH.like(0.4), region=REGION.optional
    ),
    "PatchBlend": door(
        o3l.PatchBlend,
        textures=OBJECT.like(lambda w: [w.texture, w.texture]).without("a list"),
        breaks=VALUES.like([4.0]).but("a scalar").without("one less", "none"),
        fade=maybe_length,
        axis=one_of("along"),
        period=VECTOR.like((2.0, 2.0)).but("one dimension more", "a scalar").optional,
    ),
    "PatchBlend.save": method(patch_blend, "save", path=SAVED),
    "RBFInterpolant.fit": door(
        o3l.RBFInterpolant.fit,
        points=SITES,
        values=MORE_VALUES,
        kernel=KERNEL,
        epsilon=maybe_length,
        degree=DEGREE,
        smoothing=smoothing,
        rho=smoothing,
        weights=VALUES.like(lambda w: np.ones(300)).optional,
        unit=maybe_unit,
    ),
    "RBFInterpolant.save": method(lambda w: w.rbf, "save", path=SAVED),
    "RBFInterpolant.hessian": method(lambda w: w.rbf, "hessian", points=QUERIES),
    "TextureOptions": door(
        o3l.TextureOptions,
        lacks=True,
        level=NUMBER.later,
        rho=SIZE,
        period=VECTOR.like((2.0, 2.0)).later.optional,
        flip=one_of("along").later.optional,
        shift=NUMBER.like(0.0),
        tiles=one_of("wang").later,
        seed=WHOLE.like(0),
    ),
    "TiledField": door(
        o3l.TiledField,
        field=OBJECT.like(lambda w: w.texture.field),
        period=VECTOR.like((2.0, 2.0)).but("one dimension more", "a scalar").optional,
        offset=VECTOR.like((0.0, 0.0)).but("a scalar").optional,
        fade=VECTOR.like((0.2, 0.2)).but("a scalar").optional,
        flip=one_of("along").optional,
        shift=NUMBER.like(0.0),
    ),
    "TiledField.seam_energy": method(lambda w: w.texture, "seam_energy", width=SIZE.like(0.0)),
    "TiledField.save": method(lambda w: w.texture, "save", path=SAVED),
    "WangField": door(
        o3l.WangField,
        fields=OBJECT.like(lambda w: w.texture.field).without("a list"),
        tile=VECTOR.like((0.8, 0.8)).but("one dimension more").optional,
        seed=WHOLE.like(0).optional,
        quilt=OBJECT.like(lambda w: wang_tiles(w).quilt).optional,
    ),
    "WangField.kinds": method(wang_tiles, "kinds", places=QUERIES.like(np.array([[0.0, 0.0], [3.0, -4.0]]))),
    "WangField.save": method(wang_tiles, "save", path=SAVED),
    "ThinnedField": door(
        o3l.ThinnedField,
        texture=OBJECT.like(lambda w: w.texture),
        shares=SHARES,
        box=REGION,
        seed=WHOLE.like(0),
        longest=LENGTH.like(0.1).optional,
        zones=OBJECT.like(lambda w: thinned(w).zones).optional,
    ),
    "ThinnedField.save": method(thinned, "save", path=SAVED),
    "Volume": door(
        o3l.Volume,
        data=VALUES.like(lambda w: w.volume.data)
        .without("one less", "backwards twice", "single precision", "long double", "read-only")
        .but("a scalar"),
        spacing=STEP,
        origin=VECTOR,
        unit=maybe_unit,
    ),
    "Volume.threshold": method(lambda w: w.volume, "threshold", method=one_of("valley").but("a number")),
    "Volume.to_samples": method(
        lambda w: w.volume,
        "to_samples",
        level=NUMBER.like(50.0),
        mask=VALUES.like(lambda w: np.ones(w.volume.shape, bool)).without("all equal").optional,
        transform=BOX.like(np.eye(4)).without("upside down").optional,
        bounds=BOX.optional,
    ),
    "Volume.crop": method(lambda w: w.volume, "crop", bounds=BOX),
    "VolumeOnDisk": door(
        o3l.VolumeOnDisk,
        voxels=OBJECT.like(lambda w: w.volume.data),
        spacing=STEP,
        origin=VECTOR,
        unit=maybe_unit,
    ),
    "VolumeOnDisk.threshold": method(on_disk, "threshold", method=one_of("mixture")),
    "VolumeOnDisk.crop": method(on_disk, "crop", bounds=BOX),
    "adaptive_down_sample": door(o3l.adaptive_down_sample, cloud=ORIENTED),
    "align_blade": door(
        o3l.align_blade,
        volume=OBJECT.like(lambda w: w.volume),
        level=NUMBER.like(50.0),
        up=VECTOR.optional,
        along=VECTOR.like((1.0, 0.0, 0.0)).optional,
    ),
    "check_report": door(
        o3l.check_report, report=OBJECT.like(lambda w: w.report), require=WORD.like("watertight").but("empty text")
    ),
    "clean_mesh": door(
        o3l.clean_mesh,
        mesh=MESH,
        merge=SIZE.like(0.0),
        smallest_component=SIZE.like(0.0),
        smallest_area=SIZE.like(0.0),
        fewest_triangles=WHOLE.like(0),
        largest_hole=SIZE.like(0.0),
        smallest_height=SIZE.like(0.0),
        fold_angle=SIZE.like(1.0),
        untangle=FLAG,
        orient=FLAG.like(True),
    ),
    "color_by_support": door(
        o3l.color_by_support,
        mesh=MESH,
        support=OBJECT.like(lambda w: w.support),
        measure=one_of("distance"),
        color_map=one_of("viridis"),
        limits=tuple_of(0.0, 1.0).optional,
    ),
    "create_blade": door(
        o3l.create_blade,
        scan=scan,
        midrib=midrib.optional,
        unit=UNIT,
        options=OBJECT.like(lambda w: o3l.BladeOptions()).optional,
        slow=True,
    ),
    "create_from_point_cloud_rbfpu": door(
        o3l.create_from_point_cloud_rbfpu,
        pcd=CLOUD.but("a NaN", "an infinity", "minus infinity"),
        spacing=LENGTH.like(0.1).optional,
        rho=smoothing,
        smoothing=smoothing,
        local=one_of("rbf"),
        creases=NUMBER.like(40.0).optional,
        points_per_ball=BALL,
        unit=maybe_unit,
        viewpoint=VECTOR.optional,
        prepare=CALLABLE.optional,
        merge=CALLABLE.optional,
        constraints=CALLABLE.optional,
        closed=one_of("auto").optional,
        trim=CALLABLE.optional,
        clean=CALLABLE.optional,
        attributes=CALLABLE.optional,
        measure=MEASURE_OPTIONAL,
        slow=True,
    ),
    "create_multiscale_leaf": door(
        o3l.create_multiscale_leaf,
        scan=scan,
        volume=OBJECT.like(lambda w: w.texture),
        midrib=midrib.optional,
        unit=UNIT,
        blade=OBJECT.like(lambda w: o3l.BladeOptions()).optional,
        texture=OBJECT.like(lambda w: o3l.TextureOptions()).optional,
        slow=True,
    ),
    "create_texture": door(
        o3l.create_texture,
        volume=OBJECT.like(lambda w: w.volume),
        options=OBJECT.like(lambda w: o3l.TextureOptions()).optional,
    ),
    "detect_outliers": door(
        o3l.detect_outliers,
        cloud=CLOUD,
        max_gap=LIMIT.like(3.0),
        max_ratio=LIMIT.like(8.0),
        max_clutter=LIMIT.like(8.0),
        std_ratio=LIMIT.like(2.0),
    ),
    "distance_mask": door(o3l.distance_mask, cloud=CLOUD, factor=LENGTH.like(2.0)),
    "draw_figures": door(
        o3l.draw_figures,
        leaf=OBJECT.like(lambda w: w.leaf),
        folder=folder_at("figures"),
        scan=maybe_cloud,
        volume=OBJECT.like(lambda w: w.volume).optional,
        level=NUMBER.like(50.0),
        formats=OBJECT.like(["png"]).without("a list", "an array"),
        only=OBJECT.like(["cross-section"]).without("None", "a list", "an array"),  # all of them take long
        slow=True,
    ),
    "estimate_noise": door(o3l.estimate_noise, cloud=CLOUD),
    "estimate_normals": door(o3l.estimate_normals, cloud=CLOUD),
    "export_distance": door(
        o3l.export_distance,
        mesh=MESH,
        path=written_to("out.vti"),
        spacing=LENGTH.like(0.2),
        bounds=BOX.optional,
        unit=maybe_unit,
        to_unit=maybe_unit,
    ),
    "export_facets": door(
        o3l.export_facets,
        facets=OBJECT.like(lambda w: o3l.facets_of(w.mesh)),
        path=written_to("out.vtp"),
        to_unit=maybe_unit,
    ),
    "export_mesh": door(
        o3l.export_mesh,
        mesh=MESH,
        path=out_mesh,
        labels=VALUES.like(lambda w: np.zeros(len(w.mesh[1]), np.uint8)).optional,
        unit=maybe_unit,
        to_unit=maybe_unit,
        consumer=one_of("paraview").optional,
        scalars=OBJECT.like(lambda w: {"a": np.ones(len(w.mesh[0]))}).optional,
    ),
    "export_particles": door(
        o3l.export_particles,
        particles=OBJECT.like(lambda w: w.particles),
        path=written_to("out.vtp"),
        to_unit=maybe_unit,
    ),
    "extract_isosurface": door(
        o3l.extract_isosurface,
        field=FIELD,
        spacing=STEP.like(0.2),
        bounds=BOX.like(lambda w: np.array([[-0.6] * 3, [0.6] * 3])).optional,
        isovalue=NUMBER.like(0.0),
        method=one_of("cubes"),
        closed=FLAG.optional,
        seeds=CLOUD.but("times 1e-200").optional,
        within=CALLABLE.optional,
        sharpen=FLAG,
        features=FLAG,
    ),
    "facets_of": door(
        o3l.facets_of,
        mesh=MESH,
        field=OBJECT.optional,
        vertical=VECTOR.like([0.0, 0.0, 1.0]),
        labels=VALUES.like(lambda w: np.zeros(len(w.mesh[1]), np.uint8)).optional,
        unit=maybe_unit,
    ),
    "fill_particles": door(o3l.fill_particles, mesh=MESH, step=LENGTH.like(0.2), unit=maybe_unit),
    "find_inverted_regions": door(o3l.find_inverted_regions, mesh=MESH, cloud=ORIENTED),
    "find_pieces": door(o3l.find_pieces, scan=scan, unit=maybe_unit, one_sheet=FLAG, slow=True),
    "find_midrib": door(o3l.find_midrib, slow=True, cloud=CLOUD.like(lambda w: w.long_strip)),
    "fit_surface": door(
        o3l.fit_surface,
        cloud=ORIENTED,
        rho=smoothing,
        smoothing=smoothing,
        local=one_of("rbf"),
        constraints=CALLABLE.optional,
        creases=NUMBER.like(40.0).optional,
        points_per_ball=BALL,
        margin=SIZE.optional,
        unit=maybe_unit,
        slow=True,
    ),
    "inspect_mesh": door(o3l.inspect_mesh, mesh=MESH, **REPORT, isovalue=NUMBER.like(0.0)),
    "interpolate_attributes": door(
        o3l.interpolate_attributes,
        cloud=QUERIES.like(lambda w: w.points).but("a NaN", "an infinity", "minus infinity"),
        places=QUERIES,
    ),
    "load": door(o3l.load, path=read_from("good.o3l")),
    "memory_limit": door(entered, size=MEMORY),
    "set_memory_limit": door(set_for_a_moment, size=MEMORY),
    "time_limit": door(entered_in_time, duration=WORD.like("2h").without("None").but("a number")),
    "mesh_report": door(o3l.mesh_report, mesh=MESH, **REPORT, isovalue=NUMBER.like(0.0)),
    "offset_constraints": door(
        o3l.offset_constraints,
        cloud=ORIENTED,
        distance=STEP.like(0.02).optional,
        every=WHOLE,
        sides=one_of("both"),
        floor=SIZE.like(0.2),
    ),
    "orient_normals": door(o3l.orient_normals, cloud=CLOUD, normals=NORMALS.but("all zero").optional),
    "point_spacing": door(o3l.point_spacing, cloud=CLOUD),
    "VoxelLayout": door(
        o3l.VoxelLayout,
        dataset=TITLE.like("scan").optional,
        axes=WORD.like("zyx").optional,
        shape=OBJECT.optional,
        offset=WHOLE.optional,
    ),
    "polyharmonic": door(o3l.polyharmonic, m=WHOLE.like(2), d=WHOLE.like(3)),
    "preprocess_point_cloud": door(
        o3l.preprocess_point_cloud,
        cloud=CLOUD.but("a NaN", "an infinity", "minus infinity"),
        normals=NORMALS.but("all zero", "a NaN", "an infinity", "minus infinity").optional,
        viewpoint=VECTOR.optional,
        voxel_size=maybe_length,
        outliers=CALLABLE.optional,
        branchings=CALLABLE.optional,
        estimate=CALLABLE.optional,
        orient=CALLABLE.optional,
    ),
    "read_mesh": door(o3l.read_mesh, path=read_from("good.ply")),
    "read_point_cloud": door(
        o3l.read_point_cloud,
        path=read_from("good.xyz").without("cut off"),
        least=WHOLE,
        finite=FLAG,
        columns=WORD.like("x y z").optional,
    ),
    "open_volume": door(
        o3l.open_volume,
        path=read_from("good.tif"),
        spacing=STEP.optional,
        unit=maybe_unit,
        origin=VECTOR.optional,
        layout=OBJECT.optional,
    ),
    "read_volume": door(
        o3l.read_volume,
        path=read_from("good.tif"),
        spacing=STEP.optional,
        unit=maybe_unit,
        origin=VECTOR.optional,
        layout=OBJECT.optional,
    ),
    "remove_bend": door(o3l.remove_bend, volume=OBJECT.like(lambda w: w.volume), level=NUMBER.like(50.0)),
    "remove_drift": door(o3l.remove_drift, volume=OBJECT.like(lambda w: w.volume)),
    "remove_rings": door(
        o3l.remove_rings, volume=OBJECT.like(lambda w: w.volume), axis=VECTOR.like((1.0, 0.0)).optional
    ),
    "remesh": door(
        o3l.remesh,
        mesh=MESH,
        target_edge=LENGTH.like(0.2),
        field=maybe_field,
        isovalue=NUMBER.like(0.0),
        deviation=maybe_length,
    ),
    "sample_boundary": door(
        o3l.sample_boundary,
        mesh=MESH,
        spacing=LENGTH.like(0.2),
        layers=WHOLE.like(2),
        field=OBJECT.optional,
        labels=VALUES.like(lambda w: np.zeros(len(w.mesh[1]), np.uint8)).optional,
        unit=maybe_unit,
        seed=WHOLE,
    ),
    "sample_particles": door(
        o3l.sample_particles,
        mesh=MESH,
        spacing=LENGTH.like(0.2),
        labels=VALUES.like(lambda w: np.zeros(len(w.mesh[1]), np.uint8)).optional,
        unit=maybe_unit,
        seed=WHOLE,
    ),
    "set_num_threads": door(o3l.set_num_threads, threads=WHOLE.like(2)),
    "show_progress": door(o3l.show_progress, title=TITLE.optional, quiet=FLAG),
    "simplify_mesh": door(
        o3l.simplify_mesh,
        mesh=MESH,
        target_triangles=WHOLE.like(50),
        target_edge=maybe_length,
        deviation=SIZE.optional,
        quality=NUMBER.like(0.3),
    ),
    "surface_distance": door(o3l.surface_distance, mesh=MESH, other=MESH),
    "trim_to_data": door(
        o3l.trim_to_data,
        mesh=MESH,
        cloud=ORIENTED,
        factor=LENGTH.like(2.0),
        margin=SIZE.like(0.5),
        noise=SIZE.optional,
    ),
    "vertex_support": door(
        o3l.vertex_support,
        lacks=True,
        mesh=MESH.but("vertices alone"),
        cloud=CLOUD,
        field=FIELD.later.optional,
        measures=OBJECT.like(("distance",)).without("a list"),
    ),
    "voxel_down_sample": door(o3l.voxel_down_sample, cloud=ORIENTED, voxel_size=LENGTH.like(0.1)),
    "write_mesh": door(
        o3l.write_mesh, mesh=MESH, path=out_mesh, comments=OBJECT.like(("a",)).without("a list").optional
    ),
    "write_report": door(
        o3l.write_report,
        mesh=MESH,
        path=written_to("out.html"),
        **REPORT,
        require=WORD.like("watertight").but("empty text"),
        title=TITLE,
        slow=True,
    ),
    "write_volume": door(
        o3l.write_volume,
        volume=OBJECT.like(lambda w: w.volume),
        path=written_to("out.tif").but("strange suffix", "without a suffix"),
    ),
    # samples
    "samples.Block": door(samples.Block, sides=EXTENT),
    "samples.Figure": door(samples.Figure, parts=TABLE.like(samples.Figure().parts), blend=LENGTH.like(0.012)),
    "samples.MeshSolid.of": door(samples.MeshSolid.of, mesh=MESH),
    "samples.Sphere": door(samples.Sphere, radius=LENGTH),
    "samples.Torus": door(samples.Torus, radius=LENGTH, tube=LENGTH.like(0.15)),
    "samples.WavySheet": door(
        samples.WavySheet,
        length=LENGTH.like(1.0),
        width=LENGTH.like(0.7),
        thickness=LENGTH.like(0.06),
        amplitude=SIZE.like(0.05),
        wave=LENGTH,
    ),
    "samples.Solid.closest": method(lambda w: w.ball, "closest", points=QUERIES),
    "samples.Solid.signed_distance": method(lambda w: w.ball, "signed_distance", points=QUERIES),
    "samples.Solid.sample": method(lambda w: w.ball, "sample", count=WHOLE.like(20).without("10^9"), seed=WHOLE),
    "samples.WheatBlade": door(
        samples.WheatBlade,
        length=LENGTH.like(200.0),
        width=LENGTH.like(11.3),
        base=VECTOR.like((360.0, 730.0, 96.0)).but("a scalar"),
        rise=NUMBER,
        droop=NUMBER.like(-1.0),
        swing=NUMBER.like(0.4),
        twist=NUMBER.like(1.0),
        half_thickness=LENGTH.like(0.1),
        unit=UNIT,
    ),
    "samples.WheatBlade.axis": method(lambda w: w.wheat, "axis", along=ROW),
    "samples.WheatBlade.frame": method(lambda w: w.wheat, "frame", along=ROW),
    "samples.WheatBlade.half_width": method(lambda w: w.wheat, "half_width", along=ROW),
    "samples.WheatBlade.height": method(lambda w: w.wheat, "height", along=ROW, across=ROW),
    "samples.WheatBlade.surface": method(lambda w: w.wheat, "surface", along=ROW, across=ROW),
    "samples.WheatBlade.closest": method(lambda w: w.wheat, "closest", points=QUERIES),
    "samples.WheatPatch.faces": method(lambda w: w.patch, "faces", points=PLACES),
    "samples.Wires": door(
        samples.Wires, places=TABLE.like(samples.Wires().places), radius=LENGTH.like(0.1), length=LENGTH
    ),
    "samples.bumps": door(samples.bumps, slow=True, height=SIZE.like(0.01), wave=LENGTH.like(0.15)),
    "samples.fins": door(samples.fins, slow=True, thickness=LENGTH.like(0.04)),
    "samples.fold": door(samples.fold, slow=True, distance=LENGTH.like(0.04)),
    "samples.gap": door(samples.gap, slow=True, width=LENGTH.like(0.04)),
    "samples.leaf_shape": door(
        samples.leaf_shape,
        kind=one_of("petiole").without("upper case"),
        parameters=named(
            length=LENGTH.like(80.0),
            width=LENGTH.like(40.0),
            stalk=LENGTH.like(45.0),
            stub=LENGTH.like(16.0),
            arch=FINITE.like(60.0),
        ),
    ),
    **{
        f"samples.leaf_shape.{kind}": door(partial(samples.leaf_shape, kind), parameters=named(**parameters))
        for kind, parameters in {
            "curled": {"angle": FINITE.like(110.0), "arch": FINITE.like(0.0)},
            "eaten": {"hole": SIZE.like(10.0), "notch": SIZE.like(6.0)},
            "lobed": {"lobes": LENGTH.like(5.0), "depth": SIZE.like(0.25)},
            "cupped": {"radius": LENGTH.like(40.0)},
            "layers": {"height": SIZE.like(0.5)},
        }.items()
    },
    "samples.scan_leaf": door(
        samples.scan_leaf,
        leaf=OBJECT.like(lambda w: w.leaf_shape),
        options=named(
            spacing=LENGTH.like(2.0),
            pattern=one_of("random"),
            noise=SIZE.like(0.0),
            gaps=one_of("none"),
            passes=WHOLE.like(1),
            offset=SIZE.like(0.0).optional,
            flying=SIZE.like(0.0),
            seed=WHOLE.like(0),
        ),
        slow=True,
    ),
    **{
        f"samples.LeafShape.{name}": method(lambda w: w.leaf_shape, name, plane=PLACES)
        for name in ("lift", "jacobian", "normals", "stretch", "contains")
    },
    **{
        f"samples.LeafShape.{name}": method(lambda w: w.leaf_shape, name, step=LENGTH.like(2.0))
        for name in ("margin_places", "margin", "mesh")
    },
    "samples.LeafShape.closest": method(lambda w: w.leaf_shape, "closest", points=ON_LEAF),
    "samples.wheat_ct": door(
        samples.wheat_ct,
        seed=WHOLE,
        spacing=LENGTH.like(60.0),
        size=tuple_of(600.0, 600.0, 480.0),
        noise=SIZE.like(0.01),
        drift=NUMBER.like(0.1),
        ridges=LENGTH.like(3.0).optional,
        slow=True,
    ),
    "samples.wheat_scan": door(
        samples.wheat_scan,
        seed=WHOLE,
        count=WHOLE.like(500).without("10^9"),
        noise=SIZE.like(0.1),
        misregistration=SIZE.like(0.15),
        holes=WHOLE.like(1).without("10^9"),
        outliers=WHOLE.like(0).without("10^9"),
    ),
    "samples.write_leaf_scans": door(samples.write_leaf_scans, folder=folder_at("leaves"), seed=WHOLE, slow=True),
    "samples.write_samples": door(samples.write_samples, folder=folder_at("samples"), seed=WHOLE, slow=True),
    # view
    "view.Camera.project": method(lambda w: w.camera, "project", points=QUERIES, size=SIDE),
    "view.View": door(
        view.View,
        direction=tuple_of(0.0, 0.0, 1.0).but("an infinity").optional,
        tilt=NUMBER.like(20.0),
        turn=NUMBER.like(0.0),
        perspective=FLAG,
        smooth=FLAG,
        supersampling=WHOLE.like(1),
        text=LENGTH.like(1.0),
    ),
    "view.render": door(
        view.render,
        mesh=MESH.but("a cloud", "vertices alone"),  # are drawn as they are
        path=out_picture.optional,
        size=SIDE,
        insets=OBJECT.like(lambda w: [view.Inset(w.mesh)]).without("a list").optional,
        scalars=VALUES.like(lambda w: np.arange(len(w.mesh[0])) + 0.0).optional,
        scale_bar=FLAG,
        unit=maybe_unit,
        title=TITLE.optional,
        view=VIEW.optional,
        engine=one_of("cpu"),
        slow=True,
    ),
    "view.render_distortion": door(
        view.render_distortion,
        blade=blade,
        path=out_picture.optional,
        measure=one_of("area"),
        flat=FLAG,
        spacing=LENGTH.like(0.5).optional,
        options=named(
            size=SIDE,
            view=VIEW.optional,
            title=TITLE.optional,
            scale_bar=FLAG,
            unit=maybe_unit,
            insets=OBJECT.like(lambda w: [view.Inset(w.mesh)]).without("a list").optional,
            engine=one_of("cpu"),
        ),
        slow=True,
    ),
    "view.render_pieces": door(
        view.render_pieces,
        pieces=OBJECT.like(lambda w: w.pieces),
        path=out_picture.optional,
        unit=maybe_unit,
        size=SIDE,
        view=VIEW.optional,
        title=TITLE.optional,
        slow=True,
    ),
    "view.render_residuals": door(
        view.render_residuals,
        blade=blade,
        scan=scan,
        path=out_picture.optional,
        signed=FLAG,
        flat=FLAG,
        spacing=LENGTH.like(0.5).optional,
        fit=OBJECT.like(lambda w: w.fit_quality).optional,
        size=SIDE,
        view=VIEW.optional,
        slow=True,
    ),
    "view.write_midrib": door(view.write_midrib, control=CLOUD.like(lambda w: w.midrib), path=written_to("out.ply")),
    **_fields(),
}
