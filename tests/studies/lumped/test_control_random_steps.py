"""The paper's random steps in a closed loop, and what no voltage within the supply can do."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from tests.oracles.lumped_model import equations
from tests.support.lumped import OVAL, compiled_controller
from tympan.paper.figures import Choices
from tympan.paper.published import MASSES
from tympan.paper.table1 import paper_actuators
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.case import ChosenActuators, LumpedCase
from tympan.studies.lumped.control.controller import Method
from tympan.studies.lumped.control.result import ControlledFilm, ControlLimit, ControlStep
from tympan.studies.lumped.control.run import ControlSettings, controlled
from tympan.studies.lumped.model_file import LumpedModel
from tympan.studies.signals import Pieces, random_steps, through

SUPPLY, INTERVAL = 7e3, 10e-3
PERMITTIVITY = 9.735
#: Radii of the circles of the paper's three shapes [m], and their weights.
SHAPES = (((45e-3,), (1.0,)), ((45e-3, 60e-3), (0.413, 0.587)), ((45e-3, 75e-3), (0.413, 0.587)))
#: Steps of Runge and Kutta's rule in a sampling interval: two fifths of a radian of the swing.
SUBSTEPS = 2
#: Places between which a plate is swung [m]: all, the near ones, those in the middle.
SWUNG = np.array([[-1.0, 1.0], [-1.0, 7e-3], [-1.0, 5e-3], [2.5e-3, 5.5e-3]]).T

#: Voltage by number of the sample and states.
Voltage = Callable[[int, np.ndarray], Any]


def looped(shape: int, mass: float, signal: Pieces, method: Method = "pi") -> ControlledFilm:
    """A shape of the paper that is to follow the rests of a signal."""
    specimen = paper_actuators(PERMITTIVITY)[shape]
    one = Actuator.of(specimen, mass, SHAPES[shape][1])
    film, = controlled(ChosenActuators(LumpedCase((specimen,), ()), (one,), ()), signal,
                       ControlSettings(method=method)).films
    return film


def hold_of(signal: Pieces) -> float:
    return float(np.diff(signal.breaks).max())


def three_times_as_soon(film: ControlledFilm, hold: float) -> int:
    """How many steps are three times as soon: all that any controller can bring there so soon."""
    for each in film.steps:
        assert each.limited_by in get_args(ControlLimit)
        without = each.open_settled_s or hold
        if each.soonest_s is not None and 3 * each.soonest_s <= without:
            assert each.times_as_soon is not None
            assert each.times_as_soon >= 3
        else:
            assert each.limited_by == "supply"
        if each.settled_s is not None and each.soonest_s is not None:
            assert each.settled_s >= each.soonest_s
    return sum((each.times_as_soon or 0) >= 3 for each in film.steps)


class Equations:
    """A shape under a mass as the paper's equations move it, typed again; by Runge and Kutta."""

    def __init__(self, shape: int, mass: float) -> None:
        self.radii, self.weights = SHAPES[shape]
        self.mass = mass

    def rates(self, state: np.ndarray, voltage: Any) -> np.ndarray:
        return equations(state, voltage, self.weights, self.mass, PERMITTIVITY, self.radii)

    def at_rest(self, deflection: float) -> np.ndarray:
        return np.array([deflection, 0.0, *(np.hypot(1, deflection / (radius - 1e-2)) - 1
                                            for radius in self.radii)])

    def moved(self, state: np.ndarray, voltage: Voltage, count: int) -> np.ndarray:
        """States at each of so many samples, and after the last one, (count + 1, size, …)."""
        states, h = [state], INTERVAL / SUBSTEPS
        for number in range(count):
            for _ in range(SUBSTEPS):
                held = voltage(number, state)
                first = self.rates(state, held)
                second = self.rates(state + h / 2 * first, held)
                third = self.rates(state + h / 2 * second, held)
                fourth = self.rates(state + h * third, held)
                state = state + h / 6 * (first + 2 * second + 2 * third + fourth)
            states.append(state)
        return np.array(states)


