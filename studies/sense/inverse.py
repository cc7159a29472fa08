"""Deflection as a polynomial of capacitance and voltage.

The capacitance of a flat film is at its minimum there, as an even function: its excess over the
minimum grows as the square of the deflection. So the polynomial is in the root of the excess.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from string import Template
from typing import Annotated, Any

import numpy as np
from numpy.polynomial import polynomial

from tympan.base.arrays import AnyArray, Array
from tympan.base.fields import Key
from tympan.studies.segments import share_words

#: Degrees of the root of the excess that are tried.
_DEGREES = range(2, 11)
#: Highest degree of the voltage squared: each needs a curve, and high ones oscillate.
_CHARGED = 3
#: Relative spread of the first capacitance over voltages from which on it depends on voltage.
_CHANGES = 1e-9
#: Highest degree of the voltage squared in that capacitance, whose error the root magnifies.
_BASE = 8
#: Error over the range of deflections at which no higher degree is tried: no bridge reads better.
_ENOUGH = 1e-5
#: Share by which a row may exceed the range, for rounding, also of units.
_ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True)
class Inverse:
    """Deflection from capacitance C and nominal voltage U.

    y = start + Σ a[i][j] uⁱ⁺¹ vʲ with v = (U / highest)² and u = √(C / C₀ − 1), C₀ = Σ b[j] vʲ. It
    does not hold beyond the curves of its fit.
    """

    start_m: Annotated[float, Key("deflection where u is 0")]
    highest_V: Annotated[float, Key("voltage by which U is divided; 1 V where all are 0")]
    base_F: Annotated[tuple[float, ...], Key("b: capacitance at that deflection, by powers of v")]
    coefficients_m: Annotated[tuple[tuple[float, ...], ...], Key(
        "a: a row for each power of u, from the first, in it a number for each power of v, from 0")]
    error_m: Annotated[float, Key(
        "largest error over the range, at deflections, and where there are several voltages at one "
        "voltage, that were not fitted")]
    voltages_V: Annotated[tuple[float, ...], Key("voltages of the curves, ascending")]
    largest_F: Annotated[tuple[float, ...], Key("largest capacitance of each of these curves")]
    segment_shares: Annotated[Mapping[str, float], Key(
        "voltages of the segments over U, by their names; empty for an electrode in one piece")] = (
            field(default_factory=dict))

    def root(self, capacitance: Any, voltage: Any) -> Array:
        """Compute the root u of the excess, 0 where there is no excess."""
        v = np.square(np.asarray(voltage, float) / self.highest_V)
        base = polynomial.polyval(v, self.base_F)
        excess = np.asarray(capacitance, float) / base - 1
        return np.asarray(np.sqrt(np.maximum(excess, 0.0)))

    @property
    def ends(self) -> tuple[Array, Array]:
        """Largest root u at v, ascending; linear between these points, none beyond them."""
        v = np.square(np.array(self.voltages_V) / self.highest_V)
        u = (1 + _ROUNDING) * self.root(self.largest_F, self.voltages_V)
        places = np.array([v[0] - _ROUNDING, *v, v[-1] + _ROUNDING])
        return places, np.array([u[0], *u, u[-1]])

    def deflection(self, capacitance: Any, voltage: Any) -> Array:
        """Compute the deflection [m] from capacitances [F] at nominal voltages [V] that broadcast.

        It is NaN beyond the curves, and the first deflection below its capacitance.
        """
        u, v = self.root(capacitance, voltage), np.square(np.asarray(voltage) / self.highest_V)
        known = u <= np.interp(v, *self.ends, left=np.nan, right=np.nan)
        return np.where(known, self.continued(capacitance, voltage), np.nan)

    def continued(self, capacitance: Any, voltage: Any) -> Array:
        """Evaluate the polynomial alone, also beyond the curves."""
        u, v = self.root(capacitance, voltage), np.square(np.asarray(voltage) / self.highest_V)
        total = polynomial.polyval2d(u, v + 0 * u, np.array(self.coefficients_m))
        return np.asarray(self.start_m + u * total)

    def c_source(self, name: str, number: int = 1) -> str:
        """Write the inverse as a function of C99, named after a specimen.

        ``number``: of the proportion of the segments' voltages; from the second on names have it.
        """
        word = re.sub(r"[^A-Za-z0-9_]", "_", name)
        word = word if word[0].isalpha() else f"model_{word}"
        word += f"_{number}" * (number > 1)
        title = ": ".join(filter(None, (name, share_words(self.segment_shares))))
        text = resources.files("tympan.studies.sense").joinpath("source.txt")
        rows = [", ".join(map(repr, row)) for row in self.coefficients_m]
        known = [f" * {voltage:g} V: up to {1e12 * largest:.6g} pF"
                 for voltage, largest in zip(self.voltages_V, self.largest_F, strict=True)]
        at, ends = (", ".join(map(repr, part.tolist())) for part in self.ends)
        return Template(text.read_text(encoding="utf-8")).substitute(
            title=title, name=word, start=repr(self.start_m), highest=repr(self.highest_V),
            error=f"{1e3 * self.error_m:.2g}", base=", ".join(map(repr, self.base_F)),
            rows=len(rows), columns=len(self.coefficients_m[0]),
            powers=len(self.base_F), known="\n".join(known), at=at, ends=ends,
            places=len(self.voltages_V) + 2, first=f"{1e3 * self.start_m:.4g}",
            coefficients=", ".join(f"{{{row}}}" for row in rows))


@dataclass(frozen=True)
class SampledCurve:
    """Capacitances [F] at deflections [m] on the way, ascending, at a nominal voltage [V]."""

    voltage: float
    deflection: Array
    capacitance: Array


def fit_inverse(curves: Sequence[SampledCurve], beside: Sequence[SampledCurve],
                firsts: Sequence[SampledCurve]) -> Inverse:
    """Fit the polynomial through every other point of curves; those between and ``beside`` test it.

    The result is the lowest degree that is accurate enough, or the one with the least error.
    ``firsts`` are the first deflection at many voltages.
    """
    plain = _without_coefficients(curves, firsts)
    count = len(plain.coefficients_m[0])
    fitted = [SampledCurve(curve.voltage, curve.deflection[::2], curve.capacitance[::2])
              for curve in curves]
    root = np.concatenate([plain.root(each.capacitance, each.voltage) for each in fitted])
    charged = np.concatenate([np.full(len(each.deflection), (each.voltage / plain.highest_V) ** 2)
                              for each in fitted])
    rise = np.concatenate([each.deflection for each in fitted]) - plain.start_m
    found = []
    for degree in _DEGREES:
        if degree * count >= len(rise):
            break
        coefficients = _coefficients(root, charged, rise, (degree, count))
        given = replace(plain, coefficients_m=tuple(map(tuple, coefficients.tolist())))
        error = max(_error(given, curve) for curve in (*curves, *beside))
        found.append((error, given))
        if error <= _ENOUGH * float(np.ptp(rise)):
            break
    error, best = min(found, key=lambda each: each[0])
    return replace(best, error_m=error)


def _without_coefficients(curves: Sequence[SampledCurve], firsts: Sequence[SampledCurve]
                          ) -> Inverse:
    """Fit the capacitance of the first deflection by voltage; leave the coefficients 0."""
    highest = max(abs(curve.voltage) for curve in curves) or 1.0
    every = [*curves, *firsts]
    shares = np.array([each.voltage / highest for each in every])
    capacitances = np.array([each.capacitance[0] for each in every])
    changes = np.ptp(capacitances) > _CHANGES * capacitances[0]
    base = polynomial.polyfit(shares**2, capacitances, min(_BASE, len(every) - 1) if changes else 0)
    powers = min(len(curves), _CHARGED + 1)
    return Inverse(start_m=float(curves[0].deflection[0]), highest_V=highest,
                   base_F=tuple(base.tolist()), coefficients_m=((0.0,) * powers,), error_m=np.inf,
                   voltages_V=tuple(curve.voltage for curve in curves),
                   largest_F=tuple(float(curve.capacitance[-1]) for curve in curves))


def _coefficients(root: Array, charged: Array, rise: Array, shape: tuple[int, int]) -> Array:
    """Fit rises of the deflection by powers of the root, from 1, and of v, from 0."""
    degree, count = shape
    scale = float(root.max())
    along = np.arange(1, degree + 1)
    columns = (root[:, None] / scale) ** along
    powers = charged[:, None] ** np.arange(count)
    matrix = (columns[:, :, None] * powers[:, None, :]).reshape(len(rise), -1)
    solved: AnyArray = np.linalg.lstsq(matrix, rise, rcond=None)[0]
    coefficients: Array = solved.reshape(shape) / scale ** along[:, None]
    return coefficients


def _error(inverse: Inverse, curve: SampledCurve) -> float:
    """Find the largest error of the polynomial on a curve [m]."""
    sensed = inverse.continued(curve.capacitance, curve.voltage)
    return float(np.abs(sensed - curve.deflection).max())
