"""``tympan sensitivity`` and the case behind it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.oracles.unstable import slack_voltage
from tests.support.biases import SAMPLES
from tests.support.specimens import (
    NEO_HOOKE,
    ROUND,
    circular,
    reference_film,
    skewed,
    specimen_toml,
)
from tympan.base.fields import fields_of
from tympan.base.paths import at, with_number
from tympan.cli import main
from tympan.fem import rig
from tympan.fem.equilibrium.newton import newton
from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.biases import (
    Bistable,
    BuckledBeam,
    Magnet,
    Spring,
)
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Case, Settings, equilibrate
from tympan.studies.sensitivity import case_parameters, sensitivity

COARSE = Settings(MeshSettings(order=2).refined(0.7))
RIG = Rig(gravity=9.81, unaccounted_mass=1e-3, spring=3.0, amplifier_gain=0.02, sag_voltage=9e3,
          weight_offset=(1e-3, 0.0), plate_pressure=100.0, gas_pressure=5.0,
          biases=(Magnet(0.05, 20e-3, 8e-3),), lag_voltage=200.0)
#: Settings of the rig on which no equilibrium depends.
OF_INSTRUMENTS = {f"rig.{field.name}" for record in (rig.Sensor, rig.Tester, rig.Grips)
                  for field in fields_of(record)}
NEO_HOOKE_TOML = '[membrane.material]\nlaw = "neo_hooke"\nmu = "25 kPa"'


@pytest.fixture
def specimen(tmp_path: Path) -> str:
    (tmp_path / "round.toml").write_text(
        specimen_toml("round", ROUND, NEO_HOOKE_TOML), encoding="utf-8")
    return str(tmp_path / "round.toml")


@pytest.mark.parametrize("direction", [0.0, -1.0])
def test_rig_and_loads_against_differences(direction: float) -> None:
    """What the rig makes of mass and voltage counts, and the pressure on the plate's own area."""
    case = Case(skewed(), mass=17.9e-3, voltage=3e3, rig=RIG, direction=direction)
    model, outcome = equilibrate(case, COARSE)
    parameters = case_parameters(case, model)
    names = ["mass", "voltage", "plate.outline.radius",
             *(name for name in parameters if name.startswith("rig"))]
    derivatives = {name: answer.derivative
                   for name, answer in sensitivity(case, COARSE).quantities["heave"].by.items()}
    assert {"rig.gravity", "rig.sag_voltage", "rig.weight_offset.1",
            "rig.biases.0.gap"} < set(names)
    assert not OF_INSTRUMENTS & {*names}
    assert ("rig.lag_voltage" in names) == (direction != 0)
    for name in names:
        value = parameters[name].value(model, outcome.state)
        errors = []
        for step in (4e-3 * (abs(value) or 1e-2), 2e-3 * (abs(value) or 1e-2)):
            changed = [parameters[name].changed(model, outcome.state, change)
                       for change in (step, -step)]
            heaves = [newton(*each).state.plate.deflection for each in changed]
            errors.append(abs((heaves[0] - heaves[1]) / (2 * step) - derivatives[name]))
        assert errors[1] <= 1e-6 * abs(derivatives[name]) or errors[0] / errors[1] > 3.5, name


