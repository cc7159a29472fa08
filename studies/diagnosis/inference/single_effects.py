"""How much of a misfit each effect could explain, and how large it would have to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tympan.studies.diagnosis.inference.fit import Fit, fit
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reduced.hypothesis import SIZES, Cause
from tympan.studies.diagnosis.reduced.simulation import Simulation

#: Factor on the widths of the priors: what is left of them holds back only what nothing asks for.
_WIDE = 10.0


@dataclass(frozen=True, eq=False)
class SingleEffect:
    """One effect fitted with hardly any prior.

    ``share``: of the nominal model's χ² beyond noise that it takes away; ``widths``: its largest
    parameter in standard deviations of its prior; ``bounded``: whether it stopped at a limit of its
    parameters or of the reduced model.
    """

    cause: Cause
    fit: Fit
    share: float
    widths: float
    bounded: bool

    @property
    def plausible(self) -> bool:
        """Whether the size is one such actuators have: within two standard deviations."""
        return self.widths <= 2.0


def single_effects(simulation: Simulation, judged: Judgement,
                   causes: Sequence[Cause]) -> tuple[SingleEffect, ...]:
    """Every effect fitted alone, the one that explains most first; none when nothing is wrong.

    Those too that are not visible at a usual size: at an unusual one they may be.
    """
    if judged.posterior is None:
        return ()
    excess = max(judged.nominal.chi_squared - len(judged.table), 1e-9)
    effects = []
    for cause in causes:
        wide = fit(simulation, (cause,), judged.table, judged.nominal.unknowns, widen=_WIDE)
        if wide.possible:
            share = (judged.nominal.chi_squared - wide.chi_squared) / excess
            sizes, (low, high) = wide.unknowns[SIZES], wide.bounds[:, SIZES]
            widths = max(abs(size) / parameter.deviation for size, parameter
                         in zip(sizes.tolist(), cause.effect.parameters, strict=True))
            bounded = bool(np.any((sizes != 0) & ((sizes <= low) | (sizes >= high))))
            effects.append(SingleEffect(cause, wide, min(max(share, 0.0), 1.0), widths, bounded))
    return tuple(sorted(effects, key=lambda effect: -effect.share))
