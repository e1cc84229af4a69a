"""Figures of numbers: the flattened scan, the height map with the outline, the histogram with the threshold."""

from collections.abc import Sequence

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.leaf.ct.threshold import thin
from o3dleaf.leaf.ct.voids import PiecesAtLevel
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.leaf.macro.blade import HeightMapBlade
from o3dleaf.output.figures.style import ALONG, HEIGHT, VERMILION, FigureSheet, plot, styled, words
from o3dleaf.output.view.panel import FAINT, INK

BINS = 128
SAMPLES = (600, 150)
"""Bins of the histogram, and samples of the height map along and across the leaf."""


def flattened_scan(blade: HeightMapBlade, scan: CloudLike) -> FigureSheet:
    """Return the scan in leaf coordinates, from above and from the side, colored by the way along the midrib.

    Parameters
    ----------
    blade : HeightMapBlade
    scan : (n, 3) array_like or Open3D point cloud
        In the blade's unit.
    """
    leaf = blade.frame.to_leaf(points_of(scan, "scan", least=1))
    with styled():
        figure, axes = plot(2.3, 2, sharex=True)
        for axis, across, name in zip(axes, (leaf[:, 1], leaf[:, 2]), ("across", "height"), strict=True):
            dots = axis.scatter(leaf[:, 0], across, c=leaf[:, 0], s=0.8, linewidths=0, cmap=ALONG, rasterized=True)
            axis.axhline(0, color=FAINT, linewidth=0.5, zorder=0)
            axis.set_ylabel(words(blade.unit, name))
        axes[1].set_xlabel(words(blade.unit, "along the midrib"))
        bar = figure.colorbar(dots, ax=axes, shrink=0.8, aspect=30, pad=0.02)
        bar.set_label(words(blade.unit, "along"))
        bar.outline.set_visible(False)
    return FigureSheet(
        figure,
        f"The scan ({len(leaf):,} points) in leaf coordinates, y = T(x): from above and from the side. "
        "Across and height are enlarged. Colors as in the figure of the scan.",
    )


def height_map(blade: HeightMapBlade) -> FigureSheet:
    """Return the smoothed height map H inside the outline of the blade, with contours."""
    low, high = blade.outline.bounds
    along, across = (np.linspace(low[axis], high[axis], count) for axis, count in enumerate(SAMPLES))
    plane = np.stack(np.meshgrid(along, across), axis=-1).reshape(-1, 2)
    values = blade.height_map(plane)
    spread = np.quantile(values[blade.outline.contains(plane)], (0.01, 0.99)).tolist()
    grid = values.reshape(len(across), len(along))
    with styled():
        figure, (axis,) = plot(1.55)
        picture = axis.imshow(
            grid, extent=(low[0], high[0], low[1], high[1]), origin="lower", aspect="auto", cmap=HEIGHT,
            vmin=spread[0], vmax=spread[1], interpolation="bilinear",
        )  # fmt: skip
        levels = MaxNLocator(8).tick_values(*spread)
        lines = axis.contour(along, across, grid, levels=levels, colors="white", linewidths=0.35, linestyles="solid")
        outline = PathPatch(_path_of(blade.outline.polygon), fill=False, edgecolor=INK, linewidth=0.6)
        axis.add_patch(outline)
        for drawn in (picture, lines):
            drawn.set_clip_path(outline)
        axis.set_xlim(low[0] - 0.01 * (high - low)[0], high[0] + 0.01 * (high - low)[0])
        axis.set_ylim(low[1] - 0.03 * (high - low)[1], high[1] + 0.03 * (high - low)[1])
        axis.set_xlabel(words(blade.unit, "along the midrib"))
        axis.set_ylabel(words(blade.unit, "across"))
        bar = figure.colorbar(picture, ax=axis, aspect=18, pad=0.02, extend="both")
        bar.set_label(words(blade.unit, "height H"))
        bar.outline.set_visible(False)
    return FigureSheet(
        figure,
        "The height map H of the blade over its midrib, and the outline, an α-shape of the flattened scan with "
        f"α = {blade.outline.alpha:.3g} {blade.unit or ''}. Across is enlarged.",
    )


