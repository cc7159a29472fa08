"""Requirements of a film, given numbers, and free numbers: REQUIREMENTS.toml."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Self

from tympan.base.errors import InputError
from tympan.base.fields import Key, Special, checks_types, field_at, fields_of, read
from tympan.base.toml_reader import FINITE, NON_NEGATIVE, POSITIVE, Rule, Table, one_of
from tympan.fem.film.library import library_material
from tympan.fem.rig import (
    MOST_MASS,
    MOST_VOLTAGE,
    OWN,
    Rig,
    load_actuator,
    mounted_together,
    rig_under,
)
from tympan.geometry.specimen import Specimen, require_different_names
from tympan.studies.design.ranges import Vary
from tympan.studies.driven import by_segment, driven_once, film_voltage
from tympan.studies.films.box import SPRING, varying
from tympan.studies.films.family import require_reducible
from tympan.studies.limits.loads import require_moved
from tympan.studies.shipped import specimen_tables
from tympan.studies.tolerance.given import Tolerances, tolerances_under
from tympan.studies.wanted import (
    BREAKDOWN,
    QUANTITIES,
    TENSION,
    Bound,
    Quantity,
    by_key,
    table_bounds,
)

#: Words for the one quantity that is to be optimised.
_BEST = {True: "largest", False: "least"}
#: Loads that may vary, with their rules; a load of 0 leaves nothing to design.
VARIED_LOADS: dict[str, Rule] = {
    "mass": (lambda x: 0 < x <= MOST_MASS, f"must be above 0 and at most {MOST_MASS:g} kg"),
    "voltage": (lambda x: 0 < x <= MOST_VOLTAGE,
                f"must be above 0 and at most {MOST_VOLTAGE / 1e3:g} kV")}
#: Everything that may vary besides numbers of the specimen: dimensions and rules.
_BESIDE: dict[str, tuple[str, Rule]] = {
    **{key: (key, rule) for key, rule in VARIED_LOADS.items()},
    SPRING: ("stiffness per length", NON_NEGATIVE)}

#: Keys of `tympan optimise` and of the former search by finite elements, and their replacements.
_FORMER = {
    "search": "is no longer a key: the search is by reduced films, and finite elements check the "
              "best one; leave it out",
    "hold": "is no longer a key: write frame_area or frame_perimeter in [want], which the frame "
            "has at most",
    "reference": "is no longer a key: name that film as the specimen; the result says what it has "
                 "now, beside the best film",
    "start": "is no longer a key: the search begins at the best of random films in the ranges of "
             "[vary]; leave it out",
    "pull_in_margin": "is no longer a quantity: write tension_margin, the voltage of the "
                      "film's first loss of tension or pull-in, over its voltage"}
#: Keys of such files by the names that they had formerly.
FORMER_KEYS = {"limits": "bounds"}
#: Message for a file without wants, as in the files of `tympan optimise`.
_NO_WANT = ('is missing: write a table [want], such as stroke = "largest" and bounds: '
            'tension_margin = 1.2, frame_area = "100 cm^2"')

#: Paths of segments' numbers, and their keys in files.
_SEGMENTS = "electrode.segments.", "electrode.segment."
#: End of the keys of segments' voltages over the film's. They may be 0, unlike lengths.
_OF_VOLTAGE = ".share"

#: Magnitude of a negative number that tests a rule: offsets and exponents allow it, lengths do not.
_SIGNED = 1e-3

_SHARE: Rule = (lambda x: 0.5 <= x <= 0.99, "must be a share of the films from 0.5 to 0.99")
_LAYERS: Rule = (lambda x: 1 <= x <= 100, "must be whole numbers from 1 to 100")


@dataclass(frozen=True)
class SoldFilm:
    """Films that can be bought: every thickness in every number of layers."""

    thickness: Annotated[tuple[float, ...], Key("virgin thicknesses", "length", POSITIVE)]
    layers: Annotated[tuple[int, ...], Key("numbers of layers", rule=_LAYERS)] = (1,)
    material: Annotated[str, Key("name in the library", default="the specimen's material")] = ""


@dataclass(frozen=True)
class RequirementsFile:
    """Keys of a requirements file; tables whose keys are names are kept as written."""

    specimen: Annotated[tuple[Specimen, ...], Key(
        "a specimen: its file, one of the paper's by name, or its tables; or a list of them, one "
        "for each kind of outline; what does not vary is of these")]
    want: Annotated[Table, Key(
        "bounds of quantities by their names; at most one of these is \"largest\" or \"least\"")]
    vary: Annotated[Table, Key(
        "lowest and highest value of each number that may vary: of the specimen by its path, such "
        "as \"plate.radius\", of mass, voltage or rig.spring")]
    mass: Annotated[float | None, Key("load on the plate", "mass", VARIED_LOADS["mass"],
                                      default="required where it does not vary")] = None
    voltage: Annotated[float | None, Key(
        "of the supply; of segments by their names: \"A = 3 kV, B = 0 kV\"", "voltage",
        VARIED_LOADS["voltage"], default="required where it does not vary")] = None
    name: Annotated[str, Key("of the result and its files", default="the file's name")] = ""
    share: Annotated[float, Key("of the films that keep all bounds", rule=_SHARE)] = 0.95
    front: Annotated[tuple[str, ...], Key(
        "two quantities between whose best films others are sought")] = ()
    films: Annotated[tuple[SoldFilm, ...], Key(
        "films of which one is chosen; without, that of the specimen", name="film")] = ()
    rig: Annotated[Rig | None, Key("of the actuator: its keys, or the name of their file",
                                   default="that of the specimens")] = None
    tolerances: Annotated[Tolerances | None, Key(
        "how numbers scatter: keys of TOLERANCES.toml, the name of such a file, or \"none\"")
        ] = Tolerances()
    bounds: Annotated[Table | None, Key(
        "bounds as in want, also of a quantity that is \"largest\" or \"least\" there")] = None


def sought() -> dict[str, Quantity]:
    """List the quantities that a design can aim at, by name."""
    return {key: quantity for key, quantity in QUANTITIES.known.items() if quantity.sought}


@checks_types
@dataclass(frozen=True)
class Requirements:
    """Bounds that 95 % of the films keep, and one quantity that is to be optimised.

    ``specimens``: one for each kind to try; fixed numbers are theirs. ``bounds``: by their keys.
    ``best``: one of :func:`sought`, or "" for the film that keeps all bounds by the largest common
    share. ``mass`` [kg] and the supply's ``voltage`` [V]: where they do not vary. ``tolerances``:
    None for films without scatter. ``front``: two quantities between whose best films others are
    sought. ``least``: whether the least value of ``best`` is sought, where neither is better of
    itself.
    """

    name: str
    specimens: tuple[Specimen, ...]
    mass: float
    voltage: float
    variables: Mapping[str, tuple[Vary, ...]]
    bounds: Mapping[str, Bound]
    best: str = ""
    rig: Rig = OWN
    tolerances: Tolerances | None = field(default_factory=Tolerances)
    share: float = 0.95
    front: tuple[str, str] | None = None
    least: bool | None = None

    def __post_init__(self) -> None:
        specimens, rig = mounted_together(self.specimens, self.rig)
        object.__setattr__(self, "specimens", specimens)
        object.__setattr__(self, "rig", rig)

    @classmethod
    def read(cls, file: Path | str) -> Self:
        """Read requirements from a TOML file; specimens are files next to it, or the paper's."""
        return cls._of(Table.read(file, "requirements"))

    @classmethod
    def shipped(cls) -> Self:
        """Read the example of the paper's large ellipse: the largest stroke for its frame area."""
        with resources.as_file(resources.files("tympan.studies.design") / "ellipse.toml") as file:
            return cls.read(file)

    @classmethod
    def _of(cls, table: Table) -> Self:
        if "want" not in table:
            raise table.error("want", _NO_WANT)
        _refuse_former(table)
        for former, now in FORMER_KEYS.items():
            table = table.renamed(former, now)
        given = read(RequirementsFile, table, _READERS)
        wired = table.data.get("voltage")
        try:
            specimens, rig = mounted_together(_specimens(table, given), given.rig)
            if by_segment(wired):
                specimens = tuple(_driven(specimen, wired)[0] for specimen in specimens)
        except InputError as error:
            raise error.located(file=table.file) from None
        variables = _variables(given.vary, specimens, rig)
        mass, voltage = _loads(table, given, variables, specimens)
        for specimen in specimens:
            try:
                require_reducible(specimen, rig)
                require_moved(specimen, rig, mass)
            except InputError as error:
                raise error.located(file=table.file) from None
        bounds, best, least = _wanted(table, (given.want, given.bounds), specimens)
        return cls(given.name or Path(table.file).stem, specimens, mass, voltage, variables, bounds,
                   best, rig, given.tolerances, given.share, _front(table, given.front), least)

    def seeks_more(self, quantity: Quantity) -> bool:
        """Check whether more of a quantity is better, in these requirements."""
        if quantity.gain is None and quantity.name == self.best:
            return not self.least
        return bool(quantity.gain)

    @property
    def margin(self) -> float:
        """Voltage that a film must bear without loss of tension, over its own voltage."""
        bound = self.bounds.get(TENSION)
        return 1.0 if bound is None else bound.value

    @property
    def swings(self) -> bool:
        """Whether a bound or an aim needs frequencies."""
        names = (bound.name for bound in self.bounds.values())
        return "frequency" in (*names, self.best, *(self.front or ()))

    def kept(self, specimen: Specimen) -> dict[str, Bound]:
        """Collect all bounds of a specimen; its film must bear the voltage in any case."""
        always = [TENSION]
        if specimen.membrane.strength is not None:
            always.append(BREAKDOWN)
        return {**by_key(Bound(name, 1.0, True) for name in always), **self.bounds}


