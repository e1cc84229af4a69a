"""The command line: each command reads files, does one job of the package, and writes files."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from o3dleaf.commands.terminal import shown
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.parallel import set_num_threads

FAILED = 1
"""Exit code of a mesh that is not what it must be."""

app = typer.Typer(
    help="Laser scan and micro-CT of a leaf into one multi-scale surface.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Output = Annotated[Path, typer.Option("--output", "-o", help="File to write.")]
CtUnit = Annotated[
    str | None, typer.Option(help="Unit to take the volume in: lengths that its file states are converted.")
]
VoxelSpacing = Annotated[float | None, typer.Option(help="Edge of a voxel, in ct-unit, if the file does not say.")]
Level = Annotated[str, typer.Option(help="Intensity of the surface: a number, 'valley' or 'otsu'.")]
Rho = Annotated[
    str, typer.Option(help="The paper's rho for the micro-structure, in ct-unit³, 'gcv' or 'gcv-per-ball'.")
]
Period = Annotated[
    str | None,
    typer.Option(help="Size of a tile, 'ALONG ACROSS' in ct-unit, or 'best': the one whose faces match best."),
]
Flip = Annotated[str | None, typer.Option(help="Mirror every second tile: along, across or both.")]
Shift = Annotated[float, typer.Option(help="Shift rows of tiles along by this share of one, like bricks.")]
Threads = Annotated[int | None, typer.Option(help="Threads; all cores by default. Results do not depend on it.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress.")]
Unit = Annotated[str | None, typer.Option(help="Unit of the coordinates: m, cm, mm, um or nm.")]


@app.command()
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write into.")] = Path("demo_output"),
    samples: Annotated[Path, typer.Option(help="Folder of the samples; made anew if not there.")] = Path(
        "data_samples"
    ),
    spacing: Annotated[float, typer.Option(help="Mesh step, in mm.")] = 0.1,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Build the sample leaf: mesh, picture and summary into a folder."""
    from o3dleaf.samples.files import MIDRIB, PATCH, SCAN, write_samples

    output.mkdir(parents=True, exist_ok=True)
    if not all((samples / name).is_file() for name in (SCAN, MIDRIB, PATCH)):
        samples = output / "data_samples"
        write_samples(samples)
    leaf(
        samples / SCAN,
        output / "leaf.ply",
        ct=samples / PATCH,
        midrib=samples / MIDRIB,
        model=output / "leaf.o3l",
        spacing=spacing,
        threads=threads,
        quiet=quiet,
    )


