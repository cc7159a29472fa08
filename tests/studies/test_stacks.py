"""A stack of n films under n times the load is one film under the load, whatever is asked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tympan
from tests.support.specimens import circular, elliptical, specimen_toml
from tympan.fem.film.laws import NeoHooke
from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.biases import Spring
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Electrode, Specimen, ViscousBranch
from tympan.studies.case import Case, Settings, solve
from tympan.studies.force import ForceCase, force
from tympan.studies.limits import limits
from tympan.studies.limits.curve import curve
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.build import build
from tympan.studies.lumped.equilibria import rest
from tympan.studies.modes import modes
from tympan.studies.response import response
from tympan.studies.sensitivity import sensitivity
from tympan.studies.signals import Wave
from tympan.studies.transient import TransientCase, respond

COUNT = 3
COARSE = Settings(MeshSettings().refined(0.5))
BRANCHES = (ViscousBranch(60e3, 0.3),)
#: What acts beside film and weight, for one film and for all of them.
ONE = Rig(biases=(Spring(8.0, 1e-3),), gas_pressure=-5.0, series_resistance=3e6, plate_damping=0.2)
ALL = Rig(biases=(Spring(8.0 * COUNT, 1e-3),), gas_pressure=-5.0 * COUNT,
          series_resistance=3e6 / COUNT, plate_damping=0.2 * COUNT)
MASS = 15e-3


def stacked(specimen: Specimen) -> Specimen:
    return replace(specimen, membrane=replace(specimen.membrane, layers=COUNT))


def film(**more: object) -> Specimen:
    return replace(elliptical(60e-3, NeoHooke(25e3)), electrode=Electrode(mass=0.02),
                   membrane=replace(elliptical(60e-3, NeoHooke(25e3)).membrane, density=960.0,
                                    **more))


@pytest.fixture(scope="module")
def pairs() -> tuple[Case, Case]:
    return (Case(film(), mass=MASS, voltage=3e3, rig=ONE),
            Case(stacked(film()), mass=MASS * COUNT, voltage=3e3, rig=ALL))


def test_at_rest(pairs: tuple[Case, Case]) -> None:
    one, several = (solve(case, COARSE) for case in pairs)
    for name in ("deflection_m", "max_stretch", "max_true_stress_Pa", "max_field_V_per_m",
                 "slack_share"):
        assert getattr(several, name) == pytest.approx(getattr(one, name), rel=1e-10)
    for name in ("reaction_N", "capacitance_F", "energy_J"):
        assert getattr(several, name) == pytest.approx(COUNT * getattr(one, name), rel=1e-10)


def test_they_are_springs_in_parallel() -> None:
    """Of films without weight, which the plate alone pulls."""
    single = circular(NeoHooke(25e3))
    one, several = (force(ForceCase(specimen, voltages=(0.0, 3e3), to=6e-3, points=13), COARSE)
                    for specimen in (single, stacked(single)))
    for alone, together in zip(one.curves, several.curves, strict=True):
        assert np.allclose(together.force_N, COUNT * np.array(alone.force_N), rtol=1e-10)
        assert np.allclose(together.stiffness_N_per_m, COUNT * np.array(alone.stiffness_N_per_m),
                           rtol=1e-10)
        assert np.allclose(together.capacitance_F, COUNT * np.array(alone.capacitance_F),
                           rtol=1e-10)
        assert np.allclose(together.max_true_stress_Pa, alone.max_true_stress_Pa, rtol=1e-10)
    assert several.blocked_force_N == pytest.approx(COUNT * one.blocked_force_N, rel=1e-9)


def test_limits_and_curves(pairs: tuple[Case, Case]) -> None:
    one, several = (limits(case, COARSE) for case in pairs)
    assert [limit.kind for limit in several.reached] == [limit.kind for limit in one.reached]
    for alone, together in zip(one.reached, several.reached, strict=True):
        assert together.voltage_V == pytest.approx(alone.voltage_V, rel=1e-7)
    tables = [curve(case.specimen, (case.mass,), COARSE, case.rig).table for case in pairs]
    assert np.allclose(tables[1]["deflection"], tables[0]["deflection"], rtol=1e-7)


def test_vibrations(pairs: tuple[Case, Case]) -> None:
    one, several = (modes(case, COARSE, 4).modes for case in pairs)
    for alone, together in zip(one, several, strict=True):
        assert together.frequency_Hz == pytest.approx(alone.frequency_Hz, rel=1e-9)
        assert together.film_share == pytest.approx(alone.film_share, rel=1e-7)
    answers = [response(replace(case, specimen=replace(case.specimen, membrane=replace(
        case.specimen.membrane, branches=BRANCHES))), COARSE, (1.0, 20.0, 60.0)) for case in pairs]
    assert answers[1].amplitude_m_per_V == pytest.approx(answers[0].amplitude_m_per_V, rel=1e-9)


@pytest.mark.parametrize("inertia", [False, True])
def test_in_time(pairs: tuple[Case, Case], inertia: bool) -> None:
    signal = Wave("step", high=3e3, duration=0.3).signal()
    ends = []
    for case in pairs:
        specimen = replace(case.specimen,
                           membrane=replace(case.specimen.membrane, branches=BRANCHES))
        run = TransientCase(specimen, signal, mass=case.mass, rig=case.rig, inertia=inertia)
        ends.append(respond(run, COARSE, 0.02, None, True, ())[0])
    assert np.allclose(ends[1].samples["displacement"], ends[0].samples["displacement"],
                       rtol=1e-6)


def test_derivatives(pairs: tuple[Case, Case]) -> None:
    one, several = (sensitivity(case, COARSE, ("heave",)).quantities["heave"].by for case in pairs)
    for name in ("membrane.thickness", "membrane.density", "electrode.mass", "frame.semi_axes.0",
                 "membrane.relative_permittivity"):
        assert several[name].derivative == pytest.approx(one[name].derivative, rel=1e-6), name
    assert "membrane.layers" not in several


def test_the_lumped_models() -> None:
    ones = [Actuator.of(specimen, mass, (0.5, 0.5)) for specimen, mass in (
        (film(), MASS), (stacked(film()), MASS * COUNT))]
    assert rest(ones[1], 2e3) == pytest.approx(rest(ones[0], 2e3), rel=1e-9)
    assert ones[1].capacitance(1e-3) == pytest.approx(COUNT * ones[0].capacitance(1e-3), rel=1e-12)
    built = [build(specimen, COARSE) for specimen in (film(), stacked(film()))]
    assert built[1].model.weights == pytest.approx(built[0].model.weights, rel=1e-4)


def test_it_is_a_key_of_the_film(tmp_path: Path) -> None:
    file = tmp_path / "stack.toml"
    file.write_text(specimen_toml("stack").replace("thickness =", "layers = 4\nthickness ="),
                    encoding="utf-8")
    assert load_specimen(file).membrane.layers == 4
    for wrong in ("0", "2.5", '"four"'):
        film = f"layers = {wrong}\nthickness ="
        file.write_text(specimen_toml("stack").replace("thickness =", film),
                        encoding="utf-8")
        with pytest.raises(tympan.InputError, match="layers"):
            load_specimen(file)
