"""Tests of strips and sheets of a film: coupon.csv."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.toml_reader import Rule
from tympan.studies.columns import Column, Sheet, read_sheet

Array = NDArray[np.float64]

#: The second in-plane stretch of each mode as a power of the first.
MODES = {"uniaxial": -0.5, "equibiaxial": 1.0, "pure_shear": 0.0}
_STRETCH: Rule = (lambda x: 0.05 <= x <= 20, "must be a stretch from 0.05 to 20")
_STRESS: Rule = (lambda x: abs(x) <= 1e12, "must be within 1e9 kPa")

#: The columns of coupon.csv.
COLUMNS: tuple[Column, ...] = (
    Column.labels("mode", tuple(MODES)),
    Column("stretch", rule=_STRETCH),
    Column("nominal_stress", "kPa", _STRESS),
    Column.labels("specimen", required=False),
    Column("t", "s", required=False),
    Column.labels("run", required=False),
)


@dataclass(frozen=True, eq=False)
class Coupons:
    """Readings, one entry per reading: mode, stretch, nominal stress [Pa].

    Nominal stress is force over virgin cross-section, in equibiaxial tests that of one axis.
    ``time`` [s] is nan where not given, specimen and run are "".
    """

    mode: NDArray[np.str_]
    stretch: Array
    stress: Array
    specimen: NDArray[np.str_]
    run: NDArray[np.str_]
    time: Array

    @classmethod
    def of(cls, sheet: Sheet) -> Coupons:
        """The readings of a file with the columns of :data:`COLUMNS`."""
        return cls(mode=sheet["mode"], stretch=sheet["stretch"], stress=sheet["nominal_stress"],
                   specimen=sheet["specimen"], run=sheet["run"], time=sheet["t"])

    def __len__(self) -> int:
        return len(self.stretch)

    def __getitem__(self, choice: Any) -> Coupons:
        return Coupons(*(getattr(self, item.name)[choice] for item in fields(self)))

    @property
    def modes(self) -> tuple[str, ...]:
        return tuple(mode for mode in MODES if mode in self.mode)

    @cached_property
    def in_plane(self) -> tuple[Array, Array]:
        """λ₁ along the test and λ₂ across it."""
        powers = np.array([MODES[mode] for mode in self.mode])
        return self.stretch, self.stretch**powers

    @property
    def stretch_range(self) -> tuple[float, float]:
        """Smallest and largest in-plane stretch the tests reach, the virgin state included."""
        both = np.concatenate([*self.in_plane, [1.0]])
        return float(both.min()), float(both.max())


def read_coupons(file: Path | str) -> Coupons:
    """The readings of a CSV file with the columns of :data:`COLUMNS`."""
    return Coupons.of(read_sheet(file, COLUMNS))
