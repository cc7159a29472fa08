"""A lumped model as C: compiled by a C compiler, its rates and motion those of the model."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import cast

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

from tests.support.lumped import OVAL
from tests.support.specimens import circular
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.laws import Gent
from tympan.studies.films.film import ReducedFilm
from tympan.studies.lumped.export.c_source import export_c
from tympan.studies.lumped.export.fmu import export_fmu
from tympan.studies.lumped.model_file import LumpedModel, write_model
from tympan.studies.lumped.simulate import LumpedMotion, simulate
from tympan.studies.signals import Pieces

COMPILER = shutil.which("cc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")

MODELS = {
    "ogden, two circles": LumpedModel(OVAL, (45e-3, 75e-3), (0.6, 0.4), 2e-9, 5e3, 1.03, 0.8),
    "gent, falling permittivity": LumpedModel(
        circular(Gent(18e3, 110.0), permittivity_exponent=0.4), (45e-3,), (1.0,), 1.2e-9, 5e3)}

Rates = Callable[[np.ndarray, float, float], np.ndarray]


def compiled(model: LumpedModel, folder: Path) -> tuple[ctypes.CDLL, str]:
    header, source = export_c(model, folder)
    library = folder / "model.so"
    subprocess.run([str(COMPILER), "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic",
                    "-shared", "-fPIC", str(source), "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library)), header.stem


def rates_of(library: ctypes.CDLL, name: str) -> Rates:
    function = getattr(library, f"{name}_rates")
    vector = ctypes.POINTER(ctypes.c_double)
    function.argtypes = (vector, ctypes.c_double, ctypes.c_double, vector)
    function.restype = None

    def rates(state: np.ndarray, mass: float, voltage: float) -> np.ndarray:
        state, result = np.ascontiguousarray(state), np.empty(len(state))
        function(state.ctypes.data_as(vector), mass, voltage, result.ctypes.data_as(vector))
        return result

    return rates


@needs_compiler
@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
def test_compiled_rates_are_the_models(model: LumpedModel, tmp_path: Path) -> None:
    library, name = compiled(model, tmp_path)
    rates, generator = rates_of(library, name), np.random.default_rng(1)
    capacitance = getattr(library, f"{name}_capacitance")
    capacitance.restype = ctypes.c_double
    for mass in (5e-3, 17.9e-3):
        actuator = model.actuator(mass)
        for voltage in (0.0, 4.2e3):
            state = np.array([*generator.uniform(-0.02, 0.02, 1), *generator.normal(size=1),
                              *generator.uniform(0, 0.1, actuator.count)])
            ours = actuator.linear(state, voltage)[0]
            assert rates(state, mass, voltage) == pytest.approx(ours, rel=1e-10, abs=1e-10)
            in_c = capacitance(state.ctypes.data_as(ctypes.POINTER(ctypes.c_double)))
            assert in_c == pytest.approx(float(actuator.capacitance(state[0])), rel=1e-11)
    sensed = getattr(library, f"{name}_sensed_deflection")
    sensed.restype, sensed.argtypes = ctypes.c_double, (ctypes.c_double,)
    for deflection in (4e-3, 9e-3, 2e-2):
        read = float(actuator.capacitance(deflection))
        assert sensed(read) == pytest.approx(deflection, rel=1e-9)
    assert sensed(0.5 * float(actuator.capacitance(0.0))) == 0.0
    assert np.isnan(sensed(100 * read))
    beyond = np.array([1.0, *[0.0] * (1 + actuator.count)])
    assert np.isnan(rates(beyond, 5e-3, 0.0)[1])


@needs_compiler
def test_compiled_model_moves_as_ours(tmp_path: Path) -> None:
    """Under a step, by another integrator than the simulation's."""
    model = MODELS["ogden, two circles"]
    rates = rates_of(*compiled(model, tmp_path))
    actuator = model.actuator(17.9e-3)
    step = Pieces(np.array([0.0, 0.0, 0.5]), np.array([0.0, 4e3, 4e3]))
    time = np.linspace(0, 0.5, 200)
    ours = simulate(actuator, step, precision=1e-12).state(time)
    motion = solve_ivp(lambda t, x: rates(x, 17.9e-3, 4e3), (0, 0.5), ours[0], "DOP853", time,
                       rtol=1e-11, atol=1e-14)
    assert np.ptp(ours[:, 0]) > 1e-4
    assert motion.y[0] == pytest.approx(ours[:, 0], abs=1e-6 * np.ptp(ours[:, 0]))


def test_command_writes_both_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = MODELS["ogden, two circles"]
    named = replace(model, specimen=replace(model.specimen, name="2nd oval-1"))
    write_model(tmp_path / "oval.lumped.toml", named)
    assert main(["lumped", "export", str(tmp_path / "oval.lumped.toml"), "-o", str(tmp_path)]) == 0
    printed = capsys.readouterr().out.split()
    assert [Path(file).name for file in printed] == ["model_2nd_oval_1.h", "model_2nd_oval_1.c"]


