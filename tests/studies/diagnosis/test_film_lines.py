"""Readings over the film: shapes against the axisymmetric membrane and the whole field model on
other meshes, and what they tell that heaves do not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.trials.strata import lines as film_lines
from benchmarks.trials.strata.evidence import Evidence, cross, seen_heights
from benchmarks.trials.synthetic_trials import FINEST, MESHES
from tests.oracles.axisymmetric import solve_deflection
from tests.support.costs import dear
from tests.support.datasets import HEAD, write_dataset
from tests.support.library import among
from tests.support.specimens import circular, reference_film, skewed
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.places import Places
from tympan.geometry.mesher import MeshSettings
from tympan.reports.diagnosis.page import build_diagnosis_page
from tympan.studies.case import Settings, build_model
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import calibrated, film_error
from tympan.studies.diagnosis.diagnose import diagnose, judge_dataset
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.reduced.film_shape import ALONG, AROUND, FilmShape, lattice_of
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.reduced.sampling import COARSE
from tympan.studies.diagnosis.result import Diagnosis

STATIC = "specimen,mass_g,voltage_kV,displacement_mm\n" + "".join(
    f"A,17.9,{kv},{2 + 0.03 * kv**2}\n" for kv in range(5))
FIELD = "specimen,mass_g,voltage_kV,x_mm,y_mm,displacement_mm"


def shape_of(film: Model, state: State) -> FilmShape:
    lattice = lattice_of(film.specimen.frame, film.specimen.plate)
    moved = Places.of(film.discretisation, lattice.flat).displacement(film, state)
    return FilmShape.of(lattice, moved.T.reshape(3, ALONG, AROUND))


@pytest.mark.parametrize(("heave", "voltage"), [(3e-3, 0.0), (12e-3, 3e3)])
def test_a_laser_sees_the_axisymmetric_membrane(heave: float, voltage: float) -> None:
    """Within 2 µm, and not what lay there in the flat film."""
    exact = solve_deflection(reference_film(circular().membrane.material), heave, voltage)
    mounted = np.linspace(10e-3, 45e-3, 400)
    film = build_model(circular(), Settings(mesh=MeshSettings(around_plate=16, growth=0.5)))
    outcome = held(film, heave, voltage)
    seen = shape_of(film, outcome.state)
    radius = np.linspace(11e-3, 44.5e-3, 50)
    for angle in (0.0, 0.4, 2.0):
        places = radius[:, None] * np.array([np.cos(angle), np.sin(angle)])
        there = np.interp(radius, exact.r(mounted), exact.z(mounted))
        assert seen.heights(places) == pytest.approx(there, abs=2e-6)
        moved = seen.displacements(places)
        assert moved[2] == pytest.approx(exact.z(radius), abs=2e-6)
        assert np.hypot(*(places + moved[:2].T).T) == pytest.approx(exact.r(radius), abs=2e-6)
    assert seen.heights(np.array([[0.0, 0.0], [5e-3, -6e-3]])) == pytest.approx(heave)
    assert seen.heights(np.array([[46e-3, 0.0]])) == pytest.approx(0.0)
    if heave > 10e-3:
        assert np.abs(seen.heights(places) - moved[2]).max() > 20e-6


def test_a_laser_sees_a_tilted_plate_and_a_film_without_symmetry() -> None:
    """Against places sought step by step in the whole field model on a mesh of another order."""
    films = [build_model(skewed(), settings) for settings in (COARSE, MESHES[FINEST])]
    states = [equilibrium(film, 0.1, 2e3).state for film in films]
    assert states[0].plate.tilt > 4e-3
    places = np.concatenate([cross(skewed()), skewed().plate.points(40).T])
    seen = shape_of(films[0], states[0]).heights(places)
    assert seen == pytest.approx(seen_heights(films[1], states[1], places), abs=5e-6)


def test_a_plate_that_slides_bares_film() -> None:
    """Where it lay, against the whole field model; an uneven film pulls it 2 mm aside."""
    uneven = replace(circular(), membrane=replace(circular().membrane,
                                                  thickness_gradient=(0.15, -0.02)))
    films = [build_model(uneven, settings) for settings in (COARSE, MESHES[FINEST])]
    states = [equilibrium(film, 0.22, 3e3).state for film in films]
    assert states[0].plate.translation[0] > 1e-3
    places = np.column_stack([np.linspace(-14e-3, -6e-3, 60), np.full(60, 0.5e-3)])
    seen = shape_of(films[0], states[0]).heights(places)
    assert seen == pytest.approx(seen_heights(films[1], states[1], places), abs=10e-6)


@pytest.fixture(scope="module")
def plain() -> Evidence:
    """What is read of the round film in which nothing is hidden."""
    return film_lines.seen(shapes=["round"])


def test_shapes_of_the_reduced_model_and_their_derivatives(tmp_path: Path, plain: Evidence) -> None:
    """Against finite elements on a fine mesh within 3 µm, and differences of themselves."""
    data = film_lines.write(tmp_path / "d", seed=3, shapes=["round"], read=plain)
    readings = prepared_readings(read_dataset(data))
    nominal = calibrated(readings.setup, readings.table)
    assert 0 < film_error(nominal.simulation, nominal.fit, nominal.table)["film"] < 3e-6
    hypothesis = (Cause("parallel_spring"), Cause("sensor_gain"))
    centre = np.array([0.05, -0.03, 4.0, 0.02])
    jacobian = Prediction(nominal.simulation, hypothesis, centre, nominal.table).jacobian
    rows = nominal.table.rows_of["film"]
    for number, step in enumerate(1e-3 * np.abs(centre)):
        ends = [nominal.simulation.predict(hypothesis, centre + sign * step * np.eye(4)[number],
                                           nominal.table)[rows] for sign in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * step)
        assert jacobian[rows, number] == pytest.approx(slope, rel=2e-3,
                                                       abs=1e-4 * np.abs(slope).max() + 1e-9)
    assert not jacobian[rows, 3].any(), "the sensor of the plate does not read the line"


def test_lines_have_a_zero_of_their_own(tmp_path: Path, plain: Evidence) -> None:
    """A length added to all of a line, here some 0.2 mm, moves what is judged by its 500th."""
    tables = [prepared_readings(read_dataset(film_lines.write(
        tmp_path / name, seed=3, shapes=["round"], zero=zero, read=plain))).table
        for name, zero in (("none", 0.0), ("some", 0.2e-3))]
    rows = tables[0].rows_of["film"]
    apart = tables[1].value[rows] - tables[0].value[rows]
    for scan in np.unique(tables[0].scan[rows]):
        added = apart[tables[0].scan[rows] == scan]
        assert added == pytest.approx(added[:1].repeat(len(added)), abs=1e-12)
    seen = np.abs(tables[0].noise[rows].apart(apart))
    assert 0 < seen.max() < 1e-6


@pytest.mark.parametrize(("effect", "sizes"), [
    pytest.param("plate_eccentricity", (1e-3, -0.5e-3), marks=pytest.mark.study),
    dear("thickness_gradient", (0.15, -0.03), seconds=99)])
def test_a_line_names_what_moves_the_film_aside(tmp_path: Path, effect: str,
                                                sizes: tuple[float, ...]) -> None:
    line = film_lines.write(tmp_path / "line", [(effect, sizes, None)], 1, shapes=["round"])
    _, judged, _ = judge_dataset(read_dataset(line))
    assert [str(cause) for cause in judged.named] == [effect]
    assert judged.chosen is not None
    assert judged.chosen.unknowns[2:] == pytest.approx(sizes, rel=0.1, abs=0.05e-3)


@pytest.mark.study(seconds=18)
@among("strain_stiffening", "prestretch_anisotropy", "plate_eccentricity", "thickness_gradient",
       "sensor_gain", seconds=43)
def test_what_heaves_do_not_tell_a_line_names(tmp_path: Path) -> None:
    """And the page and the file say so."""
    effect, size = "prestretch_anisotropy", 0.03
    read = film_lines.seen([(effect, (size,), None)], ["round"])
    heaves, line = (read_dataset(film_lines.write(tmp_path / name, seed=1, shapes=["round"],
                                                  places=places, read=read))
                    for name, places in (("heaves", None), ("line", cross)))
    assert judge_dataset(heaves)[1].verdict != "named"
    diagnosis = diagnose(line)
    assert diagnosis.verdict == "named"
    diagnosis.save(tmp_path / "out")
    page, = build_diagnosis_page(Diagnosis.load(tmp_path / "out"), tmp_path / "out")
    assert "What they leave over the films" in page.read_text(encoding="utf-8")
    cause = diagnosis.json()["causes"][0]
    assert cause["effect"] == effect
    (parameter,) = cause["parameters"].values()
    assert parameter["value"] == pytest.approx(size, rel=0.1)


@pytest.mark.study(seconds=60)
def test_a_spot_without_electrode_is_named_by_a_line(tmp_path: Path) -> None:
    """By films of other meshes and order; without a line nothing is said of spots."""
    sizes = (20e-3, -12e-3, 0.5)
    read = film_lines.seen([("electrode_patch", sizes, "round")], ["round"])
    heaves, line = (film_lines.write(tmp_path / name, seed=1, shapes=["round"], places=places,
                                     read=read)
                    for name, places in (("heaves", None), ("line", cross)))
    spot = Cause("electrode_patch", "round")
    assert spot not in prepared_readings(read_dataset(heaves)).causes
    verdict = diagnose(read_dataset(line)).json()
    assert verdict["verdict"] == "named"
    cause = verdict["causes"][0]
    assert (cause["effect"], cause["which"]) == (spot.name, spot.which)
    for parameter, size in zip(cause["parameters"].values(), sizes, strict=True):
        unit = {"mm": 1e-3}.get(parameter["unit"], 1.0)
        assert parameter["low"] <= size / unit <= parameter["high"]
        assert parameter["high"] - parameter["low"] < 0.75 * abs(size) / unit or unit == 1.0


@pytest.mark.study
@pytest.mark.parametrize(("effect", "sizes"), [
    ("electrode_margin", (6e-3,)), ("plate_eccentricity", (2e-3, -1e-3)),
    ("thickness_gradient", (0.15, -0.03))])
def test_what_lies_over_a_film_otherwise_is_no_spot(tmp_path: Path, effect: str,
                                                    sizes: tuple[float, ...]) -> None:
    data = film_lines.write(tmp_path / "d", [(effect, sizes, None)], 1, shapes=["round"])
    verdict = diagnose(read_dataset(data)).json()
    listed = {cause["effect"]: cause["probability"] for cause in verdict["causes"]}
    assert listed[effect] > 0.9
    assert listed.get("electrode_patch", 0.0) < 0.1


def test_nothing_hidden_in_lines_is_nothing_found(tmp_path: Path, plain: Evidence) -> None:
    data = film_lines.write(tmp_path / "d", seed=2, shapes=["round"], read=plain)
    assert judge_dataset(read_dataset(data))[1].verdict == "nothing"


def test_places_off_the_film_get_line_and_column(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for place, column in (("50,0", "column 4 (x_mm)"), ("10,-46", "column 5 (y_mm)")):
        data = write_dataset(tmp_path / "d", 'noise = "20 um"\n' + HEAD, static=STATIC,
                             field=f"{FIELD}\nA,17.9,0,10,0,1.9\nA,17.9,0,{place},1.9\n")
        assert main(["diagnose", str(data), "-o", str(tmp_path / "out")]) == 2
        err = capsys.readouterr().err
        assert f"line 3, {column}" in err
        assert "must lie on the film or the plate" in err
        assert err.count("\n") == 1


def test_places_may_be_counted_from_the_plate(tmp_path: Path) -> None:
    """The same readings with the plate off centre, in both frames."""
    offset = (4e-3, -2e-3)

    def moved(places: np.ndarray) -> np.ndarray:
        return places - [4e-3, -2e-3]

    def inside(specimen: object) -> np.ndarray:
        return cross(circular())[5:-5] * 0.8

    read, fits = film_lines.seen([], ["round"], offset, inside), []
    for name, head, change in (("table", {}, lambda places: places),
                               ("plate", {"field_frame": "plate"}, moved)):
        data = film_lines.write(tmp_path / name, seed=3, shapes=["round"], offset=offset, head=head,
                                places=inside, change=change, read=read)
        readings = prepared_readings(read_dataset(data))
        fits.append(calibrated(readings.setup, readings.table).fit)
    assert fits[0].residual == pytest.approx(fits[1].residual, abs=1e-3)
    assert fits[0].chi_squared < 1.3 * len(fits[0].residual)


WRITTEN = {
    "x mirrored": [[-1, 0], [0, 1]], "y mirrored": [[1, 0], [0, -1]],
    "half a turn": [[-1, 0], [0, -1]], "x and y swapped": [[0, 1], [1, 0]],
    "90 degrees to the left": [[0, 1], [-1, 0]], "90 degrees to the right": [[0, -1], [1, 0]],
    "in cm": [[0.1, 0], [0, 0.1]]}


OFFSET = (4e-3, -2.5e-3)


@pytest.fixture(scope="module")
def off_centre() -> Evidence:
    """What is read of a film whose plate is known to sit off centre."""
    return film_lines.seen([], ["round"], OFFSET)


@pytest.mark.parametrize("frame", WRITTEN)
def test_another_frame_is_told_before_it_gets_a_cause(tmp_path: Path, off_centre: Evidence,
                                                      frame: str) -> None:
    """A plate known to sit off centre makes every one of them another film."""
    data = film_lines.write(tmp_path / "d", seed=3, shapes=["round"],
                            offset=OFFSET, read=off_centre,
                            change=lambda places: places @ np.array(WRITTEN[frame]).T)
    with pytest.raises(InputError, match=r"fits better with .* \(p below 1e-") as answer:
        diagnose(read_dataset(data))
    assert frame in str(answer.value)


@pytest.mark.parametrize(("factor", "words"), [(-1.0, "opposite sign"), (0.1, "ten times")])
def test_wrong_displacements_of_lines_are_told_as_such(tmp_path: Path, plain: Evidence,
                                                       factor: float, words: str) -> None:
    data = film_lines.write(tmp_path / "d", seed=3, shapes=["round"], scale=factor, read=plain)
    with pytest.raises(InputError, match=words):
        diagnose(read_dataset(data))
