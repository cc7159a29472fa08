"""A check of JSON against the part of JSON Schema (draft 2020-12) that our schemas use."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from tympan.reports.schema import json_records
from tympan.reports.schema_number import SCHEMA_NUMBER

_TYPES: dict[str, Any] = {"string": str, "number": (int, float), "integer": int, "boolean": bool,
                          "object": dict, "array": list, "null": type(None)}
_USED = {"$schema", "title", "description", "unit", "type", "enum", "const", "anyOf", "items",
         "properties", "required", "additionalProperties"}


def schema_of(name: str) -> dict[str, Any]:
    """The JSON Schema of a record of the reference."""
    return next(record.schema for record in json_records() if record.name == name)


def printed_record(text: str) -> dict[str, Any]:
    """The record that ``--json`` printed, without the number of its schema."""
    number, *rest = json.loads(text).items()
    assert number == ("schema", SCHEMA_NUMBER)
    return dict(rest)


def faults(value: Any, schema: dict[str, Any], path: str = "") -> Iterator[str]:
    """What of a value is not as its schema says; nothing where all is well."""
    assert schema.keys() <= _USED, schema.keys() - _USED
    if "anyOf" in schema:
        tried = [list(faults(value, option, path)) for option in schema["anyOf"]]
        yield from () if [] in tried else tried[0]
    if "enum" in schema and value not in schema["enum"]:
        yield f"{path}: {value!r} is none of {schema['enum']}"
    if "const" in schema and value != schema["const"]:
        yield f"{path}: {value!r} is not {schema['const']}"
    if "type" in schema and not is_of_type(value, schema["type"]):
        yield f"{path}: {value!r} is no {schema['type']}"
    if isinstance(value, list):
        for number, entry in enumerate(value):
            yield from faults(entry, schema.get("items", {}), f"{path}[{number}]")
    if isinstance(value, dict):
        yield from _faults_of_object(value, schema, path)


def is_of_type(value: Any, names: Any) -> bool:
    """Whether it is of one of the types; true and false are no numbers."""
    names = [names] if isinstance(names, str) else names
    if isinstance(value, bool):
        return "boolean" in names
    wanted = (_TYPES[name] for name in names)
    return any(isinstance(value, kind) for kind in wanted)


def _faults_of_object(value: dict[str, Any], schema: dict[str, Any], path: str) -> Iterator[str]:
    known_keys = schema.get("properties", {})
    yield from (f"{path}.{name} is missing" for name in schema.get("required", ())
                if name not in value)
    further = schema.get("additionalProperties", {})
    for name, entry in value.items():
        if name in known_keys:
            yield from faults(entry, known_keys[name], f"{path}.{name}")
        elif further is False:
            yield f"{path}.{name} is not declared"
        else:
            yield from faults(entry, further, f"{path}.{name}")
