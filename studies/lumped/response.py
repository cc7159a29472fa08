"""What simulations of the lumped model found: a result that saves and loads itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tympan.geometry.errors import InputError
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.files import read_json, remove, write_json
from tympan.studies.lumped.actuator import flat_capacitance
from tympan.studies.lumped.equilibria import pull_in
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.simulate import Response, settling_time

_MOST = 2_000_000
#: A loop that drifts by less than this share of its range counts as closed.
_CLOSED = 0.01
_COLUMNS = (Column.labels("specimen"), Column("mass", "g"), Column.labels("run"),
            Column("t", "s"), Column("voltage", "kV"), Column("displacement", "mm"))
_LOOP_COLUMNS = (Column.labels("specimen"), Column("voltage", "kV"), Column("deflection", "mm"))


@dataclass(frozen=True, eq=False)
class SampledResponse:
    """What one actuator's response tells, and its samples.

    ``numbers`` are those of ``lumped simulate --json``; ``samples`` have the columns of
    transient.csv, SI, as the rig's sensor shows them, and ``loop``, the last period of a signal
    that has one, those of hysteresis.csv.
    """

    numbers: dict[str, Any]
    samples: pd.DataFrame
    loop: pd.DataFrame | None = None


def sample(response: Response, interval: float, period: float | None = None,
           step: bool = False, equal_weights: bool = False) -> SampledResponse:
    """A response with an interval [s], and what it tells.

    ``period`` is its signal's [s] if it has one; ``step`` says that the signal is a step, after
    which an oscillation settles; ``equal_weights`` that nobody gave any.
    """
    if response.end / interval > _MOST:
        raise InputError(f"would give more than {_MOST} samples", key="--interval",
                         given=f"{interval:g} s")
    actuator, drawn_in = response.actuator, response.drawn_in
    name, limit, warnings = actuator.specimen.name, pull_in(actuator), []
    time = np.linspace(0.0, response.end, max(2, round(response.end / interval) + 1))
    voltage, deflection = response.voltage(time), response.deflection(time)
    if equal_weights and actuator.count > 1:
        warnings.append("equal weights were taken: the paper's are lost; `tympan alpha` finds "
                        "those of a specimen")
    if drawn_in is not None:
        warnings.append(f"the film is drawn in after {drawn_in:.4g} s: a step overshoots what a "
                        "slow ramp may reach; lower the voltage")
    loop = area = None
    if period is not None and drawn_in is None:
        u, y = response.last_period(period)
        loop = pd.DataFrame({"specimen": name, "voltage": u, "deflection": y})
        # ∮ y du: positive where the deflection lags behind.
        area = float(-np.sum((y[1:] + y[:-1]) / 2 * np.diff(u)))
        if abs(y[-1] - y[0]) > _CLOSED * np.ptp(y):
            warnings.append(f"the last period ends {1e6 * (y[-1] - y[0]):+.3g} um from where it "
                            "began: the film still creeps; more periods (--count) close the loop")
    if limit is not None and deflection[-1] > limit[1]:
        warnings.append(f"the film was drawn in: it ends beyond {1e3 * limit[1]:.4g} mm, where "
                        "pull-in begins")
    settled = settling_time(time, deflection) if step else np.nan
    flat = flat_capacitance(actuator.specimen)
    numbers = {
        "specimen": name,
        "mass_kg": actuator.mass,
        "circles": actuator.circles.radius.tolist(),
        "alpha": list(actuator.weights),
        "status": "done" if drawn_in is None else "drawn_in",
        "first_m": float(deflection[0]),
        "last_m": float(deflection[-1]),
        "range_m": float(np.ptp(deflection)),
        "settling_time_s": settled if np.isfinite(settled) else None,
        "hysteresis_area_V_m": area,
        "pull_in_film_voltage_V": None if limit is None else limit[0],
        "flat_capacitance_F": flat,
        "flat_stored_energy_J": flat * float(np.abs(voltage).max()) ** 2 / 2,
        "linear": linearise(actuator, response.signal.first).json(),
        "evaluations": response.evaluations,
        "warnings": warnings,
    }
    samples = pd.DataFrame({
        "specimen": name, "mass": actuator.mass, "run": "simulated", "t": time,
        "voltage": voltage, "displacement": actuator.rig.reading(deflection, time)})
    return SampledResponse(numbers, samples, loop)


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """Responses of one actuator each, all to the same signal."""

    responses: tuple[SampledResponse, ...]

    def json(self) -> dict[str, Any]:
        """The object of ``lumped simulate --json``."""
        return {"responses": [response.numbers for response in self.responses]}

    def save(self, folder: Path) -> None:
        """Write simulate.json, transient.csv, which datasets may hold, and of loops hysteresis.csv.

        simulate.json comes last, so its presence means the rest is complete.
        """
        remove(folder, "simulate.json", "hysteresis.csv")
        write_sheet(folder / "transient.csv", _COLUMNS,
                    pd.concat([response.samples for response in self.responses]))
        loops = [response.loop for response in self.responses if response.loop is not None]
        if loops:
            write_sheet(folder / "hysteresis.csv", _LOOP_COLUMNS, pd.concat(loops))
        write_json(folder / "simulate.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> SimulationResult:
        """What was saved; what is missing, damaged or of another kind is an InputError."""
        content = read_json(folder / "simulate.json")
        if not isinstance(content, dict) or not content.get("responses"):
            raise InputError("is not of tympan lumped simulate: run it again",
                             file=folder / "simulate.json")
        samples = pd.DataFrame(read_own_sheet(folder / "transient.csv", _COLUMNS))
        loops, file = {}, folder / "hysteresis.csv"
        if file.exists():
            periods = pd.DataFrame(read_own_sheet(file, _LOOP_COLUMNS))
            loops = dict(iter(periods.groupby("specimen")))
        return cls(tuple(
            SampledResponse(numbers, samples[samples["specimen"] == numbers["specimen"]],
                            loops.get(numbers["specimen"]))
            for numbers in content["responses"]))