def histogram(volume: Volume, level: float | str = "mixture") -> FigureSheet:
    """Return the histogram of a volume's intensities, zeros left out, with the threshold between air and leaf.

    Parameters
    ----------
    volume : Volume
    level : float, "mixture", "valley" or "otsu"
        The threshold, or how it is found.
    """
    threshold = volume.threshold(level)
    with styled():
        figure, (axis,) = plot(2.0)
        _draw_histogram(axis, volume, threshold)
        axis.set_xlabel("CT intensity")
    how = f"“{level}”" if isinstance(level, str) else "given"
    return FigureSheet(
        figure,
        f"Histogram of the intensities of {' × '.join(str(n) for n in volume.shape)} voxels, zeros left out, in "
        f"{BINS} bins; the line is the threshold f_surface = {threshold:.4g} ({how}) between air and leaf.",
    )


def levels(volume: Volume, rows: Sequence[PiecesAtLevel], level: float | None = None) -> FigureSheet:
    """Return the histogram of a volume, and below it number and volume of voids and of loose pieces over the level.

    Parameters
    ----------
    volume : Volume
    rows : sequence of PiecesAtLevel
    level : float, optional
        The threshold.
    """
    kinds = (("voids in the leaf", "voids", "void_volume"), ("loose pieces", "pieces", "piece_volume"))
    with styled():
        figure, axes = plot(4.0, 3, sharex=True)
        _draw_histogram(axes[0], volume, level)
        for axis, which, name in zip(axes[1:], (1, 2), ("number", words(volume.unit, "volume")), strict=True):
            for kind, color in zip(kinds, (VERMILION, INK), strict=True):
                values = [getattr(row, kind[which]) for row in rows]
                axis.plot([row.level for row in rows], values, "o-", color=color, label=kind[0], markersize=2.5)
            axis.set_yscale("symlog")
            axis.set_ylabel(name if which == 1 or volume.unit is None else f"{name}³")
            if level is not None:
                axis.axvline(level, color=FAINT, linewidth=0.8, zorder=0)
        axes[1].legend(frameon=False)
        axes[2].set_xlabel("level")
    return FigureSheet(
        figure,
        "Histogram of the intensities, zeros left out; and for each level the voids, which are air that no way leads "
        "out of, and the pieces of leaf beside the largest. The line is the threshold.",
    )


def _draw_histogram(axis: Axes, volume: Volume, threshold: float | None) -> None:
    """Draw shares of the voxels, and a line at the threshold between air and leaf."""
    sample = np.asarray(thin(volume.data), dtype=np.float64).ravel()
    sample = sample[sample != 0]
    low, high = np.quantile(sample, (0.0005, 0.9995))
    if threshold is not None:
        low, high = min(low, threshold), max(high, threshold)
    counts, edges = np.histogram(sample, BINS, (low, high))
    share = 100 * counts / len(sample)
    axis.stairs(share, edges, fill=True, color="#9fb4a4")
    top = 1.12 * float(share.max())
    axis.set_ylim(0, top)
    axis.set_xlim(edges[0], edges[-1])
    axis.set_ylabel("voxels, %")
    axis.yaxis.set_major_locator(MaxNLocator(4))
    if threshold is None:
        return
    axis.axvline(threshold, color=VERMILION, linewidth=1.2)
    right = threshold < (edges[0] + edges[-1]) / 2
    axis.annotate(
        f"threshold {threshold:.3g}", (threshold, 0.93 * top), (4 if right else -4, 0), textcoords="offset points",
        ha="left" if right else "right", va="center", color=VERMILION,
    )  # fmt: skip
    for name, side in (("air", edges[:-1] < threshold), ("leaf", edges[:-1] >= threshold)):
        _name_peak(axis, name, np.where(side, share, 0), edges)


def _name_peak(axis: Axes, name: str, share: FloatArray, edges: FloatArray) -> None:
    """Write a name above the highest bin, inside the axes."""
    peak = int(share.argmax())
    x = np.clip((edges[peak] + edges[peak + 1]) / 2, *np.quantile(edges, (0.04, 0.96)))
    axis.annotate(name, (x, share[peak]), (0, 3), textcoords="offset points", ha="center", color=INK)


def _path_of(outline: shapely.Polygon) -> Path:
    """Return the rings of a polygon as a path."""
    return Path.make_compound_path(*(Path(np.asarray(ring.coords)) for ring in (outline.exterior, *outline.interiors)))
