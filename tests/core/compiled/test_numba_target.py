"""What is compiled now, what is loaded and what was called before make no difference to a result, and nor do others."""

import os
import shutil
import subprocess
import sys

import llvmlite.binding as llvm
import numpy as np
import pytest
from numba import njit as of_numba

from o3dleaf.core.compiled import code_cache, level_code
from o3dleaf.core.compiled.decorator import njit
from o3dleaf.core.compiled.level_code import LEVELS, NAME, LevelContext, processor_level
from o3dleaf.core.compiled.numba_target import LevelTypes

LOOPS = """
import math
import numpy as np
from o3dleaf.core.compiled.decorator import njit

REASSOCIATE = {"reassoc", "contract", "nsz"}

@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def total(a, b, count):
    s = 0.0
    for i in range(count):
        s += a[i] * b[i]
    return s

@njit(nogil=True, cache=True)
def totals(a, b):
    s = np.empty(len(a))
    for i in range(len(a)):
        s[i] = total(a[i], b[i], a.shape[1])
        for j in range(a.shape[1] // 3):
            s[i] += math.exp(total(a[i], a[j], j)) / 7
    return s

@njit(nogil=True, cache=True)
def fibonacci(n):
    return n if n < 2 else fibonacci(n - 1) + fibonacci(n - 2)

@njit(nogil=True, cache=True)
def argsort(a):  # the name of what it calls, as a function has that calls itself
    order = np.argsort(a, kind="mergesort")
    return fibonacci(15), a[order]
"""

CALLS = """
import sys
import numpy as np
import some_loops as loops
from numba.core import event
a, b = np.random.default_rng(0).random((2, 50, 77))
recorder = event.RecordingListener()
event.register("numba:compile", recorder)
if "callee first" in sys.argv:
    loops.total(b[0], b[1], 77)
parts = [loops.totals(a, b)]
if "all" in sys.argv:
    parts += loops.argsort(a.ravel())
    assert parts[1] == 610 and (parts[2] == np.sort(a, axis=None)).all()
print("|".join(np.asarray(each).tobytes().hex() for each in parts))
missed = sum(sum(f.stats.cache_misses.values()) for f in (loops.total, loops.totals, loops.argsort))
assert bool(recorder.buffer) == bool(missed)
assert ("numba.cpython.setobj" in sys.modules) == bool(missed)  # what is loaded needs nothing of what compiles
print(missed)
"""


def caller(folder):
    """Return a function that calls some loops in a process of its own, and returns results and what it compiled."""

    def run(*words, **environment):
        path = os.pathsep.join([str(folder), *filter(None, sys.path)])
        command = [sys.executable, "-c", CALLS, *words]
        done = subprocess.run(
            command,
            env=os.environ | {"PYTHONPATH": path} | environment,
            cwd=folder,
            capture_output=True,
            text=True,
            check=True,
        )
        bits, compiled = done.stdout.splitlines()
        return bits, int(compiled)

    return run


@pytest.fixture
def call(tmp_path):
    (tmp_path / "some_loops.py").write_text(LOOPS)
    return caller(tmp_path)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A folder with the loops and the code that a first call of them has left, and what that returned."""
    folder = tmp_path_factory.mktemp("compiled")
    (folder / "some_loops.py").write_text(LOOPS)
    bits, compiled = caller(folder)()
    assert compiled == 1
    return folder, bits


@pytest.fixture
def call_again(compiled, tmp_path):
    """Return a function that calls the loops in a copy of that folder, and what the first call returned."""
    shutil.copytree(compiled[0], tmp_path, dirs_exist_ok=True)
    return caller(tmp_path), compiled[1]


@pytest.mark.slow
def test_compiled_loaded_and_called_in_any_order_give_the_same_bits(call, tmp_path):
    compiled, first = call("all")
    for path in tmp_path.rglob("*.callee"):
        path.unlink()  # a wheel brings none
    loaded, second = call("all")
    anew, third = call("all", "callee first", NUMBA_CACHE_DIR=str(tmp_path / "elsewhere"))
    assert (first, second, third) == (2, 0, 3)
    assert compiled == loaded == anew


def test_where_nothing_can_be_written_it_compiles(call, compiled, tmp_path):
    """Numba itself raises at import."""
    (tmp_path / "file").touch()
    hidden = {"HOME": str(tmp_path / "file"), "XDG_CACHE_HOME": str(tmp_path / "file")}
    (tmp_path / "__pycache__").touch()
    assert call(NUMBA_CACHE_DIR="", **hidden) == (compiled[1], 1)


def test_a_file_for_another_source_is_not_loaded(call_again, tmp_path):
    """The name is the same, and a function that is only called has changed."""
    call, _ = call_again
    (tmp_path / "some_loops.py").write_text(LOOPS.replace("/ 7", "/ 9"))
    assert call()[1] == 1


def test_a_file_that_another_numba_wrote_is_not_loaded(call_again, tmp_path):
    call, bits = call_again
    for path in tmp_path.rglob("*.code"):
        path.write_bytes(path.read_bytes().replace(b"Numba 0.6", b"Numba 0.7", 1))
    assert call() == (bits, 1)


def test_a_damaged_file_is_not_loaded(call_again, tmp_path):
    call, bits = call_again
    for path in tmp_path.rglob("*.code"):
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 255
        path.write_bytes(content)
    assert call() == (bits, 1)


def test_a_copy_of_the_folder_is_as_good(call_again):
    """Else none of those before would say anything."""
    call, bits = call_again
    assert call() == (bits, 0)


def product(a, b):
    """Return Σ a b."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