def _driven(specimen: Specimen, given: object) -> tuple[Specimen, float]:
    """Set the shares of a specimen's segments from voltages by their names; also the film's [V]."""
    wired, voltage = driven_once(specimen, given)
    if not VARIED_LOADS["voltage"][0](voltage):
        raise InputError("must have one voltage for each segment, one of them above 0",
                         key="voltage", given=str(given))
    return wired, voltage


def _refuse_former(table: Table) -> None:
    """Refuse former keys, and say what to write instead."""
    for key in table.data:
        if key in _FORMER:
            raise table.error(key, _FORMER[key])


def _specimens(table: Table, given: RequirementsFile) -> tuple[Specimen, ...]:
    """Make the specimens of all kinds and films to try, with different names."""
    kinds = given.specimen
    require_different_names(kinds)
    films = [film for number, sold in enumerate(given.films)
             for film in _choices(table, f"film.{number}", sold)]
    if not films:
        return tuple(kinds)
    return tuple(_made(specimen, film) for specimen, film in product(kinds, films))


def _choices(table: Table, key: str, sold: SoldFilm) -> list[dict[str, Any]]:
    """List every thickness of a catalogue entry in every number of layers."""
    try:
        material = {"material": library_material(sold.material)} if sold.material else {}
    except InputError as error:
        raise table.error(f"{key}.material", error.allowed, sold.material) from None
    return [{"name": sold.material, "thickness": thickness, "layers": count, **material}
            for thickness, count in product(sold.thickness, sold.layers)]


