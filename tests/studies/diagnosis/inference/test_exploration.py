"""Exploration of hypotheses: which effects are grown beyond what is sampled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from tympan.studies.diagnosis.evidence.kind import ReadingModel
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis
from tympan.studies.diagnosis.inference.exploration import _BEHIND, Exploration

NEAR, FAR = (Cause("sensor_zero"),), (Cause("drift"),)


def pressing(hypothesis: Hypothesis, cost: float, size: float = 1.0) -> Fit:
    """A fit at the end of what is sampled, 1, that would go on."""
    return Fit(hypothesis, np.array([0.0, 0.0, size]), bounds=bounds(1.0), limits=bounds(100.0),
               residual=np.zeros(1), jacobian=np.zeros((1, 3)), slope=np.array([0.0, 0.0, -1.0]),
               precision=np.eye(3), cost=cost, evidence=-cost, deflection=np.zeros(1))


def bounds(end: float) -> np.ndarray:
    return np.array([[-9.0, -9.0, -end], [9.0, 9.0, end]])


@dataclass
class Sampled:
    """Films sampled up to an end for each effect, which doubles when they are grown."""

    ends: dict[Cause, float] = field(default_factory=lambda: {NEAR[0]: 1.0, FAR[0]: 1.0})

    def bounds(self, hypothesis: Hypothesis) -> np.ndarray:
        return bounds(self.ends[hypothesis[0]])

    def limits(self, hypothesis: Hypothesis) -> np.ndarray:
        return bounds(100.0)

    def grown(self, cause: Cause, index: int, side: int, workers: int = 1) -> Sampled:
        assert (index, side) == (0, 1)
        return Sampled({**self.ends, cause: 2 * self.ends[cause]})


class Fitted(Exploration):
    """An exploration whose fits end where they begin, and press no more."""

    def _fit(self, hypothesis: Hypothesis, starts: Sequence[np.ndarray]) -> None:
        self.fits[hypothesis] = replace(self.fits[hypothesis], unknowns=starts[-1],
                                        slope=np.zeros(3))


def grown(*fits: Fit) -> Fitted:
    """An exploration of fits, grown as far as they press."""
    nothing = cast(Any, None)
    explored = Fitted(cast(ReadingModel, Sampled()), nothing, nothing, (), lambda fit: True)
    explored.fits = {fit.hypothesis: fit for fit in fits}
    explored._grow(list(explored.fits), 5)
    return explored


def test_an_effect_grows_that_may_still_be_the_best_and_none_that_is_far_behind() -> None:
    explored = grown(pressing(NEAR, 10.0), pressing(FAR, 10.0 + _BEHIND + 5.0))
    assert cast(Any, explored.simulation).ends == {NEAR[0]: 2.0, FAR[0]: 1.0}
    assert explored.fits[NEAR].unknowns[2] > 1.0
    assert explored.fits[FAR].unknowns[2] == 1.0


def test_an_effect_grows_though_its_search_ended_a_little_before_the_end() -> None:
    explored = grown(pressing(NEAR, 10.0, size=0.9995), pressing(FAR, 10.0, size=0.99))
    assert cast(Any, explored.simulation).ends == {NEAR[0]: 2.0, FAR[0]: 1.0}
