"""Motion of film and plate in time, in steps as long as an error estimate allows.

A massless film is in equilibrium with the plate at every moment; its viscous branches flow
(:mod:`tympan.fem.film.memory`), the plate moves by the trapezoidal rule
(:class:`~tympan.fem.membrane.rigid_plate.Swing`), a circuit charges the film by the same rule. All
are of second order, so that what the last three moments foretell misses by 13 times the error of a
step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tympan.fem.equilibrium.constraints import difference, length
from tympan.fem.equilibrium.newton import NewtonSettings, Solution, moved, newton
from tympan.fem.film.density import from_virgin
from tympan.fem.film.memory import Flow, Memory
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.rigid_plate import RigidPlate, Swing
from tympan.fem.membrane.state import HEAVE, State

Array = NDArray[np.float64]


class Signal(Protocol):
    """A voltage in time: smooth within pieces between ``breaks`` [s], which may have jumps."""

    @property
    def breaks(self) -> Array:
        """Times between which it is smooth [s], shape (pieces + 1,)."""

    def within(self, piece: Any, time: Any) -> Any:
        """Voltages [V] at times of a piece, its ends included."""


@dataclass(frozen=True)
class Circuit:
    """Between source and film: a series ``resistance`` and what ``leakage`` passes by it [Ω]."""

    resistance: float = 0.0
    leakage: float = np.inf

    def current(self, source: float, film: float) -> float:
        """Into the electrodes [A] at voltages of source and film [V]; 0 without resistance."""
        return (source - film) / self.resistance - film / self.leakage if self.resistance else 0.0

    def charged(self, source: float, charge: float, current: float, capacitance: float,
                duration: float) -> float:
        """The film's voltage [V] at the end of a step from a charge [C] and a current [A]."""
        if not self.resistance:
            return source
        half = duration / 2
        conductance = 1 / self.resistance + 1 / self.leakage
        return ((charge + half * (current + source / self.resistance))
                / (capacitance + half * conductance))


@dataclass(frozen=True)
class StepSettings:
    """Steps in time.

    ``error``: of a step's motion, relative to the frame's half extent, and of the branches'
    strain; ``first`` and ``shortest``: steps as shares of the shortest time that matters;
    ``growth`` of a step at most; ``charging``: of the film's voltage, at which its iteration ends,
    relative.
    """

    error: float = 1e-6
    first: float = 1e-3
    shortest: float = 1e-9
    growth: float = 2.0
    charging: float = 1e-10
    newton: NewtonSettings = field(default_factory=NewtonSettings)


@dataclass(frozen=True, eq=False)
class Moment:
    """Film and plate at a time [s].

    ``velocity`` and ``acceleration`` of the plate's six freedoms; ``charge`` on the electrodes [C],
    0 without a circuit, and the ``current`` into them [A].
    """

    time: float
    state: State
    memory: Memory
    velocity: Array
    acceleration: Array
    voltage: float
    charge: float = 0.0
    current: float = 0.0


class Stopped(ArithmeticError):
    """The motion cannot be followed further: the film pulls in, or loses its tension."""


