"""Arrays without reference counts, in functions that make none and return none.

Numba counts the references to an array's memory with atomic additions wherever a view of it is taken, also in a loop
over balls, and threads that count in the same memory wait for one another. A caller holds what it
hands over until the call returns, so that a function which has nothing but views of its arguments need not count.
"""

from typing import Any

from numba.core import ir, types
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.typed_passes import IRLegalization

TAKING = {
    *("cast", "phi", "getattr", "static_getitem", "build_tuple"),
    *("exhaust_iter", "getiter", "iternext", "pair_first", "pair_second"),
}
"""Numba's operations whose result holds what their operands hold, and nothing new. `getitem` is another by numbers and
slices."""

VIEW = "array.reshape"
"""Numba's name of the method that makes a view of a contiguous array."""


def counts(state: Any) -> bool:
    """Return whether a function must count references: whether it makes, returns or copies an array, or may do so.

    Parameters
    ----------
    state : StateDict
        What Numba knows of the function once its types are inferred.
    """
    if state.func_ir.is_generator or _holds(state, state.return_type):
        return True
    held = [kind for kind in state.typemap.values() if _holds(state, kind)]
    statements = [each for block in state.func_ir.blocks.values() for each in block.body]
    return not held or not all(map(_is_of_arrays, held)) or any(_makes(state, each) for each in statements)


def _holds(state: Any, kind: types.Type) -> bool:
    """Return whether values of a type hold memory whose references are counted."""
    return bool(state.targetctx.data_model_manager[kind].contains_nrt_meminfo())


def _is_of_arrays(kind: types.Type) -> bool:
    """Return whether memory that values of a type hold is that of arrays: lists and strings are not looked into."""
    if isinstance(kind, types.BaseTuple):
        return all(isinstance(part, types.Number | types.Boolean) or _is_of_arrays(part) for part in kind)
    return isinstance(kind, types.Array | types.IteratorType | types.Pair | types.BoundFunction)


def _makes(state: Any, statement: ir.Stmt) -> bool:
    """Return whether a statement may make an array, or copy one."""
    typed = state.typemap
    if isinstance(statement, ir.SetItem | ir.StaticSetItem):
        return _holds(state, typed[statement.value.name])  # one that overlaps its source would be copied
    if not isinstance(statement, ir.Assign) or not _holds(state, typed[statement.target.name]):
        return False
    value = statement.value
    if not isinstance(value, ir.Expr):
        return isinstance(value, ir.Yield)
    if value.op == "getitem":
        return not _is_basic(typed[value.index.name])
    if value.op == "call":
        function = typed[value.func.name]
        return not (isinstance(function, types.BoundFunction) and function.typing_key == VIEW)
    return value.op not in TAKING


def _is_basic(index: types.Type) -> bool:
    """Return whether an index is of numbers and slices, for which NumPy has a view."""
    parts = index.types if isinstance(index, types.BaseTuple) else (index,)
    return all(isinstance(part, types.Integer | types.SliceType | types.EllipsisType) for part in parts)


@register_pass(mutates_CFG=False, analysis_only=True)
class BorrowedReferences(AnalysisPass):
    """Numba's pass that has the code of such a function made without counts."""

    _name = "o3dleaf_borrowed_references"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Give the function a context without counts if it needs none."""
        if not counts(state):
            state.targetctx = state.targetctx.subtarget(enable_nrt=False)
            state.targetctx.__dict__.pop("nrt", None)  # of the context that was copied
        return False


class BorrowingCompiler(Compiler):
    """Numba's pipeline with that pass."""

    def define_pipelines(self) -> list[Any]:
        """Return the pipeline, with the pass where all types are known and nothing is lowered."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(BorrowedReferences, IRLegalization)
        passes.finalize()
        return [passes]
