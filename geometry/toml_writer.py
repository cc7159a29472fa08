"""Nested tables as TOML text."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

Content = Mapping[str, Any]


def toml(content: Content) -> str:
    """Nested tables as TOML text; lists of tables become arrays of tables.

    Examples
    --------
    >>> print(toml({"name": "a", "frame": {"axes": ["1 m", 2.0]}}))
    name = "a"
    <BLANKLINE>
    [frame]
    axes = ["1 m", 2.0]
    <BLANKLINE>
    """
    return "\n".join(_lines(content, "")) + "\n"


def _lines(content: Content, path: str) -> Iterator[str]:
    inner = {key: value for key, value in content.items() if _is_table(value)}
    for key, value in content.items():
        if key not in inner:
            yield f"{key} = {_value(value)}"
    for key, value in inner.items():
        where = f"{path}.{key}" if path else key
        for entry in [value] if isinstance(value, Mapping) else value:
            yield ""
            yield f"[{where}]" if isinstance(value, Mapping) else f"[[{where}]]"
            yield from _lines(entry, where)


def _is_table(value: Any) -> bool:
    return isinstance(value, Mapping) or (isinstance(value, list) and bool(value)
                                          and isinstance(value[0], Mapping))


def _value(value: Any) -> str:
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Sequence):
        return f"[{', '.join(map(_value, value))}]"
    return repr(float(value))
