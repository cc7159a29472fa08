"""Laws fitted to coupon tests: constants with limits, what stays open, which law to take."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.admissibility import inadmissible_stretch
from tympan.geometry.errors import InputError
from tympan.geometry.fields import fields_of
from tympan.geometry.specimen import Material
from tympan.studies.data.coupon import MODES, Coupons
from tympan.studies.estimation.identifiability import Noise, covariance
from tympan.studies.estimation.least_squares import LeastSquares, minima, seeded_starts
from tympan.studies.estimation.profile import profile
from tympan.studies.material.families import FAMILIES, Family, largest_excess

Array = NDArray[Any]
#: What to tell the reader, by key.
NOTES: dict[str, str] = tomllib.loads(
    Path(__file__).with_name("notes.toml").read_text(encoding="utf-8"))

#: 95 % limits, None where the readings set none.
Limits = tuple[float | None, float | None]

#: Correlations above this are told: the tests then see a combination of two constants, hardly each
#: alone.
CORRELATED = 0.95
#: So are intervals whose half is more than this share of the constant.
WIDE = 0.5
#: Terms of an Ogden law that cancel to less than this part are a limit of the law, not constants to
#: compute with.
CANCELLING = 50.0
#: Stress in a search for minima is in units of so much of the readings; limits are met to such a
#: share of the quantile.
_FINE, _MET = 1e-8, 1e-3


@dataclass(frozen=True, eq=False)
class CouponCurves:
    """Nominal stress [Pa] read at stretches (λ₁, λ₂), shape (n,) each, and the family to fit."""

    family: Family
    l1: Array
    l2: Array
    stress: Array

    @classmethod
    def of(cls, coupons: Coupons, family: Family) -> CouponCurves:
        """The readings of all tests."""
        return cls(family, *coupons.in_plane, coupons.stress)

    @property
    def scale(self) -> float:
        """Size of the readings [Pa]."""
        return float(np.sqrt(np.mean(self.stress**2))) or 1.0

    def residual(self, values: Array) -> Array:
        """Predicted minus read stress [Pa]."""
        return self.family.stress(self.l1, self.l2, values) - self.stress

    def squares(self, values: Array) -> float:
        """Sum of squares [Pa²]; no less than the rounding of the readings."""
        return max(float(np.sum(self.residual(values) ** 2)),
                   len(self.stress) * (1e-13 * self.scale) ** 2)

    def jacobian(self, values: Array) -> Array:
        """Derivatives of the stress by the constants, shape (n, p)."""
        return self.family.jacobian(self.l1, self.l2, values)

    def problem(self, unit: float) -> LeastSquares:
        """Least squares for the constants, stress in units of ``unit`` [Pa]."""
        least, most = self.family.bounds(largest_excess(self.l1, self.l2))
        linear, shaped = len(self.family.linear), len(self.family.shape)
        return LeastSquares.of(
            lambda values: (self.residual(values) / unit, self.jacobian(values) / unit),
            np.array([-np.inf] * linear + [least] * shaped),
            np.array([np.inf] * linear + [most] * shaped), tuple(range(linear)))

    def minima(self, count: int) -> list[Array]:
        """Local minima from ``count`` starts for each shape constant, best first."""
        linear, shaped = len(self.family.linear), len(self.family.shape)
        least, most = self.family.starts(largest_excess(self.l1, self.l2))
        shapes = seeded_starts(least, most, shaped, count * max(1, shaped))
        starts = np.concatenate([np.zeros((len(shapes), linear)), shapes], axis=1)
        return [self.family.ordered(values)
                for values in minima(self.problem(_FINE * self.scale), starts)]

    def limits(self, values: Array, spread: Array, noise: Noise) -> tuple[Limits, ...]:
        """95 % limits of every constant at the best fit.

        Where stress is linear in all constants, value ± quantile · standard deviation, which is
        exact for normal noise; otherwise by profiles.
        """
        if not self.family.shape:
            halves = noise.quantile * spread
            return tuple((float(value - half), float(value + half)) if np.isfinite(half)
                         else (None, None) for value, half in zip(values, halves, strict=True))
        floor = 1e-9 * self.scale * len(self.stress) ** 0.5 / noise.quantile
        problem = self.problem(max(noise.sigma, floor))
        lines = [profile(problem, values, index, noise.quantile, _MET)
                 for index in range(len(values))]
        return tuple((line.low, line.high) for line in lines)


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law fitted to readings: the new material and the raw result.

    ``values`` are the family's constants [Pa or plain], ``limits`` their 95 % limits, None where
    the readings set none; ``covariance`` is linearised. ``criterion`` is Akaike's, corrected for
    few readings (Hurvich and Tsai, Biometrika 76, 297, 1989); lower is better. ``held_out`` is the
    root mean square error [Pa] on each mode after a fit to the others, None where the law could not
    follow. ``range`` is of the in-plane stretches of the tests, ``inadmissible`` the first
    stretches within it where Hill's inequality fails.
    """

    family: Family
    material: Material | None
    values: Array
    limits: tuple[Limits, ...]
    covariance: Array
    noise: Noise
    squares: float
    readings: int
    criterion: float
    condition: float
    held_out: dict[str, float | None]
    range: tuple[float, float]
    inadmissible: tuple[float, float] | None
    notes: tuple[str, ...] = ()

    @property
    def offered(self) -> bool:
        """Whether a film may be made of it."""
        return self.material is not None and self.inadmissible is None

    @property
    def rmse(self) -> float:
        """Root mean square of the residuals [Pa]."""
        return float((self.squares / self.readings) ** 0.5)

    def predict(self, mode: str, stretch: Array) -> tuple[Array, Array]:
        """Nominal stress and half the width of its 95 % band [Pa], linearised."""
        across = stretch ** MODES[mode]
        rows = self.family.jacobian(stretch, across, self.values)
        with np.errstate(invalid="ignore"):
            variance = np.einsum("ni,ij,nj->n", rows, self.covariance, rows)
            variance = np.nan_to_num(variance, nan=np.inf, posinf=np.inf)
        half = self.noise.quantile * np.sqrt(np.maximum(variance, 0))
        return self.family.stress(stretch, across, self.values), half

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        linear = len(self.family.linear)
        constants = {name: {"value": float(value), "low": low, "high": high,
                            "unit": "Pa" if index < linear else "1"}
                     for index, (name, value, (low, high)) in enumerate(
                         zip(self.family.constants, self.values, self.limits, strict=True))}
        return {"name": self.family.name, "law": getattr(self.material, "law", None),
                "offered": self.offered,
                "constants": constants, "rmse_Pa": self.rmse, "aicc": self.criterion,
                "condition": self.condition,
                "held_out_rmse_Pa": self.held_out, "stretch_range": list(self.range),
                "inadmissible_at": None if self.inadmissible is None else list(self.inadmissible),
                "notes": list(self.notes)}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Fits of several laws to the same readings, lowest criterion first."""

    coupons: Coupons
    fits: tuple[LawFit, ...]

    @property
    def best(self) -> LawFit | None:
        """The first that may be offered."""
        return next((fit for fit in self.fits if fit.offered), None)

    @property
    def warnings(self) -> list[str]:
        """What stands between the best fit and its use."""
        best, first = self.best, self.fits[0]
        if best is None:
            return [NOTES["none_offered"]]
        warnings = [f"{best.family.name}: {note}" for note in best.notes]
        if first is not best:
            warnings.append(NOTES["best_not_offered"].format(name=first.family.name))
        if "equibiaxial" not in self.coupons.modes:
            warnings.append(NOTES["no_equibiaxial"])
        warnings += self._overfitted(best)
        times = self.coupons.time[np.isfinite(self.coupons.time)]
        if len(times) and np.ptp(times) > 0:
            warnings.append(NOTES["relaxation"].format(first=times.min(), last=times.max()))
        return warnings

    def _overfitted(self, best: LawFit) -> Iterator[str]:
        """Modes that the best law foretells far worse than another does."""
        for mode, error in best.held_out.items():
            errors = ((fit.held_out.get(mode), fit.family.name) for fit in self.fits if fit.offered)
            rivals = [(rival, name) for rival, name in errors if rival is not None]
            least, name = min(rivals, default=(float("inf"), ""))
            if error is None or error > 2 * least:
                rival = ("" if name in ("", best.family.name)
                         else NOTES["rival"].format(name=name, error=least / 1e3))
                yield NOTES["cannot_follow" if error is None else "misses"].format(
                    name=best.family.name, mode=mode.replace("_", " "), error=(error or 0) / 1e3,
                    rival=rival)


def compare(coupons: Coupons, names: Sequence[str] | None = None,
            noise: float | None = None) -> Comparison:
    """Fit laws, all that the readings are enough for where none is named.

    ``noise`` is the standard deviation of one reading [Pa], estimated where None.

    Raises
    ------
    InputError
        When a name is unknown or the readings are fewer than a named law needs.
    """
    families = [_family(name, len(coupons)) for name in dict.fromkeys(names)] if names else [
        family for family in FAMILIES.values() if len(coupons) >= _needed(family)]
    if not families:
        raise InputError(f"must be at least {_needed(FAMILIES['neo_hooke'])} to fit any law",
                         key="readings", given=len(coupons))
    if largest_excess(*coupons.in_plane) < 1e-6:
        raise InputError("none of the readings is stretched", key="stretch",
                         given=coupons.stretch_range[1])
    fits = [fit_law(coupons, family, noise) for family in families]
    return Comparison(coupons, tuple(sorted(fits, key=lambda fit: fit.criterion)))


def fit_law(coupons: Coupons, family: Family, noise: float | None = None, starts: int = 12,
            hold_out: bool = True) -> LawFit:
    """Fit one law: the best minimum that is admissible over the tests' stretches, else the best.

    Parameters
    ----------
    noise
        Standard deviation of one reading [Pa], estimated where None.
    starts
        How many are searched per shape constant.
    hold_out
        Fit again without each mode.
    """
    curves = CouponCurves.of(coupons, family)
    ends = curves.minima(starts)
    values, (material, failing) = _admissible(ends, family, coupons)
    squares = curves.squares(values)
    sigma = Noise.of(squares, len(coupons) - len(values), noise)
    jacobian = curves.jacobian(values)
    spread = covariance(jacobian, sigma.sigma)
    lengths = np.linalg.norm(jacobian, axis=0)
    # 1e300 where no reading sees a constant.
    condition = np.linalg.cond(jacobian / lengths) if lengths.all() else np.inf
    result = LawFit(
        family=family, material=material, values=values,
        limits=curves.limits(values, np.sqrt(np.diag(spread)), sigma), covariance=spread,
        noise=sigma, squares=squares, readings=len(coupons),
        criterion=_criterion(squares, len(coupons), len(values), noise),
        condition=float(min(condition, 1e300)),
        held_out=_held_out(coupons, family, starts) if hold_out else {},
        range=coupons.stretch_range, inadmissible=failing)
    worse = squares - curves.squares(ends[0]) > 0.01 * squares
    return replace(result, notes=tuple(_notes(result, curves, coupons, worse)))


def material_lines(material: Material, stretch_range: tuple[float, float] | None = None) -> str:
    """The ``[membrane.material]`` table of a specimen file.

    Examples
    --------
    >>> from tympan.fem.film.laws import Gent
    >>> print(material_lines(Gent(18e3, 110.0), (0.5, 3.0)))
    [membrane.material]
    law = "gent"
    mu = "18 kPa"
    j_lim = 110
    range = [0.5, 3]
    <BLANKLINE>
    """
    def written(dimension: str, value: float) -> str:
        return f'"{value / 1e3:.10g} kPa"' if dimension == "stress" else f"{value:.10g}"

    lines = ["[membrane.material]", f'law = "{material.law}"']
    for item in fields_of(type(material)):
        value = getattr(material, item.name)
        texts = [written(item.says.dimension, part)
                 for part in (value if item.several else (value,))]
        lines.append(f"{item.key} = " + (f"[{', '.join(texts)}]" if item.several else texts[0]))
    if stretch_range is not None:
        lines.append(f"range = [{stretch_range[0]:.4g}, {stretch_range[1]:.4g}]")
    return "\n".join(lines) + "\n"


def _needed(family: Family) -> int:
    """Readings without which the criterion has no value."""
    return len(family.constants) + 3


def _family(name: str, readings: int) -> Family:
    if name not in FAMILIES:
        raise InputError(f"must be all or one of {', '.join(FAMILIES)}", key="--law", given=name)
    family = FAMILIES[name]
    if readings < _needed(family):
        raise InputError(f"needs at least {_needed(family)} readings, there are {readings}",
                         key="--law", given=name)
    return family


def _admissible(ends: list[Array], family: Family, coupons: Coupons
                ) -> tuple[Array, tuple[Material | None, tuple[float, float] | None]]:
    """The best admissible minimum, or the best, with its material and where that fails."""
    judged = [(values, _judged(family, values, coupons)) for values in ends]
    return next((item for item in judged if item[1][0] is not None and item[1][1] is None),
                judged[0])


def _judged(family: Family, values: Array, coupons: Coupons
            ) -> tuple[Material | None, tuple[float, float] | None]:
    try:
        material = family.material(values)
    except InputError:
        return None, None
    terms = values[:len(family.linear)] * values[len(family.linear):] if family.alike else values
    if family.alike and np.abs(terms).sum() > CANCELLING * abs(terms.sum()):
        return None, None
    return material, inadmissible_stretch(material, *coupons.stretch_range)


def _criterion(squares: float, readings: int, constants: int, noise: float | None) -> float:
    """Akaike's; an estimated noise counts as one more constant."""
    if noise is not None:
        count, misfit = constants, squares / noise**2
    else:
        count, misfit = constants + 1, readings * np.log(squares / readings)
    return float(misfit + 2 * count + 2 * count * (count + 1) / (readings - count - 1))


