"""Two films joined by a rod, against the forces of each by itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.support.biases import COARSE
from tests.support.specimens import circular, elliptical, specimen_toml
from tympan.base.errors import InputError
from tympan.fem.derivatives.sensitivity import nearby_tangent
from tympan.fem.equilibrium.solve import held
from tympan.fem.membrane.biases import JoinedFilm
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.state import HEAVE
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import rig_to_toml
from tympan.studies.case import Case, build_model, equilibrate, solve
from tympan.studies.force import ForceCase
from tympan.studies.force import force as force_of
from tympan.studies.limits import limits
from tympan.studies.modes import modes
from tympan.studies.path import path
from tympan.studies.sensitivity import sensitivity
from tympan.studies.signals import ramp
from tympan.studies.transient import TransientCase, respond

DISC = circular()
PAIR = JoinedFilm(DISC, distance=20e-3, rod=20e-3)
#: Pushed apart by 8 mm.
CONES = JoinedFilm(elliptical(6e-2), distance=20e-3, rod=28e-3, voltage=2e3)


def forces(specimen, voltage: float, gravity: float = 9.80665):
    """Force of a film [N] by the deflection of its plate [m], each searched from the flat film."""
    model = build_model(specimen, COARSE, Loading(gravity=gravity))
    return lambda place: held(model, place, voltage).state.force


def stiffness(case: Case) -> float:
    """Of plate, film and mechanisms against the deflection [N/m]."""
    model, outcome = equilibrate(case, COARSE)
    assert outcome.status == "equilibrium"
    tangent = nearby_tangent(model, outcome.state)
    number = model.plate_freedoms.index(HEAVE)
    return float(tangent.plate_stiffness[number, number] * model.discretisation.mirrored)


@pytest.mark.parametrize("voltage", [0.0, 3e3])
def test_equal_films_stay_flat_and_are_twice_as_stiff(voltage: float) -> None:
    alone = Case(DISC, voltage=voltage)
    pair = replace(alone, rig=Rig(biases=(replace(PAIR, voltage=voltage),)))
    assert abs(solve(pair, COARSE).deflection_m) <= 1e-10 * 45e-3
    assert stiffness(pair) == pytest.approx(2 * stiffness(alone), rel=1e-10)


@pytest.mark.parametrize("side", ["below", "above"])
def test_the_plate_is_where_the_curves_of_both_films_cross(side: str) -> None:
    """Unequal films pushed apart, a voltage on one and a higher one on the other, and a weight."""
    cones, mass = replace(CONES, side=side), 5e-3
    out = 8e-3 if side == "below" else -8e-3
    for voltage in (0.0, 4e3):
        case = Case(DISC, mass=mass, voltage=voltage, rig=Rig(biases=(cones,)))
        mine, other = forces(DISC, voltage), forces(CONES.specimen, CONES.voltage)
        crossing = brentq(lambda w, mine=mine, other=other: mine(w) + other(w + out)
                          - mass * 9.80665, -8e-3, 8e-3, xtol=1e-12)
        assert solve(case, COARSE).deflection_m == pytest.approx(crossing, rel=1e-6)


def test_the_film_s_own_weight_acts_on_both() -> None:
    heavy = circular(density=960.0)
    rig = Rig(biases=(replace(PAIR, specimen=heavy),))
    pair = solve(Case(heavy, rig=rig), COARSE)
    assert pair.deflection_m == pytest.approx(solve(Case(heavy), COARSE).deflection_m, rel=1e-6)
    assert pair.deflection_m > 0


def test_force_and_stiffness_are_those_of_the_film_and_its_energy_s_derivatives() -> None:
    model = build_model(DISC, COARSE, Loading((replace(CONES, specimen=DISC),)))
    film, = model.loading.biases
    alone = forces(DISC, CONES.voltage, 0.0)
    for place in np.random.default_rng(1).uniform(-12e-3, 4e-3, 6).tolist():
        _, push, rate = film.derivatives(place)
        stepped = film.derivatives(place + 1e-30j)
        assert (stepped[0].imag, stepped[1].imag) == pytest.approx((push * 1e-30, rate * 1e-30),
                                                                   rel=1e-12)
        assert push == pytest.approx(alone(place + 8e-3), rel=2e-7)  # Newton's own error
        beside = (film.derivatives(place + 1e-5)[1] - film.derivatives(place - 1e-5)[1]) / 2e-5
        assert rate == pytest.approx(beside, rel=1e-5)
    again = build_model(DISC, COARSE, Loading((replace(CONES, specimen=DISC, voltage=2000.0),)))
    assert again.loading.biases[0] is film


def test_the_answers_to_its_numbers_are_differences() -> None:
    case = Case(DISC, mass=5e-3, voltage=3e3, rig=Rig(biases=(CONES,)))
    answers = sensitivity(case, COARSE).quantities["heave"].by
    for name, step in (("voltage", 20.0), ("rod", 1e-5), ("distance", 1e-5)):
        ends = [solve(replace(case, rig=Rig(biases=(
            replace(CONES, **{name: getattr(CONES, name) + sign * step}),))), COARSE).deflection_m
            for sign in (1, -1)]
        assert answers[f"rig.biases.0.{name}"].derivative == pytest.approx(
            (ends[0] - ends[1]) / (2 * step), rel=1e-5)
    assert not any("specimen" in name for name in answers if name.startswith("rig."))


def test_every_search_meets_the_same_pair() -> None:
    """Load lines, a path, limits, modes and a slow ramp of the voltage."""
    rig = Rig(biases=(CONES,))
    case = Case(DISC, mass=5e-3, voltage=3e3, rig=rig)
    rest = solve(case, COARSE).deflection_m
    line = force_of(ForceCase(DISC, voltages=(3e3,), start=-9e-3, to=3e-3, points=13,
                              masses=(5e-3,), rig=rig), COARSE).loads[0]
    assert [each.displacement_m for each in line.crossings] == pytest.approx([rest], rel=1e-6)
    way = path(replace(case, voltage=0.0), COARSE, "voltage").stations
    between = np.interp(3e3, [each.voltage_V for each in way][:4],
                        [each.deflection_m for each in way][:4])
    assert between == pytest.approx(rest, rel=0.05)
    assert limits(case, COARSE).first is not None
    slow, history = respond(TransientCase(DISC, ramp(0.0, 3e3, 1.0), mass=5e-3, rig=rig), COARSE,
                            0.1)
    assert np.interp(0.5, history.time, history.deflection) == pytest.approx(rest, rel=1e-3)
    assert any("without mass" in words for words in slow.warnings)
    weighed = [modes(Case(DISC, mass=5e-3, rig=Rig(
        guide="vertical", gravity=1e-9, biases=biases)), COARSE, 1
                     ).modes[0].frequency_Hz for biases in ((), (PAIR,))]
    assert weighed[1] / weighed[0] == pytest.approx(2**0.5, rel=1e-3)


def test_a_rig_file_names_the_other_film_s_file(tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(specimen_toml("other"))
    file = tmp_path / "rig.toml"
    file.write_text('[[bias]]\nlaw = "film"\nspecimen = "other.toml"\ndistance = "20 mm"\n'
                    'rod = "25 mm"\nvoltage = "1 kV"\nside = "above"\n')
    rig = Rig.read(file)
    assert rig.biases[0].other(0.0) == pytest.approx(-5e-3)
    (tmp_path / "again").mkdir()
    (tmp_path / "again" / "rig.toml").write_text(rig_to_toml(rig))
    assert Rig.read(tmp_path / "again" / "rig.toml") == rig


def test_rods_and_voltages_that_the_other_film_does_not_allow_are_refused() -> None:
    for rod, distance in ((0.0, 80e-3), (150e-3, 80e-3)):
        with pytest.raises(InputError, match=r"must be from 12.5 to 147.5 mm: .* half extent"):
            replace(PAIR, rod=rod, distance=distance)
    with pytest.raises(InputError, match=r"voltage: given '20 kV': .* with its plate at 0 mm"):
        solve(Case(DISC, rig=Rig(biases=(replace(PAIR, voltage=20e3),))), COARSE)


def test_a_plate_beyond_what_the_other_film_bears_says_so() -> None:
    soft = replace(PAIR, specimen=circular(thickness=0.2e-3), rod=80e-3)
    beyond = solve(Case(DISC, mass=1.0, rig=Rig(biases=(soft,))), COARSE)
    assert beyond.status == "not_converged"
    assert '"film" of the rig ends' in beyond.warnings[0]
