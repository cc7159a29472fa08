"""Loads that cannot be meant get a warning, whichever way they came; ordinary ones get none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from scipy.constants import epsilon_0, g, pi

import tympan
from tests.support.specimens import NEO_HOOKE, ROOT5, circular
from tympan.cli import main
from tympan.fem.membrane.loading import Spring
from tympan.fem.plausible_loads import implausible_loads
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.errors import InputError
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Film
from tympan.studies.case import Case, Settings
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


def test_what_else_carries_the_weight_is_not_forgotten() -> None:
    assert not doubts(17.9, rig=Rig(guide="fixed"))
    assert not doubts(17.9, rig=Rig(gas_pressure=176 / (pi * 0.045**2)))
    assert not doubts(17.9, rig=Rig(gravity=0.0))
    assert not doubts(17.9, rig=Rig(spring=176 / 0.045))
    assert not doubts(17.9, rig=Rig(biases=(Spring(176 / 0.01),)))


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
    said = tympan.solve(film, COARSE, mass=17.9, voltage=3.5).warnings
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
    assert printed(f"{step}2 kV") == []


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