def _made(specimen: Specimen, film: dict[str, Any]) -> Specimen:
    """Make the specimen with a film of the catalogue, and name it after the film."""
    given = {key: value for key, value in film.items() if key != "name"}
    words = [specimen.name, film["name"], f"{1e6 * film['thickness']:.0f}um"]
    words += [f"{film['layers']}x"] * (film["layers"] > 1)
    if "material" in given:
        old = specimen.membrane
        made = type(old)(prestretch=old.prestretch, density=old.density, **given)
    else:
        made = replace(specimen.membrane, **given)
    return replace(specimen, name="-".join(filter(None, words)), membrane=made)


def _loads(table: Table, given: RequirementsFile, variables: Mapping[str, tuple[Vary, ...]],
           specimens: tuple[Specimen, ...]) -> tuple[float, float]:
    """Read mass [kg] and voltage [V]; a varied load has its highest value.

    Films without plates need no mass.
    """
    wired = table.data.get("voltage")
    voltage = (_driven(specimens[0], wired)[1] if by_segment(wired) else given.voltage)
    return (_load(table, "mass", given.mass, variables,
                  needed=any(each.plate is not None for each in specimens)),
            _load(table, "voltage", voltage, variables))


def _load(table: Table, key: str, given: float | None, variables: Mapping[str, tuple[Vary, ...]],
          *, needed: bool = True) -> float:
    """Read a load that is given or varies."""
    varied = [each.high for several in variables.values() for each in several if each.key == key]
    if varied and given is not None:
        raise table.error(key, "is given and varies, too: only one of both", table.data[key])
    if given is None and not varied and needed:
        table.value(key)  # raises the error of a missing key
    return varied[0] if varied else given or 0.0


