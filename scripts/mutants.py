"""Mutants of Python source: every place where one operator, number, condition or call could be another one.

Names are changed as in the literature (Jia and Harman, An analysis and survey of the development of mutation testing,
2011): a mutant that no test notices marks a line that no test holds. Annotations, decorators, docstrings, messages of
errors and what is imported for types alone are left out, as no theorem is about them.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SYMBOLS = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
    ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
    ast.And: ("and", "or"),
    ast.Or: ("or", "and"),
}
"""What stands for an operator, and what is written in its place."""

PAIRS = (("min", "max"), ("minimum", "maximum"), ("any", "all"), ("floor", "ceil"), ("argmin", "argmax"))
CALLS = {**dict(PAIRS), **{second: first for first, second in PAIRS}}
"""Functions that are called in place of one another."""


@dataclass(frozen=True)
class Mutant:
    """One change of one file: bytes from `start` to `stop` become `text`.

    `scope` is the function or class that holds it, or "" for the module itself.
    """

    path: Path
    scope: str
    line: int
    start: int
    stop: int
    text: str

    def source(self) -> bytes:
        """Return the changed source."""
        code = self.path.read_bytes()
        return code[: self.start] + self.text.encode() + code[self.stop :]

    def change(self) -> str:
        """Return the line before and after the change."""
        before, after = (
            code.decode().splitlines()[self.line - 1].strip() for code in (self.path.read_bytes(), self.source())
        )
        return f"{before}  →  {after}"


class Mutations(ast.NodeVisitor):
    """All mutants of a file, in the order of the source."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.code = path.read_bytes()
        self.lines = [0]
        for line in self.code.splitlines(keepends=True):
            self.lines.append(self.lines[-1] + len(line))
        self.scopes: list[str] = []
        self.mutants: list[Mutant] = []
        self.visit(ast.parse(self.code))

    def span(self, node: ast.AST) -> tuple[int, int]:
        """Return where a node begins and ends, in bytes."""
        start = self.lines[node.lineno - 1] + node.col_offset
        return start, self.lines[node.end_lineno - 1] + node.end_col_offset

    def add(self, start: int, stop: int, text: str) -> None:
        """Note a mutant."""
        line = self.code.count(b"\n", 0, start) + 1
        self.mutants.append(Mutant(self.path, ".".join(self.scopes), line, start, stop, text))

    def exchange(self, operator: ast.AST, left: ast.AST, right: ast.AST) -> None:
        """Note that an operator between two nodes could be another one."""
        if type(operator) not in SYMBOLS:
            return
        symbol, other = SYMBOLS[type(operator)]
        start, stop = self.span(left)[1], self.span(right)[0]
        place = self.code.find(symbol.encode(), start, stop)
        self.add(place, place + len(symbol), other)

    def negate(self, test: ast.expr) -> None:
        """Note that a condition could be its contrary."""
        start, stop = self.span(test)
        self.add(start, stop, f"(not ({self.code[start:stop].decode()}))")

    def visit_scope(self, node: ast.FunctionDef | ast.ClassDef) -> None:
        """Visit the body and the defaults of a function or class, not its annotations and decorators."""
        self.scopes.append(node.name)
        defaults = [] if isinstance(node, ast.ClassDef) else [*node.args.defaults, *node.args.kw_defaults]
        for each in (*filter(None, defaults), *node.body):
            self.visit(each)
        self.scopes.pop()

    visit_FunctionDef = visit_ClassDef = visit_scope  # noqa: N815 - ast's names

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def leave_out(self, node: ast.AST) -> None:
        """Leave out messages, and types."""

    visit_Raise = visit_JoinedStr = visit_Assert = visit_Import = visit_ImportFrom = leave_out  # noqa: N815

    def visit_If(self, node: ast.If) -> None:
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            return
        self.negate(node.test)
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self.negate(node.test)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        for operator, left, right in zip(node.ops, [node.left, *node.comparators], node.comparators, strict=False):
            self.exchange(operator, left, right)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        self.exchange(node.op, node.left, node.right)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.exchange(node.op, node.target, node.value)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        for left, right in zip(node.values, node.values[1:], strict=False):
            self.exchange(node.op, left, right)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub | ast.Not):
            start = self.span(node)[0]
            self.add(start, start + len("not" if isinstance(node.op, ast.Not) else "-"), "")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, bool):
            self.add(*self.span(node), str(not node.value))
        elif isinstance(node.value, int):
            self.add(*self.span(node), str(node.value + 1))
        elif isinstance(node.value, float):
            self.add(*self.span(node), str(2 * node.value or 1.0))

    def visit_Call(self, node: ast.Call) -> None:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in CALLS:
            stop = self.span(node.func)[1]
            self.add(stop - len(name), stop, CALLS[name])
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self.add(*self.span(node), "pass")
        self.generic_visit(node)

    def visit_Break(self, node: ast.Break) -> None:
        self.add(*self.span(node), "continue")

    def visit_Continue(self, node: ast.Continue) -> None:
        self.add(*self.span(node), "break")


def mutants_of(path: Path) -> Iterator[Mutant]:
    """Return all mutants of a file."""
    return iter(Mutations(path).mutants)
