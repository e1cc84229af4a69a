"""A field that is asked for its gradient once at each place: for creases, and again for the normals of a mesh."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import require_one_column
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field, values_and_gradients
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.resume.blocks import kept_block
from o3dleaf.surface.isosurface import remembered_loops as loops

MAX_PLACES = 1 << 20
"""Places that are kept: sixty megabytes. What comes after is asked again."""

MAX_STARTS = 64
"""Latest batches of places that another may repeat."""


class RememberedField:
    """A field of three dimensions that keeps its values with gradients, and is asked anew where they are not known.

    Values alone are asked every time: who follows a surface has them at hand (`Band`). Answers are those of the field,
    to the last bit: places are the same if all bits of their coordinates are. Work that is to be resumed keeps them.

    Parameters
    ----------
    field : Field
        One value at a point.
    """

    def __init__(self, field: Field) -> None:
        require_one_column(field, "RememberedField")
        self.field = field
        self._jets = _Memory()

    def __repr__(self) -> str:
        return f"RememberedField({self.field!r})"

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) lower, then upper corner of the field's domain."""
        return self.field.bounds

    @property
    def unit(self) -> str | None:
        """Unit of length of the points, or None."""
        return self.field.unit

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n,) values at (n, 3) points."""
        places = as_points(points, dim=3)
        return kept_block(lambda: (np.asarray(self.field(places), dtype=np.float64),))[0]

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) gradients at (n, 3) points."""
        return self.jets(points)[1]

    def jets(self, points: npt.ArrayLike, level: int = 1) -> tuple[FloatArray, ...]:
        """Return values (n,) and gradients (n, 3) at (n, 3) points, of `level` 1 alone."""
        if level != 1:
            raise InputError(f"level: is {level}; a memory holds values with gradients, so give 1")
        answers = self._jets.recall(as_points(points, dim=3), self._jet)
        return answers[:, 0], answers[:, 1:]

    def changed(self, field: Field, where: Callable[[FloatArray], BoolArray]) -> "RememberedField":
        """Return another field with this one's memory of the places where both are the same, which is given up here.

        Parameters
        ----------
        field : Field
        where : callable
            ``where(places) -> mask`` of the places (n, 3) at which the fields may differ; elsewhere they say the same,
            to the last bit.
        """
        other = RememberedField(field)
        self._jets.forget(where)
        other._jets = self._jets
        return other

    def _jet(self, points: FloatArray) -> FloatArray:
        return kept_block(lambda: (np.column_stack(values_and_gradients(self.field, points)),))[0]


class _Memory:
    """Places and what was said there: (n, 3) and (n, 4), in the order in which they came.

    What is `stale` is asked again; from then on there is a hash table of the places' rows.
    """

    def __init__(self) -> None:
        self.places, self.answers = np.empty((0, 3), dtype=np.int64), np.empty((0, 4))
        self.stale = np.empty(0, dtype=bool)
        self.count, self.starts, self.table = 0, list[int](), np.empty(0, dtype=np.int32)

    def recall(self, points: FloatArray, ask: Callable[[FloatArray], FloatArray]) -> FloatArray:
        """Return the answers at points (n, 3), those that are not known from `ask`."""
        bits, rows = np.ascontiguousarray(points).view(np.int64), np.empty(len(points), dtype=np.int32)
        starts = np.array(self.starts[-MAX_STARTS:], dtype=np.int64)
        loops.find_rows(bits, self.table, self.places, self.count, starts, rows)
        new = rows < 0
        asked = new | self.stale[rows] if self.count else new
        if not asked.any():
            return self.answers[rows]
        if new.all():
            answers = ask(points)
        else:
            answers = self.answers[rows]
            answers[asked] = ask(points[asked])
            again = rows[asked & ~new]
            self.answers[again], self.stale[again] = answers[asked & ~new], False
        self._add(bits[new], answers[new])
        return answers

    def forget(self, where: Callable[[FloatArray], BoolArray]) -> None:
        """Ask again where a field has changed."""
        self.stale[: self.count] |= where(self.places[: self.count].view(np.float64))
        if not len(self.table):
            self._index()

    def _add(self, places: IntArray, answers: FloatArray) -> None:
        first, last = self.count, min(self.count + len(places), MAX_PLACES)
        places, answers = places[: last - first], answers[: last - first]
        if last > len(self.places):
            for name in ("places", "answers", "stale"):
                old = getattr(self, name)
                new = np.empty((max(min(2 * len(old), MAX_PLACES), last), *old.shape[1:]), dtype=old.dtype)
                new[:first] = old[:first]
                setattr(self, name, new)
        self.places[first:last], self.answers[first:last], self.stale[first:last] = places, answers, False
        self.count = last
        self.starts.append(first)
        if len(self.table):
            self._index(first)

    def _index(self, first: int = 0) -> None:
        """Enter the places from row `first` on into the table."""
        if 2 * self.count > len(self.table):
            self.table, first = _empty_table(self.count), 0
        loops.enter_rows(first, self.count, self.table, self.places)


def rows_among(places: FloatArray, known: FloatArray) -> npt.NDArray[np.int32]:
    """Return which of known places (m, 3) each of others (n, 3) is, to the last bit; −1 for none, and where m > 2²⁰."""
    bits, rows = np.ascontiguousarray(known).view(np.int64), np.full(len(places), -1, dtype=np.int32)
    if len(known) <= MAX_PLACES:
        table = _empty_table(len(known))
        loops.enter_rows(0, len(known), table, bits)
        asked, starts = np.ascontiguousarray(places).view(np.int64), np.empty(0, dtype=np.int64)
        loops.find_rows(asked, table, bits, len(known), starts, rows)
    return rows


def _empty_table(count: int) -> npt.NDArray[np.int32]:
    """Return a hash table for the rows of so many places, at most half of which they use."""
    return np.full(1 << (2 * count).bit_length(), -1, dtype=np.int32)
