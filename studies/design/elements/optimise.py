"""Best designs from every start, checked on a finer mesh and against each other; stored."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.library import load_specimen
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, state_warnings
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.design.elements.evaluator import Design, DesignEvaluator, check_derivatives
from tympan.studies.design.elements.space import ElementSpace
from tympan.studies.design.quantities import QUANTITIES
from tympan.studies.design.requirements import MEASURES, NOTHING, held_words
from tympan.studies.design.sqp import Descent, DescentSettings, maximise
from tympan.studies.files import from_json, read_json, remove, write_json, write_text

#: A limit is active where its value is so near to it, relative.
ACTIVE = 1e-3

#: What differs between the same warning of two states.
_NUMBERS = re.compile(r"\d[\d.e+-]*")

#: The columns of optimum-outlines.csv: edges of frame and plate of the reference (``held`` blank)
#: and of the designs gone to on the way to each optimum.
OUTLINES: tuple[Column, ...] = (
    Column.labels("held", required=False), Column("trial"),
    Column.labels("part", ("frame", "plate")), Column("x", "mm"), Column("y", "mm"))

TableOfColumns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class OptimiseResult:
    """``record``: all numbers [SI]; ``trials``: every design tried; ``outlines``: as OUTLINES.

    ``record`` has an optimum for each measure of the frame that is held: the best end of all
    starts. Its ``finer`` is the same design on a mesh twice as fine, ``starts_apart_stroke`` the
    largest difference in stroke between starts that came to an end, relative,
    ``starts_apart_variables`` in any variable, relative to its bounds; ``gain`` and
    ``gain_over_given`` are its stroke over the reference's and the specimen's own, minus one.
    ``trials`` has the columns of path.csv: held, start, trial, accepted, the variables, stroke, the
    limited values, how the film ends, and reason. ``specimens``: the optimal ones by file name.
    """

    pictures: ClassVar[tuple[str, ...]] = ("optimum.png", "optimum.svg")  #: that are drawn of it

    record: Mapping[str, Any]
    trials: TableOfColumns
    outlines: TableOfColumns
    specimens: Mapping[str, Specimen]

    def json(self) -> dict[str, Any]:
        """Result as a JSON object."""
        return dict(self.record)

    def save(self, folder: Path) -> None:
        """Write ``path.csv``, ``optimum-outlines.csv``, specimens, and last ``optimum.json``."""
        specimens = (f"optimum-{measure}.toml" for measure in (*MEASURES, NOTHING))
        remove(folder, "optimum.json", "path.csv", "optimum.toml", "optimum-outlines.csv",
               *specimens)
        write_sheet(folder / "path.csv", _trial_columns(self.record), self.trials)
        write_sheet(folder / "optimum-outlines.csv", OUTLINES, self.outlines)
        for name, specimen in self.specimens.items():
            write_text(folder / name, specimen_to_toml(specimen))
        write_json(folder / "optimum.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> OptimiseResult:
        """Load a saved optimum; refused where it is of a version that kept too little."""
        file = folder / "optimum.json"
        record = from_json(dict[str, Any], read_json(file), file)
        if "variables" not in record:
            raise InputError("is of a version that kept too little for a picture: run tympan "
                             "design again", file=file)
        files = [optimum["specimen_file"] for optimum in record["optima"]]
        return cls(record, read_own_sheet(folder / "path.csv", _trial_columns(record)),
                   read_own_sheet(folder / "optimum-outlines.csv", OUTLINES),
                   {name: load_specimen(folder / name) for name in files})


@dataclass(frozen=True, eq=False)
class StartRun:
    """The designs tried from one start; numbers in the descent are shares of the bounds."""

    held: str
    start: int
    trials: tuple[Design, ...]
    descent: Descent

    @property
    def best(self) -> Design:
        """End of the search; a start that came to nothing, itself."""
        accepted = [trial for trial in self.trials if trial.accepted]
        return (accepted or self.trials)[-1]


def optimise(space: ElementSpace, settings: Settings = Settings(),
             progress: Callable[[str], None] = lambda words: None) -> OptimiseResult:
    """The best design of a space, one for each measure of the frame that is held.

    Raises
    ------
    InputError
        When a variable's shape has no derivative.
    """
    requirements = space.requirements
    check_derivatives(space, settings)
    reference = given = _alone(space, space.specimen, settings)
    if space.reference != space.specimen:
        reference = _alone(space, space.reference, settings)
    optima: list[dict[str, Any]] = []
    ended: list[StartRun] = []
    failed: list[StartRun] = []
    bests: list[StartRun] = []
    for measure in requirements.held:
        runs: list[StartRun] = []
        for number, values in enumerate(space.starts):
            progress(f"{held_words(measure)}, start {number + 1}")
            run = run_from(space, measure, number, np.array(values), settings)
            (runs if run.descent.here is not None else failed).append(run)
        progress(f"{held_words(measure)}, finer mesh")
        if runs:
            bests.append(max(runs, key=lambda run: (run.descent.status == "optimum",
                                                    run.best.stroke)))
            optima.append(_optimum(space, bests[-1], runs, reference, given, settings))
            ended += runs
    record = {
        "name": requirements.name, "mass_kg": requirements.mass, "voltage_V": requirements.voltage,
        "limits": {name: {"bound": bound, "unit": QUANTITIES[name].unit}
                   for name, bound in requirements.bounds.items()},
        "variables": {variable.key: {"low": variable.low, "high": variable.high,
                                     "dimension": variable.dimension}
                      for variable in space.variables},
        "reference": {"specimen": space.reference.name, **_design(space, reference)},
        "given": {"specimen": space.specimen.name, **_design(space, given)},
        "optima": optima,
        "failed": [{"held": run.held, **_run(space, run)} for run in failed]}
    specimens = {
        _specimen_file(space, run): replace(run.best.specimen,
                                              name=f"{requirements.name} {held_words(run.held)}")
        for run in bests if run.best.specimen is not None}
    return OptimiseResult(record, _trials(space, [*ended, *failed]), _outlines(space, bests),
                          specimens)


def run_from(space: ElementSpace, measure: str, number: int, values: NDArray[np.float64],
             settings: Settings, descent: DescentSettings = DescentSettings()) -> StartRun:
    """One descent, every point on its way kept."""
    nowhere = Design(values, reason=f"no design within the bounds has the {measure} of the "
                                    "reference's frame")
    evaluator = DesignEvaluator(space, settings, measure)
    trials: list[Design] = []

    def note(accepted: bool) -> None:
        trials.append(replace(evaluator.last or nowhere, accepted=accepted))

    ended = maximise(evaluator, (values - space.lows) / space.widths, descent, note)
    return StartRun(measure, number, tuple(trials) or (evaluator.last or nowhere,), ended)


def _alone(space: ElementSpace, specimen: Specimen, settings: Settings) -> Design:
    """A specimen of its own shape under the space's load and limits, nothing varied."""
    evaluator = DesignEvaluator(replace(space, specimen=specimen, variables=()), settings)
    evaluator.at(np.zeros(0), renew=True)
    assert evaluator.last is not None
    return evaluator.last


