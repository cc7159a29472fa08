"""Kinds and keys of specimen and rig files, each as a change of one plain film or rig.

They come from the registries and from the declared fields, so that what is registered later is
among them; :func:`missing` names what has no example yet.
"""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import numpy as np

from benchmarks.trials.random_specimens import slack_voltage, tension
from tests.oracles.laws import SAMPLES
from tympan.base.errors import InputError
from tympan.base.fields import Content, Registry, fields_of
from tympan.fem.film.library import MATERIALS, load_specimen
from tympan.fem.membrane.biases import BIASES
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import toml
from tympan.geometry.cad.membrane import electrode_part, membrane_part, write_step
from tympan.geometry.cad.parts import write_dxf
from tympan.geometry.outlines import OUTLINES, Circle, Ellipse, examples, perimeter, reshaped
from tympan.geometry.specimen import (
    FLOWS,
    LAWS,
    STRENGTHS,
    Electrode,
    Film,
    Plate,
    Specimen,
)

#: The film that all others are a change of.
PLAIN: Content = {
    "name": "plain",
    "frame": {"shape": "circle", "radius": "4.5 cm"},
    "plate": {"shape": "circle", "radius": "1 cm"},
    "membrane": {"thickness": "1 mm", "prestretch": [2.236, 2.236], "material": "vhb-4910",
                 "relative_permittivity": 4.7}}
#: Film that is asked on every rig.
_WITHOUT_AXIS = "frame ellipse"
#: Rigs of films that no mass loads.
_LOADED_BY = {"no plate": "rig.gas_pressure"}
#: Half extent of plates [m].
_PLATE = 10e-3
#: What plates of other outlines are as large as: a round stadium would be one of two half circles.
_LONG_PLATE = Ellipse((12e-3, 8e-3))
#: Prestretches of a library's material, of which the first one that its law was tested at is taken.
_PRESTRETCHES = (2.236, 2.0, 1.5, 1.2, 1.1, 1.05)
#: Thickness of those that are stretched less: silicones are thin.
_THIN = "100 um"
#: Permittivity of a material of which the library knows none.
_PERMITTIVITY = 2.8

#: Weight on the plate over the pull of the flat film round its edge: 18 g of the plain one.
_LOADED = 0.145
#: Voltage over that at which the flat film loses its pull: 3 kV of the plain one.
_CHARGED = 0.31
#: Standard gravity, by which a mass is chosen on every rig [m/s²].
_GRAVITY = 9.80665

#: Examples of keys, and of kinds that have none elsewhere.
EXAMPLES: Content = tomllib.loads(Path(__file__).with_name("examples.toml").read_text("utf-8"))
#: Where files name kinds of a registry, and what an example of a kind is called.
REGISTRIES: Mapping[str, tuple[str, Registry[Any]]] = {
    "frame": ("frame", OUTLINES), "plate": ("plate", OUTLINES),
    "membrane.material": ("law", LAWS), "membrane.breakdown": ("strength", STRENGTHS),
    "membrane.branch": ("flow", FLOWS), "bias": ("bias", BIASES)}
#: Tables of a specimen file whose keys are concepts, and what declares them.
TABLES: Mapping[str, type] = {"membrane": Film, "electrode": Electrode, "plate": Plate}
#: Keys that are other concepts already: kinds of a registry, and the outline's own keys.
_ELSEWHERE = {"membrane.material", "membrane.breakdown", "membrane.branch", "plate.outline",
              "rig.bias"}


@dataclass(frozen=True)
class Concept:
    """A film or rig that differs from the plain one by these values at places of its file."""

    of: Literal["film", "rig"]
    name: str
    changes: Mapping[str, Any]

    @property
    def place(self) -> str:
        """Place of its first change; two concepts of one place do not go together."""
        return next(iter(self.changes))


