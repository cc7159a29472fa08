"""Requirements of a film, what is given, and what may vary: REQUIREMENTS.toml."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any, Self

from tympan.fem.film.library import library_material, load_specimen
from tympan.fem.rig import MOST_MASS, MOST_VOLTAGE, Rig
from tympan.geometry.fields import checks_types, field_at, read
from tympan.geometry.specimen import Specimen, require_different_names
from tympan.geometry.toml_reader import POSITIVE, Rule, Table, one_of
from tympan.studies.design.quantities import BREAKDOWN, QUANTITIES, TENSION
from tympan.studies.films.box import varying
from tympan.studies.tolerance.given import Tolerances

#: Words for the one quantity that shall be as good as can be.
_BEST = {True: "largest", False: "least"}
#: Loads that may vary; without them there is nothing to be designed.
LOADS: dict[str, Rule] = {
    "mass": (lambda x: 0 < x <= MOST_MASS, f"must be above 0 and at most {MOST_MASS:g} kg"),
    "voltage": (lambda x: 0 < x <= MOST_VOLTAGE,
                f"must be above 0 and at most {MOST_VOLTAGE / 1e3:g} kV")}

_SHARE: Rule = (lambda x: 0.5 <= x <= 0.99, "must be a share of the films from 0.5 to 0.99")
_LAYERS: Rule = (lambda x: x == int(x) and 1 <= x <= 100, "must be whole numbers from 1 to 100")


@dataclass(frozen=True)
class Vary:
    """A number of the specimen, or several that are alike, or a load, from lowest to highest [SI].

    ``names``: of a family's parameters; none of a load.
    """

    key: str
    names: tuple[str, ...]
    low: float
    high: float
    dimension: str = ""


@checks_types
@dataclass(frozen=True)
class Requirements:
    """Bounds that 95 % of the films keep, and one quantity that shall be as good as can be.

    ``specimens``: one for each kind that is tried; what does not vary is theirs. ``bounds`` [SI] by
    the keys of :data:`~tympan.studies.design.quantities.QUANTITIES`; ``best``: one of these, ""
    for the film that keeps all bounds by the largest common share. ``mass`` [kg] and the supply's
    ``voltage`` [V] where they do not vary. ``tolerances``: None for films without scatter.
    ``front``: two quantities between whose best films others are sought.
    """

    name: str
    specimens: tuple[Specimen, ...]
    mass: float
    voltage: float
    variables: Mapping[str, tuple[Vary, ...]]
    bounds: Mapping[str, float]
    best: str = ""
    rig: Rig = field(default_factory=Rig)
    tolerances: Tolerances | None = field(default_factory=Tolerances)
    share: float = 0.95
    front: tuple[str, str] | None = None

    @classmethod
    def read(cls, file: Path | str) -> Self:
        """The requirements of a TOML file; specimens are files beside it."""
        return cls._of(Table.read(file))

    @classmethod
    def _of(cls, table: Table) -> Self:
        rig = Rig.from_table(table.table("rig", {}))
        specimens = _specimens(table)
        variables = _variables(table, specimens)
        loads = {key: _load(table, key, rule, variables) for key, rule in LOADS.items()}
        bounds, best = _wanted(table, specimens)
        tolerances = _tolerances(table)
        share, front = table.number("share", default=0.95, rule=_SHARE), _front(table)
        found = cls(table.text("name", Path(table.file).stem), specimens, loads["mass"],
                    loads["voltage"], variables, bounds, best, rig, tolerances, share,
                    front)
        table.done()
        return found

    @property
    def margin(self) -> float:
        """Voltage that a film must bear without loss of tension, over its own."""
        return self.bounds.get(TENSION, 1.0)

    @property
    def swings(self) -> bool:
        """Whether frequencies are asked for."""
        return "frequency" in (*self.bounds, self.best, *(self.front or ()))

    def kept(self, specimen: Specimen) -> dict[str, float]:
        """All bounds of a specimen: its film bears the voltage, whatever else is wanted."""
        always = {TENSION: 1.0}
        if specimen.membrane.strength is not None:
            always[BREAKDOWN] = 1.0
        return {**always, **self.bounds}


def _specimens(table: Table) -> tuple[Specimen, ...]:
    """Specimens of all kinds and films that are tried, by different names."""
    given = table.value("specimen")
    files = [given] if isinstance(given, str) else given
    if not isinstance(files, list) or not files or not all(isinstance(name, str) for name in files):
        raise table.error("specimen", "must be a specimen file, or a list of them", given)
    kinds = [load_specimen(Path(table.file).parent / name) for name in files]
    for specimen in kinds:
        specimen.needed_plate()
    require_different_names(kinds)
    films = [choice for entry in table.tables("film") for choice in _films(entry)]
    if not films:
        return tuple(kinds)
    return tuple(_made(specimen, film) for specimen, film in product(kinds, films))


def _films(table: Table) -> list[dict[str, Any]]:
    """Films of one entry of the catalogue: every thickness in every number of layers."""
    name = table.text("material") if "material" in table else ""
    material = {"material": library_material(name)} if name else {}
    thicknesses = table.numbers("thickness", "length", rule=POSITIVE)
    layers = table.numbers("layers", default=(1,), rule=_LAYERS)
    table.asked.add("material")
    table.done()
    return [{"name": name, "thickness": thickness, "layers": int(count), **material}
            for thickness, count in product(thicknesses, layers)]


def _made(specimen: Specimen, film: dict[str, Any]) -> Specimen:
    """The specimen of a film of the catalogue, named after it."""
    given = {key: value for key, value in film.items() if key != "name"}
    words = [specimen.name, film["name"], f"{1e6 * film['thickness']:.0f}um"]
    words += [f"{film['layers']}x"] * (film["layers"] > 1)
    if "material" in given:
        old = specimen.membrane
        made = type(old)(prestretch=old.prestretch, density=old.density, **given)
    else:
        made = replace(specimen.membrane, **given)
    return replace(specimen, name="-".join(filter(None, words)), membrane=made)


def _load(table: Table, key: str, rule: Rule, variables: Mapping[str, tuple[Vary, ...]]) -> float:
    """A load; one that varies has its highest value."""
    varied = next((each.high for several in variables.values() for each in several
                   if each.key == key), None)
    if varied is None:
        return table.number(key, key, rule=rule)
    if key in table:
        raise table.error(key, "is given and varies, too: only one of both", table.data[key])
    return varied


def _variables(table: Table, specimens: tuple[Specimen, ...]) -> dict[str, tuple[Vary, ...]]:
    """Keys that vary of each specimen, by its name; a key must be known to one of them."""
    inner = table.table("vary")
    known = {key for specimen in specimens for key in _keys(specimen)} | set(LOADS)
    found: dict[str, list[Vary]] = {specimen.name: [] for specimen in specimens}
    if not inner.data:
        raise table.error("vary", f"must name at least one of {', '.join(sorted(known))}")
    for key, given in inner.data.items():
        if key not in known:
            raise inner.error(key, one_of(key, dict.fromkeys(known, 0)), given)
        for specimen in specimens:
            if (varied := _varied(inner, key, specimen)) is not None:
                found[specimen.name].append(varied)
    inner.done()
    return {name: tuple(several) for name, several in found.items()}


def _varied(table: Table, key: str, specimen: Specimen) -> Vary | None:
    """A key's numbers of one specimen, None where that has none."""
    names = () if key in LOADS else _keys(specimen).get(key, ())
    if not names and key not in LOADS:
        return None
    declared = None if key in LOADS else field_at(specimen, tuple(names[0].split(".")))
    dimension = key if key in LOADS else declared.says.dimension if declared is not None else ""
    rule = LOADS.get(key, POSITIVE)
    low, high = table.numbers(key, dimension, count=2, rule=rule)
    if not low < high:
        raise table.error(key, "must be a lower and a larger upper bound", table.data[key])
    return Vary(key, names, low, high, dimension)


