"""Blocks of a source file, each with a line in front of it that records its first run.

A block is a list of statements in a function, or a part of one behind a branch or a loop, or the
body of a lambda. The line is ``if __blocks__[7]: __block__(7)``; it costs some 30 ns.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from types import CodeType

from benchmarks.trials.mutants.source import Places, is_docstring

#: Statements after which a block may not go on.
_LEAVING = (ast.If, ast.For, ast.AsyncFor, ast.While, ast.Try, ast.Match, ast.With, ast.AsyncWith)
_LISTS = ("body", "orelse", "finalbody")


@dataclass(frozen=True)
class Block:
    """Where a block stands in a file, in bytes."""

    start: int
    end: int


def instrument(source: bytes, file: str, first: int) -> tuple[CodeType, list[Block]]:
    """Code of a module that records its blocks, numbered from ``first``, and the blocks."""
    transformer = _Recording(source, first)
    tree = ast.fix_missing_locations(transformer.visit(ast.parse(source)))
    return compile(tree, file, "exec", dont_inherit=True), transformer.blocks


def block_at(blocks: list[Block], start: int) -> int | None:
    """Number of the smallest block around a place; None where the code runs at import."""
    around = [(block.end - block.start, number) for number, block in enumerate(blocks)
              if block.start <= start < block.end]
    return min(around)[1] if around else None


class _Recording(ast.NodeTransformer):
    def __init__(self, source: bytes, first: int) -> None:
        self.blocks: list[Block] = []
        self._places = Places(source)
        self._first = first
        self._inside = False

    def _block(self, start: int, end: int) -> tuple[ast.expr, ast.expr]:
        """What asks whether a new block is still to be recorded, and what records it."""
        number = self._first + len(self.blocks)
        self.blocks.append(Block(start, end))
        asked, call = (ast.parse(text.format(number), mode="eval").body
                       for text in ("__blocks__[{}]", "__block__({})"))
        return asked, call

    def _recorded(self, body: list[ast.stmt], start: int | None = None) -> Iterator[ast.stmt]:
        """A list of statements with the lines that record its blocks.

        The first block may start before its first statement.
        """
        behind = 0
        ordinals = []
        for statement in body:
            ordinals.append(behind)
            behind += isinstance(statement, _LEAVING)
        for ordinal, pairs in groupby(zip(ordinals, body, strict=True), key=lambda pair: pair[0]):
            block = [statement for _, statement in pairs]
            begin = self._places.start(block[0]) if ordinal or start is None else start
            asked, call = self._block(begin, self._places.end(block[-1]))
            line = ast.If(asked, [ast.Expr(call)], [])
            for node in ast.walk(line):
                ast.copy_location(node, block[0])
            if not ordinal and is_docstring(block[0]) and start is not None:
                yield block.pop(0)
            yield line
            yield from block

    def generic_visit(self, node: ast.AST) -> ast.AST:
        super().generic_visit(node)
        if self._inside:
            for name in _LISTS:
                body = getattr(node, name, None)
                if isinstance(body, list) and body:
                    setattr(node, name, list(self._recorded(body)))
        return node

    def visit_Module(self, node: ast.Module) -> ast.AST:
        return self._outside(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        return self._outside(node)

    def _outside(self, node: ast.AST) -> ast.AST:
        before, self._inside = self._inside, False
        super().generic_visit(node)
        self._inside = before
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        before, self._inside = self._inside, True
        super().generic_visit(node)
        self._inside = before
        node.body = list(self._recorded(node.body, self._places.start(node)))
        return node

    def visit_AsyncFunctionDef(self, node: ast.AsyncFunctionDef) -> ast.AST:
        return self.visit_FunctionDef(node)  # type: ignore[arg-type]

    def visit_Lambda(self, node: ast.Lambda) -> ast.AST:
        super().generic_visit(node)
        asked, call = self._block(self._places.start(node.body), self._places.end(node.body))
        # Neither is true, so that the value is that of the body.
        record = ast.BoolOp(ast.And(), [asked, call])
        body = ast.BoolOp(ast.Or(), [record, node.body])
        for part in (*ast.walk(record), body):
            ast.copy_location(part, node.body)
        node.body = body
        return node
