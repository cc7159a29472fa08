"""Laws fitted to coupon tests: constants with limits, what remains open, choice of a law."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, TypeVar

import numpy as np
from scipy.stats import spearmanr

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.base.fields import fields_of
from tympan.fem.film.admissibility import inadmissible_stretch
from tympan.geometry.specimen import Material
from tympan.studies.data.coupon import MODES, Coupons
from tympan.studies.estimation.correlation import CorrelatedSpread, akaike, independent_count
from tympan.studies.estimation.identifiability import covariance
from tympan.studies.estimation.least_squares import LeastSquares, minima, seeded_starts
from tympan.studies.estimation.noise import Noise
from tympan.studies.estimation.profile import profile
from tympan.studies.files import words_beside
from tympan.studies.material.families import FAMILIES, LawFamily, largest_excess

T = TypeVar("T")
#: Notes for the reader, by key.
NOTES = words_beside(__file__)

#: 95 % limits, None where the readings set none.
ParameterLimits = tuple[float | None, float | None]

#: Constants, the material they make, if any, and the first stretches where it is inadmissible.
Judged = tuple[Array, Material | None, tuple[float, float] | None]

#: Correlation above which a note says so: the tests then determine a combination of two constants,
#: hardly each alone.
CORRELATED = 0.95
#: Half-width of an interval, over the constant, above which a note says so.
WIDE = 0.5
#: Ratio of stresses by different laws in an untested mode above which a note says so.
DIFFERING = 1.5
#: Ratio of two terms of a law to their sum in the readings above which they are no constants to
#: compute with, but a limit of the law.
CANCELLING = 50.0
#: Factor between a law's stress in an untested mode and that of most laws above which it is ranked
#: last: half an order of magnitude.
FAR = 10**0.5
#: Most evaluations of one profile: a limit not found within them is not worth the time.
_EVALUATIONS = 600
#: Factor of errors on held-out runs within which laws are equally good.
_SAME_ERROR = 1.05
#: Angle between terms of a law, in the space of the readings, below which they are one.
_ALIKE = 1e-3
#: Distance of a constant from its bound, as a share of it, within which it is at the bound.
_AT_BOUND = 1e-3
#: Least number of readings of which it is said that their errors grow.
_ENOUGH = 15
#: Most groups of runs held out.
_FOLDS = 5

#: Unit of stress in a search for minima, as a share of the readings: small, so that the search
#: continues down to rounding.
_FINE = 1e-8
#: Accuracy of a profile's limits as a share of the quantile: the third digit of a limit.
_MET = 1e-3


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law fitted to readings: the new material and the raw result.

    ``values`` are the family's constants [Pa or plain], ``limits`` their 95 % limits, None where
    the readings set none; ``covariance`` is linearised; ``rmse`` is that of the residuals [Pa].
    ``criterion`` is Akaike's for the number of independent readings; lower is better. ``held_out``
    is the root mean square error [Pa] on each mode after a fit to the others, None where the law
    has no value; ``foretold`` is that on held-out runs, None without any. ``range`` is that of the
    principal stretches of the tests, ``inadmissible`` the first stretches within it where Hill's
    inequality fails. ``dropped`` says which constant has no effect, ``far`` in which untested mode
    the law is far from the others; each is "" if there is none.
    """

    family: LawFamily
    material: Material | None
    values: Array
    limits: tuple[ParameterLimits, ...]
    covariance: Array
    noise: Noise
    rmse: float
    criterion: float
    condition: float
    held_out: dict[str, float | None]
    range: tuple[float, float]
    inadmissible: tuple[float, float] | None
    notes: tuple[str, ...] = ()
    foretold: float | None = None
    dropped: str = ""
    far: str = ""

    @property
    def offered(self) -> bool:
        """Whether a film may be made of it."""
        return self.material is not None and self.inadmissible is None and not self.dropped

    def predict(self, mode: str, stretch: Array) -> tuple[Array, Array]:
        """Predict nominal stress and half the width of its 95 % band [Pa], linearised."""
        across = stretch ** MODES[mode]
        rows = self.family.jacobian(stretch, across, self.values)
        with np.errstate(invalid="ignore"):
            variance = np.einsum("ni,ij,nj->n", rows, self.covariance, rows)
            variance = np.nan_to_num(variance, nan=np.inf, posinf=np.inf)
        half = self.noise.quantile * np.sqrt(np.maximum(variance, 0))
        return self.family.stress(stretch, across, self.values), half

    def json(self) -> dict[str, Any]:
        """Write the fit as a JSON object."""
        linear = len(self.family.linear)
        constants = {name: {"value": float(value), "low": low, "high": high,
                            "unit": "Pa" if index < linear else "1"}
                     for index, (name, value, (low, high)) in enumerate(
                         zip(self.family.constants, self.values, self.limits, strict=True))}
        return {"name": self.family.name, "law": getattr(self.material, "law", None),
                "offered": self.offered, "dropped": self.dropped or None,
                "far_off": self.far or None,
                "constants": constants, "rmse_Pa": self.rmse,
                "aicc": self.criterion if np.isfinite(self.criterion) else None,
                "held_out_runs_Pa": self.foretold,
                "condition": self.condition,
                "held_out_rmse_Pa": self.held_out, "stretch_range": list(self.range),
                "inadmissible_at": None if self.inadmissible is None else list(self.inadmissible),
                "notes": list(self.notes)}


