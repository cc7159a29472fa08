"""Texts to copy from the page: a command and a script that compute its numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import tympan
from tympan.base.command_line import command_line, file_word
from tympan.base.fields import Key, fields_of
from tympan.base.units import quantity_text
from tympan.explore.view import FilmView
from tympan.fem.film.breakdown import STRENGTH_LIBRARY
from tympan.fem.film.library import MATERIALS, material_name
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Film

#: Most characters in a line of a script.
_WIDTH = 100
#: Characters of it for the name of an argument and the brackets after it.
_NAME = 16


def command_of(view: FilmView, file: str, rig_file: str = "") -> str:
    """Write the command that solves a view whose specimen and rig are in files."""
    rig = ("--rig", file_word(rig_file)) if rig_file else ()
    return command_line("solve", file_word(file), "--mass", quantity_text(view.mass, "mass"),
                        "--voltage", quantity_text(view.voltage, "voltage"), *rig)


def python_of(view: FilmView, file: str = "") -> str:
    """Write a script that solves a view; a film that is in a ``file`` is loaded from it."""
    specimen, rig = view.actuator, view.rig
    held = [rig] * (rig != Rig()) + [specimen] * (not file)
    imports = sorted({f"from {kind.__module__} import {kind.__qualname__}"
                      for part in held for kind in _kinds(part) if not _is_public(kind)})
    made = f"tympan.load({_python(str(Path(file).absolute()))})" if file else _python(specimen)
    loads = [f'mass="{quantity_text(view.mass, "mass")}"',
             f'voltage="{quantity_text(view.voltage, "voltage")}"', *["rig=rig"] * (rig != Rig())]
    return "\n".join([
        "import tympan", *imports, "", *(f"# {line}" for line in [stiffness_remark(view)] if line),
        f"specimen = {made}", *[f"rig = {_python(rig)}"] * (rig != Rig()),
        f"result = tympan.solve(specimen, {', '.join(loads)})",
        "print(result.status, result.deflection_m)", ""])


def stiffness_remark(view: FilmView) -> str:
    """Remark on the constants of a film whose stiffness was changed; "" for no change or name."""
    name = material_name(view.specimen.membrane)
    return f"{name}, its stresses times {view.stiffness:g}" if name and view.stiffness != 1 else ""


def _is_public(kind: type) -> bool:
    name = kind.__name__
    return name in tympan.__all__ and getattr(tympan, name) is kind


def _kinds(value: Any) -> Iterator[type]:
    """List the classes that :func:`_python` calls."""
    if isinstance(value, tuple):
        for item in value:
            yield from _kinds(item)
    elif is_dataclass(value) and not isinstance(value, type):
        yield type(value)
        for part in _stated(value).values():
            yield from _kinds(part)


def _stated(value: Any) -> dict[str, Any]:
    """Collect the fields of a dataclass without their defaults; names of the library."""
    stated = {}
    for item in fields(value):
        part = getattr(value, item.name)
        usual = item.default if item.default_factory is MISSING else item.default_factory()
        if item.init and part != usual:
            stated[item.name] = part
    if isinstance(value, Film):
        name = material_name(value)
        if name is not None:
            known = MATERIALS[name].of_film
            stated = {key: part for key, part in stated.items() if part != known.get(key)}
            stated["material"] = name
        for name, entry in STRENGTH_LIBRARY.items():
            if stated.get("strength") == entry.strength:
                stated["strength"] = name
    return stated


def _python(value: Any, says: Key | None = None, indent: int = 0) -> str:
    """Write an expression that makes a value, with lines indented by ``indent``."""
    if isinstance(value, tuple):
        items = ", ".join(_python(item, says, indent) for item in value)
        return f"({items}{',' * (len(value) == 1)})"
    if not is_dataclass(value):
        if isinstance(value, str):
            return json.dumps(value, ensure_ascii=False)
        number = isinstance(value, float | int) and not isinstance(value, bool)
        if number and says is not None and says.dimension:
            return f'"{quantity_text(value, says.dimension)}"'
        return f'float("{value}")' if number and not isfinite(value) else repr(value)
    kind = type(value)
    # Constructors that are not public may take only SI numbers.
    declared = {field.name: field.says for field in fields_of(kind)} if _is_public(kind) else {}
    name = f"tympan.{kind.__name__}" if _is_public(kind) else kind.__qualname__
    arguments = [f"{key}={_python(part, declared.get(key), indent + 4)}"
                 for key, part in _stated(value).items()]
    line = f"{name}({', '.join(arguments)})"
    if len(line) + indent <= _WIDTH - _NAME and "\n" not in line:
        return line
    lines = [""]
    for argument in arguments:
        # Parts of the specimen each begin a line.
        if not indent or indent + len(lines[-1]) + len(argument) > _WIDTH - _NAME:
            lines.append("")
        lines[-1] += f"{' ' * bool(lines[-1])}{argument},"
    between = "\n" + " " * (indent + 4)
    return f"{name}({between.join(lines).removesuffix(',')})"
