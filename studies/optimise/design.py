"""Designs: what one specimen is worth and keeps to, with derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.derivatives.quantities import QUANTITIES
from tympan.fem.derivatives.sensitivity import gradient_many
from tympan.fem.derivatives.shape import motion_between, moved_by
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.errors import InputError
from tympan.geometry.mesh import folded
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model, failure_reason, voltage_ramp
from tympan.studies.optimise.limits import DesignState, Highest
from tympan.studies.optimise.problem import OptimiseProblem
from tympan.studies.optimise.sqp import Linearisation
from tympan.studies.sensitivity import case_parameters

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Design:
    """A specimen and its ``stroke`` [m]: deflection at the voltage minus ``rest``, that at none.

    ``limited``: what each limit measures [SI]; ``owners``: the limit each value c belongs to.
    Where there is no equilibrium, or no such specimen, ``reason`` says why and the numbers are nan.
    ``accepted``: a search went there.
    """

    values: Array
    specimen: Specimen | None = None
    reason: str = ""
    stroke: float = np.nan
    rest: float = np.nan
    limited: Mapping[str, float] = field(default_factory=dict)
    owners: tuple[str, ...] = ()
    accepted: bool = False


@dataclass(eq=False)
class DesignEvaluator:
    """Computes designs of a problem on the mesh it keeps, which it makes anew when asked.

    As an objective of :func:`tympan.studies.optimise.sqp.maximise` its points are shares of the
    variables' bounds and ``measure`` of the frame is kept; ``last`` is the design computed last.
    ``model`` and ``state``: mesh to move and film at the voltage on it; ``scales``: how far limits'
    stand-ins fall short there.
    """

    problem: OptimiseProblem
    settings: Settings
    measure: str = "area"
    last: Design | None = None
    model: Model | None = None
    state: State | None = None
    scales: Mapping[str, float] = field(default_factory=dict)

    def fresh(self, values: Array) -> tuple[Design, Linearisation | None]:
        """A design on a mesh of its own, which becomes the one to move."""
        return self._evaluated(values, renew=True)

    def moved(self, values: Array) -> tuple[Design, Linearisation | None]:
        """A design on the kept mesh, moved: designs compare without the noise of new meshes."""
        return self._evaluated(values, renew=False)

    def renewed(self, x: Array) -> Linearisation | None:
        """On a new mesh."""
        self.last, local = self.fresh(self._values(x))
        return self._scaled(local)

    def at(self, x: Array) -> Linearisation | None:
        """On the mesh moved."""
        self.last, local = self.moved(self._values(x))
        return self._scaled(local)

    def held(self, x: Array) -> tuple[float, Array]:
        """What the frame must keep; nan where there is no such frame."""
        try:
            miss, slope = self.problem.held_slopes(self.measure, self._values(x))
        except InputError:
            return float("nan"), np.zeros(len(x))
        return miss, slope * self.problem.widths

    def _values(self, x: Array) -> Array:
        return self.problem.lows + self.problem.widths * x

    def _scaled(self, local: Linearisation | None) -> Linearisation | None:
        widths = self.problem.widths
        return None if local is None else replace(local, slope=local.slope * widths,
                                                  limit_slopes=local.limit_slopes * widths)

    def _evaluated(self, values: Array, renew: bool) -> tuple[Design, Linearisation | None]:
        problem, path = self.problem, self.settings.path
        try:
            specimen = problem.design(values)
            model = (build_model(specimen, self.settings, problem.rig.loading) if renew
                     else self._moved_model(specimen))
        except InputError as error:
            return Design(values, reason=str(error)), None
        if not renew and folded(model.discretisation.mesh):
            return Design(values, specimen, "the mesh cannot be moved so far"), None
        case = problem.case(specimen)
        parameters = case_parameters(case, model)
        by = {variable.name: parameters[variable.name] for variable in problem.variables}
        ramp = voltage_ramp(model, case.mass, (0.0, case.voltage), case.rig, path)
        resting, charged = (outcome for _, outcome in ramp)
        slopes = []
        for outcome in (resting, charged):
            if outcome.status != "equilibrium":
                return Design(values, specimen, failure_reason(outcome)), None
            gradient = gradient_many(model, outcome, {"": QUANTITIES["heave"]}, by)[""]
            slopes.append(np.array([gradient[name] for name in by]))
        state = DesignState(case, model, charged, by, self.scales, path)
        if renew:
            self.scales = {limit.name: limit.scale(state) for limit in problem.limits
                           if isinstance(limit, Highest)}
            self.model, self.state = model, charged.state
            state = replace(state, scales=self.scales)
        evaluations = [limit.evaluate(state) for limit in problem.limits]
        rest = resting.state.plate.deflection
        stroke = charged.state.plate.deflection - rest
        limited = {limit.name: measured for limit, (measured, *_)
                   in zip(problem.limits, evaluations, strict=True)}
        owners = tuple(limit.name for limit, (_, c, _)
                       in zip(problem.limits, evaluations, strict=True) for _ in c)
        return Design(values, specimen, "", stroke, rest, limited, owners), Linearisation(
            stroke, slopes[1] - slopes[0],
            np.concatenate([np.zeros(0), *(c for _, c, _ in evaluations)]),
            np.concatenate([np.zeros((0, len(by))), *(slope for *_, slope in evaluations)]))

    def _moved_model(self, specimen: Specimen) -> Model:
        model = self.model
        assert model is not None
        motion = motion_between(model.discretisation, model.specimen, specimen)
        return moved_by(model, model.mounted(), specimen, motion)[0]
