"""One specimen at one load and one voltage: from CAD to numbers."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import lru_cache
from itertools import chain, islice, product
from math import hypot
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key, Printed, asks, checks_types
from tympan.base.toml_reader import NON_NEGATIVE
from tympan.base.units import drive_words, place_text, segment_words
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.discretisation.isoparametric import folded
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import Outcome, Status, in_words
from tympan.fem.equilibrium.snap import resting
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.voltage_path import voltage_path
from tympan.fem.film.admissibility import failures
from tympan.fem.film.tension_field import Tension
from tympan.fem.membrane.biases import JoinedFilm
from tympan.fem.membrane.formula import FORMULAS, Formula, FormulaFilm
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.plausible_loads import implausible_loads
from tympan.fem.results.fields import Fields, LostTension
from tympan.fem.results.firmness import firmness
from tympan.fem.results.limit_states import (
    BREAKDOWN,
    INSTABILITY,
    LIMIT_STATES,
    PULL_IN,
    TENSION,
    LimitState,
)
from tympan.fem.results.solved_states import SolvedStates
from tympan.fem.rig import DIRECTIONS, OWN, Rig, checked_load, mounted
from tympan.geometry.mesh import segmented, unfold
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Film, Specimen
from tympan.studies.files import from_json, read_json, remove, stored_file, to_json, write_json
from tympan.studies.film_surface import NO_SURFACE, FilmSurface, film_surface
from tympan.studies.joined_film import SolvedFilm, with_films
from tympan.studies.kept.meshes import film_part
from tympan.studies.rows import columns_of
from tympan.studies.segments import OfSegments, segments_of
from tympan.studies.variables import ShowsState, StateValues, rows_of_variables

#: Margin to breakdown below which a result warns; strengths scatter by more.
LEAST_MARGIN = 1.2

#: Elements times states summarised at once: more would leave the cache, or take much memory.
_TOGETHER = 400

_ALONE = Loading()

#: What is said where the mass of a question about one state is left out.
NO_MASS = 'must be given, such as "17.9 g", or "0 g" for none: the film has a plate'

#: Fields that several results have.
#: Text of a result that is the kind of a limit state.
OF_LIMITS = Printed(choices=LIMIT_STATES)

Existence = Annotated[Status, Key("whether there is an equilibrium; past pull-in there is none")]
Deflection = Annotated[float | None, Key("deflection of the plate, downwards")]
UnknownCount = Annotated[int, Key("unknowns of the finite elements")]
WallTime = Annotated[float, Key("time it took")]
Warnings = Annotated[tuple[str, ...], Key("what limits the result, in sentences")]


@checks_types
@dataclass(frozen=True)
class Settings:
    """Settings of a computation: mesh, path, use of mirror symmetry, and what computes the film.

    ``formula``: name of a film in closed form of :data:`~tympan.fem.membrane.formula.FORMULAS`; by
    default finite elements compute the film.
    """

    mesh: MeshSettings = field(default_factory=MeshSettings)
    path: PathSettings = field(default_factory=PathSettings)
    symmetry: bool = True
    formula: str | None = None

    def __post_init__(self) -> None:
        if self.formula is not None and self.formula not in FORMULAS.whole(self.formula):
            raise InputError(f"must be a registered film in closed form: "
                             f"{', '.join(FORMULAS) or 'there is none'}", key="formula",
                             given=self.formula)

    @property
    def closed_form(self) -> Formula | None:
        """Film in closed form; None where finite elements compute the film."""
        return None if self.formula is None else FORMULAS[self.formula]

    def require_elements(self) -> None:
        """Raise InputError for a film in closed form, where a mesh is asked for."""
        if self.formula is not None:
            raise InputError("must be left out: a film in closed form has no mesh to write",
                             key="formula", given=self.formula)

    def bounded(self, model: Model, loads: int = 1) -> Settings:
        """Share one budget of work between all searches over many loads of a model."""
        return replace(self, path=self.path.bounded(model, followed=True, loads=loads))


@asks
@dataclass(frozen=True)
class Case:
    """A specimen on a rig under a nominal ``mass`` [kg] and ``voltage`` [V].

    An :class:`~tympan.fem.rig.Actuator` is on its own rig unless another is given. It is read
    ``elapsed`` [s] after the run began; ``direction`` is 1 where the voltage was reached
    from below, -1 from above, 0 if unknown. Texts carry their unit.
    """

    specimen: Specimen
    _: KW_ONLY
    mass: Annotated[float, Key("nominal load on the plate", "mass")] = 0.0
    voltage: Annotated[float, Key("nominal voltage", "voltage")] = 0.0
    rig: Rig = OWN
    elapsed: Annotated[float, Key("time since the run began", "time", NON_NEGATIVE)] = 0.0
    direction: float = 0.0

    if TYPE_CHECKING:
        def __init__(self, specimen: Specimen, *, mass: float | str = 0.0,
                     voltage: float | str = 0.0, rig: Rig = OWN, elapsed: float | str = 0.0,
                     direction: float | str = 0.0) -> None: ...

    def __post_init__(self) -> None:
        specimen, rig = mounted(self.specimen, self.rig)
        object.__setattr__(self, "specimen", specimen)
        object.__setattr__(self, "rig", rig)
        checked_load(self.mass, self.voltage, self.rig.gas_pressure)
        if isinstance(self.direction, str) and self.direction in DIRECTIONS:
            object.__setattr__(self, "direction", DIRECTIONS[self.direction])
        if self.direction not in DIRECTIONS.values():
            raise InputError("must be up (1), down (-1) or not known (0)", key="direction",
                             given=self.direction)
        if self.specimen.plate is None:
            self.rig.require_no_plate_loads()
            if self.mass:
                raise InputError("must be 0: the film has no plate to carry it", key="--mass",
                                 given=f"{self.mass:g} kg")

    @classmethod
    def greatest(cls, specimen: Specimen, masses: Iterable[float], voltages: Iterable[float],
                 rig: Rig = OWN) -> Case:
        """Make the case of the largest of several masses [kg] and the highest of voltages [V]."""
        return cls(specimen, mass=max(masses, key=abs, default=0.0),
                   voltage=max(voltages, key=abs, default=0.0), rig=rig)

    @property
    def film_voltage(self) -> float:
        """Voltage on the film itself [V]."""
        return float(self.rig.film_voltage(self.voltage, self.direction))

    @property
    def axisymmetric(self) -> bool:
        """Whether film and loads are axisymmetric, and so are all results."""
        return self.specimen.axisymmetric and not any(self.rig.weight_offset)

    def force(self, plate_area: float) -> float:
        """Compute the force on the film [N] for a plate's area [m²], with full friction."""
        return float(self.rig.rubbed(self.rig.force(self.mass, plate_area), self.direction))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences that belong to every result of this case, with those of its rig."""
        return remarks_on(self.specimen, self.rig, self.mass, self.voltage)

    def doubted(self, reason: str) -> str:
        """Add to a reason for refusal which of the loads may be a mistake."""
        return "; ".join((reason, *self._doubts))

    @property
    def _doubts(self) -> list[str]:
        return implausible_loads(self.specimen, self.rig, self.mass, self.voltage)


@dataclass(frozen=True, kw_only=True)
class SpecimenRecord:
    """Numbers of one specimen, SI, in a file named after it and the record's ``ending``.

    ``film`` is the deformed film, if it exists and was requested; its VTU file stands beside the
    numbers. ``writer`` is the command that writes both.
    """

    ending: ClassVar[str] = ""
    writer: ClassVar[str]
    #: Kinds of files that an earlier run may have left, and of the pictures among them.
    kinds: ClassVar[tuple[str, ...]] = ("vtu", "json")
    drawn: ClassVar[tuple[str, ...]] = ()
    #: Columns of its rows that are dimensions where xarray has them: what was varied.
    indexed: ClassVar[tuple[str, ...]] = ()

    specimen: Annotated[str, Key("name of the specimen")]
    film: FilmSurface | None = field(default=None, repr=False, compare=False)

    def json(self) -> dict[str, Any]:
        """Write the record as a JSON object, without films."""
        record: dict[str, Any] = to_json(self)
        return record

    @property
    def rows(self) -> Any:
        """Rows of its tables, as pandas reads them: one with all that is printed, unless it lists.

        Names of columns end in SI units.
        """
        record = self.json()
        for name, parts in columns_of(self).items():
            del record[name]
            record |= parts
        return [record | {key: " | ".join(record[key]) for key in ("warnings",) if key in record}]

    @property
    def pictures(self) -> tuple[str, ...]:
        """Names of its pictures."""
        return tuple(f"{self.specimen}{self.ending}.{kind}" for kind in self.drawn)

    def save(self, folder: Path) -> None:
        """Write NAME, the ending, ``.json`` and, if there is a film, ``.vtu``."""
        name = f"{self.specimen}{self.ending}"
        remove(folder, *(f"{name}.{kind}" for kind in self.kinds))
        if self.film is not None:
            self.film.save(folder / f"{name}.vtu")
        write_json(folder / f"{name}.json", self.json())

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> Self:
        """Load a saved result, by the specimen's ``name``, or the only one."""
        file = stored_file(folder, f"*{cls.ending}.json", name, cls.writer)
        result = from_json(cls, read_json(file), file)
        surface = file.with_suffix(".vtu")
        return replace(result, film=FilmSurface.load(surface)) if surface.exists() else result


