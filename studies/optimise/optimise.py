"""Optima of a problem: from every start, for all that may be held.

Checked on a finer mesh and against each other.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.complex_step import complex_step
from tympan.fem.derivatives.parameters import shape_names
from tympan.fem.derivatives.shape import velocities
from tympan.geometry.errors import InputError
from tympan.geometry.paths import at, with_change
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model, state_warnings
from tympan.studies.optimise.design import Design, DesignEvaluator
from tympan.studies.optimise.problem import OptimiseProblem
from tympan.studies.optimise.sqp import Descent, DescentSettings, Linearisation, maximise

Array = NDArray[np.float64]
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Trial:
    """A design tried on the way, and whether it was gone to."""

    design: Design
    accepted: bool


@dataclass(frozen=True, eq=False)
class StartRun:
    """The way from one start, the numbers in the descent being shares of the bounds."""

    held: str
    start: int
    trials: tuple[Trial, ...]
    descent: Descent

    @property
    def best(self) -> Design:
        """Where it ended; a start that came to nothing, itself."""
        accepted = [trial.design for trial in self.trials if trial.accepted]
        return (accepted or [self.trials[-1].design])[-1]


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best end of all starts, holding one measure of the frame.

    ``finer``: the same design on a mesh twice as fine. ``apart``: largest difference in stroke
    between starts that came to an end, relative; ``elsewhere``: in any variable, relative to its
    bounds. ``gain`` and ``gain_start``: stroke over the reference's and the specimen's own, minus
    one, nan where those have none.
    """

    held: str
    runs: tuple[StartRun, ...]
    best: StartRun
    finer: Design
    apart: float
    elsewhere: float
    gain: float
    gain_start: float
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Optima:
    """All optima of a problem, the reference and the specimen it began with on the same footing."""

    problem: OptimiseProblem
    reference: Design
    given: Design
    optima: tuple[Optimum, ...]
    failed: tuple[StartRun, ...]


def find_optima(problem: OptimiseProblem, settings: Settings, descent: DescentSettings,
                progress: Progress = lambda words: None) -> Optima:
    """The optima of a problem, one for each measure of the frame that is held.

    Raises
    ------
    InputError
        When a variable's shape has no derivative.
    """
    check_derivatives(problem, settings)
    reference = _alone(problem, problem.reference, settings)
    given = _alone(problem, problem.specimen, settings)
    optima: list[Optimum] = []
    failed: list[StartRun] = []
    for held in problem.held:
        runs: list[StartRun] = []
        for number, values in enumerate(problem.starts):
            progress(f"equal {held}, start {number + 1}")
            run = run_from(problem, held, number, np.array(values), settings, descent)
            (runs if run.descent.here is not None else failed).append(run)
        progress(f"equal {held}, finer mesh")
        if runs:
            optima.append(_optimum(problem, held, tuple(runs), reference, given, settings))
    return Optima(problem, reference, given, tuple(optima), tuple(failed))


def run_from(problem: OptimiseProblem, held: str, number: int, values: Array, settings: Settings,
             descent: DescentSettings
             ) -> StartRun:
    """One descent, every point on its way kept."""
    reason = f"no design within the bounds has the {held} of the reference's frame"
    objective = _WithinBounds(problem, held, DesignEvaluator(problem, settings),
                              Design(values, reason=reason))
    trials: list[Trial] = []

    def note(x: Array, accepted: bool) -> None:
        trials.append(Trial(objective.last, accepted))

    ended = maximise(objective, objective.share(values), descent, note)
    if not trials:
        trials.append(Trial(objective.last, False))
    return StartRun(held, number, tuple(trials), ended)


