"""Requirements of a film, what is given, and what may vary: REQUIREMENTS.toml."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Any, Self

from tympan.fem.film.library import library_material, load_specimen
from tympan.fem.rig import MOST_MASS, MOST_VOLTAGE, Rig
from tympan.geometry.errors import InputError
from tympan.geometry.fields import checks_types, field_at, fields_of, read
from tympan.geometry.outlines import area, perimeter
from tympan.geometry.paths import at
from tympan.geometry.specimen import Specimen, require_different_names
from tympan.geometry.toml_reader import FINITE, NON_NEGATIVE, POSITIVE, Rule, Table, one_of
from tympan.studies.case import Settings
from tympan.studies.design.quantities import BREAKDOWN, LIMITS, QUANTITIES, REDUCED, TENSION
from tympan.studies.design.ranges import Vary
from tympan.studies.films.box import SPRING, varying
from tympan.studies.films.family import require_reducible
from tympan.studies.limits.loads import usual_masses, usual_voltages
from tympan.studies.paper.actuators import FILES
from tympan.studies.tolerance.given import Tolerances

#: Words for the one quantity that shall be as good as can be.
_BEST = {True: "largest", False: "least"}
#: Loads that may vary; without them there is nothing to be designed.
LOADS: dict[str, Rule] = {
    "mass": (lambda x: 0 < x <= MOST_MASS, f"must be above 0 and at most {MOST_MASS:g} kg"),
    "voltage": (lambda x: 0 < x <= MOST_VOLTAGE,
                f"must be above 0 and at most {MOST_VOLTAGE / 1e3:g} kV")}
#: All that may vary beside numbers of the specimen: dimensions and rules.
_BESIDE: dict[str, tuple[str, Rule]] = {
    **{key: (key, rule) for key, rule in LOADS.items()},
    SPRING: ("stiffness per length", NON_NEGATIVE)}

#: What of a frame may be held, by its name in files, and the word for holding nothing.
MEASURES = {"area": area, "perimeter": perimeter}
NOTHING = "nothing"
#: Ways to search, by their words in files, and whether it is by finite elements.
_SEARCHES = {"reduced films": False, "finite elements": True}
_WORDS = {exact: words for words, exact in _SEARCHES.items()}

#: Number below 0 that tells which numbers may be there: offsets and exponents, no length.
_SIGNED = 1e-3

_SHARE: Rule = (lambda x: 0.5 <= x <= 0.99, "must be a share of the films from 0.5 to 0.99")
_LAYERS: Rule = (lambda x: x == int(x) and 1 <= x <= 100, "must be whole numbers from 1 to 100")


def held_words(measure: str) -> str:
    """Words on what is held of the frame.

    Examples
    --------
    >>> held_words("area"), held_words("nothing")
    ('equal area', 'free')
    """
    return "free" if measure == NOTHING else f"equal {measure}"


@checks_types
@dataclass(frozen=True)
class Requirements:
    """Bounds that 95 % of the films keep, and one quantity that shall be as good as can be.

    ``specimens``: one for each kind that is tried; what does not vary is theirs. ``bounds`` [SI] by
    the keys of :data:`~tympan.studies.design.quantities.QUANTITIES`; ``best``: one of these, ""
    for the film that keeps all bounds by the largest common share. ``mass`` [kg] and the supply's
    ``voltage`` [V] where they do not vary. ``tolerances``: None for films without scatter.
    ``front``: two quantities between whose best films others are sought.

    ``held``: measures of the frame, of :data:`MEASURES` or :data:`NOTHING`, each of which gives a
    best film of its own that has the ``reference``'s; found by finite elements alone, from the
    specimen and from ``starts``, one row of values of the variables each. Empty for reduced films.
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
    held: tuple[str, ...] = ()
    reference: Specimen | None = None
    starts: tuple[tuple[float, ...], ...] = ()

    @classmethod
    def read(cls, file: Path | str) -> Self:
        """The requirements of a TOML file; specimens are files beside it, or the paper's."""
        return cls._of(Table.read(file, "requirements"))

    @classmethod
    def shipped(cls) -> Self:
        """Those of the paper's large ellipse: the best frames of its area and of its length."""
        with resources.as_file(resources.files("tympan.studies.design") / "ellipse.toml") as file:
            return cls.read(file)

    @classmethod
    def _of(cls, table: Table) -> Self:
        rig, old = Rig.from_table(table.table("rig", {})), "want" not in table
        exact = table.choice("search", _SEARCHES, "finite elements" if old else "reduced films")
        for key in () if exact else ("hold", "reference", "start"):
            if key in table:
                raise table.error(key, 'needs search = "finite elements"')
        specimens = _specimens(table, exact)
        for specimen in () if exact else specimens:
            try:
                require_reducible(specimen, rig)
            except InputError as error:
                raise error.located(file=table.file) from None
        variables = _variables(table, specimens, rig, exact)
        loads = _loads(table, specimens, rig, variables, exact)
        bounds, best = _wanted(table, specimens, exact)
        more: dict[str, Any] = {"tolerances": None}
        if exact:
            more |= _by_elements(table, specimens[0], variables[specimens[0].name],
                                 "area" if old else NOTHING)
        if not exact or "tolerances" in table:
            more["tolerances"] = _tolerances(table)
        if not exact:
            more |= {"share": table.number("share", default=0.95, rule=_SHARE),
                     "front": _front(table)}
        elif more["tolerances"] is not None:
            raise table.error("tolerances", 'must be "none": a search by finite elements has none')
        found = cls(table.text("name", Path(table.file).stem), specimens, *loads, variables, bounds,
                    best, rig, **more)
        table.done()
        return found

    @property
    def steps(self) -> int:
        """Steps of the search that are told of."""
        return len(self.held) * (len(self.starts) + 2) or len(self.specimens)

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


