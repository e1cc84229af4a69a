"""A surface that is followed again where its field has changed is that of the new field, to the last bit."""

import numpy as np
import pytest

from o3dleaf.samples import Sphere
from o3dleaf.surface.isosurface.continuation import Continuation


class Spheres:
    """A ball's field, and a ball beside it that can be joined to it, dented or taken away; counts what it is asked."""

    bounds, unit = np.array([[-4.0] * 3, [4.0] * 3]), None

    def __init__(self, bridge=-1.0, second=0.5):
        self.bridge, self.second, self.asked = bridge, second, 0

    def __call__(self, points):
        self.asked += len(points)
        one, other = (size - np.linalg.norm(points - [x, 0, 0], axis=1) for x, size in ((0, 1.0), (2, self.second)))
        bar = self.bridge - np.maximum(np.linalg.norm(points[:, 1:], axis=1), np.abs(points[:, 0] - 1.2) - 0.7)
        return np.maximum(np.maximum(one, other), bar)

    def gradient(self, points):
        step = 1e-6 * np.eye(3)
        return np.column_stack([(self(points + along) - self(points - along)) / 2e-6 for along in step])


def beside(places):
    """Return where the fields of this test may differ: all but the left of the first ball."""
    return places[:, 0] > 0.3


@pytest.mark.parametrize("within", [None, lambda places: places[:, 2] < 0.4, 2.2])
@pytest.mark.parametrize(
    ("before", "after"), [((-1.0, 0.5), (0.2, 0.5)), ((0.2, 0.5), (-1.0, 0.5)), ((0.2, 0.5), (0.2, 0.4))]
)
def test_what_a_change_joins_is_followed_and_what_it_cuts_off_is_not(before, after, within):
    """The second ball, which no seed lies on, is there as long as a bar leads to it."""
    seeds = Sphere().sample(50, seed=1)[0]
    seeds = seeds[seeds[:, 0] < 0]
    step, new = np.full(3, 0.1), Spheres(*after)
    continued = Continuation.of(Spheres(*before), step, seeds, 0.0, within=within, box=new.bounds)
    continued.change(new, beside)
    whole = Spheres(*after)
    expected = Continuation.of(whole, step, seeds, 0.0, within=within, box=new.bounds)
    assert new.asked < whole.asked
    for sharpen in (False, True):
        for array, other in zip(
            continued.draw(sharpen=sharpen, features=False), expected.draw(sharpen=sharpen, features=False), strict=True
        ):
            assert np.array_equal(array, other)
    assert (continued.draw(sharpen=True, features=False)[0][:, 0].max() > 1.5) == (after[0] > 0)
