"""ε_r and α, which Table 1 lacks, found from Table 2's ranges with the paper's cones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import NonlinearConstraint, least_squares, minimize

from tympan.base.arrays import Array
from tympan.paper.published import HIGHEST, LOWEST, MASSES, ranges
from tympan.paper.table1 import VISCOUS, paper_actuators
from tympan.studies.circles import ConeCircle, radii_of
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import settle
from tympan.studies.lumped.simulate import slow_ends
from tympan.studies.signals import Signal

_START = np.array([8.0, 0.5, 0.5])
_BOUNDS = np.array([(1.0, 15.0), (0.0, 1.0), (0.0, 1.0)])
#: Matrix that builds (ε_r, α₁, α₁) from ε_r and one α₁ for both ellipses.
_SHARED = np.array([[1.0, 0], [0, 1], [0, 1]])

#: ε_r and α₁ where the search over levels begins. Steps of derivatives point towards them, so that
#: none leaves the bounds.
_LEVELS_START = np.array([9.0, 0.5])
#: Bounds of ε_r and α₁, from the lowest to the highest.
_LEVELS_BOUNDS = ((1.0, 0.0), (11.0, 1.0))

#: Step of ε_r and α₁ for derivatives of the ranges over levels.
_STEP = 1e-2
#: Range that replaces pull-in [m]: it is far beyond any real range, so the search turns back.
_DRAWN_IN = 1e-2


def paper_array(permittivity: Any, alpha: Any, masses: Sequence[float] = MASSES) -> Actuator:
    """Make one array of the paper's three actuators under masses [kg], with the missing values.

    ``permittivity`` has any shape; ``alpha``, α₁ of the ellipses' short circles, has one axis more.
    The actuators have the shape of ``permittivity`` and two axes more: masses and actuators.
    """
    circle, small, large = paper_actuators(1.0)
    radii = [2 * radii_of(circle.frame), radii_of(small.frame), radii_of(large.frame)]
    short = np.asarray(alpha)[..., None, :]
    short = np.concatenate([0 * short[..., :1] + 1, short], axis=-1)
    return Actuator(ConeCircle(circle, np.array(radii)), np.stack([short, 1 - short], axis=-1),
                    np.array(masses)[:, None], VISCOUS,
                    permittivity=np.asarray(permittivity)[..., None, None])


def deflections(permittivity: Any, alpha: Any, voltage: Any,
                masses: Sequence[float] = MASSES) -> Array:
    """Solve equilibrium deflections [m] of :func:`paper_array`, (…, masses, 3).

    They are nan beyond pull-in.
    """
    moved = paper_array(permittivity, alpha, masses)
    return np.asarray(settle(lambda y: moved.balance(y, voltage), moved.flat))


def rest_ranges(permittivity: Any, alpha: Any, high: Any = HIGHEST,
                masses: Sequence[float] = MASSES) -> Array:
    """Compute equilibrium ranges [m] from Table 2's lowest voltage to another, (…, masses, 3)."""
    return (deflections(permittivity, alpha, high, masses)
            - deflections(permittivity, alpha, LOWEST, masses))


def ranges_with_slopes(values: Array) -> tuple[Array, Array]:
    """Compute equilibrium ranges [m], (masses, 3), and derivatives by (ε_r, α₁, α₁), (…, 3)."""
    steps = values + 1e-30j * np.eye(3)
    stepped = paper_array(steps[:, 0], steps[:, 1:])
    slopes = []
    for voltage in (HIGHEST, LOWEST):
        y = deflections(values[0], values[1:], voltage)
        # Derivative of an implicit function: in equilibrium the balance stays zero.
        force, stiffness = stepped.balance(y, voltage)
        slopes.append(-np.imag(force) / 1e-30 / np.real(stiffness))
    return rest_ranges(values[0], values[1:]), np.moveaxis(slopes[0] - slopes[1], 0, -1)


@dataclass(frozen=True, eq=False)
class MissingParameters:
    """Values for the cells that Table 1 lost: ε_r, α₁ of the small and of the large ellipse.

    ``ranges`` [m] are those with these values, ``misfit`` [m] is their difference from the paper's.
    ``rows`` are the rows of Table 2 from which the values were found.
    """

    permittivity: float
    alpha: tuple[float, float]
    ranges: Array
    misfit: Array
    rows: tuple[int, ...] = (0, 1)

    @classmethod
    def of(cls, permittivity: float, alpha: Sequence[float],
           rows: tuple[int, ...] = (0, 1)) -> MissingParameters:
        small, large = alpha
        ours = rest_ranges(permittivity, (small, large))
        return cls(float(permittivity), (float(small), float(large)), ours, ours - ranges(), rows)

    @property
    def rms(self) -> float:
        """Root mean square of the misfit over the rows used [m]."""
        return float(np.sqrt(np.mean(self.misfit[list(self.rows)] ** 2)))

    @property
    def rms_mm(self) -> float:
        return 1e3 * self.rms

    @property
    def worst(self) -> float:
        """Largest misfit over the rows used [m]."""
        return float(np.abs(self.misfit[list(self.rows)]).max())

    @property
    def worst_mm(self) -> float:
        return 1e3 * self.worst

    def weights(self, actuator: int) -> tuple[float, ...]:
        """List the weights α of the circles of an actuator, given by its number."""
        return (1.0,) if actuator == 0 else (self.alpha[actuator - 1], 1 - self.alpha[actuator - 1])

    def actuators(self, mass: float) -> tuple[Actuator, ...]:
        """Build the paper's three actuators under a mass [kg] with these values."""
        return tuple(Actuator.of(specimen, mass, self.weights(number), VISCOUS)
                     for number, specimen in enumerate(paper_actuators(self.permittivity)))

    def json(self) -> dict[str, Any]:
        return {"relative_permittivity": self.permittivity, "alpha_1": list(self.alpha),
                "rms_mm": self.rms_mm, "worst_mm": self.worst_mm,
                "misfit_mm": (1e3 * self.misfit).tolist(),
                "rows_g": [1e3 * MASSES[row] for row in self.rows]}


