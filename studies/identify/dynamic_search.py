"""The search for Eq. (12)'s constants: bounded least squares, and the paper's simplex."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from tympan.geometry.errors import InputError
from tympan.studies.estimation.identifiability import Identifiability, identifiability, unseen
from tympan.studies.estimation.least_squares import minimise
from tympan.studies.estimation.noise import noise_of
from tympan.studies.identify.dynamic_fit import CONSTANTS, DynamicProblem, Exact
from tympan.studies.lumped.actuator import Viscous

Array = NDArray[np.float64]

#: The search sees the first so many periods of the fast oscillation, then more: a response that is
#: out of step by half a period has its own minimum.
_PERIODS = (1.5, 6.0, 25.0, 100.0)
_LOOSE = 3.0  # deviation of a logarithm about the start while little of the record is seen


@dataclass(frozen=True, eq=False)
class DynamicFit:
    """The viscous constants, what the data determine of them, the misfit, and what the search cost.

    ``z`` are all numbers found, as :class:`DynamicProblem` has them; ``fast`` is the time in which
    the fastest motion at rest goes through a radian [s]; ``waited`` how long after a jump of the
    voltage readings were left out [s], because they come too seldom to follow it.
    """

    problem: DynamicProblem
    z: Array
    sigma: float
    judgement: Identifiability
    rmse: float
    evaluations: int
    seconds: float
    fast: float
    waited: float

    @property
    def viscous(self) -> Viscous:
        """The constants found."""
        return Viscous(*np.exp(self.z[:3]).tolist())

    def json(self) -> dict[str, Any]:
        """As the command prints it."""
        inner = 3 + self.problem.statics.count
        return {
            "noise_um": 1e6 * self.sigma,
            "rmse_um": 1e6 * self.rmse,
            "readings": self.problem.size,
            **self.judgement.json(),
            "runs": [{"specimen": self.problem.actuator(record, self.z).specimen.name,
                      "mass_kg": record.mass,
                      "run": record.run, "began_at_V": began, "interval_s": record.interval,
                      "delay_s": float(delay * record.interval)}
                     for record, began, delay in zip(self.problem.records, self.problem.began,
                                                     self.z[inner:],
                                                     strict=True)],
            "evaluations": self.evaluations,
            "seconds": self.seconds,
            "warnings": self.warnings,
        }

    @property
    def warnings(self) -> list[str]:
        """What a reader must know."""
        found, given = [], self.problem.noise
        if given is not None and self.sigma > given:
            found.append("the responses do not follow this model: misfit "
                         f"{1e6 * self.sigma:.3g} um, noise {1e6 * given:.3g} um; the limits count "
                         "the misfit as noise, and it is not")
        if isinstance(self.problem.statics, Exact):
            equal = ", equal weights" if self.problem.statics.weights is None else ", the weights"
            found.append(f"there is no static.csv: the films' own material{equal} and permittivity "
                         "are taken as exact")
        if self.waited:
            often = min(record.interval for record in self.problem.records)
            found.append(f"a reading every {1e3 * often:.3g} ms does not follow the fast "
                         f"oscillation, a radian of which takes {1e3 * self.fast:.3g} ms: "
                         f"those within {self.waited:.2g} s after a jump of the voltage were left "
                         "out, and eta_2, which damps it, is not determined")
        return found


def identify_dynamic(problem: DynamicProblem, profiles: bool = True) -> DynamicFit:
    """Fit k₁, η₁ and η₂ to all responses, by bounded least squares in their logarithms.

    First to the beginning of every response, then to more of it. As in the static fit, what the
    responses do not see stays where the search began, and limits are by profiles of the misfit.

    Raises
    ------
    InputError
        When there are no more readings than numbers to find, or a run does not begin at rest.
    """
    began, calls, z = time.perf_counter(), 0, problem.start
    problem, waited = _calm(problem)
    if problem.size <= len(z):
        raise InputError(f"needs more readings than the {len(z)} numbers to find",
                         key="transient.csv",
                         given=problem.size)
    sigma = problem.noise or 1e-6
    loose = np.eye(len(z))[:3] / _LOOSE
    for length in [] if waited else _lengths(problem):
        beginning = problem.until(length).misfit(sigma).with_rows(loose, problem.start)
        minimum = minimise(beginning, z, precision=1e-2)
        calls, z = calls + minimum.evaluations, minimum.unknowns
    for _ in range(4):
        misfit = problem.misfit(sigma)
        rows, known = unseen(misfit, z, 3)
        minimum = minimise(misfit.with_rows(rows, problem.start), z, precision=1e-6)
        moved = float(np.abs(minimum.unknowns - z).max())
        calls, z = calls + minimum.evaluations, minimum.unknowns
        squares = sum(float(residual @ residual) for residual, _ in problem.parts(z))
        freedom = problem.size - known - (len(z) - 3)
        noise = noise_of(squares, freedom, problem.noise)
        settled, sigma = 0.9 < noise.sigma / sigma < 1.1, noise.sigma
        if settled and (moved < 1e-4 or known == 3):
            break
    judgement = identifiability(problem.misfit(sigma), z, CONSTANTS, noise.quantile,
                                lambda _, log: float(np.exp(log)), profiles)
    return DynamicFit(problem, z, sigma, judgement, (squares / problem.size) ** 0.5, calls,
                      time.perf_counter() - began, 1 / abs(problem.pole(z)), waited)


def _lengths(problem: DynamicProblem) -> list[float]:
    """How much of the responses to look at first [s]."""
    whole = max(float(record.time[-1]) - record.begins for record in problem.records)
    period = 2 * np.pi / abs(problem.pole(problem.start))
    return [count * period for count in _PERIODS if count * period < whole / 2]


def _calm(problem: DynamicProblem) -> tuple[DynamicProblem, float]:
    """Without readings of an oscillation that no run follows, and how long it lasts [s].

    Out of step with it by whole periods a fit has other minima. It is given twice the time in which
    it falls from the whole range to the noise.
    """
    pole = problem.pole(problem.start)
    if any(record.interval < np.pi / abs(pole) for record in problem.records):
        return problem, 0.0
    span = max(float(np.ptp(record.displacement)) for record in problem.records)
    wait = 2 * float(np.log(max(span / (problem.noise or 1e-6), np.e)) / abs(pole.real))
    return replace(problem, records=tuple(record.calm(wait) for record in problem.records),
                   followed=False), wait


def nelder_mead_dynamic(problem: DynamicProblem, most: int = 400) -> dict[str, Any]:
    """The paper's way: Nelder and Mead's simplex on Eq. (12), in logarithms, the statics held."""
    began, start = time.perf_counter(), problem.start

    def cost(logs: Array) -> float:
        try:
            parts = problem.parts(np.append(np.clip(logs, *(end[:3] for end in problem.bounds)),
                                            start[3:]), False)
        except InputError:
            return 1e12
        return sum(float(np.mean((1e6 * residual) ** 2)) for residual, _ in parts)

    simplex = start[:3] + np.vstack([np.zeros(3), 0.3 * np.eye(3)])
    done = minimize(cost, start[:3], method="Nelder-Mead", options={
        "maxfev": most, "maxiter": most, "xatol": 1e-6, "fatol": 1e-9, "initial_simplex": simplex})
    return {"values": dict(zip((one.name for one in CONSTANTS), np.exp(done.x).tolist(),
                               strict=True)),
            "rmse_um": float((done.fun / len(problem.records)) ** 0.5),
            "evaluations": int(done.nfev),
            "converged": bool(done.success), "seconds": time.perf_counter() - began}
