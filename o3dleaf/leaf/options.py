"""Options for building a leaf: its blade, and its micro-structure.

A field made by `option` is an option of the commands too; the others are for Python alone.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Finite, NotNegative, Positive, SmoothingValue, Whole
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.errors import InputError
from o3dleaf.core.jobs.option import option
from o3dleaf.core.jobs.words import number_or_word, words_of

TILES = ("periodic", "wang")
FRAMES = ("surface", "paper")
OF_FRAME = {
    "surface": ("piece", "one_sheet", "keep_petiole", "fill_holes", "complete_margin", "rim_radius", "thickness"),
    "paper": ("alpha", "offset"),
}
"""Options that one frame alone looks at."""


OF_VOLUME: dict[str, Any] = {"needs": ("volume",)}
"""Of options of the micro-structure: a model has its own already."""


def _period(text: str) -> Any:
    """Return the two lengths of a text, or its word."""
    values = [number_or_word(word) for word in words_of(text)]
    return values[0] if len(values) == 1 else tuple(values)


@checked
@dataclass(frozen=True, kw_only=True)
class BladeOptions:
    """Options for the macro-scale blade; by default everything is chosen from the scan.

    Attributes
    ----------
    frame : {"surface", "paper"}
        The blade as a surface of its own over a chart, for any leaf, or as the paper has it: a height map over a plane
        about the midrib, inside an α-shape.
    smoothing : "robust", float or "gcv"
        Of the surface or the height map, see `HeightMap.fit`.
    up, base : (3,) array_like, optional
        Direction of the adaxial side; a point near the base.
    piece : int, optional
        Which of several pieces of the scan, or of leaves that touch or rest on one another, is the leaf, the largest
        being 1.
    one_sheet : bool
        Whether passes that disagree, or the two sides of a thin leaf, are one surface.
    keep_petiole : bool
        Whether a petiole or a stub of the stem belongs to the blade.
    fill_holes : float, optional
        Width, in the scan's unit, up to which holes of the scan are filled; by default that of the widest gap over
        which pieces of the scan had to be joined, none if it is in one piece.
    complete_margin : float, optional
        Length along the midrib, in the scan's unit, from which on a stretch of margin that is hidden or missing is
        completed by the mirror image of the blade's other half; by default none is.
    rim_radius : float, optional
        Distance from the margin over which the thickness of the micro-structure falls, in the scan's unit.
    thickness : (n, m) array_like or path-like, optional
        Factors of the thickness of the micro-structure, a table or a CSV file of one, laid over the blade: rows along
        it, from base to tip, columns across; see `ThicknessMap`.
    hair_density : (n, m) array_like or path-like, optional
        Shares of the micro-structure's hairs that are kept, 0 to 1, a table or a CSV file of one, laid over the blade
        as `thickness` is; see `ThinnedField`.
    hair_seed : int
        Of the hairs that are kept.
    alpha : float, optional
        Of frame "paper": radius of the α-shape, in the scan's unit.
    offset : {"up", "normal"}
        Of frame "paper": direction along which the heights of the micro-structure are measured, see `HeightMapBlade`.
    """

    HEADING: ClassVar = "Blade"

    def check_frame(self) -> None:
        """Refuse an unknown frame, and options that it would not look at.

        Raises
        ------
        InputError
        """
        require_choice(self.frame, FRAMES, "frame")
        defaults = {each.name: each.default for each in fields(BladeOptions)}
        for frame, names in OF_FRAME.items():
            given = [name for name in names if np.any(getattr(self, name) != defaults[name])]
            if frame != self.frame and given:
                name = given[0]
                raise InputError(
                    f"{name.replace('_', '-')}: is {getattr(self, name)}, which frame '{self.frame}' does not look at; "
                    f"leave it out, or give frame '{frame}'"
                )

    frame: str = option(
        "surface",
        "The blade as a 'surface' of its own, for any leaf, or as in the 'paper': heights over a plane.",
        choices=FRAMES,
    )
    smoothing: SmoothingValue | Literal["robust"] = "robust"
    up: Any = None
    base: Any = None
    piece: Count | None = option(None, "Which piece of the scan is the leaf, the largest being 1.")
    one_sheet: bool = option(True, "Take passes that disagree, or both sides of a thin leaf, for one surface.")
    keep_petiole: bool = option(False, "Keep the petiole, or a stub of the stem, as part of the blade.")
    fill_holes: NotNegative | None = option(
        None, "Fill holes up to this width (by default those no larger than the scan's gaps)", unit="scan-unit"
    )
    complete_margin: Positive | None = option(
        None,
        "Complete hidden stretches of margin from this length on by the other half's mirror image",
        unit="scan-unit",
    )
    rim_radius: Positive | None = option(
        None, "Let the thickness fall over this distance from the rim", unit="scan-unit"
    )
    thickness: Any = option(
        None,
        "CSV table of factors of the thickness, laid over the leaf: rows along it, from base to tip.",
        kind=Path,
        reads=True,
        needs=("ct",),
    )
    hair_density: Any = option(
        None,
        "CSV table of the shares of hairs to keep, 0 to 1, laid over the leaf: rows along it, from base to tip.",
        kind=Path,
        reads=True,
        needs=("ct",),
        unless=("remesh", "remesh_tile"),
    )
    hair_seed: Whole = option(0, "Random seed: which hairs are kept.", needs=("hair_density",))
    alpha: Positive | None = option(
        None, "With frame 'paper': radius of the alpha-shape (chosen from the scan if not given)", unit="scan-unit"
    )
    offset: str = option(
        "up",
        "With frame 'paper': direction of heights, 'up', as published, or the blade's 'normal'.",
        choices="o3dleaf.leaf.macro.offset:OFFSETS",
    )


@checked
@dataclass(frozen=True, kw_only=True)
class TextureOptions:
    """Options for the micro-structure from a micro-CT volume.

    Attributes
    ----------
    level : float, "mixture", "valley" or "otsu"
        Intensity of the surface, or the method that finds it in the histogram.
    rho : float, "gcv" or "gcv-per-ball"
        The paper's ρ, in (CT unit)³.
    period : (2,) array_like or "best", optional
        Size of a tile; by default all of the patch, as in the paper. "best" searches for one whose faces match.
    flip : {"along", "across", "both"}, optional
    shift : float
        Mirrored tiles, and rows of tiles that are shifted along by this share of a tile; see `TiledField`.
    tiles : {"periodic", "wang"}
        One tile that repeats, or sixteen cut out of the patch that never do; see `WangField`. Their size is `period`.
    seed : int
        Of Wang tiles: which ones, and where they lie.
    """

    HEADING: ClassVar = "Micro-structure"

    def check_tiles(self) -> None:
        """Refuse what tiles of the other kind alone can have.

        Raises
        ------
        InputError
        """
        if require_choice(self.tiles, TILES, "tiles") == "periodic":
            return
        wrong = {"flip": self.flip is not None, "shift": self.shift != 0, "period": isinstance(self.period, str)}
        for name in (name for name, given in wrong.items() if given):
            value = getattr(self, name)
            raise InputError(f"{name}: is {value!r}, which is for one tile that repeats, not Wang tiles; leave it out")

    level: Finite | str = option(
        "mixture",
        "Intensity of the surface: a number, or how the histogram tells it, 'mixture', 'valley' or 'otsu'.",
        kind=str,
        parse=number_or_word,
        **OF_VOLUME,
    )
    rho: SmoothingValue = option(
        "gcv",
        "Smoothing of the micro-structure: the paper's rho, in ct-unit³, 'gcv' or 'gcv-per-ball'.",
        kind=str,
        parse=number_or_word,
        **OF_VOLUME,
        unless=("saved_leaf",),
    )
    period: Any = option(
        None,
        "Size of a tile, 'ALONG ACROSS' in ct-unit, or 'best': the one whose opposite sides match best.",
        kind=str,
        parse=_period,
        **OF_VOLUME,
        unless=("saved_leaf",),
    )
    flip: str | None = option(None, "Mirror every second tile: along, across or both.", **OF_VOLUME)
    shift: Finite = option(0.0, "Shift each row of tiles along by this share of a tile, like bricks.", **OF_VOLUME)
    tiles: str = option(
        "periodic",
        "One 'periodic' tile, or 'wang': sixteen cut out of the patch and laid without repetition.",
        choices=TILES,
        **OF_VOLUME,
        unless=("saved_leaf",),
    )
    seed: Whole = option(0, "Random seed of Wang tiles: which ones, and where they lie.", needs=("tiles=wang",))

    @property
    def wang(self) -> bool:
        """Whether --tiles is 'wang'."""
        return self.tiles == "wang"