def _specimens(table: Table, exact: bool) -> tuple[Specimen, ...]:
    """Specimens of all kinds and films that are tried, by different names."""
    given = table.value("specimen")
    files = [given] if isinstance(given, str) else given
    if (not isinstance(files, list) or not files or (exact and len(files) > 1)
            or not all(isinstance(name, str) for name in files)):
        raise table.error("specimen", "must be one specimen file" if exact else
                          "must be a specimen file, or a list of them", given)
    kinds = [_specimen(table, "specimen", name) for name in files]
    require_different_names(kinds)
    films = [] if exact else [choice for entry in table.tables("film") for choice in _films(entry)]
    if not films:
        return tuple(kinds)
    return tuple(_made(specimen, film) for specimen, film in product(kinds, films))


def _specimen(table: Table, key: str, name: str) -> Specimen:
    """A specimen with a plate, of a file or of the paper."""
    if not name.endswith(".toml") and name not in FILES:
        raise table.error(key, "must be a specimen file, ending in .toml, or one of "
                               f"{', '.join(FILES)}", name)
    specimen = load_specimen(FILES[name] if name in FILES else table.named_file(key, name))
    specimen.needed_plate()
    return specimen


def _films(table: Table) -> list[dict[str, Any]]:
    """Films of one entry of the catalogue: every thickness in every number of layers."""
    name = table.text("material") if "material" in table else ""
    try:
        material = {"material": library_material(name)} if name else {}
    except InputError as error:
        raise table.error("material", error.allowed, name) from None
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


def _loads(table: Table, specimens: tuple[Specimen, ...], rig: Rig,
           variables: Mapping[str, tuple[Vary, ...]], exact: bool) -> tuple[float, float]:
    """Mass [kg] and voltage [V]; of one that varies the highest.

    In a search by finite elements what is left out suits the specimen.
    """
    found: dict[str, float | None] = {}
    for key, rule in LOADS.items():
        varied = next((each.high for several in variables.values() for each in several
                       if each.key == key), None)
        if varied is not None and key in table:
            raise table.error(key, "is given and varies, too: only one of both", table.data[key])
        found[key] = (varied if varied is not None
                      else table.number(key, key, rule=rule) if not exact or key in table
                      else None)
        table.asked.add(key)
    mass, voltage = found.values()
    if mass is None:
        mass, = usual_masses(specimens[0], Settings(), rig, (1.0,))
    if voltage is None:
        voltage, = usual_voltages(specimens[0], mass, Settings(), rig, (1.0,))
    return mass, voltage


