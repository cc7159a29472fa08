"""Every change that can be made in a source file, by kind."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from benchmarks.trials.mutants.source import Places, is_docstring

KINDS = ("operator", "constant", "branch", "swapped arguments", "dropped line")

#: What stands in an operator's place.
_OPERATORS: dict[type[ast.AST], tuple[str, tuple[str, ...]]] = {
    ast.Add: ("+", ("-",)), ast.Sub: ("-", ("+",)), ast.Mult: ("*", ("/",)),
    ast.Div: ("/", ("*",)), ast.FloorDiv: ("//", ("/",)), ast.Mod: ("%", ("//",)),
    ast.Pow: ("**", ("*",)), ast.MatMult: ("@", ("*",)), ast.BitAnd: ("&", ("|",)),
    ast.BitOr: ("|", ("&",)),
    ast.Lt: ("<", ("<=", ">=")), ast.LtE: ("<=", ("<", ">")), ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")), ast.Eq: ("==", ("!=",)), ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)), ast.IsNot: ("is not", ("is",)), ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)), ast.And: ("and", ("or",)), ast.Or: ("or", ("and",)),
}
#: Functions whose first two arguments may be swapped without a difference.
_SYMMETRIC = {"max", "min", "maximum", "minimum", "hypot", "isclose", "allclose", "array_equal",
              "broadcast_shapes", "isinstance"}
#: Methods whose result is for a developer's eye.
_UNCHANGED = {"__repr__", "__str__"}
_COMMENT = re.compile(rb"#[^\n]*")


@dataclass(frozen=True)
class Change:
    """A text in place of another, from a byte of a file on, in a function."""

    kind: str
    function: str
    start: int
    old: str
    new: str


def changes(source: bytes) -> list[Change]:
    """Every possible change of a file, in its functions and in the defaults of fields.

    Docstrings, annotations, imports, texts with values in them, and what is raised stay as they
    are, as does a line with ``# pragma``.
    """
    finder = _Finder(source)
    finder.visit(ast.parse(source))
    kept = [match.span() for match in re.finditer(rb"^.*# pragma.*$", source, re.MULTILINE)]
    return [change for change in finder.found
            if not any(first <= change.start < last for first, last in kept)]


class _Finder(ast.NodeVisitor):
    """Walk through a module; ``_bound`` are the names a function has bound so far."""

    def __init__(self, source: bytes) -> None:
        self.found: list[Change] = []
        self._source = source
        self._places = Places(source)
        self._scope: list[str] = []
        self._bound: set[str] = set()

    def _add(self, kind: str, start: int, end: int, new: str) -> None:
        old = self._source[start:end].decode()
        if new != old:
            self.found.append(Change(kind, ".".join(self._scope), start, old, new))

    def _text(self, node: ast.expr) -> str:
        return self._source[self._places.start(node):self._places.end(node)].decode()

    # Where code is

    def visit_Module(self, node: ast.Module) -> None:
        self._definitions(node.body)

    def _definitions(self, body: Iterable[ast.stmt]) -> None:
        for statement in body:
            if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                self.visit(statement)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        self._scope.append(node.name)
        for statement in node.body:
            if isinstance(statement, ast.AnnAssign) and statement.value is not None:
                self._scope.append(ast.unparse(statement.target))
                self.visit(statement.value)
                self._scope.pop()
        self._definitions(node.body)
        self._scope.pop()

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        if node.name in _UNCHANGED:
            return
        self._scope.append(node.name)
        outside, self._bound = self._bound, {argument.arg for argument in ast.walk(node.args)
                                             if isinstance(argument, ast.arg)}
        for default in [*node.args.defaults, *node.args.kw_defaults]:
            if default is not None:
                self.visit(default)
        for statement in node.body:
            self.visit(statement)
        self._bound = outside
        self._scope.pop()

    visit_AsyncFunctionDef = visit_FunctionDef

    def visit_Lambda(self, node: ast.Lambda) -> None:
        self.visit(node.body)

    # What stays as it is

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Nothing in it: it is a text, and old Pythons do not know where its values stand."""

    def visit_Raise(self, node: ast.Raise) -> None:
        """Nothing in it: it is a message."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        self._drop(node, [node.target])
        if node.value is not None:
            self.visit(node.value)

    # Operators

    def _operator(self, operator: ast.AST, left: ast.AST, right: ast.AST, suffix: str = "") -> None:
        """Replace what stands between two operands."""
        if type(operator) not in _OPERATORS:
            return
        sign, others = _OPERATORS[type(operator)]
        begin = self._places.end(left)  # type: ignore[arg-type]
        between = self._source[begin:self._places.start(right)]  # type: ignore[arg-type]
        between = _COMMENT.sub(lambda comment: b" " * len(comment[0]), between)
        place = re.search(rb"\s+".join(map(re.escape, (sign + suffix).encode().split())), between)
        if place is not None:
            for other in others:
                self._add("operator", begin + place.start(), begin + place.end(), other + suffix)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if not any(map(_is_text, (node.left, node.right))):
            self._operator(node.op, node.left, node.right)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._operator(node.op, left, right)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        operands = [node.left, *node.comparators]
        for operator, left, right in zip(node.ops, operands, operands[1:], strict=False):
            self._operator(operator, left, right)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        sign = {ast.USub: "-", ast.Not: "not"}.get(type(node.op))
        if sign:
            start = self._places.start(node)
            self._add("operator", start, start + len(sign), "")
        self.generic_visit(node)

    # Constants

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if type(value) in (int, float, complex):
            for other in dict.fromkeys((value + 1, 2 * value, -value)):  # type: ignore[operator]
                if other != value:
                    text = repr(other)
                    self._add("constant", self._places.start(node), self._places.end(node),
                              f"({text})" if text.startswith("-") else text)

    # Branches

    def _branch(self, test: ast.expr, *others: str) -> None:
        for other in (f"not ({self._text(test)})", *others):
            self._add("branch", self._places.start(test), self._places.end(test), other)

    def visit_If(self, node: ast.If | ast.While) -> None:
        self._branch(node.test, "False")
        self.generic_visit(node)

    visit_While = visit_If

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._branch(node.test)
        self.generic_visit(node)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for test in node.ifs:
            self._branch(test)
        self.generic_visit(node)

    # Swapped arguments

    def visit_Call(self, node: ast.Call) -> None:
        name = ast.unparse(node.func).rpartition(".")[2]
        if name not in _SYMMETRIC:
            for left, right in zip(node.args, node.args[1:], strict=False):
                if not any(isinstance(argument, ast.Starred) for argument in (left, right)):
                    begin, end = self._places.end(left), self._places.start(right)
                    between = self._source[begin:end].decode()
                    self._add("swapped arguments", self._places.start(left),
                              self._places.end(right),
                              self._text(right) + between + self._text(left))
        if name == "isinstance":  # its second argument is a type
            self.visit(node.args[0])
        else:
            self.generic_visit(node)

    # Dropped lines

    def _drop(self, node: ast.stmt, targets: Sequence[ast.expr]) -> None:
        """Drop a statement without which every name is still bound."""
        names = {name.id for target in targets for name in ast.walk(target)
                 if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)}
        if names <= self._bound and not any(
                isinstance(part, ast.Yield | ast.YieldFrom | ast.Await) for part in ast.walk(node)):
            self._add("dropped line", self._places.start(node), self._places.end(node), "pass")
        self._bound |= names

    def visit_Expr(self, node: ast.Expr) -> None:
        if is_docstring(node):
            return
        if isinstance(node.value, ast.Call):
            self._drop(node, [])
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        self._drop(node, node.targets)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._drop(node, [])
        if not _is_text(node.value):
            self._operator(node.op, node.target, node.value, "=")
        self.generic_visit(node)

    def visit_For(self, node: ast.For) -> None:
        self._bound |= {name.id for name in ast.walk(node.target) if isinstance(name, ast.Name)}
        self.generic_visit(node)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str))
