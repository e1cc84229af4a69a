"""Style shared by all figures: a column's width, the fonts, colors that color-blind readers can tell apart."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from o3dleaf.output.view.panel import FAINT, INK

COLUMN = 3.35
"""Width of a printed column in inches, 85 mm."""

PICTURE, LOW = (1200, 760), (1200, 570)
"""Pixels of a picture in such a column, 360 an inch, and of one of something long."""

TEXT = 1.75
"""Words of a picture, relative to those on a screen: 7 points in a column."""

BLUE, ORANGE, VERMILION, TEAL = "#0072b2", "#e69f00", "#d55e00", "#009e73"
"""Of the palette of Okabe and Ito, which color-blind readers can tell apart."""

ALONG, HEIGHT = "viridis", "cividis"
"""Color maps of even lightness: of the way along the leaf, and of heights."""

RULES: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7.0,
    "axes.labelsize": 7.0,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


class FigureSheet(NamedTuple):
    """A figure of Matplotlib, which ``figure.savefig`` writes, and its caption."""

    figure: Figure
    caption: str


@contextmanager
def styled() -> Iterator[None]:
    """Draw by `RULES` meanwhile."""
    with rc_context(RULES):  # type: ignore[arg-type]
        yield


def plot(height: float, rows: int = 1, **options: Any) -> tuple[Figure, list[Axes]]:
    """Return a figure a column wide and `height` inches high, and the axes of its rows."""
    with styled():
        figure = Figure(figsize=(COLUMN, height), dpi=300, layout="constrained")
        axes = figure.subplots(rows, 1, squeeze=False, **options)
    return figure, list(np.ravel(axes))


def words(unit: str | None, name: str) -> str:
    """Return the name of an axis with its unit."""
    return f"{name}, {unit.replace('um', 'µm')}" if unit else name