def compare(coupons: Coupons, names: Sequence[str] | None = None, noise: float | None = None,
            starts: int = 12, quick: bool = False) -> tuple[LawFit, ...]:
    """Fit laws, the best first; by default all for which there are enough readings.

    Where every mode has several runs, laws are compared by their errors on runs held out, otherwise
    by Akaike's criterion for the number of independent readings. Laws that are far from the others
    in an untested mode come last. ``noise`` is the standard deviation of one reading [Pa],
    estimated where None. ``starts`` are those of :func:`fit_law`; ``quick`` fits have no limits of
    constants, and no mode is held out.

    Raises
    ------
    InputError
        When a name is unknown or the readings are fewer than a named law needs.
    """
    families = [named_family(name, len(coupons)) for name in dict.fromkeys(names)] if names else [
        family for family in FAMILIES.values() if len(coupons) >= _needed(family)]
    if not families:
        raise InputError(f"must be at least {_needed(FAMILIES['neo_hooke'])} to fit any law",
                         key="readings", given=len(coupons))
    if largest_excess(*coupons.in_plane) < 1e-6:
        raise InputError("none of the readings is stretched", key="stretch",
                         given=coupons.stretch_range[1])

    def fitted(family: LawFamily) -> LawFit:
        return fit_law(coupons, family, noise, starts, hold_out=not quick, profiles=not quick)

    fits = with_simpler([fitted(family) for family in families], fitted, lambda fit: fit)
    count = independent_count(len(coupons), _common_correlation(coupons, fits, noise))
    fits = [replace(fit, criterion=akaike(fit.rmse**2, count, len(fit.values), noise),
                    foretold=_foretold(coupons, fit.family)) for fit in fits]
    far = far_off(coupons, fits)
    return _ranked([replace(fit, far=far.get(fit.family.name, "")) for fit in fits])


def with_simpler(fits: list[T], fitted: Callable[[LawFamily], T], law: Callable[[T], LawFit]
                 ) -> list[T]:
    """Add fits of simpler laws in place of those with constants that have no effect."""
    every = list(fits)
    for fit in every:
        names = {law(other).family.name for other in every}
        if law(fit).dropped and law(fit).family.simpler not in names:
            every.append(fitted(FAMILIES[law(fit).family.simpler]))
    return every


