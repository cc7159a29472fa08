"""Shares of the nominal model's misfit that patterns explain: where the misfit is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.inference.projection import basis_outside, taken_by
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.patterns.reading_patterns import EACH_RUN, JUMPS, over

#: Factors on the χ² of vague patterns, so that more specific ones are reported instead.
_VAGUE = {"level": 0.5, "fitted": 0.6, "voltage": 0.9, "coupon_level": 0.5, "coupon_stretch": 0.9}
#: Factors on the χ² of the best of many columns: it fits a little of anything.
_BEST_OF_MANY = {"step": 0.8, "stick": 0.8}

#: χ² from which a second pattern is reported. Set by trial.
_CLEAR = 30.0
#: Factor by which a specimen or run that deviates alone must explain more than any other.
_ALONE = 2.0


def largest_patterns(judged: Judgement) -> tuple[list[str], dict[str, float]]:
    """Find the pattern that explains most of the misfit, and one more; and the shares of all.

    The second one explains most besides all patterns of the first one's kind. A pattern is counted
    by what it explains beyond the refitted stiffness and permittivity, so a specimen is not blamed
    for a change of these factors.
    """
    columns = pattern_columns(judged)
    taken, largest = taken_by(judged.nominal.free_jacobian), list[str]()
    first: dict[str, float] = {}
    for least in (0.0, _CLEAR):
        kinds = {name.split()[0] for name in largest}
        others = {name: values for name, values in columns.items() if name.split()[0] not in kinds}
        shares = shares_of(judged, taken, others)
        best = max(shares, key=lambda name: shares[name], default=None)
        if best is None or shares[best] <= least or (largest and best.split()[0] in _VAGUE):
            break
        largest.append(best)
        first = first or shares
        of_kind = [values for name, values in others.items() if name.split()[0] == best.split()[0]]
        taken = np.hstack([taken, basis_outside(taken, np.hstack(of_kind))])
    return largest, first


def shares_of(judged: Judgement, taken: Array, columns: Mapping[str, Array]) -> dict[str, float]:
    """Compute χ² that patterns explain, reduced for vague ones and for the best of many."""
    weights = _VAGUE | _BEST_OF_MANY
    return {name: _taken(judged.nominal, taken, values) * weights.get(name.split()[0], 1.0)
            for name, values in columns.items()}


def pattern_columns(judged: Judgement) -> dict[str, Array]:
    """Build columns of patterns over the noise; of jumps only the best one.

    Jumps are left out where another pattern is less probable by noise alone.
    """
    columns = over(judged.misfit.patterns, judged.table)
    for name in EACH_RUN:
        columns.pop(name, None)
    p_values = judged.test.p_values
    least = min(p_values.get(name, 1.0) for name in columns)
    for name in columns.keys() & set(JUMPS):
        size = np.linalg.norm(columns[name], axis=0)
        best = np.argmax(np.abs(judged.nominal.residual @ columns[name]) / np.maximum(size, 1e-300))
        columns[name] = columns[name][:, [best]]
    return {name: values for name, values in columns.items()
            if name not in JUMPS or p_values.get(name, 1.0) <= least}


def stands_out(best: str, shares: Mapping[str, float], rivals: Iterable[str] = ()) -> bool:
    """Check that no other specimen, or none of some rivals, explains nearly as much."""
    among = rivals or [name for name in shares if name.startswith("specimen ")]
    return shares[best] >= _ALONE * max([*(shares[name] for name in among if name != best), 0.0])


def _taken(nominal: Fit, taken: Array, columns: Array) -> float:
    """Compute χ² that columns explain besides those taken already, beyond their number."""
    basis = basis_outside(taken, columns)
    return float(np.sum((basis.T @ nominal.residual) ** 2) - basis.shape[1])
