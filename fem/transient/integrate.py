"""Motion of film and plate in time, in steps whose length an error estimate controls.

A massless film is in equilibrium with the plate at every moment. Its viscous branches flow
(:mod:`tympan.fem.film.memory`). The plate moves by the trapezoidal rule
(:class:`~tympan.fem.membrane.rigid_plate.Swing`), and a circuit charges the film by the same rule
(:mod:`tympan.fem.circuit`). All these rules are of second order.

Every step is made once as a whole and once in two halves. The difference of their ends is the error
that controls the steps' length. The motion continues from (4 halves − whole)/3 (Hairer, Nørsett and
Wanner, *Solving Ordinary Differential Equations I*, §II.4). With the trapezoidal rule, components
that decay much faster than a step would grow by 5/3 in each step. If damper or circuit cause such a
decay, the rule is damped (:mod:`tympan.fem.membrane.damped_rule`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.fem.circuit import Circuit, SourceSignal, highest_voltage
from tympan.fem.equilibrium.constraints import (
    Constraint,
    difference,
    held_charge,
    held_plate,
    length,
)
from tympan.fem.equilibrium.newton import (
    NewtonSettings,
    Solution,
    moved,
    newton,
    simplified_newton,
    tangent_at,
)
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import without_mechanism
from tympan.fem.equilibrium.snap import landed
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.film.density import small_strain_modulus
from tympan.fem.film.memory import Flow, Memory, determinant
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.rigid_plate import RigidPlate, Swing, carried_along
from tympan.fem.membrane.state import HEAVE, Load, State
from tympan.fem.transient.dense_output import weights
from tympan.fem.transient.ends import Stopped
from tympan.fem.transient.film_memory import virgin_strain
from tympan.fem.transient.stepper import StepControl, moments

#: Weight of the branches' relative strain in the error, where the plate's motion over the frame has
#: weight 1. A strain of a tenth counts like a motion of a hundredth of the frame. Set by trial.
_STRAIN = 0.1
#: Weight in the error of the charge's change over the largest possible charge. Set by trial.
_CHARGE = 0.1

#: Weight in the error of the relative change of the force that holds a plate.
_HOLDING = 0.1

#: Distance from the end of a mechanism's range, relative to the frame, within which the mechanism
#: is named as the reason why the motion stops. A failed step is halved until it is far shorter.
_NEAR = 0.02
#: Ratio of a step's length to the longest that its error would allow, so that few steps are
#: rejected; a usual safety factor.
_SAFETY = 0.85
#: Power of a step's length with which its error grows, for rules of second order.
_ORDER = 3

#: Tolerance of Newton's method relative to the error of a step, so that its own error is
#: negligible.
_CLOSER = 1e-3
#: Largest number of Newton's iterations in a step; a step that needs more is too long.
_ITERATIONS = 10

#: Free load if the film's charge is given, and if the plate's deflection is given.
_VOLTAGE: tuple[Load, ...] = ("voltage",)
_FORCE: tuple[Load, ...] = ("force",)

#: Shortest part of a jump of loads that is tried.
_PART = 1e-4


@dataclass(frozen=True)
class StepSettings:
    """Settings of the steps in time.

    ``error``: largest error of a step in halves: of the motion relative to the frame's half extent,
    of the branches' strain and of the charge. The extrapolated state from which the motion
    continues is far more accurate. ``first`` and ``shortest``: steps relative to the shortest
    relevant time. ``reach``: deflection, relative to the frame's half extent, at which the film has
    pulled in.
    """

    error: float = 1e-5
    first: float = 1e-2
    shortest: float = 1e-7
    reach: float = 1.5
    newton: NewtonSettings = field(default_factory=NewtonSettings)

    @property
    def close(self) -> NewtonSettings:
        """Newton's settings for such errors.

        If a step needs many iterations, it is too long.
        """
        return replace(self.newton, iterations=min(self.newton.iterations, _ITERATIONS),
                       correction=min(self.newton.correction, _CLOSER * self.error),
                       residual=min(self.newton.residual, _CLOSER * self.error))


@dataclass(frozen=True, eq=False)
class Moment:
    """Film and plate at a time [s].

    ``velocity``: velocity of the plate's six freedoms. ``rate``: rate of change of their momentum.
    ``charge`` on the electrodes [C] and ``current`` into them [A]; both are 0 without a circuit.
    ``stiffness``: stiffness of the film against the deflection of a plate with inertia or damper
    [N/m].
    """

    time: float
    state: State
    memory: Memory
    velocity: Array = field(default_factory=lambda: np.zeros(6))
    rate: Array = field(default_factory=lambda: np.zeros(6))
    charge: float = 0.0
    current: float = 0.0
    stiffness: float = 0.0

    @property
    def voltage(self) -> float:
        """Voltage across a film that a circuit charges [V], with the sign of its charge."""
        return float(np.copysign(np.sqrt(self.state.voltage_squared), self.charge))


#: End of a step, and a tangent of the film near it.
ImplicitStep = tuple[Moment, Tangent | None]


@dataclass(frozen=True, eq=False)
class Transient:
    """A film under a force [N], a gas ``pressure`` [Pa] and a source's signal.

    ``plate``: mass of the plate, None without inertia. ``damper``: damper on its deflection [N
    s/m]. ``deflection``: prescribed deflections [m] of a held plate, with the breaks of the signal
    and without jumps. The force then holds the plate; inertia, damper and circuit have no effect.
    """

    model: Model
    force: float
    signal: SourceSignal
    plate: RigidPlate | None = None
    damper: float = 0.0
    circuit: Circuit = field(default_factory=Circuit)
    settings: StepSettings = StepSettings()
    pressure: float = 0.0
    deflection: SourceSignal | None = None

    def moments(self, state: State, memory: Memory) -> Iterator[Moment]:
        """Yield moments from the signal's start, at a state, to its end; a jump repeats its time.

        Raises
        ------
        Stopped
            If film and plate have no equilibrium any more, or the plate has pulled in.
        """
        begin = Moment(float(self.signal.breaks[0]), state, memory)
        if self.circuit.resistance:
            charge = float(self.model.capacitance(state)) * np.sqrt(state.voltage_squared)
            begin = replace(begin, charge=float(np.copysign(charge, self.signal.first)))
        return self.onward(begin)

    def onward(self, begin: Moment) -> Iterator[Moment]:
        """Yield moments from one that is in motion, as :meth:`moments` does."""
        return moments(_InMotion(self, [begin]), self.signal.breaks.tolist())

    @property
    def control(self) -> StepControl:
        """Control of the steps' lengths."""
        settings = self.settings
        return StepControl(settings.error, _ORDER, _SAFETY, settings.shortest / settings.first)

    @property
    def _at_once(self) -> bool:
        """Whether a mechanism may make the plate jump at once: nothing delays its motion."""
        timed = self.plate is not None or self.damper or self.circuit.resistance
        return not timed and self.deflection is None and bool(self.model.loading.softening)

    def snapped(self, past: list[Moment]) -> Moment | None:
        """Find the moment after a jump in the direction of the last motion; None without one."""
        if not self._at_once or len(past) < 2:
            return None
        before, last = (moment.state.plate.deflection for moment in past[-2:])
        moment = past[-1]
        model = self.remembering(moment)
        start = newton(model, moment.state, settings=self.settings.close)
        rest = landed(model, start, last - before, PathSettings()) if start.converged else None
        return None if rest is None else replace(moment, state=rest.state)

    def times(self, moment: Moment) -> list[float]:
        """List relevant times [s]: of the branches, of the plate's motion, of charging."""
        times = [float(time) for time in moment.memory.times]
        if moment.stiffness > 0:
            times.append(self.damper / moment.stiffness if self.plate is None
                         else float(np.sqrt(self.plate.mass / moment.stiffness)))
        if self.circuit.resistance:
            times.append(float(self.model.capacitance(moment.state)) / self.circuit.conductance)
        return times

    def stopped(self, moment: Moment) -> Stopped:
        least = _PART * small_strain_modulus(self.model.specimen.membrane.material)
        thin = self.model.thinning_margin(moment.state) < least
        there, near = self.model.deflection(moment.state), _NEAR * self.model.size
        ends = (without_mechanism(self.model, there + way * near) for way in (1, -1))
        return Stopped("thinning" if thin else "pull_in", moment.time, next(filter(None, ends), ""))

    def after_jump(self, moment: Moment, source: float) -> Moment:
        """Compute the moment immediately after a jump of the source's voltage.

        Inertia holds the plate, and a damper holds its deflection.
        """
        squared = moment.state.voltage_squared if self.circuit.resistance else source**2
        model = self.remembering(moment)
        if self.deflection is not None:
            film = self._jumped(model, moment, squared, deflection=moment.state.plate.deflection)
        elif self.plate is not None:
            clamped = replace(model, loading=replace(model.loading, guide="fixed"))
            film = self._jumped(clamped, moment, squared)
            moment = replace(moment, rate=self._pushed(model, film, moment.velocity))
        elif self.damper:
            film = self._jumped(model, moment, squared, deflection=moment.state.plate.deflection)
            velocity = (self.force - film.force) / self.damper * np.eye(6)[HEAVE]
            film, moment = film.under(force=self.force), replace(moment, velocity=velocity)
        else:
            film = self._jumped(model, moment, squared)
        if self.plate is not None or self.damper:
            tangent, _ = tangent_at(model, film)
            moment = replace(moment, stiffness=_stiffness(tangent) if tangent else 0.0)
        voltage = float(np.copysign(np.sqrt(squared), moment.charge))
        return replace(moment, state=film, current=self.circuit.current(source, voltage))

    def _pushed(self, model: Model, film: State, velocity: Array) -> Array:
        """Compute the rate of the plate's momentum [N, N m] from its unbalanced forces."""
        assert self.plate is not None
        _, outer = model.residual(model.nodal_forces(film), film)
        rate = -self._damping @ velocity
        rate -= carried_along(velocity, self.plate.matrix(film.plate) @ velocity)
        rate[list(model.plate_freedoms)] -= outer * model.discretisation.mirrored
        return self._of_freedoms(rate)

    def _of_freedoms(self, values: Array) -> Array:
        """Set values of the six freedoms to 0 where guide or symmetry remove the freedom.

        These freedoms are not solved for, and the extrapolation of a step would amplify their
        rounding errors.
        """
        return np.where(self._free, values, 0.0)

    @cached_property
    def _free(self) -> Mask:
        """Mask of the plate's freedoms that guide and symmetry allow."""
        return np.isin(np.arange(6), self.model.plate_freedoms)

    def _jumped(self, model: Model, moment: Moment, squared: float, deflection: float | None = None
                ) -> State:
        """Solve for the state after a jump of force, gas and U², in as many parts as needed.

        If the plate is held at a ``deflection`` [m], the force is solved for.
        """
        targets: dict[Load, float] = {"force": self.force, "pressure": self.pressure,
                                      "voltage": squared}
        free, constraints = ((), ()) if deflection is None else (_FORCE, (held_plate(deflection),))
        share, step, state, before = 0.0, 1.0, moment.state, moment.state
        while share < 1:
            ahead = min(1.0, share + step)
            loads = {name: before.load(name) + ahead * (target - before.load(name))
                     for name, target in targets.items()}
            solution = newton(model, state.under(**loads), free, constraints, self.settings.close)
            if solution.converged and (solution.stable or deflection is not None):
                state, share, step = solution.state, ahead, 2 * step
            elif (step := step / 2) < _PART:
                start = newton(model, state, settings=self.settings.close)
                if not (self._at_once and start.converged):
                    raise self.stopped(moment)
                outcome = equilibrium(model, self.force, float(np.sqrt(squared)), self.pressure,
                                      start)
                if outcome.status != "equilibrium":
                    raise self.stopped(moment)
                return outcome.state
        return state

    def step(self, past: list[Moment], piece: int, duration: float,
             tangent: Tangent | None = None) -> tuple[ImplicitStep | None, float]:
        """Compute the moment after a duration [s] by a whole step and two halves, and the error.

        The moment is None if the film cannot be followed. A given tangent near the start may
        replace a new one.
        """
        steps = self._whole_and_halves(past, piece, duration, tangent)
        if steps is None:
            return None, np.inf
        whole, middle, halves, tangent = steps
        gap = difference(self.model, halves.state, whole.state)
        viscous, change = halves.memory.viscous, halves.memory.viscous - whole.memory.viscous
        along = np.stack([viscous[0], viscous[1], np.sqrt(viscous[0] * viscous[1]), viscous[3]])
        strain = np.sqrt(np.mean((change / along) ** 2)) if viscous.size else 0.0
        error = max(length(self.model, gap), _STRAIN * float(strain)) / 3
        if self.circuit.resistance:
            error = max(error, _CHARGE * abs(halves.charge - whole.charge) / 3
                        / self._most_charge(halves))
        error = max(error, self._between(past, middle, halves))
        beyond = viscous + change / 3
        beyond = beyond / np.cbrt(determinant(beyond)) if viscous.size else viscous
        further = halves.state.force - whole.state.force
        state = moved(self.model, halves.state, gap, 1 / 3, {"force": further})
        squared = halves.state.voltage_squared
        if self.circuit.resistance:
            squared = (halves.voltage + (halves.voltage - whole.voltage) / 3) ** 2
        return (replace(
            halves, state=state.under(voltage=squared),
            memory=replace(halves.memory, viscous=beyond),
            velocity=halves.velocity + (halves.velocity - whole.velocity) / 3,
            rate=halves.rate + (halves.rate - whole.rate) / 3,
            charge=halves.charge + (halves.charge - whole.charge) / 3,
            current=halves.current + (halves.current - whole.current) / 3,
            stiffness=_stiffness(tangent) if self.damper and tangent else halves.stiffness),
            tangent), error

    def _whole_and_halves(
            self, past: list[Moment], piece: int, duration: float, tangent: Tangent | None
            ) -> tuple[Moment, Moment, Moment, Tangent | None] | None:
        """Make a step as a whole and in halves: end, middle, end; return a tangent, too.

        The halves start from the whole step's prediction and tangent.
        """
        whole = self.implicit_step(past, piece, duration, tangent=tangent)
        if whole is None:
            return None
        ahead, tangent = whole
        middle = self.implicit_step(past, piece, duration / 2, [ahead], tangent)
        if middle is None:
            return None
        halves = self.implicit_step([*past, middle[0]], piece, duration / 2, [ahead], middle[1])
        return None if halves is None else (ahead, middle[0], *halves)

    def _between(self, past: list[Moment], middle: Moment, end: Moment) -> float:
        """Compute the interpolation error of deflection, charge and force at a step's middle.

        The interpolating curve passes through the stored moments and the step's end.
        """
        shares = list(_shares([*past[-3:], end], middle.time))
        deflection = sum(share * self.model.deflection(moment.state) for moment, share in shares)
        miss = abs(self.model.deflection(middle.state) - deflection) / self.model.size
        if self.circuit.resistance:
            charge = sum(share * moment.charge for moment, share in shares)
            miss = max(miss, _CHARGE * abs(middle.charge - charge) / self._most_charge(end))
        if self.deflection is not None:
            force = sum(share * moment.state.force for moment, share in shares)
            scale = max(abs(moment.state.force) for moment in (*past[-3:], middle, end))
            miss = max(miss, _HOLDING * abs(middle.state.force - force) / max(scale, 1e-300))
        return float(miss)

    def _most_charge(self, moment: Moment) -> float:
        """Compute the film's charge [C] at a moment's shape under the highest voltage."""
        return self._highest * float(self.model.capacitance(moment.state))

    def implicit_step(self, past: list[Moment], piece: int, duration: float,
                      ahead: Sequence[Moment] = (), tangent: Tangent | None = None
                      ) -> ImplicitStep | None:
        """Make one implicit step of a duration [s]; None if the film cannot be followed.

        Moments ``ahead`` improve the guess. A given tangent near the guess may replace a new one.
        """
        moment = past[-1]
        time = moment.time + duration
        source = float(self.signal.within(piece, time))
        guess = self.state_at([*past[len(ahead) - 3:], *ahead], time)
        if self.deflection is None:
            guess = guess.under(force=self.force)
        flow = self._flow(moment, duration, guess)
        model = self._moving(replace(self.model, flow=flow), moment, guess, duration)
        voltage, charge = self._electrodes(model, guess, moment, source, duration)
        given = (_VOLTAGE if charge else (), charge) if self.deflection is None else (
            _FORCE, (held_plate(float(self.deflection.within(piece, time))),))
        solution = self._solved((model, guess.under(voltage=voltage**2), *given), tangent)
        free = self.circuit.resistance or self.deflection is not None
        if not solution.converged or not (solution.stable or free):
            return None
        state, swing = solution.state, model.loading.swing
        if state.voltage_squared < 0:  # the film is almost discharged
            state = state.under(voltage=0.0)
        memory = moment.memory if flow is None else flow.after(virgin_strain(self.model, state))
        following = Moment(time, state, memory, stiffness=moment.stiffness)
        if swing is not None:
            velocity, rate = map(self._of_freedoms, swing.after(state.plate))
            following = replace(following, velocity=velocity, rate=rate)
        if self.circuit.resistance:
            across = float(np.copysign(np.sqrt(state.voltage_squared), voltage))
            following = replace(following, current=self.circuit.current(source, across),
                                charge=float(self.model.capacitance(state)) * across)
        return following, solution.tangent

    def _flow(self, moment: Moment, duration: float, guess: State) -> Flow | None:
        """Prepare the flow of the branches in a step; None without branches."""
        memory = moment.memory
        if not len(memory.times):
            return None
        ahead = virgin_strain(self.model, guess) if memory.flows else None
        return memory.step(virgin_strain(self.model, moment.state), duration, ahead)

    def _electrodes(self, model: Model, guess: State, moment: Moment, source: float,
                    duration: float) -> tuple[float, tuple[Constraint, ...]]:
        """Predict a film's voltage [V]; build the charge constraint that a circuit adds.

        The model contains only the voltage's square, so the constraint prescribes the magnitude of
        a negative charge.
        """
        if not self.circuit.resistance:
            return source, ()
        capacitance = float(model.capacitance(guess))
        charge, further = self.circuit.charged(moment.charge, moment.current, source, duration,
                                               capacitance)
        voltage = charge / (capacitance + further)
        return voltage, (held_charge(abs(charge), further),) if voltage else ()

    def _solved(self, problem: tuple[Model, State, tuple[Load, ...], tuple[Constraint, ...]],
                tangent: Tangent | None) -> Solution:
        """Solve with the given tangent or the guess's; if both fail, with full Newton."""
        close = self.settings.close
        near = None if tangent is None else simplified_newton(*problem, close, tangent)
        return near or simplified_newton(*problem, close) or newton(*problem, close)

    def _moving(self, model: Model, moment: Moment, guess: State, duration: float) -> Model:
        """Add the plate's inertia and damping in a step to the model."""
        if self.plate is None and not self.damper:
            return model
        before, after = ((np.zeros((6, 6)),) * 2 if self.plate is None else
                         (self.plate.matrix(state.plate) for state in (moment.state, guess)))
        swing = Swing(moment.state.plate, moment.velocity, before @ moment.velocity, moment.rate,
                      after, self._damping, duration, moment.stiffness)
        return replace(model, loading=replace(model.loading, swing=swing))

    def state_at(self, past: list[Moment], time: float) -> State:
        """Interpolate the state at a time by the polynomial through some moments."""
        last = past[-1]
        motion: Parts = (np.zeros(self.model.discretisation.free_count),
                         np.zeros(len(self.model.plate_freedoms)))
        for moment, share in _shares(past, time):
            film, plate = difference(self.model, moment.state, last.state)
            motion = motion[0] + share * film, motion[1] + share * plate
        return moved(self.model, last.state, motion)

    def moment_at(self, past: list[Moment], time: float) -> Moment:
        """Interpolate state and memory at a time by the polynomial through some moments."""
        viscous = np.asarray(sum(share * moment.memory.viscous
                                 for moment, share in _shares(past, time)))
        return Moment(time, self.state_at(past, time), replace(past[-1].memory, viscous=viscous))

    def remembering(self, moment: Moment) -> Model:
        """Set the stress of the branches at a moment in the model."""
        if not len(moment.memory.times):
            return self.model
        strain = virgin_strain(self.model, moment.state)
        return replace(self.model, flow=moment.memory.step(strain, 0.0))

    @cached_property
    def _highest(self) -> float:
        """Highest voltage of the source [V]."""
        return highest_voltage(self.signal)

    @property
    def _damping(self) -> Array:
        damping = np.zeros((6, 6))
        damping[HEAVE, HEAVE] = self.damper
        return damping