def _optimum(space: ElementSpace, best: StartRun, runs: Sequence[StartRun],
             reference: Design, given: Design, settings: Settings) -> dict[str, Any]:
    design, multipliers, here = best.best, best.descent.multipliers, best.descent.here
    assert multipliers is not None
    assert here is not None
    evaluator = DesignEvaluator(space, replace(settings, mesh=settings.mesh.refined(2)))
    evaluator.at(best.descent.x, renew=True)
    finer = evaluator.last
    assert finer is not None
    share, limits = 1 / design.stroke, {}
    for name, bound in space.requirements.bounds.items():
        rows = np.array([owner == name for owner, _ in design.owners], bool)
        near = [design.owners[row][1] for row in np.flatnonzero(rows & (here.limits > -ACTIVE))]
        limits[name] = {
            "bound": bound, "unit": QUANTITIES[name].unit, "value": _number(design.limited[name]),
            "at_V": design.kept[name].at_V,
            "finer": _number(finer.limited.get(name, np.nan)), "active": bool(near),
            "active_V": sorted({at for at in near if at is not None}),
            "multiplier": float(multipliers.limits[rows].sum()) * share}
    strokes, ends = [run.best.stroke for run in runs], np.array([run.descent.x for run in runs])
    return {
        "held": best.held, "best_start": best.start + 1,
        "specimen_file": _specimen_file(space, best),
        "status": best.descent.status, **_design(space, design),
        "gain": _number(design.stroke / reference.stroke - 1),
        "gain_over_given": _number(design.stroke / given.stroke - 1),
        "held_multiplier": multipliers.held * share,
        "kkt_residual": multipliers.residual, "limits": limits,
        "at_bounds": [variable.key for variable, force
                      in zip(space.variables, multipliers.bounds, strict=True) if force],
        "finer": {**_design(space, finer),
                  "gain": _number(finer.stroke / reference.stroke - 1)},
        "starts": [_run(space, run) for run in runs],
        "starts_apart_stroke": float(np.ptp(strokes)) / max(strokes),
        "starts_apart_variables": float(np.ptp(ends, axis=0).max()),
        "warnings": [*_warnings(evaluator), *space.case.remarks]}


