"""Eq. (5) in time: responses to any signal, creep alone, and what they tell, saved and loaded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tympan.fem.rig import Rig
from tympan.fem.roots import root_between
from tympan.fem.toml_writer import specimen_content, toml
from tympan.geometry.errors import InputError
from tympan.geometry.fields import write
from tympan.geometry.specimen import Specimen
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.files import read_json, remove, write_json, write_text
from tympan.studies.lumped.actuator import Actuator, flat_capacitance
from tympan.studies.lumped.collocation import CollocationSolver, DrawnIn, Motion, first_mesh
from tympan.studies.lumped.equilibria import (
    highest,
    limit_words,
    pull_in,
    rest,
    settle,
)
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.remarks import origin, remark
from tympan.studies.signals import Signal

Array = NDArray[np.float64]
_PRECISION = 1e-11  # of a response [m]
_WINDOW = 4000  # steps of a first mesh that are solved at once
_FINER = 8
_SETTLED = 0.05
_SAMPLES = 400  # of a period
_WITHIN = 8  # times of a step at which extremes are sought
_SHORTEST = 1e-9  # [s]: a film that cannot be followed for so long is gone
#: Samples of one file: with its nine columns it stays within what a table may have.
_MOST = 1_000_000
#: Samples that are computed at once.
_TOGETHER = 100_000
_WORK = 10_000_000  # evaluations of the rates: the better part of a minute
_LIGHTEST = 1e-6  # [kg]
#: A loop that drifts by less than this share of its range counts as closed.
_CLOSED = 0.01
#: How long before a jump at once the rest is sampled, over the interval of samples.
_EARLY = 1e-3
_COLUMNS = (Column.labels("specimen"), Column("mass", "g"), Column.labels("run"),
            Column("t", "s"), Column("voltage", "kV"), Column("displacement", "mm"),
            Column("rest", "s", required=False), Column("film_voltage", "kV", required=False),
            Column("current", "uA", required=False))
_LOOP_COLUMNS = (Column.labels("specimen"), Column("voltage", "kV"), Column("deflection", "mm"))


@dataclass(frozen=True, eq=False)
class Response:
    """What an actuator did: dense in time. ``drawn_in`` is when it left the model's reach [s].

    ``ends`` are the times between ``motions``, from 0 to when it is over [s].
    """

    actuator: Actuator
    signal: Signal
    ends: Array
    motions: tuple[Motion, ...]
    evaluations: int
    drawn_in: float | None = None

    @property
    def end(self) -> float:
        return float(self.ends[-1])

    def state(self, time: Array) -> Array:
        """States at times [s], shape (times, 2 + circles)."""
        time = np.asarray(time, float)
        number = np.clip(np.searchsorted(self.ends, time, "right") - 1, 0, len(self.motions) - 1)
        result = np.empty((len(time), 2 + self.actuator.count))
        for each in np.unique(number):
            result[number == each] = self.motions[each].state(time[number == each])
        return result

    def voltage(self, time: Array) -> Array:
        """The signal at times [V]; at a jump what comes after it."""
        breaks = self.signal.breaks
        piece = np.clip(np.searchsorted(breaks, time, "right") - 1, 0, len(breaks) - 2)
        return np.asarray(self.signal.within(piece, np.asarray(time, float)))

    def deflection(self, time: Array) -> Array:
        """y at times [m]."""
        parts = np.array_split(time, len(time) // _TOGETHER + 1)
        return np.concatenate([self.state(part)[:, 0] for part in parts])

    @property
    def extremes(self) -> tuple[float, float]:
        """The smallest and the largest deflection [m], between samples too."""
        shares = np.linspace(0.0, 1.0, _WITHIN, endpoint=False)
        ends: list[Array] = [self.deflection(np.array([0.0, self.end]))]
        for motion in self.motions:
            times = (motion.time[:-1, None] + np.diff(motion.time)[:, None] * shares).ravel()
            y = motion.deflection(times.clip(0, self.end))[0]
            ends.append(np.array([y.min(), y.max()]))
        return float(np.min(ends)), float(np.max(ends))

    def last_period(self, period: float) -> tuple[Array, Array]:
        """Voltages [V] and deflections [m] of the last whole period [s] of a sine."""
        time = np.linspace(self.end - period, self.end, _SAMPLES + 1)
        return self.voltage(time), self.deflection(time)


def simulate(actuator: Actuator, signal: Signal, start: Array | None = None,
             precision: float = _PRECISION,
             progress: Callable[[float], None] = lambda share: None) -> Response:
    """The response to a signal, by default from rest at its first voltage, to a precision [m].

    By collocation over many steps at once. ``progress`` is called with the share of the signal that
    is over. A motion that leaves the model's reach ends there: ``Response.drawn_in``. A signal
    beyond pull-in or the model's reach is refused: no rest holds the film there. So is a mass next
    to nothing, and what would take minutes.
    """
    if actuator.moved < _LIGHTEST:
        raise InputError("must move at least 1 mg: the model has no mass but this, not the film's",
                         key=actuator.label)
    peak = abs(float(actuator.rig.film_voltage(signal.peak)))
    if peak > highest(actuator):
        reason = f"the signal goes too high: {limit_words(actuator)}"
        raise InputError(actuator.case(signal.peak).doubted(reason), key=actuator.label,
                         given=f"{peak / 1e3:.5g} kV")
    state = actuator.rest(rest(actuator, signal.first)) if start is None else start
    solver = CollocationSolver(signal, precision, most=_WORK)
    solver.check(len(signal.breaks) - 1)
    mesh = first_mesh(actuator, state, signal)
    ends, motions = [0.0], list[Motion]()
    steps, drawn_in = _WINDOW, None
    while drawn_in is None and len(mesh) > 1:
        window = mesh[:steps + 1]
        try:
            motion = solver.solve(actuator, state[:, None], window)
        except DrawnIn as gone:
            # On to where there is a motion yet, in finer steps, which may follow it further.
            whole = max(int(np.searchsorted(window, gone.time, "right")) - 1, 1)
            if window[whole] - window[0] < _SHORTEST:
                drawn_in = float(window[0])
                break
            finer = np.interp(np.linspace(0, whole, _FINER * whole + 1), np.arange(whole + 1),
                              window[:whole + 1])
            mesh, steps = np.concatenate([finer, mesh[whole + 1:]]), _FINER * whole
            continue
        drawn_in = _leaves(motion, actuator.reach)
        mesh, steps, state = mesh[len(window) - 1:], _WINDOW, motion.nodes[-1]
        ends.append(float(window[-1]) if drawn_in is None else drawn_in)
        motions.append(motion)
        progress(ends[-1] / signal.end)
    return Response(actuator, signal, np.array(ends), tuple(motions), solver.evaluations, drawn_in)


def _leaves(motion: Motion, reach: float) -> float | None:
    beyond = np.flatnonzero(np.abs(motion.nodes[:, 0]) >= reach)
    if not len(beyond):
        return None
    ends = motion.time[max(int(beyond[0]) - 1, 0)], motion.time[beyond[0]]
    def room(time: float) -> float:
        return reach - abs(float(motion.deflection(np.array([time]))[0][0]))

    moment = root_between(room, *ends)
    return float(ends[1]) if moment is None else moment


def slow_ends(actuator: Actuator, signal: Signal) -> Array:
    """Deflections [m] at the ends of a signal's pieces, the rest before it first, without inertia.

    And without η₂: only the branches move, where the oscillation after a jump is gone. Of any array
    of actuators, shape (pieces + 1, …); nan where there is no rest.
    """
    y = settle(lambda at: actuator.balance(at, signal.first), actuator.flat)
    strains = actuator.rest(y)[..., 2:]
    rate, shape = actuator.viscous.k1 / actuator.viscous.eta1, strains.shape
    deflections = [y]

    def settled(voltage: float, start: Array, strains: Array) -> Array:
        return np.asarray(settle(lambda y: actuator.balance(y, voltage, strains), start))

    for piece, (begin, end) in enumerate(pairwise(signal.breaks)):
        def rates(time: float, flat: Array, piece: int = piece) -> Array:
            nonlocal y
            at = flat.reshape(shape)
            y = settled(signal.within(piece, time), y, at)
            behind = actuator.circles.stretch(y[..., None])[0] - 1 - at
            return np.asarray(np.nan_to_num(rate * behind).ravel())

        done = solve_ivp(rates, (begin, end), np.nan_to_num(strains).ravel(), "DOP853",
                         rtol=1e-8, atol=1e-11)
        strains = done.y[:, -1].reshape(shape)
        y = settled(signal.within(piece, end), y, strains)
        deflections.append(y)
    return np.array(deflections)


def settling_time(time: Array, deflection: Array) -> float:
    """When the oscillation about the slow motion last exceeds 5 % of its largest swing [s].

    Counted from time[0]; nan where there is no oscillation, or it is not over yet. The slow motion
    is that through the midpoints of neighbouring extremes, as one draws it by eye: the membrane
    goes on creeping long after the oscillation has died away.
    """
    turning = np.flatnonzero(np.diff(np.sign(np.diff(deflection))) != 0) + 1
    if len(turning) < 3:
        return float("nan")
    heights, times = deflection[turning], time[turning]
    swing = np.abs(np.diff(heights)) / 2
    if swing.max() < 1e-9 * np.abs(deflection).max():
        return float("nan")
    large = np.flatnonzero(swing > _SETTLED * swing.max())
    if large[-1] == len(swing) - 1 and time[-1] - times[-1] < 2 * (times[-1] - times[-2]):
        return float("nan")
    return float((times[large[-1]] + times[large[-1] + 1]) / 2 - time[0])


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


def sample_count(end: float, interval: float, runs: int = 1) -> int:
    """How many samples a response up to ``end`` gives with an interval [s].

    An :class:`InputError` where so many ``runs`` give more than a million.
    """
    if runs * end / interval > _MOST:
        raise InputError(f"would give more than {_MOST} samples", key="--interval",
                         given=f"{interval:g} s")
    return max(2, round(end / interval) + 1)


def with_rest(signal: Signal, time: Array, voltage: Array, deflection: Array, before: float
              ) -> tuple[Array, Array, Array]:
    """Times [s], voltages [V] and deflections [m] of samples, begun at rest if they are not.

    A run of a dataset begins at rest under its first voltage. Where the signal jumps at once, its
    first sample is after the jump already, and another comes in front: ``before`` [m], at rest.
    """
    if voltage[0] == signal.first:
        return time, voltage, deflection
    early = time[0] - _EARLY * (time[1] - time[0])
    return (np.append(early, time), np.append(signal.first, voltage),
            np.append(before, deflection))


def sample(response: Response, interval: float, period: float | None = None,
           step: bool = False, remarks: Sequence[str] = ()) -> SampledResponse:
    """A response with an interval [s], and what it tells.

    ``period`` is its signal's [s] if it has one; ``step`` says that the signal is a step, after
    which an oscillation settles; ``remarks`` are on how the actuator was chosen.
    """
    actuator, drawn_in = response.actuator, response.drawn_in
    name, first = actuator.specimen.name, response.signal.first
    limit, (lowest, highest_reached) = pull_in(actuator), response.extremes
    time = np.linspace(0.0, response.end, sample_count(response.end, interval))
    voltage, deflection = response.voltage(time), response.deflection(time)
    warnings = [*remarks]
    if drawn_in is not None:
        warnings.append(remark("drawn_in", time=drawn_in))
    loop = _loop(response, period) if period is not None and drawn_in is None else None
    if loop is not None:
        y = loop["deflection"].to_numpy()
        if abs(y[-1] - y[0]) > _CLOSED * np.ptp(y):
            warnings.append(remark("open_loop", gap=1e6 * (y[-1] - y[0])))
    if limit is not None and deflection[-1] > limit[1]:
        warnings.append(remark("beyond_pull_in", limit=1e3 * limit[1]))
    settled = settling_time(time, deflection) if step else np.nan
    flat = flat_capacitance(actuator.specimen)
    numbers = {
        "specimen": name,
        "mass_kg": actuator.mass,
        "circles": actuator.circles.radius.tolist(),
        "alpha": list(actuator.weights),
        "status": "done" if drawn_in is None else "drawn_in",
        "first_voltage_V": first,
        "first_m": float(deflection[0]),
        "last_m": float(deflection[-1]),
        "lowest_m": lowest,
        "highest_m": highest_reached,
        "range_m": highest_reached - lowest,
        "settling_time_s": settled if np.isfinite(settled) else None,
        "hysteresis_area_V_m": None if loop is None else _area(loop),
        "pull_in_film_voltage_V": None if limit is None else limit[0],
        "flat_capacitance_F": flat,
        "flat_stored_energy_J": flat * float(np.abs(voltage).max()) ** 2 / 2,
        "linear": linearise(actuator, first, by="U" if first else "U2").json(),
        "evaluations": response.evaluations,
        "warnings": [*warnings, *origin(actuator), *actuator.case(response.signal.peak).remarks],
    }
    # Its plate has inertia: at a jump it has not moved yet.
    time, voltage, deflection = with_rest(response.signal, time, voltage, deflection,
                                          float(deflection[0]))
    samples = pd.DataFrame({
        "specimen": name, "mass": actuator.mass, "run": "simulated", "t": time,
        "voltage": voltage, "displacement": actuator.rig.reading(deflection, time)})
    return SampledResponse(numbers, samples, loop)


def _loop(response: Response, period: float) -> pd.DataFrame:
    voltage, deflection = response.last_period(period)
    return pd.DataFrame({"specimen": response.actuator.specimen.name, "voltage": voltage,
                         "deflection": deflection})


def _area(loop: pd.DataFrame) -> float:
    """∮ y du [V m]: positive where the deflection lags behind."""
    u, y = loop["voltage"].to_numpy(), loop["deflection"].to_numpy()
    return float(-np.sum((y[1:] + y[:-1]) / 2 * np.diff(u)))


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """Responses of one actuator each, all to the same signal.

    With ``specimens``, on a ``rig``, what is saved is a dataset.
    """

    file: ClassVar[str] = "simulate.json"
    writer: ClassVar[str] = "tympan lumped simulate"

    responses: tuple[SampledResponse, ...]
    specimens: tuple[Specimen, ...] = ()
    rig: Rig = Rig()

    def json(self) -> dict[str, Any]:
        return {"responses": [response.numbers for response in self.responses]}

    def save(self, folder: Path) -> None:
        """Write the numbers, transient.csv, dataset.toml beside it, and of loops hysteresis.csv.

        The numbers come last, so their presence means the rest is complete.
        """
        remove(folder, self.file, "hysteresis.csv")
        samples = pd.concat([response.samples for response in self.responses])
        write_sheet(folder / "transient.csv",
                    [column for column in _COLUMNS if column.name in samples], samples)
        loops = [response.loop for response in self.responses if response.loop is not None]
        if loops:
            write_sheet(folder / "hysteresis.csv", _LOOP_COLUMNS, pd.concat(loops))
        if self.specimens:
            with suppress(InputError):  # a dataset that is there already stays as it is
                write_text(folder / "dataset.toml", toml({
                    "name": "simulated", "source": self.writer, "rig": write(self.rig),
                    "specimen": [specimen_content(specimen) for specimen in self.specimens]}))
        write_json(folder / self.file, self.json())

    @classmethod
    def load(cls, folder: Path) -> Self:
        """What was saved; what is missing, damaged or of another kind is an InputError."""
        content = read_json(folder / cls.file)
        if not isinstance(content, dict) or not content.get("responses"):
            raise InputError(f"is not of {cls.writer}: run it again", file=folder / cls.file)
        samples = pd.DataFrame(read_own_sheet(folder / "transient.csv", _COLUMNS)).dropna(
            axis="columns", how="all")
        loops, file = {}, folder / "hysteresis.csv"
        if file.exists():
            periods = pd.DataFrame(read_own_sheet(file, _LOOP_COLUMNS))
            loops = dict(iter(periods.groupby("specimen")))
        return cls(tuple(
            SampledResponse(numbers, samples[samples["specimen"] == numbers["specimen"]],
                            loops.get(numbers["specimen"]))
            for numbers in content["responses"]))