@dataclass(frozen=True, kw_only=True)
class CaseRecord(SpecimenRecord):
    """Numbers of one case."""

    mass_kg: Annotated[float, Key("nominal load on the plate")]
    voltage_V: Annotated[float, Key("nominal voltage")]
    pressure_Pa: Annotated[float | None, Key("pressure of the gas below the film; positive lifts "
                                             "it, none where there is no gas")] = None


#: Distance from the centre below which a place is the centre [m].
_CENTRE = 1e-6

#: Relative error of a limit from which on it is printed. Limits are printed with four digits, and
#: films scatter more.
_WORTH = 5e-3
#: Relative error of a limit from which on the mesh is too coarse to resolve it. Set by trial.
_RESOLVED = 0.05
#: Relative error of a limit above which no digit is certain: no percentage is printed.
_VAGUE = 1.0


@dataclass(frozen=True, kw_only=True)
class Limit:
    """First limit of a film as its voltage rises, and where in the mounted film."""

    kind: Annotated[str, Key("kind of the limit: its key in the limits of a film"), OF_LIMITS]
    voltage_V: Annotated[float, Key("nominal voltage")]
    x_m: Annotated[float, Key("where it begins, in the mounted film: for a pull-in, where the film "
                              "thins fastest")]
    y_m: Annotated[float, Key("y of the same place")]
    spread: Annotated[float, Key("how far the voltage may be off, relative")] = 0.0
    at_edge: Annotated[bool, Key("whether it begins at the edge of an electrode")] = False
    at_corner: Annotated[bool, Key("whether it begins at a sharp corner, where the film's stress "
                                   "and field grow with every refinement of the mesh")] = False
    ring: Annotated[bool, Key("whether it begins all around at the place's distance from the "
                              "centre, as film, plate and load are round")] = False
    segment: Annotated[str | None, Key(
        "segment of the electrode in which it begins, or the nearest ones, after commas; none of "
        "an electrode in one piece")] = None
    segment_voltages_V: Annotated[Mapping[str, float], Key(
        "voltages of the segments there, by their names; empty without segments")] = field(
            default_factory=dict)

    @property
    def state(self) -> LimitState:
        """Limit state: label and mark."""
        state: LimitState = LIMIT_STATES[self.kind]
        return state

    @property
    def words(self) -> str:
        """Label and voltage."""
        return self.state.at(self.text)

    @property
    def place(self) -> str:
        """Place where it begins, in millimetres."""
        away = hypot(self.x_m, self.y_m)
        where = (f"r {place_text(away, 0.0).partition(',')[0][2:]}, all around"
                 if self.ring and away > _CENTRE else place_text(self.x_m, self.y_m))
        return (where + segment_words(self.segment) + ", the electrode's edge" * self.at_edge
                + ", a sharp corner" * self.at_corner)

    @property
    def drive(self) -> str:
        """Voltages of the segments, where they differ: "A 6.2 kV, B 2.1 kV"; else ""."""
        return drive_words(self.segment_voltages_V)

    def of(self, specimen: Specimen) -> Limit:
        """Add the voltages of a specimen's segments, and the segment nearest to the place."""
        segment = self.segment or specimen.segment_near(self.x_m, self.y_m)
        return replace(self, segment=segment,
                       segment_voltages_V=specimen.electrode.voltages(self.voltage_V))

    @property
    def advice(self) -> str | None:
        """Advice to make it more accurate; None if it is accurate enough."""
        if self.at_corner:
            return ("the finer the mesh, the lower this voltage: round the corner, with `fillet` "
                    "or `corner_radius`")
        return None if self.resolved else (
            "the mesh hardly resolves this: divide its elements further, with a larger --refine")

    @property
    def text(self) -> str:
        """Voltage, with its possible error where the mesh resolves it badly.

        Examples
        --------
        >>> Limit(kind="pull_in", voltage_V=2991.97, x_m=0.0, y_m=0.0, spread=1e-4).text
        '2.992 kV'
        >>> Limit(kind="tension", voltage_V=2663.0, x_m=0.0, y_m=0.0, spread=0.3).text
        '2.663 kV ± 30 %'
        >>> Limit(kind="tension", voltage_V=2663.0, x_m=0.0, y_m=0.0, spread=110.0).text
        'about 3 kV (known to its order of magnitude only)'
        """
        voltage_kV = self.voltage_V / 1e3
        if self.spread > _VAGUE:
            return f"about {float(f'{voltage_kV:.1g}'):g} kV (known to its order of magnitude only)"
        off = f" ± {100 * self.spread:.2g} %" if self.spread >= _WORTH else ""
        return f"{voltage_kV:.4g} kV{off}"

    @property
    def resolved(self) -> bool:
        """Whether the mesh is fine enough to resolve it."""
        return self.spread < _RESOLVED