def _ranked(fits: Sequence[LawFit]) -> tuple[LawFit, ...]:
    """Rank fits, best first: the simplest of those with about the same error on held-out runs.

    Laws that are far off in untested modes come last.
    """
    errors = [fit.foretold for fit in fits if fit.foretold is not None and fit.offered]
    enough = _SAME_ERROR * min(errors, default=0.0)

    def key(fit: LawFit) -> tuple[Any, ...]:
        if fit.foretold is None:
            return bool(fit.far), bool(errors), fit.criterion, len(fit.values)
        close = fit.foretold <= enough
        return (bool(fit.far), False, 0.0 if close else fit.foretold,
                len(fit.values) if close else 0, fit.foretold)

    return tuple(sorted(fits, key=key))


def _common_correlation(coupons: Coupons, fits: Sequence[LawFit], noise: float | None) -> float:
    """Estimate the correlation of noise from neighbouring residuals of the most accurate fit."""
    count = len(coupons)
    least = min((fit for fit in fits), key=lambda fit: (
        fit.rmse**2 / max(count - len(fit.values), 1)))
    return coupon_noise(coupons, least.family, least.values, noise).correlation


def coupon_noise(coupons: Coupons, family: LawFamily, values: Array, noise: float | None = None
                 ) -> CorrelatedSpread:
    """Estimate errors of a law's readings, correlated along the stretch of each run of a mode."""
    residual = _residual(family, coupons, values)
    floor = 1e-13 * _size(coupons)
    seen = np.where(np.abs(residual) > floor, residual, floor)
    return CorrelatedSpread.of(family.jacobian(*coupons.in_plane, values), seen,
                              list(runs_of_modes(coupons).values()), noise)


def runs_of_modes(coupons: Coupons) -> dict[tuple[str, str], Numbers]:
    """Find the numbers of the readings of each run and mode, in order of time or stretch."""
    runs = {}
    for name, rows in coupons.series.items():
        for mode in coupons.modes:
            part = rows[coupons.mode[rows] == mode]
            timed = np.isfinite(coupons.time[part]).all()
            order = np.argsort((coupons.time if timed else coupons.stretch)[part], kind="stable")
            if len(part):
                runs[mode, name] = part[order]
    return runs


def _foretold(coupons: Coupons, family: LawFamily) -> float | None:
    """Compute the root mean square error [Pa] on runs held out, some of each mode.

    None where a mode has a single run: without it no reading of the mode remains.
    """
    runs = runs_of_modes(coupons)
    by_mode = [[runs[key] for key in runs if key[0] == mode] for mode in coupons.modes]
    folds = min(_FOLDS, *map(len, by_mode))
    if folds < 2:
        return None
    squares = 0.0
    for fold in range(folds):
        tested = np.zeros(len(coupons), bool)
        tested[np.concatenate([run for part in by_mode for run in part[fold::folds]])] = True
        rest = coupons[~tested]
        if len(rest) < _needed(family):
            return None
        values, *_ = _admissible(_minima(family, rest, 4), family, rest)
        missed = _residual(family, coupons[tested], values)
        squares += float(missed @ missed)
    error = (squares / len(coupons)) ** 0.5
    return error if np.isfinite(error) else None


def far_off(coupons: Coupons, fits: Sequence[LawFit]) -> dict[str, str]:
    """Find laws whose stress in an untested mode is far from that of most laws, with the words.

    Neo-Hooke's law, as stiff in the tests as they are, counts as one more: in modes that were not
    tested a law with one constant is rarely far off (Treloar, *The Physics of Rubber Elasticity*,
    1975).
    """
    offered = [fit for fit in fits if fit.offered]
    if not offered:
        return {}
    plain = FAMILIES["neo_hooke"]
    column = plain.columns(*coupons.in_plane, np.empty(0))[:, 0]
    modulus = np.median([column @ fit.family.stress(*coupons.in_plane, fit.values)
                         for fit in offered], keepdims=True) / (column @ column)
    stretch = np.array([1 + (coupons.stretch_range[1] - 1) / 2])
    words: dict[str, str] = {}
    for mode in MODES:
        if mode in coupons.modes:
            continue
        across = stretch ** MODES[mode]
        with np.errstate(all="ignore"):
            stresses = {fit.family.name: float(fit.family.stress(stretch, across, fit.values)[0])
                        for fit in offered}
        usual = float(plain.stress(stretch, across, modulus)[0])
        finite = [value for value in (*stresses.values(), usual) if value > 0]
        middle = float(np.exp(np.median(np.log(finite))))
        for name, value in stresses.items():
            if np.isfinite(value) and not middle / FAR <= value <= middle * FAR:
                words.setdefault(name, NOTES["far"].format(
                    name=name, mode=mode.replace("_", " "), stretch=stretch[0],
                    stress=value / 1e3, others=middle / 1e3))
    return words


