"""A film's own instability, known alike to every command, against the axisymmetric equations."""

from __future__ import annotations

import json
import pickle
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.oracles import axisymmetric
from tests.oracles.laws import rivlin
from tests.oracles.unstable import instability_voltage, least_stiffness
from tests.support.costs import dear
from tympan.cli import main
from tympan.fem.film.laws import NeoHooke, Ogden, Yeoh
from tympan.fem.results.limit_states import LIMIT_STATES
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen
from tympan.studies.case import (
    Case,
    Limit,
    Limits,
    Settings,
    equilibrate,
    solve,
)
from tympan.studies.files import to_json
from tympan.studies.limits import limits, solve_within
from tympan.studies.limits.curve import curve
from tympan.studies.limits.voltages import first_limit
from tympan.studies.path import Event, path

MASS = 58e-3
FRAME, PLATE = Circle(31.7e-3), Plate(Circle(7.3e-3))
#: A law that softens, whose permittivity grows with the stretch.
SOFTENING = Specimen("yeoh", FRAME, PLATE, Film(
    0.83e-3, (1.93, 1.93), Yeoh((13.1e3, -210.0, 9.3)), 3.1, permittivity_exponent=-0.6))
#: Bare along frame and plate: it wrinkles, and thins long after.
BARE = Specimen("w3", FRAME, PLATE, Film(0.61e-3, (1.09, 1.09), NeoHooke(23e3), 3.1),
                Electrode(margin_frame=11.3e-3, margin_plate=2.9e-3))

#: Bare along frame and plate, taut: the electrode's edge gives way before anything else does.
EDGED = Specimen("edged", Ellipse((65.5e-3, 34.8e-3)), Plate(Circle(8.1e-3)), Film(
    0.82e-3, (2.7, 2.7), NeoHooke(20e3), 4.0), Electrode(5.3e-3, 2.7e-3))
#: The same film with x and y swapped, on another mesh.
EDGED_TURNED = replace(EDGED, frame=Ellipse((34.8e-3, 65.5e-3)))


def refined(factor: float) -> Settings:
    return Settings(MeshSettings().refined(factor))


@pytest.fixture(scope="module")
def exact() -> float:
    law = rivlin(lambda i1, _: 13.1e3 * (i1 - 3) - 210 * (i1 - 3) ** 2 + 9.3 * (i1 - 3) ** 3,
                 lambda i1: 13.1e3 - 420 * (i1 - 3) + 27.9 * (i1 - 3) ** 2)
    film = axisymmetric.Film(7.3e-3, 31.7e-3, 0.83e-3, 1.93, law, 3.1, -0.6)
    return instability_voltage(film, MASS * 9.80665, 5000.0, 5500.0)


@pytest.mark.parametrize("refine", [1.0, 1.5, 2.0])
def test_every_mesh_has_it_where_the_equations_do(exact: float, refine: float) -> None:
    reached = limits(Case(SOFTENING, mass=MASS), refined(refine))
    gone = reached.instability
    assert gone is not None
    assert exact == pytest.approx(5240.157, rel=1e-6)
    assert gone.voltage_V == pytest.approx(exact, rel=2e-4)
    assert abs(gone.voltage_V / exact - 1) < gone.spread < 2e-3
    assert np.hypot(gone.x_m, gone.y_m) == pytest.approx(7.3e-3)
    # What such a film would do beyond depends on the mesh, and is not told.
    assert reached.reached == (gone,)
    assert (reached.first, reached.limit, reached.end) == ("instability", gone, None)
    assert f"instability at {gone.text}" in reached.ended


def test_solve_warns_beyond_it_and_is_silent_before() -> None:
    before, beyond = (solve_within(Case(SOFTENING, mass=MASS, voltage=voltage), Settings())
                      for voltage in (5200.0, 5650.0))
    assert before.status == "equilibrium"
    assert before.limit is None
    assert before.warnings == ()
    assert beyond.limit is not None
    assert (beyond.limit.kind, beyond.first) == ("instability", "instability")
    assert "instability at" in beyond.warnings[0]
    assert beyond.limits == before.limits
    further = solve_within(Case(SOFTENING, mass=MASS, voltage=5750.0), Settings())
    assert any("instability at" in words for words in further.warnings)
    # Without limits, as a sweep solves it, the state itself says so.
    assert "instability at" in solve(beyond_case(), Settings()).warnings[0]


