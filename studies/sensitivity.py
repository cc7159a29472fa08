"""How results of a case answer to every number of specimen, rig and load.

Derivatives, elasticities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from tympan.fem.derivatives.parameters import ModelParameter, film_names, parameters, shape_names
from tympan.fem.derivatives.quantities import Quantity, named_quantity
from tympan.fem.derivatives.sensitivity import gradient_many, limit_gradient
from tympan.fem.derivatives.shape import velocities
from tympan.fem.equilibrium.ramp import Outcome, Status
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load, State
from tympan.geometry.errors import InputError
from tympan.geometry.fields import field_at, symbol
from tympan.geometry.paths import at, numbers, with_change
from tympan.studies.case import Case, Settings, equilibrate, failure_reason, state_warnings
from tympan.studies.files import from_json, read_json, stored_file, write_json

#: Units of quantities; a pull-in load is the last three.
UNITS = {"heave": "m", "tilt": "rad", "reaction": "N", "capacitance": "F", "energy": "J",
         "max_stretch": "1",
         "max_true_stress": "Pa", "max_field": "V/m", "pull_in_voltage": "V", "pull_in_force": "N",
         "pull_in_pressure": "Pa"}

#: What of a case makes each load; at the load's own limit they have no say.
_MAKE = {"voltage": ("voltage", "rig.amplifier_gain", "rig.sag_voltage", "rig.lag_voltage"),
         "pressure": ("rig.gas_pressure",),
         "force": ("mass", "rig.unaccounted_mass", "rig.gravity", "rig.plate_pressure")}


@dataclass(frozen=True)
class Answer:
    """A quantity's ``derivative`` by a parameter [SI].

    ``elasticity``: per cent per per cent, None where one is 0. ``unit``: of the parameter.
    """

    parameter: str
    unit: str
    value: float
    derivative: float
    elasticity: float | None


@dataclass(frozen=True)
class Answers:
    """A quantity and its answers to all parameters."""

    quantity: str
    value: float
    answers: tuple[Answer, ...]

    @property
    def unit(self) -> str:
        """Of the quantity."""
        return UNITS.get(self.quantity, "SI")

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        by = {answer.parameter: {"value": answer.value, "unit": answer.unit,
                                 "derivative": answer.derivative, "elasticity": answer.elasticity}
              for answer in self.answers}
        return {"value": self.value, "unit": self.unit, "by": by}


@dataclass(frozen=True)
class SensitivityResult:
    """What ``tympan sensitivity --json`` prints."""

    specimen: str
    mass_kg: float
    voltage_V: float
    status: Status
    quantities: tuple[Answers, ...] = ()
    warnings: tuple[str, ...] = field(default=())

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        quantities = {item.quantity: item.json() for item in self.quantities}
        return {"specimen": self.specimen, "mass_kg": self.mass_kg, "voltage_V": self.voltage_V,
                "status": self.status, "quantities": quantities, "warnings": list(self.warnings)}

    def save(self, folder: Path) -> None:
        """Write ``NAME-sensitivity.json``; NAME is the specimen's."""
        write_json(folder / f"{self.specimen}-sensitivity.json", self.json())

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> SensitivityResult:
        """What was saved, of the specimen of a ``name`` or of the only one."""
        file = stored_file(folder, "*-sensitivity.json", name, "tympan sensitivity")
        record = from_json(dict[str, Any], read_json(file), file)
        stored = from_json(dict[str, dict[str, Any]], record.get("quantities"), file, "quantities")
        quantities = []
        for quantity, entry in stored.items():
            key = f"quantities.{quantity}"
            by = from_json(dict[str, dict[str, Any]], entry.get("by"), file, f"{key}.by")
            answers = tuple(from_json(Answer, {**values, "parameter": parameter}, file, key)
                            for parameter, values in by.items())
            value = from_json(float, entry.get("value"), file, f"{key}.value")
            quantities.append(Answers(quantity, value, answers))
        return replace(from_json(cls, {**record, "quantities": []}, file),
                       quantities=tuple(quantities))

def sensitivity(case: Case, settings: Settings,
                names: Sequence[str] = ("heave",)) -> SensitivityResult:
    """Derivatives of named quantities of a case by all it depends on.

    Past pull-in, those of the pull-in load.

    Raises
    ------
    InputError
        For names that are no quantities, and for quantities without derivatives, such as the tilt
        of a level plate.
    """
    wanted = {name: named_quantity(name) for name in names}
    model, outcome = equilibrate(case, settings)
    result = SensitivityResult(case.specimen.name, case.mass, case.voltage, outcome.status)
    left_out = tuple(_immovable(model))
    if outcome.status == "equilibrium":
        return replace(result, quantities=_at_equilibrium(case, model, outcome, wanted),
                       warnings=(*state_warnings(model, outcome.state), *left_out))
    if outcome.critical is None or outcome.limited is None:
        return replace(result, warnings=(failure_reason(outcome),))
    return replace(result, quantities=(_at_limit(case, model, outcome),),
                   warnings=(failure_reason(outcome), *left_out))