def best_offered(fits: Sequence[LawFit]) -> LawFit | None:
    """Find the first law that may be offered."""
    return next((fit for fit in fits if fit.offered), None)


def warnings(coupons: Coupons, fits: Sequence[LawFit], at_rest: bool = False) -> list[str]:
    """List warnings before the best fit is used; ``at_rest`` says it was fitted with branches."""
    best, first = best_offered(fits), fits[0]
    if best is None:
        return [NOTES["none_offered"]]
    words = [f"{best.family.name}: {note}" for note in best.notes]
    words += [fit.far for fit in fits if fit.far]
    if first is not best and not first.dropped:
        words.append(NOTES["best_not_offered"].format(name=first.family.name))
    if "equibiaxial" not in coupons.modes:
        words.append(NOTES["no_equibiaxial"])
        words += _differing(coupons, [fit for fit in fits if fit.offered and not fit.far])
    words += _overfitted(best, [fit for fit in fits if fit.offered])
    times = coupons.time[np.isfinite(coupons.time)]
    if not at_rest and len(times) and np.ptp(times) > 0:
        words.append(NOTES["relaxation"].format(first=times.min(), last=times.max()))
    return words


def _differing(coupons: Coupons, offered: Sequence[LawFit]) -> Iterator[str]:
    """Warn where laws that may be offered differ much on an equibiaxial film."""
    stretch = np.array([1 + (coupons.stretch_range[1] - 1) / 2])
    with np.errstate(all="ignore"):
        stresses = {fit.family.name: float(fit.family.stress(stretch, stretch, fit.values).item())
                    for fit in offered}
    finite = {name: stress for name, stress in stresses.items() if np.isfinite(stress)}
    if len(finite) > 1 and max(finite.values()) > DIFFERING * min(finite.values()):
        least, most = (pick(finite, key=lambda name: finite[name]) for pick in (min, max))
        yield NOTES["differing"].format(stretch=stretch[0], least=least, most=most,
                                        low=finite[least] / 1e3, high=finite[most] / 1e3)


def _overfitted(best: LawFit, offered: Sequence[LawFit]) -> Iterator[str]:
    for mode, error in best.held_out.items():
        errors = ((fit.held_out.get(mode), fit.family.name) for fit in offered)
        rivals = [(rival, name) for rival, name in errors if rival is not None]
        least, name = min(rivals, default=(float("inf"), ""))
        if error is None or error > 2 * least:
            rival = ("" if name in ("", best.family.name)
                     else NOTES["rival"].format(name=name, error=least / 1e3))
            yield NOTES["cannot_follow" if error is None else "misses"].format(
                name=best.family.name, mode=mode.replace("_", " "), error=(error or 0) / 1e3,
                rival=rival)