@dataclass(frozen=True)
class Limits:
    """First limits of a film under a mass, by their kinds, those of :data:`LIMIT_STATES`.

    A limit is an attribute by its kind too, such as ``pull_in``. None stands for a limit that is
    not met as far as the voltage was raised.
    """

    by_kind: Annotated[Mapping[str, Limit | None], Key("limits by their kinds"),
                       Printed(choices=LIMIT_STATES, inline=True)]
    _: KW_ONLY
    first: Annotated[str | None, Key("kind of the limit that comes first"), OF_LIMITS] = None
    ended: Annotated[str, Key("why the voltage was not raised further")]
    thins: Annotated[bool, Key("whether the instability is thinning without bound of a film that "
                               "has lost tension; a pull-in after that is the one of a film kept "
                               "from wrinkling")] = False

    def __post_init__(self) -> None:
        every = {kind: self.by_kind.get(kind) for kind in LIMIT_STATES}
        object.__setattr__(self, "by_kind", every)
        object.__setattr__(self, "first", self.reached[0].kind if self.reached else None)

    def __getattr__(self, kind: str) -> Limit | None:
        if kind not in LIMIT_STATES:
            raise AttributeError(f"{type(self).__name__} has no {kind!r}")
        return self.by_kind.get(kind)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *LIMIT_STATES]

    @property
    def reached(self) -> tuple[Limit, ...]:
        """Limits that are reached as the voltage rises, in the order in which they come."""
        return tuple(sorted(self._met(falling=False), key=lambda limit: limit.voltage_V))

    @property
    def told(self) -> tuple[Limit, ...]:
        """All limits: those that are met as the voltage falls come last."""
        return *self.reached, *self._met(falling=True)

    def _met(self, falling: bool) -> list[Limit]:
        return [limit for kind, limit in self.by_kind.items()
                if limit is not None and LIMIT_STATES[kind].falling == falling]

    @property
    def limit(self) -> Limit | None:
        """First limit that is reached."""
        return next(iter(self.reached), None)

    @property
    def end(self) -> Limit | None:
        """Limit beyond which the film has no equilibrium, stable or not."""
        return self.instability if self.thins else self.pull_in

    def beyond(self, voltage: float) -> Limit | None:
        """Find the most severe limit that a nominal voltage [V] is beyond."""
        # The pull-in calculated for a film that could not thin is no limit of one that does.
        beyond = {limit.kind: limit for limit in self.reached if voltage > limit.voltage_V
                  and not (self.thins and limit.kind == PULL_IN.kind)}
        return next((beyond[kind] for kind in reversed(LIMIT_STATES) if kind in beyond), None)