def case_parameters(case: Case, model: Model, limited: Load | None = None
                    ) -> dict[str, ModelParameter]:
    """All a case depends on, by name: specimen, nominal loads and rig.

    Lengths the mesh cannot follow are left out.
    """
    of_model = parameters(model)
    result = {name: of_model[name] for name in film_names(case.specimen)}
    for name in () if _immovable(model) else shape_names(case.specimen):
        shape = of_model[name]
        loads = case.rig.plate_pressure and limited != "force"
        result[name] = _under_pressure(shape, case) if loads else shape
    idle = ("rig.sensor", "rig.drift", *(() if case.direction else ("rig.lag",)))
    rig = [name for name in numbers(case.rig, "rig") if not name.startswith(idle)]
    for name in ("mass", "voltage", *rig):
        path = tuple(name.split("."))
        if isfinite(at(case, path)) and (limited is None or name not in _MAKE[limited]):
            result[name] = _case_number(case, path, limited)
    return result


def _case_number(case: Case, path: tuple[str, ...], limited: Load | None) -> ModelParameter:
    """The nominal mass, the nominal voltage or a number of the rig; ``limited`` is left alone."""
    def changed(model: Model, state: State, change: Any) -> tuple[Model, State]:
        mass, voltage = (getattr(case, name) + (change if path == (name,) else 0)
                         for name in ("mass", "voltage"))
        rig = with_change(case.rig, path[1:], change) if path[0] == "rig" else case.rig
        loads = {"force": rig.force(mass, model.plate_area), "pressure": rig.gas_pressure,
                 "voltage": rig.film_voltage(voltage, case.direction) ** 2}
        loads = {name: load for name, load in loads.items() if name != limited}
        return replace(model, loading=rig.loading), state.under(**loads)

    odd = "xy"[int(path[-1])] if path[-2:-1] == ("weight_offset",) else ""
    return ModelParameter(lambda model, state: float(at(case, path)), changed, frozenset(odd))


def _under_pressure(length: ModelParameter, case: Case) -> ModelParameter:
    """A length that changes the plate's area, and so the force of a pressure on the plate."""
    def changed(model: Model, state: State, change: Any) -> tuple[Model, State]:
        other, moved = length.changed(model, state, change)
        force: Any = case.rig.force(case.mass, other.plate_area)
        return other, moved.under(force=force)

    return replace(length, changed=changed)


def _immovable(model: Model) -> list[str]:
    """Why the mesh cannot follow the lengths of the specimen, if it cannot."""
    try:
        velocities(model.discretisation, model.specimen).check()
    except InputError as error:
        return [f"no derivatives by lengths: {error}"]
    return []


def _at_equilibrium(case: Case, model: Model, outcome: Outcome,
                    wanted: dict[str, Quantity]) -> tuple[Answers, ...]:
    by = case_parameters(case, model)
    slopes = gradient_many(model, outcome, wanted, by)
    state = outcome.state
    return tuple(_answers(name, float(quantity.value(model, state)), slopes[name], by, case, model,
                          state) for name, quantity in wanted.items())


def _at_limit(case: Case, model: Model, outcome: Outcome) -> Answers:
    assert outcome.critical is not None
    assert outcome.limited is not None
    load, critical = outcome.limited, outcome.critical
    by = case_parameters(case, model, load)
    slopes, value = limit_gradient(model, critical, load, by), critical.state.load(load)
    if load == "voltage":
        value = float(np.sqrt(value))
        slopes = {name: slope / (2 * value) for name, slope in slopes.items()}
    return _answers(f"pull_in_{load}", value, slopes, by, case, model, critical.state)


def _answers(name: str, value: float, slopes: dict[str, float], by: dict[str, ModelParameter],
             case: Case, model: Model, state: State) -> Answers:
    answers = []
    for parameter, slope in slopes.items():
        path = tuple(parameter.split("."))
        field = field_at(case, path) or field_at(case.specimen, path)
        number = by[parameter].value(model, state)
        elasticity = slope * number / value if number and value else None
        answers.append(Answer(parameter, symbol(field), number, slope, elasticity))
    return Answers(name, value, tuple(answers))
