"""The furniture of a page: scale bars, color bar, frames and words, drawn by Matplotlib without its global state."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from textwrap import wrap
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from o3dleaf.core.atomic_files import whole_file
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.units import name_length

INK = "#27302a"
FAINT = "#8b958d"
LETTER = 0.47
"""Mean width of a letter of a caption, in heights of a line."""
UNIT = re.compile(r"(?<=\d) (?=%|[nµumck]?m\b)")
"""The space between a number and its unit, at which no line ends."""


@dataclass(frozen=True)
class Box:
    """A rectangle of pixels on the page, from its left and top edge."""

    left: int
    top: int
    width: int
    height: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.width, self.height

    def without_foot(self, foot: int) -> "Box":
        """Return the box less `foot` pixels at its lower edge."""
        return Box(self.left, self.top, self.width, self.height - foot)


def lay_out(size: tuple[int, int], insets: int, wide: float, top: int, foot: int) -> tuple[Box, list[Box]]:
    """Return the box of the main picture and one for each inset.

    Parameters
    ----------
    size : (int, int)
        Width and height of the page in pixels.
    insets : int
        Their number.
    wide : float
        Width over height of what the main picture shows: something long lies below a row of
        insets, anything else stands beside a column of them.
    top : int
        Pixels kept free for the title.
    foot : int
        Pixels in each box that the scale bar takes from the picture.
    """
    width, height = size
    free = height - top
    if not insets:
        return Box(0, top, width, free), []
    gap = round(0.025 * min(size))
    if wide > 1.6 * width / free:
        low = foot + min(round(0.48 * free), max(round(0.15 * free), round(width / wide)))
        high = free - low - gap
        each = min((width - gap * (insets + 1)) // insets, round(1.5 * high))
        left = (width - insets * each - (insets - 1) * gap) // 2
        boxes = [Box(left + n * (each + gap), top + gap, each, high - gap) for n in range(insets)]
        return Box(0, top + free - low, width, low), boxes
    column = round(0.36 * width)
    each = (free - gap * (insets + 1)) // insets
    boxes = [Box(width - column - gap, top + gap + n * (each + gap), column, each) for n in range(insets)]
    return Box(0, top, width - column - 2 * gap, free), boxes


def em_of(size: tuple[int, int]) -> float:
    """Return the height of a line of text on a page of `size` pixels, in pixels."""
    return max(8.0, 0.017 * min(size[0], 1.6 * size[1]))


class Page:
    """A picture in the making: pixels below, ink above."""

    def __init__(self, pixels: FloatArray, text: float = 1.0, dpi: float = 100.0) -> None:
        """Start from (h, w, 3) `pixels`, sRGB, `dpi` an inch, for words of `text` times the usual height."""
        height, width = pixels.shape[:2]
        self.em = text * em_of((width, height))
        # Matplotlib measures type and lines in points.
        self.line = self.em * 100 / dpi
        self.figure = Figure(figsize=(width / dpi, height / dpi), dpi=dpi)
        self.canvas = FigureCanvasAgg(self.figure)
        self.axes: Axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set_axis_off()
        # As Matplotlib would round them itself, but before it resamples four channels of floats.
        shown = np.full((height, width, 4), 255, dtype=np.uint8)
        shown[..., :3] = 255 * pixels
        self.axes.imshow(shown, extent=(0, width, height, 0), interpolation="nearest", aspect="auto")
        self.axes.set_xlim(0, width)
        self.axes.set_ylim(height, 0)

    def write(
        self, x: float, y: float, text: str, *, align: str = "left", scale: float = 1.0, framed: bool = False
    ) -> None:
        """Write `text` with the middle of its line at pixel (x, y), in a frame if it stands on the picture."""
        points = scale * self.line * 0.72
        # Names of files may hold a dollar sign.
        drawn = self.axes.text(x, y, text, color=INK, fontsize=points, ha=align, va="center", parse_math=False)
        drawn.set_fontfamily("DejaVu Sans")
        if framed:
            drawn.set_bbox({"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": INK, "alpha": 0.9})

    def key(self, color: str, marker: str, text: str, place: float = 0.29) -> None:
        """Write a legend at the foot, `place` of its width from the left, for a marker of Matplotlib in a color."""
        width, height = self.figure.bbox.size
        left, base = place * width, height - 1.3 * self.em
        line = marker == "-"
        x = left + self.em * np.array([-0.6, 0.6] if line else [0.0])
        drawn = self.axes.plot(x, np.full(len(x), base), color=color, linewidth=0.15 * self.line)[0]
        if not line:
            drawn.set(marker=marker, markersize=0.5 * self.line)
        self.write(left + 1.1 * self.em, base, text, scale=0.85)

    def frame(self, box: Box) -> None:
        """Draw the frame of an inset."""
        self.axes.add_patch(
            Rectangle(
                (box.left, box.top), box.width, box.height, fill=False, edgecolor=FAINT, linewidth=0.06 * self.line
            )
        )

    def mark(self, corners: FloatArray, box: Box) -> None:
        """Mark the rectangle around (n, 2) pixel positions, and join it to the inset that enlarges it."""
        least = 0.45 * self.em
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        half = np.maximum((corners.max(axis=0) - corners.min(axis=0)) / 2, least)
        low, extent = middle - half, 2 * half
        width = 0.07 * self.line
        self.axes.add_patch(
            Rectangle((low[0], low[1]), extent[0], extent[1], fill=False, edgecolor=INK, linewidth=width)
        )
        below = box.top + box.height <= low[1]
        ends = [(low[0], box.left), (low[0] + extent[0], box.left + box.width)]
        if not below:
            ends = [(low[1], box.top), (low[1] + extent[1], box.top + box.height)]
        for near, far in ends:
            line = (
                ([near, far], [low[1], box.top + box.height])
                if below
                else ([low[0] + extent[0], box.left], [near, far])
            )
            self.axes.plot(*line, color=FAINT, linewidth=0.05 * self.line)

    def scale_bar(self, box: Box, width: float, unit: str | None) -> None:
        """Draw a scale bar into the lower left corner of a box that shows `width` of the mesh's unit."""
        length = round_length(0.22 * width)
        pixels = length / width * box.width
        left, base = box.left + self.em, box.top + box.height - 0.9 * self.em
        self.axes.plot(
            [left, left + pixels], [base, base], color=INK, linewidth=0.15 * self.line, solid_capstyle="butt"
        )
        self.write(left, base - 0.85 * self.em, name_length(length, unit))

    def color_bar(self, box: Box, color_map: str, limits: tuple[float, float], label: str) -> None:
        """Draw the bar of a color map, with its two ends and a label, into the lower right corner of a box."""
        width, height = max(0.24 * box.width, 9 * self.em), 0.55 * self.em
        left, top = box.left + box.width - width - self.em, box.top + box.height - 2.3 * self.em
        strip = colormaps[color_map](np.linspace(0, 1, 256))[np.newaxis]
        self.axes.imshow(strip, extent=(left, left + width, top + height, top), aspect="auto", zorder=3)
        self.axes.set_xlim(0, self.figure.bbox.width)
        self.axes.set_ylim(self.figure.bbox.height, 0)
        self.write(left, top + 1.4 * self.em, f"{limits[0]:.3g}", scale=0.85)
        self.write(left + width, top + 1.4 * self.em, f"{limits[1]:.3g}", align="right", scale=0.85)
        self.write(left + width / 2, top - 0.7 * self.em, label, align="center", scale=0.85)

    def pixels(self) -> npt.NDArray[np.uint8]:
        """Return the finished (h, w, 3) page."""
        self.canvas.draw()
        return np.array(self.canvas.buffer_rgba())[:, :, :3].copy()


