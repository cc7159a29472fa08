"""Eq. (5) in time: responses to any signal, creep alone, and the numbers of a response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import MAY_MISS, Key
from tympan.base.progress import ShareDone
from tympan.fem.roots import root_between
from tympan.fem.transient.ends import Stopped, status_of
from tympan.studies.lumped.actuator import Actuator, flat_capacitance
from tympan.studies.lumped.collocation import CollocatedMotion, CollocationSolver, first_mesh
from tympan.studies.lumped.equilibria import (
    highest,
    limit_words,
    pull_in,
    rest,
    settle,
)
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.remarks import origin, remark
from tympan.studies.signals import Signal, nominal
from tympan.studies.trace import Response, sample_count, unclosed, with_rest

#: Precision of a response [m].
_PRECISION = 1e-11
#: Steps of a first mesh that are solved at once.
_WINDOW = 4000
#: Factor by which steps are refined where the motion stops.
_FINER = 8
#: Samples of a period.
_SAMPLES = 400
#: Times of a step between which extremes are sought.
_WITHIN = 8
#: Shortest time [s] of a motion: a film that cannot be followed for this long has pulled in.
_SHORTEST = 1e-9
#: Number of samples that are computed at once.
_TOGETHER = 100_000
#: Most evaluations of the rates: nearly a minute.
_WORK = 10_000_000
#: Smallest moving mass [kg].
_LIGHTEST = 1e-6


@dataclass(frozen=True, eq=False)
class LumpedMotion:
    """Motion of an actuator, dense in time.

    ``ends`` holds the times [s] between ``motions``, from 0 to the end. ``stopped`` says where the
    motion left the model's reach; None where it did not.
    """

    actuator: Actuator
    signal: Signal
    ends: Array
    motions: tuple[CollocatedMotion, ...]
    evaluations: int
    stopped: Stopped | None = None

    @property
    def end(self) -> float:
        return float(self.ends[-1])

    def state(self, time: Array) -> Array:
        """Interpolate states at times [s], shape (times, size)."""
        time = np.asarray(time, float)
        number = np.clip(np.searchsorted(self.ends, time, "right") - 1, 0, len(self.motions) - 1)
        result = np.empty((len(time), self.actuator.size))
        for each in np.unique(number):
            result[number == each] = self.motions[each].state(time[number == each])
        return result

    def voltage(self, time: Array) -> Array:
        """Evaluate the signal at times [V]; at a jump it has the value after it."""
        return nominal(self.signal, time)

    def deflection(self, time: Array) -> Array:
        """Interpolate y at times [m]."""
        parts = np.array_split(time, len(time) // _TOGETHER + 1)
        return np.concatenate([self.state(part)[:, 0] for part in parts])

    @property
    def extremes(self) -> tuple[float, float]:
        """The smallest and the largest deflection [m], between samples too."""
        shares = np.linspace(0.0, 1.0, _WITHIN, endpoint=False)
        found: list[Array] = [self.deflection(np.array([0.0, self.end]))]
        for motion in self.motions:
            times = (motion.time[:-1, None] + np.diff(motion.time)[:, None] * shares).ravel()
            times = np.append(times, motion.time[-1]).clip(0, self.end)
            y, speed, _ = motion.deflection(times)
            turns = np.flatnonzero(speed[1:] * speed[:-1] < 0)
            # At an extreme the deflection is flat: an error of its time hardly counts.
            passed = speed[turns] / (speed[turns] - speed[turns + 1])
            turned = times[turns] + passed * np.diff(times)[turns]
            found += [y, motion.deflection(turned)[0]]
        every = np.concatenate(found)
        return float(every.min()), float(every.max())

    def last_loop(self, period: float) -> pd.DataFrame:
        """Sample voltages [V] and deflections [m] of the last whole period [s] of a sine."""
        time = np.linspace(self.end - period, self.end, _SAMPLES + 1)
        return pd.DataFrame({"voltage": self.voltage(time), "deflection": self.deflection(time)})


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelResponse(Response):
    """Response of a lumped model: of circles, or of a film that is reduced to a few shapes.

    Values that a model does not have are None.
    """

    file = "simulate.json"
    writer = "tympan lumped simulate"

    circles: Annotated[tuple[float, ...] | None, Key(
        "radii of the circles [m], of models without a reduced film"), MAY_MISS] = None
    alpha: Annotated[tuple[float, ...] | None, Key("weights of the circles"), MAY_MISS] = None
    pull_in_film_voltage_V: Annotated[float | None, Key(
        "pull-in voltage across the film; none where there is no pull-in"), MAY_MISS] = None
    flat_capacitance_F: Annotated[float | None, Key("capacitance of the flat film"),
        MAY_MISS] = None
    flat_stored_energy_J: Annotated[float | None, Key("energy in that at the largest voltage"),
        MAY_MISS] = None
    linear: Annotated[dict[str, Any] | None, Key("small motions about its beginning"),
        MAY_MISS] = None
    evaluations: Annotated[int | None, Key("evaluations of the rates"), MAY_MISS] = None
    stopped_s: Annotated[float | None, Key("when it stopped before the end"), MAY_MISS] = None
    film_error: Annotated[dict[str, float] | None, Key(
        "error of the reduced film, over the range, by signal"), MAY_MISS] = None
    steps: Annotated[int | None, Key("steps in time"), MAY_MISS] = None


def simulate(actuator: Actuator, signal: Signal, start: Array | None = None,
             precision: float = _PRECISION,
             progress: ShareDone = lambda share: None) -> LumpedMotion:
    """Simulate the response to a signal, by default from rest at its first voltage.

    The method is collocation over many steps at once, to a ``precision`` [m]. ``progress`` is
    called with the finished share of the signal. A motion that leaves the model's reach ends there:
    ``LumpedMotion.stopped``. A signal beyond pull-in or the model's reach is refused, because no
    equilibrium holds the film there. Refused, too, are a nearly zero mass and a signal that would
    take minutes.
    """
    if actuator.moved < _LIGHTEST:
        raise InputError("must move at least 1 mg: the model has no mass but this, not the film's",
                         key=actuator.label)
    peak = abs(float(actuator.rig.film_voltage(signal.peak)))
    if peak > highest(actuator):
        reason = f"the signal goes too high: {limit_words(actuator)}"
        raise InputError(actuator.case(signal.peak).doubted(reason), key=actuator.label,
                         given=f"{peak / 1e3:.5g} kV")
    state = start
    if state is None:
        state = actuator.rest(rest(actuator, signal.first), signal.first)
    solver = CollocationSolver(signal, precision, most=_WORK)
    solver.check(len(signal.breaks) - 1)
    mesh = first_mesh(actuator, state, signal)
    ends, motions = [0.0], list[CollocatedMotion]()
    steps, gone = _WINDOW, None
    while gone is None and len(mesh) > 1:
        window = mesh[:steps + 1]
        try:
            motion = solver.solve(actuator, state[:, None], window)
        except Stopped as ending:
            # Solve up to where the motion exists, in finer steps, which may follow it further.
            whole = max(int(np.searchsorted(window, ending.time, "right")) - 1, 1)
            if window[whole] - window[0] < _SHORTEST:
                gone = float(window[0])
                break
            finer = np.interp(np.linspace(0, whole, _FINER * whole + 1), np.arange(whole + 1),
                              window[:whole + 1])
            mesh, steps = np.concatenate([finer, mesh[whole + 1:]]), _FINER * whole
            continue
        gone = _leaves(motion, actuator.reach)
        mesh, steps, state = mesh[len(window) - 1:], _WINDOW, motion.nodes[-1]
        ends.append(float(window[-1]) if gone is None else gone)
        motions.append(motion)
        progress(ends[-1] / signal.end)
    stopped = None if gone is None else Stopped("drawn_in", gone)
    return LumpedMotion(actuator, signal, np.array(ends), tuple(motions), solver.evaluations,
                        stopped)


def _leaves(motion: CollocatedMotion, reach: float) -> float | None:
    beyond = np.flatnonzero(np.abs(motion.nodes[:, 0]) >= reach)
    if not len(beyond):
        return None
    ends = motion.time[max(int(beyond[0]) - 1, 0)], motion.time[beyond[0]]
    def room(time: float) -> float:
        return reach - abs(float(motion.deflection(np.array([time]))[0][0]))

    moment = root_between(room, *ends)
    return float(ends[1]) if moment is None else moment


def slow_ends(actuator: Actuator, signal: Signal) -> Array:
    """Find the deflections [m] at the ends of a signal's pieces, without inertia and η₂.

    The first is the equilibrium before the signal. Only the branches move: each deflection is the
    one after the oscillation of a jump has decayed. The actuators may be an array; the shape is
    (pieces + 1, …). It is nan where there is no equilibrium.
    """
    y = settle(lambda at: actuator.balance(at, signal.first), actuator.flat)
    strains = actuator.strains(actuator.rest(y, signal.first))
    viscous, shape = actuator.viscous, strains.shape
    rate = np.asarray(viscous.k1 / viscous.eta1)[..., None]
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


def sample(response: LumpedMotion, interval: float, period: float | None = None,
           step: bool = False, remarks: Sequence[str] = ()) -> ModelResponse:
    """Sample a response at an interval [s], and compute its numbers.

    ``period`` is the signal's period [s], if it has one. ``step`` says that the signal is a step,
    after which an oscillation settles. ``remarks`` are on how the actuator was chosen.
    """
    actuator, stopped, rig = response.actuator, response.stopped, response.actuator.rig
    name, first = actuator.specimen.name, response.signal.first
    limit = pull_in(actuator)
    time = np.linspace(0.0, response.end, sample_count(response.end, interval))
    voltage, deflection = response.voltage(time), response.deflection(time)
    warnings = [*remarks]
    if stopped is not None:
        warnings.append(str(stopped))
    loop = response.last_loop(period) if period is not None and stopped is None else None
    warnings += [] if loop is None else unclosed(loop)
    if limit is not None and deflection[-1] > limit[1]:
        warnings.append(remark("beyond_pull_in", limit=1e3 * limit[1]))
    flat = flat_capacitance(actuator.specimen)
    # The plate has inertia: at a jump it has not moved yet.
    shown = with_rest(response.signal, time, voltage, deflection, float(deflection[0]))
    return ModelResponse.of(
        response.signal, time, deflection, *response.extremes, step,
        specimen=name, mass_kg=actuator.mass, circles=tuple(actuator.circles.radius.tolist()),
        alpha=tuple(actuator.weights), status=status_of(stopped),
        hysteresis_area_V_m=None if loop is None else _area(loop),
        pull_in_film_voltage_V=np.nan if limit is None else limit[0], flat_capacitance_F=flat,
        flat_stored_energy_J=flat * float(np.abs(voltage).max()) ** 2 / 2,
        linear=linearise(actuator, first, by="U" if first else "U2").motions(),
        evaluations=response.evaluations, loop=loop,
        warnings=(*warnings, *origin(actuator), *rig.in_motion,
                  *actuator.case(response.signal.peak).remarks),
        samples=pd.DataFrame({
            "specimen": name, "mass": actuator.mass, "run": "simulated", "t": shown[0],
            "voltage": shown[1],
            "displacement": rig.recorded(shown[0], shown[2])}))


def _area(loop: pd.DataFrame) -> float:
    """Integrate ∮ y du [V m]: positive where the deflection lags behind."""
    u, y = loop["voltage"].to_numpy(), loop["deflection"].to_numpy()
    return float(-np.sum((y[1:] + y[:-1]) / 2 * np.diff(u)))
