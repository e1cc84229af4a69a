"""Contact of two triangles in more than a common corner or edge: exact, by signs of determinants alone.

Corners are common where they are in the same place. A triangle comes with its view: 2 · axis, plus 1 if it runs
counter-clockwise seen along that axis, along which it is not a line; −1 for one whose corners are in a line. Most
neighbours of a smooth surface are separated in that view.
"""

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.mesh.predicate_loops import line_side, plane_side, sure_turn


@njit(nogil=True, cache=True)
def find_view(v, a):
    """Return the view of a triangle of three rows of (n, 3) `v`."""
    ux, uy, uz = v[a[1], 0] - v[a[0], 0], v[a[1], 1] - v[a[0], 1], v[a[1], 2] - v[a[0], 2]
    wx, wy, wz = v[a[2], 0] - v[a[0], 0], v[a[2], 1] - v[a[0], 1], v[a[2], 2] - v[a[0], 2]
    x, y, z = abs(uy * wz - uz * wy), abs(uz * wx - ux * wz), abs(ux * wy - uy * wx)
    best = 0 if x >= y and x >= z else 1 if y >= z else 2
    for turn in range(3):
        axis = (best + turn) % 3
        side = line_side(v, axis, a[0], a[1], a[2])
        if side != 0:
            return 2 * axis + (side > 0)
    return -1


@njit(nogil=True, cache=True)
def is_same(v, i, j):
    """Say whether two vertices are in the same place."""
    return (i == j) | ((v[i, 0] == v[j, 0]) & (v[i, 1] == v[j, 1]) & (v[i, 2] == v[j, 2]))


@njit(nogil=True, cache=True)
def meet(v, a, view_a, b, view_b):
    """Say whether triangles `a` and `b`, neither of them a line, share a point beyond their common corner or edge."""
    common, corner_a, corner_b = 0, 0, 0
    for i in range(3):
        for j in range(3):
            # Added, not branched on: no processor foresees which corners they are.
            same = int(is_same(v, a[i], b[j]))
            common, corner_a, corner_b = common + same, corner_a + i * same, corner_b + j * same
    if common == 0:
        return _strangers_meet(v, a, view_a, b, view_b)
    if common == 1:
        p, one, other = a[corner_a], a[(corner_a + 1) % 3], a[(corner_a + 2) % 3]
        return _fan_meets(v, p, (one, other), view_a, (b[(corner_b + 1) % 3], b[(corner_b + 2) % 3]), view_b, a, b)
    if common == 2:
        # Of corners 0, 1 and 2 the one that is not common makes up for the sum to 3.
        third = 3 - corner_a
        return _fold_meets(v, a[(third + 1) % 3], a[(third + 2) % 3], a[third], b[3 - corner_b], view_a)
    return True


@njit(nogil=True, cache=True)
def _fold_meets(v, p, q, c, d, view):
    """Say whether triangles p q c and p q d lie on each other: in one plane, on one side of their edge."""
    axis = view >> 1
    if line_side(v, axis, p, q, c) * line_side(v, axis, p, q, d) <= 0:
        return False
    return plane_side(v, p, q, c, d) == 0


@njit(nogil=True, cache=True)
def _fan_meets(v, p, a, view_a, b, view_b, whole_a, whole_b):
    """Say whether triangles with the one corner p in common and edges `a` and `b` across from it meet elsewhere.

    What they share is convex and holds p: if it is more, it reaches the edge across from p in one of them.
    """
    if _fans_are_apart(v, view_a >> 1, p, a, b):
        return False
    low, high = plane_side(v, p, a[0], a[1], b[0]), plane_side(v, p, a[0], a[1], b[1])
    if low * high > 0:
        return False
    if _segment_meets(v, b[0], b[1], low, high, whole_a, view_a):
        return True
    low, high = plane_side(v, p, b[0], b[1], a[0]), plane_side(v, p, b[0], b[1], a[1])
    return _segment_meets(v, a[0], a[1], low, high, whole_b, view_b)


@njit(nogil=True, cache=True)
def _fans_are_apart(v, axis, p, a, b):
    """Say whether, seen along an axis, one of the four edges at p has the two triangles on different sides."""
    turn_a, turn_b, side, other_side, last, other_last = _turns_around(v, axis, p, a, b)
    if turn_b == 0:
        return False
    # The corner of one is on a side of the edge to another's, which is on the other side of the edge to the first.
    return (
        _are_beyond(v, axis, p, a[0], b, side * turn_a, other_side * turn_a)
        or _are_beyond(v, axis, p, a[1], b, -last * turn_a, -other_last * turn_a)
        or _are_beyond(v, axis, p, b[0], a, -side * turn_b, -last * turn_b)
        or _are_beyond(v, axis, p, b[1], a, other_side * turn_b, other_last * turn_b)
    )


