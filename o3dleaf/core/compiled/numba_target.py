"""Numba's compiler for a level of processors instead of the one at hand; the only file that knows its inner parts.

Numba compiles for the processor that it runs on, so that sums are vectorized differently on each, and what it keeps on
disk serves one kind of processor only. Here compiled functions are a target of their own, as Numba's "target
extensions" are, whose code generator knows the level (x86-64-v3: every processor with AVX2) and nothing else of the
processor. Functions of others in the same process are compiled as ever.

What is compiled now and what is loaded is the same object code. To be so in a running process, too, a function calls
its own copies of those that it calls: Numba leaves all copies exchangeable, and of two that were optimized in different
callers the first one in the process served all.
"""

import pickle
import platform
import sys
import warnings
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core import codegen, config, cpu, types, typing
from numba.core.caching import CompileResultCacheImpl, _Cache
from numba.core.compiler import Compiler, CompileResult
from numba.core.dispatcher import _FunctionCompiler
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher, CPUTarget
from numba.core.serialize import dumps
from numba.core.target_extension import CPU, dispatcher_registry, jit_registry, target_override, target_registry
from numba.core.utils import threadsafe_cached_property

from o3dleaf.core.compiled import code_files, sources
from o3dleaf.core.errors import CodeWarning
from o3dleaf.core.journal import note, open_journal

NAME = "o3dleaf"

SHIPPED = Path(__file__).parent / "machine_code"
"""The folder of the package with the code that a wheel brings; a checkout has none."""

MADE_BY = (
    f"Numba {numba.__version__}, llvmlite {version('llvmlite')}, {sys.implementation.cache_tag}, "
    f"{sources.stamp(__name__)[:16]}"
)
"""All that code is made by: this file, too."""

MADE_FOR = "made_for.txt"
"""The file in that folder that says what its code was made by, and for which processors."""

ENVIRONMENT = "_ZN08NumbaEnv"
"""How Numba's names of environments begin: the constants of a function that are Python objects."""

RECURSIVE = codegen.RuntimeLinker.PREFIX
"""How Numba's names of the addresses of functions that call themselves begin."""

LEVELS = {
    "x86-64-v3": ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"),
    "x86-64-v2": ("sse3", "ssse3", "sse4.1", "sse4.2", "popcnt", "cx16"),
    "x86-64": (),
}
"""The levels of the x86-64 ABI, the highest first, and the features that a processor must have for each.

A fourth, x86-64-v4 (AVX-512), is not worth its own code: see `scripts/bench_engine.py`.
"""


@cache
def processor_level() -> tuple[str, str]:
    """Return name and features of the processors that code is made for, as LLVM calls them."""
    if platform.machine().lower() not in {"x86_64", "amd64"}:
        return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    features = llvm.get_host_cpu_features()
    return next(level for level, needed in LEVELS.items() if all(features.get(each) for each in needed)), ""


CALLEES: dict[str, "LevelLibrary"] = {}
"""Libraries of callees by the names of their functions."""


