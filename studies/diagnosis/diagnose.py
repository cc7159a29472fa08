"""A dataset diagnosed: what its readings say is wrong, what it may be, and what to do about it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tympan.geometry.errors import InputError
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.calibration import calibrated, law_error, with_effects
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.result import Diagnosis, cause_names

#: Factors on the widths of the priors for which the verdict is found again.
SWEEP = (0.5, 2.0)


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
    readings = prepared_readings(dataset)
    nominal, fit = calibrated(readings.setup, readings.table)
    error = law_error(nominal, fit, readings.table)
    # The reduced model's error is noise of the lengths.
    table = readings.table.with_sigma(np.hypot(readings.table.sigma,
                                               np.where(readings.table.lengths, error, 0.0)))
    readings = replace(readings, table=table)
    simulation = with_effects(nominal, progress, workers)
    try:
        judged = judge(simulation, table, readings.causes, readings.stated, seed=seed)
    except ArithmeticError as failure:
        raise InputError(str(failure), key="readings", given=f"{len(table)} readings") from None
    swept = []
    for widen in SWEEP if judged.posterior is not None else ():
        other = judge(simulation, table, readings.causes, readings.stated, widen=widen, seed=seed)
        swept.append((other.verdict, cause_names(other.named)))
    if judged.chosen is not None:
        error = max(error, law_error(simulation, judged.chosen, table))
    return Diagnosis.of(dataset, readings, simulation, judged, error, tuple(swept), seed)