def beyond_case() -> Case:
    return Case(SOFTENING, mass=MASS, voltage=5300.0)


def test_path_and_curve_have_the_same() -> None:
    reached = limits(Case(SOFTENING, mass=MASS), Settings()).instability
    assert reached is not None
    branch = path(Case(SOFTENING, mass=MASS), Settings(), "voltage")
    event = branch.events[0]
    assert event.what == "instability"
    assert event.value == pytest.approx(reached.voltage_V, rel=1e-9)
    beyond = [station.voltage_V > 1.0001 * reached.voltage_V for station in branch.stations]
    assert sum(beyond) > 2
    before = [station.voltage_V < 0.9999 * reached.voltage_V for station in branch.stations]
    for station, early, late in zip(branch.stations, before, beyond, strict=True):
        assert not early or station.stable
        assert not late or not station.stable
    drawn = curve(SOFTENING, (MASS,), Settings(), voltages=(5000.0, 5300.0))
    assert drawn.curves[0].limits.first == "instability"
    asked = drawn.table["asked"] == 1
    assert drawn.table["beyond"][asked].tolist() == ["", "instability"]
    assert drawn.table["voltage"][~asked].max() == pytest.approx(reached.voltage_V, rel=1e-9)


@pytest.mark.parametrize("mass", [5e-3, 28e-3])
def test_a_film_that_wrinkles_first_thins_at_one_voltage_on_every_mesh(mass: float) -> None:
    """Numbers and sentence are of one source: tension, then the thinning, and no pull-in."""
    both = [limits(Case(BARE, mass=mass), refined(factor)) for factor in (1.0, 1.5)]
    for reached in both:
        tension, gone = reached.reached
        assert (tension.kind, gone.kind, reached.first) == ("tension", "instability", "tension")
        assert reached.thins
        assert reached.end == gone
        assert reached.ended == (f"loss of tension at {tension.text} and, at {gone.text}, "
                                 "instability: the film, wrinkled, thins without bound")
    for coarse, fine in zip(both[0].reached, both[1].reached, strict=True):
        assert coarse.voltage_V == pytest.approx(fine.voltage_V, rel=1e-3)


@pytest.mark.study(seconds=4)
@pytest.mark.parametrize("mass", [dear(20e-3, seconds=7), 28e-3, dear(40e-3, seconds=7)])
def test_every_command_has_the_end_of_a_wrinkled_film_at_one_voltage(mass: float) -> None:
    """However far beyond it a voltage is asked for: one search, of one accuracy."""
    case = Case(BARE, mass=mass)
    gone = limits(case, Settings()).instability
    assert gone is not None
    ends = [equilibrate(replace(case, voltage=gone.voltage_V + further), Settings())[1]
            for further in (1.0, 20.0, 100.0, 5e3)]
    assert [(end.status, end.thins) for end in ends] == 4 * [("no_equilibrium", True)]
    branch = path(case, Settings(), "voltage")
    drawn = curve(BARE, (mass,), Settings(), voltages=(gone.voltage_V - 1, gone.voltage_V + 1))
    asked = drawn.table["asked"] == 1
    voltages = [*(np.sqrt(end.limit) for end in ends), branch.events[-1].value,
                drawn.table["voltage"][~asked].max()]
    assert voltages == pytest.approx(6 * [gone.voltage_V], rel=1e-6)
    assert branch.warnings[0].startswith("followed until the film, wrinkled, thins without bound")
    assert branch.stations[-1].voltage_V == branch.events[-1].value
    assert drawn.table["status"][asked].tolist() == ["equilibrium", "no_equilibrium"]


@pytest.mark.study(seconds=4)
@pytest.mark.parametrize("factors", [(1.0, 1.5, 2.0),
                                     dear((1.0, 1.25, 1.5, 2.0, 3.0), seconds=16)])