@app.command()
def leaf(
    scan: Annotated[Path, typer.Argument(help="Point cloud of one leaf: PLY, PCD, XYZ, XYZN, XYZRGB or PTS.")],
    output: Output,
    ct: Annotated[
        Path | None,
        typer.Option(help="Micro-CT volume of a patch, or a model that `patch` made; else: blade only."),
    ] = None,
    midrib: Annotated[Path | None, typer.Option(help="Control points from base to tip; found if not given.")] = None,
    scan_unit: Annotated[str, typer.Option(help="Unit of scan and midrib: m, cm, mm, um or nm.")] = "mm",
    ct_unit: CtUnit = None,
    voxel_spacing: VoxelSpacing = None,
    spacing: Annotated[float, typer.Option(help="Mesh step, in scan-unit.")] = 0.1,
    region: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(help="Part to mesh, in leaf coordinates: ALONG0 ACROSS0 ALONG1 ACROSS1, in scan-unit."),
    ] = None,
    around: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="Mesh a window around this point of the world, X Y Z in scan-unit, instead."),
    ] = None,
    window: Annotated[float, typer.Option(help="Width of that window, in scan-unit.")] = 3.0,
    closed: Annotated[bool, typer.Option(help="One solid with a rim, instead of two open sheets.")] = False,
    fine: Annotated[
        list[str] | None,
        typer.Option(help="A finer window in the mesh, 'ALONG0 ACROSS0 ALONG1 ACROSS1 STEP'; again for more."),
    ] = None,
    simplify: Annotated[float | None, typer.Option(help="Share of its triangles to simplify a tile to.")] = None,
    remesh: Annotated[
        float | None, typer.Option(help="Edge length to remesh to, in scan-unit: triangles that a solver accepts.")
    ] = None,
    remesh_tile: Annotated[
        float | None, typer.Option(help="Or edge length to remesh one tile to, in scan-unit; the rest is copies.")
    ] = None,
    tile_solid: Annotated[
        Path | None, typer.Option(help="Write one flat period as a closed block too; opposite sides match.")
    ] = None,
    grid: Annotated[Path | None, typer.Option(help="Write the leaf on a grid too: .vti or .nrrd.")] = None,
    grid_of: Annotated[str, typer.Option(help="What of it: 'field', 'distance' or 'mask'.")] = "field",
    grid_step: Annotated[float, typer.Option(help="Step of the grid, in scan-unit.")] = 0.1,
    distortion: Annotated[
        str | None, typer.Option(help="Draw a map of it: along, across, shear, thickness, area or volume.")
    ] = None,
    offset: Annotated[str, typer.Option(help="Measure heights along 'up', as the paper, or the 'normal'.")] = "up",
    period: Period = None,
    flip: Flip = None,
    shift: Shift = 0.0,
    level: Level = "valley",
    rho: Rho = "gcv",
    alpha: Annotated[
        float | None, typer.Option(help="Radius of the outline's alpha-shape, in scan-unit; chosen if not given.")
    ] = None,
    method: Annotated[str, typer.Option(help="Marching 'cubes' or 'tetrahedra'.")] = "cubes",
    picture: Annotated[bool, typer.Option(help="Draw the picture.")] = True,
    model: Annotated[Path | None, typer.Option(help="Write the leaf as a model file (.o3l) too.")] = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Build a leaf from a laser scan, with the micro-structure of a micro-CT volume if one is given.

    Writes the mesh, and beside it a picture (.png) and a summary (.json) of the same name.
    """
    from o3dleaf.commands.leaf import LeafRun

    set_num_threads_if(threads)
    job = LeafRun(
        scan=scan,
        output=output,
        ct=ct,
        midrib=midrib,
        model=model,
        scan_unit=scan_unit,
        ct_unit=ct_unit,
        voxel_spacing=voxel_spacing,
        spacing=spacing,
        region=None if region is None else (region[:2], region[2:]),
        around=around,
        window=window,
        closed=closed,
        fine=tuple(as_window(text) for text in fine or ()),
        simplify=simplify,
        remesh=remesh,
        remesh_tile=remesh_tile,
        tile_solid=tile_solid,
        grid=grid,
        grid_of=grid_of,
        grid_step=grid_step,
        distortion=distortion,
        offset=offset,
        period=as_period(period),
        flip=flip,
        shift=shift,
        level=number_or_word(level),
        rho=number_or_word(rho),
        alpha=alpha,
        method=method,
        picture=picture,
    )
    with shown(quiet=quiet) as journal:
        report = job.run(journal)["mesh"]
    if not quiet:
        typer.echo(f"{output}: {report['triangles']:,} triangles, {report['area']:,.0f} {scan_unit}²")


@app.command()
def reconstruct(
    cloud: Annotated[Path, typer.Argument(help="Any point cloud, with normals or without: PLY, PCD, XYZ, XYZN, ...")],
    output: Output,
    spacing: Annotated[float | None, typer.Option(help="Mesh step, in the cloud's unit; from its points.")] = None,
    rho: Annotated[str, typer.Option(help="Smoothing, the paper's rho in unit³, or 'gcv'.")] = "gcv",
    local: Annotated[str, typer.Option(help="Fit in the balls: rbf, hermite, curl-free, mls or auto.")] = "rbf",
    keep_all: Annotated[
        bool, typer.Option("--untrimmed", help="Keep what no data support, four spacings beyond the data.")
    ] = False,
    measure: Annotated[str, typer.Option(help="Support to colour by: distance, weight or residual.")] = "distance",
    unit: Unit = None,
    model: Annotated[Path | None, typer.Option(help="Write the field as a model too (.o3l).")] = None,
    picture: Annotated[Path | None, typer.Option(help="Write a picture too, in the colours of the support.")] = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Make a surface of any point cloud: open where the data are open, closed where they are closed."""
    from o3dleaf.commands.reconstruct import CloudRun, in_a_line

    set_num_threads_if(threads)
    job = CloudRun(cloud, output, spacing, number_or_word(rho), local, not keep_all, measure, unit, model, picture)
    with shown(quiet=quiet) as journal:
        found = job.run(journal)
    if not quiet:
        typer.echo(f"{output}: {in_a_line(found)}")