def _variables(inner: Table, specimens: tuple[Specimen, ...], rig: Rig
               ) -> dict[str, tuple[Vary, ...]]:
    """Read the varied keys of each specimen, by its name; one of them must know each key."""
    keys = {each.name: _keys(each) for each in specimens}
    known = dict.fromkeys(key for several in keys.values() for key in several)
    found: dict[str, list[Vary]] = {specimen.name: [] for specimen in specimens}
    if not inner.data:
        raise InputError(f"must name at least one of {', '.join(sorted(known))}", file=inner.file,
                         key=inner.where)
    for key, given in inner.data.items():
        if key not in known:
            instead = next((words[key] for words in map(_halves, specimens) if key in words), "")
            raise inner.error(key, instead + one_of(key, known), given)
        if key == SPRING and rig.spring:
            raise inner.error(key, "is given in [rig], and varies, too: only one of both", given)
        for specimen in specimens:
            if key in keys[specimen.name]:
                found[specimen.name].append(
                    _varied(inner, key, keys[specimen.name][key], specimen))
    inner.done()
    return {name: tuple(several) for name, several in found.items()}


def _halves(specimen: Specimen) -> dict[str, str]:
    """Make advice for words in files that mean twice a number, such as the width of a frame."""
    parts = {"frame": specimen.frame, "plate": specimen.plate and specimen.plate.outline}
    return {f"{part}.{word}": f"write {part}.{each.key}.{number} and half of these lengths; "
            for part, outline in parts.items() if outline is not None
            for each in fields_of(type(outline)) for number, word in enumerate(each.says.doubled)}


def _varied(table: Table, key: str, names: tuple[str, ...], specimen: Specimen) -> Vary:
    """Read the range of one key's numbers of a specimen."""
    if key in _BESIDE:
        dimension, rule = _BESIDE[key]
    else:
        declared = field_at(specimen, tuple(names[0].split(".")))
        dimension = declared.says.dimension if declared is not None else ""
        declared_rule = declared.says.rule if declared is not None else None
        signed = declared_rule is not None and declared_rule[0](-_SIGNED)
        rule = FINITE if signed else POSITIVE
        if key.endswith(_OF_VOLTAGE) and declared_rule is not None:
            rule = declared_rule
    low, high = table.numbers(key, dimension, count=2, rule=rule)
    if not low < high:
        raise table.error(key, "must be a lower and a larger upper bound", table.data[key])
    return Vary(key, names, low, high, dimension)


