"""The compiled blend of composed splines: several to a ball, whose function is their minimum or maximum."""

from typing import Any, NamedTuple

from numba.extending import overload

from o3dleaf.fitting.local.blend_loops import ball_jets


class ComposedBalls(NamedTuple):
    """What the blend reads of several splines a ball; see `LocalCreasedSplines`.

    Attributes
    ----------
    splines : SplineBalls
        One for each sheet.
    first, composition
        As of `LocalCreasedSplines`.
    sites, exponents, widest
        Those of the splines.
    """

    splines: Any
    first: Any
    composition: Any
    sites: Any
    exponents: Any
    widest: Any


@overload(ball_jets, jit_options={"nogil": True})
def ball_jets_of_sheets(model, ball, z, count, space, level, local):  # noqa: ARG001 - types, of which one chooses
    """Return the function for composed splines."""
    return composed_jets if model.instance_class is ComposedBalls else None


def composed_jets(model, ball, z, count, space, level, local):
    """`ball_jets` of sheets: where another is below (minimum) or above (maximum) the ones before, its jet is taken."""
    sheet = space.spare
    ball_jets(model.splines, model.first[ball], z, count, space, level, local)
    for k in range(model.first[ball] + 1, model.first[ball + 1]):
        ball_jets(model.splines, k, z, count, space, level, sheet)
        for i in range(count):
            if model.composition[k] * (sheet[0, i] - local[0, i]) > 0.0:
                for row in range(len(local)):
                    local[row, i] = sheet[row, i]