def test_a_wrinkled_film_s_end_is_as_certain_as_it_says(factors: tuple[float, ...]) -> None:
    """The end on the finest mesh lies within what coarser ones state."""
    *coarse, fine = [limits(Case(BARE, mass=40e-3), refined(factor)).instability
                     for factor in factors]
    for gone in coarse:
        assert abs(gone.voltage_V / fine.voltage_V - 1) < gone.spread < 4e-3


def test_limits_stand_in_the_order_in_which_they_come() -> None:
    def at(kind: str, voltage: float) -> Limit:
        return Limit(kind=kind, voltage_V=voltage, x_m=0.0, y_m=0.0)

    met = (at("tension", 3e3), at("breakdown", 1e3), at("instability", 3e3), at("pull_in", 4e3))
    mixed = Limits({limit.kind: limit for limit in met}, ended="", thins=True)
    assert [limit.kind for limit in mixed.reached] == ["breakdown", "tension", "instability",
                                                       "pull_in"]
    assert (mixed.first, mixed.limit) == ("breakdown", mixed.breakdown)
    assert mixed.beyond(2e3) == mixed.breakdown
    assert mixed.beyond(5e3) == mixed.instability  # it never gets to pull in
    assert Limits({}, ended="").beyond(1e9) is None


def test_each_kind_is_registered_once() -> None:
    """What lists limits asks the registry; the keys of results are its kinds."""
    assert [*to_json(Limits({}, ended=""))] == [*LIMIT_STATES, "first", "ended", "thins"]
    assert len({state.marker for state in LIMIT_STATES.values()}) == len(LIMIT_STATES)
    some = Limit(kind="tension", voltage_V=1.0, x_m=0.0, y_m=0.0)
    reached = Limits(dict.fromkeys(LIMIT_STATES, some), ended="")
    assert all(getattr(reached, kind) is some for kind in LIMIT_STATES)
    assert {*LIMIT_STATES} <= {*dir(reached)}
    assert pickle.loads(pickle.dumps(reached)) == deepcopy(reached) == reached
    with pytest.raises(AttributeError, match="collapse"):
        reached.collapse  # noqa: B018


TOML = """
name = "yeoh"
[frame]
shape = "circle"
radius = "{0} mm"
[plate]
shape = "circle"
radius = "{1} mm"
[membrane]
thickness = "{2} mm"
prestretch = [1.93, 1.93]
relative_permittivity = 3.1
permittivity_exponent = -0.6
breakdown = "vhb-4910"
[membrane.material]
law = "yeoh"
c = ["13.1 kPa", "-0.21 kPa", "0.0093 kPa"]
"""


