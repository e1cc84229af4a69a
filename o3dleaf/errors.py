"""The namespace o3l.errors: every error and warning of the package, see `o3dleaf.core.errors`."""

from o3dleaf.core.errors import (
    CloudWarning,
    CodeWarning,
    DataWarning,
    IllPosedError,
    InputError,
    MemoryBudgetError,
    O3DLeafError,
    OrientationError,
    ReconstructionError,
    TimeBudgetError,
    UnitError,
)

__all__ = [
    "CloudWarning",
    "CodeWarning",
    "DataWarning",
    "IllPosedError",
    "InputError",
    "MemoryBudgetError",
    "O3DLeafError",
    "OrientationError",
    "ReconstructionError",
    "TimeBudgetError",
    "UnitError",
]
