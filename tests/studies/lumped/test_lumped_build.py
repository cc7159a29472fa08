"""The lumped model built from the field model: its errors, its formulas typed again, its file, and
the command."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.constants import epsilon_0, g
from scipy.integrate import quad

from tests.oracles import axisymmetric
from tests.support.checks.json_schema import printed_record
from tests.support.specimens import circular, elliptical
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.laws import Gent, NeoHooke, Ogden, Stiffened
from tympan.fem.film.library import MATERIALS, load_specimen
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Circle, Ellipse, examples
from tympan.geometry.specimen import Electrode, Plate, Specimen
from tympan.paper.published import MASSES
from tympan.studies.case import Settings
from tympan.studies.circles import MembraneCircle
from tympan.studies.lumped.actuator import Viscous
from tympan.studies.lumped.build import BuildResult, BuildSettings, Built, build
from tympan.studies.lumped.equilibria import rest_curve
from tympan.studies.lumped.model_file import LumpedModel, read_model, write_model
from tympan.studies.lumped.simulate import simulate
from tympan.studies.signals import step

ACTUATORS = Path(__file__).parents[3] / "studies" / "shipped"
FEW = BuildSettings(MASSES, tuple(np.linspace(0.0, 5e3, 7)))
TAPE = Ogden((18.4e3, 210.0), (2.0, 4.0))
MODEL = LumpedModel(elliptical(75e-3, TAPE), (45e-3, 75e-3), (0.6, 0.4), 2.14e-9, 5e3, 1.02, 0.95,
                    Viscous(1e6, 2e6, 3e4))


@cache
def of_paper(name: str) -> Built:
    return build(load_specimen(str(ACTUATORS / f"{name}.toml")), Settings(), FEW)


@pytest.fixture(params=["circular", "elliptical-small", "elliptical-large"])
def actuator(request: pytest.FixtureRequest) -> Built:
    return of_paper(request.param)


def test_the_papers_actuators_within_one_per_cent(actuator: Built) -> None:
    """Issue 6's line, at loads of both masses, and ten times better; α alone does it, cones miss by
    their factor."""
    assert actuator.worst("corrected", held_out=False) < 1e-3
    assert actuator.worst("corrected", held_out=True) < 1e-3
    assert actuator.worst("membrane", held_out=True) < 1e-3
    assert actuator.worst("cone", held_out=True) > 1.0
    assert actuator.stroke_error("corrected") < 2e-3
    assert actuator.capacitance_error("corrected") < 1e-4
    assert not actuator.warnings


def test_the_fit_saw_three_loads_of_one_mass(actuator: Built) -> None:
    assert actuator.settings.fitted.sum(axis=1).tolist() == [3, 0]


def test_heave_of_the_model_is_the_fields(actuator: Built) -> None:
    """Independent of the fit, which saw forces alone: the field model's eigenvalues."""
    assert actuator.frequencies["lumped"] == pytest.approx(actuator.frequencies["field"], rel=1e-3)


def test_cones_miss_by_the_membrane_factor() -> None:
    """Without voltage a film that hardly stiffens sinks as its stiffness says: 2.33 for the circle.
    """
    circle = of_paper("circular")
    factor, = circle.model.circles.membrane_factor
    assert circle.errors("cone")[0, 0] + 1 == pytest.approx(factor, rel=5e-3)
    assert factor == pytest.approx(2.33, abs=0.005)


@pytest.mark.parametrize(("law", "mine", "near"), [
    (NeoHooke(20e3), axisymmetric.neo_hooke(20e3), 1e-3),
    (TAPE, axisymmetric.Ogden(TAPE.mu, TAPE.alpha), 1e-3),
    (Ogden((30e3, 2e3), (1.3, 5.5)), axisymmetric.Ogden((30e3, 2e3), (1.3, 5.5)), 1e-3)],
                         ids=["neo", "tape", "stiff"])
