"""The source text that a compiled function depends on.

Numba stamps what it keeps with the file of the function alone, and overlooks a change in one that is called from
another file. Here the stamp covers all compiled modules that the file imports, and those that they import.
"""

import hashlib
import importlib.util
import re
from functools import cache
from pathlib import Path

PACKAGE = __name__.partition(".")[0]
IMPORT = re.compile(rf"^from ({PACKAGE}\.[\w.]+_loops) import", re.MULTILINE)
"""An import of a compiled module, which stands on a line of its own: the house's tests hold that."""


@cache
def stamp(*modules: str) -> str:
    """Return a hash of the source texts of modules and of all compiled ones that they import, directly or not."""
    digest = hashlib.sha256()
    for name in sorted(_closure(modules)):
        digest.update(f"{name}\n".encode())
        digest.update(_source(name))
    return digest.hexdigest()


def _closure(modules: tuple[str, ...]) -> set[str]:
    reached, waiting = set(), list(modules)
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += IMPORT.findall(_source(name).decode())
    return reached


@cache
def _source(module: str) -> bytes:
    found = importlib.util.find_spec(module)
    if found is None or found.origin is None:
        raise ModuleNotFoundError(module)
    return Path(found.origin).read_bytes()
