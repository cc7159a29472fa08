"""A dataset diagnosed: what its readings say is wrong, what it may be, and what to do about it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.studies.data.checks import warnings as data_warnings
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.calibration import calibrated, extended_setup, law_error, with_effects
from tympan.studies.diagnosis.inference.fit import Fit
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.next_experiment.proposals import Proposals, propose
from tympan.studies.diagnosis.readings import Readings, readings_of
from tympan.studies.diagnosis.reduced.simulation import Cause, Simulation
from tympan.studies.diagnosis.validation.gain import GainReport, gain_of
from tympan.studies.effects import Setup

Array = NDArray[np.float64]

#: Factors on the widths of the priors for which the verdict is found again.
SWEEP = (0.5, 2.0)

#: Scatter about smooth curves over the stated noise from which it is worth a word.
_ROUGH = 1.4


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that was found.

    ``model_error``: of the reduced model's deflections at the nominal fit and the best one, against
    finite elements on a fine mesh [m]; ``swept``: verdict and causes with the priors' widths times
    each factor of :data:`SWEEP`; ``chosen``: the hypothesis the extended model has, None when
    nothing is wrong; ``gain`` on readings held out; ``proposals`` for the next experiment.
    """

    dataset: Dataset
    readings: Readings
    simulation: Simulation
    judgement: Judgement
    model_error: float
    swept: tuple[tuple[str, tuple[str, ...]], ...]
    chosen: Fit | None
    gain: GainReport
    proposals: Proposals

    @property
    def verdict(self) -> str:
        """The verdict; with a noise that is only assumed no cause is named."""
        found = self.judgement.verdict
        return "ambiguous" if found == "named" and self.readings.assumed else found

    @property
    def extended(self) -> Setup | None:
        """Specimens and rig with stiffness, permittivity and effects as found."""
        one = self.chosen
        return None if one is None else extended_setup(self.simulation, one.hypothesis,
                                                       one.unknowns)

    @property
    def moves(self) -> bool:
        """Whether the verdict or the named causes change with the priors' widths."""
        here = self.judgement.verdict, names(self.judgement.named)
        return any(one != here for one in self.swept)

    def warnings(self) -> list[str]:
        """What limits the conclusions."""
        found = [*data_warnings(self.dataset), *self.readings.remarks]
        noise = float(np.median(self.judgement.table.sigma))
        if self.readings.assumed:
            found.append("the noise is not known but assumed, so no cause is named")
        if self.model_error > 0.5 * noise:
            found.append(f"the reduced model is off by up to {1e6 * self.model_error:.2g} um, which is not small "
                         f"beside the noise of {1e6 * noise:.2g} um")
        if self.judgement.test.noise > _ROUGH and self.readings.stated:
            found.append(f"the readings scatter {self.judgement.test.noise:.2g} times as much about smooth curves as "
                         "stated: the noise is understated, or something jumps, such as a plate that rubs")
        if self.moves:
            found.append("the verdict depends on how wide the effects' priors are taken (half or twice as wide)")
        return found


def diagnose(dataset: Dataset, workers: int = 1, seed: int = 0,
             progress: Callable[[int, int], None] = lambda done, all_of_them: None) -> Diagnosis:
    """Diagnose a dataset's static readings and ranges.

    Parameters
    ----------
    workers
        Processes for the finite elements; with more than one the calling script needs a main guard.
    seed
        Of the draws for critical values; another one moves probabilities by their sampling error.
    progress
        Called with the parts of the work done and their number.

    Raises
    ------
    InputError
        When nothing can be concluded: too few readings, a column off by a unit, films that cannot
        be solved.
    """
    readings = readings_of(dataset)
    nominal, found = calibrated(readings.setup, readings.table)
    error = law_error(nominal, found, readings.table)
    table = readings.table.with_sigma(np.hypot(readings.table.sigma,
                                               np.where(_lengths(readings), error, 0.0)))
    simulation = with_effects(nominal, progress, workers)
    causes = readings.causes
    judged = _judged(simulation, replace(readings, table=table), causes, seed)
    swept = []
    if judged.weighing is not None:
        for widen in SWEEP:
            other = judge(simulation, table, causes, readings.stated, widen=widen, seed=seed)
            swept.append((other.verdict, names(other.named)))
    chosen = chosen_fit(judged)
    if chosen is not None:
        error = max(error, law_error(simulation, chosen, table))
    gain = gain_of(simulation, table, causes, judged, seed)
    return Diagnosis(dataset, readings, simulation, judged, error, tuple(swept), chosen, gain,
                     propose(simulation, judged, causes))


def _judged(simulation: Simulation, readings: Readings, causes: tuple[Cause, ...],
            seed: int) -> Judgement:
    try:
        return judge(simulation, readings.table, causes, readings.stated, seed=seed)
    except ArithmeticError as error:
        raise InputError(str(error), key="readings",
                         given=f"{len(readings.table)} readings") from None


def _lengths(readings: Readings) -> NDArray[np.bool_]:
    """Rows that are lengths."""
    return np.asarray(np.isin(readings.table.kind, ("displacement", "range")))


def chosen_fit(judged: Judgement) -> Fit | None:
    """The hypothesis to extend the model with: the causes named, or the most probable."""
    if judged.weighing is None:
        return None
    return (judged.weighing.fit_of(judged.named) if judged.named else None) or judged.weighing.best


def names(causes: tuple[Cause, ...]) -> tuple[str, ...]:
    """Causes as words, in order."""
    return tuple(sorted(map(str, causes)))


def rmse(residual: Array, sigma: Array) -> float:
    """Root mean square of residuals given over their noise [m]."""
    return float(np.sqrt(np.mean((residual * sigma) ** 2)))

