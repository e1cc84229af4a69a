"""Kinds of arguments: what is a good one, and what a user may hand over instead.

Of each kind there is a good value, taken from the `World`, and three tables of others, each a function of the good
one by a name: `bad`, which must be refused; `odd`, which may be refused or answered; `same`, other forms of the same
value, which must be answered alike.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

Change = Callable[[Any], Any]


@dataclass(frozen=True)
class Kind:
    """A kind of argument: `good(world)` is one that is answered, the tables hold others by name."""

    good: Callable[[Any], Any]
    bad: Mapping[str, Change] = field(default_factory=dict)
    odd: Mapping[str, Change] = field(default_factory=dict)
    same: Mapping[str, Change] = field(default_factory=dict)
    given: bool = True

    def like(self, good: Any) -> "Kind":
        """Return the kind with another good value, given as such or as a function of the world."""
        return replace(self, good=good if callable(good) else lambda _: good)

    def but(self, *names: str) -> "Kind":
        """Return the kind whose values of these names may be answered as well."""
        moved = {name: self.bad[name] for name in names}
        return replace(self, bad={k: v for k, v in self.bad.items() if k not in moved}, odd={**self.odd, **moved})

    @property
    def later(self) -> "Kind":
        """The kind of an argument that is looked at where it is used."""
        return self.but(*self.bad)

    def without(self, *names: str) -> "Kind":
        """Return the kind without the values of these names."""

        def kept(changes: Mapping[str, Change]) -> dict[str, Change]:
            return {name: change for name, change in changes.items() if name not in names}

        return replace(self, bad=kept(self.bad), odd=kept(self.odd), same=kept(self.same))

    @property
    def optional(self) -> "Kind":
        """The kind of an argument that may be left out or be None, and is left out where another is tried."""
        return replace(self.without("None"), given=False)


def always(**values: Any) -> dict[str, Change]:
    """Return changes to fixed values, by their names with blanks for underscores."""
    return {name.replace("_", " "): lambda _, value=value: value for name, value in values.items()}


def put(value: float) -> Change:
    """Return the change that puts a value into the middle of a copy of an array."""

    def change(array: Any) -> Any:
        made = np.array(array, dtype=float)
        made.flat[made.size // 2] = value
        return made

    return change


def times(factor: float) -> Change:
    """Return the change that multiplies an array."""
    return lambda array: np.asarray(array) * factor


FOREIGN = always(None_=None, an_object=object(), a_dict={"a": 1}, bytes=b"mm", a_function=len)
FOREIGN = {name.strip(): change for name, change in FOREIGN.items()}
"""What is of no kind at all."""
TEXT = always(text="furlong", empty_text="", text_with_a_NUL="a\0b")

ARRAY_BAD: dict[str, Change] = {
    **FOREIGN,
    **TEXT,
    "a NaN": put(np.nan),
    "an infinity": put(np.inf),
    "minus infinity": put(-np.inf),
    "complex": lambda a: np.asarray(a) * 1j,
    "ragged": lambda a: [[1.0, 2.0, 3.0], [1.0, 2.0]],
    "words": lambda a: np.full(np.shape(a), "x"),
    "objects": lambda a: np.full(np.shape(a), object()),
    "dates": lambda a: np.asarray(a, dtype=float).astype("datetime64[s]"),
    "masked": lambda a: np.ma.masked_array(a, np.arange(np.size(a)).reshape(np.shape(a)) == 0),
    "a scalar": lambda a: 3.0,
    "one dimension more": lambda a: np.asarray(a)[None, None],
    "a set": lambda a: {1.0, 2.0},
}


def frozen(array: Any) -> Any:
    made = np.array(array, dtype=float)
    made.setflags(write=False)
    return made


SAME: dict[str, Change] = {
    "a list": lambda a: np.asarray(a).tolist(),
    "single precision": lambda a: np.asarray(a, dtype=np.float32),
    "big-endian": lambda a: np.asarray(a, dtype=">f8"),
    "by columns": np.asfortranarray,
    "every second row": lambda a: np.repeat(np.asarray(a), 2, axis=0)[::2],
    "read-only": frozen,
    "backwards twice": lambda a: np.asarray(a)[::-1].copy()[::-1],
    "long double": lambda a: np.asarray(a, dtype=np.longdouble),
}


def on_a_line(points: Any) -> Any:
    return np.linspace(0, 1, len(points))[:, None] * np.ones(np.shape(points)[1])


POINTS_ODD: dict[str, Change] = {
    "none": lambda a: np.empty((0, np.shape(a)[1])),
    "one": lambda a: np.asarray(a)[:1],
    "two": lambda a: np.asarray(a)[:2],
    "three": lambda a: np.asarray(a)[:3],
    "all equal": lambda a: np.repeat(np.asarray(a)[:1], len(a), axis=0),
    "on a line": on_a_line,
    "all twice": lambda a: np.repeat(np.asarray(a), 2, axis=0),
    "flat": lambda a: np.asarray(a) * ([1.0] * (np.shape(a)[1] - 1) + [0.0]),
    "in half precision": lambda a: np.asarray(a, dtype=np.float16),
    "whole numbers": lambda a: np.rint(10 * np.asarray(a)).astype(int),
    "truths": lambda a: np.asarray(a) > 0,
    "times 1e-12": times(1e-12),
    "times 1e12": times(1e12),
    "times 1e-40": times(1e-40),
    "times 1e40": times(1e40),
    "far away": lambda a: np.asarray(a) + 1e9,
}
POINTS_BAD: dict[str, Change] = {
    **ARRAY_BAD,
    "times 1e154": times(1e154),
    "times 1e300": times(1e300),
    "times 1e-200": times(1e-200),
    "a column more": lambda a: np.column_stack([a, np.ones(len(a))]),
    "a column less": lambda a: np.asarray(a)[:, :-1],
    "flat list of them": lambda a: np.asarray(a).ravel(),
    "a path": lambda a: "cloud.ply",
}

CLOUD = Kind(lambda w: w.points, POINTS_BAD, POINTS_ODD, SAME)
POINTS = CLOUD
QUERIES = Kind(
    lambda w: w.queries,
    {k: v for k, v in POINTS_BAD.items() if not k.startswith("times")},
    {**POINTS_ODD, **{k: v for k, v in POINTS_BAD.items() if k.startswith("times")}},
    SAME,
)
VALUES = Kind(
    lambda w: w.values,
    {
        **ARRAY_BAD,
        "one less": lambda a: np.asarray(a)[:-1],
        "none": lambda a: np.empty(0),
    },
    {
        "all zero": lambda a: np.zeros(np.shape(a)),
        "all equal": lambda a: np.ones(np.shape(a)),
        "below zero": lambda a: -np.abs(np.asarray(a, dtype=float)),
        "times 1e154": times(1e154),
        "times 1e308": times(1e308),
        "times 1e-200": times(1e-200),
    },
    SAME,
)
MORE_VALUES = VALUES.but("one dimension more")
NORMALS = Kind(
    lambda w: w.normals,
    {
        **{k: v for k, v in POINTS_BAD.items() if not k.startswith("times")},
        "all zero": times(0.0),
        "one less": lambda a: np.asarray(a)[:-1],
    },
    {
        "times 1e154": times(1e154),
        "times 1e-200": times(1e-200),
        "turned around": times(-1.0),
        "all alike": lambda a: np.repeat(np.asarray(a)[:1], len(a), axis=0),
    },
    SAME,
)
VECTOR = Kind(
    lambda w: (0.0, 0.0, 1.0),
    {
        **ARRAY_BAD,
        "of four": lambda a: (1.0, 2.0, 3.0, 4.0),
        "of one": lambda a: (1.0,),
        "none": lambda a: (),
    },
    {"all zero": lambda a: (0.0, 0.0, 0.0), "times 1e154": times(1e154), "times 1e-200": times(1e-200)},
    {k: SAME[k] for k in ("a list", "single precision", "big-endian", "read-only")},
)
BOX = Kind(
    lambda w: np.array([[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]]),
    {
        **{k: v for k, v in POINTS_BAD.items() if not k.startswith("times")},
        "upside down": lambda a: np.asarray(a)[::-1],
        "one corner": lambda a: np.asarray(a)[:1],
    },
    {
        "times 1e154": times(1e154),
        "times 1e-200": times(1e-200),
        "elsewhere": lambda a: np.asarray(a) + 1000.0,
        "without width": lambda a: np.asarray(a) * [1.0] * (np.arange(np.shape(a)[1]) > 0),
    },
    {k: SAME[k] for k in ("a list", "single precision", "big-endian", "read-only", "by columns")},
)


@dataclass(frozen=True)
class Carrier:
    """Points and normals, as a cloud of Open3D has them, but any."""

    points: Any
    normals: Any


def with_normals(kind: Kind) -> Kind:
    """Return the kind of clouds that are changed as those of `kind`, and have normals."""

    def carried(changes: Mapping[str, Change]) -> dict[str, Change]:
        return {
            name: lambda cloud, change=change: Carrier(change(cloud.points), cloud.normals[: np.size(cloud.points)])
            for name, change in changes.items()
        }

    good = lambda w: Carrier(w.points, w.normals)  # noqa: E731
    return replace(kind, good=good, bad=carried(kind.bad), odd=carried(kind.odd), same=carried(kind.same))


def single_of(number: float) -> Any:
    """Return a number in single precision, if that is the same number."""
    single = np.float32(number)
    return single if float(single) == number else number


NUMBER = Kind(
    lambda w: 0.5,
    {
        **FOREIGN,
        **TEXT,
        "NaN": lambda x: np.nan,
        "a number as text": lambda x: "0.5",
        "complex": lambda x: 1j,
        "two numbers": lambda x: [1.0, 2.0],
        "a class": lambda x: float,
    },
    {
        "infinity": lambda x: np.inf,
        "minus infinity": lambda x: -np.inf,
        "1e308": lambda x: 1e308,
        "1e-308": lambda x: 1e-308,
        "a denormal": lambda x: 5e-324,
        "1e154": lambda x: 1e154,
        "1e-200": lambda x: 1e-200,
        "zero": lambda x: 0.0,
        "minus one": lambda x: -1.0,
        "true": lambda x: True,
        "huge whole": lambda x: 10**400,
    },
    {
        "of NumPy": np.float64,
        "single": single_of,
        "0-d": lambda x: np.array(float(x)),
    },
)
SIZE = NUMBER.but()
SIZE = replace(
    SIZE,
    bad={**NUMBER.bad, **{name: NUMBER.odd[name] for name in ("minus one", "minus infinity")}},
    odd={name: change for name, change in NUMBER.odd.items() if name not in {"minus one", "minus infinity"}},
)
"""A number of at least zero."""
LENGTH = replace(
    SIZE,
    bad={**SIZE.bad, **{name: NUMBER.odd[name] for name in ("zero", "infinity", "huge whole")}},
    odd={name: change for name, change in SIZE.odd.items() if name not in {"zero", "infinity", "huge whole"}},
)
"""A finite number above zero."""
STEP = LENGTH.but("two numbers")
WHOLE = Kind(
    lambda w: 3,
    {
        **{k: v for k, v in NUMBER.bad.items() if k != "a number as text"},
        "half": lambda x: 2.5,
        "a number as text": lambda x: "3",
        "infinity": lambda x: np.inf,
    },
    {
        "zero": lambda x: 0,
        "minus one": lambda x: -1,
        "true": lambda x: True,
        "10^9": lambda x: 10**9,
        "10^30": lambda x: 10**30,
        "-10^30": lambda x: -(10**30),
    },
    {"of NumPy": np.int64, "small": np.int16},
)
FLAG = Kind(
    lambda w: False,
    {**FOREIGN, **TEXT, "yes": lambda x: "yes", "no": lambda x: "no", "two": lambda x: 2, "NaN": lambda x: np.nan},
    {"zero": lambda x: 0, "one": lambda x: 1},
    {"of NumPy": np.bool_},
)
WORD = Kind(
    lambda w: "cubes",
    {**FOREIGN, **TEXT, "a number": lambda x: 3, "a list": lambda x: [x], "upper case": lambda x: str(x).upper() + "X"},
    {},
    {},
)
TITLE = Kind(
    lambda w: "a title",
    FOREIGN | {"a number": lambda x: 3},
    {
        **TEXT,
        "half a formula": lambda x: r"$\frac{$",
        "a percent sign": lambda x: "100 % $5 {x} <b>",
        "lines": lambda x: "a\nb",
        "Chinese": lambda x: "葉",
        "long": lambda x: "x" * 5000,
        "a lone surrogate": lambda x: "a\udc80b",
    },
    {},
)
UNIT = WORD.like("mm")
OBJECT_BAD: dict[str, Change] = {
    **FOREIGN,
    "text": lambda x: "furlong",
    "a number": lambda x: 3,
    "a list": lambda x: [x],
    "an array": lambda x: np.zeros((5, 3)),
    "its class": type,
    "an error": lambda x: ValueError("x"),
}
OBJECT = Kind(lambda w: None, OBJECT_BAD)
CALLABLE = Kind(
    lambda w: None,
    {**{k: v for k, v in FOREIGN.items() if k != "a function"}, "text": lambda x: "furlong", "a number": lambda x: 3},
    {},
)


class NoField:
    """A field whose answers are wrong."""

    unit = None
    columns = None

    def __init__(self, answer: Callable[[Any], Any], bounds: Any = ((-1, -1, -1), (1, 1, 1))) -> None:
        self.answer, self.bounds = answer, bounds if bounds is None else np.array(bounds, dtype=float)

    def __call__(self, points: Any) -> Any:
        return self.answer(points)

    def gradient(self, points: Any) -> Any:
        return np.ones(np.shape(points))


FIELD = Kind(
    lambda w: w.ball,
    OBJECT_BAD
    | {
        "answers NaN": lambda f: NoField(lambda p: np.full(len(p), np.nan)),
        "answers infinity": lambda f: NoField(lambda p: np.full(len(p), np.inf)),
        "answers None": lambda f: NoField(lambda p: None),
        "answers columns": lambda f: NoField(lambda p: np.ones((len(p), 2))),
        "answers one number": lambda f: NoField(lambda p: 1.0),
        "answers words": lambda f: NoField(lambda p: ["x"] * len(p)),
    },
    {
        "without bounds": lambda f: NoField(lambda p: np.linalg.norm(p, axis=1) - 0.5, None),
        "bounds of NaN": lambda f: NoField(lambda p: np.linalg.norm(p, axis=1) - 0.5, np.full((2, 3), np.nan)),
        "constant": lambda f: NoField(lambda p: np.ones(len(p))),
    },
)


def pair(change: Change, which: int) -> Change:
    """Return the change of one part of a mesh (vertices, triangles)."""

    def changed(mesh: Any) -> Any:
        parts = [*mesh]
        parts[which] = change(parts[which])
        return tuple(parts)

    return changed


CORNERS_BAD: dict[str, Change] = {
    "missing vertex": lambda t: np.vstack([t, [[0, 1, 10**6]]]),
    "vertex below zero": lambda t: np.vstack([t, [[0, 1, -1]]]),
    "fractions": lambda t: np.asarray(t) + 0.5,
    "quads": lambda t: np.column_stack([t, t[:, :1]]),
    "NaN corners": lambda t: np.where(np.arange(np.size(t)).reshape(np.shape(t)) == 0, np.nan, t),
    "huge corners": lambda t: np.where(np.arange(np.size(t)).reshape(np.shape(t)) == 0, 1e300, t),
    "complex corners": lambda t: np.asarray(t) * 1j,
    "words as corners": lambda t: np.full(np.shape(t), "x"),
    "true or false corners": lambda t: np.asarray(t) > 3,
    "masked corners": lambda t: np.ma.masked_array(t, np.asarray(t) == 0),
    "flat corners": np.ravel,
    "no triangle at all": lambda t: None,
}
MESH = Kind(
    lambda w: w.mesh,
    {
        **FOREIGN,
        "text": lambda m: "furlong",
        "a path": lambda m: "mesh.ply",
        "a number": lambda m: 3,
        "vertices alone": lambda m: m[0],
        "three parts": lambda m: (*m, m[0]),
        "a cloud": lambda m: as_cloud(m[0]),
        **{
            f"vertices: {name}": pair(change, 0)
            for name, change in POINTS_BAD.items()
            if name not in {"an object", "a function", "a path"}
        },
        **{name: pair(change, 1) for name, change in CORNERS_BAD.items()},
    },
    {
        "no triangles": lambda m: (m[0], m[1][:0]),
        "nothing": lambda m: (m[0][:0], m[1][:0]),
        "one triangle": lambda m: (m[0], m[1][:1]),
        "a triangle twice": lambda m: (m[0], np.vstack([m[1], m[1][:1]])),
        "a triangle without area": lambda m: (m[0], np.vstack([m[1], [[0, 0, 1]]])),
        "unused vertices": lambda m: (np.vstack([m[0], m[0] + 9]), m[1]),
        "turned": lambda m: (m[0], m[1][:, ::-1]),
        "half turned": lambda m: (m[0], np.vstack([m[1][::2, ::-1], m[1][1::2]])),
        "cut open": lambda m: (m[0], m[1][5:]),
        "all vertices equal": lambda m: (np.repeat(m[0][:1], len(m[0]), axis=0), m[1]),
        "on a line": lambda m: (on_a_line(m[0]), m[1]),
        "flat": lambda m: (m[0] * [1.0, 1.0, 0.0], m[1]),
        "times 1e-12": lambda m: (m[0] * 1e-12, m[1]),
        "times 1e40": lambda m: (m[0] * 1e40, m[1]),
        "times 1e-40": lambda m: (m[0] * 1e-40, m[1]),
        "far away": lambda m: (m[0] + 1e9, m[1]),
        "three on an edge": lambda m: (m[0], np.vstack([m[1], [[m[1][0, 0], m[1][0, 1], m[1][-1, 2]]]])),
    },
    {
        "lists": lambda m: (m[0].tolist(), m[1].tolist()),
        "whole floats": lambda m: (m[0], m[1].astype(float)),
        "small numbers": lambda m: (m[0].astype(np.float32), m[1].astype(np.uint16)),
        "legacy": lambda m: as_legacy(*m),
    },
)


def as_cloud(points: Any) -> Any:
    import open3d as o3d

    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))


def as_legacy(vertices: Any, triangles: Any) -> Any:
    from o3dleaf.core.mesh_arrays import build_mesh

    return build_mesh(vertices, triangles)


def tuple_of(*good: float, whole: bool = False) -> Kind:
    """Return the kind of some numbers in a row."""
    return Kind(
        lambda w: good,
        {
            **FOREIGN,
            **TEXT,
            "one number": lambda t: good[0],
            "one more": lambda t: (*good, 1),
            "one less": lambda t: good[:-1],
            "a NaN": lambda t: (*good[:-1], np.nan),
            "an infinity": lambda t: (*good[:-1], np.inf),
            "words": lambda t: ("x",) * len(good),
            "nothings": lambda t: (None,) * len(good),
            "complex": lambda t: (1j,) * len(good),
            **({"fractions": lambda t: tuple(each + 0.5 for each in good)} if whole else {}),
        },
        {
            "zeros": lambda t: (0,) * len(good),
            "below zero": lambda t: tuple(-abs(each) for each in good),
            "huge": lambda t: (10**9,) * len(good),
            "backwards": lambda t: good[::-1],
        },
        {"a list": lambda t: list(good), "an array": np.array},
    )


@dataclass(frozen=True)
class Options:
    """Options by name, as an argument with two stars takes them, and good values of all."""

    named: Mapping[str, Any]
    good: Mapping[str, Any]


def named(**kinds: Kind) -> Kind:
    """Return the kind of an argument with two stars: one of its options spoiled at a time, or a name that is none."""

    def good(world: Any) -> Options:
        values = {name: kind.good(world) for name, kind in kinds.items()}
        return Options({name: values[name] for name, kind in kinds.items() if kind.given}, values)

    def put_in(options: Options, name: str, change: Change) -> Options:
        return replace(options, named={**options.named, name: change(options.good[name])})

    def table(which: str) -> dict[str, Change]:
        return {
            f"{name}: {how}": lambda options, name=name, change=change: put_in(options, name, change)
            for name, kind in kinds.items()
            if kind.given or which != "same"
            for how, change in getattr(kind, which).items()
        }

    strange = {"a name that is none": lambda options: replace(options, named={**options.named, "furlong": 1.0})}
    return Kind(good, {**table("bad"), **strange}, table("odd"), table("same"))


READ_PATH_BAD: dict[str, str] = {
    "missing": "missing{suffix}",
    "empty": "empty{suffix}",
    "a folder": "folder",
    "a link to itself": "loop{suffix}",
    "a link to nothing": "nowhere{suffix}",
    "300 letters": "x" * 300 + "{suffix}",
    "below a file": "a file/x{suffix}",
    "foreign text": "words{suffix}",
    "foreign bytes": "noise{suffix}",
    "cut off": "cut{suffix}",
    "a pipe": "pipe{suffix}",
    "without a suffix": "words",
}
WRITE_PATH_BAD: dict[str, str] = {
    "a folder": "folder{suffix}",
    "in no folder": "missing/x{suffix}",
    "a link to itself": "loop{suffix}",
    "300 letters": "x" * 300 + "{suffix}",
    "below a file": "a file/x{suffix}",
    "a pipe": "pipe{suffix}",
    "strange suffix": "x.furlong",
    "without a suffix": "xyz",
    "read-only": "read only{suffix}",
}
PATH_BAD = {
    **FOREIGN,
    **{name: change for name, change in TEXT.items() if name != "text"},
    "a number": lambda p: 3,
    "a list": lambda p: [p],
}


@dataclass(frozen=True)
class Named:
    """A file of a scratch folder, as an argument."""

    pattern: str

    def __call__(self, good: Any) -> Any:
        return good.parent / self.pattern.format(suffix=good.suffix)


def read_from(name: str) -> Kind:
    """Return the kind of a file that is read, `name` of the world's folder."""
    files = {each: Named(pattern) for each, pattern in READ_PATH_BAD.items()}
    return Kind(lambda w: w.file(name), {**PATH_BAD, **files}, {}, {"as text": str})


def folder_at(name: str) -> Kind:
    """Return the kind of a folder that is written into, and made."""
    return written_to(name).without("in no folder", "strange suffix", "without a suffix", "a folder", "as text")


def written_to(name: str) -> Kind:
    """Return the kind of a file that is written, `name` in the world's folder."""
    files = {each: Named(pattern) for each, pattern in WRITE_PATH_BAD.items()}
    return Kind(lambda w: w.target(name), {**PATH_BAD, **files}, {}, {"as text": str})
