"""The search for Eq. (11)'s constants: bounded least squares, and the paper's simplex."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from tympan.geometry.errors import InputError
from tympan.studies.estimation.identifiability import Identifiability, identifiability, unseen
from tympan.studies.estimation.least_squares import LeastSquares, minimise
from tympan.studies.estimation.noise import noise_of
from tympan.studies.identify.static_fit import Objective, StaticProblem

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StaticFit:
    """Constants, what the data determine of them, the misfit, and what the search cost."""

    problem: StaticProblem
    values: Array
    sigma: float
    judgement: Identifiability
    rmse: float
    evaluations: int
    seconds: float

    def json(self) -> dict[str, Any]:
        """As the command prints it."""
        return {
            "law": self.problem.law,
            "alpha": self.problem.alpha,
            "noise_um": 1e6 * self.sigma,
            "rmse_um": 1e6 * self.rmse,
            **self.judgement.json(),
            "evaluations": self.evaluations,
            "seconds": self.seconds,
            "warnings": self.warnings,
        }

    @property
    def warnings(self) -> list[str]:
        """What a reader must know."""
        given = self.problem.readings.noise
        if given is None or self.sigma <= given:
            return []
        return [f"the readings do not follow this law: misfit {1e6 * self.sigma:.3g} um, noise "
                f"{1e6 * given:.3g} um; "
                "the limits count the misfit as noise, and it is not"]


def identify_static(problem: StaticProblem, objective: Objective = "deflection",
                    profiles: bool = True) -> StaticFit:
    """Fit the constants by bounded least squares, and judge what the readings determine.

    What the readings do not see, by the singular directions of the Jacobian, stays where the search
    began. Limits are Student's (normal, where the noise is known); they are profiles of the misfit
    in deflection where that was the ``objective``, else linearised.

    Raises
    ------
    InputError
        When there are no more readings than constants to find.
    """
    began, calls = time.perf_counter(), 0
    scale, size = problem.column("scale"), problem.readings.noise or 1e-6
    z = start = problem.column("start") / scale
    if len(problem.read) <= len(z):
        raise InputError(f"needs more readings than constants: {len(z)} are to be found",
                         key="static.csv",
                         given=f"{len(problem.read)} readings")
    # In force the problem is nearly linear: its fit is a safe place to begin from.
    safe: list[Objective] = ["force", "force"] if objective == "deflection" else []
    for seek in [*safe, *[objective] * 6]:
        rows, known = unseen(_misfit(problem, "deflection", size), z, len(z))
        minimum = minimise(_misfit(problem, seek, size).with_rows(rows, start), z)
        moved = float(np.abs(minimum.unknowns - z).max())
        calls, z = calls + minimum.evaluations, minimum.unknowns
        if seek == objective and moved < 1e-4:
            break
    residual = problem.residual(scale * z, "deflection")[0]
    noise = noise_of(float(residual @ residual), len(residual) - known, problem.readings.noise)
    judgement = identifiability(_misfit(problem, "deflection", noise.sigma), z, problem.constants,
                                noise.quantile, lambda index, at: float(scale[index] * at),
                                profiles and objective == "deflection")
    rmse = float(np.sqrt(np.mean(residual**2)))
    return StaticFit(problem, scale * z, noise.sigma, judgement, rmse, calls,
                     time.perf_counter() - began)


def _misfit(problem: StaticProblem, objective: Objective, size: float) -> LeastSquares:
    """Residuals over the constants in their scales, in a reading's noise [m] or its force."""
    scale = problem.column("scale")
    stiffness = float(np.mean(problem.load / np.abs(problem.read)))
    unit = size * (1.0 if objective == "deflection" else stiffness)

    def both(z: Array) -> tuple[Array, Array]:
        residual, slopes = problem.residual(scale * z, objective)
        return residual / unit, slopes * scale / unit

    return LeastSquares.of(both, problem.column("low") / scale, problem.column("high") / scale)


def nelder_mead(problem: StaticProblem, objective: Objective = "force",
                most: int = 20_000) -> dict[str, Any]:
    """The paper's way: Nelder and Mead's simplex on Eq. (11)'s squares, from the same start."""
    began, scale = time.perf_counter(), problem.column("scale")
    low, high, start = problem.column("low"), problem.column("high"), problem.column("start")
    unit = float(np.mean(problem.load)) if objective != "deflection" else 1e-3

    def cost(z: Array) -> float:
        return float(np.sum((problem.residual(np.clip(start + scale * z, low, high), objective)[0]
                             / unit) ** 2))

    done = minimize(cost, np.zeros(len(start)), method="Nelder-Mead",
                    options={"maxfev": most, "maxiter": most, "xatol": 1e-10, "fatol": 1e-16,
                             "adaptive": True})
    values = np.clip(start + scale * done.x, low, high)
    misfit = problem.residual(values, "deflection")[0]
    return {"values": dict(zip((c.name for c in problem.constants), values.tolist(), strict=True)),
            "rmse_um": 1e6 * float(np.sqrt(np.mean(misfit**2))), "evaluations": int(done.nfev),
            "converged": bool(done.success), "seconds": time.perf_counter() - began}

