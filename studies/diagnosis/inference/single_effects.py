"""Every effect by itself: how much of a misfit it would explain, and of what size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import SIZES, Cause
from tympan.studies.diagnosis.inference.verdict import Judgement


@dataclass(frozen=True, eq=False)
class SingleEffect:
    """One effect fitted with hardly any prior.

    ``share``: of the nominal model's χ² beyond noise that it takes away; ``widths``: its largest
    parameter over its usual size.
    """

    cause: Cause
    fit: Fit
    share: float
    widths: float

    @property
    def bounded(self) -> bool:
        """Whether it stopped at a limit."""
        sizes, (low, high) = self.fit.unknowns[SIZES], self.fit.bounds[:, SIZES]
        return bool(np.any((sizes != 0) & ((sizes <= low) | (sizes >= high))))

    @property
    def plausible(self) -> bool:
        """Whether the size is one such actuators have: up to twice the usual one."""
        return self.widths <= 2.0


def single_effects(judged: Judgement) -> tuple[SingleEffect, ...]:
    """Every effect fitted alone, the one that explains most first; none when nothing is wrong."""
    excess = max(judged.nominal.chi_squared - len(judged.table), 1e-9)
    effects = []
    for alone in judged.alone:
        share = (judged.nominal.chi_squared - alone.chi_squared) / excess
        cause = alone.hypothesis[0]
        effects.append(SingleEffect(cause, alone, min(max(share, 0.0), 1.0),
                                    alone.surprise(cause)))
    return tuple(sorted(effects, key=lambda effect: -effect.share))
