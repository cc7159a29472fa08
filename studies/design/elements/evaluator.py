"""Designs: what one specimen is worth and keeps to, with derivatives."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.complex_step import complex_step
from tympan.fem.derivatives.quantities import QUANTITIES
from tympan.fem.derivatives.sensitivity import shape_names
from tympan.fem.derivatives.shape import edge_nodes, motion_between, moved_by
from tympan.fem.discretisation.isoparametric import folded
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.errors import InputError
from tympan.geometry.paths import with_change
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model, failure_reason, voltage_ramp
from tympan.studies.design.elements.space import ElementSpace
from tympan.studies.design.limits.cycle import cycle_voltages, kept_limit
from tympan.studies.design.limits.state import DesignState, Evaluation, MeshMemory, slopes_of
from tympan.studies.design.quantities import LIMITS
from tympan.studies.design.sqp import Linearisation
from tympan.studies.limits.voltages import EndKind
from tympan.studies.sensitivity import case_parameters

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Design:
    """A specimen and its ``stroke`` [m]: deflection at the voltage minus ``rest``, that at none.

    ``kept``: what each limit measures over the cycle of the voltage; ``owners``: the limit and the
    nominal voltage each value c belongs to, None where it depends on none. Where there is no
    equilibrium, or no such specimen, ``reason`` says why and the numbers are nan.
    ``accepted``: a search went there.
    """

    values: Array
    specimen: Specimen | None = None
    reason: str = ""
    stroke: float = np.nan
    rest: float = np.nan
    kept: Mapping[str, Evaluation] = field(default_factory=dict)
    owners: tuple[tuple[str, float | None], ...] = ()
    accepted: bool = False

    @property
    def end(self) -> EndKind | None:
        """First end of its film, if a limit asks and there is one."""
        return next((limit.end for limit in self.kept.values() if limit.end), None)

    @property
    def limited(self) -> dict[str, float]:
        """Value of each limit where it comes nearest to its bound [SI]."""
        return {name: limit.value for name, limit in self.kept.items()}


@dataclass(eq=False)
class DesignEvaluator:
    """Designs of a space as an objective of :func:`tympan.studies.design.sqp.maximise`.

    ``measure`` of the frame is kept; ``last`` is the design computed last. ``model``, ``states``:
    the mesh to move and the film on it, from no voltage to the working one; ``memory``: what it
    keeps while it moves; ``between``: some limit comes nearest between the two there, so that a
    moved mesh is solved between them too.
    """

    space: ElementSpace
    settings: Settings
    measure: str = "area"
    last: Design | None = None
    model: Model | None = None
    states: Sequence[State] = ()
    memory: MeshMemory = field(default_factory=MeshMemory)
    between: bool = False

    def at(self, x: Array, renew: bool = False) -> Linearisation | None:
        """Values at a design, by shares of the variables' bounds.

        The kept mesh is moved, so that designs compare without the noise of new meshes; renewed, it
        is a mesh of the design's own, kept from there on.
        """
        self.last, local = self._evaluated(self.space.values(x), renew)
        return local

    def held(self, x: Array) -> tuple[float, Array]:
        """Miss of what the frame must keep, and its slope; nan where there is no such frame."""
        space = self.space
        try:
            miss, slope = space.held_slopes(self.measure, space.values(x))
        except InputError:
            return float("nan"), np.zeros(len(x))
        return miss, slope * space.widths

    def _evaluated(self, values: Array, renew: bool) -> tuple[Design, Linearisation | None]:
        space, path = self.space, self.settings.path
        requirements = space.requirements
        try:
            specimen = space.built(values)
            if renew:
                model = build_model(specimen, self.settings, requirements.rig.loading)
            else:
                assert self.model is not None
                motion = motion_between(self.model.discretisation, self.model.specimen, specimen)
                model, _ = moved_by(self.model, self.model.mounted(), specimen, motion)
        except InputError as error:
            return Design(values, reason=str(error)), None
        if not renew and folded(model.discretisation.mesh):
            return Design(values, specimen, "the mesh cannot be moved so far"), None
        case = replace(space.case, specimen=specimen)
        parameters = case_parameters(case, model)
        by = {name: parameters[name] for each in space.variables for name in each.names}
        loaded = any(LIMITS[name].load is not None for name in requirements.bounds)
        voltages = cycle_voltages(case.voltage, loaded and (renew or self.between))
        ramp = list(voltage_ramp(model, case.mass, voltages, case.rig, path))
        for _, outcome in ramp:
            if outcome.status != "equilibrium":
                return Design(values, specimen, case.doubted(failure_reason(outcome))), None
        (_, resting), (_, charged) = ramp[0], ramp[-1]
        slopes = [slopes_of(QUANTITIES["heave"], model, outcome, by)
                  for outcome in (resting, charged)]
        if renew:
            self.model, self.states = model, [end.state for _, end in ramp]
            self.memory = MeshMemory()
        states = [DesignState(at, model, outcome, by, self.memory, path, resting.state)
                  for at, outcome in ramp]
        kept = {name: kept_limit(LIMITS[name], states, bound)
                for name, bound in requirements.bounds.items()}
        if renew:
            self.between = any(limit.between for limit in kept.values())
        rest = resting.state.plate.deflection
        stroke = charged.state.plate.deflection - rest
        # A plate that the gas holds up is moved further up.
        sense = -1.0 if stroke < 0 else 1.0
        owners = tuple((name, at) for name, limit in kept.items() for at in limit.voltages)
        limits = np.concatenate([np.zeros(0), *(limit.c for limit in kept.values())])
        limit_slopes = np.concatenate([np.zeros((0, len(by))),
                                       *(limit.slopes for limit in kept.values())])
        return Design(values, specimen, "", sense * stroke, rest, kept, owners), Linearisation(
            sense * stroke, sense * (slopes[1] - slopes[0]) * space.widths, limits,
            limit_slopes * space.widths)


def check_derivatives(space: ElementSpace, settings: Settings) -> None:
    """Refuse variables no mesh can follow, or whose outline is not differentiable by them."""
    specimen, values = space.specimen, np.array(space.starts[0])
    model = build_model(specimen, settings, space.requirements.rig.loading)
    edge_nodes(model.discretisation, model.specimen)
    for variable, value, unit in zip(space.variables, values, np.eye(len(values)), strict=True):
        name, = variable.names
        path = name.split(".")
        if name not in shape_names(specimen):
            raise InputError("has no derivative: moved alone it would break the specimen's "
                             "symmetry", key=f"vary.{variable.key}", given=specimen.name)
        step = 1e-5 * (variable.high - variable.low)
        inward = step if value - 2 * step < variable.low else -step
        edges = [_edge(space.built(values + share * inward * unit), path[0])
                 for share in (0, 1, 2)]
        differences = (-3 * edges[0] + 4 * edges[1] - edges[2]) / (2 * inward)
        size = np.abs(differences).max()
        slope = _edge_slope(specimen, path)
        if slope is None or not size > 0 or not np.abs(slope - differences).max() < 1e-3 * size:
            raise InputError("has no derivative: the points of its outline do not follow it "
                             "smoothly", key=f"vary.{variable.key}", given=specimen.name)


def _edge(specimen: Specimen, part: str) -> Array:
    outline = specimen.frame if part == "frame" else specimen.needed_plate().outline
    return outline.points(720)


def _edge_slope(specimen: Specimen, path: Sequence[str]) -> Array | None:
    """Derivative of the edge's points, None where the outline takes no complex step."""
    with warnings.catch_warnings(action="error"):
        try:
            return np.asarray(complex_step(
                lambda change: _edge(with_change(specimen, path, change), path[0]), 0.0))
        except (TypeError, ValueError, np.exceptions.ComplexWarning):
            return None
