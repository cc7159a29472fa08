"""The reduced film with memory: against other solvers, the field model, and its own file."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.constants import epsilon_0

from tests.oracles.creep import CreepingFilm
from tests.support.biases import DECLARED
from tests.support.specimens import circular, elliptical
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.density import FilmDensity
from tympan.fem.film.flows import ShearThinning
from tympan.fem.film.laws import NeoHooke, Ogden, PrestretchedOgden
from tympan.fem.film.library import load_specimen
from tympan.fem.film.staged_memory import StagedFlow
from tympan.fem.rig import Rig
from tympan.fem.transient.collocation import radau
from tympan.fem.transient.ends import Stopped
from tympan.fem.transient.integrate import StepSettings
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Ellipse, RoundedRectangle
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen, ViscousBranch
from tympan.studies.case import Case, Settings, build_model, solve
from tympan.studies.films.driven_film import ReducedMoment
from tympan.studies.films.film import FilmLoads, NoBalance, ReducedFilm
from tympan.studies.films.reduction import error_of, held_out, reduced_film
from tympan.studies.limits import limits
from tympan.studies.lumped.build import BuildSettings, build
from tympan.studies.lumped.film_response import film_deflections, film_motion, film_response
from tympan.studies.lumped.model_file import STILL, LumpedModel, read_model, write_model
from tympan.studies.motion import Trace
from tympan.studies.signals import Pieces, Sine, ramp, random_steps, step
from tympan.studies.transient import TransientCase, history

ACTUATORS = Path(__file__).parents[3] / "studies" / "shipped"
MASS, HEAVY, HIGH = 17.9e-3, 22.45e-3, 7e3
FORCES = MASS * 9.80665, HEAVY * 9.80665
ROOT5 = 5**0.5


def branched(specimen: Specimen, *branches: ViscousBranch, **more: Any) -> Specimen:
    return replace(specimen, membrane=replace(specimen.membrane, branches=branches, **more))


NEO = branched(circular(NeoHooke(20e3)), ViscousBranch(200e3, 10.0))
EXACT = CreepingFilm(10e-3, 45e-3, 1e-3, ROOT5, 20e3, 200e3, 10.0, 4.7)
TAPE = Ogden((18.4e3, 210.0), (2.0, 4.0))
BAND = replace(branched(elliptical(75e-3, TAPE), ViscousBranch(1e6, 30.0),
                        ViscousBranch(50e3, 2.0)), electrode=Electrode(8e-3, 0.0))


@cache
def of(specimen: Specimen, voltage: float = HIGH) -> ReducedFilm:
    return reduced_film(build_model(specimen, Settings()), FORCES, voltage)


def moved(film: ReducedFilm, signal: Any, times: np.ndarray, mass: float = MASS, **more: Any
          ) -> np.ndarray:
    moments = list(film_motion(film, signal, mass, **more).moments())
    return Trace(np.array([moment.time for moment in moments])).at(
        np.array([moment.deflection for moment in moments]), times)


def stepped(low: float, high: float, end: float) -> Pieces:
    return Pieces(np.array([0.0, 0.0, end]), np.array([low, high, high]))


def test_creep_against_the_axisymmetric_equations() -> None:
    """Of which the film knows nothing: finite elements made it, these are solved by other means."""
    times = np.array([0.0, 1.0, 10.0, 30.0, 100.0])
    exact = EXACT.history((FORCES[0], 0.0), (FORCES[0], 7e3), times[1:])
    assert moved(of(NEO), stepped(0.0, 7e3, 100.0), times) == pytest.approx(exact, rel=2e-4)
    exact = EXACT.history((FORCES[1], 0.0), (FORCES[1], 4.2e3), times[1:])
    assert moved(of(NEO), stepped(0.0, 4.2e3, 100.0), times, HEAVY) == pytest.approx(exact,
                                                                                     rel=2e-4)


def test_the_plates_swing_against_the_axisymmetric_equations() -> None:
    times = 1e-3 * np.array([10, 20, 50, 100, 200, 300])
    exact = EXACT.swing(MASS, FORCES[0], 3500.0, times)
    near = moved(of(NEO), stepped(0.0, 3500.0, 0.3), times, inertia=True)
    assert np.abs(near - exact).max() < 2e-3 * np.ptp(exact)


@pytest.mark.parametrize("inertia", [False, True])
def test_a_damper_holds_the_plate_at_a_jump(inertia: bool) -> None:
    """Then it creeps to its rest; one that is there within microseconds leaves creep alone."""
    times = np.r_[np.geomspace(1e-3, 0.3, 12), 0.0 if inertia else 2.0]
    times.sort()
    exact = EXACT.swing(MASS if inertia else 0.0, FORCES[0], 7e3, times, 4.0)
    near = moved(of(NEO), stepped(0.0, 7e3, times[-1]), times, inertia=inertia,
                 rig=Rig(plate_damping=4.0))
    assert np.abs(near - exact).max() < 2e-3 * np.ptp(exact)
    late = np.array([30.0, 100.0])
    creep = EXACT.history((FORCES[0], 0.0), (FORCES[0], 7e3), late)[1:]
    signal, rig = stepped(0.0, 7e3, 100.0), Rig(plate_damping=20.0 if inertia else 1e-4)
    motion = film_motion(of(NEO), signal, MASS, rig, inertia)
    # Four moments a step.
    assert len(list(motion.moments())) / 4 < (40 if inertia else 20)
    # The heavier damper is still a third of a second behind.
    behind = 1e-3 if inertia else 2e-4
    assert moved(of(NEO), signal, late, inertia=inertia, rig=rig) == pytest.approx(creep,
                                                                                   rel=behind)


@pytest.mark.parametrize(("law", "inertia"), [
    ("spring", True), *((law, False) for law in DECLARED)])
def test_mechanisms_on_the_plate_are_those_of_finite_elements(law: str, inertia: bool) -> None:
    """A film made without them creeps, and swings, with each as the whole film in time does."""
    rig, film = Rig(biases=(DECLARED[law],), plate_damping=0.3 * inertia), of(NEO)
    end = 0.2 if inertia else 30.0
    signal, times = stepped(0.0, 4e3, end), np.linspace(0.0, end, 20)
    case = TransientCase(NEO, signal, mass=MASS, rig=rig, inertia=inertia)
    done = history(case, Settings())
    field = done.at(done.deflection, times)
    near = moved(film, signal, times, rig=rig, inertia=inertia)
    assert np.abs(near - field).max() < 3e-4 * np.abs(field).max()
    plain = moved(film, signal, times, inertia=inertia)
    assert np.abs(near - plain).max() > 2e-2 * np.abs(field).max()  # it does something


@pytest.mark.parametrize("pressure", [30.0, -30.0])
def test_gas_lifts_the_plate_in_time_as_finite_elements_have_it(pressure: float) -> None:
    """To the bulge of the film, which counts with the square of the pressure."""
    built = build(NEO, Settings(), BuildSettings((MASS,), (0.0, 2e3, 4e3))).model
    assert built.film is not None
    rig, times = Rig(gas_pressure=pressure), np.linspace(0.0, 30.0, 20)
    signal = stepped(0.0, 4e3, 30.0)
    done = history(TransientCase(NEO, signal, mass=MASS, rig=rig), Settings())
    field = done.at(done.deflection, times)
    near = moved(built.film, signal, times, rig=rig)
    assert np.abs(near - field).max() < 3e-3 * np.abs(field).max()
    with pytest.raises(InputError, match="no gas_area_m2: build it again"):
        film_motion(of(NEO), signal, MASS, rig)


#: Charging in a microsecond, a tenth of a second and the better part of two, which also leaks.
CIRCUITS = (Rig(series_resistance=1e3), Rig(series_resistance=1e8),
            Rig(series_resistance=1.5e9, leakage_resistance=1.5e10))


@pytest.mark.parametrize("rig", CIRCUITS, ids=["at once", "soon", "late"])
@pytest.mark.parametrize("signal", [step(0.0, 6e3, 0.0, 20.0), step(4e3, 1e3, 0.0, 20.0),
                                    Sine(2.5e3, 2.5e3, 10.0, 1.0)], ids=["up", "down", "sine"])
def test_a_film_that_charges_creeps_as_by_finite_elements(rig: Rig, signal: Any) -> None:
    when = np.linspace(0.0, signal.end, 81)
    done = history(TransientCase(NEO, signal, mass=MASS, rig=rig,
                                 steps=StepSettings(error=1e-6)), Settings())
    field, voltage = (done.at(values, when) for values in (done.deflection, done.voltage))
    moments = list(film_motion(of(NEO), signal, MASS, rig).moments())
    trace = Trace(np.array([moment.time for moment in moments]))
    near = trace.at(np.array([moment.deflection for moment in moments]), when)
    across = trace.at(np.array([moment.voltage for moment in moments]), when)
    assert np.abs(near - field).max() < 2e-3 * np.ptp(np.append(field, done.before))
    assert np.abs(across - voltage).max() < 1e-3 * np.abs(voltage).max()


@pytest.mark.parametrize("rig", CIRCUITS, ids=["at once", "soon", "late"])
def test_a_film_charges_by_a_sine_about_0_v_in_few_steps(rig: Rig) -> None:
    """The source is 0 V at both ends of its signal; its size is not."""
    signal, when = Sine(0.0, 5e3, 10.0, 1.0), np.linspace(0.0, 10.0, 81)
    done = history(TransientCase(NEO, signal, mass=MASS, rig=rig), Settings())
    field = done.at(done.deflection, when)
    moments = list(film_motion(of(NEO), signal, MASS, rig).moments())
    assert max(len(moments), len(done.time)) < 200
    near = Trace(np.array([moment.time for moment in moments])).at(
        np.array([moment.deflection for moment in moments]), when)
    assert np.abs(near - field).max() < 5e-3 * np.ptp(field)  # 2e-3 of it without a circuit


@pytest.mark.parametrize("rig", [Rig(series_resistance=1e7), Rig(series_resistance=3e6,
                                                                 plate_damping=0.3)])
def test_the_swing_of_a_film_that_charges_is_that_of_finite_elements(rig: Rig) -> None:
    signal, when = stepped(0.0, 4e3, 0.2), np.linspace(0.0, 0.2, 81)
    done = history(TransientCase(NEO, signal, mass=MASS, rig=rig, inertia=True,
                                 steps=StepSettings(error=1e-6)), Settings())
    field = done.at(done.deflection, when)
    near = moved(of(NEO), signal, when, rig=rig, inertia=True)
    assert np.abs(near - field).max() < 2e-3 * np.ptp(field)
    plain = moved(of(NEO), signal, when, rig=replace(rig, series_resistance=0.0), inertia=True)
    assert np.abs(near - plain).max() > 0.05 * np.ptp(field)  # it charges late


def test_a_stiff_film_charges_as_a_capacitor_does() -> None:
    """In closed form: U = U_s (1 − e^(−t/RC)), of a film that hardly moves at 10 V, and back.

    Beyond 0 to a negative voltage, too.
    """
    rig, signal = Rig(series_resistance=1e9), Pieces(np.array([0.0, 0.0, 4.0, 4.0, 8.0]),
                                                     np.array([0.0, 10.0, 10.0, -10.0, -10.0]))
    film = of(NEO)
    moments = list(film_motion(film, signal, MASS, rig, error=1e-6).moments())
    time = np.array([moment.time for moment in moments])
    late = 1e9 * film.capacitance(moments[0].q)
    charged = 10 * (1 - np.exp(-time / late))
    top = 10 * (1 - np.exp(-4.0 / late))
    back = -10 + (top + 10) * np.exp(-(time - 4.0) / late)
    exact = np.where(time <= 4.0, charged, back)
    assert [moment.voltage for moment in moments] == pytest.approx(exact, abs=1e-4)


@pytest.mark.parametrize("mounted", [None, 3600.0])
def test_films_that_charge_together_are_each_its_own(mounted: float | None) -> None:
    film, when = of(NEO), np.linspace(0.0, 20.0, 25)
    if mounted is not None:
        membrane = replace(film.specimen.membrane, mounted=mounted)
        film = replace(film, specimen=replace(film.specimen, membrane=membrane))
    rig = Rig(series_resistance=1e9)
    signals = [random_steps(0.0, high, 10.0, 2, 5) for high in (3e3, 5e3)]
    together = film_deflections(film, signals, [MASS, HEAVY], when, rig)
    for row, signal, mass in zip(together, signals, (MASS, HEAVY), strict=True):
        alone, = film_deflections(film, [signal], [mass], when, rig)
        assert row == pytest.approx(alone, rel=3e-4)


@pytest.mark.parametrize("specimen", [NEO, BAND], ids=["circle", "band"])
def test_at_rest_it_is_the_field_model(specimen: Specimen) -> None:
    """At loads that it was not made from, its capacitance too; no more volume than the film has."""
    film = of(specimen)
    for mass, voltage in ((MASS, 3e3), (20e-3, 5.5e3), (HEAVY, 1e3)):
        field = solve(Case(specimen, mass=mass, voltage=voltage), Settings())
        q = film.at_rest(FilmLoads(mass * 9.80665, voltage**2))
        assert q[0] == pytest.approx(field.deflection_m, rel=1e-3)
        assert film.capacitance(q, voltage**2) == pytest.approx(field.capacitance_F, rel=1e-3)
    assert (film.volumes > 0).all()
    model = build_model(specimen, Settings())
    whole = model.volumes.sum() * model.discretisation.mirrored
    assert film.volumes.sum() == pytest.approx(whole, rel=1e-3)


def test_pull_in_is_the_fields() -> None:
    """Beyond the voltages that it was made from."""
    film, field = of(NEO), limits(Case(NEO, mass=MASS), Settings(), beyond=True)
    low, high = HIGH, 12e3
    while high - low > 1.0:
        middle = (low + high) / 2
        try:
            film.at_rest(FilmLoads(FORCES[0], middle**2))
            low = middle
        except NoBalance:
            high = middle
    assert field.pull_in is not None
    assert low == pytest.approx(field.pull_in.voltage_V, rel=2e-3)


def test_fast_branches_leave_it_elastic_and_slow_ones_as_it_begins() -> None:
    """τ → 0: the field at rest; τ → ∞: the field at once. The same points: τ is no part of them."""
    film, end = of(NEO), np.array([1.0])
    fast = replace(film, specimen=branched(NEO, ViscousBranch(200e3, 1e-6)))
    rest = solve(Case(NEO, mass=HEAVY, voltage=5e3), Settings()).deflection_m
    assert moved(fast, stepped(0.0, 5e3, 1.0), end, HEAVY) == pytest.approx([rest], rel=1e-3)
    slow = branched(NEO, ViscousBranch(200e3, 1e9))
    at_once = history(TransientCase(slow, stepped(0.0, 5e3, 1.0), mass=HEAVY), Settings())
    assert moved(replace(film, specimen=slow), stepped(0.0, 5e3, 1.0), end, HEAVY) == \
        pytest.approx([at_once.deflection[-1]], rel=1e-3)


def _energy(film: ReducedFilm, moment: ReducedMoment) -> float:
    c = film.strain(moment.q)
    virgin = replace(film.specimen, membrane=replace(film.specimen.membrane,
                                                     prestretch=(1.0, 1.0)))
    density = FilmDensity(virgin, moment.loads.voltage_squared, film.covered)
    stored = density(tuple(c), tangent=False).energy + moment.memory.energy(c)
    return float((stored * film.volumes).sum()) - moment.loads.force * moment.q[0]


@pytest.mark.parametrize("specimen", [NEO, BAND], ids=["circle", "band"])
def test_it_never_gains_energy(specimen: Specimen) -> None:
    """What the branches turn to heat is never negative, and is what is missing in the balance."""
    film = of(specimen)
    signal = ramp(0.0, 6e3, 20.0)
    moments = list(film_motion(film, signal, MASS, error=1e-6).moments())
    time = np.array([moment.time for moment in moments])
    energy = np.array([_energy(film, moment) for moment in moments])
    heat = np.array([(moment.memory.dissipation(film.strain(moment.q)) * film.volumes).sum()
                     for moment in moments])
    assert (heat >= -1e-9 * heat.max()).all()
    charge = np.array([film.capacitance(moment.q, moment.loads.voltage_squared)
                       for moment in moments])
    squared = np.array([moment.loads.voltage_squared for moment in moments])

    # The moments are far apart: between, all is a cubic spline.
    often = np.linspace(0.0, signal.end, 2001)
    charge, squared, heat = (Trace(time).at(values, often) for values in (charge, squared, heat))

    def total(values: np.ndarray, by: np.ndarray) -> float:
        return float(((values[1:] + values[:-1]) / 2 * np.diff(by)).sum())

    # The energy counts the film's charge at constant voltage: dE = −½ C dU² − heat dt.
    work = -total(charge, squared) / 2
    missing = energy[0] + work - energy[-1]
    assert missing == pytest.approx(total(heat, often), rel=2e-3)
    assert missing > 0


def test_many_runs_together_are_each_its_own() -> None:
    """Their steps are shared; who pulls in is nan from then on and takes nobody along."""
    film, when = of(NEO), np.linspace(0.0, 120.0, 25)
    cases = [(mass, high) for mass in (MASS, HEAVY) for high in (0.0, 3e3, 6.5e3, 14e3)]
    signals = [random_steps(0.0, high, 40.0, 3, 5) for _, high in cases]
    together = film_deflections(film, signals, [mass for mass, _ in cases], when)
    for row, signal, (mass, high) in zip(together, signals, cases, strict=True):
        alone, = film_deflections(film, [signal], [mass], when)
        assert np.isnan(row).any() == (high > 9e3)
        assert (np.isnan(row) == np.isnan(alone)).all()
        assert np.nan_to_num(row) == pytest.approx(np.nan_to_num(alone), rel=1e-3)
    with pytest.raises(InputError, match="the same breaks"):
        film_deflections(film, [stepped(0.0, 1e3, 1.0), stepped(0.0, 1e3, 2.0)], [MASS] * 2, when)


def test_stiffness_derives_from_the_forces() -> None:
    film, q = of(BAND), np.array([3e-3, 2e-4, -1e-4, *np.zeros(of(BAND).count - 3)])
    flow = film.relaxed(0.9 * q).step(film.strain(0.9 * q), 3.0)
    _, stiffness = film.pull(q, 25e6, flow)
    for number, change in enumerate(1e-8 * np.eye(film.count)):
        difference = film.pull(q + change, 25e6, flow)[0] - film.pull(q - change, 25e6, flow)[0]
        assert difference / 2e-8 == pytest.approx(stiffness[number],
                                                  abs=1e-5 * np.abs(stiffness).max())


@pytest.mark.parametrize("specimen", [NEO, BAND], ids=["circle", "band"])
def test_its_law_in_a_table_is_its_law(specimen: Specimen) -> None:
    """And where the table ends, and where the film wrinkles, it is the law that is asked."""
    film = of(specimen)
    assert film.tabulated.table is not None
    flow = film.relaxed(film.flat).step(film.strain(film.flat), 0.0)
    for deflection, squared, near in ((3e-3, 30e6, 1e-4), (3e-2, 30e6, 1e-13), (3e-3, 9e8, 1e-13)):
        q = deflection * np.eye(film.count)[0]
        for exact, quick in zip(film.pull(q, squared, flow), film.tabulated.pull(q, squared, flow),
                                strict=True):
            assert np.abs(quick - exact).max() <= near * np.abs(exact).max()


@pytest.mark.parametrize("alike", [False, True])
def test_stiffness_over_stages_derives_from_the_forces(alike: bool) -> None:
    """By q of the same stage anywhere, by that of others where the film is the same at all."""
    film, rule = of(BAND), radau(3)
    start = np.array([3e-3, 2e-4, -1e-4, *np.zeros(film.count - 3)])
    flow = StagedFlow.of(film.relaxed(0.9 * start), film.strain(start), 3.0, rule.matrix)
    q = np.outer(1 + (0.0 if alike else 0.1) * rule.nodes, start)
    squared = 1e6 * np.array([20.0, 25.0, 30.0])
    _, stiffness, _ = film.staged_pull(q, squared, flow)
    for stage, other in [(i, j) for i in range(3) for j in range(3) if alike or i == j]:
        for number, change in enumerate(1e-8 * np.eye(film.count)):
            moved = np.zeros_like(q)
            moved[other] = change
            ends = [film.staged_pull(q + sign * moved, squared, flow)[0] for sign in (1, -1)]
            assert (ends[0] - ends[1])[stage] / 2e-8 == pytest.approx(
                stiffness[stage, :, other, number], abs=1e-5 * np.abs(stiffness).max())


def test_dashpots_that_thin_against_the_field_model() -> None:
    """Under a step at once and a slow ramp, of viscosities that fall a hundredfold."""
    branch = ViscousBranch(300e3, 60.0, ShearThinning(2e3, 0.7, 0.01))
    film = of(branched(circular(TAPE), branch), 6e3)
    for signal in (step(0.0, 5e3, 0.0, 30.0), ramp(0.0, 5e3, 40.0)):
        field = history(TransientCase(film.specimen, signal, mass=MASS), Settings())
        when = np.linspace(0.0, signal.end, 41)
        exact = field.at(field.deflection, when)
        near, before = moved(film, signal, when), film.at_rest(FilmLoads(FORCES[0], 0.0))[0]
        assert np.abs(near - exact).max() < 5e-3 * np.ptp(np.append(exact, before))


def test_a_branch_much_stiffer_than_the_law_against_the_field_model() -> None:
    """There a state a little out of balance is out of it by much in the next step."""
    film = of(branched(circular(NeoHooke(50e3)), ViscousBranch(14e6, 11.0)))
    for signal in (Sine(3.5e3, 3.5e3, 60.0, 2.0), stepped(0.0, 7e3, 30.0)):
        field = history(TransientCase(film.specimen, signal, mass=MASS), Settings())
        when = np.linspace(0.0, signal.end, 121)
        exact = field.at(field.deflection, when)
        before = film_motion(film, signal, MASS).begin.deflection
        assert (np.abs(moved(film, signal, when) - exact).max()
                < 5e-3 * np.ptp(np.append(exact, before)))


def test_a_film_without_branches_follows_its_voltage() -> None:
    film = replace(of(NEO), specimen=replace(NEO, membrane=replace(NEO.membrane, branches=())))
    late, = moved(film, ramp(0.0, 6e3, 20.0), np.array([10.0]))
    assert late == pytest.approx(film.at_rest(FilmLoads(FORCES[0], 36e6))[0], rel=2e-4)


def test_a_start_that_is_not_in_balance_is_put_there() -> None:
    """No step is short enough for it."""
    film = of(NEO)
    for inertia in (False, True):
        motion = film_motion(film, stepped(3e3, 3e3, 1.0), MASS, inertia=inertia)
        begin = motion.begin
        q = begin.q + 2e-5 * np.eye(film.count)[1]
        deflections = [moment.deflection for moment in motion.moments(replace(begin, q=q))]
        assert deflections[-1] == pytest.approx(begin.deflection, abs=2e-6)


def lumped(film: ReducedFilm) -> LumpedModel:
    return LumpedModel(film.specimen, (45e-3,), (1.0,), 1.26e-9, HIGH, viscous=STILL, film=film)


def test_the_files_formulas_give_the_same(tmp_path: Path) -> None:
    """The comment at the head of the file, typed again on nothing but its numbers."""
    film = of(NEO)
    write_model(tmp_path / "a.lumped.toml", lumped(film))
    text = (tmp_path / "a.lumped.toml").read_text(encoding="utf-8")
    assert "dB_i/dt = (C_p - (C_p : B_i^-1) B_i/3)/t_i" in text
    read = tomllib.loads(text)
    foil = read["specimen"]["membrane"]
    (branch,), stretch = foil["branch"], np.diag(foil["prestretch"])
    mu, eps = foil["material"]["mu_Pa"], epsilon_0 * foil["relative_permittivity"]
    before, u = np.array([2e-3, 1e-4, *np.zeros(film.count - 2)]), 5e3

    def right(q: np.ndarray, point: dict[str, Any]) -> np.ndarray:
        f = np.eye(3, 2) + np.tensordot(q, np.reshape(point["gradient_per_m"], (-1, 3, 2)), 1)
        return stretch @ f.T @ f @ stretch

    def energy(q: np.ndarray) -> Any:
        whole: Any = 0.0
        for point in read["film"]["point"]:
            c, b = right(q, point), right(before, point)
            c33, b33 = 1 / np.linalg.det(c), 1 / np.linalg.det(b)
            law = mu / 2 * (np.trace(c) + c33 - 3)
            voltage = point["covered"] / 2 * eps * (u / foil["thickness_m"]) ** 2 / c33
            stored = branch["modulus_Pa"] / 2 * (np.trace(c @ np.linalg.inv(b)) + c33 / b33 - 3)
            whole += point["volume_m3"] * (law - voltage + stored)
        return whole

    q = np.array([3e-3, -2e-4, *np.zeros(film.count - 2)])
    pull, _ = film.pull(q, u**2, film.relaxed(before).step(film.strain(before), 0.0))
    for number, change in enumerate(np.eye(film.count)):
        assert energy(q + 1e-30j * change).imag / 1e-30 == pytest.approx(pull[number], rel=1e-9)


def test_reads_back_equal_and_responds_the_same(tmp_path: Path) -> None:
    model = lumped(of(BAND))
    write_model(tmp_path / "a.lumped.toml", model)
    read = read_model(tmp_path / "a.lumped.toml")
    assert read.film is not None
    assert model.film is not None
    assert replace(read, film=None) == replace(model, film=None)
    for name in ("volumes", "covered", "gradients"):
        assert (getattr(read.film, name) == getattr(model.film, name)).all()
    assert read.film.errors == model.film.errors
    when = np.linspace(0.0, 10.0, 11)
    assert (moved(read.film, stepped(0.0, 5e3, 10.0), when)
            == moved(model.film, stepped(0.0, 5e3, 10.0), when)).all()


@pytest.mark.parametrize(("old", "new", "words"), [
    ("volume_m3 = ", "volume_m3 = -", "must be positive"),
    ("gradient_per_m = [", "gradient_per_m = [1.0, ", "six numbers for each shape"),
    ("covered = 1.0", "covered = 7.0", "from 0 to 1"),
    ("[film.error]", "[film.errors]", "error"),
    ("step = ", "step = -", "negative"),
])
def test_a_broken_file_names_its_key(old: str, new: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "a.lumped.toml"
    write_model(file, lumped(of(NEO)))
    file.write_text(file.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_model(file)


def test_a_film_that_pulls_in_says_when() -> None:
    """And a step that the branches bear for a while is followed until they no longer do."""
    film = of(NEO)
    with pytest.raises(Stopped) as ending:
        list(film_motion(film, stepped(0.0, 9.5e3, 1e3), MASS).moments())
    assert 0 <= ending.value.time < 1e3
    response = film_response(lumped(film), stepped(0.0, 9.5e3, 1e3), MASS, Rig(), 1.0)
    assert response.status == "pull_in"
    assert response.stopped_s == ending.value.time
    with pytest.raises(InputError, match="weight beside the centre"):
        film_motion(film, stepped(0.0, 1e3, 1.0), MASS, Rig(weight_offset=(1e-3, 0.0)))


def test_a_film_mounted_a_while_ago() -> None:
    """It begins flat, with the prestress of its branches."""
    specimen = branched(circular(TAPE), ViscousBranch(200e3, 10.0), mounted=60.0)
    film = of(specimen, 5e3)
    assert max(film.errors.values()) < 3e-3
    field = history(TransientCase(specimen, stepped(0.0, 4e3, 20.0), mass=MASS), Settings())
    when = np.linspace(0.0, 20.0, 21)
    assert moved(film, stepped(0.0, 4e3, 20.0), when) == \
        pytest.approx(field.at(field.deflection, when), rel=2e-3)


def test_a_swing_of_an_hour_ends_with_its_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a budget that half a minute of it takes; a film that follows at once needs far less."""
    monkeypatch.setattr("tympan.studies.lumped.film_response.WORK", 1e4)
    model, levels = lumped(of(NEO)), random_steps(0.0, 3e3, 10.0, 360, 1)
    with pytest.raises(InputError, match=r"signal.*given up at .* s of 3600 s; make it shorter"):
        film_response(model, levels, MASS, Rig(), 1.0, inertia=True)
    short = random_steps(0.0, 3e3, 1.0, 2, 1)
    assert film_response(model, short, MASS, Rig(), 1.0, inertia=True).status == "done"
    monkeypatch.setattr("tympan.studies.lumped.film_response.WORK", 1e5)
    assert film_response(model, levels, MASS, Rig(), 1.0).status == "done"


