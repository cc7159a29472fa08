"""Loads that cannot be meant get a warning, whichever way they came; ordinary ones get none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from scipy.constants import epsilon_0, g, pi

import tympan
from tests.support.biases import DECLARED
from tests.support.specimens import NEO_HOOKE, ROOT5, circular
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.admissibility import equibiaxial_stiffness
from tympan.fem.membrane.biases import Spring
from tympan.fem.plausible_loads import implausible_loads
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Film
from tympan.studies.alpha import AlphaSettings, LoadGrid
from tympan.studies.case import Case, Settings
from tympan.studies.lumped.eq8 import eq8
from tympan.studies.path import path

COARSE = Settings(MeshSettings(order=2).refined(0.6))
KILOGRAMS, VOLTS = 'was "17.9 g" meant?', 'was "3.5 kV" meant?'


def doubts(mass: float = 0.0, voltage: float = 0.0, rig: Rig = Rig(), **changes: object) -> str:
    return " | ".join(implausible_loads(circular(**changes), rig, mass, voltage))


def test_yardsticks_are_those_of_the_neo_hookean_film() -> None:
    """True stress μ(λ² - λ⁻⁴) grows by μ(2λ² + 4λ⁻⁴) with ln λ; the film is 1/λ² as thick."""
    film, mu = circular().membrane, 25e3
    assert film.material == NEO_HOOKE
    stiffness, thickness = mu * (2 * 5 + 4 / 25), film.thickness / 5
    around = stiffness * thickness * 2 * pi * 10e-3
    assert f"({around:.3g} N)" in doubts(mass=17.9)
    limit = 10 * around / g
    assert not doubts(mass=0.99 * limit)
    assert "kg weighs" in doubts(mass=1.01 * limit)
    strains = thickness * (1e-5 * stiffness / (epsilon_0 * 4.7)) ** 0.5
    assert not doubts(voltage=1.01 * strains)
    assert "hardly strains" in doubts(voltage=0.99 * strains)
    assert "hardly strains" in doubts(voltage=-0.99 * strains)


def test_only_what_cannot_be_meant() -> None:
    assert not doubts()
    assert not doubts(17.9e-3, 3.5e3)
    assert KILOGRAMS in doubts(17.9)
    assert VOLTS in doubts(voltage=3.5)
    # Nor would as many kilovolts be seen: there is nothing to ask.
    assert doubts(voltage=1e-3).endswith("of its stiffness)")
    # An amplifier that makes kilovolts of volts.
    assert not doubts(voltage=3.5e2, rig=Rig(amplifier_gain=9.0))


def test_a_law_without_stiffness_is_no_yardstick() -> None:
    """The paper's Eq. (8) with Table 1's constants: the film would be softer than nothing."""
    film = eq8(circular(), 4.7)
    assert equibiaxial_stiffness(film.membrane.material, ROOT5, ROOT5) < 0
    assert implausible_loads(film, Rig(), 17.9e-3, 3.5e3) == []


def test_what_else_carries_the_weight_is_not_forgotten() -> None:
    assert not doubts(17.9, rig=Rig(guide="fixed"))
    assert not doubts(17.9, rig=Rig(gas_pressure=176 / (pi * 0.045**2)))
    assert not doubts(17.9, rig=Rig(gravity=9.81e-3))
    assert not doubts(17.9, rig=Rig(spring=176 / 0.045))
    assert not doubts(17.9, rig=Rig(biases=(Spring(176 / 0.01),)))
    # What carries grams leaves the question.
    for law in ("spring", "constant", "magnet", "table"):
        assert 'was "20 g" meant?' in doubts(20.0, rig=Rig(biases=(DECLARED[law],)))


@pytest.mark.parametrize("prestretch", [1.0, ROOT5, 4.0])
@pytest.mark.parametrize("mu", [5e3, 1e8])
def test_ordinary_strains_of_any_film_pass(mu: float, prestretch: float) -> None:
    """A weight of a tenth of the stiffness round the plate, a Maxwell stress of a thousandth."""
    film = Film(1e-3, (prestretch,) * 2, tympan.NeoHooke(mu), 4.7)
    specimen = replace(circular(), membrane=film)
    stiffness = mu * (2 * prestretch**2 + 4 * prestretch**-4)
    thickness = 1e-3 / prestretch**2
    mass = 0.1 * stiffness * thickness * 2 * pi * 10e-3 / g
    voltage = thickness * (1e-3 * stiffness / (epsilon_0 * 4.7)) ** 0.5
    assert implausible_loads(specimen, Rig(), mass, voltage) == []
    assert len(implausible_loads(specimen, Rig(), 1e3 * mass, 1e-3 * voltage)) == 2


def test_both_doors_say_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    film = circular()
    said = tympan.solve(film, settings=COARSE, mass=17.9, voltage=3.5).warnings
    assert any(KILOGRAMS in words for words in said)
    assert any(VOLTS in words for words in said)
    file = tmp_path / "film.toml"
    file.write_text(specimen_to_toml(film), encoding="utf-8")

    def printed(line: str) -> list[str]:
        command, *options = line.split("|")
        assert main([command, str(file), *options, "--refine", "0.6", "--json"]) == 0
        content = json.loads(capsys.readouterr().out)
        return content["warnings"] if "warnings" in content else content["responses"][0]["warnings"]

    assert any(VOLTS in words for words in printed("solve|--mass|17.9 g|--voltage|3.5 V"))
    assert any(KILOGRAMS in words for words in printed("limits|--mass|17.9 kg"))
    low, = printed("curve|--mass|17.9 g|--voltage|1 V, 3.5 V")
    assert VOLTS in low
    assert printed("curve|--mass|17.9 g|--voltage|0 V, 1 V, 2 kV") == []
    step = "transient|--mass|17.9 g|--signal|step|--duration|1 s|--high|"
    assert any(VOLTS in words for words in printed(f"{step}3.5 V"))
    assert not any(word in words for words in printed(f"{step}2 kV") for word in (VOLTS, KILOGRAMS))


def test_weights_of_circles_are_judged_by_all_their_loads(tmp_path: Path) -> None:
    def alpha(fit: LoadGrid, held_out: LoadGrid) -> tuple[str, ...]:
        return tympan.alpha(circular(), alpha_settings=AlphaSettings(fit, held_out),
                            settings=COARSE).warnings

    none, some = LoadGrid(()), LoadGrid((17.9e-3,), (0.0, 3.5))
    assert any(VOLTS in words for words in alpha(some, none))
    assert not any("meant" in words for words in alpha(some, LoadGrid((17.9e-3,), (3.5e3,))))
    with pytest.raises(InputError, match=r'at any load of the fit.*"17\.9 g" meant'):
        alpha(LoadGrid((17.9,), (20e3,)), none)


def test_lumped_commands_ask_as_solve_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]
                                           ) -> None:
    film, out = tmp_path / "film.toml", tmp_path / "out"
    film.write_text(specimen_to_toml(circular()), encoding="utf-8")

    def warned(line: str, kind: str) -> str:
        assert main(["lumped", *line.split("|"), "--json"]) == 0
        content, = json.loads(capsys.readouterr().out)[kind]
        return " | ".join(content["warnings"])

    mesh = "--refine|0.6"
    for high, asked in (("3.5 V", True), ("3.5 kV", False)):
        step = f"simulate|{film}|--mass|17.9 g|--signal|step|--duration|1 s|--high|{high}|{mesh}"
        assert (VOLTS in warned(step, "responses")) == asked
        small = f"linearise|{film}|--mass|17.9 g|--voltage|{high}|{mesh}"
        assert (VOLTS in warned(small, "linear")) == asked
        model = f"build|{film}|--mass|17.9 g|--voltage|0 V..{high}|-o|{out}|{mesh}"
        assert (VOLTS in warned(model, "built")) == asked
    model = out / "circle.lumped.toml"
    for line in (f"simulate|{film}|--mass|17.9 kg|--signal|step|--duration|1 s|{mesh}",
                 f"simulate|{film}|--paper|--mass|17.9 kg|--signal|step|--duration|1 s",
                 f"linearise|--model|{model}|--mass|17.9 kg",
                 f"build|{film}|--mass|17.9 kg|--voltage|0 V..3.5 kV|-o|{out}|{mesh}",
                 f"export|{model}|--slow-fast|--mass|17.9 kg|-o|{out}"):
        assert main(["lumped", *line.split("|")]) == 2
        assert KILOGRAMS in capsys.readouterr().err


def test_readings_that_a_film_cannot_have_given_are_asked_about(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Volts in a column of kilovolts, in readings at rest and in time."""
    film, runs = tmp_path / "film.toml", tmp_path / "runs"
    film.write_text(specimen_to_toml(circular()), encoding="utf-8")
    assert main(["lumped", "simulate", str(film), "--mass", "17.9 g", "--signal", "step",
                 "--duration", "0.5 s", "--high", "3.5 V", "--refine", "0.6", "-o",
                 str(runs)]) == 0
    (runs / "static.csv").write_text(
        "specimen,mass_g,voltage_kV,displacement_mm\ncircle,17.9,0,1.694\n"
        "circle,17.9,0.0035,1.695\ncircle,22,0,2.08\n", encoding="utf-8")
    capsys.readouterr()
    assert main(["lumped", "identify", str(runs), "--dynamic", "--no-limits", "--refine", "0.6",
                 "--json"]) == 0
    fits = json.loads(capsys.readouterr().out)
    for kind in ("static", "dynamic"):
        assert any(words.startswith("circle: ") and VOLTS in words
                   for words in fits[kind]["warnings"])