@dataclass(frozen=True)
class Combination:
    """Concepts that one film on one rig has at once; none is the plain one."""

    concepts: tuple[Concept, ...]

    @property
    def name(self) -> str:
        """Names of its concepts."""
        return " + ".join(concept.name for concept in self.concepts) or "plain"

    @property
    def stem(self) -> str:
        """Name of its files and folders."""
        return self.name.replace(" ", "_")

    def content(self, of: Literal["film", "rig"]) -> Content:
        """Content of the specimen file or the rig file."""
        made: Content = copy.deepcopy(PLAIN) if of == "film" else {}
        changes = [item for concept in self.concepts if concept.of == of
                   for item in concept.changes.items()]
        # A whole table comes before its keys.
        for place, value in sorted(changes, key=lambda item: item[0].count(".")):
            _put(made, place.split("."), copy.deepcopy(value))
        return made

    @cached_property
    def on_a_rig(self) -> bool:
        """Whether its rig is not the ideal one."""
        return any(concept.of == "rig" for concept in self.concepts)

    def write(self, folder: Path) -> Asked:
        """Write its files; a film that no file may have is an InputError."""
        film, rig = folder / f"{self.stem}.toml", folder / f"{self.stem}.rig.toml"
        content = self.content("film")
        film.write_text(toml(content), encoding="utf-8")
        if self.on_a_rig:
            rig.write_text(toml(self.content("rig")), encoding="utf-8")
            Rig.read(rig)
        return Asked(self, load_specimen(film), film, rig if self.on_a_rig else None)


@dataclass(frozen=True)
class Asked:
    """A combination with its files, and loads that suit its film."""

    combination: Combination
    specimen: Specimen
    film: Path
    rig: Path | None

    @property
    def mass(self) -> float | None:
        """Mass on the plate [kg] to two digits, None without a plate."""
        if self.specimen.plate is None:
            return None
        film, edge = self.specimen.membrane, float(perimeter(self.specimen.plate.outline))
        return _rounded(_LOADED * film.layers * tension(film) * edge / _GRAVITY)

    @property
    def voltage(self) -> float:
        """Voltage [V] to two digits."""
        return _rounded(_CHARGED * slack_voltage(self.specimen.membrane))


def concepts() -> list[Concept]:
    """All concepts that have an example, films first."""
    return [*_films(), *_rigs()]


def alone(every: Sequence[Concept]) -> list[Combination]:
    """The plain film, every other film on the plain rig, and an ellipse on every other rig.

    A film that nothing would load has a rig that does.
    """
    named = {concept.name: concept for concept in every}

    def of(concept: Concept) -> Combination:
        if concept.of == "rig":
            return Combination((named[_WITHOUT_AXIS], concept))
        loaded = _LOADED_BY.get(concept.name)
        return Combination((concept, named[loaded]) if loaded else (concept,))

    return [Combination(()), *map(of, every)]


def missing() -> list[str]:
    """Kinds and keys without an example."""
    known = {"frame": set(OUTLINES), "plate": set(OUTLINES), "law": set(SAMPLES),
             **{name: set(EXAMPLES[name]) for name in ("strength", "flow", "bias")}}
    kinds = [f"{name}.{kind}" for name, registry in REGISTRIES.values() for kind in registry
             if kind not in known[name]]
    keys = [f"{table}.{field.key}" for table, declared in {**TABLES, "rig": Rig}.items()
            for field in fields_of(declared)
            if field.key not in EXAMPLES[table] and f"{table}.{field.key}" not in _ELSEWHERE]
    tables = [field.key for field in fields_of(Specimen)
              if field.key not in ("name", "frame", *TABLES)]
    return kinds + keys + tables


def drawn(every: Sequence[Concept], count: int, seed: int, folder: Path
          ) -> tuple[list[Combination], int]:
    """Combinations of two or three concepts that files may have, and a count of others drawn."""
    random, found, refused = np.random.default_rng(seed), list[Combination](), 0
    while len(found) < count:
        numbers = random.choice(len(every), size=2 + len(found) % 2, replace=False)
        chosen = [every[number] for number in sorted(numbers)]
        if len({concept.place for concept in chosen}) < len(chosen):
            continue
        made = Combination(tuple(chosen))
        try:
            electrode_part(made.write(folder).specimen)
        except InputError:
            refused += 1
        else:
            found.append(made)
    return found, refused


