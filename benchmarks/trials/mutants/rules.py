"""Rules of a source file, and how each is switched off or its constant moved far off.

A rule is a constant of a module, or a condition in a function. Where a condition has several parts,
joined by ``and`` or ``or``, each part is a rule of its own. Constants that only bound the cost are
none, nor is a part that compares with ``None``.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

from benchmarks.trials.mutants.kinds import Change
from benchmarks.trials.mutants.source import Places

#: Kinds of such changes.
RULES = ("rule off", "constant far off")

#: A constant is moved by so large a factor, up and down.
_FAR = 1000
#: What the comment above a constant says that decides nothing: it saves time.
_OF_COST = "bound of the cost"


def rules(source: bytes) -> list[Change]:
    """Every change of a rule. Those of one rule have the same function and the same start."""
    finder = _Finder(source)
    finder.visit(ast.parse(source))
    return finder.found


class _Finder(ast.NodeVisitor):
    def __init__(self, source: bytes) -> None:
        self.found: list[Change] = []
        self._source = source
        self._places = Places(source)
        self._lines = source.decode().splitlines()
        self._scope: list[str] = []

    def _add(self, kind: str, node: ast.expr, *others: str) -> None:
        start, end = self._places.start(node), self._places.end(node)
        old = self._source[start:end].decode()
        self.found += [Change(kind, ".".join(self._scope), start, old, other.format(old))
                       for other in others]

    def visit_Module(self, node: ast.Module) -> None:
        for statement in node.body:
            if isinstance(statement, ast.Assign):
                self._constant(statement)
            elif isinstance(statement, ast.FunctionDef | ast.ClassDef):
                self.visit(statement)

    def _constant(self, node: ast.Assign) -> None:
        """Move a number far off; a count becomes none or very many."""
        name, value = node.targets[0], _number(node.value)
        if isinstance(name, ast.Name) and value and not self._saves_time(node.lineno):
            self._scope.append(name.id)
            self._add("constant far off", node.value, f"{_FAR} * ({{}})",
                      "0" if isinstance(value, int) else f"({{}}) / {_FAR}")
            self._scope.pop()

    def _saves_time(self, line: int) -> bool:
        """Whether the comment above a line says that the constant decides nothing."""
        words = list[str]()
        for above in reversed(self._lines[: line - 1]):
            if not above.startswith("#:"):
                break
            words.insert(0, above.removeprefix("#:").strip())
        return _OF_COST in " ".join(words)

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.ClassDef) -> None:
        self._scope.append(node.name)
        self.generic_visit(node)
        self._scope.pop()

    visit_ClassDef = visit_FunctionDef

    def visit_If(self, node: ast.If | ast.IfExp) -> None:
        self._condition(node.test)
        self.generic_visit(node)

    visit_IfExp = visit_If

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for test in node.ifs:
            self._condition(test)
        self.generic_visit(node)

    def visit_Return(self, node: ast.Return) -> None:
        if node.value is not None and _decides(node.value):
            self._condition(node.value)
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        if _decides(node.value):
            self._condition(node.value)
        self.generic_visit(node)

    def _condition(self, node: ast.expr) -> None:
        """Switch a condition off: always or never, or a part of it so that the others decide."""
        for part, neutral in _parts(node):
            if _guards(part):
                continue
            self._add("rule off", part, *((neutral,) if neutral else ("True", "False")))


def _number(node: ast.expr) -> float | None:
    """Value of a plain number or of a quotient of two; else None."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return node.value  # type: ignore[return-value]
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
        above, below = _number(node.left), _number(node.right)
        return above / below if above is not None and below else None
    return None


def _guards(node: ast.expr) -> bool:
    """Whether a condition asks whether there is a thing at all."""
    return isinstance(node, ast.Compare) and any(
        isinstance(other, ast.Constant) and other.value is None for other in node.comparators)


def _decides(node: ast.expr) -> bool:
    """Whether an expression is a comparison, or parts of which all are such."""
    if isinstance(node, ast.BoolOp):
        return any(map(_decides, node.values))
    return isinstance(node, ast.Compare) or (
        isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not))


def _parts(node: ast.expr, neutral: str = "") -> Iterator[tuple[ast.expr, str]]:
    """Parts of a condition, each with what takes it out of the whole; "" for the whole itself."""
    if isinstance(node, ast.BoolOp):
        own = "True" if isinstance(node.op, ast.And) else "False"
        for value in node.values:
            yield from _parts(value, own)
    else:
        yield node, neutral