@dataclass(frozen=True, kw_only=True)
class Band:
    """Spread of one number between films that scatter; its unit is that of the number."""

    low: Annotated[float, Key("5 % of the films have less")]
    median: Annotated[float, Key("half of the films have more")]
    high: Annotated[float, Key("5 % of the films have more")]
    share: Annotated[float, Key("films that have a stable equilibrium there, in tension and below "
                                "their electric strength, of all")]


@dataclass(frozen=True, kw_only=True)
class StableEquilibrium:
    """One of several equilibria at which the plate may stay under the same loads."""

    deflection_m: Annotated[float, Key("deflection of the plate, downwards")]
    reached: Annotated[bool, Key("whether the mounted plate comes to it, loaded slowly and then "
                                 "charged slowly")]


@dataclass(frozen=True, kw_only=True)
class CaseResult(ShowsState, CaseRecord):
    """The numbers of ``solve --json``, SI; those of a state that does not exist are None.

    Each of the :data:`~tympan.studies.variables.VARIABLES` of the state is an attribute by its key,
    such as ``deflection_m``. ``film`` has the fields.
    """

    writer = "tympan solve -o"
    drawn = ("png", "svg")

    status: Existence
    values: StateValues = field(default_factory=dict)
    segments: OfSegments = ()
    charge_by_voltage_F: Annotated[tuple[tuple[float, ...], ...], Key(
        "capacitance matrix of the segments: how the charge of each, a row, grows with the voltage "
        "of each, a column, while film and plate follow; with both held it is diagonal, the "
        "segments' capacitances; empty without segments, and where it was not asked for")] = ()
    equilibria: Annotated[tuple[StableEquilibrium, ...], Key(
        "all stable equilibria under these loads, by deflection, where a mechanism of the rig "
        "makes several; all other results are of the one that is reached")] = ()
    limits: Annotated[Limits | None, Key("limits of the film under this mass, where they were "
                                         "asked for")] = None
    bands: Annotated[Mapping[str, Band], Key(
        "spread between films made to the tolerances, by result; empty where none were given, "
        "and where more than 5 % of the films do not reach the voltage")] = field(
            default_factory=dict)
    first: Annotated[str | None, Key("kind of the limit that comes first"), OF_LIMITS] = None
    limit: Annotated[Limit | None, Key("the most severe limit that the voltage is beyond")] = None
    dofs: UnknownCount
    wall_s: WallTime
    warnings: Warnings

    @property
    def rows(self) -> Any:
        """Row of the table: the entries of the capacitance matrix have columns of their own."""
        row, = super().rows
        del row["charge_by_voltage_F"]
        entries = zip(product([each.name for each in self.segments], repeat=2),
                      chain.from_iterable(self.charge_by_voltage_F), strict=False)
        return [row | {f"charge_{one}_by_voltage_{other}_F": value
                       for (one, other), value in entries}]