def test_elasticities_are_those_of_similarity(specimen: str,
                                              capsys: pytest.CaptureFixture[str]) -> None:
    """1 % stiffer is the same as 1 % less mass and ½ % less voltage."""
    assert main(["sensitivity", specimen, "--mass", "17.9 g", "--voltage", "3.5 kV", "--of",
                 "heave,energy",
                 "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["status"] == "equilibrium"
    heave = {name: answer["elasticity"]
             for name, answer in result["quantities"]["heave"]["by"].items()}
    assert heave["membrane.material.mu"] == pytest.approx(-heave["mass"] - heave["voltage"] / 2,
                                                          rel=1e-8)
    energy = {name: answer["elasticity"]
              for name, answer in result["quantities"]["energy"]["by"].items()}
    assert energy["membrane.material.mu"] == pytest.approx(1 - energy["mass"] - energy["voltage"]
                                                           / 2, rel=1e-8)
    assert result["quantities"]["heave"]["by"]["plate.outline.radius"]["unit"] == "m"
    assert heave["plate.offset.0"] is None


def test_the_table_reads_from_the_strongest_down(specimen: str,
                                                 capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sensitivity", specimen, "--mass", "17.9 g", "--voltage", "3.5 kV"]) == 0
    lines = capsys.readouterr().out.splitlines()
    shares = [abs(float(line.split(" %")[0].split()[-1])) for line in lines if " %  " in line
              and "by 1" not in line]
    assert len(shares) > 8
    assert shares == sorted(shares, reverse=True)
    assert lines[-1].split()[-2] == "per"


def test_past_its_end_it_is_the_voltage_at_which_the_film_thins() -> None:
    """Voltages scale as T sqrt(mu/eps), loads as mu: its elasticities must say so.

    That by the mass is the axisymmetric equations', in which the hoop stress vanishes there.
    """
    material, mass = Ogden((15e3,), (2.0,)), 17.9e-3
    result = sensitivity(Case(circular(material), mass=mass, voltage=7e3), Settings())
    assert result.status == "no_equilibrium"
    (quantity, answers), = result.quantities.items()
    elasticities = {name: answer.elasticity for name, answer in answers.by.items()}
    ends = [slack_voltage(reference_film(material), share * mass * 9.80665, 6700.0)
            for share in (0.99, 1.0, 1.01)]
    assert (quantity, answers.unit) == ("thinning_voltage", "V")
    assert answers.value == pytest.approx(ends[1], rel=5e-4)
    assert elasticities["mass"] == pytest.approx((ends[2] - ends[0]) / 0.02 / ends[1], rel=5e-3)
    assert elasticities["membrane.relative_permittivity"] == pytest.approx(-0.5, abs=1e-6)
    assert elasticities["membrane.material.mu.0"] == pytest.approx(0.5 - elasticities["mass"],
                                                                   abs=1e-4)
    assert elasticities["membrane.thickness"] == pytest.approx(1 - elasticities["mass"], abs=1e-4)
    of_supply = {f"rig.{field.name}" for field in fields_of(rig.Supply)}
    assert not {"voltage", *of_supply} & {*elasticities}
    assert np.isfinite([answer.derivative for answer in answers.by.values()]).all()


def test_past_pull_in_it_is_the_pull_in_pressure() -> None:
    """Pressures and loads scale as mu, sizes alike: its elasticities must say so."""
    result = sensitivity(Case(circular(NEO_HOOKE, prestretch=(1.2, 1.2)), mass=5e-3,
                              rig=Rig(gas_pressure=3e3)), Settings())
    (quantity, answers), = result.quantities.items()
    elasticities = {name: answer.elasticity for name, answer in answers.by.items()}
    assert (quantity, answers.unit) == ("pull_in_pressure", "Pa")
    assert elasticities["membrane.material.mu.0"] == pytest.approx(1 - elasticities["mass"],
                                                                   abs=1e-4)
    assert "rig.gas_pressure" not in elasticities


def test_at_a_force_s_limit_gravity_still_pulls_a_film_with_mass() -> None:
    """Against limits at other gravities; the weight of the plate is the force itself."""
    def case(density: float, gravity: float) -> Case:
        rig = Rig(biases=(Magnet(0.3, 6e-3, 6e-3),), gravity=gravity)
        return Case(circular(NEO_HOOKE, density=density), mass=50e-3, rig=rig)

    coarse = Settings(MeshSettings(order=3).refined(0.6))
    (quantity, answers), = sensitivity(case(960.0, 9.81), coarse).quantities.items()
    low, high = (equilibrate(case(960.0, gravity), coarse)[1].limit for gravity in (8.81, 10.81))
    assert quantity == "pull_in_force"
    assert low is not None
    assert high is not None
    assert answers.by["rig.gravity"].derivative == pytest.approx((high - low) / 2, rel=1e-3)
    (_, massless), = sensitivity(case(0.0, 9.81), coarse).quantities.items()
    assert "rig.gravity" not in massless.by


def test_what_cannot_be_said_ends_with_status_two(specimen: str,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sensitivity", specimen, "--mass", "17.9 g", "--of", "tilt"]) == 2
    assert "does not tilt" in capsys.readouterr().err
    assert main(["sensitivity", specimen, "--mass", "17.9 g", "--of", "beauty"]) == 2
    assert "must be one of heave, tilt" in capsys.readouterr().err


#: Of each kind one, but of a joined film, whose own derivatives are tested with it; and some that
#: leave out other numbers.
MECHANISMS = [
    *(bias for law, bias in SAMPLES.items() if law != "film"),
    Spring(10.0, preload=0.02), Bistable(0.1, 4e-3),
    BuckledBeam(40e-3, 3e-3, 1e-4, 3e9, 2e-5, number=2, middle=-2e-3)]  # far in tension


@pytest.mark.parametrize("bias", MECHANISMS, ids=lambda bias: bias.law)
def test_numbers_of_mechanisms_against_differences(bias) -> None:
    case = Case(circular(NEO_HOOKE), mass=10e-3, voltage=2e3, rig=Rig(biases=(bias,)))
    by = sensitivity(case, COARSE).quantities["heave"].by
    names = [name for name in by if name.startswith("rig.biases")]
    assert bool(names) == (bias.law != "table")  # measured numbers are no parameters
    for name in names:
        path = tuple(name.split("."))
        value = at(case, path)
        if not value:  # of a key that is left out: the other one is there
            continue
        step = 1e-4 * abs(value)
        ends = [equilibrate(with_number(case, path, value + sign * step), COARSE)[1]
                for sign in (1, -1)]
        heaves = [end.state.plate.deflection for end in ends]
        # Of a number that moves nothing the difference has the heaves' rounding.
        assert by[name].derivative == pytest.approx(
            (heaves[0] - heaves[1]) / (2 * step), rel=1e-4, abs=1e-14 / (2 * step))
