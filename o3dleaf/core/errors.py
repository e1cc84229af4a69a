"""Errors and warnings; every message says the cause and then the cure."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


class O3DLeafError(Exception):
    """Base of every error that o3dleaf raises on purpose; the command line prints it in one line."""


class InputError(O3DLeafError, ValueError):
    """An argument or a file does not hold what it should."""


class UnitError(InputError):
    """Two lengths in different or unknown units meet, or a length has an impossible size."""


class IllPosedError(O3DLeafError):
    """The data cannot determine the interpolant that was requested (names the rank found)."""


class OrientationError(InputError):
    """The points do not determine which side of them is outside."""


class ReconstructionError(O3DLeafError):
    """A stage of the reconstruction ran but its result is not a usable surface.

    Attributes
    ----------
    places : (k, 3) ndarray or None
        Where in the world, if that is known: a picture of the scan can show it.
    pieces : tuple of (k, 3) ndarrays
        Points of each of the scan's pieces, where the message names these by number.
    """

    def __init__(
        self,
        message: str,
        places: "npt.NDArray[np.float64] | None" = None,
        pieces: "tuple[npt.NDArray[np.float64], ...]" = (),
    ) -> None:
        super().__init__(message)
        self.places = places
        self.pieces = pieces


class MemoryBudgetError(O3DLeafError, MemoryError):
    """The job would not fit into the stated memory budget."""


class TimeBudgetError(O3DLeafError, TimeoutError):
    """The job would take longer than the stated time."""


class CloudWarning(UserWarning):
    """A decision about a point cloud on the way to its surface."""


class DataWarning(UserWarning):
    """Data that a function can take in part only: values that contradict one another, or places that leave it open."""


class CodeWarning(UserWarning):
    """The machine code that came with the package cannot be used here, and functions are compiled anew."""
