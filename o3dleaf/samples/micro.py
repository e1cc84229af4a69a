"""The truth of the micro-structure: a patch of wheat blade with ridges, hairs, stomata and air pockets."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_near
from o3dleaf.samples.domain import evaluate

LEAF = 0.2
"""Intensity of leaf, relative to the scanner's largest; air is 0."""
CREST, BACK = 24.0, 9.0
"""Half the height of the adaxial and of the abaxial ridges, in micrometers."""
ADAXIAL, ABAXIAL = 100.0, -95.0
"""Mean height of the two faces above the middle of the blade, in micrometers."""
PIT_DEPTH, PIT_SPREAD = 28.0, np.array([28.0, 16.0])
"""Depth of a stoma's pit and its standard deviations along (x, y), in micrometers."""
REACH = 7.0
"""So many standard deviations of the blur away, a profile is flat to 1e-12."""


@dataclass(frozen=True, eq=False, repr=False)
class WheatPatch:
    r"""Noise-free intensity of a patch of wheat blade, as a Field: leaf is where F > `level`.

    The blade lies in the (x, y) plane with its ridges along x and its adaxial side up. Each part
    has an opacity :math:`\Phi(g / \sigma)` with g its signed distance to first order (positive in
    the part), :math:`\sigma` the scanner's blur and :math:`\Phi` the normal distribution; parts are
    joined as

    .. math:: F = I_{leaf} \left(1 - \Bigl(1 - B \prod_j (1 - P_j)\Bigr) \prod_i (1 - H_i)\right),

    blade B less air pockets P, with hairs H. The surface F = `level` is where the opacity is one
    half: two sheets and the closed pockets.

    Attributes
    ----------
    bounds : (2, 3) ndarray
        The patch, in micrometers.
    blur : float
        Standard deviation of the scanner's point spread, in micrometers.
    ridges : float
        Number of ridges across y.
    phases : (3,) ndarray
        Phases of the ridges' wander and of their height along x and y, in radians.
    hairs : (n, 8) ndarray
        Foot (x, y, z), tip (x, y, z), radius at the foot and at the tip, in micrometers.
    stomata : (n, 2) ndarray
        Centers (x, y) of the pits in the adaxial face, in micrometers.
    pockets : (n, 6) ndarray
        Center (x, y, z) and half axes of the closed air pockets, in micrometers.
    """

    bounds: FloatArray
    blur: float
    ridges: float
    phases: FloatArray
    hairs: FloatArray
    stomata: FloatArray
    pockets: FloatArray
    unit: str = "um"
    level: float = LEAF / 2

    def __repr__(self) -> str:
        size = " × ".join(f"{extent:.4g}" for extent in self.bounds[1] - self.bounds[0])
        parts = f"{len(self.hairs)} hairs, {len(self.stomata)} stomata, {len(self.pockets)} air pockets"
        return f"WheatPatch({size} {self.unit}, {self.ridges:g} ridges, {parts})"

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n,) intensities at (n, 3) points in micrometers."""
        return evaluate(self.inside, self.bounds, points, LEAF / self.blur)[0]

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) gradients at (n, 3) points, in intensity per micrometer."""
        return evaluate(self.inside, self.bounds, points, LEAF / self.blur)[1]

    def faces(self, points: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the heights (n,) of the adaxial and the abaxial face, without hairs, at (n, 2) points (x, y)."""
        (top, _), (bottom, _) = self._faces(as_near(points, self.bounds[:, :2]))
        return top, bottom

    def inside(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the (n,) intensities and (n, 3) gradients at (n, 3) points in the bounds, unchecked."""
        # Each complement 1 − opacity and its gradient are carried through the product together.
        solid, d_solid = self._blade(p)
        centers, half = self.pockets[:, :3], self.pockets[:, 3:]
        reach = half * (1 + REACH * self.blur / half.mean(axis=1, keepdims=True))
        for j, i in _near(p, centers, reach):
            pocket = self.pockets[j]
            keep, d_keep = _complement(*_ellipsoid(p[i], pocket), self.blur)
            d_solid[i] = d_solid[i] * keep[:, np.newaxis] + solid[i, np.newaxis] * d_keep
            solid[i] *= keep
        air, d_air = 1.0 - solid, -d_solid
        feet, tips, radii = self.hairs[:, :3], self.hairs[:, 3:6], self.hairs[:, 6:7]
        for j, i in _near(p, 0.5 * (feet + tips), 0.5 * abs(tips - feet) + radii + REACH * self.blur):
            hair = self.hairs[j]
            keep, d_keep = _complement(*_round_cone(p[i], hair), self.blur)
            d_air[i] = d_air[i] * keep[:, np.newaxis] + air[i, np.newaxis] * d_keep
            air[i] *= keep
        return LEAF * (1.0 - air), -LEAF * d_air

    def on_lattice(self, x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
        """Return the (nx, ny, nz) intensities of `inside` at the points of a lattice in the bounds, unchecked.

        The faces are found once a column, and without slopes the rest takes a fraction of the time.
        """
        (top, _), (bottom, _) = self._faces(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2))
        columns = (len(x), len(y), 1)
        solid = ndtr((top.reshape(columns) - z) / self.blur)
        solid *= ndtr((z - bottom.reshape(columns)) / self.blur)
        centers, half = self.pockets[:, :3], self.pockets[:, 3:]
        reach = half * (1 + REACH * self.blur / half.mean(axis=1, keepdims=True))
        for j, place, points in _near_on((x, y, z), centers, reach):
            keep = ndtr(-_ellipsoid(points, self.pockets[j])[0] / self.blur)
            solid[place] *= keep.reshape(solid[place].shape)
        air = np.subtract(1.0, solid, out=solid)
        feet, tips, radii = self.hairs[:, :3], self.hairs[:, 3:6], self.hairs[:, 6:7]
        half = 0.5 * abs(tips - feet) + radii + REACH * self.blur
        for j, place, points in _near_on((x, y, z), 0.5 * (feet + tips), half):
            keep = ndtr(-_round_cone(points, self.hairs[j])[0] / self.blur)
            air[place] *= keep.reshape(air[place].shape)
        leaf: FloatArray = LEAF * (1.0 - air)
        return leaf

    def _blade(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Opacity between the two faces."""
        (top, d_top), (bottom, d_bottom) = self._faces(p[:, :2])
        below, d_below = _opacity(top - p[:, 2], np.column_stack([d_top, -np.ones(len(p))]), self.blur)
        above, d_above = _opacity(p[:, 2] - bottom, np.column_stack([-d_bottom, np.ones(len(p))]), self.blur)
        return below * above, d_below * above[:, np.newaxis] + d_above * below[:, np.newaxis]

    def _faces(self, q: FloatArray) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
        """Heights of both faces and their (n, 2) slopes at (n, 2) points (x, y)."""
        u, v = (2 * np.pi * (q - self.bounds[0, :2]) / np.diff(self.bounds[:, :2], axis=0)[0]).T
        du, dv = 2 * np.pi / np.diff(self.bounds[:, :2], axis=0)[0]
        wander, along, across = self.phases
        # Ridges wander a little and differ in height; 1.7 and 2.3 do not repeat, so tiles show a slight seam.
        angle, angle_u = self.ridges * v + 0.12 * np.sin(3 * u + wander), 0.36 * np.cos(3 * u + wander) * du
        swell = 1 + 0.1 * np.sin(1.7 * u + along) + 0.1 * np.cos(2.3 * v + across)
        swell_u, swell_v = 0.17 * np.cos(1.7 * u + along) * du, -0.23 * np.sin(2.3 * v + across) * dv
        shape, d_shape = np.cos(angle) + 0.15 * np.cos(2 * angle), -np.sin(angle) - 0.3 * np.sin(2 * angle)
        top = ADAXIAL + CREST * swell * shape
        d_top = CREST * np.column_stack(
            [
                swell_u * shape + swell * d_shape * angle_u,
                swell_v * shape + swell * d_shape * self.ridges * dv,
            ]
        )
        bottom = ABAXIAL - BACK * np.cos(angle)
        d_bottom = BACK * np.sin(angle)[:, np.newaxis] * np.column_stack([angle_u, np.full(len(q), self.ridges * dv)])
        for j, i in _near(q, self.stomata, np.broadcast_to(REACH * PIT_SPREAD, self.stomata.shape)):
            from_pit = (q[i] - self.stomata[j]) / PIT_SPREAD
            pit = PIT_DEPTH * np.exp(-0.5 * (from_pit**2).sum(axis=1))
            top[i] -= pit
            d_top[i] += pit[:, np.newaxis] * from_pit / PIT_SPREAD
        return (top, d_top), (bottom, d_bottom)


def _near(points: FloatArray, centers: FloatArray, half: FloatArray) -> Iterator[tuple[int, npt.NDArray[np.intp]]]:
    """Yield each box (m, d) that meets the points, with the rows of the points in it."""
    if not len(points):
        return
    low, high = np.array([(column.min(), column.max()) for column in points.T]).T
    for j in np.flatnonzero(((centers - half < high) & (centers + half > low)).all(axis=1)):
        rows = np.flatnonzero(abs(points[:, 0] - centers[j, 0]) < half[j, 0])
        for axis in range(1, points.shape[1]):
            # One axis after the other, as few rows are left after the first.
            rows = rows[abs(points[rows, axis] - centers[j, axis]) < half[j, axis]]
        yield int(j), rows


def _near_on(
    axes: tuple[FloatArray, FloatArray, FloatArray], centers: FloatArray, half: FloatArray
) -> Iterator[tuple[int, tuple[slice, ...], FloatArray]]:
    """Yield each box (m, 3) that meets a lattice, with the slices and the (n, 3) points of the lattice in it."""
    for j in range(len(centers)):
        place = []
        for axis, ticks in enumerate(axes):
            rows = np.flatnonzero(abs(ticks - centers[j, axis]) < half[j, axis])
            place.append(slice(rows[0], rows[-1] + 1) if len(rows) else slice(0, 0))
        ticks_in = [ticks[where] for ticks, where in zip(axes, place, strict=True)]
        if all(len(ticks) for ticks in ticks_in):
            yield j, tuple(place), np.stack(np.meshgrid(*ticks_in, indexing="ij"), axis=-1).reshape(-1, 3)


def _opacity(g: FloatArray, d_g: FloatArray, blur: float) -> tuple[FloatArray, FloatArray]:
    """Φ(g / blur) and its gradient."""
    z = g / blur
    slope = np.exp(-0.5 * z**2) / (np.sqrt(2 * np.pi) * blur)
    return ndtr(z), slope[:, np.newaxis] * d_g


def _complement(g: FloatArray, d_g: FloatArray, blur: float) -> tuple[FloatArray, FloatArray]:
    """1 − Φ(g / blur) and its gradient."""
    return _opacity(-g, -d_g, blur)


def _ellipsoid(p: FloatArray, pocket: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance s (1 − |x/a|²) / 2 with s the mean half axis: slope one at the surface, no kink in the middle."""
    scaled = (p - pocket[:3]) / pocket[3:]
    size = pocket[3:].mean()
    return 0.5 * size * (1 - (scaled**2).sum(axis=1)), -size * scaled / pocket[3:]


def _round_cone(p: FloatArray, hair: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance into a cone with round ends: the largest over its spheres, whose nearest gives the gradient."""
    foot, radius, tip_radius = hair[:3], hair[6], hair[7]
    length = np.linalg.norm(hair[3:6] - foot)
    axis = (hair[3:6] - foot) / length
    taper = (radius - tip_radius) / length
    along = ((p - foot) * axis).sum(axis=1)
    aside = np.sqrt(np.maximum(((p - foot) ** 2).sum(axis=1) - along**2, 0.0))
    station = np.clip(along - aside * taper / np.sqrt(1 - taper**2), 0.0, length)
    away = p - foot - station[:, np.newaxis] * axis
    distance = np.linalg.norm(away, axis=1)
    outward = away / np.where(distance > 0, distance, 1.0)[:, np.newaxis]
    return radius - taper * station - distance, -outward
