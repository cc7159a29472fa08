"""Readings far off the smooth curve of their ramp, before any film is solved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import Numbers
from tympan.studies.columns import Sheet
from tympan.studies.data.ramps import MEDIAN, ramps

#: Standard deviations from which a reading is an outlier. Of 10,000 normal readings none is.
_FAR = 6.0
#: Most outliers of a ramp, as a share: of more the others do not tell the curve.
_MOST = 0.25
#: Fewest readings of a ramp that tell a curve and one that is off it.
_FEWEST = 6
#: Least scatter, over the largest reading: no sensor resolves so little, and a computer's rounding
#: is less.
_LEAST = 1e-6
#: Share of a reading within which it is another one times ten, or with the other sign.
_SAME = 0.05


@dataclass(frozen=True)
class Outlier:
    """A reading by the number of its row, with what the curve of the others has there [m].

    ``how``: what makes it right, "factor" or "sign", else "".
    """

    row: int
    read: float
    expected: float
    how: str = ""


def outliers(static: Sheet, rows: Numbers, noise: float | None) -> list[Outlier]:
    """Those among some rows; ``noise`` is the standard deviation of a reading [m], if stated.

    The scale is the median of what all curves miss, or the noise if that is more, or a millionth of
    the largest reading. The readings are taken away one by one, the farthest first, for one moves
    the curve of its neighbours. The last one before the ramp's end counts only if its sign or a
    factor of ten makes it right: a film near pull-in moves more than any smooth curve foretells.
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
    """Kind of change that makes a reading right."""
    for how, factors in (("sign", (-1.0,)), ("factor", (10.0, 0.1))):
        if any(abs(factor * read - expected) <= _SAME * abs(expected) for factor in factors):
            return how
    return ""