class LevelLibrary(codegen.JITCodeLibrary):
    """The code of one function, which calls its own copies of those that it calls, never those of another library.

    That of a callee is there to be linked into its callers, and no machine code is made of it.
    """

    is_callee = False

    def _optimize_final_module(self) -> None:
        self._tie_recursive_calls()
        if not self.is_callee:
            super()._optimize_final_module()
            return
        passes, builder = self._codegen._module_pass_manager(
            loop_vectorize=False, slp_vectorize=False, opt=self._codegen._opt_level, cost="cheap"
        )
        passes.run(self._final_module, builder)

    def _tie_recursive_calls(self) -> None:
        """Let functions that call themselves do so by name; Numba does it by an address that the process fills in."""
        variables = [variable.name for variable in self._final_module.global_variables]
        calls = {name: name.removeprefix(RECURSIVE) for name in variables if name.startswith(RECURSIVE)}
        if not calls:
            return
        defined = {function.name for function in self._final_module.functions if not function.is_declaration}
        elsewhere = set(calls.values()) - defined
        code = str(self._final_module)
        for name, function in calls.items():
            code = code.replace(f'@"{name}" = external global ptr', f'@"{name}" = internal constant ptr @{function}')
        self._final_module = llvm.parse_assembly(code + "".join(f"declare void @{name}()\n" for name in elsewhere))
        self._final_module.name = self.name
        for name in elsewhere:
            self._final_module.link_in(CALLEES[name]._get_module_for_linking(), preserve=True)

    def _finalize_final_module(self) -> None:
        if self._shared_module is None:  # compiled here, not loaded
            self._shared_module = self._linkable_copy()
            for function in self._final_module.functions:
                if function.linkage == llvm.Linkage.linkonce_odr and not function.is_declaration:
                    function.linkage = llvm.Linkage.internal
        if self.is_callee:
            self._finalize_dynamic_globals()
            self._finalized = True
        else:
            super()._finalize_final_module()

    def _linkable_copy(self) -> llvm.ModuleRef:
        """Return what is linked into callers, where equal functions of several libraries are one."""
        module = self._final_module.clone()
        for function in module.functions:
            if function.linkage == llvm.Linkage.external and not function.is_declaration:
                function.linkage = llvm.Linkage.linkonce_odr
        return module


class LevelCodegen(codegen.JITCPUCodegen):
    """Numba's code generator for a level of processors, or for what `NUMBA_CPU_NAME` says."""

    _library_class = LevelLibrary

    def _get_host_cpu_name(self) -> str:
        return processor_level()[0] if config.CPU_NAME is None else super()._get_host_cpu_name()

    def _get_host_cpu_features(self) -> str:
        return processor_level()[1] if config.CPU_NAME is None else super()._get_host_cpu_features()


class LevelContext(cpu.CPUContext):
    """Numba's context of a target, with that code generator."""

    def init(self) -> None:
        """Make the code generator."""
        super().init()
        self._internal_codegen = LevelCodegen(f"{NAME}.exec")

    def get_executable(self, library: LevelLibrary, fndesc: Any, env: Any) -> Any:
        """Return what Python can call; callees' environments are set too, since they are never called from Python."""
        function = super().get_executable(library, fndesc, env)
        for variable in library._final_module.global_variables:
            if variable.name.startswith(ENVIRONMENT) and (found := lookup_environment(variable.name)) is not None:
                library.codegen.set_env(variable.name, found)
        return function


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


class CodeCache(_Cache):
    """Machine code of one function on disk: shipped with the package, or compiled here and kept where Numba would."""

    suffix = ".code"

    def __init__(self, function: Any) -> None:
        self._function = function

    @property
    def cache_path(self) -> str | None:
        """Where code that is compiled here is kept, or None where nothing can be written."""
        folder = _writable_folder(self._function)
        return None if folder is None else str(folder)

    def load_overload(self, sig: Any, target_context: LevelContext) -> CompileResult | None:
        """Return the code for these arguments, or None if there is none."""
        target_context.refresh()
        name, key = self._name_and_key(sig, target_context.codegen())
        payload = None if _only_folder else code_files.read_code(SHIPPED / name, key)
        if payload is None and (folder := _writable_folder(self._function)) is not None:
            payload = code_files.read_code(folder / name, key)
        if payload is None:
            _tell_once()
        return None if payload is None else self._unpack(payload, target_context)

    def save_overload(self, sig: Any, data: CompileResult) -> None:
        """Keep what was compiled for these arguments."""
        folder = _writable_folder(self._function)
        if folder is not None and not data.lifted and not data.library.has_dynamic_globals:
            name, key = self._name_and_key(sig, data.codegen)
            code_files.write_code(folder / name, key, self._pack(data))

    def _pack(self, data: CompileResult) -> bytes:
        return dumps(data._reduce())

    def _unpack(self, payload: bytes, target_context: LevelContext) -> CompileResult:
        return CompileResult._rebuild(target_context, *pickle.loads(payload))

    def _name_and_key(self, sig: Any, generator: Any) -> tuple[str, str]:
        function = f"{self._function.__module__}.{self._function.__qualname__}"
        stamps = map(sources.stamp, sorted({self._function.__module__, *_record_modules(sig)}))
        key = "\n".join((MADE_BY, *generator.magic_tuple(), function, str(sig), " ".join(stamps)))
        return code_files.file_name(function, key) + self.suffix, key

    def enable(self) -> None:
        """Do nothing: it is always on."""

    def disable(self) -> None:
        """Do nothing: it is always on."""

    def flush(self) -> None:
        """Do nothing: what is not current is never read."""


