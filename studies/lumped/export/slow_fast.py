"""A lumped model as a polynomial of the voltage before a slow and a fast transfer function.

The form of SoftPyIdentify (github.com/jkb-ctrl/SoftPyIdentify): v = f(u) is the deflection at rest,
y = G_slow G_fast v with G_slow = (s + z₀)/(s + s₀), G_fast = k (α² + ω²)/(s² + 2 α s + α² + ω²) and
k z₀ = s₀, so that the gain at rest is that of f.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import least_squares

from tympan.base.arrays import Array
from tympan.base.errors import Failure, InputError
from tympan.studies.files import write_json
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import rest
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.model_file import LumpedModel
from tympan.studies.lumped.simulate import LumpedMotion, simulate
from tympan.studies.signals import Pieces, random_steps

#: Number of voltages for the polynomial's fit: several for each of its coefficients.
_RESTS = 41
#: Levels of the steps that the form is fitted to, over the highest voltage: up and down, large and
#: small.
_STEPS = (0.5, 1.0, 0.25, 0.75, 0.0)

#: Duration of a step, over the slow motion's time: the motion is then within 2 % of its end.
_HELD = 4.0
#: Number of sampling times soon after a step, and again later on. Found by trial.
_SAMPLES = 400

#: The polynomial's largest admissible error over the range: small compared with the errors in time.
_FINE = 1e-3
#: The polynomial's highest degree. Above it, the polynomial may swing between the voltages.
_HIGHEST = 8


@dataclass(frozen=True)
class SlowFast:
    """v = Σ p_i u^i [m] of u [V], then s₀, z₀, α, ω [1/s] and k.

    Errors are shares of the range of the deflection up to ``highest_voltage`` [V]: the largest at
    rest, and the root mean square and the largest on random steps that were not used in the fit.
    """

    polynomial: tuple[float, ...]
    s0: float
    z0: float
    alpha: float
    omega: float
    k: float
    highest_voltage: float
    rest_error: float = np.nan
    step_error_rms: float = np.nan
    step_error_largest: float = np.nan

    def at_rest(self, voltage: Any) -> Any:
        """Evaluate f(u) [m]."""
        return Polynomial(self.polynomial)(np.asarray(voltage, float))

    def to_unit_step(self, time: Array) -> Array:
        """Compute the response y when v steps from 0 to 1 at time 0 [s]; 0 before it."""
        square = self.alpha**2 + self.omega**2
        poles = np.array([0.0, -self.s0, -self.alpha + 1j * self.omega,
                          -self.alpha - 1j * self.omega])
        apart = poles[:, None] - poles[None, :]
        np.fill_diagonal(apart, 1.0)
        residues = self.k * square * (poles + self.z0) / apart.prod(axis=1)
        after = np.exp(np.outer(np.maximum(time, 0.0), poles)) @ residues
        return np.asarray(np.where(time > 0, after.real, 0.0))

    def deflection(self, signal: Pieces, time: Array) -> Array:
        """Compute y [m] at times [s] under steps, from rest at the first voltage."""
        y = np.full(len(time), float(self.at_rest(signal.first)))
        for at, change in _changes(signal):
            y += (self.at_rest(change[1]) - self.at_rest(change[0])) * self.to_unit_step(time - at)
        return y


def slow_fast(actuator: Actuator, highest: float) -> SlowFast:
    """Fit the form to an actuator's steps up to a voltage across the film [V].

    Raises
    ------
    Failure
        Where the plate does not swing: there is no fast pair.
    """
    polynomial = _polynomial(actuator, highest)
    about = linearise(actuator, 0.7 * highest)
    poles = about.named_poles
    swings = [pole for pole in poles if pole.name == "oscillation"]
    creeps = [pole for pole in poles if pole.name == "creep" and pole.share]
    if not swings or not creeps:
        raise Failure("the plate must swing and the film creep: this one has no "
                      + ("slow pole" if swings else "fast pair"))
    slow = max(creeps, key=lambda pole: pole.share or 0.0)
    lasting = sum(pole.share or 0.0 for pole in creeps)
    start = np.array([-slow.value.real, max(1 - lasting, 0.01), -swings[0].value.real,
                      swings[0].value.imag])

    def form(x: Array) -> SlowFast:
        s0, k, alpha, omega = np.exp(x).tolist()
        return SlowFast(polynomial, s0, s0 / k, alpha, omega, k, highest)

    pause = _HELD / start[0]
    signal = _staircase(highest * np.array(_STEPS), pause)
    time = _looked_at(signal, 1 / start[3])
    wanted = simulate(actuator, signal).deflection(time)
    span = float(np.ptp(Polynomial(polynomial)(np.array([0.0, highest]))))
    fitted = form(least_squares(
        lambda x: (form(x).deflection(signal, time) - wanted) / span, np.log(start)).x)
    return _judged(fitted, actuator, pause, span)


def _judged(fitted: SlowFast, actuator: Actuator, pause: float, span: float) -> SlowFast:
    """Add the errors: at voltages between, and on steps of other heights and lengths."""
    highest = fitted.highest_voltage
    between = np.linspace(0.0, highest, 4 * _RESTS)
    resting = np.array([rest(actuator, voltage) for voltage in between.tolist()])
    signal = random_steps(0.0, highest, pause / 3, 8, seed=1)
    time = _looked_at(signal, 1 / fitted.omega)
    response: LumpedMotion = simulate(actuator, signal)
    missed = (fitted.deflection(signal, time) - response.deflection(time)) / span
    return SlowFast(**{**asdict(fitted), **{
        "rest_error": float(np.abs(fitted.at_rest(between) - resting).max() / span),
        "step_error_rms": float(np.sqrt(np.mean(missed**2))),
        "step_error_largest": float(np.abs(missed).max())}})


def _polynomial(actuator: Actuator, highest: float) -> tuple[float, ...]:
    """Fit the polynomial of the lowest degree that follows the deflections at rest."""
    voltage = np.linspace(0.0, highest, _RESTS)
    y = np.array([rest(actuator, float(each)) for each in voltage])
    for degree in range(2, _HIGHEST + 1):
        fitted = Polynomial.fit(voltage, y, degree)
        if np.abs(fitted(voltage) - y).max() < _FINE * np.ptp(y):
            break
    return tuple(fitted.convert().coef.tolist())


def _staircase(levels: Array, pause: float) -> Pieces:
    times = pause * np.repeat(np.arange(len(levels) + 2.0), 2)[1:-1]
    return Pieces(times, np.repeat(np.append(0.0, levels), 2))


def _changes(signal: Pieces) -> list[tuple[float, tuple[float, float]]]:
    """Find the times [s] of jumps, with the voltages [V] before and after them."""
    time, voltage = signal.time.tolist(), signal.voltage.tolist()
    return [(time[jump], (voltage[jump], voltage[jump + 1]))
            for jump in np.flatnonzero(np.diff(signal.time) == 0).tolist()]


def _looked_at(signal: Pieces, swing: float) -> Array:
    """Space times evenly over the first swings after each change, and wider later on."""
    times = [np.zeros(1)]
    starts = [at for at, _ in _changes(signal)]
    for at, end in pairwise([*starts, signal.end]):
        soon = np.linspace(0.0, min(30 * swing, end - at), _SAMPLES, endpoint=False)[1:]
        late = np.geomspace(max(soon[-1], 1e-9), end - at, _SAMPLES)
        times.append(at + np.concatenate([soon, late[1:]]))
    return np.concatenate(times)


def export_slow_fast(model: LumpedModel, folder: Path, mass: float) -> Path:
    """Write ``NAME.slow-fast.json`` of a model with a mass [kg] on its plate, for its full range.

    Raises
    ------
    Failure
        Where the plate does not swing, or the film has branches of its own.
    """
    if model.film is not None:
        raise Failure("this form is of circles with one branch: the film of this model has its own")
    if not 1e-6 <= mass <= 100:
        raise InputError("must be from 1 mg to 100 kg", key="--mass", given=f"{mass:g} kg")
    file = folder / f"{model.specimen.name}.slow-fast.json"
    form = slow_fast(model.actuator(mass), model.highest_voltage)
    write_json(file, {
        "form": "v = f(u) = sum p_i u^i; y = (s + z0)/(s + s0) * "
                "k (alpha^2 + omega^2)/(s^2 + 2 alpha s + alpha^2 + omega^2) v; k z0 = s0",
        "units": {"u": "V", "y": "m", "s0, z0, alpha, omega": "1/s"},
        "mass_kg": mass, **asdict(form)})
    return file
