"""Optima of a problem: from every start, checked on a finer mesh and against each other."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.complex_step import complex_step
from tympan.fem.derivatives.parameters import shape_names
from tympan.fem.derivatives.shape import edge_nodes
from tympan.geometry.errors import InputError
from tympan.geometry.paths import at, with_change
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model, state_warnings
from tympan.studies.optimise.design import Design, DesignEvaluator
from tympan.studies.optimise.problem import OptimiseProblem
from tympan.studies.optimise.sqp import Descent, DescentSettings, maximise

Array = NDArray[np.float64]
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class StartRun:
    """The designs tried from one start; numbers in the descent are shares of the bounds."""

    held: str
    start: int
    trials: tuple[Design, ...]
    descent: Descent

    @property
    def best(self) -> Design:
        """Where it ended; a start that came to nothing, itself."""
        accepted = [trial for trial in self.trials if trial.accepted]
        return (accepted or self.trials)[-1]


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
    for measure in problem.held:
        runs: list[StartRun] = []
        for number, values in enumerate(problem.starts):
            progress(f"equal {measure}, start {number + 1}")
            run = run_from(problem, measure, number, np.array(values), settings, descent)
            (runs if run.descent.here is not None else failed).append(run)
        progress(f"equal {measure}, finer mesh")
        if runs:
            optima.append(_optimum(problem, measure, tuple(runs), reference, given, settings))
    return Optima(problem, reference, given, tuple(optima), tuple(failed))


def run_from(problem: OptimiseProblem, measure: str, number: int, values: Array,
             settings: Settings, descent: DescentSettings) -> StartRun:
    """One descent, every point on its way kept."""
    reason = f"no design within the bounds has the {measure} of the reference's frame"
    nowhere = Design(values, reason=reason)
    evaluator = DesignEvaluator(problem, settings, measure)
    trials: list[Design] = []

    def note(x: Array, accepted: bool) -> None:
        trials.append(replace(evaluator.last or nowhere, accepted=accepted))

    ended = maximise(evaluator, (values - problem.lows) / problem.widths, descent, note)
    return StartRun(measure, number, tuple(trials) or (evaluator.last or nowhere,), ended)


def check_derivatives(problem: OptimiseProblem, settings: Settings) -> None:
    """Refuse variables no mesh can follow, or whose outline is not differentiable by them."""
    specimen = problem.specimen
    model = build_model(specimen, settings, problem.rig.loading)
    edge_nodes(model.discretisation, model.specimen)
    values = np.array([at(specimen, variable.path) for variable in problem.variables])
    for variable, value, unit in zip(problem.variables, values, np.eye(len(values)), strict=True):
        part = variable.path[0]
        if variable.name not in shape_names(specimen):
            raise InputError("has no derivative: moved alone it would break the specimen's "
                             "symmetry", key=f"vary.{variable.key}", given=specimen.name)
        step = 1e-5 * (variable.high - variable.low)
        inward = step if value - 2 * step < variable.low else -step
        edges = [_edge(problem.design(values + share * inward * unit), part) for share in (0, 1, 2)]
        differences = (-3 * edges[0] + 4 * edges[1] - edges[2]) / (2 * inward)
        size = np.abs(differences).max()
        slope = _edge_slope(specimen, variable.path)
        if slope is None or not size > 0 or not np.abs(slope - differences).max() < 1e-3 * size:
            raise InputError("has no derivative: the points of its outline do not follow it "
                             "smoothly", key=f"vary.{variable.key}", given=specimen.name)


def _optimum(problem: OptimiseProblem, measure: str, runs: tuple[StartRun, ...],
             reference: Design, given: Design, settings: Settings) -> Optimum:
    best = max(runs, key=lambda run: (run.descent.status == "optimum", run.best.stroke))
    evaluator = DesignEvaluator(problem, replace(settings, mesh=settings.mesh.refined(2)))
    finer, _ = evaluator.fresh(best.best.values)
    strokes = [run.best.stroke for run in runs]
    ends = np.array([run.descent.x for run in runs])
    warned = (() if evaluator.model is None or evaluator.state is None
              else tuple(state_warnings(evaluator.model, evaluator.state)))
    return Optimum(measure, runs, best, finer, float(np.ptp(strokes)) / max(strokes),
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


def _edge_slope(specimen: Specimen, path: tuple[str, ...]) -> Array | None:
    """Derivative of the edge's points, None where the outline takes no complex step."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.asarray(complex_step(
                lambda change: _edge(with_change(specimen, path, change), path[0]), 0.0))
        except (TypeError, ValueError, np.exceptions.ComplexWarning):
            return None
