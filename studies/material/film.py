"""Deflection of a film by fitted laws, with limits from the uncertainty of coupon tests.

Two things are uncertain: constants that the readings do not determine, and laws that fit the tests
equally well and differ where nothing was tested. For each law that fits about as well as the best,
the constants are moved as far as the readings allow in both directions of the quantity that
determines the film: the energy stored by its deflection. That is a profile (Bates and Watts,
*Nonlinear Regression Analysis*, 1988, §6.1), the profiled quantity being the energy. The film is
then solved with the constants at both ends. Its limits are the lowest and the highest deflection of
all laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.fem.complex_step import complex_step
from tympan.fem.film.admissibility import inadmissible_stretch
from tympan.fem.results.fields import node_fields
from tympan.geometry.specimen import Material
from tympan.studies.case import Case, Settings, solve, solved
from tympan.studies.data.coupon import Coupons
from tympan.studies.estimation.correlation import CorrelatedSpread
from tympan.studies.estimation.least_squares import Evaluation, LeastSquares, minimise
from tympan.studies.estimation.profile import profile
from tympan.studies.material.branches import BranchFit, TimedTests
from tympan.studies.material.families import LawFamily
from tympan.studies.material.fit import LawFit, best_offered, coupon_noise, coupon_problem
from tympan.studies.material.relaxation import BranchStress

#: Excess of a law's criterion over the best one's above which it does not count (Burnham and
#: Anderson, *Model Selection and Multimodel Inference*, 2002, §2.6).
_AS_GOOD = 10.0
#: Factor of the error on held-out runs above which a law does not count.
_FORETOLD = 1.25
#: Relative accuracy of the energy at a prescribed value.
_MET = 1e-4

#: Lower bound of the energy over that of the best fit, far below any that readings allow.
_LEAST = 1e-2
#: Upper bound of the energy over that of the best fit, far above any that readings allow.
_MOST = 1e2

#: Accuracy with which a profile meets its quantile, and its most evaluations.
_QUANTILE_MET = 0.02
_EVALUATIONS = 300
#: Steps from the limit of a profile back to constants that make a law.
_HALVINGS = 6
#: Energy of the deflection over that of the mounted film, below which the film is flat.
_FLAT = 1e-12


@dataclass(frozen=True)
class LawDeflection:
    """Deflection [m] by one law, and by the constants at both ends of its limits.

    A value is None where the film has no equilibrium with them; ``low`` is the lower one.
    """

    deflection_m: float | None
    low_m: float | None
    high_m: float | None


@dataclass(frozen=True)
class FilmDeflection:
    """Deflection of a film [m] by the best law, with 95 % limits over all laws as good.

    A limit is None where the film has no equilibrium there: it pulls in, or cannot be followed.
    """

    specimen: str
    mass_kg: float
    voltage_V: float
    deflection_m: float | None
    low_m: float | None
    high_m: float | None
    laws: dict[str, LawDeflection]

    def json(self) -> dict[str, Any]:
        """Write the film as a JSON object."""
        numbers = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return numbers | {"laws": {name: vars(law) for name, law in self.laws.items()}}


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A fitted law: its unknowns, the law's first, with everything fitted at the same time."""

    family: LawFamily
    best: AnyArray
    problem: LeastSquares
    noise: CorrelatedSpread
    jacobian: AnyArray
    range: tuple[float, float]

    def law(self, unknowns: AnyArray) -> Material | None:
        """Make the law of some unknowns, None where it is not admissible over the tests."""
        try:
            law = self.family.material(unknowns[:len(self.family.constants)])
        except InputError:
            return None
        return law if inadmissible_stretch(law, *self.range) is None else None


