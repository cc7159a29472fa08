"""Tests of strips and sheets of a film: the coupon.csv of a dataset (design §4), and the stress a law predicts."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.specimen import Material

Array = NDArray[np.float64]

#: The second in-plane stretch of each mode as a power of the first.
MODES = {"uniaxial": -0.5, "equibiaxial": 1.0, "pure_shear": 0.0}
_STRESSES = {"nominal_stress_Pa": 1.0, "nominal_stress_kPa": 1e3, "nominal_stress_MPa": 1e6}
_OPTIONAL = ("specimen", "t_s", "run")


@dataclass(frozen=True, eq=False)
class Coupons:
    """Readings, one entry per reading: mode, stretch, nominal stress [Pa]; specimen and run are "" where not given.

    Nominal stress is force over virgin cross-section, in equibiaxial tests that of one axis. ``time`` [s] is nan where
    not given.
    """

    mode: NDArray[np.str_]
    stretch: Array
    stress: Array
    specimen: NDArray[np.str_]
    run: NDArray[np.str_]
    time: Array

    def __len__(self) -> int:
        return len(self.stretch)

    def __getitem__(self, choice: Any) -> Coupons:
        """Some of the readings."""
        return Coupons(*(getattr(self, name)[choice]
                         for name in ("mode", "stretch", "stress", "specimen", "run", "time")))

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

    The law must be isotropic with stress-free faces, so that a strip pulled by λ narrows by λ^−½ both ways.

    Examples
    --------
    >>> from fem.laws import NeoHooke
    >>> nominal_stress(NeoHooke(20e3), "uniaxial", np.array([2.0]))
    array([35000.])
    """
    return np.real_if_close(material.derivatives(stretch, stretch ** MODES[mode])[1])


def read_coupons(file: Path | str) -> Coupons:
    """The readings of a CSV file with the columns mode, stretch, nominal_stress_kPa (or Pa, MPa).

    specimen, t_s and run may be added.

    Raises
    ------
    InputError
        Naming line and column of what cannot be used.
    """
    try:
        text = Path(file).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=file) from None
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text (byte {error.start})", file=file) from None
    rows = csv.reader(io.StringIO(text), skipinitialspace=True)
    lines = [(rows.line_num, row) for row in rows if any(cell.strip() for cell in row)]
    if not lines:
        raise InputError("is empty: a first line with the names of the columns is needed", file=file)
    (_, names), *readings = lines
    header = _header(file, [name.strip() for name in names])
    if not readings:
        raise InputError("has no readings below the names of its columns", file=file)
    return _coupons([_Row(file, line, header, row) for line, row in readings], header)


def _header(file: Path | str, names: Sequence[str]) -> list[str]:
    """The names of the columns, checked."""
    known = ("mode", "stretch", *_STRESSES, *_OPTIONAL)
    for column, name in enumerate(names, start=1):
        where = f"line 1, column {column}"
        if name not in known:
            raise InputError(f"unknown column: known are {', '.join(known)}", file=file, key=where, given=name)
        if name in names[:column - 1]:
            raise InputError("is there twice", file=file, key=where, given=name)
    missing = [name for name in ("mode", "stretch") if name not in names]
    stresses = [name for name in names if name in _STRESSES]
    if not stresses:
        missing.append("nominal_stress_kPa")
    if missing:
        raise InputError(f"the column {missing[0]} is missing", file=file, key="line 1", given=", ".join(names))
    if len(stresses) > 1:
        raise InputError("one column of stress only", file=file, key="line 1", given=", ".join(stresses))
    return list(names)


@dataclass(frozen=True)
class _Row:
    """One line of readings."""

    file: Path | str
    line: int
    header: list[str]
    cells: list[str]

    def __post_init__(self) -> None:
        if len(self.cells) != len(self.header):
            raise InputError(f"must have {len(self.header)} cells, as the first line has", file=self.file,
                             key=f"line {self.line}", given=f"{len(self.cells)} cells")

    def error(self, name: str, allowed: str) -> InputError:
        column = self.header.index(name)
        return InputError(allowed, file=self.file, key=f"line {self.line}, column {column + 1} ({name})",
                          given=self.cells[column].strip())

    def text(self, name: str) -> str:
        return self.cells[self.header.index(name)].strip() if name in self.header else ""

    def mode(self) -> str:
        if self.text("mode") not in MODES:
            raise self.error("mode", f"must be one of {', '.join(MODES)}")
        return self.text("mode")

    def number(self, name: str, lowest: float = -math.inf) -> float:
        try:
            value = float(self.text(name))
        except ValueError:
            raise self.error(name, "must be a number") from None
        if not math.isfinite(value):
            raise self.error(name, "must be finite")
        if value <= lowest:
            raise self.error(name, f"must be above {lowest:g}")
        return value

    def time(self) -> float:
        return self.number("t_s") if self.text("t_s") else math.nan


def _coupons(rows: Sequence[_Row], header: Sequence[str]) -> Coupons:
    [column] = [name for name in header if name in _STRESSES]
    return Coupons(
        mode=np.array([row.mode() for row in rows]),
        stretch=np.array([row.number("stretch", 0) for row in rows]),
        stress=_STRESSES[column] * np.array([row.number(column) for row in rows]),
        specimen=np.array([row.text("specimen") for row in rows]),
        run=np.array([row.text("run") for row in rows]),
        time=np.array([row.time() for row in rows]),
    )
