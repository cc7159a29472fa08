"""Constants of a film's law fitted to readings of its actuators, with the two factors.

Each step solves the films again with other constants. The factors on stiffness and permittivity are
fitted within each step. The stiffness factor scales the largest stress of the law, so that this
stress is no unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.base.errors import InputError
from tympan.base.fields import fields_of
from tympan.base.toml_reader import one_of
from tympan.fem.film.admissibility import checked
from tympan.geometry.specimen import Material
from tympan.studies.diagnosis.fits.fit import Fit

#: Step of a constant for derivatives, as a share of the stress of the mounted film.
_STEP = 0.02
#: Largest change of a constant in one step, as such a share.
_STRIDE = 0.5
#: Standard deviation of a constant before any reading, as such a share: a constant that alone
#: changes the mounted stress threefold is not unlikely.
BEFOREHAND = 3.0
#: Most steps of a search.
_STEPS = 8
#: Most halvings of a step where no film can be made of the law, or none that fits better.
_HALVINGS = 6
#: Fall of χ² below which the search has converged.
_SETTLED = 0.01


@dataclass(frozen=True)
class LawConstants:
    """The constants of a law in a row: names, keys of the law, values, and which are stresses."""

    law: Material
    names: tuple[str, ...]
    of_key: tuple[str, ...]
    values: Array
    stress: Mask

    @classmethod
    def of(cls, law: Material) -> LawConstants:
        """List the constants of a law that is a declared dataclass."""
        names, keys, values, stress = list[str](), list[str](), list[float](), list[bool]()
        for field in fields_of(type(law)):
            given = getattr(law, field.name)
            several = given if isinstance(given, tuple) else (given,)
            names += [f"{field.name}_{number}" if field.several else field.name
                      for number in range(1, len(several) + 1)]
            keys += [field.name] * len(several)
            values += several
            stress += [field.says.dimension == "stress"] * len(several)
        return cls(law, tuple(names), tuple(keys), np.array(values, float), np.array(stress))

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the law, each once."""
        return tuple(dict.fromkeys(self.of_key))

    def made(self, values: Array) -> Material:
        """Make the same law with other constants; refuse one that no film can have."""
        given: dict[str, Any] = {}
        left = values.tolist()
        for field in fields_of(type(self.law)):
            count = len(getattr(self.law, field.name)) if field.several else 1
            taken, left = left[:count], left[count:]
            given[field.name] = tuple(taken) if field.several else taken[0]
        law: Material = type(self.law)(**given)
        return checked(law)

    def units(self, prestretch: tuple[float, float]) -> Array:
        """Compute changes of each constant that would, linearly, double the mounted stress."""
        def stress(values: Array) -> float:
            return float(self.made(values).derivatives(*np.array(prestretch))[1])

        whole, units = stress(self.values), []
        for number, value in enumerate(self.values):
            least = 1e-3 * np.abs(self.values[self.stress]).max() if self.stress[number] else 1e-3
            step = 1e-4 * max(abs(value), least)
            moved = self.values.copy()
            moved[number] += step
            units.append(whole * step / (stress(moved) - whole))
        return np.asarray(np.abs(np.array(units)))


@dataclass(frozen=True)
class FittedLaw:
    """Fitted constants, multiplied by the factor on stiffness, and their standard deviations.

    ``told`` is the deviation over that before any reading; near 1 the readings add nothing. ``law``
    is without the factor, which ``fit`` has. Constants that were kept have only the factor's
    deviation.
    """

    constants: LawConstants
    values: Array
    deviations: Array
    told: Array
    law: Material
    fit: Fit


