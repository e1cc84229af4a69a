"""Maps of a leaf: where its frame stretches, shears or thins the micro-structure."""

from collections.abc import Callable
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray, require_choice
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.leaf.blade.blade import SAMPLE_COUNT, Blade
from o3dleaf.leaf.blade.distortion import Distortion
from o3dleaf.output.view.camera import View
from o3dleaf.output.view.picture import Scalars, render


class Measure(NamedTuple):
    """A quantity that a map can show: a function of the distortion, its name, and its value without distortion."""

    values: Callable[[Distortion], FloatArray]
    label: str
    neutral: float


MEASURES = {
    "along": Measure(lambda distortion: distortion.along, "stretch along", 1.0),
    "across": Measure(lambda distortion: distortion.across, "stretch across", 1.0),
    "shear": Measure(lambda distortion: np.degrees(distortion.shear), "shear, degrees", 0.0),
    "thickness": Measure(lambda distortion: distortion.thickness, "thickness factor", 1.0),
    "area": Measure(lambda distortion: distortion.area, "area factor", 1.0),
    "volume": Measure(lambda distortion: distortion.volume, "volume factor", 1.0),
}
MIN_SPAN = 1e-3
"""Half the span of the colors at least, lest rounding be painted."""


def render_distortion(
    blade: Blade,
    path: str | PathLike[str] | None = None,
    *,
    measure: str = "area",
    flat: bool = False,
    spacing: float | None = None,
    **options: Any,
) -> npt.NDArray[np.uint8]:
    """Return a picture of a blade in the colors of its distortion, and write it to a file if a path is given.

    The colors are symmetric about the value that means none, so that the middle one is undistorted;
    they reach as far as 99 % of the blade do.

    Parameters
    ----------
    blade : Blade
    path : path-like, optional
        A .png or .jpg file.
    measure : {"along", "across", "shear", "thickness", "area", "volume"}
        See `Distortion`.
    flat : bool
        Draw the plane (along, across) instead of the leaf in the world.
    spacing : float, optional
        Step of the mesh that is drawn, in the blade's unit; about twenty thousand vertices by default.
    **options
        Of `render`: size, title, view, ...

    Returns
    -------
    (height, width, 3) ndarray of uint8

    Raises
    ------
    InputError
        If there is no such measure, or the path is no picture's.
    ReconstructionError
        If the blade has no triangle at this spacing.
    """
    shown = MEASURES[require_choice(measure, MEASURES, "measure")]
    step = float(np.sqrt(blade.outline.area / SAMPLE_COUNT)) if spacing is None else spacing
    world, triangles = mesh_arrays(blade.extract_mesh(step))
    plane = blade.flatten(world)[:, :2]
    values = shown.values(blade.distortion(plane))
    span = max(float(np.quantile(np.abs(values - shown.neutral), 0.99)), MIN_SPAN)
    scalars = Scalars(values, shown.label, "coolwarm", (shown.neutral - span, shown.neutral + span))
    vertices = np.column_stack([plane, np.zeros(len(plane))]) if flat else world
    if flat:
        options.setdefault("view", View(tilt=0.0))
    return render((vertices, triangles), path, scalars=scalars, **{"unit": blade.unit} | options)
