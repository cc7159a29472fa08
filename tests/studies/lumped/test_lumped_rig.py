"""What acts on the plate of a lumped model, against the field model on the same rig."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.biases import COARSE, DECLARED, JOINED
from tests.support.specimens import circular, elliptical
from tympan.base.errors import InputError
from tympan.fem.membrane.biases import Bistable, Constant, ForceTable
from tympan.fem.rig import Rig
from tympan.studies.case import Case, solve
from tympan.studies.lumped.build import BuildSettings, build
from tympan.studies.lumped.control.run import ControlSettings
from tympan.studies.lumped.equilibria import rest, rest_curve
from tympan.studies.lumped.model_file import LumpedModel, read_model, write_model
from tympan.studies.lumped.simulate import sample, simulate
from tympan.studies.signals import step

FILM = circular()
MASS = 17.9e-3
FEW = BuildSettings((MASS, 22e-3), (0.0, 2e3, 4e3))
#: A rod that pulls both plates together, this one down; the longer one nearly bears its weight.
SHORT = replace(JOINED, rod=18e-3)
RIGS = {**{name: Rig(biases=(bias,)) for name, bias in (DECLARED | {"film": SHORT}).items()},
        "plate pressure": Rig(plate_pressure=200.0), "gas": Rig(gas_pressure=-20.0)}


@pytest.fixture(scope="module")
def model() -> LumpedModel:
    return build(FILM, COARSE, FEW).model


@pytest.mark.parametrize("name", RIGS)
def test_a_rig_is_in_both_models(name: str) -> None:
    """At loads that were not fitted; and in the frequencies, without and under voltage."""
    built = build(FILM, COARSE, FEW, RIGS[name])
    plain = solve(Case(FILM, mass=MASS), COARSE).deflection_m
    assert abs(built.field_deflection[0, 0] / plain - 1) > 1e-2  # it does something
    assert built.worst("corrected", held_out=True) < 2e-4
    # The other film is on the usual mesh in one, on a coarse one in the other.
    near = 1e-3 if name == "film" else 2e-4
    assert built.frequencies["lumped"] == pytest.approx(built.frequencies["field"], rel=near)


def test_a_plate_snaps_through_as_the_field_models_does() -> None:
    """A mechanism that the voltage pushes over, at 6.44 kV by `limits`."""
    loads = BuildSettings((MASS,), (0.0, 3e3, 6.2e3, 6.6e3, 7e3))
    built = build(FILM, COARSE, loads, Rig(biases=(Bistable(0.08, 5e-3),)))
    before, after = built.field_deflection[0, 2:4]
    assert after - before > 2e-3
    assert built.worst("corrected", held_out=True) < 3e-3
    assert built.worst("corrected", held_out=False) < 3e-3
    y = rest_curve(built.actuator("corrected", MASS), np.linspace(6.3e3, 6.6e3, 61))
    assert np.isfinite(y).all()
    assert (np.diff(y) > 1e-3).sum() == 1


def test_a_plate_that_a_mechanism_lifts_rests_above_the_frame(model: LumpedModel) -> None:
    rig = Rig(biases=(Constant(-0.32), Bistable(0.05, 5e-3, rest=-6e-3)))
    for voltage in (0.0, 6e3):
        field = solve(Case(FILM, mass=MASS, voltage=voltage, rig=rig), COARSE).deflection_m
        assert field < -1e-3
        assert rest(model.actuator(MASS, rig), voltage) == pytest.approx(field, rel=1e-3)


@pytest.mark.parametrize("pressure", [30.0, -40.0])
def test_gas_lifts_an_ovals_plate_as_finite_elements_have_it(pressure: float, tmp_path: Path
                                                             ) -> None:
    """Its area is measured of the film; α is that of the film without gas, and so the stiffness."""
    oval, rig = elliptical(75e-3), Rig(gas_pressure=pressure)
    plain, lifted = (build(oval, COARSE, FEW, rig, in_time=False) for rig in (Rig(), rig))
    assert plain.worst("corrected", held_out=True) < 3e-5
    assert lifted.worst("corrected", held_out=True) < 1e-3
    assert lifted.model.weights == pytest.approx(plain.model.weights, abs=1e-2)
    assert lifted.frequencies["lumped"] == pytest.approx(lifted.frequencies["field"], rel=1e-3)
    # A model that was built without gas knows a little of it.
    assert plain.model.gas_area == pytest.approx(lifted.model.gas_area, rel=2e-2)
    near = rest(plain.model.actuator(MASS, rig), 2e3)
    assert near == pytest.approx(lifted.field_deflection[0, 1], rel=1e-2)
    write_model(tmp_path / "oval.toml", lifted.model)
    assert read_model(tmp_path / "oval.toml") == lifted.model


def test_readings_are_late_and_what_acts_against_the_way_is_said(model: LumpedModel) -> None:
    signal = step(0.0, 3e3, 0.0, 0.4)
    plain, late = (sample(simulate(model.actuator(MASS, rig), signal), 1e-3)
                   for rig in (Rig(), Rig(sensor_lag=0.1, friction=5e-3, lag_voltage=100.0)))
    assert np.ptp(plain.samples["displacement"]) > 1.5 * np.ptp(late.samples["displacement"])
    assert late.last_m == plain.last_m
    assert [words.split()[0] for words in late.warnings if "left out in time" in words] == [
        "friction", "lag_voltage"]
    assert not any("left out" in words for words in plain.warnings)
    assert ControlSettings().lag(Rig(sensor_lag=0.1)) == 0.1
    assert ControlSettings(sensor_lag="20 ms").lag(Rig(sensor_lag=0.1)) == 0.02


@pytest.mark.parametrize(("rig", "words"), [
    (Rig(guide="fixed"), "rig.guide: given 'fixed': must let the plate move"),
    (Rig(biases=(ForceTable((1e-3, 2e-3), (0.0, 0.1)),)), "rig.bias: the mechanism 'table' has no"),
])
def test_what_circles_do_not_have_is_refused_by_its_key(rig: Rig, words: str, model: LumpedModel
                                                        ) -> None:
    with pytest.raises(InputError) as refused:
        model.actuator(MASS, rig)
    assert str(refused.value).startswith(words)
    assert replace(model.actuator(MASS), rig=Rig()).lowest == 0.0