def test_a_circle_against_the_axisymmetric_equations(law: Any, mine: Any, near: float) -> None:
    """No field model and no fit: membrane theory against the spectral solution, to 5 kV under both
    masses."""
    model = LumpedModel(circular(law), (45e-3,), (1.0,), 1.26e-9, 5e3)
    film = axisymmetric.Film(10e-3, 45e-3, 1e-3, 5**0.5, mine, 4.7)
    for mass in (17.9e-3, 22.45e-3):
        voltages = np.array([0.0, 3.5e3, 5e3])
        exact = [axisymmetric.solve_load(film, mass * g, float(u)).deflection for u in voltages]
        rests = rest_curve(model.actuator(mass, Rig(gravity=g)), voltages)
        assert rests == pytest.approx(exact, rel=near)


def test_energy_is_the_whole_films_to_fourth_order() -> None:
    """∫ Ψ over a film with the slopes of y ln(R/ρ)/ln(R/r), by quadrature: the difference falls
    with y⁶."""
    circle, law, root = MembraneCircle(circular(TAPE), 45e-3), TAPE, 5**0.5
    differences = []
    for y in (4e-3, 2e-3):
        def energy(rho: float, y: float = y) -> float:
            slope = y / (rho * np.log(4.5))
            w, flat = (law.derivatives(root * stretch, root)[0]
                       for stretch in (np.hypot(1.0, slope), 1.0))
            return float(2 * np.pi * rho * 200e-6 * (w - flat))

        whole = quad(energy, 10e-3, 45e-3, epsabs=0, epsrel=1e-12)[0]
        differences.append(abs(circle.elastic(y)[0] - whole))
        assert differences[-1] < 1e-3 * whole
    assert np.log2(differences[0] / differences[1]) == pytest.approx(6.0, abs=0.1)


def test_force_derives_from_energy_and_capacitance() -> None:
    """By a complex step: F = dE/dy, and the voltage pulls with ½U² dC/dy."""
    moved, stepped = MODEL.actuator(17.9e-3), 3e-3 + 1e-30j
    energy, force, stiffness = moved.elastic(stepped)
    assert energy.imag / 1e-30 == pytest.approx(force.real, rel=1e-12)
    assert force.imag / 1e-30 == pytest.approx(stiffness.real, rel=1e-12)
    drawn = moved.capacitance(stepped).imag / 1e-30 / 2
    assert -moved.electric(3e-3)[1] == pytest.approx(drawn, rel=1e-12)
    assert moved.capacitance(0.0) == pytest.approx(MODEL.flat_capacitance, rel=1e-12)


def test_the_files_formulas_give_the_same(tmp_path: Path) -> None:
    """The comment at the head of the file, typed again on nothing but its numbers."""
    write_model(tmp_path / "a.lumped.toml", MODEL)
    read = tomllib.loads((tmp_path / "a.lumped.toml").read_text(encoding="utf-8"))
    film, r = read["specimen"]["membrane"], read["specimen"]["plate"]["radius_m"]
    thick, lp = film["thickness_m"], np.sqrt(np.prod(film["prestretch"]))
    y, u, energy, capacitance = 3e-3 + 1e-30j, 4e3, 0.0, read["flat_capacitance_F"]

    def w(l1: Any, l2: Any) -> Any:
        pairs = zip(film["material"]["mu_Pa"], film["material"]["alpha"], strict=True)
        return sum(mu / a * (l1**a + l2**a + (l1 * l2) ** -a - 3) for mu, a in pairs)

    for circle in read["circle"]:
        outer, alpha = circle["radius_m"], circle["alpha"]
        log = np.log(outer / r)
        k = np.sqrt((1 / r**2 - 1 / outer**2) / (2 * log**3))
        volume = 2 * np.pi * thick / lp**2 / log / k**2
        stretch = lp * np.sqrt(1 + (k * y) ** 2)
        energy += read["stiffness"] * alpha * volume * (w(stretch, lp) - w(lp, lp))
        capacitance += (read["permittivity"] * alpha * volume * epsilon_0
                        * film["relative_permittivity"]
                        * (stretch**2 - lp**2) * lp**2 / thick**2)
    moved = MODEL.actuator(17.9e-3)
    force = (energy.imag - u**2 / 2 * capacitance.imag) / 1e-30
    assert moved.balance(3e-3, u)[0] + moved.load == pytest.approx(force, rel=1e-10)
    assert moved.capacitance(3e-3) == pytest.approx(capacitance.real, rel=1e-10)


FILMS = {"tape": TAPE, "gent": Gent(18e3, 110.0), "nested": Stiffened(NeoHooke(20e3), 1.2, 30.0)}


