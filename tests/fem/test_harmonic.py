"""Small swings of the voltage, against equilibria, films in time and modes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import curve_fit

from tests.support.specimens import circular
from tympan.base.errors import InputError
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.rig import Rig
from tympan.fem.transient.integrate import StepSettings
from tympan.fem.vibration.harmonic import Harmonic
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.studies.case import Case, Settings, equilibrate, solve
from tympan.studies.modes import modes
from tympan.studies.response import ResponseResult, response
from tympan.studies.signals import Pieces, Sine
from tympan.studies.transient import History, TransientCase, history

MASS, VOLTAGE, SMALL = 17.9e-3, 5e3, 20.0
#: What is compared on the same mesh needs no fine one.
COARSE = Settings(MeshSettings(order=3).refined(0.5))


def film(*branches: ViscousBranch) -> Specimen:
    specimen = circular(NeoHooke(20e3))
    return replace(specimen, membrane=replace(specimen.membrane, branches=branches))


CREEPS = film(ViscousBranch(200e3, 10.0), ViscousBranch(1e6, 0.3))


def swung(specimen: Specimen, *frequencies: float, rig: Rig = Rig(), mass: float = MASS,
          voltage: float = VOLTAGE) -> ResponseResult:
    return response(Case(specimen, mass=mass, voltage=voltage, rig=rig), COARSE, frequencies)


@cache
def rest(voltage: float) -> tuple[float, float]:
    """Deflection [m] and charge [C] at rest."""
    done = solve(Case(CREEPS, mass=MASS, voltage=voltage), COARSE)
    assert done.deflection_m is not None
    assert done.capacitance_F is not None
    return done.deflection_m, done.capacitance_F * voltage


def weightless(frequency: float) -> complex:
    """Heave over voltage of a plate without inertia."""
    model, outcome = equilibrate(Case(CREEPS, mass=MASS, voltage=VOLTAGE), COARSE)
    heave = Harmonic(model, outcome.state, RigidPlate(0.0)).response(
        np.array([frequency])).deflection
    return complex(heave[0])


def slope(what: int) -> float:
    """By the voltage, of the third order."""
    near, far = (rest(VOLTAGE + h)[what] - rest(VOLTAGE - h)[what] for h in (SMALL, 2 * SMALL))
    return (8 * near - far) / (12 * SMALL)


def test_slow_swings_follow_the_equilibria() -> None:
    slow = swung(CREEPS, 1e-7)
    assert slow.amplitude_m_per_V[0] == pytest.approx(slope(0), rel=1e-6)
    assert slow.phase_deg[0] == pytest.approx(0.0, abs=1e-3)


def test_charge_of_a_slow_swing_has_the_film_s_motion() -> None:
    """The film's voltage over a resistance, as of a capacitor of dQ/dU."""
    resistance, frequency = 1e12, 1e-4
    slow = swung(film(), frequency, rig=Rig(series_resistance=resistance))
    charging = 2j * np.pi * frequency * resistance * slope(1)
    assert slow.film_voltage_V_per_V[0] == pytest.approx(abs(1 / (1 + charging)), rel=1e-4)


def test_fast_swings_of_a_plate_without_inertia_meet_all_branches() -> None:
    step = Pieces(np.array([0.0, 0.0, 1e-3]), np.array([VOLTAGE, *2 * [VOLTAGE + SMALL]]))
    done = history(TransientCase(CREEPS, step, mass=MASS), COARSE)
    jump = (done.deflection[0] - rest(VOLTAGE)[0]) / SMALL
    assert abs(weightless(1e6)) == pytest.approx(jump, rel=5e-3)


@pytest.mark.parametrize(("frequency", "periods"), [(0.02, 4.0), (0.5, 6.0)])
def test_a_film_in_time_swings_as_its_response_says(frequency: float, periods: float) -> None:
    signal = Sine(VOLTAGE, SMALL, 1 / frequency, periods)
    done = history(TransientCase(CREEPS, signal, mass=MASS, steps=StepSettings(error=1e-7)),
                   COARSE)
    amplitude, phase = swing(done, frequency, signal.end)
    said = weightless(frequency)
    assert amplitude / SMALL == pytest.approx(abs(said), rel=1e-3)
    assert phase == pytest.approx(np.degrees(np.angle(said)), abs=0.05)


def swing(done: History, frequency: float, end: float) -> tuple[float, float]:
    """Amplitude [m] and phase [°] over the last two periods, a slow drift taken away."""
    when = np.linspace(end - 2 / frequency, end, 401)[:-1]
    angle = 2 * np.pi * frequency * when
    columns = np.column_stack([np.sin(angle), np.cos(angle), np.ones_like(when), when])
    sine, cosine, *_ = np.linalg.lstsq(columns, done.at(done.deflection, when), rcond=None)[0]
    return float(np.hypot(sine, cosine)), float(np.degrees(np.arctan2(cosine, sine)))


