"""The page: one HTML file that needs nothing else, for a screen, a dark one, and paper."""

import json
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any, NamedTuple

from o3dleaf.output.report.places import KINDS
from o3dleaf.output.report.requirements import CheckResult
from o3dleaf.output.report.viewer import as_json, viewer_script
from o3dleaf.output.report.words import QUANTITIES, TABLES, in_words, quantity_of

HEAD = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}: {word}</title>
<style>
{style}</style>
</head>
<body>"""

WORDS = {"passed": "PASSED", "failed": "FAILED", "not asked": "NO REQUIREMENTS"}

CONTROLS = (
    "Drag to turn, wheel or two fingers to zoom, Shift and drag (or the right button) to move; "
    "arrow keys, + and −, W for the wire frame, 0 for the start."
)


class Section(NamedTuple):
    """A part of the page: its name in the address, its heading, and its HTML."""

    name: str
    heading: str
    body: str


def write_page(title: str, verdict: CheckResult, sections: Sequence[Section], footer: str, *, lead: str = "") -> str:
    """Return the page of a title, a verdict and sections."""
    style = (files("o3dleaf.output.report") / "assets" / "page.css").read_text(encoding="utf-8")
    links = "".join(f'<a href="#{each.name}">{escape(each.heading)}</a>' for each in sections)
    badge = as_data("verdict", verdict.word, WORDS[verdict.word])
    parts = [
        HEAD.format(title=escape(title), word=verdict.word, style=style),
        f'<header><div><h1>{escape(title)}</h1><p class="lead">{lead}</p></div>',
        f'<div class="verdict {verdict.word.replace(" ", "-")}">{badge}</div></header>',
        f"<nav>{links}</nav>",
        requirements_table(verdict),
    ]
    parts += [f'<section id="{each.name}"><h2>{escape(each.heading)}</h2>\n{each.body}</section>' for each in sections]
    return "\n".join([*parts, f"<footer>{footer}</footer>", "</body>", "</html>", ""])


def requirements_table(verdict: CheckResult) -> str:
    """Return the table of what was required and found."""
    if not verdict.findings:
        return '<p class="note">Nothing was required of this mesh; the figures below are what it is.</p>'
    results = {True: '<td class="met">✓ met</td>', False: '<td class="unmet">✗ not met</td>'}
    rows = [
        f"<tr><td><code>{escape(str(each.requirement))}</code></td><td>{escape(each.wanted)}</td>"
        f"<td>{escape(each.found)}</td>{results[each.met]}</tr>"
        for each in verdict.findings
    ]
    head = "<tr><th>Required</th><th>Wanted</th><th>Found</th><th>Result</th></tr>"
    return f'<h2>Requirements</h2><table class="requirements">{head}{"".join(rows)}</table>'


def figures_tables(figures: Mapping[str, Any], unit: str | None) -> str:
    """Return every figure of a report in tables by topic; each exact value stands in its data element."""
    tables = list[str]()
    for table in TABLES:
        order = [
            *(name for name in QUANTITIES if name in figures),
            *(name for name in figures if name not in QUANTITIES),
        ]
        chosen = {name: figures[name] for name in order if quantity_of(name).table == table}
        rows = "".join(_row(name, value, unit) for name, value in chosen.items())
        # What nothing was measured against has a table of its own, all blanks: not shown.
        if any(value is not None for value in chosen.values()):
            tables.append(f'<section><h3>{table}</h3><table class="figures">{rows}</table></section>')
    return f'<div class="tables">{"".join(tables)}</div>'


def _row(name: str, value: Any, unit: str | None) -> str:
    """Return a figure as a row."""
    return f"<tr><td>{quantity_of(name).label}</td><td>{as_data(name, value, in_words(name, value, unit))}</td></tr>"


def as_data(name: str, value: Any, words: str) -> str:
    """Return a figure in words, with the exact value as JSON has it beside it."""
    return f'<data id="{name}" value="{escape(json.dumps(value), quote=True)}">{escape(words)}</data>'


def viewer_section(data: dict[str, Any], full: int, step: str) -> str:
    """Return the interactive view with its controls, its data and its program."""
    shown = len(data["layers"])
    choices = "".join(f'<option value="{n}">{escape(each["label"])}</option>' for n, each in enumerate(data["layers"]))
    kinds = "".join(
        f'<label><input type="checkbox" name="defect" value="{each["name"]}"{" checked" if each["shown"] else ""}> '
        f'<i class="key" style="background:{KINDS[each["name"]].color}">&nbsp;</i> '
        f"{KINDS[each['name']].title} ({each['count']:,})</label>"
        for each in data["defects"]
    )
    return f"""<p class="note interactive">{CONTROLS} {step}</p>
<div id="viewer" class="interactive" data-triangles="{full}" data-layers="{shown}">
<div class="tools"><label>Color <select name="color"><option value="-1">plain</option>{choices}</select></label>
<label><input type="checkbox" name="wire"> wire frame</label>
<button type="button" name="reset">Start view</button>{kinds}</div>
<p class="message"></p>
<canvas tabindex="0" aria-label="Interactive view of the mesh"></canvas>
<div class="legend" hidden><span class="low"></span><i></i><span class="high"></span><span class="what"></span></div>
</div>
<noscript><p class="note">The interactive view needs JavaScript; the pictures above show the same.</p></noscript>
<script type="application/json" id="viewer-data">{as_json(data)}</script>
<script>
{viewer_script()}</script>"""
