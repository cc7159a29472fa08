"""What simulations of the lumped model found: a result that saves and loads itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.files import read_json, remove, write_json
from tympan.studies.lumped.actuator import flat_capacitance
from tympan.studies.lumped.equilibria import pull_in
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.simulate import Loop, Response, last_loop, settling_time

Array = NDArray[np.float64]
_MOST = 2_000_000
#: A loop that drifts by less than this share of its range counts as closed.
_CLOSED = 0.01
_COLUMNS = (Column.labels("specimen"), Column("mass", "g"), Column.labels("run"),
            Column("t", "s"), Column("voltage", "kV"), Column("displacement", "mm"))
_LOOP_COLUMNS = (Column.labels("specimen"), Column("voltage", "kV"), Column("deflection", "mm"))


@dataclass(frozen=True, eq=False)
class SampledResponse:
    """One actuator's response at times [s]: voltages [V] and what the rig's sensor shows [m].

    ``numbers`` are those of ``lumped simulate --json``; ``loop`` is the last period of a signal
    that has one.
    """

    numbers: dict[str, Any]
    time: Array
    voltage: Array
    reading: Array
    loop: Loop | None = None

    @property
    def name(self) -> str:
        """The specimen's."""
        return str(self.numbers["specimen"])

    @property
    def mass(self) -> float:
        """On the plate [kg]."""
        return float(self.numbers["mass_kg"])

    @property
    def first_voltage(self) -> float:
        """Voltage of the rest it began from [V]."""
        return float(self.numbers["linear"]["voltage_V"])


def sample(response: Response, interval: float, period: float | None = None,
           step: bool = False, equal_weights: bool = False) -> SampledResponse:
    """A response with an interval [s], and what it tells.

    ``period`` is its signal's [s] if it has one; ``step`` says that the signal is a step, after
    which an oscillation settles; ``equal_weights`` that nobody gave any.

    Raises
    ------
    InputError
        When there would be more samples than anybody can use.
    """
    if response.end / interval > _MOST:
        raise InputError(f"would give more than {_MOST} samples", key="--interval",
                         given=f"{interval:g} s")
    actuator = response.actuator
    time = response.samples(interval)
    voltage, deflection = response.voltage(time), response.deflection(time)
    drawn_in, limit = response.drawn_in, pull_in(actuator)
    loop = None if period is None or drawn_in is not None else last_loop(response, period)
    settled = settling_time(time, deflection) if step else np.nan
    flat = flat_capacitance(actuator.specimen)
    warnings = []
    if equal_weights and actuator.count > 1:
        warnings.append("equal weights were taken: the paper's are lost; `tympan alpha` finds "
                        "those of a specimen")
    if drawn_in is not None:
        warnings.append(f"the film is drawn in after {drawn_in:.4g} s: a step overshoots what a "
                        "slow ramp may reach; lower the voltage")
    if loop is not None and abs(loop.drift) > _CLOSED * np.ptp(loop.deflection):
        warnings.append(f"the last period ends {1e6 * loop.drift:+.3g} um from where it began: the "
                        "film still creeps; more periods (--count) close the loop")
    if limit is not None and deflection[-1] > limit[1]:
        warnings.append(f"the film was drawn in: it ends beyond {1e3 * limit[1]:.4g} mm, where "
                        "pull-in begins")
    numbers = {
        "specimen": actuator.specimen.name,
        "mass_kg": actuator.mass,
        "circles": actuator.circles.radius.tolist(),
        "alpha": list(actuator.weights),
        "status": "done" if drawn_in is None else "drawn_in",
        "first_m": float(deflection[0]),
        "last_m": float(deflection[-1]),
        "range_m": float(np.ptp(deflection)),
        "settling_time_s": settled if np.isfinite(settled) else None,
        "hysteresis_area_V_m": None if loop is None else loop.area,
        "pull_in_film_voltage_V": None if limit is None else limit[0],
        "flat_capacitance_F": flat,
        "flat_stored_energy_J": flat * float(np.abs(voltage).max()) ** 2 / 2,
        "linear": linearise(actuator, response.signal.first).json(),
        "evaluations": response.evaluations,
        "warnings": warnings,
    }
    reading = np.asarray(actuator.rig.reading(deflection, time))
    return SampledResponse(numbers, time, voltage, reading, loop)


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
        runs = self.responses
        counts = [len(run.time) for run in runs]
        names = [run.name for run in runs]
        write_sheet(folder / "transient.csv", _COLUMNS, {
            "specimen": np.repeat(names, counts),
            "mass": np.repeat([run.mass for run in runs], counts),
            "run": np.repeat("simulated", sum(counts)),
            "t": np.concatenate([run.time for run in runs]),
            "voltage": np.concatenate([run.voltage for run in runs]),
            "displacement": np.concatenate([run.reading for run in runs])})
        loops = [(run.name, run.loop) for run in runs if run.loop is not None]
        if loops:
            write_sheet(folder / "hysteresis.csv", _LOOP_COLUMNS, {
                "specimen": np.repeat([name for name, _ in loops],
                                      [len(loop.voltage) for _, loop in loops]),
                "voltage": np.concatenate([loop.voltage for _, loop in loops]),
                "deflection": np.concatenate([loop.deflection for _, loop in loops])})
        write_json(folder / "simulate.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> SimulationResult:
        """What was saved.

        Raises
        ------
        InputError
            When a file is missing, damaged or of another kind.
        """
        content = read_json(folder / "simulate.json")
        if not isinstance(content, dict) or not content.get("responses"):
            raise InputError("is not of tympan lumped simulate: run it again",
                             file=folder / "simulate.json")
        samples = read_own_sheet(folder / "transient.csv", _COLUMNS)
        file = folder / "hysteresis.csv"
        loops = read_own_sheet(file, _LOOP_COLUMNS) if file.exists() else None
        responses = []
        for numbers in content["responses"]:
            rows = samples["specimen"] == numbers["specimen"]
            loop = None
            if loops is not None and (chosen := loops["specimen"] == numbers["specimen"]).any():
                loop = Loop(loops["voltage"][chosen], loops["deflection"][chosen])
            responses.append(SampledResponse(numbers, samples["t"][rows], samples["voltage"][rows],
                                             samples["displacement"][rows], loop))
        return cls(tuple(responses))
