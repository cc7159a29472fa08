"""The limits of a film, against the axisymmetric equations and other meshes."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import epsilon_0

from benchmarks.first_limit import own_rows, table
from benchmarks.peers.harness import LIMIT
from tests.oracles import axisymmetric, inflation
from tests.oracles.laws import gent
from tests.oracles.unstable import slack_voltage
from tests.support.specimens import ROOT5, circular, elliptical
from tympan.base.errors import InputError
from tympan.fem.film.laws import Gent, NeoHooke
from tympan.fem.film.library import MATERIALS, library_strength
from tympan.fem.membrane.biases import ForceTable
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse, Polygon, RegularPolygon, RoundedRectangle
from tympan.geometry.specimen import Electrode, Film, Plate, Region, Specimen
from tympan.studies.alpha import AlphaSettings, LoadGrid, alpha
from tympan.studies.case import Case, CaseResult, Settings, solve
from tympan.studies.files import from_json
from tympan.studies.limits import Limits, limits, rise, solve_within
from tympan.studies.limits.curve import curve
from tympan.studies.limits.loads import charged, usual_masses, usual_voltages
from tympan.studies.path import path

COARSE = Settings(MeshSettings(order=3).refined(0.7))
SOFT = circular(NeoHooke(15e3))
ORACLE = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, axisymmetric.neo_hooke(15e3), 4.7)
FORCE = 17.9e-3 * 9.80665


@pytest.fixture(scope="module")
def soft() -> Limits:
    return limits(Case(SOFT, mass=17.9e-3), Settings(), beyond=True)


def test_a_round_film_loses_tension_and_pulls_in_where_the_equations_have_it(soft: Limits) -> None:
    assert soft.pull_in is not None
    assert soft.tension is not None
    assert soft.pull_in.voltage_V == pytest.approx(axisymmetric.pull_in_voltage(ORACLE, FORCE),
                                                   rel=2e-5)
    # Stress at the rim is less exact than force: 2e-4 of it.
    assert soft.tension.voltage_V == pytest.approx(slack_voltage(ORACLE, FORCE, 6800.0), rel=5e-4)
    assert soft.end is not None
    assert f"at {soft.end.voltage_V / 1e3:.4g} kV" in soft.ended


def test_a_limit_is_as_certain_as_it_says(soft: Limits) -> None:
    """Against the equations: not much further off than the spread, which is small itself."""
    exact = {"tension": slack_voltage(ORACLE, FORCE, 6800.0),
             "pull_in": axisymmetric.pull_in_voltage(ORACLE, FORCE)}
    for limit in (soft.tension, soft.pull_in):
        assert limit is not None
        assert abs(limit.voltage_V / exact[limit.kind] - 1) < 2 * limit.spread < 4e-3


def test_a_share_of_the_first_limit_is_that_of_the_equations() -> None:
    """Half the voltage at which the equations have the film lose tension; no other text is one."""
    case = charged(Case(SOFT, mass=17.9e-3), "50 %", Settings())
    assert case.voltage == pytest.approx(0.5 * slack_voltage(ORACLE, FORCE, 6800.0), rel=5e-4)
    assert charged(case, "2 kV", Settings()).voltage == 2000.0
    for wrong in ("120 %", "-1 %", "some %", "%"):
        with pytest.raises(InputError, match="from 0 to 100 %"):
            charged(case, wrong, Settings())


def test_the_limit_that_peers_are_asked_for_is_that_of_the_equations() -> None:
    """``benchmarks.first_limit`` measures errors against it, tympan's at most 1e-3."""
    film = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, axisymmetric.neo_hooke(25e3), 4.7)
    assert slack_voltage(film, LIMIT.weight, 9200.0) == pytest.approx(LIMIT.voltage, rel=1e-6)
    row, = own_rows([0.5])
    assert row.error < 1e-3
    assert f"| {row.voltage_V:.1f} V | {row.error:.1e} |" in table([row])[-1]


def test_the_first_loss_of_tension_is_where_the_rim_is(soft: Limits) -> None:
    assert soft.tension is not None
    assert np.hypot(soft.tension.x_m, soft.tension.y_m) == pytest.approx(10e-3)


