"""Laws fitted to coupon tests: constants with limits, what stays open, which law to take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.laws import inadmissible_stretch
from tympan.geometry.errors import InputError
from tympan.geometry.fields import fields_of
from tympan.geometry.specimen import Material
from tympan.studies.data.coupon import MODES, Coupons
from tympan.studies.estimation.identifiability import covariance
from tympan.studies.estimation.least_squares import LeastSquares, minima, seeded_starts
from tympan.studies.estimation.noise import Noise
from tympan.studies.estimation.profile import profile
from tympan.studies.material.families import FAMILIES, Family, largest_excess

Array = NDArray[Any]
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


@dataclass(frozen=True)
class FitSettings:
    """How to fit.

    ``noise`` is the standard deviation of one reading [Pa], estimated where None; ``starts`` are
    searched per shape constant; ``hold_out`` fits again without each mode.
    """

    noise: float | None = None
    starts: int = 12
    hold_out: bool = True


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
    notes: tuple[str, ...] = field(default=())

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
        half = self.noise.quantile * np.sqrt(np.maximum(np.nan_to_num(variance, nan=np.inf,
                                                                      posinf=np.inf), 0))
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
            return ["none of the fitted laws is admissible over the stretches of the tests: none "
                    "is offered"]
        found = [f"{best.family.name}: {note}" for note in best.notes]
        if first is not best:
            found.append(f"{first.family.name} fits better by the criterion but is not admissible "
                         f"over the stretches "
                         "of the tests: not offered")
        if "equibiaxial" not in self.coupons.modes:
            found.append("no equibiaxial test: a mounted film is stretched nearly equibiaxially")
        found += self._overfitted(best)
        times = self.coupons.time[np.isfinite(self.coupons.time)]
        if len(times) and np.ptp(times) > 0:
            found.append(f"readings from {times.min():g} to {times.max():g} s are taken as one "
                         f"elastic response: "
                         "relaxation is not fitted")
        return found

    def _overfitted(self, best: LawFit) -> list[str]:
        """Modes that the best law foretells far worse than another does."""
        found = []
        for mode, error in best.held_out.items():
            errors = ((fit.held_out.get(mode), fit.family.name) for fit in self.fits if fit.offered)
            rivals = [(rival, name) for rival, name in errors if rival is not None]
            least, name = min(rivals, default=(float("inf"), ""))
            if error is None or error > 2 * least:
                missed = "cannot follow" if error is None else f"misses by {error / 1e3:.3g} kPa"
                found.append(f"{best.family.name} {missed} the {mode.replace('_', ' ')} readings "
                             f"when they are held out"
                             + (f", {name} by {least / 1e3:.3g} kPa"
                                if name not in ("", best.family.name) else ""))
        return found


def compare(coupons: Coupons, names: Sequence[str] | None = None,
            settings: FitSettings | None = None) -> Comparison:
    """Fit laws, all that the readings are enough for where none is named.

    Raises
    ------
    InputError
        When a name is unknown or the readings are fewer than a named law needs.
    """
    settings = settings or FitSettings()
    families = [_family(name, len(coupons)) for name in dict.fromkeys(names)] if names else [
        family for family in FAMILIES.values() if len(coupons) >= _needed(family)]
    if not families:
        raise InputError(f"must be at least {_needed(FAMILIES['neo_hooke'])} to fit any law",
                         key="readings",
                         given=len(coupons))
    if largest_excess(*coupons.in_plane) < 1e-6:
        raise InputError("none of the readings is stretched", key="stretch",
                         given=coupons.stretch_range[1])
    fits = (fit_law(coupons, family, settings) for family in families)
    return Comparison(coupons, tuple(sorted(fits, key=lambda item: item.criterion)))


def fit_law(coupons: Coupons, family: Family, settings: FitSettings | None = None) -> LawFit:
    """Fit one law: the best minimum that is admissible over the tests' stretches, else the best."""
    settings = settings or FitSettings()
    curves = CouponCurves.of(coupons, family)
    ends = curves.minima(settings.starts)
    values, (material, failing) = _admissible(ends, family, coupons)
    squares = curves.squares(values)
    noise = Noise.of(squares, len(coupons) - len(values), settings.noise)
    spread = covariance(curves.jacobian(values), noise.sigma)
    result = LawFit(
        family=family, material=material, values=values,
        limits=curves.limits(values, np.sqrt(np.diag(spread)), noise), covariance=spread,
        noise=noise, squares=squares, readings=len(coupons),
        criterion=_criterion(squares, len(coupons), len(values), settings.noise),
        condition=_condition(curves.jacobian(values)),
        held_out=_held_out(coupons, family, settings) if settings.hold_out else {},
        range=coupons.stretch_range, inadmissible=failing)
    return _noted(result, curves, coupons, squares - curves.squares(ends[0]) > 0.01 * squares)


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


def _admissible(found: list[Array], family: Family, coupons: Coupons
                ) -> tuple[Array, tuple[Material | None, tuple[float, float] | None]]:
    """The best admissible minimum, or the best, with its material and where that fails."""
    judged = [(values, _judged(family, values, coupons)) for values in found]
    return next((item for item in judged if item[1][0] is not None and item[1][1] is None),
                judged[0])


