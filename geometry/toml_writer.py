"""Specimens as TOML that reads back equal: the inverse of :func:`tympan.geometry.specimen.specimen_from_table`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from tympan.geometry.outlines import Drawn, Outline, Rotated
from tympan.geometry.outlines.shapes.drawn import segment_content
from tympan.geometry.specimen import Plate, Region, Specimen, Strength
from tympan.geometry.units import DIMENSIONS, quantity

#: Units people write, the preferred one first; the SI unit stands in where none gives the number
#: back exactly.
_FRIENDLY = {"length": ("mm", "um"), "mass": ("g",), "stress": ("kPa",), "voltage": ("kV",),
             "speed": ("um/min",),
             "field": ("MV/m",), "angle": ("deg",)}

#: Dimensions of the fields of outlines and of strength laws; a field that is not here is a plain
#: number.
_OUTLINES = dict.fromkeys(("radius", "semi_axes", "corner_radius", "fillet", "vertices", "through"),
                          "length")
_STRENGTHS = {"strength": "field", "thickness": "length"}

Content = Mapping[str, Any]


def quantity_text(value: float, dimension: str) -> str:
    """A quantity as number and unit that :func:`tympan.geometry.units.quantity` reads back as the very same number.

    Examples
    --------
    >>> quantity_text(0.045, "length"), quantity_text(float("inf"), "voltage"), quantity_text(1 / 3, "stress")
    ('45 mm', 'inf kV', '0.3333333333333333 Pa')
    """
    value = float(value)
    si = DIMENSIONS[dimension][0]
    for unit in (*_FRIENDLY.get(dimension, ()), si):
        text = f"{value / quantity(f'1 {unit}', dimension):.12g} {unit}"
        if quantity(text, dimension) == value:
            return text
    return f"{value!r} {si}"


def outline_dimension(word: str) -> str | None:
    """Dimension of a field of outlines, None for plain numbers."""
    return _OUTLINES.get(word)


def constants(value: Any, dimensions: Mapping[str, str]) -> dict[str, Any]:
    """The fields of a dataclass as TOML values: quantities where ``dimensions`` knows the field, numbers elsewhere.

    A field that is itself something with a ``law`` becomes a table of its own.
    """
    return {item.name: _constant(item.name, getattr(value, item.name), dimensions)
            for item in fields(value)}


def law_content(value: Any, dimensions: Mapping[str, str]) -> dict[str, Any]:
    """The table of a material, a strength or a bias: its ``law`` and its constants."""
    return {"law": value.law, **constants(value, dimensions)}


def specimen_content(specimen: Specimen, of_material: Callable[[Specimen], Content]) -> dict[str,
                                                                                             Any]:
    """The tables of a specimen file; ``of_material`` makes that of the film's material."""
    film, electrode = specimen.membrane, specimen.electrode
    membrane: dict[str, Any] = {
        "thickness": quantity_text(film.thickness, "length"),
        "prestretch": [float(x) for x in film.prestretch],
        "relative_permittivity": float(film.relative_permittivity),
        "permittivity_exponent": float(film.permittivity_exponent),
        "density": quantity_text(film.density, "density"), "material": of_material(specimen)}
    if film.strength is not None:
        membrane["breakdown"] = _strength(film.strength)
    covered: dict[str, Any] = {
        "margin_frame": quantity_text(electrode.margin_frame, "length"),
        "margin_plate": quantity_text(electrode.margin_plate, "length"),
        "stiffness": quantity_text(electrode.stiffness, "stress")}
    if electrode.outline is not None:
        covered["outline"] = _placed(electrode.outline)
    return {"name": specimen.name, "frame": _outline(specimen.frame),
            "plate": _placed(specimen.plate),
            "membrane": membrane, "electrode": covered}


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
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Sequence):
        return f"[{', '.join(map(_value, value))}]"
    return repr(float(value))


def _constant(name: str, value: Any, dimensions: Mapping[str, str]) -> Any:
    if isinstance(value, tuple):
        return [_constant(name, item, dimensions) for item in value]
    if is_dataclass(value):
        return law_content(value, dimensions)
    return quantity_text(value, dimensions[name]) if name in dimensions else float(value)


def _outline(outline: Outline) -> dict[str, Any]:
    if isinstance(outline, Rotated):
        return {**_outline(outline.outline), "rotation": quantity_text(outline.rotation, "angle")}
    if isinstance(outline, Drawn):
        segments = [segment_content(piece, quantity_text) for piece in outline.segments]
        return {"shape": outline.shape, "segments": segments}
    return {"shape": outline.shape, **constants(outline, _OUTLINES)}


def _placed(region: Plate | Region) -> dict[str, Any]:
    """An outline somewhere: a plate or a region."""
    return {**_outline(region.outline),
            "offset": [quantity_text(x, "length") for x in region.offset]}


def _strength(strength: Strength) -> dict[str, Any]:
    written = law_content(strength, _STRENGTHS)
    if not written.get("thickness_exponent", 1.0):
        del written["thickness"]  # without an exponent the reader takes no thickness
    return written
