"""The constants of lumped models from the readings of a dataset: at rest, in time, or both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from tympan.base.errors import InputError
from tympan.base.progress import Progress
from tympan.studies.case import Settings
from tympan.studies.data.dataset import Dataset
from tympan.studies.identify.dynamic import (
    DynamicProblem,
    Exact,
    identify_dynamic,
    nelder_mead_dynamic,
)
from tympan.studies.identify.responses import records_of
from tympan.studies.identify.result import IdentifyResult
from tympan.studies.identify.static import (
    Law,
    Sharing,
    StaticObjective,
    StaticProblem,
    identify_static,
    nelder_mead,
    readings_at_rest,
)
from tympan.studies.lumped.actuator import Actuator, paper_cones
from tympan.studies.lumped.model_file import LumpedModel
from tympan.studies.lumped.suited import suited_model

#: Called with the kind of an estimate, its values, and the record so far, before limits are found.
Teller = Callable[[str, dict[str, float], dict[str, Any]], None]


@dataclass(frozen=True)
class IdentifySettings:
    """Settings of an identification: models, constants and methods.

    ``model`` holds models of the specimens, in place of those built from the field model.
    ``paper`` selects the source paper's cones, whose ``weights`` may be given where no readings
    determine them. ``dynamic`` also finds the constants of the responses. ``law`` is the paper's
    Eq. (8), or one factor on the films' own material. ``alpha`` is found for each shape, found once
    for all shapes, or taken from the models. ``limits`` are found by profiles of the misfit, not
    linearised. ``nelder_mead`` adds the paper's simplex for comparison.
    """

    model: Sequence[LumpedModel] = ()
    paper: bool = False
    dynamic: bool = False
    law: Law | None = None
    alpha: Sharing | None = None
    weights: tuple[float, ...] | None = None
    objective: StaticObjective = "deflection"
    limits: bool = True
    nelder_mead: bool = False

    def steps(self, dataset: Dataset) -> int:
        """Count the progress reports."""
        return (1 + self.dynamic) * (1 + self.nelder_mead) + 4 * len(dataset.specimens)

    def require(self, dataset: Dataset) -> None:
        """Refuse a dataset without the required readings, or on a rig that cannot be fitted."""
        late = ("sensor_lag", *["series_resistance"][:self.dynamic])
        rig = dataset.rig
        for key in (*rig.hysteresis, *filter(partial(getattr, rig), late)):
            raise InputError("must be 0: constants are found of readings without it",
                             key=f"rig.{key}", given=getattr(rig, key))
        if self.dynamic:
            records_of(dataset)
        if self.at_rest(dataset):
            readings_at_rest(dataset)

    def at_rest(self, dataset: Dataset) -> bool:
        """Decide whether the readings at rest are fitted."""
        return dataset.static is not None or not self.dynamic

    def actuators(self, dataset: Dataset, settings: Settings, progress: Progress
                  ) -> tuple[Actuator, ...]:
        """Make the actuators of the specimens, in their order, under any mass."""
        if self.weights is not None and (self.at_rest(dataset) or not self.paper):
            words = ("is for --dynamic without static.csv, whose readings tell α"
                     if self.at_rest(dataset) else "is for the paper's cones, --paper")
            raise InputError(words, key="weights", given=self.weights)
        names = {model.specimen.name: model for model in self.model}
        if self.paper:
            if names:
                raise InputError("cannot be given with --paper", key="--model",
                                 given=", ".join(names))
            return paper_cones(dataset.specimens, self.weights, dataset.rig)
        if not names:
            return _suited(dataset, settings, progress)
        missing = [item.name for item in dataset.specimens if item.name not in names]
        if missing:
            raise InputError(f"must hold a model of each specimen: none is of {', '.join(missing)}",
                             key="--model", given=", ".join(names))
        return tuple(names[specimen.name].actuator(1.0, dataset.rig)
                     for specimen in dataset.specimens)


def identify(dataset: Dataset, chosen: IdentifySettings, settings: Settings,
             progress: Progress = lambda words: None,
             tell: Teller = lambda kind, values, record: None) -> IdentifyResult:
    """Find the constants behind a dataset's readings, with 95 % limits."""
    record: dict[str, Any] = {"dataset": dataset.name}
    static = dynamic = None
    actuators = chosen.actuators(dataset, settings, progress)
    if chosen.at_rest(dataset):
        law: Law = chosen.law or ("eq8" if chosen.paper else "film")
        alpha: Sharing = chosen.alpha or ("each" if chosen.paper else "given")
        problem = StaticProblem.of(dataset, actuators, law, alpha)
        progress("readings at rest")
        static = identify_static(problem, chosen.objective, chosen.limits,
                                 lambda values: tell("static", values, record))
        record["static"] = static.json()
        if chosen.nelder_mead:
            progress("readings at rest, simplex")
            record["nelder_mead_static"] = nelder_mead(problem)
    if chosen.dynamic:
        equal = chosen.paper and chosen.weights is None
        responses = DynamicProblem(static or Exact(actuators, equal), records_of(dataset),
                                   dataset.noise)
        progress("responses")
        dynamic = identify_dynamic(responses, chosen.limits,
                                   lambda values: tell("dynamic", values, record))
        record["dynamic"] = dynamic.json()
        if chosen.nelder_mead:
            progress("responses, simplex")
            record["nelder_mead_dynamic"] = nelder_mead_dynamic(responses)
    return IdentifyResult.of(record, static, dynamic)


def _suited(dataset: Dataset, settings: Settings, progress: Progress) -> tuple[Actuator, ...]:
    """Build membrane circles for the largest loads of each specimen's readings."""
    tables = [table for table in (dataset.static, dataset.transients) if table is not None]
    actuators = []
    for specimen in dataset.specimens:
        loads = [table[name][table.specimen == specimen.name].max(initial=0.0)
                 for name in ("mass", "voltage") for table in tables]
        masses, voltages = loads[:len(tables)], loads[len(tables):]
        actuators.append(suited_model(specimen, float(max(masses)), float(max(voltages)), settings,
                                      dataset.rig, progress).actuator(1.0, dataset.rig))
    return tuple(actuators)
