"""Readings of a droplet from the files of the solver, in one table: volume, contact, widths, height, speed, bounds."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, mesh_arrays
from o3dleaf.io.triangle_mesh import read_mesh
from o3dleaf.output.droplet.units import LENGTH, TIME
from o3dleaf.surface.mesh.topology import label_nodes

COLUMNS = {
    "t": "s",
    "volume": "m3",
    "contact_area": "m2",
    "width_along": "m",
    "width_across": "m",
    "height": "m",
    "velocity_x": "m/s",
    "velocity_y": "m/s",
    "velocity_z": "m/s",
    "alpha_min": "",
    "alpha_max": "",
    "fastest": "m/s",
}
"""Of the table, with their units: height is that of the droplet's top over the mean height of the surface, bounds of
alpha and the largest speed of anything, air too, are over all steps since the row before."""
TOUCHING = 0.05
"""Share of the largest contact area below which a droplet does not touch: it is over the interface's width."""


@dataclass(frozen=True, eq=False)
class DropletReadings:
    """The course of one droplet, in SI.

    Attributes
    ----------
    rows : (n, 12) ndarray
        In the order of `COLUMNS`.
    surfaces : list of Path
        The droplet's surface at these times, in the solver's unit of length.
    """

    rows: FloatArray
    surfaces: list[Path]

    @classmethod
    def read(cls, variant: Path) -> "DropletReadings":
        """Return what a run has written so far.

        Raises
        ------
        InputError
            If there is nothing.
        """
        results = variant / "postProcessing"
        volume, contact, velocity, bounds = (
            read_series(results / name) for name in ("volume", "contact", "velocity", "bounds")
        )
        found = {float(path.parent.name): path for path in results.glob("interface/*/droplet.obj")}
        times = [time for time in sorted(found) if volume[:, 0].size and time <= volume[-1, 0] * (1 + 1e-9)]
        rows = list[list[float]]()
        for time in times:
            area, size, speed = (series[nearest(series[:, 0], time), 1:] for series in (contact, volume, velocity))
            since = rows[-1][0] if rows else 0.0
            within = bounds[(bounds[:, 0] > since * (1 + 1e-9)) & (bounds[:, 0] <= time * (1 + 1e-9))]
            lowest, highest, fastest = within[:, 1].min(), within[:, 2].max(), within[:, -1].max()
            shape = measure_droplet(*mesh_arrays(read_mesh(found[time]).mesh))
            rows.append([time, *size, *area, *shape, *speed, lowest, highest, fastest])
        if not rows:
            raise InputError(f"{variant}: holds no results yet; run the case first")
        powers = np.array([TIME, LENGTH**3, LENGTH**2, *[LENGTH] * 3, *[1.0] * 6])
        return cls(np.array(rows) * powers, [found[time] for time in times])

    def column(self, name: str) -> FloatArray:
        """Return one column."""
        return np.asarray(self.rows[:, list(COLUMNS).index(name)])

    def summary(self, diameter: float) -> dict[str, float]:
        """Return the figures of the impact; NaN what has not happened: widths in diameters, times from the touch."""
        time, area, speed = self.column("t"), self.column("contact_area"), self.column("velocity_z")
        along, across = self.column("width_along") / diameter, self.column("width_across") / diameter
        touching = area > TOUCHING * area.max()
        first = int(touching.argmax())
        gone = first + int((~touching[first:]).argmax())
        left = gone if gone > first else None
        ratio = along / across
        while_touching = ratio[first:left]  # in the air, too, it swings
        most, least = (first + int(at) for at in (while_touching.argmax(), while_touching.argmin()))
        volume = self.column("volume")
        return {
            "touch_ms": time[first] * 1e3,
            "largest_width_along": float(along.max()),
            "largest_width_across": float(across.max()),
            "ratio_at_largest_width": float(ratio[int((along * across).argmax())]),
            "largest_ratio": float(ratio[most]),
            "largest_ratio_at_ms": time[most] * 1e3,
            "least_ratio": float(ratio[least]),
            "least_ratio_at_ms": time[least] * 1e3,
            "largest_contact_mm2": float(area.max()) * 1e6,
            "lift_off_ms": float("nan") if left is None else crossing(time, area, left, TOUCHING * area.max()) * 1e3,
            "rebound_m_s": float("nan") if left is None else float(speed[left]),
            "volume_drift": float(np.abs(volume / volume[0] - 1).max()),
            "alpha_min": float(self.column("alpha_min").min()),
            "alpha_max": float(self.column("alpha_max").max()),
            "fastest_m_s": float(self.column("fastest").max()),
        }


def crossing(time: FloatArray, values: FloatArray, after: int, level: float) -> float:
    """Return when values fall through a level between a row and the one before, by a straight line."""
    share = (values[after - 1] - level) / (values[after - 1] - values[after])
    return float(time[after - 1] + share * (time[after] - time[after - 1]))


def measure_droplet(vertices: FloatArray, triangles: IntArray) -> tuple[float, float, float]:
    """Return widths along x and y and the largest z of the largest connected piece of a surface."""
    pairs = np.concatenate([triangles[:, 0], triangles[:, 1]]), np.concatenate([triangles[:, 1], triangles[:, 2]])
    label = label_nodes(*pairs, len(vertices))
    piece = vertices[label == np.bincount(label[triangles[:, 0]]).argmax()]
    along, across = np.ptp(piece[:, :2], axis=0).tolist()
    return along, across, float(piece[:, 2].max())


def cap_of(volume: float, height: float) -> float:
    """Return the contact angle, in degrees, of the spherical cap of a volume and a height."""
    base = max(6 * volume / (np.pi * height) - height**2, 0.0) / 3
    return float(np.degrees(2 * np.arctan2(height, np.sqrt(base))))


def read_series(folder: Path) -> FloatArray:
    """Return the rows of a function object: what a later start wrote takes the place of what was after it."""
    rows = np.empty((0, 0))
    for start in sorted(folder.glob("*/*.dat"), key=lambda path: float(path.parent.name)):
        read = read_rows(start.read_text(encoding="ascii").splitlines())
        if not len(read):
            continue
        rows = read if not len(rows) else np.concatenate([rows[rows[:, 0] < read[0, 0] * (1 - 1e-9)], read])
    return rows if len(rows) else np.empty((0, 2))


def read_rows(lines: Iterable[str]) -> FloatArray:
    """Return the numbers of lines that are no comments, vectors without their brackets, less half a line at the end."""
    rows = [line.translate(str.maketrans("()", "  ")).split() for line in lines if line and not line.startswith("#")]
    rows = [row for row in rows if len(row) == len(rows[0])]
    return np.array(rows, dtype=np.float64)


def nearest(times: FloatArray, time: float) -> int:
    """Return the row of a time."""
    return int(np.abs(times - time).argmin())


def table_of(courses: dict[str, DropletReadings]) -> str:
    """Return the courses of several droplets as one table with commas, each row with the name of its own."""
    head = ",".join(["run", *(f"{name}_{unit}" if unit else name for name, unit in COLUMNS.items())])
    rows = [f"{run},{','.join(map(repr, row))}" for run, course in courses.items() for row in course.rows.tolist()]
    return "\n".join([head, *rows, ""])