def _judged(family: Family, values: Array, coupons: Coupons) -> tuple[Material | None,
                                                                      tuple[float, float] | None]:
    try:
        material = family.material(values)
    except InputError:
        return None, None
    if family.alike and _terms_cancel(family, values):
        return None, None
    return material, inadmissible_stretch(material, *coupons.stretch_range)


def _terms_cancel(family: Family, values: Array) -> bool:
    terms = values[:len(family.linear)] * values[len(family.linear):]
    return bool(np.abs(terms).sum() > CANCELLING * abs(terms.sum()))


def _criterion(squares: float, readings: int, constants: int, noise: float | None) -> float:
    """Akaike's; an estimated noise counts as one more constant."""
    if noise is not None:
        count, misfit = constants, squares / noise**2
    else:
        count, misfit = constants + 1, readings * np.log(squares / readings)
    return float(misfit + 2 * count + 2 * count * (count + 1) / (readings - count - 1))


def _condition(columns: Array) -> float:
    """Condition number of the sensitivities, scaled to length 1; 1e300 where one is missing."""
    lengths = np.linalg.norm(columns, axis=0)
    if not lengths.all():
        return 1e300
    return float(min(np.linalg.cond(columns / lengths), 1e300))


def _held_out(coupons: Coupons, family: Family, settings: FitSettings) -> dict[str, float | None]:
    """Error on each mode after a fit to the others."""
    errors: dict[str, float | None] = {}
    for mode in coupons.modes:
        rest, tested = coupons[coupons.mode != mode], coupons[coupons.mode == mode]
        if len(rest) < _needed(family):
            continue
        ends = CouponCurves.of(rest, family).minima(max(2, settings.starts // 3))
        values, _ = _admissible(ends, family, rest)
        missed = CouponCurves.of(tested, family).residual(values)
        errors[mode] = float(np.sqrt(np.mean(missed**2))) if np.isfinite(missed).all() else None
    return errors


def _noted(result: LawFit, curves: CouponCurves, coupons: Coupons, worse: bool) -> LawFit:
    """The fit with what its reader must know."""
    notes = [*_open_constants(result), *_open_modes(result, coupons)]
    if result.material is None:
        notes.append("the best constants have no meaning (a modulus that is not positive, or terms "
                     "that cancel one "
                     "another): not offered")
    if result.inadmissible is not None:
        notes.append(f"true stress falls with stretch at ({result.inadmissible[0]:.3g}, "
                     f"{result.inadmissible[1]:.3g}), "
                     f"within the tests' range {result.range[0]:.3g} to {result.range[1]:.3g}: not "
                     f"offered")
    elif worse:
        notes.append("other constants fit better but are not admissible over the stretches of the "
                     "tests")
    if _systematic(curves.residual(result.values), coupons):
        notes.append("the residuals run in long stretches of one sign: the law misses the shape of "
                     "the curves, and the "
                     "intervals tell of noise alone")
    return replace(result, notes=tuple(notes))


def _open_constants(result: LawFit) -> list[str]:
    """Constants and pairs of constants that the readings do not settle."""
    names, linear, notes = result.family.constants, len(result.family.linear), []
    for index, (name, value, (low, high)) in enumerate(zip(names, result.values, result.limits,
                                                           strict=True)):
        unit, size = (" kPa", 1e3) if index < linear else ("", 1.0)
        if low is None or high is None:
            sides = " and ".join(side for side, limit in (("lower", low), ("upper", high))
                                 if limit is None)
            notes.append(f"{name} is poorly determined: the readings set no {sides} limit")
        elif high - low > 2 * WIDE * abs(value):
            notes.append(f"{name} is poorly determined: {value / size:.4g}{unit}, 95 % limits "
                         f"{low / size:.4g} and "
                         f"{high / size:.4g}{unit}")
    spread = np.sqrt(np.diag(result.covariance))
    for one, other in combinations(range(len(names)), 2):
        if np.isfinite(spread[[one, other]]).all() and spread[one] * spread[other] > 0:
            correlation = result.covariance[one, other] / (spread[one] * spread[other])
            if abs(correlation) > CORRELATED:
                notes.append(f"{names[one]} and {names[other]} are poorly determined apart "
                             f"(correlation "
                             f"{correlation:.4f}): the readings see a combination of them")
    return notes


def _open_modes(result: LawFit, coupons: Coupons) -> list[str]:
    """Modes not tested in which the fit's stress is uncertain by more than a tenth."""
    notes = []
    reach = coupons.stretch_range[1]
    for mode in MODES:
        if mode in coupons.modes or result.material is None:
            continue
        # A law may not reach, in another mode, the stretch it was tested to in this one.
        stretch = np.array([1 + (reach - 1) / 2])
        if np.isposinf(np.real(result.material.derivatives(stretch,
                                                           stretch ** MODES[mode])[0])).any():
            continue
        stress, half = result.predict(mode, stretch)
        if half[0] > 0.1 * abs(stress[0]):
            notes.append(f"untested in {mode.replace('_', ' ')}: at stretch {stretch[0]:.3g} its "
                         f"stress there is "
                         f"{stress[0] / 1e3:.4g} ± {half[0] / 1e3:.2g} kPa (95 %)")
    return notes


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