@dataclass(frozen=True, eq=False)
class _Visited:
    """Stretches of a film, with its volume there [m³], and those of the mounted film."""

    l1: AnyArray
    l2: AnyArray
    volume: AnyArray
    mounted: tuple[AnyArray, AnyArray]

    def energies(self, family: LawFamily, shape: AnyArray) -> AnyArray:
        """Compute the energy stored by the deflection per linear constant [J/Pa]."""
        unit = np.eye(len(family.linear))
        laws = [family.make(tuple(row), tuple(value.item() for value in np.asarray(shape)))
                for row in unit]
        return np.array([np.sum(self.volume * (law.derivatives(self.l1, self.l2)[0]
                                               - law.derivatives(*self.mounted)[0]))
                         for law in laws])

    def energy(self, family: LawFamily, constants: AnyArray) -> tuple[float, AnyArray]:
        """Compute the energy [J] and its derivative by every constant."""
        linear, shape = np.split(constants, [len(family.linear)])
        columns = self.energies(family, shape)
        parts = [complex_step(lambda moved: self.energies(family, moved) @ linear, shape, row)
                 for row in np.eye(len(shape))]
        return float(columns @ linear), np.append(columns, parts)


def film_deflection(case: Case, settings: Settings, coupons: Coupons,
                    fits: Sequence[LawFit | BranchFit], noise: float | None = None
                    ) -> FilmDeflection:
    """Compute the deflection of a case's film at rest by fitted laws, with its uncertainty.

    ``fits`` are those of :func:`~tympan.studies.material.fit.compare` or
    :func:`~tympan.studies.material.branches.compare_in_time` to the readings ``coupons``, the best
    first; ``noise`` is the standard deviation of a reading [Pa] that was given to them.

    Raises
    ------
    InputError
        When none of the laws is offered, or the film is flat: nothing deflects it.
    """
    best = best_offered([_law_of(fit) for fit in fits])
    if best is None or best.material is None:
        raise InputError("none of the fitted laws is offered, so there is no film", key="--film",
                         given=case.specimen.name)
    as_good = [fit for fit in fits if _law_of(fit) is best or _counts(_law_of(fit), best)]
    visited = _visited(_with_law(case, best.material), settings)
    each = {}
    for fit in as_good:
        candidate = _candidate(coupons, fit, noise)
        each[candidate.family.name] = _deflections(case, settings, candidate, visited)
    deflection = each[best.family.name].deflection_m
    lows = [law.low_m for law in each.values()]
    highs = [law.high_m for law in each.values()]
    return FilmDeflection(
        case.specimen.name, case.mass, case.voltage, deflection,
        None if None in lows else min(filter(None, lows)),
        None if None in highs else max(filter(None, highs)), each)


def _law_of(fit: LawFit | BranchFit) -> LawFit:
    return fit.law if isinstance(fit, BranchFit) else fit


def _counts(law: LawFit, best: LawFit) -> bool:
    """Check whether a law is about as good as the best."""
    if not law.offered or law.far:
        return False
    if law.foretold is not None and best.foretold is not None:
        return law.foretold <= _FORETOLD * best.foretold
    return law.criterion <= best.criterion + _AS_GOOD


def _with_law(case: Case, law: Material) -> Case:
    film = replace(case.specimen.membrane, material=law, law_range=None, branches=())
    return replace(case, specimen=replace(case.specimen, membrane=film))


def _visited(case: Case, settings: Settings) -> _Visited:
    model, outcome, result = solved(case, settings)
    if outcome.status != "equilibrium":
        raise InputError(f"has no equilibrium by the fitted law: {result.warnings[0]}",
                         key="--film", given=case.specimen.name)
    prestretch = case.specimen.membrane.prestretch
    fields, = node_fields(model, [outcome.state])
    each = len(fields.stretch_1) // len(model.volumes)
    visited = _Visited(fields.stretch_1, fields.stretch_2,
                       np.repeat(model.volumes.sum(axis=1) / each, each),
                       (np.array(prestretch[0]), np.array(prestretch[1])))
    law = case.specimen.membrane.material
    stored = float(np.sum(visited.volume * (law.derivatives(visited.l1, visited.l2)[0]
                                            - law.derivatives(*visited.mounted)[0])))
    if stored <= _FLAT * float(visited.volume.sum() * law.derivatives(*visited.mounted)[0]):
        raise InputError("stays flat: give a mass that deflects it", key="--film",
                         given=case.specimen.name)
    return visited