@pytest.fixture(scope="module")
def film() -> Specimen:
    """A rounded rectangle of 80 by 50 mm with an elliptical plate of 24 by 16 mm.

    Its film thins without bound soon after it has lost tension.
    """
    membrane = Film(thickness=0.5e-3, prestretch=(3.0, 3.0), relative_permittivity=4.7,
                    material=MATERIALS["vhb-4910"].material)
    return Specimen("film", RoundedRectangle((40e-3, 25e-3), 8e-3), Plate(Ellipse((12e-3, 8e-3))),
                    membrane)


def test_limits_of_a_film_hold_on_another_mesh(film: Specimen) -> None:
    """The other one has a third of the unknowns; both spreads cover what they differ by."""
    fine, coarse = (limits(Case(film, mass=20e-3), Settings(MeshSettings().refined(refine)))
                    for refine in (1.0, 0.6))
    assert fine.tension is not None
    assert fine.tension.voltage_V == pytest.approx(2730, rel=1e-3)
    assert coarse.tension is not None
    assert fine.tension.voltage_V == pytest.approx(
        coarse.tension.voltage_V, rel=fine.tension.spread + coarse.tension.spread)


def test_a_film_that_thins_as_it_loses_tension_loses_it_on_every_mesh() -> None:
    """An oval with its electrode on a disc and its plate aside: it is unstable at the next step."""
    membrane = Film(thickness=1e-3, prestretch=(2.236, 2.236), relative_permittivity=4.7,
                    material=MATERIALS["vhb-4910"].material)
    oval = Specimen("oval", Ellipse((60e-3, 45e-3)), Plate(Circle(10e-3), (2e-3, 0.0)), membrane,
                    Electrode(outline=Region(Circle(30e-3))))
    case, settings = Case(oval, mass=27e-3), Settings()
    tensions = [limits(case, replace(settings, mesh=settings.mesh.refined(factor))).tension
                for factor in (1.0, 1.5)]
    voltages = [limit.voltage_V for limit in tensions if limit is not None]
    assert len(voltages) == 2
    assert np.ptp(voltages) < 2e-4 * voltages[0]


@pytest.mark.study(seconds=14)
def test_a_limit_that_the_mesh_makes_is_said_to_be_hardly_resolved() -> None:
    """Where Gent's law locks: by the equations the film outside the electrode pulls for ever."""
    film = Film(0.2e-3, (4.0, 4.0), Gent(15e3, 90.0), 4.8)
    disc = Specimen("spot", Circle(10e-3), None, film,
                    Electrode(outline=Region(Circle(10e-3 / 3))))
    oracle = inflation.Disc(0.0, 10e-3, 0.2e-3, 4.0, gent(15e3, 90.0), 4.8)
    assert inflation.voltage_at(oracle, 10e-3 / 3, 6.815) > 15e3
    assert inflation.pull_of(oracle, 10e-3 / 3, 6.815) > 1e3
    case = Case(disc, rig=Rig(gravity=1e-9))
    tension = limits(case, Settings()).tension
    assert tension is None or not tension.resolved
    assert tension is None or "±" in tension.text or "order of magnitude" in tension.text
    assert limits(case, Settings(mesh=MeshSettings().refined(2))).tension is None


def test_a_limit_without_a_sure_digit_is_known_to_its_order_of_magnitude() -> None:
    """Near its locking stretch under 10 kg and 100 MPa of gas a film has no other."""
    film = Film(1e-3, (7.0, 7.0), Gent(18e3, 110.0), 4.7)
    specimen = Specimen("locking", Circle(45e-3), Plate(Circle(10e-3)), film)
    reached = limits(Case(specimen, mass=10.0, rig=Rig(gas_pressure=1e8)), Settings())
    gone = reached.instability
    assert gone is not None
    assert gone.spread > 1
    about = round(gone.voltage_V, -5) / 1e3
    assert gone.text == f"about {about:g} kV (known to its order of magnitude only)"
    assert gone.text in reached.ended
    assert "%" not in reached.ended


