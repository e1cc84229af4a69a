"""The page of a droplet: figures, curves, pictures and the animation in one HTML file."""

import base64
import io
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

import numpy as np

from o3dleaf.core.atomic_files import write_text
from o3dleaf.output.droplet.readings import DropletReadings
from o3dleaf.output.figures.style import BLUE, ORANGE, TEAL, VERMILION, plot, styled
from o3dleaf.output.report.page import HEAD

COLORS = (BLUE, ORANGE, TEAL, VERMILION, "#56b4e9", "#cc79a7", "#f0e442", "#000000")
CURVES = (
    (("width_along", "width_across"), "width along (dashed: across), mm", 1e3),
    (("height",), "top of the droplet, mm", 1e3),
    (("contact_area",), "contact area, mm²", 1e6),
    (("velocity_z",), "mean normal speed, m/s", 1.0),
    (("fastest",), "largest speed in the box, m/s", 1.0),
)
"""Columns of each plot, its axis, and the factor from SI."""
FIGURES = {
    "touch_ms": "first touch, ms",
    "largest_width_along": "largest width along the leaf, diameters",
    "largest_width_across": "largest width across, diameters",
    "ratio_at_largest_width": "along over across, at the largest spread",
    "largest_ratio": "along over across, largest while it touches",
    "largest_ratio_at_ms": "along over across, largest, at ms",
    "least_ratio": "along over across, least while it touches",
    "least_ratio_at_ms": "along over across, least, at ms",
    "largest_contact_mm2": "largest contact area, mm²",
    "lift_off_ms": "lift-off, ms",
    "rebound_m_s": "speed at lift-off, m/s",
    "volume_drift": "volume, largest relative change",
    "alpha_min": "least α",
    "alpha_max": "largest α",
    "fastest_m_s": "largest speed of water or air, m/s",
}
"""Names of the figures of a run."""
NOTES = (
    "Widths, height and the pictures are those of the surface α = 0.5 of the largest piece of water. A droplet touches "
    "where its contact area is at least 5 % of the largest: the interface is about two cells thick. Times run from the "
    "start, which is a little before the touch. Largest speeds are those of parasitic currents beside the interface as "
    "well. The contact angle is a static one, and the solver's mesh does not resolve hairs thinner than a cell."
)


def write_page(
    path: Path,
    title: str,
    figures: str,
    courses: Mapping[str, DropletReadings],
    pictures: Sequence[str],
) -> None:
    """Write the page around its table of figures; pictures lie beside it, and are taken into it."""
    style = (files("o3dleaf.output.report") / "assets" / "page.css").read_text(encoding="utf-8")
    drawn = "".join(f"<figure>{curve(courses, *each)}</figure>" for each in CURVES)
    images = "".join(image(path.parent / name) for name in pictures)
    body = [
        HEAD.format(title=escape("A droplet on a leaf"), word="droplet", style=style),
        f'<header><div><h1>A droplet on a leaf</h1><p class="lead">{escape(title)}</p></div></header>',
        f"<section><h2>Figures</h2>{figures}<p class='note'>{NOTES}</p></section>",
        f'<section><h2>Curves</h2><div class="row">{drawn}</div></section>',
        f"<section><h2>Pictures</h2>{images}</section>",
        "</body>",
        "</html>",
        "",
    ]
    write_text("\n".join(body), path)


def figures_table(
    summaries: Mapping[str, Mapping[str, float]],
    spread: Mapping[str, tuple[float, float]],
    failures: Sequence[str] = (),
) -> str:
    """Return the figures of all runs, a column each, their mean and spread over landing places, and what has failed."""
    head = "".join(f"<th>{escape(run)}</th>" for run in summaries)
    rows = []
    for name, words in FIGURES.items():
        cells = "".join(f"<td>{in_words(figures[name])}</td>" for figures in summaries.values())
        if spread:
            cells += f"<td>{in_words(spread[name][0])} ± {spread[name][1]:.2g}</td>"
        rows.append(f"<tr><td>{words}</td>{cells}</tr>")
    more = "<th>leaf, mean ± standard deviation</th>" if spread else ""
    warned = "".join(f"<p class='note'><b>{escape(failure)}</b></p>" for failure in failures)
    return f"<table><tr><th></th>{head}{more}</tr>{''.join(rows)}</table>{warned}"


def in_words(value: float) -> str:
    """Return a figure, or a dash for what has not happened."""
    return f"{value:.4g}" if np.isfinite(value) else "–"


def curve(courses: Mapping[str, DropletReadings], columns: Sequence[str], label: str, factor: float) -> str:
    """Return one plot of all runs as SVG; of two columns the second is dashed."""
    with styled():
        figure, (axis,) = plot(2.1)
        for (run, course), color in zip(courses.items(), COLORS * len(courses), strict=False):
            for name, line in zip(columns, ("-", "--"), strict=False):
                which = run if line == "-" else None
                axis.plot(course.column("t") * 1e3, course.column(name) * factor, line, color=color, lw=1, label=which)
        axis.set_xlabel("time, ms")
        axis.set_ylabel(label)
        axis.legend(frameon=False, fontsize=6)
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None})
    text = stream.getvalue()
    return text[text.index("<svg") :]


def image(path: Path) -> str:
    """Return a picture with its bytes in the page."""
    kind = path.suffix.removeprefix(".")
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    return f'<figure><img alt="{escape(path.stem)}" src="data:image/{kind};base64,{data}"></figure>'
