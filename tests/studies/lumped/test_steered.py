"""Steered plates: lumped model, inverse, controller, C and FMU; the film in time in a study."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

from tests.support.steered import LOAD, SUPPLY, model, places, quarters, small_film
from tympan.base.errors import Failure, InputError
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.rig import Rig
from tympan.studies.lumped.steered.export import export_c, export_fmu
from tympan.studies.lumped.steered.inverse import SteeredInverse, voltages_at
from tympan.studies.lumped.steered.law import design_law
from tympan.studies.lumped.steered.run import (
    SteerSettings,
    steerable,
)

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


def some_state(seed: int) -> tuple[np.ndarray, np.ndarray]:
    random, made = np.random.default_rng(seed), model()
    x = made.resting(np.full(4, SUPPLY**2 / 3))
    x = x + 0.3 * np.tile(made.scale, 4) * random.normal(size=made.size)
    return x, SUPPLY * random.uniform(size=4)


def test_forces_derive_from_an_energy() -> None:
    made, (x, voltage) = model(), some_state(1)
    p, u, steps = x[:3], voltage**2, 1e-4 * model().scale

    def energy(p: np.ndarray) -> float:
        terms = made.terms(p)[0]
        return float(made.elastic @ terms - u @ (made.electric @ terms) / 2 - made.force * p[0])

    pull, stiffness, by_u = made.pull(p, u)
    for number, step in enumerate(np.diag(steps)):
        slope = (energy(p + step) - energy(p - step)) / (2 * steps[number])
        assert slope == pytest.approx(pull[number], rel=1e-5, abs=1e-8 * LOAD)
        bent = (made.pull(p + step, u)[0] - made.pull(p - step, u)[0]) / (2 * steps[number])
        np.testing.assert_allclose(bent, stiffness[:, number], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose((made.pull(p, u + 1e6)[0] - pull) / 1e6, by_u.sum(1), rtol=1e-6,
                               atol=1e-18)


def test_small_motions_are_the_derivatives_of_the_rates() -> None:
    made, u = model(), np.array([1.0, 2.0, 3.0, 4.0]) * 1e6
    linear, x = made.linearise(u), made.resting(u)
    assert np.abs(made.rates(x, u)).max() < 1e-9
    sizes = 1e-4 * np.tile(made.scale, 4)
    for number, step in enumerate(np.diag(sizes)):
        slope = (made.rates(x + step, u) - made.rates(x - step, u)) / (2 * sizes[number])
        np.testing.assert_allclose(slope, linear.a[:, number], rtol=1e-6, atol=1e-6)
    for number, step in enumerate(1e3 * np.eye(4)):
        slope = (made.rates(x, u + step) - made.rates(x, u - step)) / 2e3
        np.testing.assert_allclose(slope, linear.b[:, number], rtol=1e-6, atol=1e-14)
    further = made.rest(u + 1e2) - made.rest(u - 1e2)
    np.testing.assert_allclose(further / 2e2, linear.gain.sum(1), rtol=1e-5, atol=1e-16)
    assert linear.to_scipy().A.shape == (12, 12)
    assert (linear.states[0], linear.inputs[3], linear.outputs) == (
        "deflection", "U2_D", ("deflection", "tilt_x", "tilt_y"))


def test_the_inverse_holds_the_plate_where_it_says() -> None:
    made, wanted = model(), places(2e-3)
    inverse = SteeredInverse.of(made, wanted, SUPPLY)
    for place in wanted:
        u = inverse.squared(place)
        np.testing.assert_allclose(made.rest(u), place, atol=1e-7)
        np.testing.assert_allclose(u, voltages_at(made, place, SUPPLY),
                                   atol=2 * inverse.error * SUPPLY**2)
    with pytest.raises(Failure, match="a smaller tilt or a higher supply"):
        SteeredInverse.of(made, wanted, SUPPLY / 3)


def test_a_law_at_rest_asks_for_the_voltages_of_the_inverse() -> None:
    made, wanted = model(), places(2e-3)
    inverse = SteeredInverse.of(made, wanted, SUPPLY)
    designed = design_law(made, inverse, [inverse.squared(inverse.centre)], 0.01, 1.0)
    law = designed.law
    assert designed.margins.sensitivity < 1.6
    for place in (inverse.centre, wanted[3]):
        memory = law.resting(place, place)
        for _ in range(3):
            voltages, memory = law.voltages(memory, place, place)
            np.testing.assert_allclose(voltages**2, inverse.squared(place), rtol=1e-6)
        np.testing.assert_allclose(memory, law.resting(place, place), atol=1e-9)


@needs_compiler
def test_the_c_has_the_models_rates(tmp_path: Path) -> None:
    made, source = model(), export_c(model(), tmp_path)
    subprocess.run(["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared",
                    "-fPIC", str(source), "-o", str(tmp_path / "model.so"), "-lm"], check=True)
    library, vector = ctypes.CDLL(str(tmp_path / "model.so")), ctypes.POINTER(ctypes.c_double)
    for seed in range(5):
        x, voltage = some_state(seed)
        rates, stored = np.empty(made.size), np.empty(4)
        library.quarters_rates(*(part.ctypes.data_as(vector) for part in (x, voltage, rates)))
        library.quarters_capacitances(*(part.ctypes.data_as(vector) for part in (x, stored)))
        np.testing.assert_allclose(rates, made.rates(x, voltage**2), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(stored, made.capacitances(x[:3]), rtol=1e-12)


@needs_compiler
@pytest.mark.parametrize("use", ["CoSimulation", "ModelExchange"])
def test_the_fmu_moves_as_the_model(use: str, tmp_path: Path) -> None:
    made, file = model(), export_fmu(model(), tmp_path)
    assert validate_fmu(str(file)) == []
    voltage = (2000.0, 1500.0, 1000.0, 500.0)
    given = np.array([(time, *voltage) for time in (0.0, 0.2)],
                     dtype=[("time", float), *((f"voltage[{i}]", float) for i in range(1, 5))])
    names = ("deflection", "tilt_x", "tilt_y")
    motion = fmpy.simulate_fmu(str(file), fmi_type=use, stop_time=0.2, output_interval=1e-3,
                               input=given, output=names, relative_tolerance=1e-10)
    exact = solve_ivp(lambda _, x: made.rates(x, np.square(voltage)), (0, 0.2),
                      made.resting(np.zeros(4)), rtol=1e-11, atol=1e-14, t_eval=motion["time"])
    for number, name in enumerate(names):
        span = np.ptp(exact.y[number])
        np.testing.assert_allclose(motion[name], exact.y[number], atol=1e-6 * span)


def test_a_films_stiffness_is_the_derivative_of_its_pull() -> None:
    film, _ = small_film().driven({"A": 2e3, "B": 500.0})
    assert film.led == 3
    assert len(film.bends)
    q = np.zeros(film.count)
    q[:3] = 2.6e-3, 5e-4, -3e-4
    _, stiffness = film.pull(q, 4e6)
    for number, step in enumerate(1e-6 * np.eye(film.count)):
        slope = (film.pull(q + step, 4e6)[0] - film.pull(q - step, 4e6)[0]) / 2e-6
        np.testing.assert_allclose(slope, stiffness[:, number], rtol=1e-6,
                                   atol=1e-7 * np.abs(stiffness).max())


def test_a_films_plate_has_the_inertia_of_its_freedoms() -> None:
    film = small_film()
    plate = RigidPlate.uniform(film.specimen.needed_plate().outline, 0.02)
    turning = 0.02 * 1e-4 / 4 / 0.045**2
    np.testing.assert_allclose(film.inertia(plate), np.diag([0.02, turning, turning]),
                               rtol=1e-6, atol=1e-12)


def test_what_cannot_be_steered_is_refused() -> None:
    film = quarters()
    two = replace(film, electrode=replace(film.electrode, segments=film.electrode.segments[:2]))
    still = replace(film, membrane=replace(film.membrane, branches=()))
    for specimen, rig, key in ((two, Rig(), "electrode.segment"), (still, Rig(), "membrane.branch"),
                               (film, Rig(series_resistance=1e6), "rig.series_resistance"),
                               (film, Rig(gas_pressure=10.0), "rig.gas_pressure"),
                               (film, Rig(weight_offset=(1e-3, 0.0)), "rig.weight_offset")):
        with pytest.raises(InputError) as caught:
            steerable(specimen, SteerSettings(), rig)
        assert caught.value.key == key
