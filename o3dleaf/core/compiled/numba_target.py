"""Numba's compiler for a level of processors instead of the one at hand.

Numba compiles for the processor that it runs on, so that sums are vectorized differently on each, and what it keeps on
disk serves one kind of processor only. Here compiled functions are a target of their own, as Numba's "target
extensions" are, whose code generator knows the level (x86-64-v3: every processor with AVX2) and nothing else of the
processor. Functions of others in the same process are compiled as ever.

What is compiled now and what is loaded is the same object code. To be so in a running process, too, a function calls
its own copies of those that it calls: Numba leaves all copies exchangeable, and of two that were optimized in different
callers the first one in the process served all.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numba
from numba.core import types, typing
from numba.core.compiler import CompileResult
from numba.core.dispatcher import _FunctionCompiler
from numba.core.registry import CPUDispatcher, CPUTarget
from numba.core.target_extension import CPU, dispatcher_registry, jit_registry, target_override, target_registry
from numba.core.utils import threadsafe_cached_property

from o3dleaf.core.compiled.borrowed import BorrowingCompiler
from o3dleaf.core.compiled.code_cache import CalleeCache, CodeCache
from o3dleaf.core.compiled.level_code import CALLEES, NAME, LevelContext


class LevelTypes(typing.Context):
    """Numba's knowledge of types; functions that it has compiled for the processor at hand are compiled anew."""

    def resolve_value_type(self, val: Any) -> Any:
        """Return the type of a global of a compiled function."""
        return super().resolve_value_type(_own(val) if type(val) is CPUDispatcher else val)


class LevelTarget(CPUTarget):
    """Numba's description of a target, with that context."""

    @threadsafe_cached_property
    def _toplevel_typing_context(self) -> LevelTypes:
        return LevelTypes()

    @threadsafe_cached_property
    def _toplevel_target_context(self) -> LevelContext:
        return LevelContext(self.typing_context, self._target_name)


class CalleeCompiler(_FunctionCompiler):
    """Numba's compiler of a function that Python does not call."""

    def _customize_flags(self, flags: Any) -> Any:
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        return flags


class CallerCompiler(_FunctionCompiler):
    """Numba's compiler of a function that Python calls."""

    callee: "Callee"

    def compile(self, args: Any, return_type: Any) -> Any:
        """Compile it; if it may call itself, its callee first: Numba would take that for what is being compiled."""
        if self.py_func.__name__ in self.py_func.__code__.co_names:
            self.callee.compile(args)
        return super().compile(args, return_type)


class Callee(CPUDispatcher):
    """What a compiled function is to those that call it: linked into them, without machine code of its own."""

    targetdescr = LevelTarget(NAME)

    def __init__(self, py_func: Any, locals: Any, targetoptions: Any, pipeline_class: Any) -> None:  # noqa: A002
        super().__init__(py_func, locals, targetoptions, pipeline_class)
        self._compiler = CalleeCompiler(py_func, self.targetdescr, targetoptions, locals, pipeline_class)

    def enable_caching(self) -> None:
        """Load and keep code on disk."""
        self._cache = CalleeCache(self.py_func)

    def add_overload(self, cres: CompileResult) -> None:
        """Make what was compiled known to callers, under a key of its own."""
        if cres.entry_point is None:  # compiled here, not loaded
            cres.library.is_callee = True
            cres = cres._replace(entry_point=object())
            self.targetctx.insert_user_function(cres.entry_point, cres.fndesc, [cres.library])
        CALLEES[cres.fndesc.llvm_func_name] = cres.library
        self.overloads[tuple(cres.signature.args)] = cres


class LevelDispatcher(CPUDispatcher):
    """A compiled function, as Python calls it; its callers link its `callee`."""

    targetdescr = Callee.targetdescr

    def __init__(
        self,
        py_func: Any,
        locals: Any = None,  # noqa: A002 - Numba's name
        targetoptions: Any = None,
        pipeline_class: Any = BorrowingCompiler,
    ) -> None:
        super().__init__(py_func, locals, targetoptions, pipeline_class)
        self.callee = Callee(py_func, self.locals, self.targetoptions, pipeline_class)
        self._compiler = CallerCompiler(py_func, self.targetdescr, self.targetoptions, self.locals, pipeline_class)
        self._compiler.callee = self.callee

    @property
    def _numba_type_(self) -> Any:
        """What a caller's compiler takes this for."""
        return types.Dispatcher(self.callee)

    def enable_caching(self) -> None:
        """Load and keep code on disk."""
        self._cache = CodeCache(self.py_func)
        self.callee.enable_caching()

    def compile(self, sig: Any) -> Any:
        """Compile or load the function for these arguments, and with it what Numba itself compiles for it."""
        with target_override(NAME):
            return super().compile(sig)


@cache
def _own(function: CPUDispatcher) -> LevelDispatcher:
    """Return a function of Numba's own for this target."""
    return LevelDispatcher(function.py_func, function.locals, function.targetoptions)


class ProcessorLevel(CPU):
    """The target's token: it has all that Numba has for processors."""


def njit(*function: Any, **options: Any) -> Callable[[Any], Any]:
    """Numba's `njit`, for a level of processors."""
    return numba.jit(*function, **{**options, "nopython": True, "_target": NAME})


def _callee(**options: Any) -> Callable[[Any], Any]:
    """Return the decorator that Numba gives its own functions: they are only called by ours."""
    return lambda function: njit(**options)(function).callee


target_registry[NAME] = ProcessorLevel
dispatcher_registry[ProcessorLevel] = LevelDispatcher
jit_registry[ProcessorLevel] = _callee