def test_solve_knows_its_film_s_limits(film: Specimen) -> None:
    beyond = solve_within(Case(film, mass=20e-3, voltage=3000.0), Settings())
    assert beyond.status == "no_equilibrium"
    assert beyond.limits is not None
    assert beyond.limits.thins
    assert beyond.limit == beyond.limits.instability
    assert beyond.first == beyond.limits.first == "tension"
    assert beyond.limit.voltage_V == pytest.approx(2730, rel=1e-3)
    # Where it would pull in, were it kept from wrinkling, limits nothing, and is told if asked.
    assert beyond.limits.pull_in is None
    whole = limits(Case(film, mass=20e-3), Settings(), beyond=True)
    assert whole.pull_in is not None
    # On this mesh the branch turns early at one place; on finer ones it does not.
    assert whole.pull_in.voltage_V == pytest.approx(2992, rel=2 * whole.pull_in.spread)
    assert replace(whole, by_kind={**whole.by_kind, "pull_in": None}) == beyond.limits
    assert beyond.warnings == (beyond.limits.ended,)
    below = solve_within(Case(film, mass=20e-3, voltage=2000.0), Settings())
    assert (below.status, below.limit, below.limits) == ("equilibrium", None, beyond.limits)
    assert CaseResult.__eq__(from_json(CaseResult, below.json()), below)


@pytest.mark.parametrize(("rig", "keys"), [
    ({}, ""), ({"friction": 5e-3}, "friction of the rig is"), ({"lag_voltage": 100.0},
                                                               "lag_voltage of the rig is"),
    ({"friction": 5e-3, "lag_voltage": 100.0}, "friction and lag_voltage of the rig are")])
@pytest.mark.parametrize("voltage", [2000.0, 3500.0])
def test_solve_says_what_it_leaves_out_without_a_direction(
        film: Specimen, rig: dict[str, float], keys: str, voltage: float) -> None:
    """In one line, below the film's limit and beyond; with a direction it counts and no word is
    said."""
    case = Case(film, mass=20e-3, voltage=voltage, rig=Rig(**rig))
    said = [words for words in solve_within(case, COARSE).warnings if "--direction" in words]
    assert [words.partition(" left out")[0] for words in said] == [keys] * bool(rig)
    told = solve_within(replace(case, direction=1.0), COARSE)
    assert not any("--direction" in words for words in told.warnings)


def test_curves_pass_through_what_solve_finds_and_end_at_the_limit(film: Specimen) -> None:
    fine = Settings(MeshSettings().refined(1.5))
    result = curve(film, (20e-3,), fine, voltages=(1000.0, 2000.0, 4000.0), beyond=True)
    table, reached = result.table, limits(Case(film, mass=20e-3), fine, beyond=True)
    asked = table["asked"] == 1
    assert table["status"][asked].tolist() == ["equilibrium"] * 2 + ["no_equilibrium"]
    voltage, deflection = table["voltage"][~asked], table["deflection"][~asked]
    between = np.interp([1e6, 4e6], voltage**2, deflection)
    assert table["deflection"][asked][:2] == pytest.approx(between, rel=5e-3)
    pull_in = result.curves[0].limits.pull_in
    assert pull_in is not None
    assert reached.pull_in is not None
    assert voltage[-1] == pytest.approx(pull_in.voltage_V)
    assert pull_in.voltage_V == pytest.approx(reached.pull_in.voltage_V, rel=1e-4)
    assert pull_in.voltage_V == pytest.approx(2992, rel=1e-4)  # as on a mesh half as fine
    shorter = curve(film, (20e-3,), fine)
    assert reached.instability is not None
    assert shorter.table["voltage"][-1] == pytest.approx(reached.instability.voltage_V)


def test_usual_loads_follow_from_the_film(film: Specimen) -> None:
    mass, = usual_masses(film, Settings(), over=(1.0,))
    deflection = solve(Case(film, mass=mass), Settings()).deflection_m
    assert deflection == pytest.approx(0.1 * film.gap, rel=0.06)  # a mass has two digits
    highest = max(usual_voltages(film, mass, Settings()))
    first = limits(Case(film, mass=mass), Settings()).limit
    assert first is not None
    assert highest == pytest.approx(0.6 * first.voltage_V, rel=0.05)


def test_usual_voltages_stay_on_a_mechanism_that_ends_before_the_film(film: Specimen) -> None:
    """Its table reaches to 3 mm, where the film has no limit yet."""
    coarse = Settings(MeshSettings(order=2).refined(0.5))
    rig = Rig(biases=(ForceTable((-5e-3, 0.0, 3e-3), (-0.1, 0.0, 0.02)),))
    case = Case(film, mass=5e-3, rig=rig)
    assert limits(case, coarse).limit is None
    highest = max(usual_voltages(film, 5e-3, coarse, rig))
    deflection = solve(replace(case, voltage=highest), coarse).deflection_m
    assert deflection is not None
    assert deflection < 3e-3
    beyond = solve(replace(case, voltage=1.05 * highest / 0.6), coarse)
    assert beyond.status != "equilibrium"


