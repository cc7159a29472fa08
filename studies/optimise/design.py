"""Designs: what one specimen is worth and keeps to, with derivatives.

On a mesh of its own, or on another's moved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.derivatives.parameters import ModelParameter
from tympan.fem.derivatives.quantities import QUANTITIES
from tympan.fem.derivatives.sensitivity import gradient_many
from tympan.fem.derivatives.shape import moved_by, velocities
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.errors import InputError
from tympan.geometry.mesh import folded
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model, failure_reason, voltage_ramp
from tympan.studies.optimise.limits import DesignState
from tympan.studies.optimise.problem import OptimiseProblem
from tympan.studies.optimise.sqp import Linearisation
from tympan.studies.sensitivity import case_parameters

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Design:
    """A specimen and its ``stroke``, deflection at the voltage minus that at none [m].

    ``rest`` is the latter.

    ``limited``: what each limit measures [SI]; ``owners``: the limit each value c
    belongs to. Where there is no equilibrium, or no such specimen, ``reason`` says
    why and the numbers are nan.
    """

    values: Array
    specimen: Specimen | None = None
    reason: str = ""
    stroke: float = np.nan
    rest: float = np.nan
    limited: Mapping[str, float] = field(default_factory=dict)
    owners: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Base:
    """A mesh to move, how far limits' stand-ins fall short on it, the film at the voltage."""

    model: Model
    scales: Mapping[str, float]
    state: State


@dataclass(eq=False)
class DesignEvaluator:
    """Computes designs of a problem on the mesh it keeps, which it makes anew when asked."""

    problem: OptimiseProblem
    settings: Settings
    base: Base | None = None

    def fresh(self, values: Array) -> tuple[Design, Linearisation | None]:
        """A design on a mesh of its own, which becomes the one to move."""
        try:
            specimen = self.problem.design(values)
            case = self.problem.case(specimen)
            model = build_model(specimen, self.settings, case.rig.loading)
        except InputError as error:
            return Design(values, reason=str(error)), None
        return self._evaluated(values, specimen, model, None)

    def moved(self, values: Array) -> tuple[Design, Linearisation | None]:
        """A design on the kept mesh, moved: designs compare without the noise of new meshes."""
        assert self.base is not None
        model = self.base.model
        try:
            specimen = self.problem.design(values)
        except InputError as error:
            return Design(values, reason=str(error)), None
        motion = velocities(model.discretisation, model.specimen).towards(specimen)
        other, _ = moved_by(model, model.mounted(), specimen, motion)
        if folded(other.discretisation.mesh):
            return Design(values, specimen, "the mesh cannot be moved so far"), None
        return self._evaluated(values, specimen, other, self.base.scales)

    def _evaluated(self, values: Array, specimen: Specimen, model: Model,
                   scales: Mapping[str, float] | None) -> tuple[Design, Linearisation | None]:
        case = self.problem.case(specimen)
        names = tuple(variable.name for variable in self.problem.variables)
        path = self.settings.path
        ends = voltage_ramp(model, case.mass, (0.0, case.voltage), case.rig, path)
        (_, rest), (_, outcome) = ends
        if rest.status != "equilibrium":
            return Design(values, specimen, failure_reason(rest)), None
        parameters = case_parameters(case, model)
        lower = _slopes(model, rest, {name: parameters[name] for name in names})
        if outcome.status != "equilibrium":
            return Design(values, specimen, failure_reason(outcome)), None
        state = DesignState(case, model, outcome, names, {}, path)
        upper = _slopes(model, outcome, state.by)
        if scales is None:
            scales = {limit.name: limit.scale(state) for limit in self.problem.limits}
            self.base = Base(model, scales, outcome.state)
        state = replace(state, scales=scales)
        pairs = [limit.values(state) for limit in self.problem.limits]
        stroke = outcome.state.plate.deflection - rest.state.plate.deflection
        limited = {limit.name: limit.measured(state) for limit in self.problem.limits}
        owners = tuple(limit.name for limit, (values_of_limit, _)
                       in zip(self.problem.limits, pairs, strict=True) for _ in values_of_limit)
        design = Design(values, specimen, "", stroke, rest.state.plate.deflection, limited, owners)
        return design, Linearisation(
            stroke, upper - lower, np.concatenate([np.zeros(0), *(pair[0] for pair in pairs)]),
            np.concatenate([np.zeros((0, len(names))), *(pair[1] for pair in pairs)]))


def _slopes(model: Model, outcome: Outcome, by: Mapping[str, ModelParameter]) -> Array:
    """Derivatives of the heave, shape (parameters,)."""
    found = gradient_many(model, outcome, {"": QUANTITIES["heave"]}, by)[""]
    return np.array([found[name] for name in by])
