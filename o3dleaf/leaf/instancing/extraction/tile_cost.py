"""Memory and time that a lattice over one tile takes, and whether there is room for it."""

from o3dleaf.core.resources import measured
from o3dleaf.core.resources.measured import Cost
from o3dleaf.core.resources.needs import in_words, require_resources
from o3dleaf.core.resources.scratch import is_held


def require_columns(count: float, step: float, layers: int = 0) -> None:
    """Raise `MemoryBudgetError` if a tile of so many columns, a step apart, does not fit into memory.

    Or `TimeBudgetError`, if its layers are known and take too long.
    """
    what = f"spacing: {in_words(count)} columns of the lattice in one tile"
    require_resources(cost_of_tile(count, layers), what, "give a larger one", step=step)


def cost_of_tile(columns: float, layers: float) -> Cost:
    """Return what a lattice over one tile takes; what lies in files (`GrowingArray`) no memory."""
    whole, beside = measured.TILE_COLUMN * columns, measured.TILE + measured.FILED_COLUMN * columns
    held = whole.bytes if is_held(whole.bytes) else min(whole.bytes, beside.bytes)
    return Cost(held) + measured.TILE_SAMPLE * (columns * layers)
