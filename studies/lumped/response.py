"""What a simulation of the lumped model found, as JSON and as a dataset's transient.csv."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.studies.files import write_csv, write_json
from tympan.studies.lumped.actuator import flat_capacitance, stored_energy
from tympan.studies.lumped.equilibria import pull_in
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.simulate import Loop, Response, last_loop, settling_time

Array = NDArray[np.float64]
_MOST = 2_000_000
#: A loop that drifts by less than this share of its range counts as closed.
_CLOSED = 0.01


@dataclass(frozen=True, eq=False)
class Simulated:
    """A response sampled with an interval [s]; ``period`` of its signal [s] if it has one.

    ``step`` says that the signal is a step, after which an oscillation settles; ``equal_weights``
    that nobody gave any.
    """

    response: Response
    interval: float
    period: float | None = None
    step: bool = False
    equal_weights: bool = False

    def __post_init__(self) -> None:
        """Refuse more samples than anybody can use."""
        if self.response.end / self.interval > _MOST:
            raise InputError(f"would give more than {_MOST} samples", key="--interval",
                             given=f"{self.interval:g} s")

    @cached_property
    def time(self) -> Array:
        """Times [s]."""
        return self.response.samples(self.interval)

    @cached_property
    def voltage(self) -> Array:
        """Voltages [V]."""
        return self.response.voltage(self.time)

    @cached_property
    def deflection(self) -> Array:
        """Deflections [m]."""
        return self.response.deflection(self.time)

    @property
    def reading(self) -> Array:
        """What the rig's sensor shows [m]."""
        return np.asarray(self.response.actuator.rig.reading(self.deflection, self.time))

    @cached_property
    def loop(self) -> Loop | None:
        """The last period, of a signal that has one."""
        if self.period is None or self.response.drawn_in is not None:
            return None
        return last_loop(self.response, self.period)

    @property
    def warnings(self) -> list[str]:
        """What a reader must know."""
        found = []
        if self.equal_weights and self.response.actuator.count > 1:
            found.append("equal weights were taken: the paper's are lost; `tympan alpha` finds those of a specimen")
        if self.response.drawn_in is not None:
            found.append(f"the film is drawn in after {self.response.drawn_in:.4g} s: a step "
                         "overshoots what a slow ramp may reach; lower the voltage")
        if self.loop is not None and abs(self.loop.drift) > _CLOSED * np.ptp(self.loop.deflection):
            found.append(f"the last period ends {1e6 * self.loop.drift:+.3g} um from where it began: the film still "
                         "creeps; more periods (--count) close the loop")
        limit = pull_in(self.response.actuator)
        if limit is not None and self.deflection[-1] > limit[1]:
            found.append(f"the film was drawn in: it ends beyond {1e3 * limit[1]:.4g} mm, where pull-in begins")
        return found

    def json(self) -> dict[str, Any]:
        """What it found, SI."""
        actuator = self.response.actuator
        limit = pull_in(actuator)
        settled = settling_time(self.time, self.deflection) if self.step else np.nan
        flat = flat_capacitance(actuator.specimen)
        return {
            "specimen": actuator.specimen.name,
            "mass_kg": actuator.mass,
            "circles": actuator.circles.radius.tolist(),
            "alpha": list(actuator.weights),
            "status": "done" if self.response.drawn_in is None else "drawn_in",
            "first_m": float(self.deflection[0]),
            "last_m": float(self.deflection[-1]),
            "range_m": float(np.ptp(self.deflection)),
            "settling_time_s": settled if np.isfinite(settled) else None,
            "hysteresis_area_V_m": None if self.loop is None else self.loop.area,
            "pull_in_film_voltage_V": None if limit is None else limit[0],
            "flat_capacitance_F": flat,
            "flat_stored_energy_J": stored_energy(flat, float(np.abs(self.voltage).max())),
            "linear": linearise(actuator, self.response.signal.first).json(),
            "evaluations": self.response.evaluations,
            "warnings": self.warnings,
        }


def simulated_json(found: Sequence[Simulated]) -> dict[str, Any]:
    """The object of ``lumped simulate --json``."""
    return {"responses": [one.json() for one in found]}


def write_simulated(found: Sequence[Simulated], result: dict[str, Any], folder: Path) -> None:
    """DIR/simulate.json and DIR/transient.csv, which a dataset may hold."""
    write_json(folder / "simulate.json", result)
    rows = ((one.response.actuator.specimen.name, 1e3 * one.response.actuator.mass, "simulated", t,
             1e-3 * u, 1e3 * y)
            for one in found
            for t, u, y in zip(one.time.tolist(), one.voltage.tolist(), one.reading.tolist(),
                               strict=True))
    write_csv(folder / "transient.csv",
              ("specimen", "mass_g", "run", "t_s", "voltage_kV", "displacement_mm"), rows)