def _by_elements(table: Table, specimen: Specimen, variables: tuple[Vary, ...], usual: str
                 ) -> dict[str, Any]:
    """Held measures, the reference and starts, which finite elements alone have."""
    given = table.value("hold", usual)
    held = [given] if isinstance(given, str) else given
    if (not isinstance(held, list) or not held
            or not all(name in (*MEASURES, NOTHING) for name in held)):
        raise table.error("hold", f"must be one of {', '.join((*MEASURES, NOTHING))}, or a list of "
                                  "them", given)
    reference = (_specimen(table, "reference", table.text("reference")) if "reference" in table
                 else None)
    own = tuple(float(at(specimen, each.names[0].split("."))) for each in variables)
    return {"held": tuple(dict.fromkeys(held)), "reference": reference,
            "starts": tuple(_start(start, variables, own) for start in table.tables("start"))}


def _variables(table: Table, specimens: tuple[Specimen, ...], rig: Rig, exact: bool
               ) -> dict[str, tuple[Vary, ...]]:
    """Keys that vary of each specimen, by its name; a key must be known to one of them."""
    inner, keys = table.table("vary"), {each.name: _keys(each, exact) for each in specimens}
    known = dict.fromkeys(key for several in keys.values() for key in several)
    found: dict[str, list[Vary]] = {specimen.name: [] for specimen in specimens}
    if not inner.data:
        raise table.error("vary", f"must name at least one of {', '.join(sorted(known))}")
    for key, given in inner.data.items():
        if key not in known:
            instead = next((words[key] for words in map(_halves, specimens) if key in words), "")
            if exact and any(key in _keys(each, False) for each in specimens):
                instead = ("a search by finite elements, as without [want], varies lengths of "
                           "frame and plate alone; ")
            raise inner.error(key, instead + one_of(key, known), given)
        if key == SPRING and rig.spring:
            raise inner.error(key, "is given in [rig], and varies, too: only one of both", given)
        for specimen in specimens:
            if key in keys[specimen.name]:
                found[specimen.name].append(
                    _varied(inner, key, keys[specimen.name][key], specimen, exact))
    inner.done()
    return {name: tuple(several) for name, several in found.items()}


def _halves(specimen: Specimen) -> dict[str, str]:
    """Advice by words of files for twice a number, such as the width of a frame."""
    parts = {"frame": specimen.frame, "plate": specimen.plate and specimen.plate.outline}
    return {f"{part}.{word}": f"write {part}.{each.key}.{number} and half of these lengths; "
            for part, outline in parts.items() if outline is not None
            for each in fields_of(type(outline)) for number, word in enumerate(each.says.doubled)}


def _varied(table: Table, key: str, names: tuple[str, ...], specimen: Specimen, exact: bool
            ) -> Vary:
    """A key's numbers of one specimen; by finite elements the search begins at its own."""
    if key in _BESIDE:
        dimension, rule = _BESIDE[key]
    else:
        declared = field_at(specimen, tuple(names[0].split(".")))
        dimension = declared.says.dimension if declared is not None else ""
        declared_rule = declared.says.rule if declared is not None else None
        signed = declared_rule is not None and declared_rule[0](-_SIGNED)
        rule = FINITE if exact or signed else POSITIVE
    low, high = table.numbers(key, dimension, count=2, rule=rule)
    if not low < high:
        raise table.error(key, "must be a lower and a larger upper bound", table.data[key])
    if exact and not low <= (own := float(at(specimen, names[0].split(".")))) <= high:
        raise table.error(key, f"must have the specimen's own value, {own:.6g} in SI units, "
                               "within", table.data[key])
    return Vary(key, names, low, high, dimension)


