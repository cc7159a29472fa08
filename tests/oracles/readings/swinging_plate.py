"""A plate that swings on a film that is charged and read late, by Runge and Kutta's method.

The film's forces are those of :mod:`tests.oracles.creep` without branch, tabulated. Nothing of the
program is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import RectBivariateSpline

from tests.oracles.creep import CreepingFilm
from tympan.base.arrays import Array

_VACUUM = 8.8541878128e-12
#: Heaves [m] and voltages [V] up to which forces are tabulated.
_HEAVE, _VOLTAGE = 8e-3, 6e3


@dataclass
class SwingingPlate:
    """A film's plate: mass that swings [kg], damping [N s/m], the resistance through which the film
    charges [Ohm], the time in which the sensor follows [s]."""

    film: CreepingFilm
    mass: float
    damping: float = 0.0
    resistance: float = 0.0
    lag: float = 0.0

    @cached_property
    def force(self) -> RectBivariateSpline:
        """The film's force on its plate [N] by heave [m] and U² [V²]."""
        heaves, squares = np.linspace(0.0, _HEAVE, 17), np.linspace(0.0, _VOLTAGE**2, 8)
        table = np.empty((len(heaves), len(squares)))
        for column, squared in enumerate(squares):
            x = np.zeros(2 * self.film.degree + 1)
            for row, heave in enumerate(heaves):
                x[-1] = heave
                x, *_ = self.film.at_rest(0.0, float(squared**0.5), None, x, fixed=True)
                table[row, column] = self.film.pull
        return RectBivariateSpline(heaves, squares, table, kx=5, ky=3)

    @property
    def capacitance(self) -> float:
        """Of the flat film [F]."""
        film = self.film
        mounted = np.pi * (film.frame**2 - film.plate**2)
        return float(_VACUUM * film.permittivity * mounted * film.prestretch**2 / film.thickness)

    def stepped(self, load: float, voltage: float, when: Array) -> Array:
        """Deflections read [m] at times [s] after a voltage comes, under a load [N], from rest."""
        start = float(self.film.at_rest(load, 0.0, None)[0][-1])
        late = self.resistance * self.capacitance

        def rate(time: float, state: Any) -> Any:
            y, v, shown = state
            seen = voltage * (1 - np.exp(-time / late)) if late else voltage
            push = load - float(self.force(y, seen**2)[0, 0]) - self.film.spring * y
            push -= self.damping * v
            return [v, push / self.mass, (y - shown) / self.lag if self.lag else 0.0]

        done = solve_ivp(rate, (0.0, when[-1]), [start, 0.0, start], "DOP853", t_eval=when,
                         rtol=1e-9, atol=1e-12)
        return np.asarray(done.y[2 if self.lag else 0])
