"""All figures of a leaf into one folder, each in every requested format, with a page of captions."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from o3dleaf.core import journal
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite
from o3dleaf.core.atomic_files import make_folder, write_text
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.ct.threshold import METHODS
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.leaf.macro.blade import HeightMapBlade
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.output.figures import pictures, plots
from o3dleaf.output.figures.style import FigureSheet
from o3dleaf.output.view.panel import save_figure

FORMATS = ("png", "pdf", "svg", "jpg")
CAPTIONS = "captions.md"


@dataclass(frozen=True)
class Subject:
    """The data that figures show; figures whose data are missing are left out."""

    blade: HeightMapBlade | None
    leaf: MultiscaleLeaf | None
    scan: CloudLike | None
    volume: Volume | None
    level: float | str

    def lacks(self, needs: str) -> str:
        """Return what keeps a figure that `needs` it from being drawn: of the scan, the paper's blade too."""
        return "blade" if needs == "scan" and self.blade is None else needs


@dataclass(frozen=True)
class Entry:
    """One figure of the list: what it needs, and what draws it."""

    needs: str
    draw: Callable[..., FigureSheet]

    def arguments(self, subject: Subject) -> tuple[object, ...] | None:
        """Return what the figure is drawn of, or None where that is not there."""
        wanted = {
            "blade": (subject.blade,),
            "scan": (subject.blade, subject.scan),
            "leaf": (subject.leaf,),
            "volume": (subject.volume, subject.level),
        }[self.needs]
        return None if any(part is None for part in wanted) else wanted


FIGURES = {
    "scan": Entry("scan", pictures.scan_picture),
    "flattened": Entry("scan", plots.flattened_scan),
    "height-map": Entry("blade", plots.height_map),
    "histogram": Entry("volume", plots.histogram),
    "tile": Entry("leaf", pictures.one_tile),
    "four-tiles": Entry("leaf", pictures.four_tiles),
    "cross-section": Entry("leaf", pictures.cross_section),
    "whole-leaf": Entry("leaf", pictures.whole_leaf),
}
"""In the order of the paper."""

MISSING = {
    "scan": "the scan is not in a saved leaf; give its file",
    "blade": "the blade has no leaf frame and height map; build it with frame='paper'",
    "volume": "the CT volume is not in a saved leaf; give its file",
    "leaf": "the blade has no micro-structure; give a CT volume or a model with one",
}


@dataclass(frozen=True)
class Drawn:
    """The files that `draw_figures` wrote.

    Attributes
    ----------
    paths : list of Path
        The files, the page of captions last.
    left_out : dict of str to str
        Figures that were not drawn, and why.
    """

    paths: list[Path]
    left_out: dict[str, str]


@checked
def draw_figures(
    leaf: MultiscaleLeaf | Blade,
    folder: str | PathLike[str],
    *,
    scan: CloudLike | None = None,
    volume: Volume | None = None,
    level: Finite | str = "mixture",
    formats: Iterable[str] = ("png", "pdf"),
    only: Iterable[str] | None = None,
) -> Drawn:
    """Draw figures like those of the paper into a folder: ``1-scan.png``, ..., ``8-whole-leaf.pdf``, ``captions.md``.

    They are a printed column wide, 85 mm, with words of 7 points, in colors that color-blind readers can tell
    apart. Plots are vectors in PDF and SVG; of pictures, their words and bars are.

    Parameters
    ----------
    leaf : MultiscaleLeaf or Blade
        Of a blade alone, figures of micro-structure are left out.
    folder : path-like
        Made if it does not exist; files of the same names are replaced.
    scan : (n, 3) array_like or Open3D point cloud, optional
        The points that the leaf was built from, in its unit.
    volume : Volume, optional
        The CT volume that the micro-structure was fitted to.
    level : float, "mixture", "valley" or "otsu"
        Its threshold, or how it was found.
    formats : sequence of {"png", "pdf", "svg", "jpg"}
    only : sequence of str, optional
        Names in `FIGURES`, if not all of them are wanted.

    Raises
    ------
    InputError
        If there is no such format or figure, the folder cannot be written to, or nothing can be drawn.
    """
    suffixes, wanted = check_request(formats, only)
    target = make_folder(folder)
    if scan is not None:
        points_of(scan, "scan", least=3)
    if isinstance(level, str):
        require_choice(level, METHODS, "level")
    blade, whole = (leaf.blade, leaf) if isinstance(leaf, MultiscaleLeaf) else (leaf, None)
    subject = Subject(blade if isinstance(blade, HeightMapBlade) else None, whole, scan, volume, level)
    captions: list[str] = []
    drawn = Drawn([], {})
    for number, (name, entry) in enumerate(FIGURES.items(), 1):
        if name not in wanted:
            continue
        arguments = entry.arguments(subject)
        try:
            if arguments is None:
                raise InputError(MISSING[subject.lacks(entry.needs)])
            with journal.stage(f"figure {number}, {name}"):
                sheet = entry.draw(*arguments)
                files = [target / f"{number}-{name}.{suffix}" for suffix in suffixes]
                for file in files:
                    save_figure(sheet.figure, file)
        except O3DLeafError as reason:
            drawn.left_out[name] = str(reason)
            journal.note(f"figure {number}, {name}: left out: {reason}")
            continue
        drawn.paths.extend(files)
        captions.append(f"**{number}-{name}.** {sheet.caption}\n")
    if not drawn.paths:
        raise InputError(f"figures: none can be drawn: {'; '.join(drawn.left_out.values())}")
    return _write_captions(target / CAPTIONS, captions, drawn)


def check_request(formats: Iterable[str], only: Iterable[str] | None) -> tuple[list[str], list[str]]:
    """Return the requested formats and figures, or raise `InputError` for one that there is not, or for none."""
    suffixes = [require_choice(name, FORMATS, "formats") for name in formats]
    wanted = list(FIGURES) if only is None else [require_choice(name, FIGURES, "only") for name in only]
    if not (suffixes and wanted):
        raise InputError("formats, only: must not be empty; name a format and a figure, or leave them out")
    return suffixes, wanted


def _write_captions(path: Path, captions: list[str], drawn: Drawn) -> Drawn:
    """Write what the figures show, and which were left out."""
    lines = captions + [f"*{name}* was left out: {reason}\n" for name, reason in drawn.left_out.items()]
    write_text("\n".join(lines), path)
    drawn.paths.append(path)
    return drawn
