"""The ε_r and the α that Table 1 lost: what Table 2's ranges say of them, with the paper's cones and constants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize

from tympan.fem.film.density import maxwell
from tympan.fem.rig import Rig
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.paper.published import HIGHEST, LOWEST, MASSES, ranges
from tympan.studies.paper.table1 import paper_actuators

Array = NDArray[np.float64]
_START = (8.0, 0.5, 0.5)
_BOUNDS = ((1.0, 15.0), (0.0, 1.0), (0.0, 1.0))
_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Ranges:
    """Ranges of motion at rest between two voltages [V] of the paper's actuators as functions of what is lost.

    The constants are (ε_r, α₁ of the small ellipse, α₁ of the large one), α₁ being of the circle
    with the short semi-axis. Rows are ``masses`` [kg], columns the three actuators.
    """

    masses: tuple[float, ...] = MASSES
    low: float = LOWEST
    high: float = HIGHEST
    unaccounted: float = 0.0

    @cached_property
    def _circles(self) -> tuple[tuple[Any, ...], ...]:
        return tuple(Actuator.of(specimen, MASSES[0]).circles for specimen in paper_actuators(1.0))

    def force(self, actuator: int, alpha: Any, y: Any, squared: Any) -> tuple[Array, Array, Array,
                                                                              Array, Array]:
        """Force of the film without voltage and that of the voltage per ε_r [N], their stiffness [N/m], ∂force/∂α."""
        circles = self._circles[actuator]
        unit = maxwell(circles[0].specimen, squared)
        parts = [(*circle.pull(circle.specimen.membrane.material, y)[1:], *circle.pull(unit, y)[1:])
                 for circle in circles]
        if len(parts) == 1:
            held, stiff, drawn, soft = parts[0]
            return held, stiff, drawn, soft, np.zeros((2, *np.shape(y)))
        mixed = [alpha * short + (1 - alpha) * long for short, long in zip(*parts, strict=True)]
        slopes = np.array([parts[0][0] - parts[1][0], parts[0][2] - parts[1][2]])
        return mixed[0], mixed[1], mixed[2], mixed[3], slopes

    def rest(self, actuator: int, mass: float, voltage: Any, permittivity: Any, alpha: Any
             ) -> tuple[Array, Array, Array]:
        """Deflection at rest [m] and its derivatives by ε_r and α₁; nan beyond pull-in. Arrays of one shape.

        Newton from the flat film: the balance of these cones is concave up to pull-in, so it climbs
        to the first rest without passing it.
        """
        permittivity, alpha, voltage = np.broadcast_arrays(*(
            np.asarray(one, float) for one in (permittivity, alpha, voltage)))
        load, y = float(Rig().force(mass + self.unaccounted)), np.zeros(permittivity.shape)
        with np.errstate(all="ignore"):
            for _ in range(_ROUNDS):
                held, stiff, drawn, soft, slopes = self.force(actuator, alpha, y, voltage**2)
                left, stiffness = load - held - permittivity * drawn, stiff + permittivity * soft
                move = np.where(stiffness > 0, left / stiffness, np.nan)
                y = y + move
                if not (np.abs(move) > 1e-13).any():
                    break
            converged = np.abs(move) <= 1e-12
            return (np.where(converged, y, np.nan), -drawn / stiffness,
                    -(slopes[0] + permittivity * slopes[1]) / stiffness)

    def at(self, values: Array) -> tuple[Array, Array]:
        """Ranges [m], shape (masses, actuators), and derivatives by the constants, shape (masses, actuators, 3)."""
        found = np.empty((len(self.masses), len(self._circles)))
        slopes = np.zeros((*found.shape, 3))
        for row, mass in enumerate(self.masses):
            for column in range(found.shape[1]):
                alpha = (1.0, values[1], values[2])[column]
                high, low = (self.rest(column, mass, volts, values[0], alpha)
                             for volts in (self.high, self.low))
                found[row, column] = high[0] - low[0]
                slopes[row, column, 0] = high[1] - low[1]
                if column:
                    slopes[row, column, column] = high[2] - low[2]
        return found, slopes


@dataclass(frozen=True, eq=False)
class Lost:
    """Values for the lost cells: ε_r, α₁ of the small and of the large ellipse.

    ``ranges`` with them and ``misfit``, those less the paper's [m]; ``rows`` of Table 2 they were
    found from.
    """

    permittivity: float
    alpha: tuple[float, float]
    ranges: Array
    misfit: Array
    rows: tuple[int, ...] = (0, 1)

    @classmethod
    def of(cls, permittivity: float, alpha: tuple[float, float],
           rows: tuple[int, ...] = (0, 1)) -> Lost:
        """With their ranges at rest."""
        found = Ranges().at(np.array([permittivity, *alpha]))[0]
        return cls(float(permittivity), (float(alpha[0]), float(alpha[1])), found, found - ranges(),
                   rows)

    @property
    def rms(self) -> float:
        """Root mean square of the misfit over the rows used [m]."""
        return float(np.sqrt(np.mean(self.misfit[list(self.rows)] ** 2)))

    @property
    def worst(self) -> float:
        """Largest misfit over the rows used [m]."""
        return float(np.abs(self.misfit[list(self.rows)]).max())

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


def fit(shared: bool = True, rows: Sequence[int] = (0, 1)) -> Lost:
    """ε_r and α₁, one for both ellipses or one each, by least squares on rows of Table 2."""
    spread = _spread(shared)
    model, read = Ranges(), ranges()
    kept = list(rows)

    def residual(free: Array) -> Array:
        return np.asarray(1e3 * (model.at(spread @ free)[0] - read)[kept].ravel())

    def slopes(free: Array) -> Array:
        return np.asarray(1e3 * model.at(spread @ free)[1][kept].reshape(-1, 3) @ spread)

    low, high = np.array(_bounds(shared)).T
    done = least_squares(residual, _start(shared), slopes, (low, high), x_scale=high - low,
                         xtol=1e-12, ftol=1e-12,
                         gtol=1e-12)
    values = spread @ done.x
    return Lost.of(values[0], (values[1], values[2]), tuple(rows))


def smallest_worst(shared: bool = True) -> Lost:
    """The ε_r and α₁ whose largest misfit over all six ranges is smallest."""
    spread = _spread(shared)
    began = fit(shared)
    start = np.append(_start(shared), 1e3 * began.worst)
    start[:-1] = np.linalg.lstsq(spread, np.array([began.permittivity, *began.alpha]),
                                 rcond=None)[0]
    done = _limited(spread, shared, start, lambda z: z[-1], np.eye(len(start))[-1])
    values = spread @ done[:-1]
    return Lost.of(values[0], (values[1], values[2]))


def allowed(factor: float = 2.0, shared: bool = True) -> dict[str, tuple[float, float]]:
    """Lowest and highest ε_r and α₁ whose misfit is nowhere above ``factor`` times the smallest worst."""
    spread, best = _spread(shared), smallest_worst(shared)
    names = ("relative_permittivity", "alpha_1") if shared else ("relative_permittivity",
                                                                 "alpha_small", "alpha_large")
    centre = np.linalg.lstsq(spread, np.array([best.permittivity, *best.alpha]), rcond=None)[0]
    found = {}
    for number, name in enumerate(names):
        ends = []
        for sign in (1.0, -1.0):
            aim = sign * np.eye(len(names) + 1)[number]
            done = _limited(spread, shared, np.append(centre, 1e3 * best.worst),
                            lambda z, aim=aim: aim @ z, aim,
                            most=1e3 * factor * best.worst)
            ends.append(float(done[number]))
        found[name] = (ends[0], ends[1])
    return found


def worst_misfit(permittivity: Array, alpha: Array) -> Array:
    """Largest misfit [m] on a grid of ε_r and one shared α₁, shape (permittivities, alphas); nan beyond pull-in."""
    model, read = Ranges(), ranges()
    grid = np.meshgrid(permittivity, alpha, indexing="ij")
    worst = np.zeros(grid[0].shape)
    for row, mass in enumerate(MASSES):
        for column in range(len(read[row])):
            high, low = (model.rest(column, mass, volts, *grid)[0]
                         for volts in (model.high, model.low))
            worst = np.maximum(worst, np.abs(high - low - read[row, column]))
    return worst


def _limited(spread: Array, shared: bool, start: Array, cost: Any, slope: Array,
             most: float | None = None) -> Array:
    """(constants, t [mm]) with the least cost among those whose misfits are within ±t, t at most ``most``."""
    model, read = Ranges(), ranges()

    def room(z: Array) -> Array:
        misfit = 1e3 * (model.at(spread @ z[:-1])[0] - read).ravel()
        return np.concatenate([z[-1] - misfit, z[-1] + misfit])

    def room_slopes(z: Array) -> Array:
        slopes = 1e3 * model.at(spread @ z[:-1])[1].reshape(-1, 3) @ spread
        ones = np.ones((len(slopes), 1))
        return np.block([[-slopes, ones], [slopes, ones]])

    done = minimize(cost, start, jac=lambda z: slope, method="SLSQP",
                    bounds=[*_bounds(shared), (0.0, most)],
                    constraints={"type": "ineq", "fun": room, "jac": room_slopes},
                    options={"ftol": 1e-12, "maxiter": 300})
    return np.asarray(done.x)


def _spread(shared: bool) -> Array:
    return np.array([[1.0, 0], [0, 1], [0, 1]]) if shared else np.eye(3)


def _start(shared: bool) -> Array:
    return np.array(_START[:2] if shared else _START)


def _bounds(shared: bool) -> tuple[tuple[float, float], ...]:
    return _BOUNDS[:2] if shared else _BOUNDS