@app.command()
def patch(
    volume: Annotated[Path, typer.Argument(help="Micro-CT volume: TIFF, folder of TIFF slices, NPY, NRRD, ...")],
    output: Output,
    voxel_spacing: VoxelSpacing = None,
    ct_unit: CtUnit = None,
    level: Level = "valley",
    rho: Rho = "gcv",
    period: Period = None,
    flip: Flip = None,
    shift: Shift = 0.0,
    tile_solid: Annotated[
        Path | None, typer.Option(help="Write one flat period as a closed block too; opposite sides match.")
    ] = None,
    spacing: Annotated[float | None, typer.Option(help="Mesh step of that block, in the patch's unit.")] = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Fit the micro-structure of a volume once, into a model file that `leaf --ct` takes."""
    from o3dleaf.core.atomic_files import require_apart, require_writable
    from o3dleaf.io.model_file import SUFFIX
    from o3dleaf.io.triangle_mesh import SUFFIXES
    from o3dleaf.leaf.ct.formats import read_volume
    from o3dleaf.leaf.instancing.stream import write_mesh
    from o3dleaf.leaf.meshing import extract_flat_tile
    from o3dleaf.leaf.pipeline import PatchOptions, create_texture

    set_num_threads_if(threads)
    require_writable(output, (SUFFIX,))
    require_apart([output, tile_solid], [volume])
    if (tile_solid is None) != (spacing is None):
        raise InputError("tile-solid, spacing: the block needs a step and the step a block; give both or none")
    if tile_solid is not None:
        require_writable(tile_solid, SUFFIXES)
    options = PatchOptions(number_or_word(level), number_or_word(rho), as_period(period), flip, shift)
    with shown(quiet=quiet) as journal:
        with journal.stage("read"):
            found = read_volume(volume, spacing=voxel_spacing, unit=ct_unit)
        texture = create_texture(found, options=options, journal=journal)
        with journal.stage("write model"):
            texture.save(output)
        if tile_solid is not None and spacing is not None:
            with journal.stage("write tile"):
                write_mesh(extract_flat_tile(texture, 1.0, spacing), tile_solid)
    if not quiet:
        energy = texture.seam_energy()
        typer.echo(f"{output}: tile {texture.tile.tolist()} {texture.unit or ''}, seam energy {energy.total:.3g}")


@app.command()
def sample(
    folder: Annotated[Path, typer.Argument(help="Folder to write into.")],
    seed: Annotated[int, typer.Option(help="Seed of the synthetic leaf.")] = 0,
) -> None:
    """Write a synthetic scan, its midrib and a micro-CT volume, with a page that says what they are."""
    from o3dleaf.samples.files import write_samples

    for path in write_samples(folder, seed=seed):
        typer.echo(str(path))


@app.command()
def info(
    file: Annotated[Path, typer.Argument(help="A mesh, a point cloud or a volume.")],
    unit: Unit = None,
    voxel_spacing: VoxelSpacing = None,
    json: Annotated[Path | None, typer.Option(help="Write it as JSON too.")] = None,
) -> None:
    """Say what a file holds: sizes, extent, and for a mesh whether it is manifold and closed."""
    from o3dleaf.core.atomic_files import require_apart, require_writable
    from o3dleaf.output.report.describe import describe_file, write_json

    require_apart([json], [file])
    if json is not None:
        require_writable(json)
    found = describe_file(file, unit=unit, voxel_spacing=voxel_spacing)
    for name, value in found.items():
        typer.echo(f"{name:>24}  {value}")
    if json is not None:
        write_json(json, found)


@app.command()
def qa(
    mesh: Annotated[Path, typer.Argument(help="Mesh to judge: PLY, OBJ, STL or OFF.")],
    field: Annotated[Path | None, typer.Option(help="Model that it is a surface of (.o3l), to measure to.")] = None,
    cloud: Annotated[Path | None, typer.Option(help="Scan to measure to, in the mesh's unit.")] = None,
    unit: Unit = None,
    require: Annotated[
        str,
        typer.Option(help="What it must be: 'watertight,manifold,oriented,components=1,min-angle=10', ..."),
    ] = "",
    html: Annotated[Path | None, typer.Option(help="Write a report with pictures, one file.")] = None,
    json: Annotated[Path | None, typer.Option(help="Write figures and verdict as JSON.")] = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Judge a mesh: figures, defects, requirements; exit code 1 if one is not met."""
    from o3dleaf.core.atomic_files import require_apart, require_writable
    from o3dleaf.output.report.examine import examine_files, verdict_lines

    require_apart([html, json], [mesh, field, cloud])
    if json is not None:
        require_writable(json)
    set_num_threads_if(threads)
    with shown(quiet=quiet) as journal:
        found = examine_files(mesh, field=field, cloud=cloud, unit=unit, require=require, html=html, journal=journal)
    if json is not None:
        found.write_json(json)
    for line in verdict_lines(found, figures=not quiet):
        typer.echo(line)
    if not found.verdict.passed:
        raise typer.Exit(FAILED)


@app.command()
def clean(
    mesh: Annotated[Path, typer.Argument(help="Mesh to clean: PLY, OBJ, STL or OFF.")],
    output: Output,
    merge: Annotated[float, typer.Option(help="Join vertices up to this far apart, in the mesh's unit.")] = 0.0,
    smallest_component: Annotated[
        float, typer.Option(help="Drop pieces of less than this diameter, in the mesh's unit.")
    ] = 0.0,
    smallest_area: Annotated[
        float, typer.Option(help="Drop pieces of less than this area, in the square of the mesh's unit.")
    ] = 0.0,
    fewest_triangles: Annotated[int, typer.Option(help="Drop pieces of fewer triangles.")] = 0,
    largest_hole: Annotated[float, typer.Option(help="Close holes up to this perimeter, in the mesh's unit.")] = 0.0,
    smallest_height: Annotated[
        float, typer.Option(help="Flip away triangles of at most this height, in the mesh's unit.")
    ] = 0.0,
    fold_angle: Annotated[
        float, typer.Option(help="Neighbours that meet at less than this are folded, in degrees; 0: none.")
    ] = 1.0,
    untangle: Annotated[bool, typer.Option(help="Remove triangles that cross others.")] = False,
    orient: Annotated[bool, typer.Option(help="Turn triangles that run against their neighbours.")] = True,
    triangles: Annotated[int | None, typer.Option(help="Then simplify to about so many triangles.")] = None,
    edge: Annotated[float | None, typer.Option(help="Or to this mean edge, in the mesh's unit.")] = None,
    deviation: Annotated[
        float | None, typer.Option(help="Simplify while the surface is off by no more, in the mesh's unit.")
    ] = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Clean a mesh, and simplify it on request; nothing gets worse, and labels and the lines between them stay."""
    from o3dleaf.core.atomic_files import require_apart, require_writable
    from o3dleaf.io.triangle_mesh import SUFFIXES, write_triangle_mesh
    from o3dleaf.output.export.read import read_labelled_mesh
    from o3dleaf.surface.repair.clean import CleaningRun

    set_num_threads_if(threads)
    require_writable(output, SUFFIXES)
    require_apart([output], [mesh])
    job = CleaningRun(
        cleaning={
            "merge": merge,
            "smallest_component": smallest_component,
            "smallest_area": smallest_area,
            "fewest_triangles": fewest_triangles,
            "largest_hole": largest_hole,
            "smallest_height": smallest_height,
            "fold_angle": fold_angle,
            "untangle": untangle,
            "orient": orient,
        },
        simplifying={"target_triangles": triangles, "target_edge": edge, "deviation": deviation},
    )
    given = read_labelled_mesh(mesh)
    with shown(quiet=quiet) as journal:
        found, labels = job.run(given.mesh, given.labels, journal)
    if labels is None:
        write_triangle_mesh(output, found)
    else:
        from o3dleaf.output.export.consumers import export_mesh

        export_mesh(output, replace(given, mesh=found, labels=labels))
    if not quiet:
        typer.echo("\n".join(job.table()))


@app.command()
def export(
    source: Annotated[
        Path, typer.Argument(help="A mesh (PLY, STL, OBJ, OFF), or a model (.o3l) that is meshed first.")
    ],
    output: Output,
    consumer: Annotated[
        str | None,
        typer.Option("--for", help="The next program: openfoam, dualsphysics, paraview, web, blender or gmsh."),
    ] = None,
    what: Annotated[
        str, typer.Option(help="'mesh', 'surface-particles', 'volume-particles' or 'distance', of a closed mesh.")
    ] = "mesh",
    unit: Unit = None,
    to_unit: Annotated[str | None, typer.Option(help="Unit of the file; by default the program's, or unit.")] = None,
    spacing: Annotated[float | None, typer.Option(help="Mesh step, if SOURCE is a model, in its unit.")] = None,
    remesh: Annotated[
        float | None,
        typer.Option(
            help="Edge length that the leaf of a model is remeshed to, in its unit; "
            "for openfoam, dualsphysics and gmsh spacing by default. Tiles never are."
        ),
    ] = None,
    no_remesh: Annotated[
        bool, typer.Option("--no-remesh", help="Do not remesh for them: quick, with slivers.")
    ] = False,
    region: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(help="Part of the leaf, in leaf coordinates: ALONG0 ACROSS0 ALONG1 ACROSS1."),
    ] = None,
    part: Annotated[str | None, typer.Option(help="Only this part: adaxial, abaxial or rim.")] = None,
    sheets: Annotated[bool, typer.Option("--open", help="Two open sheets instead of one closed solid.")] = False,
    tile: Annotated[bool, typer.Option(help="One flat period as a closed block, instead of the leaf.")] = False,
    step: Annotated[float | None, typer.Option(help="Distance of particles or grid points, in unit.")] = None,
    bounds: Annotated[
        tuple[float, float, float, float, float, float] | None,
        typer.Option(help="Box of the distances: X0 Y0 Z0 X1 Y1 Z1, in unit; the mesh's own by default."),
    ] = None,
    origin: Annotated[
        tuple[float, float, float] | None, typer.Option(help="The point X Y Z that becomes 0 0 0, in unit.")
    ] = None,
    scalar: Annotated[
        list[str] | None, typer.Option(help="Values at the vertices: curvature or deviation; again for more.")
    ] = None,
    field: Annotated[Path | None, typer.Option(help="The leaf's model, if SOURCE is a mesh, for them.")] = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Write a mesh, particles or distances for the next program, in its format and unit; see docs/consumers."""
    from o3dleaf.commands.export import ExportRun

    set_num_threads_if(threads)
    job = ExportRun(
        source=source,
        output=output,
        what=what,
        consumer=consumer,
        unit=unit,
        to_unit=to_unit,
        spacing=spacing,
        remesh=remesh,
        raw=no_remesh,
        region=None if region is None else (region[:2], region[2:]),
        part=part,
        sheets=sheets,
        tile=tile,
        step=step,
        bounds=None if bounds is None else (bounds[:3], bounds[3:]),
        origin=origin,
        field=field,
        scalars=tuple(scalar or ()),
    )
    with shown(quiet=quiet) as journal:
        said = job.run(journal)
    if not quiet:
        typer.echo(f"{output}: {said}")


@app.command()
def render(
    files: Annotated[list[Path], typer.Argument(help="Meshes and point clouds to draw together.")],
    output: Output,
    unit: Unit = None,
    title: Annotated[str | None, typer.Option(help="A line at the top.")] = None,
    size: Annotated[tuple[int, int], typer.Option(help="Width and height in pixels.")] = (1600, 1000),
    engine: Annotated[str, typer.Option(help="'cpu', 'open3d' (needs Vulkan), or 'auto'.")] = "cpu",
) -> None:
    """Draw meshes and point clouds into a picture (PNG, JPG, PDF or SVG); needs no screen and no GPU."""
    from o3dleaf.core.atomic_files import require_apart
    from o3dleaf.output.report.describe import read_geometry
    from o3dleaf.output.view.picture import render as draw_files

    require_apart([output], files)
    draw_files([read_geometry(file) for file in files], output, unit=unit, title=title, size=size, engine=engine)


@app.command()
def figures(
    scan: Annotated[Path | None, typer.Argument(help="Scan of one leaf; the samples, if there is no --model.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write into.")] = Path("figures"),
    samples: Annotated[Path, typer.Option(help="Folder of the samples; made anew if not there.")] = Path(
        "data_samples"
    ),
    ct: Annotated[Path | None, typer.Option(help="Micro-CT volume, or a model that `patch` made.")] = None,
    model: Annotated[
        Path | None, typer.Option(help="A leaf that `leaf --model` wrote, instead of building it.")
    ] = None,
    midrib: Annotated[Path | None, typer.Option(help="Control points from base to tip; found if not given.")] = None,
    scan_unit: Annotated[str, typer.Option(help="Unit of scan and midrib: m, cm, mm, um or nm.")] = "mm",
    ct_unit: CtUnit = None,
    voxel_spacing: VoxelSpacing = None,
    level: Level = "valley",
    rho: Rho = "gcv",
    period: Period = None,
    formats: Annotated[str, typer.Option("--formats", help="Of png, pdf, svg and jpg.")] = "png,pdf",
    only: Annotated[str | None, typer.Option(help="Names of figures, 'scan,tile'; all by default.")] = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Draw figures like the paper's: scan, flattened scan, height map, histogram, tiles, cross-section, whole leaf."""
    from o3dleaf.commands.figures import FiguresJob

    set_num_threads_if(threads)
    job = FiguresJob(
        output,
        scan=scan,
        ct=ct,
        model=model,
        midrib=midrib,
        samples=samples,
        scan_unit=scan_unit,
        ct_unit=ct_unit,
        voxel_spacing=voxel_spacing,
        level=number_or_word(level),
        rho=number_or_word(rho),
        period=as_period(period),
        formats=tuple(formats.replace(",", " ").split()),
        only=None if only is None else tuple(only.replace(",", " ").split()),
    )
    with shown(quiet=quiet) as journal:
        drawn = job.run(journal)
    if not quiet:
        typer.echo(f"{output}: {len(drawn.paths) - 1} files and {drawn.paths[-1].name}")


@app.command()
def pick(
    scan: Annotated[Path, typer.Argument(help="Point cloud of one leaf.")],
    output: Output,
) -> None:
    """Pick the control points of a midrib in Open3D's window, from base to tip, for `leaf --midrib`."""
    from o3dleaf.core.atomic_files import require_apart
    from o3dleaf.io.point_cloud import read_point_cloud
    from o3dleaf.output.view.pick import pick_midrib, write_midrib

    require_apart([output], [scan])
    control = pick_midrib(read_point_cloud(scan))
    write_midrib(control, output)
    typer.echo(f"{output}: {len(control)} control points")


@app.command()
def view(files: Annotated[list[Path], typer.Argument(help="Meshes and point clouds.")]) -> None:
    """Open Open3D's window on meshes and point clouds."""
    from o3dleaf.output.report.describe import read_geometry
    from o3dleaf.output.view.window import show

    show(*(read_geometry(file) for file in files))


def number_or_word(text: str) -> Any:
    """Return a number for a text that is one."""
    try:
        return float(text)
    except ValueError:
        return text


def as_period(text: str | None) -> Any:
    """Return the two lengths of a text, or the word."""
    if text is None:
        return None
    words = [number_or_word(word) for word in text.replace(",", " ").split()]
    return words[0] if len(words) == 1 else tuple(words)


def as_window(text: str) -> tuple[float, ...]:
    """Return the five numbers of a text, or raise `InputError`."""
    numbers = [number_or_word(word) for word in text.replace(",", " ").split()]
    if len(numbers) != 5 or any(isinstance(number, str) for number in numbers):
        raise InputError(f"fine: is {text!r}; give five numbers, 'ALONG0 ACROSS0 ALONG1 ACROSS1 STEP'")
    return tuple(numbers)


def set_num_threads_if(threads: int | None) -> None:
    """Set the number of threads where one is asked for."""
    if threads is not None:
        set_num_threads(threads)


def main() -> None:
    """Run the command line; an error of ours is one line and exit code 2."""
    try:
        app(standalone_mode=True)
    except O3DLeafError as error:
        sys.stderr.write(f"o3dleaf: error: {' '.join(str(error).split())}\n")
        sys.exit(2)
