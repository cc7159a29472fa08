"""Keys, kinds, units and meanings of ``--json`` and result files, and their JSON Schemas.

For results that are dataclasses they are the type and the ``Key`` of each field; for others they
are in schema.toml. There ``[part.NAME]`` lists keys that several objects share: a kind "object:
NAME, NAME" has these keys too, and so has every path given with ``below``.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from pkgutil import resolve_name
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from tympan.base.fields import fields_of
from tympan.base.units import unit_of
from tympan.reports.schema_number import SCHEMA_NUMBER
from tympan.reports.template import template, text_of

#: JSON types by the name of a kind of value.
_TYPES = {"text": "string", "number": "number", "whole number": "integer",
          "true or false": "boolean", "object": "object", "list": "array"}
_KINDS = {str: "text", float: "number", int: "whole number", bool: "true or false"}
_MISSING = " or missing"
#: Default of the unit at the end of keys whose unit depends on the result.
_UNIT = "um"

#: Units outside SI, by the end of a key.
_OTHERS = {"_C": "C", "_um": "µm", "_mm": "mm", "_cm2": "cm²", "_deg": "°", "_per_s": "1/s",
           "_kg_m2": "kg m²", "_V_per_V": "V/V", "_m_per_V": "m/V", "_m_per_V2": "m/V²",
           "_V_m": "V m", "_m_per_F": "m/F", "_J_per_kg": "J/kg", "_J_per_m3": "J/m³",
           "_g": "g", "_kV": "kV", "_percent": "%"}


@dataclass(frozen=True)
class JsonKey:
    """One key of a record by its path: ``[]`` is any entry of a list, ``{}`` any key of an object.

    ``kind``: its values, such as "number", "text or none", "object or missing" for a key that may
    be absent, or a choice of texts in quotes.
    """

    path: str
    kind: str
    meaning: str

    @property
    def unit(self) -> str:
        """The unit in the key's name."""
        name = re.sub(r"(\[\]|\{\})+$", "", self.path.rpartition(".")[2])
        if self.kind.split(" or ")[0] not in ("number", "list"):
            return ""
        other = next((unit for end, unit in _OTHERS.items() if name.endswith(end)), None)
        return (unit_of(name) or "") if other is None else other


@dataclass(frozen=True)
class JsonRecord:
    """Record that some ``commands`` print, stored as ``file``."""

    name: str
    commands: str
    file: str
    keys: tuple[JsonKey, ...]

    @property
    def rows(self) -> list[tuple[str, str, str, str]]:
        """Path, kind, unit and meaning of every key; for lists of plain values kind says it all."""
        holds = {key.path: key.kind for key in self.keys}
        rows = []
        for key in self.keys:
            entry = holds.get(f"{key.path}[]", "object")
            kind = key.kind.replace("list", f"list of {entry}s") if entry != "object" else key.kind
            if not key.path.endswith("[]") or key.kind == "object":
                rows.append((key.path, kind, key.unit, key.meaning))
        return rows

    @property
    def schema(self) -> dict[str, Any]:
        """The record as a JSON Schema (draft 2020-12); printed records have its number, too."""
        content = _object([(_steps(key.path), key) for key in self.keys])
        number = {"const": SCHEMA_NUMBER, "description": "number of this schema"}
        return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": self.commands,
                **content, "properties": {"schema": number, **content.get("properties", {})}}


@cache
def json_records() -> tuple[JsonRecord, ...]:
    """List all described records."""
    declared = tomllib.loads(text_of("reports/schema.toml"))
    return tuple(JsonRecord(name, entry["commands"], entry.get("file", ""),
                            tuple(_declared(entry, declared)))
                 for name, entry in declared["record"].items())


def _declared(entry: Mapping[str, Any], declared: Mapping[str, Any], at: str = ""
              ) -> Iterator[JsonKey]:
    """Yield the keys of a record or part: of its lines "path | kind | meaning", and its class."""
    for line in entry.get("keys", "").strip().splitlines():
        path, kind, meaning = (words.strip() for words in line.split("|"))
        kind, _, parts = kind.partition(": ")
        yield JsonKey(f"{at}{path}", kind, meaning)
        for part in parts.split(", ") if parts else ():
            yield from _declared(declared["part"][part], declared, f"{at}{path}.")
    if "class" in entry:
        cls = resolve_name(f"tympan.{entry['class']}")
        yield from class_keys(cls, f"{at}{entry.get('at', '')}")
    for path, part in entry.get("below", {}).items():
        yield from _declared(declared["part"][part], declared, f"{at}{path}.")


