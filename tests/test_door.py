"""The public door: quick to open, the README's eight lines; results with pictures, files, tables.
"""

from __future__ import annotations

import inspect
import json
import os
import pickle
import re
import subprocess
import sys
import time
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass, replace
from io import StringIO
from operator import attrgetter
from pathlib import Path
from typing import Any, is_typeddict

import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from scipy.io import loadmat

import tympan
from tests.support import parts_stub
from tests.support.checks.json_schema import printed_record
from tests.support.diagnosed import diagnosed
from tests.support.specimens import circular, elliptical, specimen_toml
from tests.support.sweeps import written
from tympan import door
from tympan.base.errors import InputError
from tympan.base.process.threads import one_thread
from tympan.cli import main
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.mesher import MeshSettings
from tympan.studies.alpha import AlphaSettings, LoadGrid
from tympan.studies.case import Case, CaseResult, Settings, equilibrate, solve
from tympan.studies.diagnosis.result import FoundCause, ShownSize
from tympan.studies.files import write_text
from tympan.studies.study import line_profile

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
#: The first Python in it.
EIGHT_LINES = README.split("```python\n")[1].split("```")[0]
COARSE = Settings(MeshSettings(order=2).refined(0.6))


#: What solves a film, by the command and in Python.
DOORS = {
    "command": "import tympan.cli; tympan.cli.main(['solve', {film!r}, '--mass', '20 g'])",
    "python": "import tympan; print(tympan.solve(tympan.load({film!r}), mass='20 g').status)"}
#: Packages and modules that take longer to import than such a film takes to solve.
HEAVY = {
    "scipy.optimize", "scipy.spatial", "scipy.interpolate", "scipy.special", "scipy.stats",
    "scipy.constants", "scipy.integrate", "pandas", "xarray", "matplotlib", "pyvista", "vtkmodules",
    "cadquery", "OCP", "ezdxf", "gmsh", "meshio", "rich", "jinja2", "pint", "tqdm",
    "numpy.f2py.rules", "numpy.testing._private.utils", "unittest", "email",
    "importlib.metadata", "charset_normalizer",
    "tympan.tables.formats", "tympan.tables.layouts", "tympan.studies.films.family",
    "tympan.studies.limits.curve", "tympan.reports.template"}
#: Most modules that a solve may load: 725 with SciPy 1.17, 767 before the list above was met.
MOST_MODULES = 740
#: Most of tympan's own; each takes some 2 ms.
MOST_OWN = 150


@pytest.mark.parametrize("door", DOORS)
def test_a_solve_loads_what_it_needs_only(door: str, tmp_path: Path) -> None:
    """The mesh is kept from a first run, as after the first solve of any film."""
    film = tmp_path / "oval.toml"
    film.write_text(specimen_toml())
    code = (f"import sys; {DOORS[door].format(film=str(film))}\n"
            "print('loaded', *sorted(sys.modules))")
    environment = os.environ | {"TYMPAN_CACHE": str(tmp_path / "kept")}
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                              check=True, cwd=ROOT, env=environment)
    loaded = set(done.stdout.split("loaded ")[1].split())
    assert "equilibrium" in done.stdout
    assert not HEAVY & loaded
    assert len(loaded) < MOST_MODULES
    assert len([name for name in loaded if name.startswith("tympan")]) < MOST_OWN


def test_every_name_loads_its_own_module_only() -> None:
    code = ("import sys, tympan; tympan.Circle; tympan.load;"
            "print(*[name for name in sys.modules if name.startswith('tympan.studies.')])")
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True,
                          check=True)
    loaded = {name.split(".")[2] for name in done.stdout.split()}
    assert not loaded & {"design", "films", "tolerance", "data", "lumped", "diagnosis"}


def test_opening_the_door_imports_nothing_heavy() -> None:
    code = ("import sys; before = set(sys.modules); import tympan; dir(tympan);"
            "print(*{name.split('.')[0] for name in set(sys.modules) - before})")
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True,
                          check=True)
    assert set(done.stdout.split()) <= set(sys.stdlib_module_names) | {"tympan"}


