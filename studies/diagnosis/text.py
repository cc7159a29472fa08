"""The words of a diagnosis: where a misfit is, what to do next, what limits the conclusions."""

from __future__ import annotations

import numpy as np

from tympan.studies.data.checks import dataset_warnings
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.inference.residual_tests import words_of
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.readings import PreparedReadings

#: The next experiment where no effect explains a misfit.
AGAIN = ("mount the specimens again and repeat the readings, up and down: see whether the misfit "
         "is there again, and how large the noise is, before looking for an effect nobody has "
         "thought of")

#: Patterns that noise shows less often than this are told too.
_CLEAR = 1e-3

#: Scatter about smooth curves over the stated noise from which it is worth a word.
_ROUGH = 1.4


def where(judged: Judgement) -> str:
    """Where the misfit is: the strongest pattern, and the strongest of another kind.

    Of patterns that are about as strong the one is taken that says more: of a specimen before of
    all readings.
    """
    strength = {name: max(p, 1e-12) for name, p in judged.test.p_values.items()
                if name in judged.patterns and name != "ramps"}
    vague = {"level": 1e4, "fitted value": 1e3, "voltage": 10.0}
    order = sorted(strength, key=lambda name: strength[name] * vague.get(name, 1.0))
    others = [name for name in order[1:] if strength[name] < _CLEAR and name not in vague
              and name.split()[0] != order[0].split()[0]]
    return "; ".join(words_of(name) for name in order[:1] + others[:1])


def limitations(dataset: Dataset, readings: PreparedReadings, judged: Judgement,
                model_error: float, moves: bool) -> list[str]:
    """What limits the conclusions.

    ``model_error`` [m], and whether the verdict moves with the priors.
    """
    words = [*dataset_warnings(dataset), *readings.remarks]
    noise = float(np.median(judged.table.sigma))
    if readings.assumed:
        words.append("the noise is not known but assumed, so no cause is named")
    if model_error > 0.5 * noise:
        words.append(f"the reduced model is off by up to {1e6 * model_error:.2g} um, which is not "
                     f"small beside the noise of {1e6 * noise:.2g} um")
    if judged.test.noise > _ROUGH and readings.stated:
        words.append(f"the readings scatter {judged.test.noise:.2g} times as much about smooth "
                     "curves as stated: the noise is understated, or something jumps, such as a "
                     "plate that rubs")
    if moves:
        words.append("the verdict depends on how wide the effects' priors are taken (half or twice "
                     "as wide)")
    return words