def _held_out(coupons: Coupons, family: Family, starts: int) -> dict[str, float | None]:
    """Error on each mode after a fit to the others."""
    errors: dict[str, float | None] = {}
    for mode in coupons.modes:
        rest, tested = coupons[coupons.mode != mode], coupons[coupons.mode == mode]
        if len(rest) < _needed(family):
            continue
        ends = CouponCurves.of(rest, family).minima(max(2, starts // 3))
        values, _ = _admissible(ends, family, rest)
        missed = CouponCurves.of(tested, family).residual(values)
        errors[mode] = float(np.sqrt(np.mean(missed**2))) if np.isfinite(missed).all() else None
    return errors


def _notes(fit: LawFit, curves: CouponCurves, coupons: Coupons, worse: bool) -> Iterator[str]:
    """What a reader of the fit must know."""
    yield from _open_constants(fit)
    yield from _open_modes(fit, coupons)
    if fit.material is None:
        yield NOTES["no_meaning"]
    if fit.inadmissible is not None:
        yield NOTES["inadmissible"].format(at=fit.inadmissible, range=fit.range)
    elif worse:
        yield NOTES["worse"]
    if _systematic(curves.residual(fit.values), coupons):
        yield NOTES["systematic"]


def _open_constants(fit: LawFit) -> Iterator[str]:
    """Constants and pairs of constants that the readings do not settle."""
    names, linear = fit.family.constants, len(fit.family.linear)
    for index, (name, value, (low, high)) in enumerate(zip(names, fit.values, fit.limits,
                                                           strict=True)):
        unit, size = (" kPa", 1e3) if index < linear else ("", 1.0)
        if low is None or high is None:
            sides = " and ".join(side for side, limit in (("lower", low), ("upper", high))
                                 if limit is None)
            yield NOTES["open"].format(name=name, sides=sides)
        elif high - low > 2 * WIDE * abs(value):
            yield NOTES["wide"].format(name=name, unit=unit, value=value / size, low=low / size,
                                       high=high / size)
    spread = np.sqrt(np.diag(fit.covariance))
    for first, second in combinations(range(len(names)), 2):
        product = spread[first] * spread[second]
        if np.isfinite(spread[[first, second]]).all() and product > 0:
            correlation = fit.covariance[first, second] / product
            if abs(correlation) > CORRELATED:
                yield NOTES["correlated"].format(first=names[first], second=names[second],
                                                 correlation=correlation)


def _open_modes(fit: LawFit, coupons: Coupons) -> Iterator[str]:
    """Modes not tested in which the fit's stress is uncertain by more than a tenth."""
    stretch = np.array([1 + (coupons.stretch_range[1] - 1) / 2])
    for mode in MODES:
        if mode in coupons.modes or fit.material is None:
            continue
        # A law may not reach, in another mode, the stretch it was tested to in this one.
        if np.isposinf(np.real(fit.material.derivatives(stretch, stretch ** MODES[mode])[0])).any():
            continue
        stress, half = fit.predict(mode, stretch)
        if half[0] > 0.1 * abs(stress[0]):
            yield NOTES["untested"].format(mode=mode.replace("_", " "), stretch=stretch[0],
                                           stress=stress[0] / 1e3, half=half[0] / 1e3)


def _systematic(residual: Array, coupons: Coupons) -> bool:
    """Whether residuals in order of stretch change sign far too seldom (runs test, p < 0.001)."""
    order = np.lexsort((coupons.stretch, coupons.mode))
    positive = residual[order] > 0
    above, below = int(positive.sum()), int((~positive).sum())
    total = above + below
    if min(above, below) < 5:
        return False
    runs = 1 + int((np.diff(positive.astype(int)) != 0).sum())
    mean = 2 * above * below / total + 1
    variance = (mean - 1) * (mean - 2) / (total - 1)
    return bool((runs - mean) / variance**0.5 < -3.1)