def fit_law(coupons: Coupons, family: LawFamily, noise: float | None = None, starts: int = 12,
            hold_out: bool = True, profiles: bool = True) -> LawFit:
    """Fit one law: the best minimum that is admissible over the tests' stretches, else the best.

    Parameters
    ----------
    noise
        Standard deviation of one reading [Pa], estimated where None.
    starts
        Number of searches per shape constant.
    hold_out
        Fit again without each mode.
    profiles
        Search for the limits of the constants.
    """
    count, ends = len(coupons), _minima(family, coupons, starts)
    values, material, failing = _admissible(ends, family, coupons)
    squares = _squares(family, coupons, values)
    sigma = Noise.left(squares, count - len(values), noise)
    jacobian = family.jacobian(*coupons.in_plane, values)
    spread = covariance(jacobian, sigma.size)
    lengths = np.linalg.norm(jacobian, axis=0)
    dropped = useless_constant(family, values, coupons, sigma.size)
    # Profiles along a constant without effect take long and give no information.
    limits = (((None, None),) * len(values) if dropped or not profiles else
              _limits(family, coupons, values, np.sqrt(np.diag(spread)), sigma))
    # The condition is 1e300 where a constant changes no reading.
    condition = np.linalg.cond(jacobian / lengths) if lengths.all() else np.inf
    result = LawFit(
        family=family, material=material, values=values,
        limits=limits, covariance=spread, noise=sigma, rmse=float((squares / count) ** 0.5),
        criterion=akaike(squares / count, count, len(values), noise),
        condition=float(min(condition, 1e300)),
        held_out=_held_out(coupons, family, starts) if hold_out else {},
        range=coupons.stretch_range, inadmissible=failing,
        dropped=dropped)
    worse = squares - _squares(family, coupons, ends[0]) > 0.01 * squares
    return replace(result, notes=tuple(_notes(result, coupons, worse)) if profiles else ())


def coupon_problem(family: LawFamily, coupons: Coupons, unit: float) -> LeastSquares:
    """Set up least squares for a family's constants, stress in units of ``unit`` [Pa]."""
    l1, l2 = coupons.in_plane
    least, most = family.bounds(largest_excess(l1, l2))
    linear, shaped = len(family.linear), len(family.shape)
    return LeastSquares.of(
        lambda values: (_residual(family, coupons, values) / unit,
                        family.jacobian(l1, l2, values) / unit),
        np.array([-np.inf] * linear + [least] * shaped),
        np.array([np.inf] * linear + [most] * shaped), tuple(range(linear)))


def _residual(family: LawFamily, coupons: Coupons, values: Array) -> Array:
    """Subtract measured from predicted stress [Pa]."""
    return family.stress(*coupons.in_plane, values) - coupons.stress


def _squares(family: LawFamily, coupons: Coupons, values: Array) -> float:
    """Sum the squared residuals [Pa²]; no less than the rounding of the readings."""
    return max(float(np.sum(_residual(family, coupons, values) ** 2)),
               len(coupons) * (1e-13 * _size(coupons)) ** 2)


def _size(coupons: Coupons) -> float:
    return float(np.sqrt(np.mean(coupons.stress**2))) or 1.0


def _minima(family: LawFamily, coupons: Coupons, count: int) -> list[Array]:
    linear, shaped = len(family.linear), len(family.shape)
    least, most = family.starts(largest_excess(*coupons.in_plane))
    shapes = seeded_starts(least, most, shaped, count * max(1, shaped))
    starts = np.concatenate([np.zeros((len(shapes), linear)), shapes], axis=1)
    problem = coupon_problem(family, coupons, _FINE * _size(coupons))
    return [family.ordered(values) for values in minima(problem, starts)]


def _limits(family: LawFamily, coupons: Coupons, values: Array, spread: Array,
            noise: Noise) -> tuple[ParameterLimits, ...]:
    """Find 95 % limits of every constant at the best fit.

    Where stress is linear in all constants they are value ± quantile · standard deviation, which is
    exact for normal noise; otherwise they come from profiles.
    """
    if not family.shape:
        halves = noise.quantile * spread
        return tuple((float(value - half), float(value + half)) if np.isfinite(half)
                     else (None, None) for value, half in zip(values, halves, strict=True))
    floor = 1e-9 * _size(coupons) * len(coupons) ** 0.5 / noise.quantile
    problem = coupon_problem(family, coupons, max(noise.size, floor))
    lines = [profile(problem, values, index, noise.quantile, _MET, _EVALUATIONS)
             for index in range(len(values))]
    return tuple((line.low, line.high) for line in lines)


