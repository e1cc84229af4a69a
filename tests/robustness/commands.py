"""Rows of commands: each option spoiled by files, outputs, values and company that it cannot have."""

from collections.abc import Iterator
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Any, get_type_hints

from o3dleaf.commands.cli import JOBS
from o3dleaf.core.jobs.option import Option, options_of
from robustness.kinds import READ_PATH_BAD, WRITE_PATH_BAD

GOOD = {
    "demo": {"output": "new"},
    "leaf": {"scan": "good.xyz", "output": "leaf.ply"},
    "reconstruct": {"cloud": "good.xyz", "output": "mesh.ply"},
    "patch": {"volume": "good.tif", "output": "model.o3l"},
    "sample": {"folder": "new"},
    "info": {"file": "good.ply"},
    "qa": {"mesh": "good.ply"},
    "clean": {"mesh": "good.ply", "output": "mesh.ply"},
    "export": {"source": "good.ply", "output": "mesh.stl"},
    "droplet": {"case": "case"},
    "render": {"files": ["good.ply"], "output": "picture.png"},
    "figures": {"output": "new"},
    "batch": {"files": ["good.ply"], "output": "new", "command": "clean"},
    "warm-up": {},
}
"""Options of each command that opens no window, with which it would work."""

FILES = {"ct": "good.tif", "midrib": "good.xyz", "model": "good.o3l", "field": "good.o3l", "cloud": "good.xyz"}
FILES |= {"scan": "good.xyz"}
"""Good files for options that name one to be read."""
OUTPUTS = {"model": "out.o3l", "tile_solid": "tile.ply", "grid": "grid.vti", "picture": "out.png", "html": "out.html"}
OUTPUTS |= {"json": "out.json", "output": "out.ply", "plot": "out.png", "pieces": "out.png"}

NUMBERS = {
    "a NaN": float("nan"),
    "an infinity": float("inf"),
    "minus one": -1.0,
    "1e308": 1e308,
    "text": "furlong",
    "a list": [1.0],
}
WHOLE_NUMBERS = {"minus one": -1, "half": 0.5, "text": "two", "10^30": 10**30}
FOLDERS = {"demo", "sample", "figures"}
"""Commands whose output is a folder."""
WITHOUT_COUNTS = {".xyz", ".csv"}
"""Files that do not say how much they hold: one that ends with a line is whole, for all that can be told."""
POINTS = {"scan", "cloud", "midrib", "files", "file"}
"""Options whose file may be a cloud: a mesh cut off behind its vertices is one."""
ANY_NUMBER = {"shift", "level", "rho"}
"""Options whose numbers are looked at in another place, or may be below zero."""


@dataclass(frozen=True)
class CommandRow:
    """A command with one option spoiled: what `JOBS[command]` is given instead of its good options."""

    command: str
    option: str
    change: str
    value: Any
    company: tuple[tuple[str, Any], ...] = ()

    def __str__(self) -> str:
        return f"{self.command} --{self.option}: {self.change}"

    def given(self, folder: Path) -> dict[str, Any]:
        """Return the options as the command line hands them over, files in a folder."""
        known = options_of(JOBS[self.command])
        named = GOOD[self.command] | dict(self.company) | {self.option: self.value}
        return {name: placed(value, known[name][1], folder) for name, value in named.items()}


def placed(value: Any, known: Option, folder: Path) -> Any:
    """Return the value of an option that names files, in a folder."""
    is_file = known.reads or known.writes is not None or known.text.startswith("Folder")
    if isinstance(value, list) and is_file:
        return [folder / each for each in value]
    return folder / value if is_file and isinstance(value, str) else value


def command_rows() -> Iterator[CommandRow]:
    """Return the rows of all commands."""
    for command in GOOD:
        for name, (_, known) in options_of(JOBS[command]).items():
            if (command, name) != ("batch", "files"):  # what is wrong with one of them is a line of its table
                yield from file_rows(command, name, known)
            yield from value_rows(command, name, known)
            yield from acting_rows(command, name, known)


def file_rows(command: str, name: str, known: Option) -> Iterator[CommandRow]:
    """Return rows of files that cannot be read, or written."""
    suffix = Path(str(GOOD[command].get(name, FILES.get(name, OUTPUTS.get(name, "x.ply"))))).suffix
    suffix = ".ply" if name == "files" else suffix
    if known.reads:
        suffixes = {suffix} | ({".ply", ".stl", ".obj", ".off"} if name in {"mesh", "files", "source"} else set())
        suffixes |= {".ply", ".pcd", ".pts", ".csv"} if name in {"scan", "cloud"} else set()
        for each in sorted(suffixes):
            for change, pattern in READ_PATH_BAD.items():
                if change == "cut off" and (each in WITHOUT_COUNTS or name in POINTS):
                    continue
                value: Any = pattern.format(suffix=each)
                company = company_of(command, name)
                yield CommandRow(command, name, f"{change} {each}", [value] if name == "files" else value, company)
    elif known.writes is not None and command not in FOLDERS:
        for change, pattern in WRITE_PATH_BAD.items():
            if (change, name) not in {("strange suffix", "json"), ("without a suffix", "json")}:
                yield CommandRow(command, name, change, pattern.format(suffix=suffix), company_of(command, name))
    elif known.text.startswith("Folder") and name != "samples":
        for change in ("below a file", "a pipe", "300 letters", "a link to itself"):
            yield CommandRow(command, name, change, WRITE_PATH_BAD[change].format(suffix=""))


