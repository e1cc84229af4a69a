"""What the process holds, and the limits that the system, a container or a shell set to it.

Of Linux all of it is known; of other systems the memory that they have, where they say it.
"""

import ctypes
import mmap
import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

PROCESS = Path("/proc/self/status")
MACHINE = Path("/proc/meminfo")
GROUPS = Path("/proc/self/cgroup")
GROUP_ROOT = Path("/sys/fs/cgroup")
VERSIONS = {
    "": ("memory.max", "memory.current", "inactive_file"),
    "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
}
"""Of control groups, version 2 and version 1: where the limit and the use stand, and what of it can be dropped."""
UNLIMITED = 1 << 62
"""Version 1 says it in bytes."""
ARENA, STACK = 64 << 20, 8 << 20
"""Addresses that threads reserve without using them: for an allocator of their own (glibc), and as stack."""
ARENAS = 2
"""Allocators that threads share where addresses are limited."""
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8
"""Of glibc's malloc.h."""
MIN_KEPT, MAX_KEPT = 128 << 10, 32 << 20
"""Bytes that its allocator keeps of what was freed: to begin with, and what it comes to by itself, about."""


class Limit(NamedTuple):
    """A limit of memory.

    Attributes
    ----------
    free : int
        Bytes that are left.
    name : str
        Who set it.
    cure : str
        What raises it.
    """

    free: int
    name: str
    cure: str


def resident() -> int:
    """Return the bytes of memory that the process holds; 0 where the system does not say.

    Pages of mapped files do not count: the system drops them when it needs room.
    """
    held = _fields(PROCESS)
    return held.get("RssAnon", held.get("VmRSS", 0)) + held.get("RssShmem", 0)


def release_pages(array: Any) -> None:
    """Give back the memory that holds parts of a mapped file of which an array is a view: they are read again.

    Of other arrays, of private copies that were written to, and where the system cannot, nothing is done.
    """
    while array is not None:
        base = getattr(array, "base", None)
        if isinstance(base, mmap.mmap):
            if getattr(array, "mode", "c") != "c" and hasattr(mmap, "MADV_DONTNEED"):
                base.madvise(mmap.MADV_DONTNEED)
            return
        array = base


def release_heap() -> None:
    """Give back what was freed and what the allocator keeps for later, where it is glibc's; else nothing is done."""
    if sys.platform == "win32":
        return
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def keep_freed(size: float) -> None:
    """Let the allocator keep about so many bytes of what each thread freed, where it is glibc's.

    By itself it keeps twice as much as the largest array that was ever freed, and of what threads freed at the end of
    their heaps `release_heap` gives nothing back.
    """
    if sys.platform == "win32":
        return
    with suppress(OSError, AttributeError):
        for kind in (M_TRIM_THRESHOLD, M_MMAP_THRESHOLD):
            ctypes.CDLL(None).mallopt(kind, int(min(max(size, MIN_KEPT), MAX_KEPT)))


def hard_limits(threads: int) -> Iterator[Limit]:
    """Yield the limits that end a process, of a shell (``ulimit``) and of control groups.

    Addresses that threads are yet to reserve count as used.
    """
    if sys.platform != "win32":
        import resource  # noqa: PLC0415 - Windows has none

        held = _fields(PROCESS)
        reserved = ARENAS * ARENA + threads * STACK
        for kind, flag, use in ((resource.RLIMIT_AS, "v", "VmSize"), (resource.RLIMIT_DATA, "d", "VmData")):
            most = resource.getrlimit(kind)[0]
            if most != resource.RLIM_INFINITY:
                free = most - held.get(use, 0) - reserved
                yield Limit(free, f"by ulimit -{flag}", f"raise ulimit -{flag}")
    for free in _group_room():
        yield Limit(free, "in the container or job", "ask its scheduler for more")


def spare_addresses() -> None:
    """Let threads share allocators where addresses are limited (``ulimit -v``): each reserves 64 MiB of its own.

    OpenBLAS reserves as much for each core when NumPy is imported: this comes before it.
    """
    if sys.platform == "win32":
        return
    import resource  # noqa: PLC0415 - Windows has none

    if resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY:
        return
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Not every C library has it.
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).mallopt(M_ARENA_MAX, ARENAS)


def limit_memory(room: int) -> None:
    """Let this process take so many bytes more at most, where the system holds it to that; less stays less."""
    held = _fields(PROCESS).get("VmSize")
    if sys.platform == "win32" or held is None:
        return
    import resource  # noqa: PLC0415 - Windows has none

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    limits = [each for each in (soft, hard, held + room) if each != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_AS, (min(limits), hard))


def available() -> Limit | None:
    """Return what the machine has left, or None where it does not say."""
    free = _fields(MACHINE).get("MemAvailable")
    if sys.platform != "win32" and free is None and "SC_PHYS_PAGES" in os.sysconf_names:
        free = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return None if free is None else Limit(free, "on this machine", "close other programs")


def _fields(path: Path) -> dict[str, int]:
    """Return the numbers of a file of lines "name: 12 kB", in bytes where they are such; none where it is not there."""
    try:
        lines = path.read_text().splitlines()
    except OSError:
        return {}
    fields = {}
    for line in lines:
        name, _, text = line.partition(":")
        words = text.split()
        if words and words[0].isdigit():
            fields[name] = int(words[0]) * (1024 if words[1:] == ["kB"] else 1)
    return fields


def _group_room() -> Iterator[int]:
    """Yield the bytes that are left in the control groups of the process, each within the one above it."""
    try:
        lines = GROUPS.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, kinds, path = line.split(":", 2)
        kind = next((each for each in VERSIONS if each in kinds.split(",")), None)
        if kind is None:
            continue
        # In a container the path may be the host's; the container's own group is then the root.
        own = PurePosixPath(path.lstrip("/"))
        for part in (own, *own.parents):
            room = _room_of(GROUP_ROOT / kind / part, *VERSIONS[kind])
            if room is not None:
                yield room


def _room_of(group: Path, limit: str, use: str, droppable: str) -> int | None:
    """Return the bytes that are left in a control group, None where it has no limit."""
    try:
        most, used = (group / limit).read_text().strip(), int((group / use).read_text())
        words = (line.split() for line in (group / "memory.stat").read_text().splitlines())
        cached = next(int(number) for name, number in words if name == droppable)
    except (OSError, ValueError, StopIteration):
        return None
    return None if most == "max" or int(most) >= UNLIMITED else int(most) - used + cached
