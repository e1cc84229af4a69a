"""The command line: each command reads files, does one job of the package, and writes files."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from o3dleaf.errors import O3DLeafError
from o3dleaf.journal import Journal
from o3dleaf.parallel import Progress, set_num_threads

if TYPE_CHECKING:
    from o3dleaf.leaf.blade import Blade
    from o3dleaf.leaf.multiscale import MultiscaleLeaf

app = typer.Typer(
    help="Laser scan and micro-CT of a leaf into one multi-scale surface.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Output = Annotated[Path, typer.Option("--output", "-o", help="File to write.")]
ScanUnit = Annotated[str, typer.Option(help="Unit of the scan: m, cm, mm, um or nm.")]
CtUnit = Annotated[str | None, typer.Option(help="Unit of the volume; by default what its file says, else um.")]
VoxelSpacing = Annotated[
    float | None, typer.Option(help="Edge of a voxel, in the volume's unit, if its file does not say.")
]
Level = Annotated[str, typer.Option(help="Intensity of the surface: a number, 'valley' or 'otsu'.")]
Rho = Annotated[str, typer.Option(help="Smoothing of the micro-structure: the paper's rho in ct-unit³, or 'gcv'.")]
Threads = Annotated[int | None, typer.Option(help="Threads to use; all cores by default. Results do not depend on it.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress.")]

DEMO_SPACING = 0.1
WINDOW = 2.4
"""Side of the inset's window, in mm, and its step: finer than the 24 µm of the CT."""
WINDOW_STEP = 0.012


@app.command()
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write into.")] = Path("demo_output"),
    samples: Annotated[Path, typer.Option(help="Folder of the samples; made anew if they are not there.")] = Path(
        "data_samples"
    ),
    spacing: Annotated[float, typer.Option(help="Mesh step, in mm.")] = DEMO_SPACING,
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
        spacing=spacing,
        threads=threads,
        quiet=quiet,
    )