def write_drawings(folder: Path) -> None:
    """Write the files that examples of rigs and drawn outlines name."""
    plain = Combination(()).write(folder).specimen
    (folder / "plain.toml").write_text(toml(PLAIN), encoding="utf-8")
    for name, frame in (("frame", plain.frame), ("plate", Circle(_PLATE))):
        face = membrane_part(Specimen(name, frame, None, plain.membrane))
        write_step([face], folder / f"{name}.step")
        write_dxf([face], folder / f"{name}.dxf")


def _films() -> Iterator[Concept]:
    for place in ("frame", "plate"):
        for shape in OUTLINES:
            yield Concept("film", f"{place} {shape}", {place: _outline(place, shape)})
    for law in LAWS:
        if law in SAMPLES:
            yield Concept("film", f"law {law}", {
                "membrane.material": {"law": law, **tomllib.loads(SAMPLES[law].lines)}})
    for name in MATERIALS:
        yield Concept("film", f"material {name}", _of_library(name))
    for name, key in (("strength", "membrane.breakdown"), ("flow", "membrane.branch")):
        for kind, values in _examples(name, REGISTRIES[key][1]):
            table = {REGISTRIES[key][1].tag: kind, **values}
            yield Concept("film", f"{name} {kind}", {key: [table] if name == "flow" else table})
    yield Concept("film", "no plate", {"plate": None})
    for table in ("frame", *TABLES):
        for key, value in EXAMPLES[table].items():
            name = f"{table}.{key}"
            yield Concept("film", name, {name: value, **EXAMPLES["beside"].get(name, {})})


def _rigs() -> Iterator[Concept]:
    for law, values in _examples("bias", BIASES):
        yield Concept("rig", f"bias {law}", {"bias": [{"law": law, **values}]})
    declared = {field.key: field for field in fields_of(Rig)}
    for key, value in EXAMPLES["rig"].items():
        field = declared[key]
        if get_origin(field.kind) is Literal:
            for choice in get_args(field.kind):
                if choice != field.default:
                    yield Concept("rig", f"rig.{key} {choice}", {key: choice})
        else:
            yield Concept("rig", f"rig.{key}", {key: value})


def _examples(name: str, registry: Iterable[str]) -> Iterator[tuple[str, Content]]:
    """Kinds of a registry with their examples."""
    return ((kind, EXAMPLES[name][kind]) for kind in registry if kind in EXAMPLES[name])


def _outline(place: str, shape: str) -> Content:
    """An outline as large as frames or plates are."""
    shapes = examples()
    if shape not in shapes:  # a drawing's
        return {"shape": shape, "file": f"{place}.{shape}", "curve": "outer"}
    if place == "frame":
        return OUTLINES.write(shapes[shape])
    return OUTLINES.write(reshaped(_LONG_PLATE, shapes[shape]))


def _of_library(name: str) -> Content:
    """A film of a material of the library, prestretched as its law was tested."""
    entry = MATERIALS[name]
    stretch = next((each for each in _PRESTRETCHES if entry.holds((each, each))),
                   _PRESTRETCHES[-1])
    changes: Content = {"membrane.material": name, "membrane.prestretch": [stretch, stretch]}
    if stretch < _PRESTRETCHES[1]:
        changes["membrane.thickness"] = _THIN
    known = entry.relative_permittivity
    return changes | {"membrane.relative_permittivity": _PERMITTIVITY if known is None else known}


def _put(content: Content, path: Sequence[str], value: Any) -> None:
    """Put a value at a place: in place of what is there, or behind the tables of a list."""
    for name in path[:-1]:
        content = content.setdefault(name, {})
    if value is None:
        content.pop(path[-1], None)
    elif isinstance(value, list) and isinstance(value[0], dict):
        content.setdefault(path[-1], []).extend(value)
    else:
        content[path[-1]] = value


def _rounded(value: float) -> float:
    """Value to two digits."""
    return float(f"{value:.2g}")