def test_the_terminal_tells_the_order_and_places_with_their_digits(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also of a film of 0.6 mm, whose places are no 0.0 mm."""
    file = tmp_path / "small.toml"
    file.write_text(TOML.format(0.317, 0.073, 0.0083))
    assert main(["limits", str(file), "--mass", "5.8 mg"]) == 0
    first, *_ = [line for line in capsys.readouterr().out.splitlines() if "(the limit)" in line]
    assert "0.073" in first
    assert main(["solve", str(file), "--mass", "5.8 mg", "--voltage", "30 V"]) == 0
    text = capsys.readouterr().out
    assert "breakdown place" in text
    assert "e-1" not in text
    assert "-0.0" not in text
    assert main(["solve", str(file), "--mass", "5.8 mg", "--voltage", "30 V", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert set(record["limits"]) >= set(LIMIT_STATES)
    assert record["first"] == record["limits"]["first"]
    assert record["limits"][record["first"]] is not None


@pytest.mark.study(seconds=4)
def test_what_pulls_the_plate_in_before_any_voltage_is_named(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "disk.toml").write_text("""
name = "disk"
[frame]
shape = "circle"
radius = "12.5 mm"
[plate]
shape = "circle"
radius = "5 mm"
[membrane]
thickness = "50 um"
prestretch = [1.2, 1.2]
relative_permittivity = 2.8
material = { law = "ogden", mu = ["0.4 MPa"], alpha = [2] }
[electrode]
margin_frame = "1 mm"
""")
    (tmp_path / "mag.toml").write_text("""
guide = "vertical"
[[bias]]
law = "magnet"
force = "0.3 N"
gap = "1.5 mm"
decay = "1 mm"
""")
    words = [str(tmp_path / "disk.toml"), "--mass", "10 g", "--rig", str(tmp_path / "mag.toml")]
    for command in (["solve", *words, "--voltage", "2.5 kV"], ["limits", *words]):
        assert main(command) == 0
        text = capsys.readouterr().out
        assert "weight and magnet pull the plate in before any voltage: 0.0981 N is more" in text
        assert "(0.0382 N); without magnet it carries that" in text
        assert "no pull-in" not in text


def happening(case: Case, what: str, refine: float) -> Event:
    """What happens along a film's branch, whether or not it has ended before."""
    events = path(case, refined(refine), "voltage", beyond=True).events
    return next(event for event in events if event.what == what)


#: On a mesh of factor 1 Newton's method finds other wrinkled films beyond, and from them others
#: before.
BANDS = Case(Specimen(
    "bands", Circle(44.97643380773953e-3),
    Plate(Circle(15.82020800965995e-3), (-5.458851084900788e-3, -5.615582095129661e-3)),
    Film(0.628e-3, (2.4544482934100973, 2.967385470774509), NeoHooke(20e3), 4.0),
    Electrode(4.264932672206591e-3, 2.1324663361032953e-3)), mass=11.567755181364974e-3)
#: Where it loses tension on a mesh of elements of half the length [V], as a dear test finds it.
LOST = 4253.646271


@pytest.mark.study(seconds=5)
@pytest.mark.parametrize("refine", [1.0, dear(2.0, seconds=10)])
def test_another_branch_beyond_tension_does_not_hide_where_it_is_lost(refine: float) -> None:
    lost = happening(BANDS, "tension", refine)
    assert abs(lost.value / LOST - 1) < lost.spread < 2e-3
    assert refine < 2 or lost.value == pytest.approx(LOST, rel=1e-6)


@pytest.mark.parametrize("refine", [1.0, dear(2.0, seconds=6)])
def test_an_electrode_s_edge_is_the_first_limit_before_tension_is_lost(refine: float) -> None:
    gone = first_limit(BANDS, refined(refine))
    assert gone is not None
    assert gone.kind == "instability"
    assert gone.voltage_V < 0.9999 * LOST


def test_what_thins_at_one_edge_is_no_pull_in_on_any_mesh() -> None:
    """A film and its mirror image: on one of their meshes the load turns beyond their end."""
    film = Film(0.6734842944718781e-3, (2.19424294877568, 2.8324046520983015), NeoHooke(20e3), 4.0)
    bare = Electrode(8.257244269964848e-3, 4.128622134982424e-3)
    found = []
    for offset in (2e-3, -2e-3):
        specimen = Specimen("edge", Circle(53.86715891848611e-3),
                            Plate(Circle(9.712178806527912e-3), (offset, 0.0)), film, bare)
        gone, = limits(Case(specimen, mass=7.098624570354486e-3), refined(0.6)).reached
        assert gone.kind == "instability"
        found.append(gone)
    here, there = found
    assert abs(here.voltage_V / there.voltage_V - 1) < min(2e-3, here.spread + there.spread)
    assert here.spread + there.spread < 0.1


@pytest.fixture(scope="module")
def at_edge() -> Limit:
    gone = limits(Case(EDGED, mass=6.6e-3), refined(3.0)).limit
    assert gone is not None
    return gone


@pytest.mark.study(seconds=3, only=("specimen0-1.0",))
@pytest.mark.parametrize(("specimen", "refine"), [(EDGED, 1.0), (EDGED, 1.5), (EDGED, 2.0),
                                                  (EDGED_TURNED, 1.0), (EDGED_TURNED, 1.5)])
def test_an_electrode_s_edge_gives_way_at_one_voltage_on_every_mesh(
        at_edge: Limit, specimen: Specimen, refine: float) -> None:
    """At its tip; what finite elements do beyond is noise, and no limit is read from it."""
    reached = limits(Case(specimen, mass=6.6e-3), refined(refine))
    gone = reached.instability
    assert gone is not None
    assert (reached.reached, reached.first) == ((gone,), "instability")
    assert gone.at_edge
    assert f"{gone.text}, at the electrode's edge" in reached.ended
    assert abs(gone.voltage_V / at_edge.voltage_V - 1) < gone.spread < 3.2e-2
    assert np.hypot(gone.x_m, gone.y_m) == pytest.approx(65.5e-3 - 5.3e-3, rel=1e-3)


@pytest.mark.study(seconds=6)
def test_finite_elements_find_the_waves_of_an_electrode_s_edge_soon_beyond() -> None:
    """None before; beyond it the more, the shorter their elements let waves be."""
    film = Film(0.614e-3, (2.91, 2.91), NeoHooke(20e3), 4.0)
    plate = Plate(Circle(14.96e-3), (8.11e-3, -17.12e-3))
    case = Case(Specimen("waves", Circle(53.72e-3), plate, film, Electrode(3.96e-3, 1.98e-3)),
                mass=2.16e-3)
    numbers = []
    for refine in (0.7, 1.0):
        gone = first_limit(case, refined(refine))
        assert gone is not None
        assert gone.kind == "instability"
        for share in (0.99, 1.015):
            _, there = equilibrate(replace(case, voltage=share * gone.voltage_V), refined(refine))
            assert there.status == "equilibrium"
            numbers.append(there.solution.wrinkling)
    assert numbers[0] == numbers[2] == 0
    assert 0 < numbers[1] < numbers[3]


def test_solve_knows_of_the_edge_too(at_edge: Limit) -> None:
    before, beyond = (solve(Case(EDGED, mass=6.6e-3, voltage=share * at_edge.voltage_V),
                            Settings()) for share in (0.99, 1.004))
    assert not any("instability" in words for words in before.warnings)
    assert "instability at" in beyond.warnings[0]


def softening(alpha: float, thickness: float, stretch: float) -> tuple[Specimen, axisymmetric.Film]:
    """A film of an Ogden law of one term, for the program and for the equations."""
    specimen = Specimen("ogden", Circle(45e-3), Plate(Circle(10e-3)), Film(
        thickness, (stretch, stretch), Ogden((40e3,), (alpha,)), 4.7))
    law = axisymmetric.Ogden((40e3,), (alpha,))
    return specimen, axisymmetric.Film(10e-3, 45e-3, thickness, stretch, law, 4.7)


@pytest.mark.study(seconds=4, only=("1.3-0.0005-2.5-0.003-1.5", "1.2-0.001-2.5-0.003-2.0"))
@pytest.mark.parametrize(("alpha", "thickness", "stretch", "mass", "refine"), [
    (1.2, 1e-3, 2.5, 3e-3, 0.7), (1.1, 1e-3, 2.0, 3e-3, 0.7),
    dear(1.2, 1e-3, 2.5, 3e-3, 2.0, seconds=7),
    (1.3, 0.5e-3, 2.5, 3e-3, 1.5), (1.25, 0.5e-3, 3.0, 1e-3, 1.0)])
def test_a_short_fold_is_not_stepped_over(alpha: float, thickness: float, stretch: float,
                                          mass: float, refine: float) -> None:
    """Beyond it there is a smooth branch, on which the film is unstable throughout."""
    specimen, film = softening(alpha, thickness, stretch)
    gone = limits(Case(specimen, mass=mass), refined(refine)).instability
    assert gone is not None
    assert gone.spread < 15e-3

    below = axisymmetric.solve_load(film, mass * 9.80665, 0.975 * gone.voltage_V)
    assert least_stiffness(film, below, film.inner) > 0
    with pytest.raises(axisymmetric.NoEquilibrium):
        axisymmetric.solve_load(film, mass * 9.80665, 1.02 * gone.voltage_V)
    beyond = solve_within(Case(specimen, mass=mass, voltage=1.1 * gone.voltage_V), refined(refine))
    assert beyond.limit is not None
    assert (beyond.limit.kind, beyond.first) == ("instability", "instability")
    assert "instability at" in beyond.warnings[0]