@app.command()
def leaf(
    scan: Annotated[Path, typer.Argument(help="Point cloud of one leaf: PLY, PCD, XYZ, ...")],
    output: Output,
    ct: Annotated[
        Path | None, typer.Option(help="Micro-CT volume of a patch: TIFF, folder of TIFF slices, NPY, ...")
    ] = None,
    midrib: Annotated[Path | None, typer.Option(help="Control points of the midrib; found if not given.")] = None,
    scan_unit: ScanUnit = "mm",
    ct_unit: CtUnit = None,
    voxel_spacing: VoxelSpacing = None,
    spacing: Annotated[float, typer.Option(help="Mesh step, in scan-unit.")] = 0.1,
    region: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(help="Part to mesh, in leaf coordinates and scan-unit: ALONG0 ACROSS0 ALONG1 ACROSS1."),
    ] = None,
    level: Level = "valley",
    rho: Rho = "gcv",
    alpha: Annotated[
        float | None, typer.Option(help="Radius of the outline's alpha-shape; chosen if not given.")
    ] = None,
    method: Annotated[str, typer.Option(help="Marching 'cubes' or 'tetrahedra'.")] = "cubes",
    picture: Annotated[bool, typer.Option(help="Draw the picture.")] = True,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Build a leaf from a laser scan, with the micro-structure of a CT volume if one is given."""
    from o3dleaf.cloud.read import read_point_cloud
    from o3dleaf.ct.formats import read_volume
    from o3dleaf.files import require_writable
    from o3dleaf.leaf.multiscale import MultiscaleLeaf
    from o3dleaf.mesh.files import write_triangle_mesh
    from o3dleaf.pipeline import BladeOptions, PatchOptions, create_blade, create_texture
    from o3dleaf.report import summarise, write_json

    settings = {
        name: value for name, value in locals().items() if isinstance(value, str | float | int | tuple | Path | None)
    }
    _prepare(threads)
    require_writable(output, (".ply", ".obj", ".stl"))
    box = None if region is None else [region[:2], region[2:]]
    with _shown(quiet) as journal:
        with journal.stage("read"):
            cloud = read_point_cloud(scan)
            control = None if midrib is None else read_point_cloud(midrib, least=2)
            volume = None if ct is None else read_volume(ct, spacing=voxel_spacing, unit=ct_unit)
        blade = create_blade(cloud, control, unit=scan_unit, options=BladeOptions(alpha=alpha), journal=journal)
        multiscale = sheets = None
        if volume is None:
            with journal.stage("extract mesh"):
                mesh = blade.extract_mesh(spacing, box)
        else:
            options = PatchOptions(level=_number_or_word(level), rho=_number_or_word(rho))
            texture = create_texture(volume, options=options, journal=journal)
            multiscale = MultiscaleLeaf(texture, blade.frame, blade.height_map, blade.outline)
            with journal.stage("extract mesh") as progress:
                sheets = multiscale.extract_sheets(spacing, box, method=method, progress=progress)
            mesh = sheets.mesh
        with journal.stage("write mesh"):
            write_triangle_mesh(output, mesh)
        if picture:
            with journal.stage("draw picture"):
                _draw(output.with_suffix(".png"), mesh, blade, multiscale)
        summary = summarise(blade, mesh, journal, settings, leaf=multiscale, sheets=sheets)
        write_json(output.with_suffix(".json"), summary)
    if not quiet:
        typer.echo(f"{output}: {summary['mesh']['triangles']:,} triangles, {summary['mesh']['area']:,.0f} {scan_unit}²")


def _draw(path: Path, mesh: Any, blade: "Blade", leaf: "MultiscaleLeaf | None") -> None:
    """Draw the whole leaf, with an inset of the micro-structure where there is one."""
    from o3dleaf.units import unit_scale
    from o3dleaf.view.render import Inset, render

    insets = []
    if leaf is not None:
        scale = unit_scale("mm", blade.unit) if blade.unit else 1.0
        middle = blade.outline.polygon.representative_point()
        half = WINDOW * scale / 2
        window = [[middle.x - half, middle.y - half], [middle.x + half, middle.y + half]]
        insets = [Inset(leaf.extract_mesh(WINDOW_STEP * scale, window))]
    render(mesh, path, insets=insets, unit=blade.unit)


@app.command()
def sample(
    folder: Annotated[Path, typer.Argument(help="Folder to write into.")] = Path("data_samples"),
) -> None:
    """Write the synthetic samples: a scan, its midrib and a micro-CT volume, with the seed that made them."""
    from o3dleaf.samples.files import write_samples

    write_samples(folder)


def _number_or_word(text: str) -> Any:
    """Return a number for a text that is one."""
    try:
        return float(text)
    except ValueError:
        return text


def _prepare(threads: int | None) -> None:
    if threads is not None:
        set_num_threads(threads)


class _RichJournal(Journal):
    """A journal that draws a progress bar for the stage that runs."""

    def __init__(self, bars: Any) -> None:
        super().__init__()
        self.bars = bars

    @contextmanager
    def show(self, name: str) -> Iterator[Progress]:
        """Show one bar, filled when the stage ends."""
        task = self.bars.add_task(name, total=None)

        def progress(done: int, total: int) -> None:
            self.bars.update(task, completed=done, total=total)

        yield progress
        self.bars.update(task, total=1, completed=1)


@contextmanager
def _shown(quiet: bool) -> Iterator[Journal]:
    """Yield a journal, shown on the terminal unless `quiet`."""
    if quiet:
        yield Journal()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:<28}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bars:
        yield _RichJournal(bars)


def main() -> None:
    """Run the command line; an error of ours is one line and exit code 2, an interruption exit code 130."""
    try:
        app(standalone_mode=True)
    except O3DLeafError as error:
        sys.stderr.write(f"o3dleaf: error: {' '.join(str(error).split())}\n")
        sys.exit(2)
    except KeyboardInterrupt:
        sys.stderr.write("o3dleaf: interrupted; nothing was written under a final name\n")
        sys.exit(130)
