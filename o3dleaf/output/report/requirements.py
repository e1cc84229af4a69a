"""Requirements of a mesh, in words, and whether it meets them: "watertight,components=1,min-angle=10"."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.errors import InputError
from o3dleaf.output.report.words import in_words, quantity_of
from o3dleaf.surface.mesh.mesh_report import MeshReport

LIMITS = {"count": np.inf, "degrees": 180.0, "share": 1.0, "length": np.inf}
"""By kind of figure, the largest value that can be asked for; the least is 0."""

ORDERS = {"=": "", "≥": "at least ", "≤": "at most "}


class Rule(NamedTuple):
    """Meaning of the name of a requirement: a figure of the report and its comparison.

    Attributes
    ----------
    attribute : str
        The figure of `MeshReport`.
    order : {"is", "none", "=", "≥", "≤"}
        Its comparison: a property that must hold, a count that must be 0, or with a number.
    kind : {"count", "degrees", "share", "length"}
        Of the number.
    causes : tuple of str
        Counts that explain why a property does not hold.
    needs : str, optional
        Input that the report must have been made with: "field" or "cloud".
    """

    attribute: str
    order: str
    kind: str = "count"
    causes: tuple[str, ...] = ()
    needs: str | None = None


_EDGES = ("nonmanifold_edges", "nonmanifold_vertices")
RULES = {
    "watertight": Rule("watertight", "is", causes=("boundary_edges", *_EDGES, "self_intersections")),
    "manifold": Rule("manifold", "is", causes=_EDGES),
    "oriented": Rule("oriented", "is", causes=("inconsistent_edges",)),
    "closed": Rule("boundary_edges", "none"),
    "no-self-intersections": Rule("self_intersections", "none"),
    "no-degenerate-triangles": Rule("degenerate_triangles", "none"),
    "no-duplicate-triangles": Rule("duplicate_triangles", "none"),
    "components": Rule("components", "="),
    "holes": Rule("holes", "="),
    "genus": Rule("genus", "="),
    "boundary-edges": Rule("boundary_edges", "="),
    "min-triangles": Rule("triangles", "≥"),
    "max-triangles": Rule("triangles", "≤"),
    "min-angle": Rule("min_angle_deg", "≥", "degrees"),
    "max-angle": Rule("max_angle_deg", "≤", "degrees"),
    "share-below-1deg": Rule("share_below_1deg", "≤", "share"),
    "share-below-5deg": Rule("share_below_5deg", "≤", "share"),
    "share-below-10deg": Rule("share_below_10deg", "≤", "share"),
    "share-below-20deg": Rule("share_below_20deg", "≤", "share"),
    "min-edge": Rule("shortest_edge", "≥", "length"),
    "max-edge": Rule("longest_edge", "≤", "length"),
    "max-deviation": Rule("field_distance_max", "≤", "length", needs="field"),
    "max-mean-deviation": Rule("field_distance_mean", "≤", "length", needs="field"),
    "max-scan-distance": Rule("scan_distance_max", "≤", "length", needs="cloud"),
    "max-mean-scan-distance": Rule("scan_distance_mean", "≤", "length", needs="cloud"),
    "unsupported-share": Rule("unsupported_share", "≤", "share", needs="cloud"),
}
"""Every word of a requirement."""


@dataclass(frozen=True)
class Requirement:
    """One word and its number.

    Attributes
    ----------
    name : str
        A key of `RULES`.
    wanted : float, optional
        The number it is compared with, where it is with one.
    """

    name: str
    wanted: float | None = None

    def __str__(self) -> str:
        return self.name if self.wanted is None else f"{self.name}={self.wanted:.12g}"

    @property
    def rule(self) -> Rule:
        """The rule of that name."""
        return RULES[self.name]


@dataclass(frozen=True)
class Finding:
    """One requirement, and the figure of the report.

    Attributes
    ----------
    requirement : Requirement
    met : bool
    wanted, found : str
        Both in words, with units.
    """

    requirement: Requirement
    met: bool
    wanted: str
    found: str

    def __str__(self) -> str:
        return f"{self.requirement}: wanted {self.wanted}, found {self.found}"


@dataclass(frozen=True)
class CheckResult:
    """Result of checking a mesh against requirements.

    Attributes
    ----------
    findings : tuple of Finding
        One for each requirement, in the order in which they were named.
    """

    findings: tuple[Finding, ...] = ()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self})"

    def __str__(self) -> str:
        count = len(self.findings)
        return f"{self.word} ({count - len(self.failures)} of {count} met)" if count else self.word

    @property
    def passed(self) -> bool:
        """True if every requirement is met, also where there are none."""
        return not self.failures

    @property
    def failures(self) -> tuple[Finding, ...]:
        """Requirements that are not met."""
        return tuple(each for each in self.findings if not each.met)

    @property
    def word(self) -> str:
        """Say "passed", "failed", or "not asked" where there was no requirement."""
        return ("passed" if self.passed else "failed") if self.findings else "not asked"

    def to_dict(self) -> dict[str, str | list[str]]:
        """Return the verdict, what was required and what failed as plain values."""
        return {
            "verdict": self.word,
            "required": [str(each.requirement) for each in self.findings],
            "failures": [str(each) for each in self.failures],
        }


def parse_requirements(text: str) -> tuple[Requirement, ...]:
    """Return the requirements of a text: names, or names with a number, between commas; none of a blank one.

    ::

        requirements = requirement {"," requirement}
        requirement  = property | name "=" number

    Properties are watertight (no boundary, manifold, no self-intersection), manifold, oriented,
    closed (no boundary edge) and no-...; counts (components, holes, genus, boundary-edges) must be
    equal; min-... are lower bounds, max-... and share-... upper ones. Angles are in degrees, lengths
    in the mesh's unit, shares between 0 and 1 of all triangles.

    Raises
    ------
    InputError
        If a name is unknown or named twice, a number is missing, too many, or not one that can be.
    """
    words = [word.strip() for word in text.split(",")] if text.strip() else []
    requirements = tuple(_parse_one(word) for word in words)
    names = [each.name for each in requirements]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"require: names {twice} twice; name it once")
    return requirements


def _parse_one(word: str) -> Requirement:
    """Return the requirement of one word, or say what is wrong with it and what there is."""
    name, equals, number = (part.strip() for part in word.partition("="))
    if name not in RULES:
        known = ", ".join(each if rule.order in {"is", "none"} else f"{each}=..." for each, rule in RULES.items())
        raise InputError(f"require: unknown {name!r}; choose from {known}")
    rule = RULES[name]
    if rule.order in {"is", "none"}:
        if equals:
            raise InputError(f"require: {name} takes no number, but has {word!r}; write {name}")
        return Requirement(name)
    largest = LIMITS[rule.kind]
    wanted = _number(number)
    whole = rule.kind != "count" or wanted == np.round(wanted)
    if not (np.isfinite(wanted) and 0 <= wanted <= largest and whole):
        what = {"count": "a whole number", "degrees": "degrees from 0 to 180", "share": "a share from 0 to 1"}
        raise InputError(f"require: is {word!r}; give {name}= {what.get(rule.kind, 'a length')}, 0 or more")
    return Requirement(name, wanted)


def _number(text: str) -> float:
    """Return the number of a text, NaN where there is none."""
    try:
        return float(text)
    except ValueError:
        return np.nan


@checked
def check_report(report: MeshReport, require: str) -> CheckResult:
    """Return whether a mesh is what it must be, requirement by requirement.

    Parameters
    ----------
    report : MeshReport
        What `mesh_report` found.
    require : str
        Names, or names with a number, between commas: "watertight,components=1,min-angle=10"; see
        `parse_requirements` for the grammar. Blank asks for nothing.

    Returns
    -------
    CheckResult
        Its `passed`, and its `failures` with what was wanted and what was found.

    Raises
    ------
    InputError
        If a requirement is unknown, or needs a figure that the report was made without.

    Examples
    --------
    >>> import o3dleaf as o3l, open3d as o3d
    >>> report = o3l.mesh_report(o3d.geometry.TriangleMesh.create_box())
    >>> o3l.check_report(report, "watertight,min-angle=46").failures[0].found
    '45°'
    """
    requirements = parse_requirements(require)
    return CheckResult(tuple(_find(report, each) for each in requirements))


def require_inputs(requirements: tuple[Requirement, ...], given: dict[str, bool]) -> None:
    """Raise `InputError` where a requirement needs a "field" or a "cloud" that is not given."""
    for each in requirements:
        needed = each.rule.needs
        if needed is not None and not given[needed]:
            raise InputError(f"require: {each.name} needs a {needed} to measure to; give one ({needed}=, --{needed})")


def _find(report: MeshReport, requirement: Requirement) -> Finding:
    """Return what one requirement finds in a report."""
    rule, unit = requirement.rule, report.unit
    value = getattr(report, rule.attribute)
    if rule.needs is not None:
        require_inputs((requirement,), {rule.needs: value is not None})
    if rule.order == "is":
        return Finding(requirement, bool(value), "yes", "yes" if value else f"no{_because(report, rule)}")
    words = "none that is defined" if value is None else in_words(rule.attribute, value, unit)
    if rule.order == "none":
        return Finding(requirement, value == 0, "none", words if value else "none")
    limit = requirement.wanted
    wanted = ORDERS[rule.order] + in_words(rule.attribute, limit, unit)
    met = value is not None and limit is not None and _compare(value, rule.order, limit)
    return Finding(requirement, met, wanted, words)


def _compare(value: float, order: str, limit: float) -> bool:
    """Say whether a figure keeps to its limit."""
    if order == "=":
        return value == limit
    return value >= limit if order == "≥" else value <= limit


def _because(report: MeshReport, rule: Rule) -> str:
    """Return the counts that say why a property does not hold, in brackets."""
    counts = {name: getattr(report, name) for name in rule.causes}
    named = [f"{quantity_of(name).label}: {in_words(name, value, None)}" for name, value in counts.items() if value]
    return f" ({', '.join(named)})" if named else ""