def material_lines(material: Material, stretch_range: tuple[float, float] | None = None) -> str:
    """Write the ``[membrane.material]`` table of a specimen file.

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
        if item.several:
            texts = [written(item.says.dimension, part) for part in value]
            lines.append(f"{item.key} = [{', '.join(texts)}]")
        else:
            lines.append(f"{item.key} = {written(item.says.dimension, value)}")
    if stretch_range is not None:
        lines.append(f"range = [{stretch_range[0]:.4g}, {stretch_range[1]:.4g}]")
    return "\n".join(lines) + "\n"


def _needed(family: LawFamily, more: int = 0) -> int:
    """Count the readings without which the criterion has no value, with ``more`` constants."""
    return len(family.constants) + more + 3


def named_family(name: str, readings: int, more: int = 0) -> LawFamily:
    """Find a law by its name; an InputError where readings are too few for it with ``more``."""
    if name not in FAMILIES:
        raise InputError(f"must be all or one of {', '.join(FAMILIES)}", key="--law", given=name)
    family = FAMILIES[name]
    if readings < _needed(family, more):
        raise InputError(f"needs at least {_needed(family, more)} readings, there are {readings}",
                         key="--law", given=name)
    return family


def _admissible(ends: list[Array], family: LawFamily, coupons: Coupons) -> Judged:
    every = [judged(family, values, coupons) for values in ends]
    return next((item for item in every if item[1] is not None and item[2] is None), every[0])


def judged(family: LawFamily, values: Array, coupons: Coupons) -> Judged:
    """Judge constants: the material they make, if any, and where it is inadmissible."""
    if _cancelling(family, values, coupons):
        return values, None, None
    try:
        material = family.material(values)
    except InputError:
        return values, None, None
    return values, material, inadmissible_stretch(material, *coupons.stretch_range)


def _terms(family: LawFamily, values: Array, coupons: Coupons) -> Array:
    """Compute the stress of each term of a law in the readings [Pa], (readings, terms)."""
    linear, shape = np.split(values, [len(family.linear)])
    with np.errstate(all="ignore"):
        return np.nan_to_num(family.columns(*coupons.in_plane, shape) * linear)


def _cancelling(family: LawFamily, values: Array, coupons: Coupons) -> bool:
    """Check whether two terms of a law almost cancel in the readings."""
    terms = _terms(family, values, coupons)
    sizes = np.linalg.norm(terms, axis=0)
    return any(np.linalg.norm(terms[:, first] + terms[:, second]) * CANCELLING
               < sizes[first] + sizes[second]
               for first, second in combinations(range(terms.shape[1]), 2))


def useless_constant(family: LawFamily, values: Array, coupons: Coupons, sigma: float) -> str:
    """Name a constant at its bound, or a term without effect on the readings, else "".

    A term has no effect if all of it is no more than one standard deviation ``sigma`` [Pa] of one
    reading: without it χ² grows by one at most.
    """
    linear, shape = np.split(values, [len(family.linear)])
    bounds = family.bounds(largest_excess(*coupons.in_plane))
    for name, value in zip(family.shape, shape, strict=True):
        for bound in bounds:
            if abs(value - bound) <= _AT_BOUND * abs(bound):
                return NOTES["at_bound"].format(name=name, bound=bound, simpler=family.simpler)
    terms = _terms(family, values, coupons)
    sizes = np.linalg.norm(terms, axis=0)
    for first, second in combinations(range(len(linear)), 2):
        along = abs(terms[:, first] @ terms[:, second])
        if along > (1 - _ALIKE**2 / 2) * sizes[first] * sizes[second]:
            return NOTES["same_terms"].format(
                first=family.linear[first], second=family.linear[second], simpler=family.simpler)
    for name, size in zip(family.linear, sizes, strict=True):
        if len(linear) > 1 and size < sigma:
            return NOTES["does_nothing"].format(name=name, simpler=family.simpler)
    return ""


def _held_out(coupons: Coupons, family: LawFamily, starts: int) -> dict[str, float | None]:
    errors: dict[str, float | None] = {}
    for mode in coupons.modes:
        rest, tested = coupons[coupons.mode != mode], coupons[coupons.mode == mode]
        if len(rest) < _needed(family):
            continue
        values, *_ = _admissible(_minima(family, rest, max(2, starts // 3)), family, rest)
        missed = _residual(family, tested, values)
        errors[mode] = float(np.sqrt(np.mean(missed**2))) if np.isfinite(missed).all() else None
    return errors


def _notes(fit: LawFit, coupons: Coupons, worse: bool) -> Iterator[str]:
    family = fit.family
    units = ["Pa"] * len(family.linear) + ["1"] * len(family.shape)
    if fit.dropped:
        yield fit.dropped
    else:
        yield from open_constants(family.constants, units, fit.values, fit.limits, fit.covariance)
        yield from _open_modes(fit, coupons)
    if fit.material is None:
        yield NOTES["no_meaning"]
    if fit.inadmissible is not None:
        yield NOTES["inadmissible"].format(at=fit.inadmissible, range=fit.range)
    elif worse:
        yield NOTES["worse"]
    if _systematic(_residual(fit.family, coupons, fit.values), coupons):
        yield NOTES["systematic"]
    if _grows(_residual(fit.family, coupons, fit.values), coupons):
        yield NOTES["grows"]


def open_constants(names: Sequence[str], units: Sequence[str], values: Array,
                   limits: Sequence[ParameterLimits], spread: Array) -> Iterator[str]:
    """Note each constant that tests determine poorly, or only in combination with another."""
    for name, unit, value, (low, high) in zip(names, units, values, limits, strict=True):
        words, size = {"Pa": (" kPa", 1e3), "1": ("", 1.0)}.get(unit, (f" {unit}", 1.0))
        if low is None or high is None:
            sides = " and ".join(side for side, limit in (("lower", low), ("upper", high))
                                 if limit is None)
            yield NOTES["open"].format(name=name, sides=sides)
        elif high - low > 2 * WIDE * abs(value):
            yield NOTES["wide"].format(name=name, unit=words, value=value / size, low=low / size,
                                       high=high / size)
    deviations = np.sqrt(np.diag(spread))
    for first, second in combinations(range(len(names)), 2):
        product = deviations[first] * deviations[second]
        if np.isfinite(deviations[[first, second]]).all() and product > 0:
            correlation = spread[first, second] / product
            if abs(correlation) > CORRELATED:
                yield NOTES["correlated"].format(first=names[first], second=names[second],
                                                 correlation=correlation)


def _open_modes(fit: LawFit, coupons: Coupons) -> Iterator[str]:
    """Note untested modes in which the fit's stress is uncertain by more than a tenth."""
    stretch = np.array([1 + (coupons.stretch_range[1] - 1) / 2])
    for mode in MODES:
        if mode in coupons.modes or fit.material is None:
            continue
        # A law may not reach, in another mode, the stretch it was tested to in this one.
        energy, *_ = fit.material.derivatives(stretch, stretch ** MODES[mode])
        if np.isposinf(np.real(energy)).any():
            continue
        stress, half = fit.predict(mode, stretch)
        if half[0] > 0.1 * abs(stress[0]):
            yield NOTES["untested"].format(mode=mode.replace("_", " "), stretch=stretch[0],
                                           stress=stress[0] / 1e3, half=half[0] / 1e3)


def _grows(residual: Array, coupons: Coupons) -> bool:
    """Check whether residuals grow with the stress (rank correlation, p < 0.001)."""
    if len(residual) < _ENOUGH:
        return False
    grown = spearmanr(np.abs(residual), np.abs(coupons.stress), alternative="greater")
    return bool(grown.pvalue < 1e-3)


def _systematic(residual: Array, coupons: Coupons) -> bool:
    """Check whether residuals along stretch change sign far too rarely (runs test, p < 0.001)."""
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