def build_model(specimen: Specimen, settings: Settings, loading: Loading = _ALONE) -> Model:
    """Build the film of a specimen as the settings say, with the actions on it.

    CAD, mesh and discretisation are kept, since a study uses a specimen many times.
    """
    model, = build_models((specimen,), settings, loading)
    return model


def build_models(specimens: Sequence[Specimen], settings: Settings, loading: Loading = _ALONE
                 ) -> list[Model]:
    """Build films that differ in the voltages of their segments alone, on one mesh."""
    planes = frozenset.intersection(*(mirror_planes(each, loading) for each in specimens))
    solved = solved_loading(loading, settings)
    return [replace(bare_film(each, settings, planes), loading=solved) for each in specimens]


def solved_loading(loading: Loading, settings: Settings) -> Loading:
    """Solve the films joined to the plate on meshes of the same settings, among its actions."""
    mesh = replace(settings, path=PathSettings())
    guide = "vertical" if loading.guide == "fixed" else loading.guide
    return with_films(loading, lambda bias: _solved_film(
        bias, mesh, Loading(guide=guide, gravity=loading.gravity), settings.closed_form))


@lru_cache(maxsize=8)
def _solved_film(bias: JoinedFilm, settings: Settings, loading: Loading,
                 formula: Formula | None) -> SolvedFilm:
    """Solve a joined film once, since a study needs its force in many models.

    A ``formula`` of the settings' name may be replaced by another one.
    """
    return SolvedFilm.of(bias, build_model(bias.specimen, settings, loading))