def _candidate(coupons: Coupons, fit: LawFit | BranchFit, noise: float | None) -> _Candidate:
    law = _law_of(fit)
    if isinstance(fit, LawFit):
        errors = coupon_noise(coupons, law.family, law.values, noise)
        return _Candidate(law.family, law.values,
                          coupon_problem(law.family, coupons, errors.noise.size), errors,
                          law.family.jacobian(*coupons.in_plane, law.values), law.range)
    tests = TimedTests(coupons, BranchStress.of(coupons), law.family)
    moduli, times = np.split(fit.values, 2)
    best = np.concatenate([law.values, moduli, np.log(times)])
    jacobian = tests.jacobian(best)
    series = list(coupons.series.values())
    errors = CorrelatedSpread.of(jacobian, tests.residual(best), series, noise)
    problem = tests.problem(fit.count, errors.noise.size)
    return _Candidate(law.family, best, problem, errors, jacobian, law.range)


def _deflections(case: Case, settings: Settings, candidate: _Candidate, visited: _Visited
                 ) -> LawDeflection:
    def deflection(unknowns: AnyArray | None) -> float | None:
        law = None if unknowns is None else candidate.law(unknowns)
        return None if law is None else solve(_with_law(case, law), settings).deflection_m

    stiff, soft = _ends(candidate, visited)
    return LawDeflection(deflection(candidate.best), deflection(stiff), deflection(soft))


def _ends(candidate: _Candidate, visited: _Visited) -> tuple[AnyArray, AnyArray]:
    """Find the unknowns at both ends of the energy's 95 % limits, the stiffer ones first."""
    family, count = candidate.family, len(candidate.family.constants)
    base, slope = visited.energy(family, candidate.best[:count])
    row = np.zeros((1, len(candidate.best)))
    row[0, :count] = slope / base

    def evaluate(unknowns: AnyArray, near: Evaluation | None) -> Evaluation:
        values, share = unknowns[:-1], unknowns[-1]
        point = candidate.problem.at(values)
        with np.errstate(all="ignore"):
            energy, slopes = visited.energy(family, values[:count])
        last = np.zeros(len(unknowns))
        last[:count], last[-1] = slopes / base / _MET, -1 / _MET
        return Evaluation(
            np.append(point.residual, (energy / base - share) / _MET),
            lambda: np.vstack([np.column_stack([point.jacobian, np.zeros(len(point.residual))]),
                               last]))

    problem = LeastSquares(evaluate, np.append(candidate.problem.low, _LEAST),
                           np.append(candidate.problem.high, _MOST), candidate.problem.linear)
    start = np.append(candidate.best, 1.0)
    line = profile(problem, start, len(candidate.best), _reach(candidate, row), _QUANTILE_MET,
                   _EVALUATIONS)
    # A profile without a limit ended at a bound, or with its last evaluation.
    ends = [float(line.values.min()) if line.low is None else line.low,
            float(line.values.max()) if line.high is None else line.high]
    soft, stiff = (_last_law(candidate, problem, start, end) for end in ends)
    return stiff, soft


def _reach(candidate: _Candidate, row: AnyArray) -> float:
    """Convert the 95 % limit of correlated errors to standard deviations of independent ones."""
    lengths = np.linalg.norm(candidate.jacobian, axis=0)
    safe = np.where(lengths > 0, lengths, 1.0)
    spread = np.linalg.pinv(candidate.jacobian / safe, rcond=1e-10) / safe[:, None]
    plain = candidate.noise.noise.size * float(np.linalg.norm(row @ spread))
    half = float(candidate.noise.halves(row)[0])
    return half / plain if plain > 0 and np.isfinite(half) else float(
        candidate.noise.quantiles.max())


def _last_law(candidate: _Candidate, problem: LeastSquares, start: AnyArray, end: float
              ) -> AnyArray:
    """Find the unknowns at an energy, or at the last one towards it that makes a law."""
    fixed = np.arange(len(start)) == len(start) - 1

    def at(share: float) -> AnyArray:
        begin = np.append(start[:-1], share)
        return minimise(problem, begin, fixed).unknowns[:-1]

    reached, unknowns = 0.0, start[:-1]
    step = 1.0
    for _ in range(_HALVINGS):
        trial = at(float(end ** min(reached + step, 1.0)))
        if candidate.law(trial) is not None:
            reached, unknowns = reached + step, trial
            if reached >= 1:
                break
        step /= 2
    return unknowns
