"""Compiled code on disk, in Numba's terms: loaded where it came with the package, or was compiled here before."""

import pickle
import sys
import warnings
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core import types
from numba.core.caching import CompileResultCacheImpl, _Cache
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from o3dleaf.core.compiled import code_files, sources
from o3dleaf.core.compiled.level_code import LevelCodegen, LevelContext
from o3dleaf.core.errors import CodeWarning
from o3dleaf.core.journal import note, open_journal

SHIPPED = Path(__file__).parent / "machine_code"
"""The folder of the package with the code that a wheel brings; a checkout has none."""

MADE_FOR = "made_for.txt"
"""The file in that folder that says what its code was made by, and for which processors."""

COMPILER = ("level_code", "code_cache", "borrowed", "numba_target")
"""The modules of this folder that decide what code is like."""

MADE_BY = (
    f"Numba {numba.__version__}, llvmlite {version('llvmlite')}, {sys.implementation.cache_tag}, "
    f"{sources.stamp(*(f'{__package__}.{name}' for name in COMPILER))[:16]}"
)
"""All that code is made by."""


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
        # The allocator is all that loading needs: Numba's compiler asks for the rest itself, a quarter of a second.
        rtsys.initialize(target_context)
        name, key = self._name_and_key(sig, target_context.codegen())
        payload = None if _only_folder else code_files.read_code(SHIPPED / name, key)
        folder = None if payload is not None else _writable_folder(self._function)
        if folder is not None:
            payload = code_files.read_code(folder / name, key)
        if payload is None:
            _tell_other_processor(target_context.codegen())
            if folder is None:
                _tell_not_kept()
            return None
        return self._unpack(payload, target_context)

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
        stamp = sources.stamp(self._function.__module__, *sorted(_record_modules(sig)))
        key = "\n".join((MADE_BY, *generator.magic_tuple(), function, str(sig), stamp))
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

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._environments: list[Any] = []  # Numba itself refers to them weakly

    def _pack(self, data: CompileResult) -> bytes:
        data.library._ensure_finalized()
        name, code = data.library.name, data.library._get_module_for_linking().as_bitcode()
        data.fndesc.typemap = data.fndesc.calltypes = None
        return dumps((name, code, data.fndesc, data.environment, data.signature, data._find_referenced_environments()))

    def _unpack(self, payload: bytes, target_context: LevelContext) -> CompileResult:
        name, code, fndesc, environment, signature, environments = pickle.loads(payload)
        self._environments += environments
        library = target_context.codegen().create_library(name)
        library.is_callee, library._shared_module, library._finalized = True, llvm.parse_bitcode(code), True
        parts = dict.fromkeys(CompileResult._fields)
        parts |= {"library": library, "fndesc": fndesc, "environment": environment, "signature": signature}
        parts["entry_point"] = object()
        parts |= {"typing_context": target_context.typing_context, "target_context": target_context}
        return CompileResult(**(parts | {"lifted": (), "objectmode": False, "reload_init": ()}))


def made_for(generator: LevelCodegen) -> str:
    """Return what code is made by, and for which processors."""
    return ", ".join((MADE_BY, *generator.magic_tuple()))


@cache
def _tell_other_processor(generator: LevelCodegen) -> None:
    """Say so, if the package brings machine code, but for something else than this process."""
    try:
        brought = (SHIPPED / MADE_FOR).read_text(encoding="utf-8")
    except OSError:
        return
    if brought != made_for(generator):
        _tell(
            f"the machine code that came with this package is for {brought}, not for {made_for(generator)}: functions "
            "are compiled when they are first called, which takes minutes once; `o3dleaf warm-up` does it on all cores"
        )


@cache
def _tell_not_kept() -> None:
    """Say once that what is compiled here is lost at the end."""
    _tell(
        "functions are compiled when they are first called, which takes minutes, and cannot be kept for the next time: "
        "neither the package's folder nor the user's cache can be written to; set NUMBA_CACHE_DIR to a folder that can"
    )


def _tell(text: str) -> None:
    if open_journal() is None:
        warnings.warn(text, CodeWarning, stacklevel=2)
    else:
        note(text)


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