def needs_mesh(specimen: Specimen, settings: Settings, loading: Loading = _ALONE) -> object:
    """Collect all values that the mesh of :func:`build_model` depends on, as a key to share it."""
    return (settings.formula, specimen.frame, specimen.plate, specimen.electrode.even,
            settings.mesh.suited(specimen.membrane.prestretch), settings.symmetry,
            mirror_planes(specimen, loading))


def mirror_planes(specimen: Specimen, loading: Loading) -> frozenset[str]:
    """Find the mirror planes that film and loads have in common."""
    return specimen.mirror_planes - {axis for axis, arm in zip("xy", loading.arm, strict=True)
                                     if arm}


def bare_film(specimen: Specimen, settings: Settings, planes: frozenset[str]) -> Model:
    """Make the film of a specimen as the settings say, without any actions on it.

    ``planes``: mirror planes, of finite elements.
    """
    formula = settings.closed_form
    return (meshed(specimen, settings, planes) if formula is None
            else FormulaFilm.of(formula, specimen))


@lru_cache(maxsize=32)
def meshed(specimen: Specimen, settings: Settings, planes: frozenset[str]) -> Model:
    """Mesh a specimen with these mirror planes, without any actions on it."""
    even = replace(specimen, electrode=specimen.electrode.even)
    return Model(discretised(even, settings, planes), specimen)


@lru_cache(maxsize=32)
def discretised(specimen: Specimen, settings: Settings, planes: frozenset[str]) -> Discretisation:
    """Mesh a specimen, whose segments have equal voltages, with the mirror planes of any others.

    The whole film has the mirrored mesh of the part, so symmetry changes nothing but the time.
    """
    for refine in (1.0, 2.0, 4.0):
        part = film_part(specimen, settings.mesh.refined(refine), planes)
        if not folded(part):
            if not settings.symmetry:
                part, planes = unfold(part, planes)[0], frozenset()
            return Discretisation.of(segmented(part, specimen, planes), planes)
    raise InputError("cannot be meshed: between the edges of frame, plate and electrode there is "
                     "too little room", key="frame, plate, electrode", given=specimen.name)


def equilibrate(case: Case, settings: Settings, start: Solution | None = None
                ) -> tuple[Model, Outcome]:
    """Build the model of a case and find its equilibrium, or why there is none.

    ``start``: an equilibrium of this model on the way, from which the search begins. If that fails,
    it begins with the flat film.
    """
    rig = case.rig
    model = build_model(case.specimen, settings, rig.loading)
    loads = case.force(model.plate_area), case.film_voltage, rig.gas_pressure
    if start is not None:
        outcome = equilibrium(model, *loads, start, settings.path)
        if outcome.status == "equilibrium":
            return model, outcome
    return model, equilibrium(model, *loads, settings=settings.path)


def voltage_ramp(model: Model, mass: float, voltages: Sequence[float], rig: Rig,
                 path: PathSettings, start: Solution | None = None
                 ) -> Iterator[tuple[Case, Outcome]]:
    """Solve a film at nominal voltages [V] under one mass [kg], each starting from the last one.

    Voltages should ascend: those above one without equilibrium are not searched. ``start`` is an
    equilibrium from which the first one is found.
    """
    outcomes = voltage_path(model, rig.force(mass, model.plate_area),
                            [rig.film_voltage(voltage) for voltage in voltages], rig.gas_pressure,
                            path, start)
    for voltage, outcome in zip(voltages, outcomes, strict=True):
        yield Case(model.specimen, mass=mass, voltage=voltage, rig=rig), outcome


def solve_grid(model: Model, masses: Iterable[float], voltages: Sequence[float], rig: Rig,
               path: PathSettings) -> Iterator[tuple[CaseResult, Outcome]]:
    """Solve every mass [kg] and voltage [V]: numbers, without times, and outcomes.

    All voltages, which ascend, follow for each mass.
    """
    start: Solution | None = None
    for mass in masses:
        cases = summaries(model, voltage_ramp(model, mass, voltages, rig, path, start),
                          max(voltages, key=abs, default=0.0))
        for number, (result, outcome) in enumerate(cases):
            if number == 0 and _charged_next(model, outcome):
                start = outcome.solution
            yield result, outcome


def _charged_next(model: Model, outcome: Outcome) -> bool:
    """Check that another mass may be put on at an equilibrium, and the film be charged then."""
    return (outcome.status == "equilibrium" and not model.slack_when_mounted
            and outcome.state.voltage_squared == 0)


