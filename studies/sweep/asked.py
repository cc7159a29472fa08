"""Questions of SWEEP.toml on every specimen besides its cases: several columns, or one quantity."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import isfinite, prod
from typing import Any

import numpy as np

from tympan.base.errors import Failure, InputError
from tympan.base.fields import Registry
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.membrane.model import Model
from tympan.fem.results.limit_states import LIMIT_STATES
from tympan.fem.vibration.modes import plate_motion, vibrations
from tympan.geometry.specimen import Specimen
from tympan.studies.alpha import AlphaSettings, alpha
from tympan.studies.case import Case, Settings
from tympan.studies.films.population import FilmGrid
from tympan.studies.force import ForceCase, force
from tympan.studies.limits import limits
from tympan.studies.modes import carried
from tympan.studies.sweep.strokes import WIDER, strokes
from tympan.studies.tolerance.bands import FEW_REACH, deflection_bands
from tympan.studies.tolerance.given import Tolerances, causes
from tympan.studies.variables import VARIABLES
from tympan.studies.wanted import QUANTITIES, Quantity

#: Values by column, with "warnings" or the reason why there are no values.
Record = dict[str, Any]


@dataclass(frozen=True)
class Ask:
    """Questions: names of :data:`QUESTIONS`, and settings of the circles for a specimen.

    ``tolerances``: the scatter of the films' numbers, by default that of their material.
    """

    names: tuple[str, ...] = ()
    circles: AlphaSettings = field(default_factory=AlphaSettings)
    tolerances: Tolerances | None = None

    def banded(self, tolerances: Tolerances) -> Ask:
        """Add the question for bands of films with these tolerances."""
        names = tuple(dict.fromkeys((*self.names, BANDS)))
        return replace(self, names=names, tolerances=tolerances)

    def check(self, specimen: Specimen) -> None:
        """Refuse tolerances of numbers that a specimen does not have."""
        if BANDS in self.names and specimen.plate is not None:
            try:
                causes(specimen, self.tolerances or Tolerances())
            except InputError as error:
                raise InputError(error.allowed, key=f"tolerances.{error.key}") from None


@dataclass(frozen=True, eq=False)
class AskedCase:
    """A case, how it is solved, what is asked, and all masses and voltages of its specimen."""

    case: Case
    settings: Settings
    ask: Ask
    masses: tuple[float, ...]
    voltages: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class SolvedCase(AskedCase):
    """A case and its solution."""

    model: Model
    outcome: Outcome


#: Number of deflections of the smooth curves on which a stroke is found.
_POINTS = 9
#: Warning of a row without voltage.
_NO_STROKE = "there is no stroke without voltage"

#: Function that answers a question on a case. Without ``voltage`` in its loads it must not use the
#: solution.
Answer = Callable[[Any], Any]

#: Function of a family that answers for its rows, films first: a record, or None where finite
#: elements must solve the row.
FamilyAnswer = Callable[[FilmGrid], list[list[Record | None]]]

#: Columns with their meanings, or a function that lists them.
Columns = Mapping[str, str] | Callable[[], Mapping[str, str]]

#: Name of the question that uses tolerances.
BANDS = "bands"


@dataclass(frozen=True)
class SweepQuestion:
    """A question: its ``columns`` with their meanings; a unit ends a column's name.

    They are ``declared`` as such, or by a function where a registry that may grow has them.
    ``{n}`` in a name is the number of a circle. ``shown`` lists the most important columns.
    ``loads`` are the loads it depends on, from mass and voltage in this order. ``answer`` is called
    once for each of their values, or once ``together`` for a list of records, masses first.
    ``by_family`` is a family's function to answer it. Without that function, a question on
    equilibria needs finite elements. ``equilibria`` is the number of equilibria that cost as much
    as one answer by finite elements. ``change``: whether the answer is a change from 0 V to the
    case's voltage.
    """

    name: str
    meaning: str
    declared: Columns
    shown: tuple[str, ...]
    loads: tuple[str, ...]
    answer: Answer
    together: bool = False
    by_family: FamilyAnswer | None = None
    equilibria: int = 0
    change: bool = False

    @property
    def columns(self) -> Mapping[str, str]:
        """Its columns with their meanings."""
        return self.declared() if callable(self.declared) else self.declared

    def names(self, circles: int) -> list[str]:
        """List its columns for at most ``circles`` circles."""
        return [name.format(n=number) for name in self.columns
                for number in range(1, circles + 1 if "{n}" in name else 2)]

    def meaning_of(self, column: str) -> str:
        """Find the meaning of one of its columns."""
        return self.columns.get(column) or self.columns[re.sub(r"\d+", "{n}", column, count=1)]

    @property
    def of_states(self) -> bool:
        """Whether it needs the equilibria of cases."""
        return "voltage" in self.loads and not self.together

    def every(self, loads: Mapping[str, int]) -> int:
        """Count the cases that share one answer, from the numbers of loads."""
        return prod(count for load, count in loads.items() if load not in self.loads)

    def records(self, asked: AskedCase) -> list[Record]:
        """Answer the question at a case; without an answer, give the reason."""
        try:
            answer = self.answer(asked)
            return answer if self.together else [answer]
        except InputError as error:  # without the name, which equal specimens do not share
            reason = str(InputError(error.allowed, key=error.key))
        except (Failure, OSError):
            raise
        except Exception as error:  # a library's error must not stop the rest
            reason = f"{type(error).__name__}: {error}"
        loads = len(asked.masses) * len(asked.voltages) if self.together else 1
        return [{"warnings": [reason]}] * loads


class Questions(Registry[SweepQuestion]):
    """Questions by name. A quantity of films that no column has yet is a question of its name."""

    def __missing__(self, name: str) -> SweepQuestion:
        return _of_quantity(QUANTITIES[name])

    @property
    def known(self) -> dict[str, SweepQuestion]:
        """All possible questions: the questions themselves, then the quantities."""
        taken = {*VARIABLES, *(column for each in self.values() for column in each.columns)}
        return {**self, **{name: self[name] for name, each in QUANTITIES.known.items()
                           if each.column not in taken}}


QUESTIONS = Questions("name")


def _of_quantity(quantity: Quantity) -> SweepQuestion:
    """Make the question for a quantity of films, by finite elements."""
    def answer(asked: AskedCase) -> Record:
        from tympan.studies.design.exact import ExactFilm  # late: it imports the limits

        case = asked.case
        film = ExactFilm(case.specimen, case.mass, case.voltage, case.rig, asked.settings)
        value = float(quantity.of(film)[0])
        if not isfinite(value):
            return {"warnings": [f"there is no {quantity.title}"]}
        return {quantity.column: value, "warnings": []}

    return SweepQuestion(quantity.name, quantity.words, {quantity.column: quantity.words},
                         (quantity.column,), ("mass", "voltage") if quantity.scatters else (),
                         answer)


def question(meaning: str, columns: Columns, shown: tuple[str, ...],
                loads: tuple[str, ...] = (), together: bool = False,
                by_family: FamilyAnswer | None = None, equilibria: int = 0,
                change: bool = False) -> Callable[[Answer], SweepQuestion]:
    """Register a function as the question of its name."""
    def registered(answer: Answer) -> SweepQuestion:
        name = answer.__name__.strip("_")
        made: SweepQuestion = QUESTIONS.register(
            SweepQuestion(name, meaning, columns, shown, loads, answer, together, by_family,
                          equilibria, change))
        return made

    return registered


@question("weights of the membrane circles that stand for it, as `tympan alpha` finds them", {
    "alpha_{n}": "weight of circle n",
    "circle_{n}_m": "its radius",
    "alpha_fit_error": "force error of the mixture, relative, at the loads of the fit",
    "alpha_held_out_error": "its force error, relative, at other loads",
}, shown=("alpha_1", "alpha_held_out_error"))
def _alpha(asked: AskedCase) -> Record:
    result = alpha(asked.case.specimen, asked.settings, asked.ask.circles, asked.case.rig)
    weights = result.by_basis["membrane"]
    return {**_numbered("alpha_{n}", weights.alpha), **_numbered("circle_{n}_m", result.circles),
            "alpha_fit_error": weights.fit_error, "alpha_held_out_error": weights.held_out_error,
            "warnings": list(result.warnings)}


def _of_limits() -> dict[str, str]:
    """List the columns of all limit states."""
    return {f"{kind}_{column}": words.format(state.label)
            for kind, state in LIMIT_STATES.items()
            for column, words in (
                ("V", "nominal voltage of {}"), ("x_m", "its place on the flat film"),
                ("y_m", "the same along y"), ("spread", "how certain the voltage is, relative"))
            } | {"last_equilibrium_V":
                 "beyond this nominal voltage there is none, by pull-in or instability"}


@question("how far the voltage can be raised, as `tympan limits` finds it", _of_limits,
             shown=("tension_V", "breakdown_V", "instability_V", "last_equilibrium_V"),
             loads=("mass",))
def _limits(asked: AskedCase) -> Record:
    result = limits(asked.case, asked.settings)
    record: Record = {"warnings": [] if result.pull_in and not result.thins else [result.ended],
                      "last_equilibrium_V": result.end.voltage_V if result.end else None}
    for limit in result.told:
        record |= {f"{limit.kind}_V": limit.voltage_V, f"{limit.kind}_x_m": limit.x_m,
                   f"{limit.kind}_y_m": limit.y_m, f"{limit.kind}_spread": limit.spread}
    return record


@question("frequencies of small vibrations of the plate, as `tympan modes` finds them", {
    "heave_Hz": "along the load",
    "tilt_1_Hz": "of the slower tilt",
    "tilt_2_Hz": "of the faster tilt",
}, shown=("heave_Hz", "tilt_1_Hz"), loads=("mass", "voltage"))
def _modes(asked: SolvedCase) -> Record:
    if asked.outcome.status != "equilibrium":
        return {"warnings": ["there is no equilibrium"]}
    computed = vibrations(asked.model, asked.outcome.state, carried(asked.case))
    motions = [plate_motion(share).split(" ")[0] for share in computed.shares]
    heave, tilt = ([float(hertz) for motion, hertz, growth in zip(
        motions, computed.frequencies_Hz, computed.growth, strict=True)
        if motion == name and not growth] for name in ("heave", "tilt"))
    missing = [f"{name}: unstable, held, or not among the slowest modes"
               for name, hertz, count in (("heave", heave, 1), ("tilt", tilt, 2))
               if len(hertz) < count]
    return {"heave_Hz": heave[0] if heave else None,
            **dict(zip(("tilt_1_Hz", "tilt_2_Hz"), tilt, strict=False)), "warnings": missing}


def _force_by_family(grid: FilmGrid) -> list[list[Record | None]]:
    found, films = strokes(grid), len(grid.films)
    numbers = {"blocked_force_N": found.blocked, "work_J": found.work, "ideal_work_J": found.ideal,
               "electrical_in_J": found.given, "coupling": found.ideal / found.given}
    voltages = np.tile(grid.voltages, grid.masses.shape[1]).ravel().tolist()
    records: list[Record | None] = []
    for voltage, sure, *values in zip(voltages, found.sure.tolist(), *(
            column.tolist() for column in numbers.values()), strict=True):
        answer = dict(zip(numbers, values, strict=True)) | {"warnings": []} if sure else None
        records.append(answer if voltage else {"warnings": [_NO_STROKE]})
    return [records[start:start + len(records) // films]
            for start in range(0, len(records), len(records) // films)]


@question("force of the held plate from no voltage to this one, as `tympan force` finds it", {
    "blocked_force_N": "its fall, the plate held where it rests without voltage",
    "work_J": "work of the stroke under the load",
    "ideal_work_J": "work of the cycle that changes the voltage with the plate held",
    "electrical_in_J": "energy that the supply gives in that cycle",
    "coupling": "ideal work over that energy",
}, shown=("blocked_force_N", "work_J"), loads=("mass", "voltage"), by_family=_force_by_family,
             equilibria=10, change=True)
def _force(asked: SolvedCase) -> Record:
    case, state = asked.case, asked.outcome.state
    if asked.outcome.status != "equilibrium" or not case.voltage:
        return {"warnings": ["there is no equilibrium" if case.voltage else _NO_STROKE]}
    deflection = asked.model.deflection(state)
    pulled = ForceCase(case.specimen, voltages=(0.0, case.voltage), masses=(case.mass,),
                       start=min(0.0, WIDER * deflection), to=max(0.0, WIDER * deflection),
                       points=_POINTS, rig=case.rig)
    result = force(pulled, asked.settings)
    line = result.loads[0]
    return {"blocked_force_N": result.blocked_force_N, "work_J": line.work_J,
            "ideal_work_J": line.ideal_work_J, "electrical_in_J": line.electrical_in_J,
            "coupling": line.coupling,
            "warnings": [] if line.stroke_m is not None else ["no stroke was found"]}


@question("constants of its lumped model, as `tympan lumped build` finds them", {
    "lumped_alpha_{n}": "weight of circle n",
    "lumped_circle_{n}_m": "its radius",
    "lumped_stiffness": "factor on the film's energy",
    "lumped_permittivity": "factor on the voltage's energy",
    "lumped_flat_capacitance_F": "of the flat film",
    "lumped_held_out_error": "largest error of the deflection, relative, at loads not fitted",
}, shown=("lumped_stiffness", "lumped_permittivity"))
def _lumped(asked: AskedCase) -> Record:
    from tympan.studies.lumped.build import BuildSettings, build  # imports pandas, half a second

    circles, specimen, rig = asked.ask.circles, asked.case.specimen, asked.case.rig
    loads = BuildSettings.suited([specimen], asked.settings, rig, circles=circles.circles,
                                 radii=circles.radii)
    built = build(specimen, asked.settings, loads, rig)
    model = built.model
    return {**_numbered("lumped_alpha_{n}", model.weights),
            **_numbered("lumped_circle_{n}_m", model.radii),
            "lumped_stiffness": model.stiffness, "lumped_permittivity": model.permittivity,
            "lumped_flat_capacitance_F": model.flat_capacitance,
            "lumped_held_out_error": built.worst("corrected", held_out=True),
            "warnings": built.warnings}


@question("spread of the deflection between films made to the tolerances, as `tympan "
             "tolerance` draws them", {
    "deflection_low_m": "5 % of the films have less",
    "deflection_median_m": "half of the films have more",
    "deflection_high_m": "5 % of the films have more",
}, shown=("deflection_low_m", "deflection_high_m"), loads=("mass", "voltage"), together=True)
def _bands(asked: AskedCase) -> list[Record]:
    found = deflection_bands(asked.case.specimen, asked.ask.tolerances or Tolerances(),
                             asked.masses, asked.voltages, asked.case.rig, asked.settings)
    return [{"warnings": [FEW_REACH]} if band is None else
            {**{f"deflection_{edge}_m": getattr(band, edge) for edge in ("low", "median", "high")},
             "warnings": []} for of_mass in found for band in of_mass]


def _numbered(name: str, values: tuple[float, ...]) -> Record:
    return {name.format(n=number): value for number, value in enumerate(values, start=1)}