class CalleeCache(CodeCache):
    """What a compiled function is to its callers, on disk: LLVM's intermediate code."""

    suffix = ".callee"

    def _pack(self, data: CompileResult) -> bytes:
        data.library._ensure_finalized()
        name, code = data.library.name, data.library._get_module_for_linking().as_bitcode()
        data.fndesc.typemap = data.fndesc.calltypes = None
        return dumps((name, code, data.fndesc, data.environment, data.signature, data._find_referenced_environments()))

    def _unpack(self, payload: bytes, target_context: LevelContext) -> CompileResult:
        name, code, fndesc, environment, signature, self._environments = pickle.loads(payload)
        library = target_context.codegen().create_library(name)
        library.is_callee, library._shared_module, library._finalized = True, llvm.parse_bitcode(code), True
        parts = dict.fromkeys(CompileResult._fields)
        parts |= {"library": library, "fndesc": fndesc, "environment": environment, "signature": signature}
        parts["entry_point"] = object()
        parts |= {"typing_context": target_context.typing_context, "target_context": target_context}
        return CompileResult(**(parts | {"lifted": (), "objectmode": False, "reload_init": ()}))


class CalleeCompiler(_FunctionCompiler):
    """Numba's compiler of a function that Python does not call."""

    def _customize_flags(self, flags: Any) -> Any:
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        return flags


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
        pipeline_class: Any = Compiler,
    ) -> None:
        super().__init__(py_func, locals, targetoptions, pipeline_class)
        self.callee = Callee(py_func, self.locals, self.targetoptions, pipeline_class)

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
            if self.py_func.__name__ in self.py_func.__code__.co_names:  # it calls itself, as its own callee
                self.callee.compile(sig)
            return super().compile(sig)


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


def made_for() -> str:
    """Return what code in this process is made by, and for which processors."""
    return ", ".join((MADE_BY, *LevelDispatcher.targetdescr.target_context.codegen().magic_tuple()))


@cache
def _tell_once() -> None:
    """Say so, if the package brings machine code, but for something else than this process."""
    try:
        brought = (SHIPPED / MADE_FOR).read_text(encoding="utf-8")
    except OSError:
        return
    if brought != made_for():
        text = (
            f"the machine code that came with this package is for {brought}, not for {made_for()}: functions are "
            "compiled when they are first called, which takes minutes once; `o3dleaf warm-up` does it on all cores"
        )
        if open_journal() is None:
            warnings.warn(text, CodeWarning, stacklevel=2)
        else:
            note(text)


@cache
def _own(function: CPUDispatcher) -> LevelDispatcher:
    """Return a function of Numba's own for this target."""
    return LevelDispatcher(function.py_func, function.locals, function.targetoptions)


def keep_in(folder: Path) -> None:
    """Keep all that is compiled from now on in one folder, as a package brings it, and read it from there only."""
    global _only_folder  # noqa: PLW0603
    _only_folder = folder


_only_folder: Path | None = None


@cache
def _writable_folder(function: Any) -> Path | None:
    if _only_folder is not None:
        return _only_folder
    try:
        return Path(CompileResultCacheImpl(function).locator.get_cache_path())
    except (RuntimeError, OSError):  # no folder can be written to
        return None


def _record_modules(sig: Any) -> set[str]:
    """Return the modules of the records among these arguments: Numba chooses some functions by their types."""
    found, waiting = set(), list(sig if isinstance(sig, tuple) else sig.args)
    while waiting:
        kind = waiting.pop()
        if isinstance(kind, types.BaseNamedTuple):
            found.add(kind.instance_class.__module__)
        waiting += getattr(kind, "types", ())
    return found