@pytest.mark.study(seconds=12)
def test_an_optimum_is_judged_by_its_own_loads(tmp_path: Path) -> None:
    def warnings(mass: str, voltage: str) -> tuple[str, ...]:
        file = tmp_path / "wanted.toml"
        file.write_text(
            f'specimen = "circular"\nmass = "{mass}"\nvoltage = "{voltage}"\n'
            'tolerances = "none"\n[want]\nstroke = "largest"\n'
            '[vary]\n"plate.radius" = ["9.9 mm", "10.1 mm"]\n', encoding="utf-8")
        return tympan.design(file, settings=COARSE).warnings

    for voltage, asked in (("3.5 V", True), ("3.5 kV", False)):
        assert any(VOLTS in words for words in warnings("17.9 g", voltage)) == asked
    with pytest.raises(InputError, match='was "99 g" meant'):
        warnings("99 kg", "3.5 kV")


def test_a_sweep_is_judged_by_its_highest_voltage(tmp_path: Path) -> None:
    (tmp_path / "film.toml").write_text(specimen_to_toml(circular()), encoding="utf-8")
    warned = []
    for high in ("3.5 V", "3.5 kV"):
        file = tmp_path / "SWEEP.toml"
        file.write_text(f'specimen = "film.toml"\nmass = "17.9 g"\nvoltage = ["1 V", "{high}"]\n'
                        '[grid]\n"membrane.thickness" = ["1 mm"]\n', encoding="utf-8")
        table = tympan.sweep(file, settings=COARSE).to_pandas()
        warned.append([VOLTS in words for words in table["warnings"]])
    assert warned == [[True, True], [False, False]]


def test_a_path_is_judged_by_what_does_not_grow() -> None:
    heavy = Case(circular(), mass=17.9e-3, voltage=3.5)
    assert any(VOLTS in words for words in path(heavy, COARSE, "mass").warnings)
    assert not any(VOLTS in words for words in path(heavy, COARSE, "voltage").warnings)


def test_a_refusal_asks_too() -> None:
    with pytest.raises(InputError, match=r'no equilibrium at once.*"17\.9 g" meant'):
        tympan.transient(circular(), mass=17.9, high=3.5e3, duration=1.0, settings=COARSE)