def test_code_is_for_the_level_and_nothing_else_of_this_processor():
    """Functions of others stay for the processor at hand."""
    a = np.arange(5.0)
    fast, of_others = njit(nogil=True, fastmath=True)(product), of_numba(fastmath=True)(product)
    assert fast(a, a) == of_others(a, a) == njit(nogil=True)(product)(a, a) == 30.0
    ours, theirs = (next(iter(f.overloads.values())).library.codegen for f in (fast, of_others))
    assert ours.magic_tuple()[1:] == (os.environ.get("NUMBA_CPU_NAME", processor_level()[0]), ours._tm_features)
    assert ours is not theirs
    if "NUMBA_CPU_NAME" not in os.environ:
        assert theirs.magic_tuple()[1] == llvm.get_host_cpu_name()
        assert "zmm" not in next(iter(fast.inspect_asm().values()))


def test_a_level_is_the_highest_that_the_processor_has(monkeypatch):
    """Each level asks for more than the one below it does not."""
    features = dict.fromkeys({name for needed in LEVELS.values() for name in needed}, True)
    for level, needed in LEVELS.items():
        monkeypatch.setattr(llvm, "get_host_cpu_features", lambda features=features: features)
        monkeypatch.setattr(level_code.platform, "machine", lambda: "x86_64")
        assert processor_level.__wrapped__() == (level, "")
        features = features | dict.fromkeys(needed[:1], False)


def test_no_machine_code_is_made_of_what_is_only_called():
    @njit(nogil=True)
    def inner(x):
        return x + 1

    @njit(nogil=True)
    def outer(x):
        return inner(x)

    assert outer(1) == 2
    assert not inner.overloads
    assert len(inner.callee.overloads) == 1
    assert not next(iter(inner.callee.overloads.values())).library._compiled
    assert inner(1) == 2
    assert len(inner.overloads) == 1


def test_what_is_kept_of_a_function_that_python_calls_is_machine_code_alone(tmp_path, monkeypatch):
    """Its callers link its callee: intermediate code would be read by every process, for nobody."""
    monkeypatch.setattr(code_cache, "_only_folder", tmp_path)

    @njit(nogil=True, cache=True)
    def product(a, b):
        return a * b

    assert product(2, 3) == 6
    library = next(iter(product.overloads.values())).library
    name, kind, (code, names) = library.serialize_using_object_code()
    assert b"BC\xc0\xde" not in code  # how LLVM's bitcode begins
    assert all(each.encode() in code for each in names)
    loaded = type(library)._unserialize(LevelContext(LevelTypes(), NAME).codegen(), (name, kind, (code, names)))
    assert all(loaded.get_pointer_to_function(each) for each in names if "NumbaEnv" not in each)
    with pytest.raises(RuntimeError, match="unfit for linking"):
        loaded._get_module_for_linking()


@njit(nogil=True)
def fibonacci(n):
    """Return the n-th Fibonacci number."""
    return n if n < 2 else fibonacci(n - 1) + fibonacci(n - 2)


@njit(nogil=True)
def two_fibonacci(n):
    """Return twice the n-th Fibonacci number."""
    return 2 * fibonacci(n)


def test_a_function_calls_its_own_copies():
    """A copy that another library could take the place of may have been optimized otherwise."""
    assert two_fibonacci(20) == 2 * fibonacci(20) == 2 * 6765
    module = next(iter(two_fibonacci.overloads.values())).library._final_module
    copies = [function for function in module.functions if "fibonacci" in function.name and not function.is_declaration]
    assert llvm.Linkage.internal in {function.linkage for function in copies}
    assert {function.linkage for function in copies} <= {llvm.Linkage.internal, llvm.Linkage.external}
