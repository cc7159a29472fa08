"""Readings far off the smooth curve of their ramp, found before any film is solved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import Numbers
from tympan.studies.columns import Sheet
from tympan.studies.data.ramps import MEDIAN, ramps

#: Standard deviations from which a reading is an outlier: none of 10,000 normal readings is.
_FAR = 6.0
#: Largest share of outliers in a ramp: with more the others do not determine the curve.
_MOST = 0.25
#: Fewest readings of a ramp that determine a curve and one outlier.
_FEWEST = 6
#: Least scatter over the largest reading: no sensor resolves less, and rounding in a computer is
#: smaller.
_LEAST = 1e-6
#: Share of a reading within which it equals ten times, a tenth or the negative of another value.
_SAME = 0.05


@dataclass(frozen=True)
class Outlier:
    """A reading by the number of its row, with the value of the others' curve there [m].

    ``how``: the correction that makes it fit, "factor" or "sign", else "".
    """

    row: int
    read: float
    expected: float
    how: str = ""


def outliers(static: Sheet, rows: Numbers, noise: float | None) -> list[Outlier]:
    """Find outliers among some rows; ``noise``: standard deviation of a reading [m], if stated.

    The scale is the largest of three: median residual of all curves, noise, a millionth of the
    largest reading. Outliers are removed one by one, the farthest first, since each one moves the
    curve at its neighbours. The last reading before a ramp's end counts only if its sign or a
    factor of ten corrects it: near pull-in a film moves more than any smooth curve predicts.
    """
    every = [ramp for ramp in ramps(static, rows) if len(ramp.rows) >= _FEWEST]
    if not every:
        return []
    scale = max(float(np.median(np.abs(np.concatenate([ramp.studentised for ramp in every])))
                      ) / MEDIAN, noise or 0.0,
                _LEAST * max(float(np.abs(ramp.read).max()) for ramp in every))
    found = list[Outlier]()
    for whole in every:
        ramp = whole
        for _ in range(int(_MOST * len(whole.rows))):
            place = int(np.abs(ramp.studentised).argmax())
            if abs(ramp.studentised[place]) <= _FAR * scale:
                break
            read, expected = float(ramp.read[place]), ramp.expected(place)
            one = Outlier(int(ramp.rows[place]), read, expected, _slip(read, expected))
            if one.how or static.voltage[one.row] < static.voltage[whole.rows].max():
                found.append(one)
            ramp = ramp.without(place)
    return sorted(found, key=lambda one: one.row)


def _slip(read: float, expected: float) -> str:
    """Find the kind of change that corrects a reading."""
    for how, factors in (("sign", (-1.0,)), ("factor", (10.0, 0.1))):
        if any(abs(factor * read - expected) <= _SAME * abs(expected) for factor in factors):
            return how
    return ""
