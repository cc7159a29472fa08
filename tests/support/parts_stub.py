"""tympan/parts.pyi from the declared fields: ``python -m tests.support.parts_stub`` writes it anew.
"""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from tympan import parts
from tympan.base.fields import Field, fields_of
from tympan.fem.film.library import LibraryMaterial

FILE = Path(parts.__file__).with_suffix(".pyi")
HEAD = '''\
"""The parts as type checkers see them: quantities are SI numbers or texts with their unit."""

from collections.abc import Sequence
from typing import Literal, overload

{imports}

Quantity = float | str
Pair = tuple[Quantity, Quantity]
'''


def stub() -> str:
    """What the file should hold."""
    places = imported()
    imports = [f"from {module} import {name} as {name if not fields(name) else 'Any' + name}"
               for name, module in places.items()]
    used = {"Bias": "tympan.fem.membrane.biases", "Outline": "tympan.geometry.outlines",
            "FlowLaw, Material, Strength": "tympan.geometry.specimen",
            "LibraryMaterial, StatedMaterial": LibraryMaterial.__module__}
    imports += [f"from {module} import {name}" for name, module in used.items()]
    classes = [f"\nclass {name}(Any{name}):\n{constructors(name)}"
               for name in places if fields(name)]
    return HEAD.format(imports="\n".join(sorted(imports))) + "".join(classes)


def imported() -> dict[str, str]:
    """The parts and the modules they come from, in order."""
    places = vars(parts)["PLACES"]  # the stub, which type checkers read, has only the parts
    return {name: module for module, names in places.items() for name in names}


def fields(name: str) -> tuple[Field, ...]:
    """The fields of a part, none where no quantity is among them."""
    declared = fields_of(getattr(parts, name))
    return declared if any(field.says.dimension for field in declared) else ()


def constructors(name: str) -> str:
    """Its constructor; two where words for twice the numbers may stand in place of a field."""
    halves = [field for field in fields(name) if field.says.doubled]
    if not halves:
        return f"    def __init__({arguments(name)}) -> None: ...\n"
    return "".join(f"    @overload\n    def __init__({arguments(name, doubled)}) -> None: ...\n"
                   for doubled in ((), halves))


def arguments(name: str, doubled: Sequence[Field] = ()) -> str:
    """Those of the constructor; words for twice as much in place of the ``doubled`` fields."""
    declared = {field.name: field for field in fields(name)}
    halves = {field.name for field in doubled}
    words = ["*", *(f"{word}: Quantity" for field in doubled for word in field.says.doubled)]
    keywords = ["*"] * all(item.kw_only for item in dataclasses.fields(getattr(parts, name)))
    listed = words * bool(doubled) + keywords + [f"{item.name}: {annotation(declared[item.name])}"
              f"{'' if declared[item.name].required else ' = ...'}"
              if item.name in declared else f"{item.name}: {item.type}"
              f"{'' if item.default is dataclasses.MISSING else ' = ...'}"
              for item in dataclasses.fields(getattr(parts, name)) if item.name not in halves]
    return textwrap.fill(", ".join(["self", *listed]), 80, subsequent_indent=" " * 17)


def annotation(field: Field) -> str:
    """The type of an argument."""
    number = "Quantity" if field.says.dimension else "float"
    if get_origin(field.item) is tuple:
        return "Sequence[Pair]"
    if field.item is float and not field.several:
        return f"{number} | None" if field.default is None else number
    if field.says.repeats:
        return "float | tuple[float, float]"
    if field.item is float and field.count == 2:
        return "Pair" if field.says.dimension else "tuple[float, float]"
    if field.several and field.item is float:
        return f"Sequence[{number}]"
    if get_origin(field.item) is Literal:
        return f"Literal[{', '.join(map(repr, get_args(field.item)))}]".replace("'", '"')
    words: Any = field.item.__name__
    words = f"Any{words}" if hasattr(parts, words) and fields(words) else words
    if field.several:
        return f"Sequence[{words}]"
    if field.says.kinds is not None and field.says.kinds.by_name:
        words += (" | LibraryMaterial | StatedMaterial | str" if words == "Material"
                  else " | str")
    return f"{words} | None" if field.default is None else str(words)


if __name__ == "__main__":
    FILE.write_text(stub(), encoding="utf-8")