def class_keys(cls: type, at: str = "") -> Iterator[JsonKey]:
    """Yield the keys of a dataclass as ``to_json`` writes it, then those of nested classes."""
    hints = get_type_hints(cls)
    declared = {field.name: field for field in fields_of(cls)}
    for item in fields(cls):
        if item.compare:
            field, hint = declared[item.name], hints[item.name]
            printed, meaning = field.printed, field.says.meaning
            if printed.choices is not None and printed.inline:
                for name, choice in printed.choices.items():
                    yield from _keys(f"{at}{name}", get_args(hint)[1], choice.meaning)
                continue
            if printed.choices is not None:
                hint = _chosen(hint, printed.choices)
            first, *below = _keys(f"{at}{printed.spelled(item.name, _UNIT)}", hint, meaning)
            if printed.may_miss:
                none = not first.kind.startswith("number")
                first = replace(first, kind=first.kind.removesuffix(" or none" * none) + _MISSING)
            yield first
            yield from below


def _chosen(hint: Any, choices: Mapping[str, Any]) -> Any:
    """Build the type of a text that is one of some names, or none where the hint allows it."""
    none = (None,) if type(None) in get_args(hint) else ()
    return Union[Literal[*choices], *none]


def _keys(path: str, hint: Any, meaning: str = "one of them") -> Iterator[JsonKey]:
    options = [option for option in get_args(hint) if option is not type(None)]
    origin, none = get_origin(hint), ""
    if origin in (Union, types.UnionType):
        none = " or none" if len(options) < len(get_args(hint)) else ""
        hint, origin = options[0], get_origin(options[0])
    inner = get_args(hint)
    if origin is Literal:
        yield JsonKey(path, " or ".join(f'"{text}"' for text in inner) + none, meaning)
    elif is_dataclass(hint):
        yield JsonKey(path, f"object{none}", meaning)
        yield from class_keys(hint, f"{path}.")  # type: ignore[arg-type]
    elif origin is tuple or origin is np.ndarray or hint is np.ndarray:
        yield JsonKey(path, f"list{none}", meaning)
        yield from _keys(f"{path}[]", inner[0] if origin is tuple else float)
    elif origin in (dict, Mapping):
        yield JsonKey(path, f"object{none}", meaning)
        if inner[1] is not Any:
            yield from _keys(f"{path}{{}}", inner[1])
    else:
        yield JsonKey(path, f"{_KINDS[hint]}{none}", meaning)


def _steps(path: str) -> list[str]:
    """Split a path into its parts: names, "[]" and "{}"."""
    return re.findall(r"[^.\[\]{}]+|\[\]|\{\}", path)


def _object(keys: Sequence[tuple[list[str], JsonKey]]) -> dict[str, Any]:
    """Build the schema of an object from its keys, each with the remaining steps to it."""
    names = dict.fromkeys(steps[0] for steps, _ in keys)
    inside = {name: [(steps[1:], key) for steps, key in keys if steps[0] == name]
              for name in names}
    if list(names) == ["{}"]:
        return {"type": "object", "additionalProperties": _value(inside["{}"])}
    return {"type": "object", "properties": {name: _value(inside[name]) for name in names},
            "required": [name for name in names if not _may_miss(inside[name])],
            "additionalProperties": False}


def _may_miss(keys: Sequence[tuple[list[str], JsonKey]]) -> bool:
    return any(key.kind.endswith(_MISSING) for steps, key in keys if not steps)


def _value(keys: Sequence[tuple[list[str], JsonKey]]) -> dict[str, Any]:
    """Build the schema of one value, from its key, if it has one, and from those below it."""
    itself, below = [key for steps, key in keys if not steps], [pair for pair in keys if pair[0]]
    kind = itself[0].kind.removesuffix(_MISSING) if itself else ""
    schema: dict[str, Any]
    if below and below[0][0][0] == "[]":
        schema = {"type": "array", "items": _value([(steps[1:], key) for steps, key in below])}
    elif below:
        schema = _object(below)
    elif '"' in kind:
        schema = {"enum": re.findall(r'"([^"]*)"', kind)}
    else:
        names = [_TYPES[word] for word in kind.split(" or ") if word in _TYPES]
        schema = {"type": names[0] if len(names) == 1 else names} if names else {}
    if kind.endswith(" or none"):
        schema = {"anyOf": [schema, {"type": "null"}]}
    if itself:
        schema["description"] = itself[0].meaning
    if itself and itself[0].unit:
        schema["unit"] = itself[0].unit
    return schema


def schemas() -> str:
    """Write the file docs/schemas.json: all schemas by the name of their record."""
    return json.dumps({record.name: record.schema for record in json_records()}, indent=1,
                      ensure_ascii=False) + "\n"


def json_page() -> str:
    """Write the page docs/json.md: the keys of all records, as people read them."""
    return template("reports/schema.txt").render(records=json_records(), number=SCHEMA_NUMBER)


if __name__ == "__main__":
    print(json_page() if "--page" in sys.argv else schemas(), end="")