class Heading(NamedTuple):
    """A title, perhaps empty, and the lines below it, in letters of `em` pixels."""

    title: str
    lines: list[str]
    em: float

    @classmethod
    def of(cls, text: str, size: tuple[int, int], em: float) -> "Heading":
        """Return the heading of a page of a size in pixels; what follows the first newline of a text is smaller."""
        title, *caption = text.split("\n")
        lines = lines_of(caption, max(1, int((size[0] / em - 2) / LETTER)))
        room = max(0, int((0.75 * size[1] / em - 2.8) / 1.4))  # the picture keeps a quarter of the page
        if len(lines) > room:
            lines = [*lines[: max(0, room - 1)], "…"][:room]
        return cls(title, lines, em)

    @property
    def height(self) -> int:
        """Pixels that it takes at the top of the page."""
        lines = 2.4 * bool(self.title) + 1.4 * len(self.lines) + 0.4 * bool(self.lines)
        return round(lines * self.em)

    def draw(self, page: Page) -> None:
        """Write it at the top of a page."""
        if self.title:
            page.write(self.em, 1.3 * self.em, self.title, scale=1.25)
        for number, line in enumerate(self.lines):
            page.write(self.em, (1.1 + 1.4 * number + 2.2 * bool(self.title)) * self.em, line, scale=0.85)


def lines_of(texts: Sequence[str], letters: int) -> list[str]:
    """Return texts as lines of at most so many letters, which do not end between a number and its unit."""
    return [line for text in texts for line in wrap(UNIT.sub("\u00a0", text), letters)]


def save_figure(figure: Figure, path: str | PathLike[str]) -> None:
    """Write a figure of Matplotlib, whole or not at all; of the same figure always the same bytes."""
    suffix = Path(path).suffix.lower()
    dated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(suffix)
    with whole_file(path) as temporary, rc_context({"svg.hashsalt": "o3dleaf", "svg.fonttype": "path"}):
        figure.savefig(temporary, dpi=figure.dpi, metadata=dated)


def round_length(length: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above `length`."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(step * power for step in (1, 2, 5) if step * power <= length * (1 + 1e-9)))
