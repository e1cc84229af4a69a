"""Numba's code generator for a level of processors: vectors, libraries of functions, what is linked into what."""

import itertools
import platform
from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba.core import codegen, config, cpu
from numba.core.environment import lookup_environment

NAME = "o3dleaf"
"""The name of the target."""

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

A fourth, x86-64-v4 (AVX-512), is not worth code of its own: fits and values take as long with it.
"""


@cache
def processor_level() -> tuple[str, str]:
    """Return name and features of the processors that code is made for, as LLVM calls them."""
    machine = platform.machine().lower()
    if machine in {"arm64", "aarch64"}:
        return "generic", ""  # every one has vectors of 128 bits and fused multiplication and addition
    if machine not in {"x86_64", "amd64"}:
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
    is_loaded = False

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, list[str]]]:
        """Return what is kept on disk: machine code and the names that it shows; to link, there is the callee's."""
        self._ensure_finalized()
        module = self._final_module
        named = itertools.chain(module.functions, module.global_variables)
        names = [each.name for each in named if not each.is_declaration and each.linkage != llvm.Linkage.internal]
        return self.name, "object", (self._get_compiled_object(), names)

    @classmethod
    def _unserialize(cls, generator: "LevelCodegen", state: tuple[str, str, tuple[bytes, list[str]]]) -> "LevelLibrary":
        name, _, (code, names) = state
        library = cls(generator, name)
        library.is_loaded = True
        library.enable_object_caching()
        library._set_compiled_object(code)
        library._finalize_final_module()
        generator._engine._defined_symbols.update(names)
        return library

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
        if not self.is_loaded:
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
