"""Pictures for a page: shaded with a see-through background, ink in SVG on top, so that both suit light and dark."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.image import imsave

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.units import name_length
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.output.view.panel import round_length
from o3dleaf.output.view.scene import UNDER_GREEN, UPPER_GREEN, encode, linear
from o3dleaf.output.view.shade import Paint, Shot, shade_mesh

FINER = 1.25
"""Pixels of a picture for each of the page's, for fine screens and paper."""

QUALITY = 82
"""Of WebP."""

FOOT = 40
"""Height below a picture that scale bar and color bar take."""

LABEL = 16
"""Height that the name of the colors takes besides."""

BANDS = 64
"""Of a color bar."""

NO_VALUE = np.array([0.42, 0.42, 0.42])
"""Linear RGB of what has no value."""


@dataclass(frozen=True)
class Colors:
    """Numbers shown as colors.

    Attributes
    ----------
    values : (n,) ndarray
        One a vertex; NaN is gray.
    label : str
        What they are, with their unit.
    limits : (float, float)
        Values at the ends of the color map.
    color_map : str
        One of Matplotlib's.
    """

    values: FloatArray
    label: str
    limits: tuple[float, float]
    color_map: str = "viridis"

    def table(self) -> FloatArray:
        """Return (256, 3) sRGB colors."""
        return np.asarray(colormaps[self.color_map](np.linspace(0, 1, 256))[:, :3])

    def stops(self) -> list[str]:
        """Return 16 colors of the map, evenly spaced, as HTML writes them."""
        return [_hex(color) for color in self.table()[::17].tolist()]

    def paint(self, triangles: IntArray) -> Paint:
        """Return the colors of the surface; a triangle with a corner without value is gray."""
        low, high = self.limits
        # Full light is brighter than the bar: toned down, the colors are those of the bar.
        table = 0.72 * linear(self.table())

        def paint(triangle: IntArray, weights: FloatArray, _facing: FloatArray) -> FloatArray:
            here = np.einsum("ij,ij->i", weights, self.values[triangles[triangle]])
            known = ~np.isnan(here)
            part = np.clip((np.where(known, here, low) - low) / ((high - low) or 1.0), 0, 1)
            return np.where(known[:, np.newaxis], table[np.round(part * 255).astype(np.int64)], NO_VALUE)

        return paint

    def bar(self, width: float, top: float) -> str:
        """Return the color bar as SVG, its right end at `width`."""
        length = min(320.0, 0.45 * width)
        left, each = width - length - 8, length / BANDS
        table = self.table()[np.linspace(0, 255, BANDS).astype(int)].tolist()
        bands = "".join(
            f'<path stroke="{_hex(color)}" d="M{left + (n + 0.5) * each:.2f} {top + 2:.0f}v9"/>'
            for n, color in enumerate(table)
        )
        return (
            f'<g class="bands" stroke-width="{each + 0.4:.2f}">{bands}</g>'
            f'<text x="{left:.0f}" y="{top + 25:.0f}">{self.limits[0]:.3g}</text>'
            f'<text class="end" x="{width - 8:.0f}" y="{top + 25:.0f}">{self.limits[1]:.3g}</text>'
            f'<text class="end" x="{width - 8:.0f}" y="{top + 42:.0f}">{escape(self.label)}</text>'
        )


def leaf_green(_triangle: IntArray, _weights: FloatArray, facing: FloatArray) -> FloatArray:
    """Return the colors of a leaf: its outside, and paler where the triangles are seen from behind."""
    return np.where(facing[:, np.newaxis] > 0, UPPER_GREEN, UNDER_GREEN)


def vertex_paint(colors: FloatArray, triangles: IntArray) -> Paint:
    """Return the colors of a surface with a linear RGB at each vertex, (n, 3)."""
    return lambda triangle, weights, _facing: np.einsum("ij,ijk->ik", weights, colors[triangles[triangle]])


@dataclass(frozen=True)
class Picture:
    """One picture of a mesh.

    Attributes
    ----------
    image : str
        The picture as a data address.
    size : (int, int)
        Its width and height on the page.
    camera : Camera
    """

    image: str
    size: tuple[int, int]
    camera: Camera

    def svg(self, unit: str | None, ink: Sequence[str] = (), colors: Colors | None = None) -> str:
        """Return the picture with its scale bar, what is drawn over it, and the bar of its colors."""
        width, height = self.size
        length = round_length(0.2 * self.camera.width)
        pixels = length / self.camera.width * width
        return "\n".join(
            [
                f'<svg class="picture" viewBox="0 0 {width} {height + FOOT + (LABEL if colors else 0)}" role="img">',
                f'<image href="{self.image}" width="{width}" height="{height}"/>',
                *ink,
                f'<path class="scale" d="M8 {height + 12}h{pixels:.1f}"/>',
                f'<text x="8" y="{height + 30}">{name_length(length, unit)}</text>',
                *([colors.bar(width, height + 4)] if colors else []),
                "</svg>",
            ]
        )


def shoot(
    vertices: FloatArray,
    triangles: IntArray,
    paint: Paint,
    camera: Camera,
    size: tuple[int, int],
    *,
    smooth: bool = True,
) -> Picture:
    """Return the picture of a mesh that a camera sees, with a see-through background."""
    finer = round(FINER * size[0]), round(FINER * size[1])
    shaded = shade_mesh(Shot(vertices, triangles, paint, camera, finer, View(smooth=smooth, supersampling=2)))
    return Picture(_as_address(shaded), size, camera)


def _as_address(shaded: FloatArray) -> str:
    """Return a data address of linear RGB times coverage, and coverage."""
    cover = shaded[..., 3:]
    color = encode(shaded[..., :3] / np.where(cover > 0, cover, 1))
    pixels: npt.NDArray[np.uint8] = np.round(255 * np.concatenate([color, cover], axis=2)).astype(np.uint8)
    stream = io.BytesIO()
    imsave(stream, pixels, format="webp", pil_kwargs={"quality": QUALITY})
    return "data:image/webp;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


def linear_color(text: str) -> FloatArray:
    """Return the linear RGB of a color as HTML writes it, "#rrggbb"."""
    return linear(np.array([int(text[each : each + 2], 16) / 255 for each in (1, 3, 5)]))


def _hex(color: Sequence[float]) -> str:
    """Return an sRGB color as HTML writes it."""
    return "#" + "".join(f"{round(255 * each):02x}" for each in color)
