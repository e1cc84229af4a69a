"""What a saved model is, told in plain values."""

from typing import Any

from o3dleaf.fitting.local.columns.column_splines import LocalColumns
from o3dleaf.fitting.local.polynomials import LocalPolynomials
from o3dleaf.fitting.local.potentials import LocalPotentials
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.interpolant import RBFInterpolant
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.surface.creases.creased_splines import LocalCreasedSplines

KINDS = {MultiscaleLeaf: "a leaf", Blade: "a blade", PUInterpolant: "a field", RBFInterpolant: "a field"}
"""What models are of; any other is of a micro-structure."""
LOCAL = {
    LocalSplines: "splines of values",
    LocalCreasedSplines: "splines of values, apart at sharp creases",
    LocalColumns: "splines of voxels",
    LocalPotentials: "splines of points and normals",
    LocalPolynomials: "moving least squares",
}
"""What is fitted in the balls of a field."""


def describe_model(model: Any) -> dict[str, Any]:
    """Return what a model is of, its class, bounds and unit; of a field, also what it is made of, lengths in its unit.

    `points` counts what was fitted to, constraints off the surface included; radius and points of a ball are medians.
    """
    bounds, fit = getattr(model, "bounds", None), {}
    if isinstance(model, PUInterpolant):
        fit = _fit_of(model)
    elif isinstance(model, RBFInterpolant):
        fit = {"points": model.points.shape[1], "kernel": str(model.kernel), "smoothing": model.smoothing.value}
    what = next((name for kind, name in KINDS.items() if isinstance(model, kind)), "a micro-structure")
    return {
        "kind": f"model of {what}",
        "class": type(model).__name__,
        **fit,
        "bounds": None if bounds is None else bounds.tolist(),
        "unit": model.unit,
    }


def _fit_of(field: PUInterpolant) -> dict[str, Any]:
    """Return what a field is made of."""
    local, members = field.local, field.cover.members
    splines = getattr(local, "splines", local)
    radius, count = field.cover.typical
    smoothing = getattr(splines, "smoothing", None)
    return {
        "points": int(members.max()) + 1 if len(members) else None,
        "balls": len(field.cover.radii),
        "ball_radius": radius,
        "points_per_ball": count,
        "local": next((name for kind, name in LOCAL.items() if isinstance(local, kind)), type(local).__name__),
        "kernel": str(splines.kernel) if hasattr(splines, "kernel") else None,
        "smoothing": getattr(smoothing, "value", smoothing),
    }