@njit(nogil=True, cache=True)
def _turns_around(v, axis, p, a, b):
    """Return how one turns around p from a_0 to a_1, b_0 to b_1, and from a_0 and a_1 each to b_0 and b_1.

    All six at once in float64, without a branch: nearly always they are sure, and who asks once for each is slower.
    """
    x, y = (axis + 1) % 3, (axis + 2) % 3
    ax, ay, cx, cy = v[a[0], x] - v[p, x], v[a[0], y] - v[p, y], v[a[1], x] - v[p, x], v[a[1], y] - v[p, y]
    bx, by, dx, dy = v[b[0], x] - v[p, x], v[b[0], y] - v[p, y], v[b[1], x] - v[p, x], v[b[1], y] - v[p, y]
    ac, bd, ab, ad, cb, cd = (
        sure_turn(ax, ay, cx, cy), sure_turn(bx, by, dx, dy), sure_turn(ax, ay, bx, by),
        sure_turn(ax, ay, dx, dy), sure_turn(cx, cy, bx, by), sure_turn(cx, cy, dx, dy),
    )  # fmt: skip
    if ac * bd * ab * ad * cb * cd != 0:
        return ac, bd, ab, ad, cb, cd
    return (
        line_side(v, axis, a[0], a[1], p), line_side(v, axis, b[0], b[1], p), line_side(v, axis, a[0], b[0], p),
        line_side(v, axis, a[0], b[1], p), line_side(v, axis, a[1], b[0], p), line_side(v, axis, a[1], b[1], p),
    )  # fmt: skip


@njit(nogil=True, cache=True)
def _are_beyond(v, axis, p, edge, points, side, other_side):
    """Say whether two points on these sides of an edge at p are both across it; see `_is_beyond`."""
    return _is_beyond(v, axis, p, edge, points[0], side) and _is_beyond(v, axis, p, edge, points[1], other_side)


@njit(nogil=True, cache=True)
def _is_beyond(v, axis, p, edge, point, side):
    """Say whether a point is across an edge at p, or in its line but on the other side of p."""
    if side != 0:
        return side < 0
    x = (axis + 1) % 3
    if v[edge, x] == v[p, x]:
        x = (axis + 2) % 3
    return (v[edge, x] > v[p, x]) != (v[point, x] > v[p, x])


@njit(nogil=True, cache=True)
def _strangers_meet(v, a, view_a, b, view_b):
    """Say whether two triangles without a common corner share a point: an edge of one then meets the other."""
    if _edge_parts(v, a, view_a, b):
        return False
    sides = _corner_sides(v, a, b)
    if abs(sides[0] + sides[1] + sides[2]) == 3 or _edge_parts(v, b, view_b, a):
        return False
    for i in range(3):
        j = (i + 1) % 3
        if _segment_meets(v, b[i], b[j], sides[i], sides[j], a, view_a):
            return True
    sides = _corner_sides(v, b, a)
    for i in range(3):
        j = (i + 1) % 3
        if _segment_meets(v, a[i], a[j], sides[i], sides[j], b, view_b):
            return True
    return False


@njit(nogil=True, cache=True)
def _corner_sides(v, a, b):
    """Return on which sides of triangle `a`'s plane the corners of `b` are."""
    first, second = plane_side(v, a[0], a[1], a[2], b[0]), plane_side(v, a[0], a[1], a[2], b[1])
    return first, second, plane_side(v, a[0], a[1], a[2], b[2])


@njit(nogil=True, cache=True)
def _edge_parts(v, a, view, b):
    """Say whether, in the view of triangle `a`, one of its edges has all of triangle `b` beyond it."""
    inner = 1 if view & 1 else -1
    for i in range(3):
        j = (i + 1) % 3
        if (
            line_side(v, view >> 1, a[i], a[j], b[0]) * inner < 0
            and line_side(v, view >> 1, a[i], a[j], b[1]) * inner < 0
            and line_side(v, view >> 1, a[i], a[j], b[2]) * inner < 0
        ):
            return True
    return False


@njit(nogil=True, cache=True)
def _segment_meets(v, p, q, side_p, side_q, a, view):
    """Say whether segment pq, with its ends on these sides of triangle `a`'s plane, shares a point with it."""
    if side_p * side_q > 0:
        return False
    if side_p == 0 and side_q == 0:
        return _segment_meets_in_plane(v, p, q, a, view)
    first, second = plane_side(v, p, q, a[0], a[1]), plane_side(v, p, q, a[1], a[2])
    if first * second < 0:
        return False
    third = plane_side(v, p, q, a[2], a[0])
    return first * third >= 0 and second * third >= 0


@njit(nogil=True, cache=True)
def _segment_meets_in_plane(v, p, q, a, view):
    """Say whether a segment in the plane of triangle `a` shares a point with it: starts in it, or meets an edge.

    One that runs along an edge and starts outside meets the next edge in their corner.
    """
    axis, inner = view >> 1, 1 if view & 1 else -1
    inside = True
    for i in range(3):
        inside &= line_side(v, axis, a[i], a[(i + 1) % 3], p) * inner >= 0
    if inside:
        return True
    for i in range(3):
        if _segments_meet(v, axis, p, q, a[i], a[(i + 1) % 3]):
            return True
    return False


@njit(nogil=True, cache=True)
def _segments_meet(v, axis, p, q, r, s):
    """Say whether two segments of one plane, not in one line, share a point."""
    if line_side(v, axis, p, q, r) == line_side(v, axis, p, q, s):
        return False
    return line_side(v, axis, r, s, p) != line_side(v, axis, r, s, q)