def test_a_film_without_branches_swings_at_its_mode() -> None:
    heave = next(mode for mode in modes(Case(film(), mass=MASS, voltage=VOLTAGE), COARSE).modes
                 if mode.name == "heave")
    said = swung(film(), 1.0)
    assert said.natural_Hz == pytest.approx(heave.frequency_Hz, rel=1e-8)
    assert said.damping == pytest.approx(0.0, abs=1e-9)


def test_a_film_without_plate_swings_at_its_centre() -> None:
    """Slowly as its equilibria, with its own mass at its lowest mode; with branches as in time."""
    rig, plain = Rig(gas_pressure=100.0), film()
    heavy = replace(plain, plate=None, membrane=replace(plain.membrane, density=960.0))
    creeps = replace(CREEPS, plate=None)

    def centre(specimen: Specimen, voltage: float) -> float:
        deflection = solve(Case(specimen, voltage=voltage, rig=rig), COARSE).deflection_m
        assert deflection is not None
        return deflection

    case = Case(heavy, voltage=VOLTAGE, rig=rig)
    said = response(case, COARSE, (1e-4,))
    slope = (centre(heavy, VOLTAGE + SMALL) - centre(heavy, VOLTAGE - SMALL)) / (2 * SMALL)
    assert slope < 0  # a voltage lifts it further
    assert said.amplitude_m_per_V[0] == pytest.approx(-slope, rel=1e-3)
    assert abs(said.phase_deg[0]) == pytest.approx(180.0, abs=1e-3)
    assert said.natural_Hz == pytest.approx(modes(case, COARSE).modes[0].frequency_Hz, rel=1e-8)
    frequency, periods = 0.5, 6.0
    signal = Sine(VOLTAGE, SMALL, 1 / frequency, periods)
    done = history(TransientCase(creeps, signal, mass=0.0, rig=rig,
                                 steps=StepSettings(error=1e-7)), COARSE)
    amplitude, phase = swing(done, frequency, signal.end)
    crept = response(Case(creeps, voltage=VOLTAGE, rig=rig), COARSE, (frequency,))
    assert crept.natural_Hz is None
    assert amplitude / SMALL == pytest.approx(crept.amplitude_m_per_V[0], rel=2e-3)
    assert (phase - crept.phase_deg[0] + 180) % 360 == pytest.approx(180.0, abs=0.1)


def test_a_swing_dies_away_as_its_natural_frequency_says() -> None:
    specimen, rig = film(ViscousBranch(300e3, 5e-3)), Rig(plate_damping=0.02)
    step = Pieces(np.array([0.0, 0.0, 0.6]), np.array([VOLTAGE, *2 * [VOLTAGE + SMALL]]))
    done = history(TransientCase(specimen, step, mass=MASS, rig=rig, inertia=True,
                                 steps=StepSettings(error=1e-7)), COARSE)
    when = np.linspace(0.1, 0.6, 400)
    said = swung(specimen, 1.0, rig=rig, voltage=VOLTAGE + SMALL)
    assert said.natural_Hz is not None
    assert said.damping is not None
    angular = 2 * np.pi * said.natural_Hz
    decay = angular * said.damping / np.sqrt(1 - said.damping**2)

    def dying(time, omega, sigma, sine, cosine, last):
        return last + np.exp(-sigma * time) * (sine * np.sin(omega * time)
                                               + cosine * np.cos(omega * time))

    values = 1e6 * done.at(done.deflection, when)
    start = (angular, decay, 0.1, 0.1, values[-1])
    (omega, sigma, *_), _ = curve_fit(dying, when, values, start)
    assert omega == pytest.approx(angular, rel=1e-3)
    assert sigma == pytest.approx(decay, rel=1e-2)


def test_a_plate_that_nothing_damps_is_asked_beside_its_natural_frequency() -> None:
    """It is one oscillator: static amplitude over |1 - (f/f₀)²| up to the resonance and beyond."""
    bare = swung(film())
    natural, asked = bare.natural_Hz, np.array(bare.frequency_Hz)
    assert natural is not None
    assert asked[0] < natural < asked[-1]
    static = bare.amplitude_m_per_V[0]
    expected = static / np.abs(1 - (asked / natural) ** 2)
    assert np.array(bare.amplitude_m_per_V) == pytest.approx(expected, rel=1e-4)
    assert max(bare.amplitude_m_per_V) < 100 * static
    assert [words for words in bare.warnings if "without bound" in words]
    damped = swung(film(), rig=Rig(plate_damping=0.05))
    assert not [words for words in damped.warnings if "without bound" in words]


def test_no_voltage_has_no_response() -> None:
    with pytest.raises(InputError, match="square of the voltage"):
        swung(film(), 1.0, voltage=0.0)


def test_each_frequency_is_said_before_it_is_solved_for() -> None:
    said: list[str] = []
    response(Case(CREEPS, mass=MASS, voltage=VOLTAGE), COARSE, (0.5, 2.0), said.append)
    assert said == ["0.5 Hz", "2 Hz"]
