"""Derivatives and elasticities of a case's results by all numbers of specimen, rig and load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from math import isfinite
from typing import Annotated, Any

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Key, field_at, fields_of, symbol
from tympan.base.paths import at, numbers, with_change
from tympan.fem.derivatives.quantities import named_functional
from tympan.fem.derivatives.sensitivity import (
    ModelParameter,
    film_names,
    gradient_many,
    limit_gradient,
    parameters,
    shape_names,
    thinning_gradient,
)
from tympan.fem.derivatives.shape import edge_nodes
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load, State
from tympan.fem.results.limit_states import PULL_IN
from tympan.fem.rig import HYSTERESIS, Grips, Sensor, Supply, Tester
from tympan.studies.case import (
    Case,
    CaseRecord,
    Existence,
    Settings,
    Warnings,
    equilibrate,
    failure_reason,
    state_warnings,
)
from tympan.studies.joined_film import SolvedFilm, with_films

#: Units of loads, and so of their limits.
_LOAD_UNITS: dict[Load, str] = {"voltage": "V", "force": "N", "pressure": "Pa"}

#: Parameters that determine each load; at the load's own limit they have no effect.
_MAKE = {"voltage": ("voltage", *(f"rig.{field.name}" for field in fields_of(Supply))),
         "pressure": ("rig.gas_pressure",),
         "force": ("mass", "rig.unaccounted_mass", "rig.gravity", "rig.plate_pressure",
                  "rig.friction")}


@dataclass(frozen=True)
class SensitivityAnswer:
    """Dependence of a quantity on one parameter."""

    value: Annotated[float, Key("value of the parameter")]
    unit: Annotated[str, Key("unit of the parameter")]
    derivative: Annotated[float, Key("derivative of the quantity by the parameter, in SI")]
    elasticity: Annotated[float | None, Key("per cent per per cent; none where one is 0")]


@dataclass(frozen=True)
class Answers:
    """A quantity with its derivatives by all parameters."""

    value: Annotated[float, Key("value of the quantity")]
    unit: Annotated[str, Key("unit of the value")]
    by: Annotated[dict[str, SensitivityAnswer], Key("answers by the parameter's name")]


@dataclass(frozen=True, kw_only=True)
class SensitivityResult(CaseRecord):
    """Result of ``tympan sensitivity --json``."""

    ending = "-sensitivity"
    writer = "tympan sensitivity"
    indexed = ("quantity", "parameter")

    status: Existence
    quantities: Annotated[dict[str, Answers], Key("quantities by "
                                                  "their names")] = field(default_factory=dict)
    warnings: Warnings = ()

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each quantity and parameter."""
        return [{"quantity": quantity, "parameter": parameter, "unit": answer.unit}
                | asdict(answer) for quantity, answers in self.quantities.items()
                for parameter, answer in answers.by.items()]


def sensitivity(case: Case, settings: Settings,
                names: Sequence[str] = ("heave",)) -> SensitivityResult:
    """Differentiate named quantities of a case by all parameters; past a limit, the limit's load.

    InputError for names that are no quantities, and for quantities without derivatives, such as the
    tilt of a level plate.
    """
    wanted = {name: named_functional(name) for name in names}
    odd = any(functional.odd for functional in wanted.values())
    if odd or {"tilt", "reaction"} & {*names}:
        case.specimen.needed_plate()
    settings = replace(settings, symmetry=settings.symmetry and not odd)
    model, outcome = equilibrate(case, settings)
    result = SensitivityResult(specimen=case.specimen.name, mass_kg=case.mass,
                               voltage_V=case.voltage, status=outcome.status)
    critical, load = outcome.critical, outcome.limited
    if outcome.status == "equilibrium":
        by, state = case_parameters(case, model), outcome.state
        slopes = gradient_many(model, outcome, wanted, by)
        values = {name: float(each.value(model, state)) for name, each in wanted.items()}
        units = {name: each.unit for name, each in wanted.items()}
        warnings = state_warnings(model, state)
    elif critical is None or load is None:
        return replace(result, warnings=(failure_reason(outcome), *case.remarks))
    else:
        by, state = case_parameters(case, model, load), critical.state
        kind = "thinning" if outcome.thins else PULL_IN.kind
        name, value = f"{kind}_{load}", state.load(load)
        warnings = [failure_reason(outcome)]
        of_limit = thinning_gradient if outcome.thins else limit_gradient
        slopes = {name: of_limit(model, critical, load, by)}
        if load == "voltage":  # value and slopes are those of U²
            value = float(np.sqrt(value))
            slopes[name] = {key: slope / (2 * value) for key, slope in slopes[name].items()}
        values, units = {name: value}, {name: _LOAD_UNITS[load]}
    numbers = {name: parameter.value(model, state) for name, parameter in by.items()}
    said = (*warnings, *_immovable(model), *case.remarks)
    return replace(result, warnings=said, quantities={
        name: _answers(case, value, units[name], slopes[name], numbers)
        for name, value in values.items()})


