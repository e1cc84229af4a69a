"""Contact of two triangles in more than a common corner or edge: exact, by signs of determinants alone.

Corners are common where they are in the same place. A triangle comes with its view: 2 · axis, plus 1 if it runs
counter-clockwise seen along that axis, along which it is not a line; −1 for one whose corners are in a line. Most
neighbours of a smooth surface are separated in that view.
"""

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.mesh.predicate_loops import line_side, plane_side


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
    return i == j or (v[i, 0] == v[j, 0] and v[i, 1] == v[j, 1] and v[i, 2] == v[j, 2])


@njit(nogil=True, cache=True)
def meet(v, a, view_a, b, view_b):
    """Say whether triangles `a` and `b`, neither of them a line, share a point beyond their common corner or edge."""
    common, corner_a, corner_b = 0, 0, 0
    for i in range(3):
        for j in range(3):
            if is_same(v, a[i], b[j]):
                common += 1
                corner_a += i
                corner_b += j
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
    side_a, side_b = line_side(v, axis, p, a[0], a[1]), line_side(v, axis, p, b[0], b[1])
    if side_b == 0:
        return False
    for i in range(2):
        first, second = line_side(v, axis, p, a[i], b[0]), line_side(v, axis, p, a[i], b[1])
        inner = side_a if i == 0 else -side_a
        if _is_beyond(v, axis, p, a[i], b[0], first * inner) and _is_beyond(v, axis, p, a[i], b[1], second * inner):
            return True
    for j in range(2):
        first, second = line_side(v, axis, p, b[j], a[0]), line_side(v, axis, p, b[j], a[1])
        inner = side_b if j == 0 else -side_b
        if _is_beyond(v, axis, p, b[j], a[0], first * inner) and _is_beyond(v, axis, p, b[j], a[1], second * inner):
            return True
    return False


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
