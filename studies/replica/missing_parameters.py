"""The ε_r and α missing from Table 1: what Table 2's ranges say of them, with the paper's cones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize

from tympan.studies.circles.cone import ConeCircle, radii_of
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import settle
from tympan.studies.paper.published import HIGHEST, LOWEST, MASSES, ranges
from tympan.studies.paper.table1 import paper_actuators

Array = NDArray[np.float64]
_START = (8.0, 0.5, 0.5)
_BOUNDS = ((1.0, 15.0), (0.0, 1.0), (0.0, 1.0))


def actuators(permittivity: Any, alpha: Any, masses: Sequence[float] = MASSES) -> Actuator:
    """The paper's three actuators under masses [kg] with what is missing, as one array.

    ``permittivity`` ε_r has any shape, ``alpha``, α₁ of the ellipses' short circles, one axis more;
    the actuators have theirs, and two: masses and shapes.
    """
    circle, small, large = paper_actuators(1.0)
    radii = [2 * radii_of(circle.frame), radii_of(small.frame), radii_of(large.frame)]
    short = np.asarray(alpha)[..., None, :]
    short = np.concatenate([0 * short[..., :1] + 1, short], axis=-1)
    return Actuator(ConeCircle(circle, np.array(radii)), np.stack([short, 1 - short], axis=-1),
                    np.array(masses)[:, None],
                    permittivity=np.asarray(permittivity)[..., None, None])


def deflections(permittivity: Any, alpha: Any, voltage: Any,
                masses: Sequence[float] = MASSES) -> Array:
    """Where these rest at a voltage [V], in m, shape (…, masses, 3); nan beyond pull-in."""
    moved = actuators(permittivity, alpha, masses)
    return np.asarray(settle(lambda y: moved.balance(y, voltage), moved.flat))


def rest_ranges(permittivity: Any, alpha: Any, high: Any = HIGHEST,
                masses: Sequence[float] = MASSES) -> Array:
    """Their ranges [m] at rest between Table 2's lowest voltage and another, (…, masses, 3)."""
    return (deflections(permittivity, alpha, high, masses)
            - deflections(permittivity, alpha, LOWEST, masses))


def ranges_with_slopes(values: Array) -> tuple[Array, Array]:
    """Ranges at rest [m], shape (masses, 3), and their derivatives by (ε_r, α₁, α₁), (…, 3)."""
    steps = values + 1e-30j * np.eye(3)
    stepped = actuators(steps[:, 0], steps[:, 1:])
    slopes = []
    for voltage in (HIGHEST, LOWEST):
        y = deflections(values[0], values[1:], voltage)
        # Implicit functions: at rest the balance stays as it is.
        force, stiffness = stepped.balance(y, voltage)
        slopes.append(-np.imag(force) / 1e-30 / np.real(stiffness))
    return rest_ranges(values[0], values[1:]), np.moveaxis(slopes[0] - slopes[1], 0, -1)


@dataclass(frozen=True, eq=False)
class MissingParameters:
    """Values for the cells that Table 1 lost: ε_r, α₁ of the small and of the large ellipse.

    ``ranges`` with them and ``misfit``, those less the paper's [m]; ``rows`` of Table 2 they were
    found from.
    """

    permittivity: float
    alpha: tuple[float, float]
    ranges: Array
    misfit: Array
    rows: tuple[int, ...] = (0, 1)

    @classmethod
    def of(cls, permittivity: float, alpha: Sequence[float],
           rows: tuple[int, ...] = (0, 1)) -> MissingParameters:
        """With their ranges at rest."""
        small, large = alpha
        ours = rest_ranges(permittivity, (small, large))
        return cls(float(permittivity), (float(small), float(large)), ours, ours - ranges(), rows)

    @property
    def rms(self) -> float:
        """Root mean square of the misfit over the rows used [m]."""
        return float(np.sqrt(np.mean(self.misfit[list(self.rows)] ** 2)))

    @property
    def rms_mm(self) -> float:
        """The same [mm]."""
        return 1e3 * self.rms

    @property
    def worst(self) -> float:
        """Largest misfit over the rows used [m]."""
        return float(np.abs(self.misfit[list(self.rows)]).max())

    @property
    def worst_mm(self) -> float:
        """The same [mm]."""
        return 1e3 * self.worst

    def weights(self, actuator: int) -> tuple[float, ...]:
        """α of an actuator's circles."""
        return (1.0,) if actuator == 0 else (self.alpha[actuator - 1], 1 - self.alpha[actuator - 1])

    def actuators(self, mass: float) -> tuple[Actuator, ...]:
        """The paper's three actuators under a mass [kg] with these values."""
        return tuple(Actuator.of(specimen, mass, self.weights(number))
                     for number, specimen in enumerate(paper_actuators(self.permittivity)))

    def json(self) -> dict[str, Any]:
        """As stored."""
        return {"relative_permittivity": self.permittivity, "alpha_1": list(self.alpha),
                "rms_mm": 1e3 * self.rms,
                "worst_mm": 1e3 * self.worst, "misfit_mm": (1e3 * self.misfit).tolist(),
                "rows_g": [1e3 * MASSES[row] for row in self.rows]}