def constants_of_least_cost(law: Material, prestretch: tuple[float, float], kinds: Sequence[str],
            fitted: Callable[[Material], Fit]) -> FittedLaw:
    """Find the constants with least cost; ``fitted`` fits the factors for a law of the readings.

    ``kinds`` are the law's keys that are fitted, such as ``mu``; "all" is every one.

    The method is Gauss–Newton by differences: residuals with the factors fitted are those of
    variable projection (Golub, Pereyra, 1973).
    """
    constants = LawConstants.of(law)
    for kind in kinds:
        if kind not in (*constants.keys, "all"):
            raise InputError(one_of(kind, dict.fromkeys((*constants.keys, "all"))),
                             key="--constants", given=kind)
    units = constants.units(prestretch)
    largest = int(np.argmax(np.where(constants.stress, np.abs(constants.values) / units, 0.0)))
    free = np.array([number for number, key in enumerate(constants.of_key)
                     if number != largest and (key in kinds or "all" in kinds)], int)
    values, best = constants.values.copy(), fitted(law)
    if not free.size:
        raise InputError("there is none but the one that the factor on stiffness moves",
                         key="--constants", given=", ".join(kinds))
    for _ in range(_STEPS):
        jacobian, drift = _slopes(constants, values, units, free, best, fitted)
        away = (values - constants.values)[free] / units[free] / BEFOREHAND
        rows = np.vstack([jacobian, np.eye(len(free)) / BEFOREHAND])
        step = np.linalg.lstsq(rows, -np.concatenate([best.residual, away]))[0]
        step *= min(1.0, _STRIDE / max(float(np.abs(step).max()), 1e-12))
        found = _shorter(constants, values, units, free, step, best, fitted)
        if found is None:
            break
        fall = best.chi_squared - found[1].chi_squared
        values, best = found
        if fall < _SETTLED:
            break
    jacobian, drift = _slopes(constants, values, units, free, best, fitted)
    beforehand = np.eye(len(free)) / BEFOREHAND**2
    precision = jacobian.T @ jacobian / best.misfit**2 + beforehand
    covariance = np.asarray(np.linalg.inv(precision), float)
    return _result(constants, values, units, free, drift, covariance, best)


def _slopes(constants: LawConstants, values: Array, units: Array, free: Array, at: Fit,
            fitted: Callable[[Material], Fit]) -> tuple[Array, Array]:
    """Differentiate residuals, and the logarithm of the factor, by the free constants."""
    residuals, factors = [], []
    for number in free:
        for sign in (1.0, -1.0):
            moved = values.copy()
            moved[number] += sign * _STEP * units[number]
            try:
                other = fitted(constants.made(moved))
            except InputError:
                continue
            residuals.append(sign * (other.residual - at.residual) / _STEP)
            factors.append(sign * (other.unknowns[0] - at.unknowns[0]) / _STEP)
            break
        else:
            residuals.append(np.zeros_like(at.residual))
            factors.append(0.0)
    return np.column_stack(residuals), np.array(factors)


def _shorter(constants: LawConstants, values: Array, units: Array, free: Array, step: Array,
             at: Fit, fitted: Callable[[Material], Fit]) -> tuple[Array, Fit] | None:
    """Halve the step until a film can be made of it that fits better; None if none does."""
    for halving in range(_HALVINGS):
        moved = values.copy()
        moved[free] += step * units[free] / 2**halving
        try:
            found = fitted(constants.made(moved))
        except InputError:
            continue
        if found.chi_squared < at.chi_squared:
            return moved, found
    return None


def _result(constants: LawConstants, values: Array, units: Array, free: Array, drift: Array,
            covariance: Array, best: Fit) -> FittedLaw:
    """Multiply constants by the factor, with the deviations of their product."""
    factor = float(np.exp(best.unknowns[0]))
    alone = best.louder(best.misfit).deviations[0]
    scale = np.where(constants.stress, factor, 1.0)
    slopes = np.zeros((len(values), len(free)))
    slopes[free, np.arange(len(free))] = units[free]
    slopes += np.where(constants.stress, values, 0.0)[:, None] * drift
    slopes *= scale[:, None]
    own = np.where(constants.stress, factor * values * alone, 0.0)
    deviations = np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes) + own**2)
    told = np.zeros(len(values))
    told[free] = np.sqrt(np.diag(covariance)) / BEFOREHAND
    return FittedLaw(constants, scale * values, deviations, told, constants.made(values), best)
