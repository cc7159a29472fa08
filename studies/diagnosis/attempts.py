"""How much of a misfit each effect could explain, and how large it would have to be, whatever is thought usual."""

from __future__ import annotations

from dataclasses import dataclass

from studies.diagnosis.fit import Fit, fit
from studies.diagnosis.judgement import Judgement
from studies.diagnosis.simulation import Cause, Simulation

#: Factor on the widths of the priors: what is left of them holds back only what nothing asks for.
_WIDE = 10.0


@dataclass(frozen=True, eq=False)
class Attempt:
    """One effect fitted with hardly any prior.

    ``share``: of the nominal model's χ² beyond noise that it takes away; ``widths``: its largest parameter in standard
    deviations of its prior; ``bounded``: whether it stopped at a limit of its parameters or of the reduced model.
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


def attempts(simulation: Simulation, judged: Judgement) -> tuple[Attempt, ...]:
    """Every visible effect, the one that explains most first; none when nothing is wrong."""
    if judged.weighing is None:
        return ()
    found = []
    table, nominal = judged.table, judged.nominal
    excess = max(nominal.chi_squared - len(table), 1e-9)
    for one in judged.weighing.fits:
        if len(one.hypothesis) == 1:
            wide = fit(simulation, one.hypothesis, table, one.unknowns, widen=_WIDE)
            parameters = one.hypothesis[0].of_registry.parameters
            sizes = wide.unknowns[2:].tolist()
            widths = max(abs(size) / item.deviation for size, item in zip(sizes, parameters, strict=True))
            ends = (wide.unknowns <= wide.bounds[0] + 1e-12) | (wide.unknowns >= wide.bounds[1] - 1e-12)
            edge = bool(ends[2:].any())
            share = (nominal.chi_squared - wide.chi_squared) / excess
            found.append(Attempt(one.hypothesis[0], wide, min(max(share, 0.0), 1.0), widths, edge and widths > 0))
    return tuple(sorted(found, key=lambda attempt: -attempt.share))
