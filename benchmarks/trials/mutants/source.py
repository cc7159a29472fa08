"""Source files of a product: where they are, where their nodes stand, how many lines are code."""

from __future__ import annotations

import ast
import io
import os
import tokenize
from collections.abc import Iterator, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Protocol

#: Folders of the product; links between them are not followed.
PRODUCT = ("base", "tables", "geometry", "fem", "studies", "reports", "tympan")
_NO_CODE = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
            tokenize.ENCODING, tokenize.ENDMARKER)


def product_files(tree: Path, product: Sequence[str] = PRODUCT) -> list[str]:
    """Python files of the product, by their paths from the root of the tree.

    ``product``: folders, and files.
    """
    files = {top for top in product if (tree / top).is_file()}
    return sorted(files | {(Path(folder) / name).relative_to(tree).as_posix()
                           for top in product for folder, _, names in os.walk(tree / top)
                           for name in names if name.endswith(".py")})


class _Placed(Protocol):
    lineno: int
    col_offset: int
    end_lineno: int | None
    end_col_offset: int | None


class Places:
    """Places of nodes, in bytes from the start of a file."""

    def __init__(self, source: bytes) -> None:
        self._starts = [0, *accumulate(map(len, source.splitlines(keepends=True)))]

    def start(self, node: _Placed) -> int:
        """Where a node starts."""
        return self._starts[node.lineno - 1] + node.col_offset

    def end(self, node: _Placed) -> int:
        """Where it ends."""
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._starts[node.end_lineno - 1] + node.end_col_offset


def is_docstring(node: ast.stmt) -> bool:
    """Whether a statement is nothing but a text."""
    return (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str))


def _docstring_lines(tree: ast.Module) -> Iterator[int]:
    for node in ast.walk(tree):
        if isinstance(node, ast.stmt) and is_docstring(node):
            yield from range(node.lineno, (node.end_lineno or node.lineno) + 1)


def code_lines(source: bytes) -> int:
    """Count of lines with code: no blank ones, comments or docstrings."""
    lines = {line for token in tokenize.tokenize(io.BytesIO(source).readline)
             if token.type not in _NO_CODE for line in range(token.start[0], token.end[0] + 1)}
    return len(lines.difference(_docstring_lines(ast.parse(source))))