def test_a_film_that_no_reduced_one_follows_is_refused() -> None:
    """A soft film off centre, whose reduced one had no equilibrium without any voltage: it raised
    what nobody expected."""
    law = PrestretchedOgden((2492.0, 124.6), (186.9, 93.44), (2.0, 4.0), 2.1)
    film = Film(0.623e-3, (3.567, 4.049), law, 15.7, branches=(ViscousBranch(10e3, 5.0),))
    specimen = Specimen("soft", RoundedRectangle((30.282e-3, 27.292e-3), 17.727e-3),
                        Plate(Ellipse((12.446e-3, 21.555e-3)), (16.983e-3, 0.0)), film)
    with pytest.raises(InputError, match=r"soft: given 'step, .*has no reduced film that follows"):
        build(specimen, Settings(MeshSettings(order=2).refined(0.5)),
              BuildSettings((70e-6, 88e-6), (0.0, 100.0, 200.0)))


@pytest.mark.study(seconds=3)
def test_build_and_simulate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The commands, beside `transient` on the same signal and rig."""
    file, rig = tmp_path / "tape.toml", tmp_path / "rig.toml"
    file.write_text((ACTUATORS / "circular.toml").read_text(encoding="utf-8")
                    + '\n[[membrane.branch]]\nmodulus = "1 MPa"\ntime = "30 s"\n')
    rig.write_text('spring = "3 N/m"\namplifier_gain = 0.05\n')
    assert not main(["lumped", "build", str(file), "--mass", "17.9 g,22.45 g", "--voltage",
                     "0 kV..6 kV", "--count", "3", "--rig", str(rig), "-o", str(tmp_path),
                     "--json"])
    built, = json.loads(capsys.readouterr().out)["built"]
    assert max(built["film"]["error"].values()) < 5e-3
    assert not built["warnings"]
    common = ["--signal", "sine", "--high", "5.5 kV", "--count", "1", "--duration", "10 s",
              "--interval", "0.1 s", "--rig", str(rig), "--mass", "20 g", "--json"]
    model = str(tmp_path / "circular.lumped.toml")
    answers = []
    for command in (["lumped", "simulate", "--model", model], ["transient", str(file)]):
        assert not main([*command, *common, "-o", str(tmp_path / command[-2])])
        (response,) = json.loads(capsys.readouterr().out)["responses"]
        answers.append(response)
    for key in ("first_m", "last_m", "range_m", "hysteresis_area_V_m"):
        assert answers[0][key] == pytest.approx(answers[1][key], rel=1e-2)
    assert main(["lumped", "build", str(file), "--viscous", "1 MPa,2 MPa s,3 kPa s"]) == 2
    assert "theirs come from the field model" in capsys.readouterr().err


def _of_paper() -> Iterator[Any]:
    for name in ("circular", "elliptical-small", "elliptical-large"):
        for modulus, time in ((200e3, 10.0), (1e6, 30.0)):
            yield pytest.param(name, ViscousBranch(modulus, time), id=f"{name}-{time:g}")


@pytest.mark.study
@pytest.mark.parametrize(("name", "branch"), list(_of_paper()))
def test_the_papers_actuators_within_one_per_cent(name: str, branch: ViscousBranch) -> None:
    """Of the motion's range, under both masses and one between, in signals never made from."""
    specimen = branched(load_specimen(str(ACTUATORS / f"{name}.toml")), branch)
    built = build(specimen, Settings(), BuildSettings((MASS, HEAVY), (0.0, 3.5e3, 7e3)))
    film, model = built.model.film, build_model(specimen, Settings())
    assert film is not None
    signals = {**held_out(model, 7e3), "high": step(0.0, 7e3, 0.0, 30.0),
               "slow": Sine(3.5e3, 3.5e3, 60.0, 2.0), "levels": random_steps(0, 7e3, 30.0, 8, 3)}
    worst = {(mass, label): error_of(film, model, mass * 9.80665, signal)
             for mass in (MASS, 20e-3, HEAVY) for label, signal in signals.items()}
    assert max(worst.values()) < 0.01, worst