def _keys(specimen: Specimen, exact: bool) -> dict[str, tuple[str, ...]]:
    """Numbers that may vary by their keys: those of one list also all alike, by its key.

    Finite elements have derivatives by single lengths of the outlines.
    """
    found: dict[str, tuple[str, ...]] = {}
    for name in varying(specimen):
        key = name.replace("plate.outline.", "plate.", 1)
        if exact and not name.startswith(("frame.", "plate.outline.")):
            continue
        found[key] = (name,)
        head, _, last = key.rpartition(".")
        if last.isdigit() and not exact:
            found[head] = (*found.get(head, ()), name)
    return found if exact else {**found, **dict.fromkeys(_BESIDE, ())}


def _start(table: Table, variables: tuple[Vary, ...], own: tuple[float, ...]) -> tuple[float, ...]:
    """A further start: what it does not name is the specimen's own."""
    values = []
    for each, value in zip(variables, own, strict=True):
        if each.key in table:
            value = table.number(each.key, each.dimension)
            if not each.low <= value <= each.high:
                raise table.error(each.key, "must lie within the variable's bounds",
                                  table.data[each.key])
        table.asked.add(each.key)
        values.append(value)
    table.done()
    return tuple(values)


def _wanted(table: Table, specimens: tuple[Specimen, ...], exact: bool
            ) -> tuple[dict[str, float], str]:
    """Bounds, and the quantity that is to be best."""
    bounds: dict[str, float] = {}
    best = "stroke" if exact and "want" not in table else ""
    known: Mapping[str, object] = {"stroke": None, **LIMITS} if exact else REDUCED
    for inner in (table.table("want", {}), table.table("limits", {})):
        for key, given in inner.data.items():
            if key not in known:
                raise inner.error(key, f"a search by {_WORDS[exact]} has none; "
                                  * (key in QUANTITIES) + one_of(key, known), given)
            quantity = QUANTITIES[key]
            if key == BREAKDOWN and any(each.membrane.strength is None for each in specimens):
                raise inner.error(key, "needs films whose electric strength is known "
                                       "(membrane.breakdown)")
            if key == TENSION and given in _BEST.values():
                raise inner.error(key, "must be a bound, such as 1.2: reduced films are followed "
                                       "no further than to it", given)
            if given == _BEST[quantity.gain] and inner.where == "want":
                if best:
                    raise inner.error(key, f"only one quantity can be best: {best} is", given)
                best = key
                inner.asked.add(key)
                continue
            if given in _BEST.values():
                raise inner.error(key, f'must be "{_BEST[quantity.gain]}" in [want], or a number '
                                       f"that it is to be {quantity.sense}", given)
            if key in bounds:
                raise inner.error(key, "has a bound in [want], too: only one of both", given)
            bounds[key] = inner.number(key, quantity.dimension, rule=quantity.rule)
        inner.done()
    if not bounds and not best:
        raise table.error("want", f"must name at least one of {', '.join(QUANTITIES)}")
    if exact and (best != "stroke" or "stroke" in bounds):
        raise table.error("want.stroke", 'must be "largest", with no bound: a search by finite '
                                         "elements has no other aim")
    return bounds, best


def _front(table: Table) -> tuple[str, str] | None:
    table.asked.add("front")
    if "front" not in table:
        return None
    pair = table.texts("front")
    for key in pair:
        known = {name: each for name, each in REDUCED.items() if name != TENSION}
        if key not in known:
            raise table.error("front", one_of(key, known), key)
    if len(pair) != 2 or pair[0] == pair[1]:
        raise table.error("front", "must be two different quantities", list(pair))
    return pair[0], pair[1]


def _tolerances(table: Table) -> Tolerances | None:
    given = table.value("tolerances", {})
    if given == "none":
        return None
    if isinstance(given, str):
        return Tolerances.read(table.beside("tolerances"))
    return read(Tolerances, table.table("tolerances", {}))