def _warnings(evaluator: DesignEvaluator) -> Iterable[str]:
    """Warnings of a design's states, each once: as it is at the highest voltage that has it."""
    if evaluator.model is None:
        return ()
    told: dict[str, str] = {}
    for state in evaluator.states:
        told |= {_NUMBERS.sub("", words): words for words in state_warnings(evaluator.model, state)}
    return told.values()


def _run(space: ElementSpace, run: StartRun) -> dict[str, Any]:
    multipliers = run.descent.multipliers
    return {"start": run.start + 1, "status": run.descent.status, "trials": run.descent.trials,
            "without_equilibrium": run.descent.missing,
            "kkt_residual": None if multipliers is None else multipliers.residual,
            **_design(space, run.best)}


def _design(space: ElementSpace, design: Design) -> dict[str, Any]:
    frame = {} if design.specimen is None else {
        f"frame_{name}": float(measure(design.specimen.frame))
        for name, measure in MEASURES.items()}
    variables = {variable.key: float(value) for variable, value
                 in zip(space.variables, design.values, strict=False)}
    return {"variables": variables, "stroke_m": _number(design.stroke),
            "deflection_without_voltage_m": _number(design.rest), **frame,
            "limited": {name: _number(value) for name, value in design.limited.items()},
            "limited_at_V": {name: limit.at_V for name, limit in design.kept.items()},
            "end": design.end,
            "reason": design.reason}


def _number(value: float) -> float | None:
    return float(value) if isfinite(value) else None


def _specimen_file(space: ElementSpace, run: StartRun) -> str:
    return "optimum.toml" if len(space.requirements.held) == 1 else f"optimum-{run.held}.toml"


def _trial_columns(record: Mapping[str, Any]) -> tuple[Column, ...]:
    variables = [Column(name, "mm" if variable["dimension"] == "length" else "")
                 for name, variable in record["variables"].items()]
    limits = [Column(name, limit["unit"].removesuffix("1"), required=False, absent="nan")
              for name, limit in record["limits"].items()]
    return (Column.labels("held"), Column("start"), Column("trial"), Column("accepted"), *variables,
            Column("stroke", "mm", required=False, absent="nan"), *limits,
            Column.labels("end", required=False), Column.labels("reason", required=False))


def _trials(space: ElementSpace, runs: Sequence[StartRun]) -> TableOfColumns:
    rows = [{"held": run.held, "start": run.start + 1.0, "trial": float(number),
             "accepted": float(trial.accepted), "stroke": trial.stroke, "reason": trial.reason,
             **{variable.key: float(value) for variable, value
                in zip(space.variables, trial.values, strict=True)},
             **{name: trial.limited.get(name, np.nan) for name in space.requirements.bounds},
            "end": trial.end or ""}
            for run in runs for number, trial in enumerate(run.trials)]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _outlines(space: ElementSpace, bests: Sequence[StartRun]) -> TableOfColumns:
    shown = [("", 0, space.reference)]
    shown += [(run.held, number, trial.specimen) for run in bests
              for number, trial in enumerate(run.trials)
              if trial.accepted and trial.specimen is not None]
    edges: list[tuple[str, int, str, NDArray[Any]]] = []
    for measure, number, specimen in shown:
        offset = np.array(specimen.needed_plate().offset)[:, None]
        edges += [(measure, number, "frame", specimen.frame.points(360)),
                  (measure, number, "plate", specimen.needed_plate().outline.points(360) + offset)]
    x, y = np.concatenate([edge for *_, edge in edges], axis=1)
    lengths = [edge.shape[1] for *_, edge in edges]
    return {"held": np.repeat([measure for measure, *_ in edges], lengths),
            "trial": np.repeat([float(number) for _, number, *_ in edges], lengths),
            "part": np.repeat([part for _, _, part, _ in edges], lengths), "x": x, "y": y}