@pytest.mark.parametrize("name", [*examples(), *FILMS])
def test_reads_back_equal(name: str, tmp_path: Path) -> None:
    """Every registered outline, and laws with constants of all kinds."""
    specimen = replace(circular(FILMS[name]), name="45 mm") if name in FILMS else \
        replace(circular(TAPE), frame=examples()[name],
                plate=Plate(Ellipse((5e-3, 4e-3)), (1e-3, 0.0)))
    model = replace(MODEL, specimen=specimen)
    write_model(tmp_path / "a.lumped.toml", model)
    assert read_model(tmp_path / "a.lumped.toml") == model


def test_a_model_read_back_responds_the_same(tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "a.lumped.toml"
    write_model(file, MODEL)
    signal, time = step(0.0, 3e3, 0.0, 0.5), np.linspace(0, 0.5, 51)
    made, read = (simulate(model.actuator(17.9e-3), signal).deflection(time)
                  for model in (MODEL, read_model(file)))
    assert read == pytest.approx(made, rel=1e-12)
    main(["lumped", "simulate", "--model", str(file), "--mass", "17.9 g", "--high", "3 kV",
          "--duration", "0.5 s", "--json"])
    (response,) = json.loads(capsys.readouterr().out)["responses"]
    assert response["last_m"] == pytest.approx(made[-1], rel=1e-9)
    assert not response["warnings"]


ODD = {
    "bands": replace(circular(TAPE), electrode=Electrode(5e-3, 5e-3)),
    "plate": replace(circular(TAPE), plate=Plate(Ellipse((15e-3, 8e-3)))),
    "off centre": replace(circular(TAPE), plate=Plate(Circle(10e-3), (10e-3, 0.0))),
    "prestretch": circular(TAPE, prestretch=(2.6, 2.0)),
}


@pytest.mark.parametrize("name", ODD)
def test_factors_carry_what_circles_do_not_know(name: str) -> None:
    """At loads that were not fitted: more than 1 % without the factors, below with them."""
    built = build(ODD[name], Settings(), replace(FEW, masses=(15e-3, 22.45e-3)))
    plain, corrected = (built.worst(kind, held_out=True) for kind in ("membrane", "corrected"))
    assert plain is not None
    assert corrected is not None
    assert corrected < 5e-3 < 0.02 < plain
    assert ("capacitance" in " ".join(built.warnings)) == (name == "bands")


@pytest.mark.parametrize("shape", ["superellipse", "stadium"])
def test_shapes_that_nothing_but_alpha_was_fitted_on(shape: str) -> None:
    """With the factors of the circle."""
    built = build(replace(elliptical(75e-3, TAPE), frame=_frame(shape)), Settings(), FEW)
    circle = of_paper("circular").model
    other = replace(built, model=replace(built.model, stiffness=circle.stiffness,
                                         permittivity=circle.permittivity))
    worst = other.worst("corrected", held_out=True)
    assert worst is not None
    assert worst < 1e-3


@pytest.mark.study
@pytest.mark.parametrize("name", [*examples(), *MATERIALS])
def test_every_outline_and_every_material_within_one_per_cent(name: str) -> None:
    """Held-out loads; circles by sectors, as some outlines' semi-axes are no circles that stand for
    them."""
    circle = load_specimen(str(ACTUATORS / "circular.toml"))
    specimen = replace(circle, frame=examples()[name]) if name in examples() else \
        replace(circle, membrane=replace(circle.membrane, material=MATERIALS[name].material))
    built = build(specimen, Settings(), replace(FEW, radii="sectors"))
    worst = built.worst("corrected", held_out=True)
    assert worst is not None
    assert worst < 0.01
    assert not built.warnings


def test_a_rigs_spring_and_amplifier_are_in_both_models() -> None:
    rig = Rig(spring=5.0, unaccounted_mass=1e-3, amplifier_gain=0.05)
    built = build(load_specimen(str(ACTUATORS / "circular.toml")), Settings(), FEW, rig)
    assert built.worst("corrected", held_out=True) < 1e-3
    assert built.frequencies["lumped"] == pytest.approx(built.frequencies["field"], rel=1e-3)


def _frame(shape: str) -> Any:
    from tympan.geometry.outlines import Stadium, Superellipse

    return Stadium((75e-3, 45e-3)) if shape == "stadium" else Superellipse((75e-3, 45e-3), 4.0)


def _softened(specimen: Specimen) -> Specimen:
    return replace(specimen, membrane=replace(specimen.membrane, material=NeoHooke(15e3)))


def test_pull_in_is_refused_with_its_voltage() -> None:
    chosen = replace(FEW, masses=(17.9e-3,), voltages=(0.0, 3.5e3, 7e3))
    with pytest.raises(InputError, match=r"7 kV.*no equilibrium: loss of tension at 6\.6"):
        build(_softened(circular()), Settings(), chosen)


@pytest.mark.parametrize(("arguments", "words"), [
    (["build", "{}", "--voltage", "5 kV"], "--voltage: given '5 kV': must be two voltages or more"),
    (["build", "{}", "--voltage", "5 kV..0 kV"], "must ascend"),
    (["build", "{}", "--mass", "17.9"], "--mass"),
    (["build", "{}", "--mass", "17.9 g,17.9 g"], "must differ"),
    (["build", "{}", "--mass", "0 g"], "needs a mass to move"),
    (["build", "{}", "--mass", "1 ug"], "too small"),
    (["build", "{}", "--count", "1"], "--count"),
    (["build", "{}", "--circles", "9"], "--circles"),
    (["build", "{}", "--viscous", "23.5 MPa"], "--viscous"),
    (["build", "{}", "--viscous", "23.5 MPa,177.2 MPa,62.4 kPa s"], "must be a viscosity"),
    (["build", "{}", "{}"], "different names"),
    (["simulate"], "give a specimen"),
], ids=lambda value: " ".join(value[1:]) if isinstance(value, list) else "")
def test_bad_input_is_one_message(arguments: list[str], words: str,
                                  capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["lumped", *(part.format(ACTUATORS / "circular.toml") for part in arguments)])
    message = capsys.readouterr().err
    assert status == 2
    assert words in message
    assert message.count("\n") == 1


@pytest.mark.parametrize(("old", "new", "words"), [
    ("alpha = 0.6", "alpha = 0.7", "add up to 1"),
    ("alpha = 0.6", "alpha = -0.6", "from 0 to 1"),
    ("stiffness = 1.02", "stiffness = -1", "must be positive"),
    ("k1_Pa = ", "k2_Pa = ", "k1_Pa"),
    ("radius_m = 0.045", "radius_m = 0.005", "larger than the plate's"),
    ("[specimen.plate]", "[specimen.plaid]", "plate"),
    ("flat_capacitance_F", "flat", "flat_capacitance_F"),
])
def test_a_broken_file_names_its_key(old: str, new: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "a.lumped.toml"
    write_model(file, MODEL)
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_model(file)


def test_a_signal_beyond_what_it_was_built_for_is_refused(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_model(tmp_path / "a.lumped.toml", MODEL)
    assert main(["lumped", "simulate", "--model", str(tmp_path / "a.lumped.toml"), "--high",
                 "6 kV"]) == 2
    assert "built for at most 5 kV" in capsys.readouterr().err


def test_the_command_writes_what_it_prints(tmp_path: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--count", "3", "--viscous", "1 MPa,2 MPa s,3 kPa s", "-o", str(tmp_path), "--json"]
    assert not main(["lumped", "build", str(ACTUATORS / "circular.toml"), *options])
    content = printed_record(capsys.readouterr().out)
    assert content == json.loads((tmp_path / "build.json").read_text(encoding="utf-8"))
    assert content["built"][0]["deflection_error"]["corrected"]["held_out"] < 1e-3
    rows = (tmp_path / "statics.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + 2 * 3
    assert (tmp_path / "build.png").stat().st_size > 10_000
    assert BuildResult.load(tmp_path).json() == content
    drawn = (tmp_path / "build.svg").read_bytes()
    assert main(["report", str(tmp_path)]) == 0
    assert (tmp_path / "build.svg").read_bytes() == drawn
    read = read_model(tmp_path / "circular.lumped.toml")
    assert read.stiffness == content["built"][0]["stiffness"]
    assert read.viscous == Viscous(1e6, 2e6, 3e3)
