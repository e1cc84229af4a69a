"""Histograms as inline SVG: crisp at any size, small, in the page's own colors."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Protocol

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.output.report.words import unit_of

WIDTH, HEIGHT = 560, 260
LEFT, RIGHT, TOP, BOTTOM = 58, 14, 40, 44
"""Margins of the plot."""


@dataclass(frozen=True)
class Mark:
    """A vertical line in a histogram: where, what it says, and whether it is a limit that was required."""

    value: float
    label: str
    is_limit: bool = False


@dataclass(frozen=True)
class Histogram:
    """Counts in equal bins of one kind of figure.

    Attributes
    ----------
    title : str
    counts : sequence of int
        One a bin.
    low, high : float
        The ends of the first and the last bin.
    kind : {"degrees", "length"}
    unit : str, optional
        Unit of lengths.
    marks : sequence of Mark
    below, above : int
        Values outside the bins.
    """

    title: str
    counts: Sequence[int]
    low: float
    high: float
    kind: str
    unit: str | None = None
    marks: Sequence[Mark] = ()
    below: int = 0
    above: int = 0

    @classmethod
    def of_lengths(cls, title: str, values: FloatArray, unit: str | None, marks: Sequence[Mark] = ()) -> "Histogram":
        """Return the histogram of finite lengths from the least to the 99.9th percentile, in 60 bins."""
        known = values[np.isfinite(values)]
        low, high = float(known.min()), float(np.quantile(known, 0.999))
        low = 0.0 if low < 0.2 * high else low
        # Of equal lengths the bins are a hundredth of them wide about their place.
        high = high if high - low > 1e-9 * max(abs(high), 1e-300) else low + max(0.01 * abs(low), 1e-300)
        counts = np.histogram(known, 60, (low, high))[0]
        return cls(title, counts.tolist(), low, high, "length", unit, marks, 0, int((known > high).sum()))

    def svg(self) -> str:
        """Return the drawing."""
        counts = np.asarray(self.counts, dtype=np.float64)
        total = max(counts.sum() + self.below + self.above, 1)
        share = 100 * counts / total
        top, ticks = _axis(0.0, float(share.max(initial=0)) or 1.0)
        plot = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM

        def x(value: float) -> float:
            return LEFT + (value - self.low) / (self.high - self.low) * plot[0]

        def y(value: float) -> float:
            return TOP + (1 - value / top) * plot[1]

        lines = [f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(self.title)}">']
        for tick in ticks:
            lines.append(f'<path class="grid" d="M{LEFT} {y(tick):.1f}H{WIDTH - RIGHT}"/>')
            lines.append(f'<text class="tick end" x="{LEFT - 7}" y="{y(tick) + 4:.1f}">{tick:g} %</text>')
        edges = np.linspace(self.low, self.high, len(counts) + 1)
        for each, (count, part) in enumerate(zip(counts, share, strict=True)):
            if count:
                # A bin that holds anything shows: at least one pixel.
                height = max(plot[1] * part / top, 1.0)
                tip = f"{edges[each]:.4g} to {edges[each + 1]:.4g}{self._unit()}: {count:,.0f} ({part:.3g} %)"
                box = f'x="{x(edges[each]):.2f}" width="{plot[0] / len(counts) - 0.6:.2f}"'
                lines.append(
                    f'<rect class="bar" {box} y="{TOP + plot[1] - height:.2f}" height="{height:.2f}">'
                    f"<title>{tip}</title></rect>"
                )
        lines.append(f'<path class="axis" d="M{LEFT} {TOP + plot[1]}H{WIDTH - RIGHT}"/>')
        ticks = _axis(self.low, self.high)[1]
        lines += [f'<text class="tick mid" x="{x(tick):.1f}" y="{HEIGHT - 26}">{tick:g}</text>' for tick in ticks]
        lines.append(f'<text class="label mid" x="{LEFT + plot[0] / 2}" y="{HEIGHT - 7}">{self._axis_label()}</text>')
        lines += self._draw_marks(x)
        return "\n".join([*lines, "</svg>"])

    def _draw_marks(self, x: "_Place") -> list[str]:
        """Return the vertical lines, their labels in rows where they would overlap."""
        lines, ends = list[str](), [-np.inf] * 3
        for mark in sorted(self.marks, key=lambda each: each.value):
            if not self.low <= mark.value <= self.high:
                continue
            position, width = x(mark.value), 6.2 * len(mark.label)
            left = min(max(position - width / 2, LEFT), WIDTH - RIGHT - width)
            row = next((row for row, end in enumerate(ends) if left > end), len(ends) - 1)
            ends[row] = left + width + 6
            kind = "mark limit" if mark.is_limit else "mark"
            lines.append(f'<path class="{kind}" d="M{position:.1f} {13 + 12 * row}V{HEIGHT - BOTTOM}"/>')
            lines.append(f'<text class="tick" x="{left:.1f}" y="{10 + 12 * row}">{escape(mark.label)}</text>')
        return lines

    def _unit(self) -> str:
        """Return what follows a value of the axis."""
        return "°" if self.kind == "degrees" else unit_of(self.kind, self.unit)

    def _axis_label(self) -> str:
        """Return what stands below the axis."""
        unit = self._unit().strip()
        beyond = f"; {self.above:,} beyond" if self.above else ""
        return escape(f"{self.title}{f', {unit}' if unit else ''}{beyond}")


class _Place(Protocol):
    """The type of a function from values to pixels."""

    def __call__(self, value: float) -> float: ...


def _axis(low: float, high: float) -> tuple[float, list[float]]:
    """Return the top of an axis that holds `high`, and some five round numbers along it."""
    raw = (high - low) / 5
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(float(each * power) for each in (1, 2, 2.5, 5, 10) if each * power >= raw * (1 - 1e-9))
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    ticks = [float(f"{n * step:.10g}") for n in range(first, last + 1)]
    return max(high * 1.04, high), ticks
