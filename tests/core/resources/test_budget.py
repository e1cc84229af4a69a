"""What needs more memory than may be used is refused before the work, with the numbers and the cure."""

import platform
import subprocess
import sys
import threading

import numpy as np
import pytest

from o3dleaf.core.errors import InputError, MemoryBudgetError
from o3dleaf.core.resources import machine
from o3dleaf.core.resources.budget import KEPT, memory_limit, set_memory_limit, usable_memory
from o3dleaf.core.resources.needs import require_resources

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux says what a process holds")
GLIBC = pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")


@LINUX
def test_the_least_of_what_is_stated_and_what_the_shell_allows_holds(monkeypatch):
    import resource

    held = machine.resident()
    with memory_limit(held + 10**9):
        assert usable_memory().free == pytest.approx(10**9, rel=0.1)
        addresses = machine._fields(machine.PROCESS)["VmSize"]
        allowed = {resource.RLIMIT_AS: addresses + 8 * 10**8}
        monkeypatch.setattr(resource, "getrlimit", lambda kind: (allowed.get(kind, resource.RLIM_INFINITY),) * 2)
        assert usable_memory().free < 8 * 10**8
        assert "ulimit -v" in usable_memory().name


@LINUX
def test_little_work_is_refused_too_where_less_was_stated_and_what_is_held_is_told():
    """Where nothing was stated, nobody asks after so little."""
    require_resources(1e6, "work: 1 thing", "do less")
    with (
        memory_limit("1MB"),
        pytest.raises(MemoryBudgetError, match=r"of the 1\.0 MB that were stated, [\d,.]+ [MG]B being"),
    ):
        require_resources(1e6, "work: 1 thing", "do less")
    with memory_limit(machine.resident() + 10**8):
        require_resources(1e6, "work: 1 thing", "do less")


@LINUX
def test_pages_of_a_mapped_file_are_not_held(tmp_path):
    """The system drops them when it needs room; of an array in memory every page is held."""
    size = 64_000_000
    np.zeros(size, dtype=np.uint8).tofile(tmp_path / "file")
    before = machine.resident()
    mapped = np.memmap(tmp_path / "file", dtype=np.uint8, mode="r")
    assert int(mapped.sum()) == 0
    assert machine.resident() - before < size / 4
    copied = mapped.copy()
    assert machine.resident() - before > 0.9 * copied.nbytes


@LINUX
@pytest.mark.parametrize("version", ["", "memory"])
def test_a_container_s_limit_holds_whichever_group_above_sets_it(version, tmp_path, monkeypatch):
    limit, use, droppable = machine.VERSIONS[version]
    group = tmp_path / "root" / version / "outer" / "inner"
    group.mkdir(parents=True)
    for folder, most in ((group, str(1 << 62) if version else "max"), (group.parent, str(3 * 10**8))):
        (folder / limit).write_text(f"{most}\n")
        (folder / use).write_text("200000000\n")
        (folder / "memory.stat").write_text(f"anon 1\n{droppable} 50000000\n")
    (tmp_path / "cgroup").write_text(f"4:{version}:/outer/inner\n")
    monkeypatch.setattr(machine, "GROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(machine, "GROUP_ROOT", tmp_path / "root")
    assert (usable_memory().free, usable_memory().name) == (150_000_000, "in the container or job")


def test_a_limit_holds_where_it_was_stated_and_no_longer(monkeypatch):
    monkeypatch.setattr(machine, "available", lambda: None)
    monkeypatch.setattr(machine, "hard_limits", lambda threads: iter(()))
    monkeypatch.setattr(machine, "resident", lambda: 0)
    require_resources(1e15, "work: 1 thing", "do less")  # nobody says what there is
    with memory_limit("2GB"):
        with memory_limit("1GB"), memory_limit(None), pytest.raises(MemoryBudgetError):
            require_resources(1e9, "work: 1 thing", "do less")
        require_resources(1e9, "work: 1 thing", "do less")
    set_memory_limit("1GB")
    seen = []
    thread = threading.Thread(target=lambda: seen.append(usable_memory().free))
    thread.start()
    thread.join()
    set_memory_limit(None)
    assert seen == [10**9]
    assert usable_memory() is None
    with pytest.raises(InputError, match="2GB"):
        set_memory_limit("much")


@LINUX
def test_pages_of_a_mapped_file_are_given_back_and_read_again(tmp_path):
    values = np.arange(1 << 22, dtype=np.int64)
    np.save(tmp_path / "values.npy", values)
    mapped = np.load(tmp_path / "values.npy", mmap_mode="r").reshape(1 << 11, -1).T
    assert mapped.sum() == values.sum()
    before = machine._fields(machine.PROCESS)["RssFile"]
    machine.release_pages(mapped)
    assert before - machine._fields(machine.PROCESS)["RssFile"] > 0.9 * values.nbytes
    assert mapped.sum() == values.sum()
    written = np.load(tmp_path / "values.npy", mmap_mode="c")
    written[:] = 7
    for other in (written, values, None):
        machine.release_pages(other)
    assert (written == 7).all()


@GLIBC
def test_what_was_freed_and_is_kept_does_not_count_as_held_where_memory_is_stated():
    # Below glibc's threshold of mapping, so that they lie on its heap; the last one keeps the top of it.
    many = [np.ones(1 << 13) for _ in range(1 << 9)]
    size, last = sum(each.nbytes for each in many), many[-1]
    del many
    kept = machine.resident()
    with memory_limit("1TB"):
        free = usable_memory().free
    assert free - (10**12 - kept) > 0.9 * size
    assert last.all()


THREAD_THAT_FREES = """
import threading
import numpy as np
from o3dleaf.core.resources import machine
from o3dleaf.core.resources.budget import memory_limit

def work():
    np.ones({size}, dtype=np.uint8)
    freed.set()
    looked.wait()

freed, looked = threading.Event(), threading.Event()
np.ones({size}, dtype=np.uint8)  # having freed so much, glibc by itself keeps as much
with memory_limit({stated}):
    before = machine.resident()
    thread = threading.Thread(target=work)
    thread.start()
    freed.wait()
    print(machine.resident() - before)
    looked.set()
    thread.join()
"""


@GLIBC
def test_what_a_thread_frees_is_given_back_where_little_memory_is_stated():
    """In a process of its own: beside other tests' threads, what they hold comes and goes."""
    stated, size = 400_000_000, 1 << 24
    program = THREAD_THAT_FREES.format(size=size, stated=stated)
    child = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True, timeout=120)
    assert int(child.stdout) < stated * KEPT < size / 4