@dataclass(eq=False)
class _InMotion:
    """A transient in motion: up to three last moments of a piece, a tangent near the last."""

    transient: Transient
    past: list[Moment]
    piece: int = 0
    tangent: Tangent | None = None
    attempted: ImplicitStep | None = None

    @property
    def control(self) -> StepControl:
        return self.transient.control

    @property
    def time(self) -> float:
        return self.past[-1].time

    @property
    def gone(self) -> bool:
        transient = self.transient
        deflection = transient.model.deflection(self.past[-1].state)
        return abs(deflection) > transient.settings.reach * transient.model.size

    def enter(self, piece: int, begin: float, end: float) -> tuple[list[Moment], float]:
        transient = self.transient
        source = float(transient.signal.within(piece, begin))
        moment = transient.after_jump(self.past[-1], source)
        self.past, self.piece, self.tangent = [moment], piece, None
        scale = min([end - begin, *transient.times(moment)])
        return [moment], transient.settings.first * scale

    def attempt(self, duration: float, end: float | None) -> float:
        ahead, error = self.transient.step(self.past, self.piece, duration, self.tangent)
        if ahead is not None and end is not None:
            moment, tangent = ahead
            # The sum of two halves may be a little less than the whole.
            ahead = replace(moment, time=end), tangent
        self.attempted = ahead
        return error

    def accept(self) -> list[Moment]:
        assert self.attempted is not None
        following, self.tangent = self.attempted
        self.past = [*self.past[-2:], following]
        return [following]

    def recover(self, shortest: bool) -> list[Moment]:
        if not shortest:
            return []
        snapped = self.transient.snapped(self.past)
        if snapped is None:
            raise self.transient.stopped(self.past[-1])
        self.past, self.tangent = [snapped], None
        return [snapped]


def _stiffness(tangent: Tangent) -> float:
    """Compute the whole film's stiffness against deflection [N/m].

    The stiffness that a time step of the plate's motion adds is subtracted.
    """
    model = tangent.model
    heave = model.plate_freedoms.index(HEAVE)
    stiffness = float(tangent.plate_stiffness[heave, heave]) * model.discretisation.mirrored
    swing = model.loading.swing
    return stiffness - (float(swing.stiffness[HEAVE, HEAVE]) if swing is not None else 0.0)


def _shares(moments: Sequence[Moment], time: float) -> Iterator[tuple[Moment, float]]:
    """Yield each moment with its weight in the interpolating polynomial at a time [s]."""
    return zip(moments, weights([moment.time for moment in moments], time), strict=True)
