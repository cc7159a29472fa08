"""What of coupon tests is held out together: a mode, a temperature, a rate or level, a voltage."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.coupon_tests import CouponTests
from tympan.studies.material.branches import held_out_groups

#: Share of the largest logarithm of a stretch from which readings are held out.
_FAR = 0.7

#: A kind of split, the name of what is held out, its rows.
Split = tuple[str, str, NDArray[np.bool_]]


def coupon_splits(tests: CouponTests, table: ReadingTable
                 ) -> tuple[list[Split], dict[str, NDArray[Any]]]:
    """The splits, and by kind what level each row is of, shape (rows,)."""
    coupons, reading = tests.coupons, tests.rows[table.point]
    mode, warmth = coupons.mode[reading], coupons.degrees[reading]
    voltage = coupons.volts[reading]
    splits: list[Split] = [("mode", str(name).replace("_", " "), mode == name)
                           for name in np.unique(mode)]
    splits += [("temperature", f"{value:.4g} °C", warmth == value) for value in np.unique(warmth)]
    splits += [("field", f"{value / 1e3:.4g} kV", voltage == value) for value in np.unique(voltage)]
    groups = held_out_groups(coupons) if coupons.in_time else {}
    splits += [("run", name, rows[reading]) for name, rows in groups.items()]
    extent = np.abs(np.log(coupons.stretch[reading]))
    edge = _FAR * float(extent.max(initial=0.0))
    splits.append(("stretch", f"beyond a stretch of {np.exp(edge):.3g}", extent > edge))
    levels = {"mode": mode, "temperature": warmth, "field": voltage,
              "run": table.states.run[table.state], "stretch": extent.round(3)}
    return splits, levels