def check_derivatives(problem: OptimiseProblem, settings: Settings) -> None:
    """Refuse variables no mesh can follow, or whose outline is not differentiable by them."""
    model = build_model(problem.specimen, settings, problem.rig.loading)
    velocities(model.discretisation, model.specimen).check()
    values = np.array([at(problem.specimen, variable.path) for variable in problem.variables])
    for number, variable in enumerate(problem.variables):
        if variable.name not in shape_names(problem.specimen):
            raise InputError("has no derivative: moved alone it would break the specimen's "
                             "symmetry",
                             key=f"vary.{variable.key}", given=problem.specimen.name)
        step = 1e-5 * (variable.high - variable.low)
        inward = step if values[number] - 2 * step < variable.low else -step
        ends = [_edge(problem.design(values + share * inward * np.eye(len(values))[number]),
                      variable.path[0])
                for share in (0, 1, 2)]
        differences = (-3 * ends[0] + 4 * ends[1] - ends[2]) / (2 * inward)
        slope = _complex_edge(problem.specimen, variable.path)
        size = np.abs(differences).max()
        if slope is None or not size > 0 or not np.abs(slope - differences).max() < 1e-3 * size:
            raise InputError("has no derivative: the points of its outline do not follow it "
                             "smoothly",
                             key=f"vary.{variable.key}", given=problem.specimen.name)


@dataclass(eq=False)
class _WithinBounds:
    """The problem over shares of the bounds; ``last`` is the design computed last."""

    problem: OptimiseProblem
    measure: str
    evaluator: DesignEvaluator
    last: Design

    def renewed(self, x: Array) -> Linearisation | None:
        """On a new mesh."""
        self.last, local = self.evaluator.fresh(self._values(x))
        return self._scaled(local)

    def at(self, x: Array) -> Linearisation | None:
        """On the mesh moved."""
        self.last, local = self.evaluator.moved(self._values(x))
        return self._scaled(local)

    def held(self, x: Array) -> tuple[float, Array]:
        """What the frame must keep; nan where there is no such frame."""
        try:
            miss, slope = self.problem.held_slopes(self.measure, self._values(x))
        except InputError:
            return float("nan"), np.zeros(len(x))
        return miss, slope * self._widths

    def share(self, values: Array) -> Array:
        """Values as shares of their bounds."""
        return (values - self._lows) / self._widths

    @property
    def _lows(self) -> Array:
        return np.array([variable.low for variable in self.problem.variables])

    @property
    def _widths(self) -> Array:
        return np.array([variable.high - variable.low for variable in self.problem.variables])

    def _values(self, x: Array) -> Array:
        return self._lows + self._widths * x

    def _scaled(self, local: Linearisation | None) -> Linearisation | None:
        return None if local is None else replace(local, slope=local.slope * self._widths,
                                                  limit_slopes=local.limit_slopes * self._widths)


def _optimum(problem: OptimiseProblem, held: str, runs: tuple[StartRun, ...], reference: Design,
             given: Design, settings: Settings) -> Optimum:
    best = max(runs, key=lambda run: (run.descent.status == "optimum", run.best.stroke))
    fine = replace(settings, mesh=settings.mesh.refined(2))
    evaluator = DesignEvaluator(problem, fine)
    finer = evaluator.fresh(best.best.values)[0]
    strokes = [run.best.stroke for run in runs]
    ends = np.array([run.descent.x for run in runs])
    base = evaluator.base
    warned = () if base is None else tuple(state_warnings(base.model, base.state))
    return Optimum(held, runs, best, finer, float(np.ptp(strokes)) / max(strokes),
                   float(np.ptp(ends, axis=0).max()),
                   best.best.stroke / reference.stroke - 1, best.best.stroke / given.stroke - 1,
                   warned)


def _alone(problem: OptimiseProblem, specimen: Specimen, settings: Settings) -> Design:
    """A specimen of its own shape under the problem's load and limits, nothing varied."""
    alone = replace(problem, specimen=specimen, variables=())
    return DesignEvaluator(alone, settings).fresh(np.zeros(0))[0]


def _edge(specimen: Specimen, part: str) -> Array:
    outline = specimen.frame if part == "frame" else specimen.plate.outline
    return outline.points(720)


def _complex_edge(specimen: Specimen, path: tuple[str, ...]) -> Array | None:
    """Derivative of the edge's points by a complex step.

    None where the outline does not take one.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.asarray(complex_step(
                lambda change: _edge(with_change(specimen, path, change), path[0]), 0.0))
        except (TypeError, ValueError, np.exceptions.ComplexWarning):
            return None