def deflection_without_voltage(case: Case, settings: Settings) -> float | None:
    """Solve a case without its voltage [m]; None if there is no equilibrium."""
    model, outcome = equilibrate(replace(case, voltage=0.0), settings)
    return model.deflection(outcome.state) if outcome.status == "equilibrium" else None


def solve(case: Case, settings: Settings, film: bool = False, start: Solution | None = None
          ) -> CaseResult:
    """Solve one case; with ``film`` the result has its fields on a surface.

    ``start`` is as in :func:`equilibrate`.
    """
    model, outcome, result = solved(case, settings, start)
    result = replace(result, equilibria=_several(model, outcome, settings),
                     charge_by_voltage_F=_charges(model, outcome))
    if not film or outcome.status != "equilibrium":
        return result
    return with_surface(result, film_surface(model, outcome.state))


def _charges(model: Model, outcome: Outcome) -> tuple[tuple[float, ...], ...]:
    """Compute the capacitance matrix of a film's segments in equilibrium [F]; else ()."""
    if outcome.status != "equilibrium" or not model.specimen.electrode.segments or not model.meshed:
        return ()
    from tympan.fem.derivatives.charges import charges_by_voltages

    return tuple(map(tuple, charges_by_voltages(model, outcome.solution).tolist()))


def with_surface(result: CaseResult, surface: FilmSurface | None) -> CaseResult:
    """Add the film's surface to a result, or a warning that it has none."""
    more = () if surface is not None else (NO_SURFACE,)
    return replace(result, film=surface, warnings=(*result.warnings, *more))


def _several(model: Model, outcome: Outcome, settings: Settings) -> tuple[StableEquilibrium, ...]:
    """Find stable equilibria under the loads of an outcome, if there are several."""
    if outcome.status != "equilibrium":
        return ()
    found = resting(model, outcome.solution, settings.path.bounded(model))
    if len(found) == 1:
        return ()
    return tuple(StableEquilibrium(deflection_m=model.deflection(each.state),
                                   reached=each is outcome.solution) for each in found)


def solved(case: Case, settings: Settings, start: Solution | None = None
           ) -> tuple[Model, Outcome, CaseResult]:
    """Solve a case: its model, its equilibrium or why there is none, and the numbers of both."""
    began = time.perf_counter()
    model, outcome = equilibrate(case, settings, start)
    (result, _), = summaries(model, [(case, outcome)])
    return model, outcome, replace(result, wall_s=time.perf_counter() - began)


def summaries(model: Model, cases: Iterable[tuple[Case, Outcome]], highest: float | None = None
              ) -> Iterator[tuple[CaseResult, Outcome]]:
    """Summarise cases of one model in numbers, without times, each with its outcome.

    ``highest`` is the highest nominal voltage [V] of cases that belong together, 0 if low voltages
    need no remark; left out, each case stands alone.
    """
    pairs = iter(cases)
    last: Outcome | None = None
    excuse: tuple[str, ...] = ()
    together = _TOGETHER // max(1, model.discretisation.mesh.nelements)
    while batch := list(islice(pairs, max(1, together))):
        found = SolvedStates(model, [outcome.state for _, outcome in batch
                                     if outcome.status == "equilibrium"])
        shown = zip(rows_of_variables(found, plate=model.specimen.plate is not None),
                    segments_of(found), states_warnings(found), strict=True
                    ) if found.states else iter(())
        for case, outcome in batch:
            remarks = (case if highest is None else replace(case, voltage=highest)).remarks
            result = CaseResult(
                specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage,
                pressure_Pa=case.rig.gas_pressure or None, status=outcome.status,
                dofs=model.unknowns, wall_s=0.0, warnings=())
            if outcome.status == "equilibrium":
                values, segments, warnings = next(shown)
                reading = float(case.rig.reading(values["deflection_m"], case.elapsed))
                yield replace(result, values={**values, "reading_m": reading}, segments=segments,
                              warnings=(*warnings, *remarks)), outcome
                continue
            if outcome is not last:  # all voltages above a limit share its outcome
                when, state = "at the last equilibrium before that", outcome.state
                if outcome.critical is not None:
                    when, state = "before it gets there", outcome.critical.state
                before = (f"{when}, {words}" for words in state_warnings(model, state))
                last, excuse = outcome, (failure_reason(outcome), *before)
            yield replace(result, warnings=(*excuse, *remarks)), outcome