def fit(shared: bool = True, rows: Sequence[int] = (0, 1)) -> MissingParameters:
    """ε_r and α₁, one for both ellipses or one each, by least squares on rows of Table 2."""
    spread, read, kept = _spread(shared), ranges(), list(rows)

    def residual(free: Array) -> Array:
        ours = rest_ranges(*_pair(spread @ free))
        return np.asarray(1e3 * (ours - read)[kept].ravel())

    def slopes(free: Array) -> Array:
        return np.asarray(1e3 * ranges_with_slopes(spread @ free)[1][kept].reshape(-1, 3) @ spread)

    low, high = np.array(_bounds(shared)).T
    done = least_squares(residual, _start(shared), slopes, (low, high), x_scale=high - low,
                         xtol=1e-12, ftol=1e-12,
                         gtol=1e-12)
    values = spread @ done.x
    return MissingParameters.of(values[0], (values[1], values[2]), tuple(rows))


def smallest_worst(shared: bool = True) -> MissingParameters:
    """The ε_r and α₁ whose largest misfit over all six ranges is smallest."""
    spread = _spread(shared)
    began = fit(shared)
    start = np.append(_start(shared), 1e3 * began.worst)
    start[:-1] = np.linalg.lstsq(spread, np.array([began.permittivity, *began.alpha]),
                                 rcond=None)[0]
    done = _limited(spread, shared, start, lambda z: z[-1], np.eye(len(start))[-1])
    values = spread @ done[:-1]
    return MissingParameters.of(values[0], (values[1], values[2]))


def allowed(factor: float = 2.0, shared: bool = True) -> dict[str, tuple[float, float]]:
    """Lowest and highest ε_r and α₁ whose worst misfit is within ``factor`` times the smallest."""
    spread, best = _spread(shared), smallest_worst(shared)
    alphas = ("alpha_1",) if shared else ("alpha_small", "alpha_large")
    names = ("relative_permittivity", *alphas)
    centre = np.linalg.lstsq(spread, np.array([best.permittivity, *best.alpha]), rcond=None)[0]
    limits = {}
    for number, name in enumerate(names):
        ends = []
        for sign in (1.0, -1.0):
            aim = sign * np.eye(len(names) + 1)[number]
            done = _limited(spread, shared, np.append(centre, 1e3 * best.worst),
                            lambda z, aim=aim: aim @ z, aim,
                            most=1e3 * factor * best.worst)
            ends.append(float(done[number]))
        limits[name] = (ends[0], ends[1])
    return limits


def worst_misfit(permittivity: Array, alpha: Array) -> Array:
    """Largest misfit [m] on a grid of ε_r and one α₁ for both, (permittivities, alphas), or nan."""
    grid, both = np.meshgrid(permittivity, alpha, indexing="ij")
    misfit = rest_ranges(grid, np.stack([both, both], axis=-1)) - ranges()
    return np.asarray(np.abs(misfit).max(axis=(-2, -1)))


def _limited(spread: Array, shared: bool, start: Array, cost: Any, slope: Array,
             most: float | None = None) -> Array:
    """(constants, t [mm]) with the least cost whose misfits are within ±t, at most ``most``."""
    read = ranges()

    def room(z: Array) -> Array:
        misfit = 1e3 * (rest_ranges(*_pair(spread @ z[:-1])) - read).ravel()
        return np.concatenate([z[-1] - misfit, z[-1] + misfit])

    def room_slopes(z: Array) -> Array:
        slopes = 1e3 * ranges_with_slopes(spread @ z[:-1])[1].reshape(-1, 3) @ spread
        ones = np.ones((len(slopes), 1))
        return np.block([[-slopes, ones], [slopes, ones]])

    done = minimize(cost, start, jac=lambda z: slope, method="SLSQP",
                    bounds=[*_bounds(shared), (0.0, most)],
                    constraints={"type": "ineq", "fun": room, "jac": room_slopes},
                    options={"ftol": 1e-12, "maxiter": 300})
    return np.asarray(done.x)


def _pair(values: Array) -> tuple[float, Array]:
    return float(values[0]), values[1:]


def _spread(shared: bool) -> Array:
    return np.array([[1.0, 0], [0, 1], [0, 1]]) if shared else np.eye(3)


def _start(shared: bool) -> Array:
    return np.array(_START[:2] if shared else _START)


def _bounds(shared: bool) -> tuple[tuple[float, float], ...]:
    return _BOUNDS[:2] if shared else _BOUNDS