def bang_bang(end: float, count: int) -> tuple[Voltage, int]:
    """Voltages of the supply's ends, and how many they are; the first one stays at an end.

    Others swing the plate at all places or at some, as hard as the supply can. Or they are at the
    other end for a tenth of the time in turn, or at random.
    """
    other, number = SUPPLY - end, np.arange(count)
    made = np.random.default_rng(45).random((3, count // 8 + 1)) < 0.5
    tenths = number * 10 // count == np.arange(10)[:, None]
    there = np.vstack([np.zeros(count, bool), tenths, np.repeat(made, 8, axis=1)[:, :count]])
    timed = len(there)

    def voltage(sample: int, state: np.ndarray) -> np.ndarray:
        y, speed = state[:2, timed:]
        # The other end pushes the plate the way it goes.
        pushed = (speed * (other - end) > 0) & (y > SWUNG[0]) & (y < SWUNG[1])
        return np.where(np.concatenate([there[:, sample], pushed]), other, end)

    return voltage, timed + SWUNG.shape[1]


def excluded(paper: Equations, start: np.ndarray, step: ControlStep, third: float) -> bool:
    """Whether no voltage within the supply settles a step in a time [s].

    At its end the supply has not brought the plate within 2 % then. Nor does that end hold it there
    with the film crept as other voltages leave it.
    """
    near, up = step.to_m - 0.02 * (step.to_m - step.from_m), step.to_m > step.from_m
    end, count, sign = SUPPLY if up else 0.0, round(third / INTERVAL), 1 if up else -1
    voltage, many = bang_bang(end, count)
    crept = paper.moved(np.repeat(start[:, None], many, axis=1), voltage, count)[-1]
    if sign * (crept[0, 0] - near) >= 0:
        return False
    crept[:2] = np.array([[near], [0.0]])
    assert (sign * paper.rates(crept, end)[1] < 0).all(), step
    return True


def assert_shown(shape: int, mass: float, signal: Pieces, folder: Path, method: Method = "pi"
                 ) -> int:
    """What a run must show; answers how many steps settle three times as soon."""
    film, hold = looped(shape, mass, signal, method), hold_of(signal)
    assert film.lowest_V >= 0
    assert film.highest_V <= SUPPLY
    assert film.scattered.stable == film.scattered.films == 1000
    wanted, reached, voltage = (film.samples[name].to_numpy()
                                for name in ("wanted", "displacement", "voltage"))
    if shutil.which("cc"):
        in_c = compiled_controller(film.controller, float(reached[0]), folder)
        assert list(map(in_c, wanted, reached)) == pytest.approx(voltage, rel=1e-9,
                                                                 abs=1e-9 * SUPPLY)
    paper = Equations(shape, mass)
    states = paper.moved(paper.at_rest(float(reached[0])), lambda number, _: float(voltage[number]),
                         len(voltage) - 1)
    assert states[:, 0] == pytest.approx(reached, abs=1e-3 * float(np.ptp(wanted)))
    for step in film.steps:
        third = (step.open_settled_s or hold) / 3
        start = states[round(step.start_s / INTERVAL)]
        assert excluded(paper, start, step, third) == ((step.times_as_soon or 0) < 3), step
    return three_times_as_soon(film, hold)


@pytest.mark.study(seconds=6)
def test_random_steps_settle_three_times_as_soon_where_the_supply_can() -> None:
    """Of membrane circles."""
    signal = random_steps(0.0, SUPPLY, 12.0, 6, 3)
    model = LumpedModel(OVAL, (45e-3, 75e-3), (0.61, 0.39), 2.2e-9, SUPPLY)
    film, = controlled(ChosenActuators(LumpedCase((), (model,)), (model.actuator(17.9e-3),), ()),
                       signal, ControlSettings()).films
    assert film.lowest_V >= 0
    assert film.highest_V <= SUPPLY
    assert len(film.steps) == 5  # it rests at the first level
    assert three_times_as_soon(film, hold_of(signal)) == 4
    assert film.error_rms_m < film.open_error_rms_m
    assert film.disturbance.settled_s is not None


@pytest.mark.parametrize(("shape", "mass"), [(1, MASSES[0]), (2, MASSES[1])])
def test_a_few_steps_of_the_papers_ellipses(shape: int, mass: float, tmp_path: Path) -> None:
    """One that the supply allows, and one up and one down that it excludes."""
    levels = np.repeat([3e3, 4.5e3, 6.9e3, 0.3e3], 2)
    signal = through(np.array([0.0, 0.1, 0.1, 3.1, 3.1, 6.1, 6.1, 9.1]), levels)
    assert assert_shown(shape, mass, signal, tmp_path) == 1


@pytest.mark.study
@pytest.mark.parametrize(("shape", "mass", "count"), [
    (0, MASSES[0], 13), (1, MASSES[0], 13), (2, MASSES[0], 13),
    (0, MASSES[1], 10), (1, MASSES[1], 9), (2, MASSES[1], 9)])
def test_the_papers_random_steps(shape: int, mass: float, count: int, tmp_path: Path) -> None:
    """Figure 14's nineteen steps, by PI."""
    assert assert_shown(shape, mass, Choices().steps()[0], tmp_path) == count


@pytest.mark.study
def test_the_papers_random_steps_by_lqg(tmp_path: Path) -> None:
    assert assert_shown(2, MASSES[0], Choices().steps()[0], tmp_path, "lqg") == 13