def _sound(model: Model, at_nodes: Sequence[Fields]) -> bool:
    """Check that the law fails nowhere, in all states at once."""
    position, first, second = map(np.concatenate, zip(*(
        (fields.position, fields.stretch_1, fields.stretch_2) for fields in at_nodes), strict=True))
    return not failures(model.specimen.membrane, position, first, second)


def state_warnings(model: Model, state: State) -> list[str]:
    """List warnings that a reader of a state must know before trusting it."""
    return next(states_warnings(SolvedStates(model, [state])))


def states_warnings(found: SolvedStates) -> Iterator[list[str]]:
    """Yield the warnings that a reader of each of the states must know before trusting it."""
    model = found.model
    film = None if _sound(model, found.at_nodes) else model.specimen.membrane
    for state, fields, loss in zip(found.states, found.at_nodes, found.lost, strict=True):
        yield field_warnings(fields, loss, film, _firm(model, state))


def _firm(model: Model, state: State) -> Array | None:
    """Compute the firmness of a charged film; without voltage its law alone determines that."""
    return firmness(model, state) if state.voltage_squared > 0 else None


def field_warnings(fields: Fields, loss: LostTension, film: Film | None,
                   firm: Array | None = None) -> list[str]:
    """List warnings that a reader of these fields must know; ``film`` is None if its law is sound.

    ``firm`` is the film's :func:`~tympan.fem.results.firmness.firmness` at the same nodes.
    """
    warnings, loose = [], fields[fields.tension != Tension.TAUT]
    if firm is not None and firm.min(initial=np.inf) <= 0:
        place = place_text(*fields.position[np.argmin(firm), :2].tolist())
        warnings.append(f"{INSTABILITY.at(place)}: this equilibrium is unstable, since short "
                        "waves of the film grow there at this voltage")
    if len(loose.tension):
        x, y, _ = loose.position[np.argmin(loose.stress_2)]
        area_cm2, slack_cm2 = (loss.wrinkled + loss.slack) * 1e4, loss.slack * 1e4
        over = (f" over {area_cm2:.3g} cm² of the mounted film ({loss.share:.2%})" if area_cm2
                else "")
        over += f", {slack_cm2:.3g} cm² of them slack in all directions" if slack_cm2 else ""
        warnings.append(f"{TENSION.label}: the film wrinkles{over}, most at "
                        f"{place_text(float(x), float(y))}")
    if not len(fields.position):
        return warnings
    weakest = int(np.argmax(fields.breakdown_share))
    x, y, _ = fields.position[weakest]
    warnings += breakdown_warning(
        fields.breakdown_share[weakest], fields.electric_field[weakest],
        fields.breakdown_strength[weakest], float(x), float(y))
    if film is None:
        return warnings
    return warnings + failures(film, fields.position, fields.stretch_1, fields.stretch_2)


def remarks_on(specimen: Specimen, rig: Rig, mass: float, voltage: float) -> tuple[str, ...]:
    """Write sentences for every result of a specimen on a rig under mass [kg] and voltage [V]."""
    return (*implausible_loads(specimen, rig, mass, voltage), *specimen.drawn_elsewhere,
            *rig.remarks)


def breakdown_warning(share: float, electric: float, strength: float, x: float, y: float
                      ) -> list[str]:
    """Warn if a field [V/m] is a large share of the film's strength at a place [m]."""
    if not share * LEAST_MARGIN >= 1:
        return []
    what = BREAKDOWN.label if share > 1 else f"near {BREAKDOWN.label} (margin {1 / share:.2f})"
    return [f"{what} at {place_text(x, y)}: field {electric / 1e6:.3g} of "
            f"{strength / 1e6:.3g} MV/m"]


def failure_reason(outcome: Outcome) -> str:
    """Explain why there is no result: by the limit that was found, or the solver's advice."""
    if outcome.limit is None:
        return outcome.advice
    load = in_words(outcome.limit, outcome.limited or "force")
    if outcome.limited == "pressure" and not outcome.thins:
        # A film blown up like a balloon is pulled nowhere.
        return f"the film bears no more than {load}"
    if outcome.thins:
        return f"{TENSION.at(load)}, where the film, wrinkled, thins without bound"
    return PULL_IN.at(load)
