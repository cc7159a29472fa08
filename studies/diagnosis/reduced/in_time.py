"""Readings of runs in time in addition to those at rest: charging, damping, late sensors.

A block's mean is read whole swings after a jump of the voltage. By then the only effect of the
swing is that the plate was late: by c/k on average where it is damped, and by the sensor's lag. A
film that charges through a resistance has less voltage for a while.
"""

from __future__ import annotations

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.rig import Rig, Supply
from tympan.studies.diagnosis.reading_table import States


def charged(states: States, supply: Supply, squared: Array, capacitance: Array) -> Array:
    """Compute U² [V²] of the films from what the supply gives at rest, shape (states,).

    ``capacitance`` is that of the film of each state [F].
    """
    rows, passages = states.in_time, states.passages
    if not supply.series_resistance or not len(rows):
        return squared
    lag = supply.circuit.time(capacitance[rows])
    less = passages.squared(supply, lag) - passages.squared(supply)
    result = squared.copy()
    result[rows] = np.maximum(result[rows] + less, 0.0)
    return result


def behind(states: States, rig: Rig, mass: Array, stiffness: Array, capacitance: Array) -> Array:
    """Compute the share of the last jump that states in time have not reached, shape (states,).

    It comes in addition to :func:`charged`. Each state has a moving ``mass`` [kg], a ``stiffness``
    of film and rig [N/m] and a ``capacitance`` [F], all positive.

    It follows from the poles of plate and sensor and those of the rise of the film's U²: for each
    the mean of its exponential over the block. Blocks begin and end whole swings after the jump,
    where a swing's phase is 0.
    """
    rows, passages, share = states.in_time, states.passages, np.zeros(len(states))
    mass, stiffness, capacitance = (values[rows] for values in (mass, stiffness, capacitance))
    rate, inertial = rig.plate_damping / (2 * mass), stiffness / mass
    root = np.sqrt((rate**2 - inertial * (1 + 1e-9)).astype(complex))
    poles = [root - rate, -root - rate]
    if rig.sensor_lag:
        poles.append(np.full(len(rows), -1 / rig.sensor_lag, complex))

    def transfer(s: Array, without: int = -1) -> Array:
        """Compute the transfer function of plate and sensor, without one pole."""
        gain = inertial / rig.sensor_lag if rig.sensor_lag else inertial
        return np.asarray(gain / np.prod([s - pole for number, pole in enumerate(poles)
                                          if number != without], axis=0))

    risen = _rise(passages.jump, rig, capacitance)
    total = np.zeros(len(rows), complex)
    for number, pole in enumerate(poles):
        force = 1 / pole - sum(part / (pole - slow) for part, slow in risen)
        total -= transfer(pole, number) * force * _mean(pole, *passages.after)
    for part, slow in risen:
        # The response of plate and sensor beyond following it.
        total += part * (transfer(slow) - 1) * _mean(slow, *passages.after)
    share[rows] = total.real
    return share


def _rise(jump: Array, supply: Supply, capacitance: Array) -> list[tuple[Array, Array]]:
    """Write the rise of U² to its last value as exponentials: shares, rates [1/s]."""
    if not supply.series_resistance:
        return []
    before, after = (np.asarray(supply.film_voltage(voltage)) for voltage in jump)
    whole = after**2 - before**2
    whole = np.where(whole == 0, 1.0, whole)
    slow = -1 / supply.circuit.time(capacitance)
    return [(2 * after * (after - before) / whole, slow + 0j),
            (-((after - before) ** 2) / whole, 2 * slow + 0j)]


def _mean(pole: Array, begin: Array, end: Array) -> Array:
    """Average an exponential from begin to end [s], where its phase is 0."""
    real = pole.real
    there = np.isfinite(begin)
    begin, end = np.where(there, begin, 0.0), np.where(there, end, 1.0)
    length = end - begin
    fallen = np.exp(real * begin) - np.exp(real * end)
    mean = np.where(length > 0, -fallen / (pole * np.where(length > 0, length, 1.0)),
                    np.exp(real * begin))
    return np.where(there, mean, 0.0)
