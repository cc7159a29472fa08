"""Writer of specimens and rigs as TOML; ``solve`` reads equal ones back."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tympan.base.errors import InputError
from tympan.base.fields import Content, write
from tympan.fem.film.admissibility import STRETCH_RANGE, inadmissible_stretch
from tympan.fem.film.library import MATERIALS, material_name
from tympan.fem.membrane.biases import JoinedFilm
from tympan.fem.rig import Actuator, Rig
from tympan.geometry.specimen import Specimen

#: Stretch ranges for a law that is not admissible over all stretches, the widest first.
_RANGES = (STRETCH_RANGE, (0.7, 5.0), (0.8, 4.0), (1.0, 4.0), (1.0, 3.0), (1.0, 2.5), (1.0, 2.0),
           (1.0, 1.5))


def specimen_content(specimen: Specimen, plain: bool = False) -> Content:
    """Convert a specimen to the tables of a specimen file.

    If the library has the material, the tables contain its name. Another law gets the ``range``
    stated for it, or the widest range over which it is admissible.

    ``plain``: quantities are SI numbers, and their keys end with the unit.

    Raises
    ------
    InputError
        When the material is not admissible over any range that holds the prestretch, so that no
        file can state it.
    """
    content = write(specimen, plain)
    if isinstance(specimen, Actuator):
        content["rig"] = rig_content(specimen.rig, plain)
    name = None if plain else material_name(specimen.membrane)
    if name is not None:
        film, known = content["membrane"], MATERIALS[name].of_film
        for key, field in (("branch", "branches"), ("breakdown", "strength")):
            if getattr(specimen.membrane, field) == known.get(field):
                film.pop(key, None)
        film["material"] = name
        return content
    material, most = specimen.membrane.material, max(specimen.membrane.prestretch)
    stated = specimen.membrane.law_range
    if stated is not None and inadmissible_stretch(material, *stated) is None:
        content["membrane"]["material"]["range"] = list(stated)
        return content
    for low, high in _RANGES:
        if high > most and inadmissible_stretch(material, low, high) is None:
            if (low, high) != STRETCH_RANGE:
                content["membrane"]["material"]["range"] = [low, high]
            return content
    raise InputError("cannot be written as a specimen file: true stress falls with stretch near "
                     "the prestretch", key="membrane.material", given=str(material))


def specimen_to_toml(specimen: Specimen) -> str:
    """Write a specimen as TOML text.

    :func:`tympan.fem.rig.load_actuator` reads an equal specimen back. If the law needs a
    range that the film does not have, the specimen read back has this range.
    """
    return toml(specimen_content(specimen))


def rig_to_toml(rig: Rig) -> str:
    """Write a rig as TOML text; :meth:`tympan.fem.rig.Rig.read` reads an equal rig."""
    return toml(rig_content(rig))


def rig_content(rig: Rig, plain: bool = False) -> Content:
    """Convert a rig to the keys of a rig file that differ from an ideal rig's.

    ``plain`` as for :func:`specimen_content`.
    """
    ideal = write(Rig(), plain)
    content = {key: value for key, value in write(rig, plain).items() if ideal.get(key) != value}
    for bias, entry in zip(rig.biases, content.get("bias", ()), strict=True):
        if isinstance(bias, JoinedFilm):
            entry["specimen"] = specimen_content(bias.specimen, plain)
    return content


def toml(content: Mapping[str, Any]) -> str:
    """Write nested tables as TOML text; lists of tables become arrays of tables.

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


def _lines(content: Mapping[str, Any], path: str) -> Iterator[str]:
    inner: dict[str, list[Any]] = {}
    for key, value in content.items():
        entries = value if isinstance(value, list) else [value]
        if entries and isinstance(entries[0], Mapping):
            inner[key] = entries
        else:
            yield f"{key} = {_value(value)}"
    for key, entries in inner.items():
        where = f"{path}.{key}" if path else key
        for entry in entries:
            yield ""
            yield f"[[{where}]]" if isinstance(content[key], list) else f"[{where}]"
            yield from _lines(entry, where)


def _value(value: Any) -> str:
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Sequence):
        return f"[{', '.join(map(_value, value))}]"
    return repr(float(value))