def test_usual_voltages_of_a_held_plate_follow_from_its_film(film: Specimen) -> None:
    fixed = Rig(guide="fixed")
    first = limits(Case(film, mass=5e-3, rig=fixed), COARSE).limit
    assert first is not None
    assert first.kind == "tension"
    highest = max(usual_voltages(film, 5e-3, COARSE, fixed))
    assert highest == pytest.approx(0.6 * first.voltage_V, rel=0.05)


def test_no_voltage_is_chosen_for_a_film_without_equilibrium() -> None:
    """Its weight pulls it beyond the end of the mechanism's table."""
    rig = Rig(biases=(ForceTable((-5e-3, 0.0, 3e-3), (-0.1, 0.0, 0.02)),))
    with pytest.raises(InputError, match="no voltage can be chosen"):
        usual_voltages(SOFT, 1.0, COARSE, rig)


def test_limits_are_nominal_voltages(soft: Limits) -> None:
    """What the supply shows: with twice the gain half of it will do."""
    doubled = limits(Case(SOFT, mass=17.9e-3, rig=Rig(amplifier_gain=1.0)), Settings(), beyond=True)
    assert doubled.pull_in is not None
    assert soft.pull_in is not None
    assert doubled.pull_in.voltage_V == pytest.approx(soft.pull_in.voltage_V / 2, rel=1e-9)


def stretched(prestretch: float) -> Specimen:
    return replace(SOFT, membrane=replace(SOFT.membrane, prestretch=(prestretch, prestretch)))


@pytest.mark.parametrize(("specimen", "mass"), [
    (SOFT, 17.9e-3), (elliptical(75e-3, NeoHooke(15e3)), 22.45e-3),
    (replace(SOFT, plate=Plate(Circle(10e-3), (5e-3, 0.0))), 12e-3), (stretched(6.5), 20e-3),
    (stretched(5.0), 0.2), (SOFT, 1.0)],
    ids=["circle", "ellipse", "plate off its centre", "stretched much", "hangs deeper", "deepest"])
def test_limits_solve_and_path_agree(specimen: Specimen, mass: float) -> None:
    """To 1e-3: with the ramp's own search, just below the first and just above the last."""
    reached = limits(Case(specimen, mass=mass), COARSE)
    first, end = reached.limit, reached.end
    assert first is not None
    assert end is not None
    below, above = (solve(Case(specimen, mass=mass, voltage=voltage), COARSE)
                    for voltage in (0.999 * first.voltage_V, 1.001 * end.voltage_V))
    assert below.status == "equilibrium"
    assert above.status != "equilibrium"
    events = {event.what: event.value
              for event in path(Case(specimen, mass=mass), COARSE, "voltage").events}
    assert reached.tension is not None
    assert events["tension"] == pytest.approx(reached.tension.voltage_V, rel=1e-3)
    if reached.pull_in is not None and "limit" in events:
        near = max(1e-3, reached.pull_in.spread)  # of a coarse mesh it says how certain it is
        assert events["limit"] == pytest.approx(reached.pull_in.voltage_V, rel=near)


def test_alpha_leaves_out_what_is_beyond_the_limit_and_says_which() -> None:
    specimen, mass = elliptical(75e-3, NeoHooke(15e3)), 17.9e-3
    end = limits(Case(specimen, mass=mass), COARSE).end
    assert end is not None
    loads = LoadGrid((mass,), (0.0, 3000.0, 1.1 * end.voltage_V))
    warned = " ".join(alpha(specimen, COARSE, AlphaSettings(loads, LoadGrid((), ()))).warnings)
    said = re.search(r"at ([0-9.]+) kV", warned)
    assert said is not None
    assert 1e3 * float(said[1]) == pytest.approx(end.voltage_V, rel=1e-3)


def test_a_film_too_stiff_for_any_supply_has_its_limit_above_it() -> None:
    """Thick and of 100 MPa: flat, it loses tension at E = √(σ/ε), 1.86 MV across 1.8 mm."""
    film = Film(2e-3, (1.05, 1.05), NeoHooke(100e6), 3.0)
    stiff = Specimen("stiff", Circle(45e-3), Plate(Circle(10e-3)), film)
    assert tension_voltage(film) > 1.8e6
    reached = limits(Case(stiff, mass=0.1), COARSE)
    assert (reached.limit, reached.end) == (None, None)
    assert reached.ended == "no pull-in was found: the limit is above 1000 kV"
    result = solve_within(Case(stiff, mass=0.1, voltage=1e6), COARSE)
    assert result.status == "equilibrium"
    assert result.limits == reached
    table = curve(stiff, [0.1], COARSE).table
    assert table["voltage"][[0, -1]] == pytest.approx([0.0, 1e6], abs=1.0)
    assert table["deflection"][-1] == pytest.approx(result.deflection_m, rel=1e-6)
    assert max(usual_masses(stiff, COARSE)) <= 100.0


