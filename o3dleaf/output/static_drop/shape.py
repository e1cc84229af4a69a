"""The shape of a drop at rest, as Surface Evolver leaves it: curved triangles with six vertices each."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.output.static_drop.datafile import StaticDrop

PARTS = 8
"""Parts of an edge that extents are looked for at: with curved edges their squares do not count any more."""
RESTING = 1e-6
"""Change of energy by the last of Newton's steps, of the energy, at which a drop is at rest."""


@dataclass(frozen=True, eq=False)
class DropShape:
    """A drop at rest: lengths in meters, z above the mean height of the surface around.

    Attributes
    ----------
    drop : StaticDrop
    vertices : (n, 3) ndarray
    faces : (m, 6) ndarray of int
        Corners, then the middles of the edges from each corner to the next one.
    line : (k, 3) ndarray of int
        Edges of the line of contact, counter-clockwise seen from above: start, middle, end.
    wetted_area : float
        Of the surface as it is, in m².
    pressure : float
        Over that of the air at z = 0, in Pa.
    held : (float, float)
        Force along and across that holds the drop over its place, of its weight; without weight, of tension · radius.
    """

    drop: StaticDrop
    vertices: FloatArray
    faces: IntArray
    line: IntArray
    wetted_area: float
    pressure: float
    held: tuple[float, float]

    @classmethod
    def read(cls, drop: StaticDrop, output: str) -> "DropShape":
        """Return what `say` of the data file has printed.

        Raises
        ------
        O3DLeafError
            If the drop has not come to rest.
        """
        rows = [line.removeprefix("Enter command: ").split() for line in output.splitlines()]
        named: dict[str, list[list[str]]] = {}
        for row in rows:
            if row and row[0] in {"vertex", "face", "line", "total"}:
                named.setdefault(row[0], []).append(row[1:])
        if not named.get("total") or not _at_rest(rows):
            raise O3DLeafError(
                "evolver: the drop has not come to rest; choose a smaller angle, a smaller drop, or a smoother surface"
            )
        numbers = dict(zip(named["total"][0][1::2], named["total"][0][2::2], strict=False))
        radius, tension = drop.radius, drop.tension
        listed = np.array(named["vertex"], dtype=np.float64)
        place = np.zeros(int(listed[:, 0].max()) + 1, dtype=np.int64)
        place[listed[:, 0].astype(np.int64)] = np.arange(len(listed))
        x, y = (float(each) for each in named["total"][0][-2:])
        weight = drop.bond_number * 4 * np.pi / 3 or 1.0
        volume = 4 * np.pi / 3
        return cls(
            drop,
            listed[:, 1:] * radius,
            place[np.array(named["face"], dtype=np.int64)],
            place[np.array(named["line"], dtype=np.int64)],
            float(numbers["wetted"]) * radius**2,
            float(numbers["pressure"]) * tension / radius,
            (x * volume / weight, y * volume / weight),
        )

    @property
    def height(self) -> float:
        """Of the top above the mean height of the surface, in meters."""
        return float(self._surface_points()[:, 2].max())

    @property
    def widths(self) -> tuple[float, float]:
        """Extents of the whole drop along and across, in meters."""
        x, y = np.ptp(self._surface_points()[:, :2], axis=0).tolist()
        return x, y

    @property
    def base_widths(self) -> tuple[float, float]:
        """Extents of the line of contact along and across, in meters."""
        t = np.linspace(0, 1, PARTS + 1)[:, np.newaxis]
        weights = np.hstack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
        x, y = np.ptp(np.einsum("tk,lkd->ltd", weights, self.vertices[self.line][..., :2]), axis=(0, 1)).tolist()
        return x, y

    @property
    def clearance(self) -> float:
        """Least height of the drop's surface above the surface that it is on, in meters; negative if it enters it."""
        points, ground = self._surface_points(), self.drop.ground
        under = ground(points[:, 0], points[:, 1]) - ground.coefficients[0, 0]
        return float((points[:, 2] - under).min())

    @property
    def contact_angles(self) -> FloatArray:
        """(k,) angles in degrees between drop and surface, in the middles of the edges of the line."""
        middle = np.full(len(self.vertices), -1)
        middle[self.line[:, 1]] = np.arange(len(self.line))
        angles = np.full(len(self.line), np.nan)
        for edge in range(3):
            rows = np.flatnonzero(middle[self.faces[:, 3 + edge]] >= 0)
            corners = self.vertices[self.faces[rows]]
            # Along the edge, and at its middle towards the opposite corner: derivatives of the quadratic patch.
            a, b, c = edge, (edge + 1) % 3, (edge + 2) % 3
            along = corners[:, b] - corners[:, a]
            inward = 2 * (corners[:, 3 + b] + corners[:, 3 + c] - corners[:, 3 + a]) - corners[:, c]
            inward -= (corners[:, a] + corners[:, b]) / 2
            normal = np.cross(along, inward)
            x, y = (corners[:, 3 + edge, axis] for axis in range(2))
            under = np.column_stack([-self.drop.ground.gradient(x, y), np.ones(len(rows))])
            cosine = np.einsum("ij,ij->i", normal, under)
            cosine /= np.linalg.norm(normal, axis=1) * np.linalg.norm(under, axis=1)
            angles[middle[self.faces[rows, 3 + edge]]] = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        return angles

    @property
    def triangles(self) -> IntArray:
        """(4 m, 3) flat triangles between the vertices, for pictures."""
        a, b, c, ab, bc, ca = self.faces.T
        return np.concatenate(
            [np.stack(rows, axis=1) for rows in ((a, ab, ca), (ab, b, bc), (bc, c, ca), (ab, bc, ca))]
        )

    def _surface_points(self) -> FloatArray:
        """Return points (n, 3) of the curved triangles."""
        i, j = (each.ravel() for each in np.meshgrid(*[np.arange(PARTS + 1)] * 2))
        u, v = (each[i + j <= PARTS, np.newaxis] / PARTS for each in (i, j))
        w = 1 - u - v
        weights = np.hstack([u * (2 * u - 1), v * (2 * v - 1), w * (2 * w - 1), 4 * u * v, 4 * v * w, 4 * w * u])
        return np.asarray(np.einsum("tk,fkd->ftd", weights, self.vertices[self.faces]).reshape(-1, 3))

    def lines(self) -> list[str]:
        """Return what was found, in millimeters."""
        mm, angles = 1e3, self.contact_angles
        return [
            f"height             {self.height * mm:.5f} mm above the surface's mean",
            f"width              {self.widths[0] * mm:.5f} mm along, {self.widths[1] * mm:.5f} mm across",
            f"base               {self.base_widths[0] * mm:.5f} mm along, {self.base_widths[1] * mm:.5f} mm across",
            f"contact area       {self.wetted_area * mm**2:.6f} mm²",
            f"contact angle      {angles.mean():.2f}°, from {angles.min():.2f}° to {angles.max():.2f}° along the line",
            f"pressure at z = 0  {self.pressure:.3f} Pa",
            f"held over place    {self.held[0]:.4f} of its weight along, {self.held[1]:.4f} across",
        ]


def _at_rest(rows: list[list[str]]) -> bool:
    """Return whether the last two energies that were printed agree."""
    energies = [float(row[row.index("energy:") + 1]) for row in rows if "energy:" in row]
    if len(energies) < 2 or not np.isfinite(energies[-2:]).all():
        return False
    return abs(energies[-1] - energies[-2]) < RESTING * abs(energies[-1])
