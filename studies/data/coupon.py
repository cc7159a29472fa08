"""Tests of strips and sheets of a film: coupon.csv, and the stress a law predicts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.specimen import Material
from tympan.geometry.toml_reader import Rule
from tympan.studies.columns import Column, LabelColumn, NumberColumn, Sheet, read_sheet

Array = NDArray[np.float64]

#: The second in-plane stretch of each mode as a power of the first.
MODES = {"uniaxial": -0.5, "equibiaxial": 1.0, "pure_shear": 0.0}
_ABOVE_0: Rule = (lambda x: x > 0, "must be above 0")

#: The columns of coupon.csv.
COLUMNS: tuple[Column, ...] = (
    LabelColumn("mode", tuple(MODES)),
    NumberColumn("stretch", rule=_ABOVE_0),
    NumberColumn("nominal_stress", "kPa", "stress"),
    LabelColumn("specimen", required=False),
    NumberColumn("t", "s", "time", required=False),
    LabelColumn("run", required=False),
)


@dataclass(frozen=True, eq=False)
class Coupons:
    """Readings, one entry per reading: mode, stretch, nominal stress [Pa].

    Nominal stress is force over virgin cross-section, in equibiaxial tests that of one axis.
    ``time`` [s] is nan where not given, specimen and run are ""; ``line`` is that of the file.
    """

    mode: NDArray[np.str_]
    stretch: Array
    stress: Array
    specimen: NDArray[np.str_]
    run: NDArray[np.str_]
    time: Array
    line: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.stretch)

    def __getitem__(self, choice: Any) -> Coupons:
        """Some of the readings."""
        return Coupons(**{name: values[choice] for name, values in vars(self).items()
                          if values is not None})

    @property
    def modes(self) -> tuple[str, ...]:
        """The modes that have readings."""
        return tuple(mode for mode in MODES if mode in self.mode)

    @property
    def in_plane(self) -> tuple[Array, Array]:
        """λ₁ along the test and λ₂ across it."""
        powers = np.array([MODES[mode] for mode in self.mode])
        return self.stretch, self.stretch**powers

    @property
    def stretch_range(self) -> tuple[float, float]:
        """Smallest and largest in-plane stretch the tests reach, the virgin state included."""
        both = np.concatenate([*self.in_plane, [1.0]])
        return float(both.min()), float(both.max())


def nominal_stress(material: Material, mode: str, stretch: Array) -> Array:
    """Nominal stress of a law along the test [Pa].

    The law must be isotropic with stress-free faces, so that a strip pulled by λ narrows by λ^−½
    both ways.

    Examples
    --------
    >>> from tympan.fem.film.laws import NeoHooke
    >>> nominal_stress(NeoHooke(20e3), "uniaxial", np.array([2.0]))
    array([35000.])
    """
    return np.real_if_close(material.derivatives(stretch, stretch ** MODES[mode])[1])


def read_coupons(file: Path | str) -> Coupons:
    """The readings of a CSV file with the columns mode, stretch and nominal_stress_kPa.

    specimen, t_s and run may be added.

    Raises
    ------
    InputError
        Naming line and column of what cannot be used.
    """
    return coupons_from_sheet(read_sheet(file, COLUMNS))


def coupons_from_sheet(sheet: Sheet) -> Coupons:
    """The readings of a file with the columns of ``COLUMNS``."""
    return Coupons(mode=sheet["mode"], stretch=sheet["stretch"], stress=sheet["nominal_stress"],
                   specimen=sheet["specimen"], run=sheet["run"], time=sheet["t"], line=sheet.line)