def test_an_amplifier_that_sags_ends_a_curve_at_the_most_it_gives() -> None:
    """At its sag voltage it gives half of that; no nominal voltage gives the film more."""
    rig = Rig(sag_voltage=3000.0)
    reached = limits(Case(SOFT, mass=17.9e-3, rig=rig), COARSE)
    assert reached.end is None
    assert "the limit is above 1.5 kV across the film" in reached.ended
    table = curve(SOFT, [17.9e-3], COARSE, rig).table
    assert table["voltage"][-1] == pytest.approx(3000.0, rel=1e-3)


def tension_voltage(film: Film) -> float:
    """Voltage [V] at which a flat neo-Hookean film of equal stretches has lost its stress."""
    stretch = film.prestretch[0]
    stress = film.material.mu * (stretch**2 - stretch**-4)
    return float(np.sqrt(stress / (epsilon_0 * film.relative_permittivity))
                 * film.thickness / stretch**2)


def test_a_curve_says_at_which_mass_and_voltage_it_is() -> None:
    said: list[str] = []
    curve(SOFT, [17.9e-3], COARSE, voltages=[1000.0, 2000.0, 30e3], progress=said.append)
    assert said == [f"circle: 17.9 g{at}" for at in ("", ", 1 kV", ", 2 kV", ", 30 kV")]


def test_a_limit_at_a_sharp_corner_asks_for_a_fillet_and_no_finer_mesh() -> None:
    """The film's range ends beyond the first limit, so its warning has a voltage."""
    sheet = Film(100e-6, (1.2, 1.2), MATERIALS["elastosil-2030"].material, 2.8,
                 strength=library_strength(MATERIALS["elastosil-2030"].breakdown),
                 law_range=(0.3, 1.5))
    frame = RoundedRectangle((30e-3, 30e-3), 0.0)
    found = {}
    for fillet in (0.0, 1e-3):
        plate = Plate(RegularPolygon(6, 8e-3, fillet), (1e-3, 0.0))
        specimen = Specimen("hexagon", frame, plate, sheet)
        found[fillet] = rise(Case(specimen, mass=20e-3), COARSE)
        assert len(specimen.sharp_corners) == (6 if fillet == 0 else 0)
    sharp, round_ = (risen.limits.breakdown for risen in found.values())
    assert sharp is not None
    assert round_ is not None
    assert "a sharp corner" in sharp.place
    assert "round the corner" in str(sharp.advice)
    assert "refine" not in str(sharp.advice)
    assert not round_.at_corner
    assert "corner" not in f"{round_.place} {round_.advice}"
    said, = found[1e-3].warnings
    volts = float(re.search(r"\(from (\S+) kV on, beyond the limit\)$", said)[1])
    assert volts * 1e3 > round_.voltage_V


def test_corners_are_sharp_where_they_point_into_the_film() -> None:
    ell = Polygon(((-40e-3, -40e-3), (40e-3, -40e-3), (40e-3, 10e-3), (10e-3, 10e-3),
                   (10e-3, 40e-3), (-40e-3, 40e-3)))
    film = SOFT.membrane
    specimen = Specimen("ell", ell, Plate(RegularPolygon(64, 5e-3), (-15e-3, -15e-3)), film)
    assert specimen.sharp_corners == pytest.approx(np.array([[10e-3, 10e-3]]))


def test_a_limit_of_a_round_film_is_on_a_ring_unless_its_weight_hangs_beside() -> None:
    settings = Settings(mesh=MeshSettings().refined(0.6))
    centred, aside = (limits(Case(circular(), mass=17.9e-3, rig=Rig(weight_offset=offset)),
                             settings).limit for offset in ((0.0, 0.0), (2e-3, 0.0)))
    assert centred is not None
    assert aside is not None
    assert centred.ring
    assert centred.place == "r 10.0 mm, all around"
    assert not aside.ring
    assert aside.place.startswith("x ")
