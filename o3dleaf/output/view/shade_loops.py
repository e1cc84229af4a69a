"""The compiled loops of shading: normals, rays to the sky, and the pixels that samples add up to."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def sum_normals(vertices, triangles, normals):
    """Add the normals of triangles, weighted by twice their area, to the (n, 3) `normals` of their vertices."""
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            ui, uj = float(vertices[b, i]) - vertices[a, i], float(vertices[b, j]) - vertices[a, j]
            vi, vj = float(vertices[c, i]) - vertices[a, i], float(vertices[c, j]) - vertices[a, j]
            normal = ui * vj - uj * vi
            normals[a, axis] += normal
            normals[b, axis] += normal
            normals[c, axis] += normal


@njit(nogil=True, cache=True)
def stand_on(rays, distance, uv, flat, triangle, triangles, normals, lift, place, normal, facing, weights):
    """Fill what rays meet where they hit a mesh, on the side that they come from.

    Parameters
    ----------
    rays : (k, 6) ndarray
    distance : (k,) ndarray
    uv : (k, 2) ndarray
        Barycentric coordinates of the second and third corner.
    flat : (k, 3) ndarray
        Unit normals of the triangles that were hit.
    triangle : (k,) ndarray of int64
    triangles : (m, 3) ndarray of int64
    normals : (n, 3) ndarray
        Of the vertices; without rows, triangles are flat.
    lift : float
        How far above the surface `place` lies.
    place, normal : (k, 3) ndarrays
        The normal is interpolated between the vertices, or that of the triangle where those cancel.
    facing : (k,) ndarray
        -1 where a triangle is seen from behind, else 1.
    weights : (k, 3) ndarray
    """
    for s in range(len(rays)):
        along = flat[s, 0] * rays[s, 3] + flat[s, 1] * rays[s, 4] + flat[s, 2] * rays[s, 5]
        facing[s] = -1.0 if along > 0 else 1.0
        weights[s, 1], weights[s, 2] = uv[s, 0], uv[s, 1]
        weights[s, 0] = 1 - weights[s, 1] - weights[s, 2]
        square = 0.0
        for axis in range(3):
            place[s, axis] = rays[s, axis] + distance[s] * rays[s, 3 + axis] + lift * facing[s] * flat[s, axis]
            normal[s, axis] = 0.0
            if len(normals):
                for corner in range(3):
                    normal[s, axis] += weights[s, corner] * normals[triangles[triangle[s], corner], axis]
            square += normal[s, axis] ** 2
        for axis in range(3):
            bent = normal[s, axis] / math.sqrt(square) if square > 0 else flat[s, axis]
            normal[s, axis] = facing[s] * bent


@njit(nogil=True, cache=True)
def reflect(color, normal, rays, sun, up, lit, light):
    """Fill the light of surfaces that rays from the eye meet.

    Scattered in the surface's color: what comes from the light and the rim, and from an open sky; and the gloss,
    added in white.

    Parameters
    ----------
    color, normal : (k, 3) ndarrays
        Linear RGB, and unit normals on the eye's side.
    rays : (k, 6) ndarray of float32
        Origins and unit directions.
    sun, up : (3,) ndarrays
        Unit vectors to the light and to the middle of the sky.
    lit : (k,) ndarray of bool
        Whether the light reaches them.
    light : (k, 6) ndarray
        Linear RGB that does not depend on the sky, and that of an open sky.
    """
    for s in range(len(rays)):
        ahead, above, sight, square, half = 0.0, 0.0, 0.0, 0.0, 0.0
        for axis in range(3):
            way, across = float(rays[s, 3 + axis]), normal[s, axis]
            ahead += across * sun[axis]
            above += across * up[axis]
            sight -= across * way
            square += (sun[axis] - way) ** 2
            half += across * (sun[axis] - way)
        direct = max(ahead, 0.0) if lit[s] else 0.0
        gloss = max(half / math.sqrt(square), 0.0) ** 20 if lit[s] and square > 0 else 0.0
        rim = (1 - min(max(sight, 0.0), 1.0)) ** 3
        for c in range(3):
            light[s, c] = color[s, c] * (1.15 * direct + 0.10 * rim) + 0.05 * gloss + 0.01 * rim
            light[s, 3 + c] = color[s, c] * 0.40 * (0.75 + 0.25 * above)


@njit(nogil=True, cache=True)
def aim_at_sky(places, normals, axes, first, row, column, steps, rays):
    """Fill rays from surface points into the sky above them, density cos θ / π.

    Sample s of a pixel takes up the points first[s] + k of the additive sequence in the unit square whose steps are
    the powers of the inverse plastic number [1], and each pixel of a 3 × 3 block shifts them by one of the
    nine points of a net in a third of the square: the rays of a sample, of a pixel and of every 3 × 3 window of
    pixels each are even over the sky. A disc's equal-area map lifted to the hemisphere makes them directions.

    Parameters
    ----------
    places, normals : (n, 3) ndarrays
        Unit normals, on the viewer's side.
    axes : (3, 3) ndarray
        Rows right, up and toward the viewer. The frame of a normal is that of the viewer's direction, turned
        the shortest way: continuous over everything that is seen.
    first : (n,) ndarray of int64
    row, column : (n,) ndarrays of int64
        Of the pixel.
    steps : (2,) ndarray
    rays : (n, count, 6) ndarray of float32
        Origin and direction.

    References
    ----------
    [1] M. Roberts, The unreasonable effectiveness of quasirandom sequences, 2018.
    """
    local, ahead, aside, way = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    count = rays.shape[1]
    known = sky_points(np.max(first) + count if len(first) else 0, steps)
    for s in range(len(places)):
        block = 3 * (row[s] % 3) + column[s] % 3
        for axis in range(3):
            local[axis] = axes[axis, 0] * normals[s, 0] + axes[axis, 1] * normals[s, 1] + axes[axis, 2] * normals[s, 2]
        x, y = local[0], local[1]
        # Straight away from the viewer there is no shortest way, and nothing to see.
        bend = 1 / max(1 + local[2], 1e-6)
        ahead[0], ahead[1], ahead[2] = 1 - x * x * bend, -x * y * bend, -x
        aside[0], aside[1], aside[2] = -x * y * bend, 1 - y * y * bend, -y
        for k in range(count):
            cosine, sine, up = known[block, first[s] + k]
            for axis in range(3):
                way[axis] = cosine * ahead[axis] + sine * aside[axis] + up * local[axis]
            for axis in range(3):
                rays[s, k, axis] = places[s, axis]
                rays[s, k, 3 + axis] = way[0] * axes[0, axis] + way[1] * axes[1, axis] + way[2] * axes[2, axis]


@njit(nogil=True, cache=True)
def sky_points(numbers, steps):
    """Return the (9, numbers, 3) points of the upper hemisphere, along two axes and up, of the pixels of a block."""
    points = np.empty((9, numbers, 3))
    for i in range(3):
        for j in range(3):
            for number in range(numbers):
                u = (0.5 + number * steps[0] + i / 9 + j / 27) % 1
                angle = 2 * math.pi * ((0.5 + number * steps[1] + j / 9 + i / 27) % 1)
                radius, point = math.sqrt(u), points[3 * i + j, number]
                point[0], point[1], point[2] = radius * math.cos(angle), radius * math.sin(angle), math.sqrt(1 - u)
    return points


@njit(nogil=True, cache=True)
def add_samples(row, light, seen, fixed, sky, dimmed, hits, seen_sum):
    """Add samples to their pixels.

    Parameters
    ----------
    row : (k,) ndarray of int64
        The pixel of each sample.
    light : (k, 6) ndarray
        Linear RGB that does not depend on the sky, and that of an open sky.
    seen : (k,) ndarray
        The part of the sky that is open.
    fixed, sky, dimmed : (n, 3) ndarrays
        Sums of the light of a pixel: without the sky, of the open sky, and of the sky that is seen.
    hits, seen_sum : (n,) ndarrays
    """
    for s in range(len(row)):
        p = row[s]
        hits[p] += 1
        seen_sum[p] += seen[s]
        for c in range(3):
            fixed[p, c] += light[s, c]
            sky[p, c] += light[s, 3 + c]
            dimmed[p, c] += light[s, 3 + c] * seen[s]


@njit(nogil=True, cache=True)
def span_samples(row, light, place, normal, low, high, place_sum, normal_sum):
    """Widen the (n, 3) range `low` to `high` of their pixels by samples, and add up where these lie.

    The range is of the square root of light, nearly what a screen shows, under an open sky; see `add_samples`.
    """
    for s in range(len(row)):
        p = row[s]
        for c in range(3):
            shown = math.sqrt(light[s, c] + light[s, 3 + c])
            low[p, c], high[p, c] = min(low[p, c], shown), max(high[p, c], shown)
            place_sum[p, c] += place[s, c]
            normal_sum[p, c] += normal[s, c]


@njit(nogil=True, cache=True)
def find_calm(pixels, number, hits, samples, low, high, place, normal, contrast, depth, calm):
    """Mark the pixels around which nothing changes: in the 3 × 3 window every sample hits one smooth piece of surface.

    Parameters
    ----------
    pixels : (n,) ndarray of int64
        Row times width plus column.
    number : (height, width) ndarray of int32
        The pixel's place in `pixels`, -1 where nothing is.
    hits : (n,) ndarray
        The samples that hit; all of `samples` must.
    low, high : (n, 3) ndarrays
        They must differ by less than `contrast` over the window.
    place, normal : (n, 3) ndarrays
        Sums over the hits; the middles must lie within `depth` of the middle pixel's tangent plane.
    calm : (n,) ndarray of bool
    """
    height, width = number.shape
    for p in range(len(pixels)):
        row, column = pixels[p] // width, pixels[p] % width
        is_calm = 0 < row < height - 1 and 0 < column < width - 1 and hits[p] == samples
        for i in range(-1, 2):
            for j in range(-1, 2):
                q = number[row + i, column + j] if is_calm else -1
                is_calm = q >= 0 and hits[q] == samples and _is_near(p, q, samples, place, normal, depth)
        for c in range(3):
            if not is_calm:
                break
            least, most = np.inf, -np.inf
            for i in range(-1, 2):
                for j in range(-1, 2):
                    q = number[row + i, column + j]
                    least, most = min(least, low[q, c]), max(most, high[q, c])
            is_calm = most - least < contrast
        calm[p] = is_calm


@njit(nogil=True, cache=True)
def share_sky(pixels, number, samples, hits, taken, place, normal, depth, seen, sky, dimmed):
    """Give pixels that one surface fills the sky that it sees in their 3 × 3 window on average.

    Parameters
    ----------
    pixels, number, samples, place, normal, depth
        As in `find_calm`.
    hits, taken : (n,) ndarrays
        Samples that hit, and all of them; in a pixel that is filled all hit.
    seen : (n,) ndarray
        Sums over the hits of the part of the sky that is open.
    sky, dimmed : (n, 3) ndarrays
        Sums of the light of the open sky; `dimmed` is set to the part of it.
    """
    height, width = number.shape
    for p in range(len(pixels)):
        if hits[p] != taken[p]:
            continue
        row, column = pixels[p] // width, pixels[p] % width
        part, count = 0.0, 0
        for i in range(max(0, row - 1), min(height, row + 2)):
            for j in range(max(0, column - 1), min(width, column + 2)):
                q = number[i, j]
                if q >= 0 and hits[q] == taken[q] and _is_near(p, q, samples, place, normal, depth):
                    part += seen[q] / hits[q]
                    count += 1
        for c in range(3):
            dimmed[p, c] = sky[p, c] * part / count


@njit(nogil=True, cache=True)
def _is_near(p, q, samples, place, normal, depth):
    """Return whether the middle of pixel q lies within `depth` of the tangent plane of pixel p."""
    off, square = 0.0, 0.0
    for c in range(3):
        off += (place[q, c] - place[p, c]) / samples * normal[p, c]
        square += normal[p, c] ** 2
    return p == q or abs(off) <= depth * math.sqrt(square)