def case_parameters(case: Case, model: Model, limited: Load | None = None
                    ) -> dict[str, ModelParameter]:
    """Collect all parameters of a case by name, except lengths the mesh cannot follow."""
    of_model = parameters(model)
    result = {name: of_model[name] for name in film_names(case.specimen)}
    for name in () if _immovable(model) else shape_names(case.specimen):
        shape = of_model[name]
        loads = case.rig.plate_pressure and limited != "force"
        result[name] = _under_pressure(shape, case) if loads else shape
    idle = {field.name for record in (Sensor, Tester, Grips) for field in fields_of(record)}
    if not case.direction:
        idle |= {field.name for field in fields_of(type(case.rig)) if HYSTERESIS in field.marks}
    rig = [name for name in numbers(case.rig, "rig") if name.split(".")[1] not in idle]
    made = set(_MAKE[limited]) if limited else set()
    if np.any(model.pull):  # gravity pulls the film, too
        made.discard("rig.gravity")
    for name in ("mass", "voltage", *rig):
        path = tuple(name.split("."))
        if isfinite(at(case, path)) and name not in made:
            result[name] = _case_number(case, path, limited)
    return result


def _case_number(case: Case, path: tuple[str, ...], limited: Load | None) -> ModelParameter:
    """Make a parameter of mass, voltage or a number of the rig; the ``limited`` load is fixed."""
    def changed(model: Model, state: State, change: Any) -> tuple[Model, State]:
        mass, voltage = (getattr(case, name) + (change if path == (name,) else 0)
                         for name in ("mass", "voltage"))
        rig = with_change(case.rig, path[1:], change) if path[0] == "rig" else case.rig
        force = rig.rubbed(rig.force(mass, model.plate_area), case.direction)
        loads = {"force": force, "pressure": rig.gas_pressure,
                 "voltage": rig.film_voltage(voltage, case.direction) ** 2}
        loads = {name: load for name, load in loads.items() if name != limited}
        films = (bias for bias in model.loading.biases if isinstance(bias, SolvedFilm))
        loading = with_films(rig.loading, lambda bias: replace(next(films), given=bias))
        return replace(model, loading=loading), state.under(**loads)

    odd = "xy"[int(path[-1])] if path[-2:-1] == ("weight_offset",) else ""
    return ModelParameter(lambda model, state: float(at(case, path)), changed, frozenset(odd))


def _under_pressure(length: ModelParameter, case: Case) -> ModelParameter:
    """Let a length also change the plate's area, and so the force of a pressure on it."""
    def changed(model: Model, state: State, change: Any) -> tuple[Model, State]:
        other, moved = length.changed(model, state, change)
        force: Any = case.rig.rubbed(case.rig.force(case.mass, other.plate_area), case.direction)
        return other, moved.under(force=force)

    return replace(length, changed=changed)


def _immovable(model: Model) -> list[str]:
    try:
        edge_nodes(model.discretisation, model.specimen)
    except InputError as error:
        return [f"no derivatives by lengths: {error}"]
    return []


def _answers(case: Case, value: float, unit: str, slopes: dict[str, float],
             numbers: dict[str, float]) -> Answers:
    by = {}
    for name, slope in slopes.items():
        path, number = tuple(name.split(".")), numbers[name]
        per = symbol(field_at(case, path) or field_at(case.specimen, path))
        elasticity = slope * number / value if number and value else None
        by[name] = SensitivityAnswer(number, per, slope, elasticity)
    return Answers(value, unit, by)
