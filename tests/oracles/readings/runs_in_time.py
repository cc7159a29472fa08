"""Runs in time of circular actuators, by none of the project's solvers.

The film is the axisymmetric one of :mod:`tests.oracles.creep`, in time by Runge and Kutta's method.
Where the plate swings it is that of :mod:`tests.oracles.readings.swinging_plate`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from tests.oracles.creep import CreepingFilm
from tests.oracles.readings.round_actuators import GRAVITY, MASSES, SHAPES, Hidden, dataset_file
from tests.oracles.readings.swinging_plate import SwingingPlate
from tympan.base.arrays import Array

VOLTAGES = (0.0, 1.5e3, 2.5e3, 3.2e3)


@dataclass(frozen=True)
class Run:
    """How runs are made: voltage from 0 on [V], their length [s], samples a second before and after
    the plate has swung out, and noise of a sample [m].

    ``share`` of a sample by which the voltage jumps before the first sample that shows it; ``hum``:
    amplitude [m] and frequency [Hz] of what hums in all samples; ``late``: samples by which the
    voltages of the first run of all are written too early.
    """

    voltage: float = 4.2e3
    length: float = 30.0
    rate: float = 100.0
    before: int = 20
    noise: float = 10e-6
    shapes: tuple[str, ...] = tuple(SHAPES)
    masses: tuple[float, ...] = MASSES
    swings: bool = False
    share: float = 0.5
    hum: tuple[float, float] = (0.0, 50.0)
    late: int = 0


def film_of(shape: str, hidden: Hidden) -> CreepingFilm:
    a, b = SHAPES[shape]
    return CreepingFilm(a, b, 1e-3, 5**0.5, 20e3 * hidden.stiffness, max(hidden.branch, 1e-3),
                        hidden.time, 4.7 * hidden.permittivity, others=hidden.others)


@cache
def plate_of(shape: str, mass: float, hidden: Hidden) -> SwingingPlate:
    return SwingingPlate(film_of(shape, hidden), mass + hidden.added, hidden.damping,
                         hidden.resistance, hidden.lag)


def creeping(shape: str, mass: float, hidden: Hidden, run: Run, when: Array) -> Array:
    """Deflections [m] at times [s] after the step of a film whose plate follows it."""
    film, load = film_of(shape, hidden), mass * GRAVITY
    times = np.geomspace(when[0] / 2, when[-1], 25)
    path = film.history((load, 0.0), (load, run.voltage), times)[1:]
    return np.interp(np.log(when), np.log(times), path)


def swinging(shape: str, mass: float, hidden: Hidden, run: Run, when: Array) -> Array:
    """The same of a plate that swings, of a film that charges, by a sensor that is late."""
    return plate_of(shape, mass, hidden).stepped(mass * GRAVITY, run.voltage, when)


def write(folder: Path, hidden: Hidden, run: Run = Run(), seed: int = 0) -> Path:
    """A dataset of readings at rest and of steps with these things hidden in it."""
    hidden.only("branch", "time", "others", "damping", "resistance", "lag", "added")
    random = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    (folder / "dataset.toml").write_text(dataset_file(run.noise, run.shapes), encoding="utf-8")
    static = ["specimen,mass_g,voltage_kV,displacement_mm"]
    transient = ["specimen,mass_g,run,t_s,voltage_kV,displacement_mm"]
    when = (np.arange(round(run.length * run.rate)) + run.share) / run.rate
    for name in run.shapes:
        for mass in run.masses:
            film, load = film_of(name, hidden), mass * GRAVITY
            for voltage in VOLTAGES:
                rest = film.at_rest(load, voltage, None)[0][-1]
                read = rest + run.noise * random.standard_normal()
                static.append(f"{name},{1e3 * mass!r},{voltage / 1e3!r},{1e3 * read:.7g}")
            follow = swinging if run.swings else creeping
            path = follow(name, mass, hidden, run, when)
            start = film.at_rest(load, 0.0, None)[0][-1]
            read = np.r_[np.full(run.before, start), path]
            read = read + run.noise * random.standard_normal(len(read))
            time = np.r_[(np.arange(run.before) - run.before + run.share) / run.rate, when]
            size, frequency = run.hum
            read = read + size * np.sin(2 * np.pi * frequency * time + 2 * np.pi * mass / MASSES[0])
            early = run.late if len(transient) == 1 else 0
            voltage = np.where(np.arange(len(time)) < run.before - early, 0.0, run.voltage)
            transient += [f"{name},{1e3 * mass!r},a,{t - time[0]:.6g},{u / 1e3!r},{1e3 * y:.7g}"
                          for t, u, y in zip(time.tolist(), voltage.tolist(), read.tolist(),
                                             strict=True)]
    (folder / "static.csv").write_text("\n".join(static) + "\n", encoding="utf-8")
    (folder / "transient.csv").write_text("\n".join(transient) + "\n", encoding="utf-8")
    return folder