def fit_rests(shared: bool = True, rows: Sequence[int] = (0, 1)) -> MissingParameters:
    """Fit ε_r and α₁, shared by both ellipses or one each, to rows of Table 2 by least squares."""
    spread = _SHARED if shared else np.eye(3)
    count, read, kept = spread.shape[1], ranges(), list(rows)

    def residual(free: Array) -> Array:
        values = spread @ free
        return 1e3 * (rest_ranges(values[0], values[1:]) - read)[kept].ravel()

    def slopes(free: Array) -> Array:
        return 1e3 * ranges_with_slopes(spread @ free)[1][kept].reshape(-1, 3) @ spread

    low, high = _BOUNDS[:count].T
    done = least_squares(residual, _START[:count], slopes, (low, high), x_scale=high - low,
                         xtol=1e-12, ftol=1e-12, gtol=1e-12)
    permittivity, *alpha = spread @ done.x
    return MissingParameters.of(permittivity, alpha, tuple(rows))


def other_fits() -> dict[str, MissingParameters]:
    """Compute other fits by description: one α₁ for each ellipse, and each mass alone."""
    return {"one alpha for each ellipse": fit_rests(shared=False),
            **{f"{1e3 * mass:g} g alone": fit_rests(rows=(row,))
               for row, mass in enumerate(MASSES)}}


@cache
def smallest_worst() -> MissingParameters:
    """Find the ε_r and α₁ with the smallest worst misfit of the six ranges."""
    began = fit_rests()
    start = np.array([began.permittivity, began.alpha[0], began.worst_mm])
    permittivity, alpha, _ = _limited(start, np.eye(3)[2])
    return MissingParameters.of(permittivity, (alpha, alpha))


def allowed() -> dict[str, tuple[float, float]]:
    """Find the limits of ε_r and α₁ within which the worst misfit is twice the smallest."""
    best, limits = smallest_worst(), {}
    start = np.array([best.permittivity, best.alpha[0], best.worst_mm])
    for number, name in enumerate(("relative_permittivity", "alpha_1")):
        low, high = (float(_limited(start, sign * np.eye(3)[number], 2 * best.worst_mm)[number])
                     for sign in (1, -1))
        limits[name] = (low, high)
    return limits


def worst_misfit(permittivity: Array, alpha: Array) -> Array:
    """Compute the largest misfit [m] on a grid of ε_r and α₁, (permittivities, alphas), or nan."""
    grid, both = np.meshgrid(permittivity, alpha, indexing="ij")
    misfit = rest_ranges(grid, np.stack([both, both], axis=-1)) - ranges()
    return np.asarray(np.abs(misfit).max(axis=(-2, -1)))


def _limited(start: Array, aim: Array, most: float | None = None) -> Array:
    """Minimise ``aim`` @ (ε_r, α₁, t) where all misfits are within ±t [mm] and t ≤ ``most``."""
    read = ranges()

    def room(z: Array) -> Array:
        misfit = 1e3 * (rest_ranges(z[0], z[[1, 1]]) - read).ravel()
        return np.concatenate([z[-1] - misfit, z[-1] + misfit])

    done = minimize(lambda z: aim @ z, start, jac=lambda z: aim, method="SLSQP",
                    bounds=[*_BOUNDS[:2].tolist(), (0.0, most)],
                    constraints=NonlinearConstraint(room, 0, np.inf, "3-point"),
                    options={"ftol": 1e-12, "maxiter": 300})
    return np.asarray(done.x)


def level_ranges(signal: Signal, values: Array) -> Array:
    """Compute ranges [m] at the ends of a signal's levels with pairs of ε_r and α₁.

    Shape (pairs, masses, actuators).
    """
    permittivity, alpha = values.T
    levels = slow_ends(paper_array(permittivity, np.array([alpha, alpha]).T), signal)
    return np.asarray(np.ptp(levels, axis=0))


def fit_levels(signal: Signal) -> MissingParameters:
    """Fit ε_r and one α₁ for both ellipses to Table 2's ranges, read at the ends of levels.

    Overshoot by inertia does not count: it decays within seconds of a switch.
    """
    read = ranges()

    @cache
    def both(*values: float) -> tuple[Array, Array]:
        at = np.array(values)
        # Steps point towards the start of the search, so that none leaves the bounds.
        moves = np.diag(np.where(at > _LEVELS_START, -_STEP, _STEP))
        with np.errstate(all="ignore"):
            stepped = level_ranges(signal, np.vstack([at, at + moves]))
        first, *others = np.nan_to_num(stepped, nan=_DRAWN_IN)
        slopes = (np.array(others) - first).reshape(2, -1) / moves.sum(axis=1)[:, None]
        return first, slopes.T

    done = least_squares(lambda values: 1e3 * (both(*values)[0] - read).ravel(), _LEVELS_START,
                         lambda values: 1e3 * both(*values)[1], _LEVELS_BOUNDS, xtol=1e-5,
                         ftol=1e-7, max_nfev=12)
    fitted, (permittivity, alpha) = both(*done.x)[0], done.x.tolist()
    return MissingParameters(permittivity, (alpha, alpha), fitted, fitted - read)