def test_what_is_public_is_there_and_nothing_else() -> None:
    assert dir(tympan) == sorted(tympan.__all__)
    for name in tympan.__all__:
        assert getattr(tympan, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        tympan.nonsense  # noqa: B018


def test_the_readme_s_eight_lines(tmp_path: Path) -> None:
    assert len([line for line in EIGHT_LINES.splitlines() if line]) == 8
    done = subprocess.run([sys.executable, "-c", EIGHT_LINES], cwd=tmp_path,
                          env=os.environ | {"PYTHONPATH": str(ROOT)},
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    status, deflection = done.stdout.split()
    assert status == "equilibrium"
    assert float(deflection) == CaseResult.load(tmp_path / "solved").deflection_m
    assert {file.name for file in tmp_path.rglob("oval.*")} == {
        "oval.png", "oval.svg", "oval.json", "oval.vtu"}


def test_parts_take_units_and_lists() -> None:
    assert tympan.Ellipse(["6 cm", 0.045]) == tympan.Ellipse((0.06, 0.045))
    assert tympan.Ogden(["16 kPa", "20 Pa"], [2, 4]) == tympan.Ogden((16e3, 20.0), (2, 4))
    assert tympan.Rig(drift="0.6 um/min").drift == pytest.approx(1e-8)
    assert isinstance(tympan.Circle("1 cm"), type(circular().plate.outline))
    with pytest.raises(tympan.InputError, match="radius: given '4 kV': wrong dimension"):
        tympan.Circle("4 kV")


def test_type_checkers_see_the_declared_fields() -> None:
    """If it fails: ``python -m tests.support.parts_stub``."""
    assert parts_stub.FILE.read_text(encoding="utf-8") == parts_stub.stub()


@pytest.fixture(scope="module")
def solved() -> tympan.Result[CaseResult]:
    return tympan.solve(circular(), settings=COARSE, mass="17.9 g", voltage="3.5 kV")


def test_a_result_has_the_study_s_numbers(solved: tympan.Result[CaseResult]) -> None:
    case = tympan.Case(circular(), mass=17.9e-3, voltage=3500.0)
    expected = solve(case, COARSE)
    assert solved.status == expected.status == "equilibrium"
    # Its walk to the limits comes near the state, from where the equilibrium is found.
    assert solved.deflection_m == pytest.approx(expected.deflection_m, rel=1e-10)
    assert {"deflection_m", "plot", "json"} <= set(dir(solved))
    with pytest.raises(AttributeError):
        solved.deflection_mm  # noqa: B018
    assert pickle.loads(pickle.dumps(solved)) == solved


def test_a_result_is_saved_drawn_and_tabulated(solved: tympan.Result[CaseResult],
                                               tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    write_text(tmp_path / "folder" / "circle.png", "of a command before")
    assert CaseResult.load(solved.save(tmp_path / "folder")) == solved.numbers
    assert (tmp_path / "folder" / "circle.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(solved.save(tmp_path / "a.json").read_text()) == solved.json()
    assert solved.save(tmp_path / "a.csv").read_text().startswith("specimen,mass_kg,voltage_V")
    assert solved.to_xarray()["deflection_m"].item() == solved.deflection_m
    with pytest.raises(tympan.InputError, match="must be a folder, or end in"):
        solved.save(tmp_path / "a.xlsx")
    axes = Figure().add_subplot()
    assert solved.plot(axes) is axes
    assert "3.5 kV" in axes.get_title()
    solved.plot(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(tympan.InputError, match="must end in"):
        solved.plot(tmp_path / "a.xyz")


def test_film_that_has_lost_tension_is_hatched(solved: tympan.Result[CaseResult]) -> None:
    film = solved.numbers.film
    assert film is not None
    assert "hatched" not in solved.plot(Figure().add_subplot()).get_title()
    right = np.where(film.mounted[:, 0] > 20e-3, 1.0, 0.0)
    loose = replace(film, values={**film.values, "tension": right})
    axes = tympan.Result(replace(solved.numbers, film=loose)).plot(Figure().add_subplot())
    assert axes.get_title().endswith("\nhatched: wrinkled or slack")
    assert axes.get_xlim()[1] > 45
    hatched, = (part for part in axes.collections if getattr(part, "hatches", None))
    west, _, east, _ = hatched.get_datalim(axes.transData).extents
    assert (west, east) == pytest.approx((20, 45), abs=4)


def test_past_pull_in_there_is_nothing_to_draw(tmp_path: Path) -> None:
    gone = tympan.solve(circular(), settings=COARSE, mass="17.9 g", voltage="20 kV")
    assert gone.status == "no_equilibrium"
    assert gone.deflection_m is None
    with pytest.raises(tympan.InputError, match=r"no film to draw: .*(pull-in|thins)"):
        gone.plot(tmp_path / "a.png")


def test_every_study_has_a_picture_and_a_table(tmp_path: Path) -> None:
    specimen, loads = circular(), {"mass": "17.9 g", "voltage": "1 kV"}
    written(tmp_path, 'specimen = "oval.toml"\nmass = ["17.9 g"]\nvoltage = ["0 kV", "2 kV"]')
    grid = LoadGrid((17.9e-3,), (0.0, 2e3))
    results = {
        "deflection_m": tympan.path(specimen, settings=COARSE, **loads),
        "frequency_Hz": tympan.modes(specimen, settings=COARSE, **loads),
        "elasticity": tympan.sensitivity(specimen, of="heave", settings=COARSE, **loads),
        "held_out_error": tympan.alpha(elliptical(60e-3), alpha_settings=AlphaSettings(grid,
                                                                                       grid),
                                                                                       settings=COARSE),
        "status": tympan.sweep(tmp_path / "SWEEP.toml", settings=COARSE),
    }
    for column, result in results.items():
        assert result.to_pandas()[column].notna().any()
        axes = result.plot(Figure().add_subplot())
        assert axes.has_data()
    assert dict(results["status"].to_xarray().sizes) == {"specimen": 1, "mass": 1, "voltage": 2}


def test_a_sweep_has_maps_over_its_keys(tmp_path: Path) -> None:
    """A cell for every pair of values, its colour that of its number on the scale beside it."""
    written(tmp_path, 'specimen = "oval.toml"\nmass = ["17.9 g"]\nvoltage = ["0 kV", "3 kV"]\n'
                      '[grid]\n"plate.radius" = ["8 mm", "1 cm"]\n'
                      '"membrane.relative_permittivity" = [3.0, 4.0, 5.0]')
    result = tympan.sweep(tmp_path / "SWEEP.toml", settings=COARSE)
    keys = ("membrane.relative_permittivity", "plate.radius")
    axes = result.plot(Figure().add_subplot(), of="stroke", over=keys)
    assert "stroke [mm]" in axes.get_title()
    assert axes.get_ylabel() == "plate.radius [mm]"
    assert [label.get_text() for label in axes.get_yticklabels()] == ["8", "10"]
    deflection = result.to_xarray()["deflection_m"].squeeze()
    stroke = 1e3 * (deflection.sel(voltage=3e3) - deflection.sel(voltage=0.0))
    bar = axes.figure.axes[1]
    scale = ScalarMappable(Normalize(*bar.get_ylim()), "viridis")
    width, height = (axes.get_xlim()[1] / 3, axes.get_ylim()[1] / 2)
    assert len(axes.patches) == 6
    for cell in axes.patches:
        column, row = round(cell.get_x() / width), round(cell.get_y() / height)
        expected = stroke.transpose(*keys).values[column, row]
        assert cell.get_facecolor() == pytest.approx(scale.to_rgba(expected), abs=0.01)
    for wrong in ({"of": "colour", "over": keys}, {"of": "stroke", "over": ("mass", keys[0])}):
        with pytest.raises(tympan.InputError, match="must be one of"):
            result.plot(Figure().add_subplot(), **wrong)


def test_pictures_and_tables_of_notebooks(solved: tympan.Result[CaseResult]) -> None:
    figures = pyplot.get_fignums()
    try:
        for axes in (solved.plot(), tympan.draw(circular())):
            assert axes.has_data()
            assert axes.figure.number in pyplot.get_fignums()
            assert "circle" in axes.get_title()
        for value in (solved.deflection_m, solved.capacitance_F):
            assert f"<td>{value:.6g}</td>" in solved._repr_html_()
        gone = replace(solved.numbers, film=None)
        with pytest.raises(tympan.InputError):
            tympan.Result(gone).plot()
    finally:
        opened = [number for number in pyplot.get_fignums() if number not in figures]
        for number in opened:
            pyplot.close(number)
    assert len(opened) == 2


def test_studies_and_lumped_models_have_pictures_and_tables(tmp_path: Path) -> None:
    (tmp_path / "STUDY.toml").write_text(
        'specimens = ["oval.toml"]\n' + "".join(
            f'[{loads}]\nmass = ["17.9 g"]\nvoltage = ["0 kV", "2 kV"]\n'
            for loads in ("curves", "alpha_fit", "alpha_held_out")))
    written(tmp_path)
    studied = tympan.study(tmp_path / "STUDY.toml")
    built = tympan.lumped(tympan.load(tmp_path / "oval.toml"), settings=COARSE)
    for column, result in {"voltage": studied, "field_mm": built}.items():
        assert result.to_pandas()[column].notna().any()
        assert result.plot(Figure().add_subplot()).has_data()
        assert list(result.save(tmp_path / column).iterdir())
    assert isinstance(built.models[0].specimen, tympan.Specimen)


def test_a_diagnosis_has_a_picture_and_a_table() -> None:
    size = ShownSize(4.0, "mm", 3.5, 4.4, "")
    causes = tuple(FoundCause(effect="prestretch_loss", which=which, probability=probability,
                              headline="", check="", parameters={"d": size})
                   for which, probability in (("A", 0.9), ("B", 0.04)))
    result = tympan.Result(diagnosed("named", *causes))
    assert result.to_pandas().loc[0].to_dict() == {
        "effect": "prestretch_loss", "which": "A", "probability": 0.9, "parameter": "d",
        **asdict(size)}
    axes = result.plot(Figure().add_subplot())
    assert axes.get_title() == "verdict: named"
    assert [label.get_text() for label in axes.get_yticklabels()] == [
        "prestretch loss of B", "prestretch loss of A"]
    assert [bar.get_width() for bar in axes.patches] == [0.04, 0.9]


def test_a_film_in_time_is_that_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]
                                                ) -> None:
    specimen = circular()
    (tmp_path / "film.toml").write_text(specimen_to_toml(specimen), encoding="utf-8")
    main(["transient", str(tmp_path / "film.toml"), "--mass", "17.9 g", "--signal", "sine",
          "--high", "3 kV", "--duration", "1 s", "--count", "2", "--interval", "10 ms", "--json"])
    printed, = json.loads(capsys.readouterr().out)["responses"]
    result = tympan.transient(specimen, signal="sine", mass="17.9 g", high="3 kV", duration="1 s",
                              count=2, interval="10 ms", at=[0.0, 0.25, 0.5])
    response, = result.responses
    for name in ("first_m", "last_m", "lowest_m", "highest_m", "hysteresis_area_V_m"):
        assert getattr(response, name) == pytest.approx(printed[name], rel=1e-12)
    rows = result.to_pandas()
    assert rows["t_s"].tolist() == pytest.approx(np.linspace(0, 2, 201))
    assert rows["displacement_m"].max() == pytest.approx(response.highest_m, rel=1e-3)
    axes = result.plot(Figure().add_subplot())
    assert axes.get_title() == "voltage between 0 and 3 kV"
    line, = axes.lines
    assert line.get_ydata() == pytest.approx(1e3 * rows["displacement_m"])
    depths = [film.values["displacement"][:, 2].max() for film in result.films[0].values()]
    assert np.argmax(depths) == 1
    at_rest = tympan.solve(specimen, mass="17.9 g", voltage="3 kV")  # it has no branches
    assert depths[1] == pytest.approx(at_rest.deflection_m, rel=5e-4)
    result.plot(tmp_path / "film.gif")
    assert (tmp_path / "film.gif").read_bytes().startswith(b"GIF")
    saved = result.save(tmp_path / "saved")
    assert (saved / "circle.pvd").is_file()
    assert (saved / "response.svg").is_file()
    with pytest.raises(tympan.InputError, match="ask for it at some times"):
        tympan.transient(specimen, mass="17.9 g", duration="1 s").plot(tmp_path / "none.gif")


@pytest.mark.parametrize(("wrong", "words"), [
    ({"signal": "square"}, "signal: given 'square'.*must be step, ramp, sine, random"),
    ({"high": "3 mm"}, "high.*wrong dimension"), ({"duration": 0.0}, "duration.*must be positive"),
    ({"interval": "1 ns"}, "would give more than"), ({"mass": "-1 g"}, "mass"),
])
def test_a_wrong_signal_is_told(wrong: dict[str, object], words: str) -> None:
    with pytest.raises(tympan.InputError, match=words):
        tympan.transient(circular(), **({"mass": "17.9 g"} | wrong))


def test_loads_are_named_and_carry_their_unit() -> None:
    with pytest.raises(tympan.InputError, match="without a name there may be specimen; name the o"):
        tympan.Case(circular(), 20, 3)
    with pytest.raises(tympan.InputError, match=r"17.9 g.*there may be specimen, target"):
        tympan.draw(circular(), None, "17.9 g")
    with pytest.raises(tympan.InputError, match=r"mass.*must be a mass with its unit"):
        tympan.solve(circular(), settings=COARSE, mass="17.9 kV")
    with pytest.raises(tympan.InputError, match=r"must be one of ecoflex-00-30, .*vhb-4905"):
        tympan.material("chewing gum")


#: What a user writes to compare two films along a radius: stress in one axis, a table of each, and
#: a warning of the first limit.
FIFTEEN_LINES = '''
import matplotlib.pyplot as plt
import tympan

figure, axes = plt.subplots()
for radius in ("8 mm", "12 mm"):
    film = tympan.Film("1 mm", 2.236, tympan.material("vhb-4910"))
    plate = tympan.Plate(tympan.Circle(radius), offset=("3 mm", "0 mm"))
    oval = tympan.Specimen(f"oval-{radius}", tympan.Ellipse(("6 cm", "4 cm")), plate, film)
    result = tympan.solve(oval, mass="17.9 g", voltage="3.5 kV")
    line = result.line("x")
    axes.plot(1e3 * line.distance, line["stress_1"] / 1e3, label=radius)
    line["stress_1"].dropna("distance").to_pandas().to_csv(f"{oval.name}.csv")
    print(radius, result.limits.limit.kind, result.limits.limit.voltage_V)
figure.savefig("stress.png")
'''


@dataclass(frozen=True)
class Ran:
    """A script that has run: where, what it printed, and the films that it solved, by name."""

    folder: Path
    printed: str
    solved: dict[str, tympan.Specimen]


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    """The script that compares two films, after its run in this process."""
    folder, solve_plainly = tmp_path_factory.mktemp("script"), tympan.solve
    printed, solved = StringIO(), dict[str, tympan.Specimen]()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(printed):
        patch.chdir(folder)
        patch.setattr(tympan, "solve", lambda specimen, **load: (
            solved.update({specimen.name: specimen}), solve_plainly(specimen, **load))[1])
        exec(FIFTEEN_LINES, {})
        pyplot.close("all")
    return Ran(folder, printed.getvalue(), solved)


def test_a_script_compares_two_films(ran: Ran) -> None:
    assert len([line for line in FIFTEEN_LINES.splitlines() if line]) <= 15
    assert [line.split()[2] for line in ran.printed.splitlines()] == ["tension", "tension"]
    assert (ran.folder / "stress.png").stat().st_size > 5000
    distance, stress = np.loadtxt(ran.folder / "oval-8 mm.csv", delimiter=",", skiprows=1).T
    # From the frame to the plate, nothing on it, and to the frame again; most stress at the plate.
    assert (distance[0], distance[-1]) == pytest.approx((-0.063, 0.057))
    assert np.abs(distance).min() == pytest.approx(8e-3, abs=1e-3)
    assert np.abs(distance[stress.argmax()]) < 10e-3


#: Processor time of the script by that of the command for the same films, at most. Both solve each
#: film once and seek its limits, which is most of it; the script also draws, half as much again.
#: Limits sought again for the line or the picture would be more than twice. On a loaded machine
#: times of equal work differ by a fifth.
SLOWER = 1.9


def test_the_script_takes_no_longer_than_the_command(
        ran: Ran, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    """With one film, in processor time, the least of two turns."""
    monkeypatch.chdir(tmp_path)
    lines = FIFTEEN_LINES.replace('("8 mm", "12 mm")', '("12 mm",)')
    assert lines != FIFTEEN_LINES
    (tmp_path / "oval.toml").write_text(specimen_to_toml(ran.solved["oval-12 mm"]), "utf-8")

    def script() -> None:
        exec(lines, {})
        pyplot.close("all")

    def commands() -> None:
        assert main(["solve", "oval.toml", "--mass", "17.9 g", "--voltage", "3.5 kV",
                     "--json"]) == 0

    spent: dict[Any, list[float]] = {commands: [], script: []}
    with one_thread():  # as the command has it when it is started by itself
        for run in [commands, script] * 2:
            began = time.process_time()
            run()
            spent[run].append(time.process_time() - began)
    said = capsys.readouterr().out
    assert said.count("tension") >= 2
    assert min(spent[script]) < SLOWER * min(spent[commands])


@pytest.fixture(scope="module")
def oval() -> tuple[tympan.Specimen, tympan.Result[CaseResult]]:
    """A film whose plate is off the middle, solved."""
    plate = tympan.Plate(tympan.Circle("1 cm"), offset=("3 mm", "0 mm"))
    film = tympan.Film("1 mm", 2.236, tympan.NeoHooke("20 kPa"), 4.7)
    specimen = tympan.Specimen("oval", tympan.Ellipse(("6 cm", "4 cm")), plate, film)
    return specimen, tympan.solve(specimen, mass="17.9 g", voltage="3.5 kV")


def test_lines_are_those_of_the_field_model(oval: tuple[tympan.Specimen, Any]) -> None:
    """Against the fields on the model's own edges: between points they are linear."""
    specimen, result = oval
    case = Case(specimen, mass="17.9 g", voltage="3.5 kV")
    model, outcome = equilibrate(case, Settings())
    for name in ("x", "y"):
        distance, fields = line_profile(model, outcome.state, name)
        line = result.line(name)
        for key in ("stress_1", "stress_radial", "stretch_1", "thickness"):
            exact = np.interp(line.distance, distance, getattr(fields, key))
            scale = np.ptp(getattr(fields, key))
            away = np.abs(line.distance) > 12e-3  # next to the plate a triangle is not flat
            assert np.abs(line[key] - exact)[away].max() < 5e-3 * scale, key
    assert result.line("x")["stress_1"].attrs["units"] == "Pa"


def test_a_line_has_a_gap_where_the_plate_is(oval: tuple[tympan.Specimen, Any]) -> None:
    """A curve that is drawn breaks there; from frame to frame there is nothing else missing."""
    _, result = oval
    for name in ("x", "y"):
        line = result.line(name)
        step = float(np.diff(line.distance).max())
        assert np.diff(line.distance).min() == pytest.approx(step)  # no place is left out
        in_plate = np.abs(line.distance) < 1e-2 - step
        in_film = np.abs(line.distance) > 1e-2 + step
        for key, values in line.items():
            assert np.isnan(values[in_plate]).all(), key
            assert np.isfinite(values[in_film]).all(), key
        at = result.at(line.distance + 3e-3, 0.0) if name == "x" else result.at(
            3e-3, line.distance)
        np.testing.assert_allclose(at["stress_1"], line["stress_1"], rtol=1e-9)
    assert len(line["stress_1"].dropna("distance")) == int(np.isfinite(line["stress_1"]).sum())


def test_fields_and_places(oval: tuple[tympan.Specimen, Any]) -> None:
    _, result = oval
    fields = result.fields
    assert float(fields["stress_1"].max()) == pytest.approx(result.max_true_stress_Pa, rel=0.02)
    assert fields["displacement"].dims == ("point", "component")
    at = result.at([0.03, 0.1, np.nan], 0.0)
    assert np.isfinite(at["stress_1"].values).tolist() == [True, False, False]
    assert np.isnan(result.at("3 mm", "0 mm")["thickness"].values).all()  # the plate's middle
    # The film's height falls from the plate to the frame.
    heights = result.at(np.linspace(0.014, 0.058, 9), 0.0)["displacement"].sel(component="z")
    assert (np.diff(np.abs(heights.values)) < 0).all()
    with pytest.raises(InputError, match="must be x or y"):
        result.line("z")
    with pytest.raises(InputError, match="this kind of result has none"):
        tympan.limits(oval[0], settings=COARSE, mass="17.9 g").fields  # noqa: B018


def test_limits_and_responses_are_those_of_the_commands(
        oval: tuple[tympan.Specimen, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
        ) -> None:
    specimen, result = oval
    result.save(tmp_path)
    (tmp_path / "oval.toml").write_text(specimen_to_toml(specimen), encoding="utf-8")
    file = str(tmp_path / "oval.toml")
    found = tympan.limits(specimen, mass="17.9 g")
    assert main(["limits", file, "--mass", "17.9 g", "--json"]) == 0
    assert printed_record(capsys.readouterr().out) == json.loads(json.dumps(found.json()))
    assert found.to_pandas()["voltage_V"].tolist() == sorted(found.to_pandas()["voltage_V"])
    moved = tympan.response(specimen, frequency=[1.0, "20 Hz"], mass="17.9 g", voltage="3 kV")
    assert main(["response", file, "--mass", "17.9 g", "--voltage", "3 kV", "--frequency",
                 "1 Hz, 20 Hz", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["amplitude_m_per_V"] == pytest.approx(moved.amplitude_m_per_V, rel=1e-9)
    for drawn in (found, moved):
        drawn.plot(tmp_path / "drawn.png")
    curve = tympan.curve(specimen, mass="17.9 g", voltage=["1 kV", 2e3])
    asked = curve.to_pandas().query("asked > 0")
    assert asked["voltage"].tolist() == [1e3, 2e3]


def matrices(file: Path) -> tuple[Any, ...]:
    """A, B, C and D of a file, as its user reads them."""
    if file.suffix == ".csv":
        block = pd.read_csv(file, index_col=0)
        assert list(block.index[:2]) == ["rate of deflection", "rate of speed"]
        assert block.columns[-1] == "voltage"
        table = block.to_numpy()
        return table[:-1, :-1], table[:-1, -1:], table[-1:, :-1], table[-1:, -1:]
    if file.suffix == ".json":
        stored: Any = json.loads(file.read_text(encoding="utf-8"))["linear"][0]
    else:
        stored = np.load(file) if file.suffix == ".npz" else loadmat(file)
        assert stored["voltage_V"].item() == 2e3
        assert [str(name).strip() for name in stored["states"]][:2] == ["deflection", "speed"]
    return tuple(np.array(stored[name]) for name in "ABCD")


def test_lumped_models_are_those_of_the_commands(tmp_path: Path,
                                                 capsys: pytest.CaptureFixture[str]) -> None:
    specimen, file = circular(), tmp_path / "circle.toml"
    file.write_text(specimen_to_toml(specimen), encoding="utf-8")

    def printed(*arguments: str) -> Any:
        assert main(["lumped", *arguments, "--json"]) == 0
        return printed_record(capsys.readouterr().out)

    built = tympan.lumped.build(specimen, mass=["17.9 g", "22 g"], voltage=("0 kV", "4 kV"),
                                count=5, circles=1)
    assert built.json() == printed("build", str(file), "--mass", "17.9 g, 22 g", "--voltage",
                                   "0 kV..4 kV", "--count", "5", "--circles", "1", "-o",
                                   str(tmp_path))
    model = str(tmp_path / f"{specimen.name}.lumped.toml")
    linear = tympan.lumped.linearise(built.models[0], voltage="2 kV", mass="17.9 g")
    assert linear.json() == printed("linearise", "--model", model, "--voltage", "2 kV", "--mass",
                                    "17.9 g")
    assert linear.to_scipy().A.tolist() == linear.json()["linear"][0]["A"]
    assert linear.to_pandas()["name"].tolist() == [
        pole.name for pole in linear.linear[0].named_poles]
    both = tympan.lumped.linearise(model, replace(specimen, name="other"), voltage="2 kV",
                                   mass="20 g")
    assert [each.specimen for each in both.linear] == ["other", specimen.name]
    with pytest.raises(InputError, match=r"several: choose one by result.linear\[0\]"):
        both.to_scipy()
    with pytest.raises(InputError, match=r"several: choose one by result.linear\[0\]"):
        both.save(tmp_path / "both.mat")
    with pytest.raises(InputError, match=r"be a folder, or end in .json, .csv, .npz or .mat"):
        linear.save(tmp_path / "linear.txt")
    for ending in ("json", "csv", "npz", "mat"):
        file = linear.save(tmp_path / f"python.{ending}")
        same = tmp_path / f"command.{ending}"
        printed("linearise", "--model", model, "--voltage", "2 kV", "--mass", "17.9 g", "--save",
                str(same))
        for found in (matrices(file), matrices(same)):
            for name, matrix in zip("abcd", found, strict=True):
                assert matrix == pytest.approx(getattr(linear.linear[0], name), rel=1e-11)
    moved = tympan.lumped.simulate(model, signal="sine", high="3 kV", duration="1 s", count=2,
                                   mass="17.9 g")
    said = printed("simulate", "--model", model, "--signal", "sine", "--high", "3 kV", "--duration",
                   "1 s", "--count", "2", "--mass", "17.9 g")
    assert json.loads(json.dumps(moved.json())) == said
    identified = moved.save(tmp_path / "readings")
    found = tympan.lumped.identify(identified, model=[model], dynamic=True, limits=False)
    told = printed("identify", str(identified), "--model", model, "--dynamic", "--no-limits")
    assert found.json()["dynamic"]["constants"] == told["dynamic"]["constants"]
    assert found.to_pandas()["name"].tolist() == ["k_1", "eta_1", "eta_2"]
    assert {file.suffix for file in tympan.lumped.export(model, tmp_path)} == {".h", ".c"}
    with pytest.raises(InputError, match="mass: must be given with --fmu"):
        tympan.lumped.export(model, tmp_path, fmu=True)
    with pytest.raises(InputError, match="specimens: give one"):
        tympan.lumped.build()
    with pytest.raises(InputError, match=r"alpha.*is for the paper's cones"):
        tympan.lumped.linearise(specimen, mass="20 g", alpha=(1.0,))


@pytest.mark.parametrize(("call", "words"), [
    (lambda film: tympan.solve("oval.toml"),
     "oval.toml: cannot be read: No such file"),
    (lambda film: tympan.solve(film, settings=3), "settings: given 3: must be a Settings"),
    (lambda film: tympan.solve(film, rig="rig.toml"), "rig.toml"),
    (lambda film: tympan.solve(film, rig={"spring": "3 mm"}), "spring.*wrong dimension"),
    (lambda film: tympan.solve(film, mass=[1, 2]), r"mass: given .*must be one: .*about one state"),
    (lambda film: tympan.solve(film, voltage="0 kV..3 kV"), "voltage: given .*about one state"),
    (lambda film: tympan.curve(film, mass=["1 m"]), "mass.*wrong dimension"),
    (lambda film: tympan.solve(film, direction="side"), "direction: given 'side': must be up"),
    (lambda film: tympan.path(film, along="volt"),
     "along.*must be one of .*did you mean 'voltage'"),
    (lambda film: tympan.modes(film, count=2.5), "count: given 2.5: must be a whole number"),
    (lambda film: tympan.force(film, to=[]), "to: given .*must be a number or a text"),
    (lambda film: tympan.force(film, too="1 mm"), "too: unknown name: did you mean 'to'"),
    (lambda film: tympan.load(3), "file: given 3: must be a text or a path"),
    (lambda film: tympan.Film("1 mm", 2.2, 3), "material: given 3: must be one of NeoHooke"),
    (lambda film: tympan.Plate("1 cm"), "outline: given '1 cm': must be one of"),
    (lambda film: tympan.Specimen("a", tympan.Circle(0.04), "1 cm", film.membrane),
     "plate: given '1 cm': must be a Plate"),
    (lambda film: tympan.limits(film, pressure="3 kV"), "pressure.*wrong dimension"),
    (lambda film: tympan.lumped.linearise(3), "given 3: must be a Specimen or a LumpedModel or"),
    (lambda film: tympan.path(film, mass="1 g", turn="3 kV"), "turn.*rate must be given too"),
    (lambda film: tympan.Case("x"), "specimen: given 'x': must be a Specimen; tympan.load"),
    (lambda film: tympan.transient([3]), "specimen: given 3: must be a Specimen or"),
    (lambda film: tympan.alpha(film, alpha_settings=3),
     "alpha_settings: given 3: must be an AlphaSettings"),
    (lambda film: tympan.Settings(mesh="fine"), "mesh: given 'fine': must be a MeshSettings"),
    (lambda film: tympan.MeshSettings(growth="x"), "growth: given 'x': must be a number"),
    (lambda film: tympan.Polygon([3, 4, 5]), "vertices.*must be pairs of numbers"),
    (lambda film: replace(film, plate=tympan.Plate(tympan.Circle(0.01), (0.04, 0.0))),
     "plate: given 'circle of 20 × 20 mm, offset 40 mm, 0 mm': the plate must lie inside"),
    (lambda film: tympan.export(film, "x", width="20 m"), "width: given '20000 mm': must be from"),
])
def test_a_wrong_argument_is_one_clear_message(call: Any, words: str) -> None:
    with pytest.raises(tympan.InputError, match=words):
        call(circular())


class Wrong:
    """A type that no argument has."""


#: Enough to ask anything else of a door.
RIGHT: dict[str, Any] = {"specimen": circular(), "file": "none.toml", "dataset": "none",
                         "name": "vhb-4910", "folder": "none", "model": "none.lumped.toml"}


def arguments(function: Any) -> list[str]:
    """Names of all arguments, those that are handed on as well."""
    listed = inspect.signature(inspect.unwrap(function)).parameters.values()
    handed = {name: kind for name, kind in vars(door).items() if is_typeddict(kind)}
    return [name for item in listed for name in (
        [] if item.kind is item.VAR_POSITIONAL else
        handed[re.search(r"\[(\w+)\]", str(item.annotation)).group(1)].__annotations__
        if item.kind is item.VAR_KEYWORD else [item.name])]


@pytest.mark.parametrize("wrong", [Wrong(), [Wrong()]], ids=["object", "list"])
@pytest.mark.parametrize("name", [
    *(name for name in tympan.__all__ if callable(getattr(tympan, name))
      and name not in ("InputError", "Result", "FilmFamily", "lumped")),
    *(f"lumped.{name}" for name in vars(type(tympan.lumped)) if not name.startswith("_"))])
def test_an_argument_of_a_wrong_type_is_an_input_error(name: str, wrong: Any) -> None:
    """Of every public function and part; results are made by functions, a family by ``of``."""
    function = attrgetter(name)(tympan)
    asked = inspect.signature(function).parameters
    right = {key: value for key, value in RIGHT.items() if key in asked
             and asked[key].default is inspect.Parameter.empty}
    for argument in arguments(function):
        with pytest.raises(tympan.InputError):
            function(**{**({} if isinstance(function, type) else right), argument: wrong})


#: One question of each kind that stores a result, each in less than a second.
STORED: dict[str, dict[str, Any]] = {
    "solve": {"mass": "17.9 g", "voltage": "2 kV"}, "curve": {"mass": ["10 g", "17.9 g"]},
    "force": {"mass": "10 g", "voltage": "0 kV, 2 kV", "points": 7}, "sense": {"mass": "10 g"},
    "modes": {"mass": "10 g"}, "path": {"mass": "10 g"},
    "response": {"mass": "10 g", "voltage": "2 kV"}, "tolerance": {"mass": "10 g", "films": 200},
    "transient": {"mass": "10 g", "duration": "0.1 s", "interval": "10 ms"}}


@pytest.mark.parametrize("name", [*STORED])
def test_a_result_is_read_back_and_is_the_same(name: str, tmp_path: Path) -> None:
    found = getattr(tympan, name)(circular(), settings=COARSE, **STORED[name])
    back = tympan.Result.load(found.save(tmp_path / "there"))
    for other in (back, pickle.loads(pickle.dumps(found))):
        assert type(other.numbers) is type(found.numbers)
        assert other.json() == found.json()
    assert back.to_pandas().shape == found.to_pandas().shape
    with pytest.raises(InputError, match="holds none of"):
        tympan.Result.load(tmp_path)


def test_columns_are_found_by_their_names() -> None:
    curve = tympan.curve(circular(), mass=["10 g", "17.9 g"], settings=COARSE)
    table = curve.to_pandas()
    assert (curve["deflection"] == table["deflection"].to_numpy()).all()
    solved = tympan.solve(circular(), mass="17.9 g", voltage="2 kV", settings=COARSE)
    assert solved["deflection"] == solved["deflection_m"] == solved.deflection_m
    assert solved["max stretch"] == solved.max_stretch
    with pytest.raises(InputError, match="did you mean 'deflection'"):
        solved["deflektion"]


def test_bands_of_a_film_in_time_are_refused_and_those_at_rest_are_not() -> None:
    with pytest.raises(InputError, match="is for films at rest: after must be left out"):
        tympan.solve(circular(), mass="10 g", after="1 s", tolerances=tympan.Tolerances())
    assert "deflection_m" in tympan.solve(circular(), mass="10 g",
                                          tolerances=tympan.Tolerances()).bands


def test_options_are_those_of_the_commands(tmp_path: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    specimen, file = circular(), str(tmp_path / "circle.toml")
    Path(file).write_text(specimen_to_toml(specimen), encoding="utf-8")

    def printed(*arguments: str) -> Any:
        assert main([*arguments, "--json"]) == 0
        return printed_record(capsys.readouterr().out)

    found = tympan.solve(specimen, mass="17.9 g", voltage="2 kV", pressure="20 Pa", direction="up",
                         after="1 s")
    told = printed("solve", file, "--mass", "17.9 g", "--voltage", "2 kV", "--pressure", "20 Pa",
                   "--direction", "up", "--after", "1 s")
    assert found.deflection_m == told["deflection_m"]
    assert tympan.limits(specimen).mass_kg == printed("limits", file)["mass_kg"]
    told = printed("modes", file, "--mass", "17.9 g", "--point-mass", "10 g", "--count", "2")
    swung = tympan.modes(specimen, count=2, mass="17.9 g", point_mass="10 g")
    assert [mode.frequency_Hz for mode in swung.modes] == [
        mode["frequency_Hz"] for mode in told["modes"]]
    loop = tympan.path(specimen, mass="17.9 g", rate="1 kV/s", turn="2 kV", fields=True)
    told, = printed("path", file, "--mass", "17.9 g", "--rate", "1 kV/s", "--to",
                    "2 kV")["responses"]
    assert loop.responses[0].highest_m == told["highest_m"]
    assert len(loop.films[0]) == 25
    assert tympan.show_material("vhb-4910").json() == printed("material", "show", "vhb-4910")
    assert tympan.effects() == printed("effects")
    assert list(tympan.materials()) == list(printed("materials"))
    files = tympan.export(specimen, tmp_path / "parts", screw="4 mm")
    assert {file.suffix for file in files} == {".step", ".dxf", ".svg", ".vtu"}
    inp, = tympan.export(specimen, tmp_path, inp=True, mass=["10 g"], voltage="1 kV")
    assert inp.suffix == ".inp"
    found.save(tmp_path / "solved")
    assert [file.suffix for file in tympan.report(tmp_path / "solved")]


def test_notebooks_and_datasets_have_units(solved: tympan.Result[CaseResult]) -> None:
    shown = solved._repr_html_()
    cells = re.sub(r"\s+", "", shown)
    assert f"<td>deflection_m</td><td>{solved.deflection_m:.6g}</td><td>m</td>" in cells
    assert "data:image/png;base64" in shown
    state = solved.to_xarray()
    assert state["deflection_m"].attrs["units"] == "m"
    assert state["stress_1"].dims == ("point",)
    pushed = tympan.force(circular(), to="2 mm", voltage=["0 kV", "2 kV"], points=3,
                          settings=COARSE)
    curves = pushed.to_xarray()
    assert dict(curves.sizes) == {"voltage_V": 2, "displacement_m": 3}
    assert curves["force_N"].attrs["units"] == "N"
    assert curves["voltage_V"].attrs["units"] == "V"
    for voltage, curve in zip((0.0, 2e3), pushed.curves, strict=True):
        assert curves["force_N"].sel(voltage_V=voltage).values == pytest.approx(curve.force_N)
    assert "<th>displacement_m</th>" in pushed._repr_html_()
    # What is printed is the same table, cut.
    lines = [line.split() for line in str(solved).splitlines()]
    assert lines[0] == ["CaseResult"]
    assert ["deflection_m", f"{solved.deflection_m:.6g}", "m"] in lines
    assert "displacement_m" in repr(pushed)
    many = tympan.Result(replace(pushed.numbers, curves=100 * pushed.curves))
    assert len(many.to_pandas()) == 600
    assert len(str(many).splitlines()) < 20
    assert max(map(len, str(many).splitlines())) <= 120
    linear = tympan.sensitivity(circular(), of="heave", settings=COARSE, mass="17.9 g").to_xarray()
    assert set(linear.dims) == {"quantity", "parameter"}