def test_a_film_with_memory_is_refused(tmp_path: Path) -> None:
    film = cast(ReducedFilm, object())  # whichever it is
    with pytest.raises(InputError, match="branches of its own"):
        export_c(replace(MODELS["ogden, two circles"], film=film), tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_mass_without_fmu_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for wrong in (["--mass", "10 g"], ["--fmu"]):
        assert main(["lumped", "export", "no.lumped.toml", "-o", str(tmp_path), *wrong]) == 2
        assert "--mass" in capsys.readouterr().err


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first model under 17.9 g."""
    return export_fmu(MODELS["ogden, two circles"], tmp_path_factory.mktemp("fmu"), 17.9e-3)


def initial_states(response: LumpedMotion) -> dict[str, float]:
    """The states of a response at its beginning, by their names in an FMU."""
    state = response.state(np.array([0.0]))[0]
    return dict(zip(("y", "speed", "strain[1]", "strain[2]"), state.tolist(), strict=True))


@needs_compiler
def test_fmu_is_as_its_standard_says_and_compiles_without_warnings(fmu: Path,
                                                                   tmp_path: Path) -> None:
    assert validate_fmu(str(fmu)) == []
    fmpy.extract(str(fmu), str(tmp_path))
    source = next((tmp_path / "sources").glob("*_fmu.c"))
    subprocess.run([str(COMPILER), "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic",
                    "-fsyntax-only", str(source)], check=True)


@needs_compiler
@pytest.mark.parametrize("use", ["ModelExchange", "CoSimulation"])
def test_fmu_runs_elsewhere_as_the_model_here(fmu: Path, use: str) -> None:
    actuator = MODELS["ogden, two circles"].actuator(17.9e-3)
    step = Pieces(np.array([0.0, 0.0, 0.5]), np.array([0.0, 4e3, 4e3]))
    response = simulate(actuator, step, precision=1e-12)
    motion = fmpy.simulate_fmu(
        str(fmu), fmi_type=use, stop_time=0.5, output_interval=1e-3, relative_tolerance=1e-10,
        start_values={**initial_states(response), "voltage": 4e3},
        output=["deflection", "capacitance"])
    ours = response.deflection(motion["time"])
    assert np.ptp(ours) > 1e-4
    assert motion["deflection"] == pytest.approx(ours, abs=1e-6 * np.ptp(ours))
    assert motion["capacitance"] == pytest.approx(actuator.capacitance(ours), rel=1e-6)


@needs_compiler
@pytest.mark.parametrize("use", ["ModelExchange", "CoSimulation"])
def test_fmu_senses_the_deflection_of_a_capacitance(fmu: Path, use: str) -> None:
    read = float(MODELS["ogden, two circles"].actuator(17.9e-3).capacitance(7e-3))
    motion = fmpy.simulate_fmu(str(fmu), fmi_type=use, stop_time=1e-2, output_interval=1e-3,
                               start_values={"measured_capacitance": read},
                               output=["sensed_deflection"])
    assert motion["sensed_deflection"] == pytest.approx(7e-3, rel=1e-9)


@needs_compiler
def test_co_simulation_steps_as_finely_as_it_must(fmu: Path) -> None:
    """Communicating less than once a swing, at its own tolerance, under steps of the voltage."""
    levels, communication = np.array([0.0, 4e3, 1.5e3, 4.5e3, 0.0]), 0.1
    edges = np.repeat(communication * np.arange(len(levels) + 1), 2)[1:-1]
    staircase = Pieces(edges, np.repeat(levels, 2))
    response = simulate(MODELS["ogden, two circles"].actuator(17.9e-3), staircase, precision=1e-12)
    voltage = np.array(list(zip(edges, np.repeat(levels, 2), strict=True)),
                       dtype=[("time", float), ("voltage", float)])
    motion = fmpy.simulate_fmu(
        str(fmu), fmi_type="CoSimulation", stop_time=edges[-1], output_interval=communication,
        start_values=initial_states(response), input=voltage, output=["deflection", "speed"])
    assert motion["time"] == pytest.approx(communication * np.arange(len(levels) + 1))
    states = response.state(motion["time"])
    for name, ours in (("deflection", states[:, 0]), ("speed", states[:, 1])):
        assert motion[name] == pytest.approx(ours, abs=1e-6 * np.ptp(ours))


@needs_compiler
def test_co_simulation_ends_at_the_models_reach(fmu: Path, tmp_path: Path) -> None:
    fmpy.extract(str(fmu), str(tmp_path))
    header = next((tmp_path / "sources").glob("*.h")).read_text(encoding="utf-8")
    reach = float(re.search(r"define \w+_REACH (\S+)", header)[1])  # type: ignore[index]
    motion = fmpy.simulate_fmu(
        str(fmu), fmi_type="CoSimulation", stop_time=1.0, output_interval=1e-3,
        start_values={"speed": 100.0}, output=["deflection"])
    assert motion["time"][-1] < 1e-3
    assert motion["deflection"][-1] == pytest.approx(reach, rel=1e-4)
    assert motion["deflection"][-1] <= reach
