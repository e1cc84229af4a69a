"""What a process of ours does without: modules that a library imports for functions which we never call."""

import sys
from functools import cache
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from types import ModuleType


def import_lightly() -> None:
    """Let libraries import empty modules instead of some: for processes that are ours, the command line's and children.

    What is loaded already stays.
    """
    _import_without_dash()
    _import_without_f2py()
    _import_without_docs()


def _import_without_dash() -> None:
    """Let Open3D do without Dash, the web server of `draw_plotly_server`: a third of a second less to start."""
    if "dash" not in sys.modules:
        empty = ModuleType("dash", "Left out by o3dleaf.")
        vars(empty).update(html=None, dcc=None, Dash=None)
        sys.modules["dash"] = empty


def _import_without_f2py() -> None:
    """Let SciPy, which imports all that NumPy names, do without its compiler of Fortran: a tenth of a second less."""
    import numpy as np  # noqa: PLC0415 - under the guard against interrupts

    if "numpy.f2py" not in sys.modules:
        sys.modules["numpy.f2py"] = vars(np)["f2py"] = ModuleType("numpy.f2py", "Left out by o3dleaf.")


def _import_without_docs() -> None:
    """Let SciPy leave the docstrings of its functions as they are, which it parses and rewrites: a sixth of a second.

    Its other doings with docstrings, in modules that we do not import, get what they ask for.
    """
    name = "scipy._lib._docscrape"
    if name not in sys.modules:
        unparsed = ModuleType(name, "Left out by o3dleaf, but for what is asked for.")
        vars(unparsed).update(FunctionDoc=_Unparsed, __getattr__=lambda asked: getattr(_load_anew(name), asked))
        sys.modules[name] = unparsed


class _Unparsed(dict[str, list[object]]):
    """The docstring of a function, whose sections seem empty; as a text it is what it was, behind a signature."""

    def __init__(self, function: object) -> None:
        super().__init__()
        self.text = function.__doc__ or ""

    def __missing__(self, section: str) -> list[object]:
        return []

    def __str__(self) -> str:
        return f"\n{self.text}"


@cache
def _load_anew(name: str) -> ModuleType:
    """Return a module of which there is another one under its name."""
    package, _, rest = name.rpartition(".")
    spec = PathFinder.find_spec(name, sys.modules[package].__path__)
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError(f"{name}: is not in {package}", name=rest)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