def company_of(command: str, name: str) -> tuple[tuple[str, Any], ...]:
    """Return other options that one needs to act."""
    _, known = options_of(JOBS[command])[name]
    needed = {"ct": ("ct", "good.tif"), "scalar": ("scalar", ("curvature",)), "points": ("what", "distance")}
    needed |= {"tile_solid": ("tile_solid", "tile.ply"), "saved_model": ("source", "good.o3l")}
    needed |= {"stored": ("source", "good.o3l"), "grid": ("grid", "grid.vti"), "around": ("around", (0.0, 0.0, 0.0))}
    needed |= {"volume_file": ("file", "good.tif"), "cloud_file": ("file", "good.xyz")}
    needed |= {each: tuple(each.split("=")) for each in known.needs if "=" in each}
    needed |= {"volume": ("ct", "good.tif")} if command in {"leaf", "figures"} else {}
    found = [needed[each] for each in known.needs if each in needed and needed[each][0] in options_of(JOBS[command])]
    return tuple(found[:1]) + ((("ct", "good.tif"),) if ("grid", "grid.vti") in found else ())


def value_rows(command: str, name: str, known: Option) -> Iterator[CommandRow]:
    """Return rows of values that an option cannot have."""
    company = company_of(command, name)
    for change, value in wrong_values(name, known, str(get_type_hints(JOBS[command])[name])).items():
        yield CommandRow(command, name, change, value, company)


def wrong_values(name: str, known: Option, hint: str) -> dict[str, Any]:
    """Return values that an option of a type cannot have."""
    if known.choices or "unit" in name:
        return {repr(word): (word,) if name == "scalar" else word for word in ("furlong", "", "CUBES")}
    if name in ANY_NUMBER or "tuple" in hint:
        return {}
    if "float" in hint:
        return NUMBERS
    if "int" in hint:
        return {change: value for change, value in WHOLE_NUMBERS.items() if (name, change) != ("seed", "10^30")}
    return {"text": "yes"} if "bool" in hint else {}


def acting_rows(command: str, name: str, known: Option) -> Iterator[CommandRow]:
    """Return rows of options that cannot act: without what they need, beside what they exclude."""
    job = JOBS[command]
    value = good_value(command, name, known)
    names = [each.partition("=")[0] for each in known.needs]
    told = any(hasattr(job, each) or each in options_of(job) for each in names)
    if told and command != "figures" and not (command == "patch" and "volume" in known.needs):
        yield CommandRow(command, name, "cannot act alone", value)
    for other in known.unless:
        if other in options_of(job):
            beside = good_value(command, other, options_of(job)[other][1])
            company = (*company_of(command, name), *company_of(command, other), (other, beside))
            yield CommandRow(command, name, f"cannot act with {other}", value, company)


def good_value(command: str, name: str, known: Option) -> Any:
    """Return a value of an option that is not its default."""
    if known.reads:
        return FILES.get(name, "good.ply")
    if known.writes is not None:
        return OUTPUTS[name]
    words = {"level": "50", "rho": "1", "period": "1 1", "flip": "along", "shift": 0.5, "method": "tetrahedra"}
    words |= {"fine": ["1 1 2 2 0.1"], "region": (1.0, 1.0, 2.0, 2.0), "around": (0.0, 0.0, 0.0)}
    words |= {"grid_of": "mask", "ct_unit": "um", "scan_unit": "cm", "unit": "mm", "scalar": ("curvature",)}
    words |= {"bounds": (0.0, 0.0, 0.0, 1.0, 1.0, 1.0), "consumer": "gmsh", "what": "distance", "samples": "new"}
    words |= dict.fromkeys(("crop", "ct_crop"), "0 0 0 1 1 1")
    words |= {"tiles": "wang", "seed": 5, "at": (10.0, 0.0), "down": (1.0, 0.0, 0.0), "landings": 3, "speed": 0.8}
    if name in words:
        return words[name]
    if get_type_hints(JOBS[command])[name] is bool:
        return not options_of(JOBS[command])[name][0].default
    return 5 if name == "triangles" else 0.5


def misused_rows() -> Iterator[tuple[str, ...]]:
    """Return words that are no command line: unknown names, what is missing, what is no number, what is too much."""
    yield from (("furlong",), ("leef", "good.xyz"), ("--furlong",))
    for command in JOBS:
        known = options_of(JOBS[command])
        yield command, "--furlong"
        if not any(
            one.positional and "list" in str(get_type_hints(JOBS[command])[name]) for name, (_, one) in known.items()
        ):
            yield command, *("one", "two", "three"), *(("--output", "x") if "output" in known else ())
        for name, (_, one) in known.items():
            flag = one.flags[0] if one.flags else f"--{name.replace('_', '-')}"
            kind = str(one.kind or get_type_hints(JOBS[command])[name])
            if one.positional or "bool" in kind:
                continue
            yield command, flag
            if "float" in kind or "int" in kind:
                yield command, flag, *["half a furlong"] * max(1, kind.count("float"), kind.count("int"))
        if any(field.default is MISSING for field, _ in known.values()):
            yield (command, "--quiet") if "quiet" in known else (command,)