@dataclass(frozen=True, eq=False)
class Transient:
    """A film under a force [N] and a source's signal, from a state and what it remembers.

    ``plate``: its mass, None for one without inertia; ``damper`` on its heave [N s/m].
    """

    model: Model
    force: float
    signal: Signal
    plate: RigidPlate | None = None
    damper: float = 0.0
    circuit: Circuit = Circuit()
    settings: StepSettings = StepSettings()

    def moments(self, state: State, memory: Memory) -> Iterator[Moment]:
        """From a state at the signal's beginning to its end; after a jump the same time again."""
        breaks = self.signal.breaks
        moment = Moment(float(breaks[0]), state, memory, np.zeros(6), np.zeros(6),
                        float(np.sqrt(state.voltage_squared)))
        if self.circuit.resistance:
            charge = float(self.model.capacitance(state)) * moment.voltage
            moment = replace(moment, charge=charge)
        for piece, (begin, end) in enumerate(zip(breaks[:-1], breaks[1:], strict=True)):
            moment = self._after_jump(moment, float(self.signal.within(piece, begin)))
            yield moment
            for moment in self._through(moment, piece, float(end)):
                yield moment

    def _through(self, moment: Moment, piece: int, end: float) -> Iterator[Moment]:
        """A piece of the signal, in steps."""
        settings, past = self.settings, [moment]
        scale = min([end - moment.time, *self.model_times(moment)])
        step = settings.first * scale
        while past[-1].time < end:
            rest = end - past[-1].time
            duration = rest if step > 0.75 * rest else min(step, rest / 2 if step > rest / 2
                                                           else step)
            following = self._step(past, piece, duration)
            error = np.inf if following is None else self._error(past, following)
            if following is not None and error <= settings.error:
                yield following
                past = [*past[-2:], following]
            elif duration < settings.shortest * scale:
                raise Stopped(f"at {past[-1].time:g} s")
            change = 0.9 * (settings.error / max(error, 1e-300)) ** (1 / 3)
            step = duration * min(max(change, 0.2), settings.growth)

    def model_times(self, moment: Moment) -> list[float]:
        """Times that matter [s]: of the branches, and of the plate's swing."""
        times = [float(time) for time in moment.memory.times]
        if self.plate is not None:
            tangent = self._solved(self.model, moment.state)
            heave = self.model.plate_freedoms.index(HEAVE)
            stiffness = tangent.tangent.plate_stiffness[heave, heave] if tangent.tangent else 0.0
            stiffness *= self.model.discretisation.mirrored
            if stiffness > 0:
                times.append(float(np.sqrt(self.plate.mass / stiffness)))
        return times

    def _after_jump(self, moment: Moment, source: float) -> Moment:
        """The film at once after the source's voltage jumped, the plate held by its inertia."""
        voltage = moment.voltage if self.circuit.resistance else source
        state = moment.state.under(voltage=voltage**2, force=self.force)
        stretch = self._stretch(moment.state)
        model = replace(self.model, flow=moment.memory.step(stretch, 0.0))
        if self.plate is not None:
            held = replace(model, loading=replace(model.loading, guide="fixed"))
            solution = self._solved(held, state)
            film = solution.state
            _, outer = model.residual(model.nodal_forces(film), film)
            allowed = list(model.plate_freedoms)
            mass = self.plate.matrix(film.plate)[np.ix_(allowed, allowed)]
            acceleration = np.zeros(6)
            acceleration[allowed] = np.linalg.solve(
                mass, -outer * model.discretisation.mirrored
                - self._damping[np.ix_(allowed, allowed)] @ moment.velocity[allowed])
            moment = replace(moment, acceleration=acceleration)
        else:
            film = self._jumped(model, moment.state, state)
        current = self.circuit.current(source, voltage)
        return replace(moment, state=film, voltage=voltage, current=current)

    def _jumped(self, model: Model, before: State, after: State) -> State:
        """From one set of loads to another at once, in as many steps as it takes."""
        share, step, state = 0.0, 1.0, before
        while share < 1:
            ahead = min(1.0, share + step)
            loads = {name: before.load(name) + ahead * (after.load(name) - before.load(name))
                     for name in ("force", "voltage")}
            solution = newton(model, state.under(**loads), settings=self.settings.newton)
            if solution.converged and solution.stable:
                state, share, step = solution.state, ahead, 2 * step
            elif (step := step / 2) < 1e-4:
                raise Stopped("the film has no equilibrium at once after the jump")
        return state

    def _step(self, past: list[Moment], piece: int, duration: float) -> Moment | None:
        """The moment after a duration [s], None where the film cannot be followed."""
        moment = past[-1]
        time = moment.time + duration
        source = float(self.signal.within(piece, time))
        flow = moment.memory.step(self._stretch(moment.state), duration)
        model = self._moving(moment, flow, duration)
        guess = self._foretold(past, time)
        voltage, capacitance = source, 0.0
        if self.circuit.resistance:
            capacitance = float(self.model.capacitance(guess))
        for _ in range(20):
            voltage = self.circuit.charged(source, moment.charge, moment.current, capacitance,
                                           duration)
            solution = newton(model, guess.under(voltage=voltage**2, force=self.force),
                              settings=self.settings.newton)
            if not solution.converged or not solution.stable:
                return None
            guess = solution.state
            if not self.circuit.resistance:
                break
            before, capacitance = capacitance, float(self.model.capacitance(guess))
            if abs(capacitance - before) <= self.settings.charging * capacitance:
                break
        else:
            return None
        swing = model.loading.swing
        velocity, acceleration = ((np.zeros(6), np.zeros(6)) if swing is None
                                  else swing.after(guess.plate))
        return Moment(time, guess, flow.after(self._stretch(guess)), velocity, acceleration,
                      voltage, capacitance * voltage, self.circuit.current(source, voltage))

    def _moving(self, moment: Moment, flow: Flow, duration: float) -> Model:
        """The model with the branches' and the plate's part in a step."""
        model = replace(self.model, flow=flow)
        if self.plate is None and not self.damper:
            return model
        mass = np.zeros((6, 6)) if self.plate is None else self.plate.matrix(moment.state.plate)
        swing = Swing(moment.state.plate, moment.velocity, moment.acceleration, mass,
                      self._damping, duration)
        return replace(model, loading=replace(model.loading, swing=swing))

    def _foretold(self, past: list[Moment], time: float) -> State:
        """The state at a time by the parabola through the last three, or as many as there are."""
        last = past[-1]
        motion: Parts = (np.zeros(self.model.discretisation.free_count),
                         np.zeros(len(self.model.plate_freedoms)))
        for moment, share in zip(past, _lagrange([moment.time for moment in past], time),
                                 strict=True):
            film, plate = difference(self.model, moment.state, last.state)
            motion = motion[0] + share * film, motion[1] + share * plate
        return moved(self.model, last.state, motion)

    def _error(self, past: list[Moment], following: Moment) -> float:
        """Of a step, relative: from how much it differs from what was foretold."""
        foretold = self._foretold(past, following.time)
        motion = length(self.model, difference(self.model, following.state, foretold))
        viscous = sum(share * moment.memory.viscous for moment, share in zip(
            past, _lagrange([moment.time for moment in past], following.time), strict=True))
        strain = np.sqrt(np.mean((following.memory.viscous - viscous) ** 2
                                 / following.memory.viscous**2)) if viscous.size else 0.0
        return max(motion, 0.1 * float(strain)) / 13

    @property
    def _damping(self) -> Array:
        damping = np.zeros((6, 6))
        damping[HEAVE, HEAVE] = self.damper
        return damping

    def _stretch(self, state: State) -> Any:
        return from_virgin(self.model.cauchy_green(state.positions),
                           self.model.specimen.membrane.prestretch)

    def _solved(self, model: Model, guess: State) -> Solution:
        solution = newton(model, guess, settings=self.settings.newton)
        if not solution.converged:
            raise Stopped(solution.advice)
        return solution


def _lagrange(times: list[float], time: float) -> list[float]:
    """Weights of values at some times in their polynomial's value at another one."""
    return [float(np.prod([(time - other) / (each - other) for other in times if other != each]))
            for each in times]