def _keys(specimen: Specimen) -> dict[str, tuple[str, ...]]:
    """Numbers that may vary by their keys: those of one list also all alike, by its key."""
    found: dict[str, tuple[str, ...]] = {}
    for name in varying(specimen):
        key = name.replace("plate.outline.", "plate.", 1)
        found[key] = (name,)
        head, _, last = key.rpartition(".")
        if last.isdigit():
            found[head] = (*found.get(head, ()), name)
    return found


def _wanted(table: Table, specimens: tuple[Specimen, ...]) -> tuple[dict[str, float], str]:
    """Bounds, and the quantity that is to be best."""
    bounds: dict[str, float] = {}
    best = ""
    for inner in (table.table("want"), table.table("limits", {})):
        for key, given in inner.data.items():
            if key not in QUANTITIES:
                raise inner.error(key, one_of(key, QUANTITIES), given)
            quantity = QUANTITIES[key]
            if key == BREAKDOWN and any(each.membrane.strength is None for each in specimens):
                raise inner.error(key, "needs films whose electric strength is known "
                                       "(membrane.breakdown)")
            if given == _BEST[quantity.gain] and inner.where == "want":
                if best:
                    raise inner.error(key, f"only one quantity can be best: {best} is", given)
                best = key
                inner.asked.add(key)
                continue
            if given in _BEST.values():
                raise inner.error(key, f'must be "{_BEST[quantity.gain]}" in [want], or a bound: '
                                       f"{quantity.sense}", given)
            if key in bounds:
                raise inner.error(key, "has a bound in [want], too: only one of both", given)
            bounds[key] = inner.number(key, quantity.dimension, rule=quantity.rule)
        inner.done()
    if not bounds and not best:
        raise table.error("want", f"must name at least one of {', '.join(QUANTITIES)}")
    return bounds, best


def _front(table: Table) -> tuple[str, str] | None:
    if "front" not in table:
        return None
    pair = table.texts("front")
    for key in pair:
        if key not in QUANTITIES:
            raise table.error("front", one_of(key, QUANTITIES), key)
    if len(pair) != 2 or pair[0] == pair[1]:
        raise table.error("front", "must be two different quantities", list(pair))
    return pair[0], pair[1]


def _tolerances(table: Table) -> Tolerances | None:
    given = table.value("tolerances", {})
    if given == "none":
        return None
    if isinstance(given, str):
        return Tolerances.read(Path(table.file).parent / given)
    return read(Tolerances, table.table("tolerances", {}))