def _keys(specimen: Specimen) -> dict[str, tuple[str, ...]]:
    """List numbers that may vary by key; the key of a list varies all its numbers alike."""
    found: dict[str, tuple[str, ...]] = {}
    for name in varying(specimen):
        key = name.replace("plate.outline.", "plate.", 1).replace(*_SEGMENTS, 1)
        found[key] = (name,)
        head, _, last = key.rpartition(".")
        if last.isdigit():
            found[head] = (*found.get(head, ()), name)
    return {**found, **dict.fromkeys(_BESIDE, ())}


def _wanted(table: Table, bounded: Sequence[Table | None], specimens: tuple[Specimen, ...]
            ) -> tuple[dict[str, Bound], str, bool | None]:
    """Read bounds by their keys, and the quantity to optimise; also whether its least is sought."""
    bounds: dict[str, Bound] = {}
    best, least = "", None
    for inner in filter(None, bounded):
        _refuse_former(inner)
        rest = dict(inner.data)
        for key, given in inner.data.items():
            if key not in QUANTITIES.known:
                raise inner.error(key, one_of(key, sought()), given)
            quantity = QUANTITIES[key]
            if not quantity.sought:
                raise inner.error(key, f"is not searched for: write {TENSION} and {BREAKDOWN}, the "
                                       "voltages of these limits over the film's", given)
            for each in specimens:
                if quantity.of_plate and each.plate is None:
                    raise inner.error(key, f"needs a plate, and {each.name} has none", given)
            if key == BREAKDOWN and any(each.membrane.strength is None for each in specimens):
                raise inner.error(key, "needs films whose electric strength is known "
                                       "(membrane.breakdown)")
            if given not in _BEST.values():
                continue
            if key == TENSION:
                raise inner.error(key, "must be a bound, such as 1.2: reduced films are followed "
                                       "no further than to it", given)
            usual = quantity.gain is None or given == _BEST[quantity.gain]
            if inner.where != "want" or not usual:
                word = " or ".join(f'"{_BEST[gain]}"' for gain in (True, False)
                                   if quantity.gain in (gain, None))
                sense = ("at least" if quantity.gain else "at most" if quantity.gain is not None
                         else "at least or at most")
                raise inner.error(key, f"must be {word} in [want], or a number that it is to be "
                                       f"{sense}", given)
            if best:
                raise inner.error(key, f"only one quantity can be best: {best} is", given)
            best = key
            least = given == _BEST[False] if quantity.gain is None else None
            inner.asked.add(key)
            del rest[key]
        found = by_key(table_bounds(replace(inner, data=rest)))
        twice = next((bound.name for key, bound in found.items() if key in bounds), None)
        if twice is not None:
            raise inner.error(twice, "has a bound in [want], too: only one of both",
                              inner.data[twice])
        bounds |= found
    if not bounds and not best:
        raise table.error("want", f"must name at least one of {', '.join(sought())}")
    return bounds, best, least


def _front(table: Table, pair: tuple[str, ...]) -> tuple[str, str] | None:
    """Read the two quantities of a front."""
    if not pair:
        return None
    known = {name: each for name, each in sought().items()
             if name != TENSION and each.gain is not None}
    for key in pair:
        if key not in known:
            raise table.error("front", one_of(key, known), key)
    if len(pair) != 2 or pair[0] == pair[1]:
        raise table.error("front", "must be two different quantities", list(pair))
    return pair[0], pair[1]


def _loaded(table: Table, key: str) -> tuple[Specimen, ...]:
    return tuple(map(load_actuator, specimen_tables(table, key)))


#: Readers of keys that accept more forms than their declaration.
_READERS: Special = {
    (RequirementsFile, "specimen"): _loaded,
    (RequirementsFile, "want"): Table.table,
    (RequirementsFile, "vary"): Table.table,
    (RequirementsFile, "voltage"): lambda table, key: film_voltage(
        table, key, VARIED_LOADS["voltage"]),
    (RequirementsFile, "bounds"): lambda table, key: table.table(key, {}),
    (RequirementsFile, "rig"): rig_under,
    (RequirementsFile, "tolerances"): lambda table, key: tolerances_under(table, key,
                                                                          Tolerances()),
}
