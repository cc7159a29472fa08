"""Force laws grown as far as readings ask: large effects, several together, films that fail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.oracles import axisymmetric
from tests.support.costs import dear
from tympan.fem.equilibrium.voltage_path import voltage_path
from tympan.fem.film.laws.stiffened import scaled
from tympan.fem.rig import Rig
from tympan.studies.case import Case, build_model, solve
from tympan.studies.diagnosis.calibration import calibrated, with_effects
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis, sizes_of
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.reduced import sampling
from tympan.studies.diagnosis.reduced.axes import HeldFilm
from tympan.studies.diagnosis.reduced.force_law import Grid
from tympan.studies.diagnosis.reduced.growth import first_laws, grown, refined, regridded
from tympan.studies.diagnosis.reduced.reduced_films import bounds_of, limits_of
from tympan.studies.diagnosis.reduced.sampling import COARSE, FINE, FiniteElements, nominal_law
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import Setup
from tympan.studies.shipped import actuators

LOSS = Cause("prestretch_loss", "circular")


def _table(specimen: int = 0) -> ReadingTable:
    mass, voltage = (grid.ravel() for grid in np.meshgrid((0.0179, 0.02245), (0.0, 4e3, 6e3),
                                                          indexing="ij"))
    return rows(States.of(np.full(len(mass), specimen), mass, voltage), "displacement", 1e-5)


def _grown_to(simulation: Simulation, hypothesis: Hypothesis, unknowns) -> Simulation:
    """Grown until the films are sampled at least so far."""
    for cause in hypothesis:
        for index, number in enumerate(range(*sizes_of(hypothesis, cause).indices(99))):
            side = 1 if unknowns[number] >= 0 else -1
            while abs(bounds_of(simulation, hypothesis)[int(side > 0), number]) < abs(
                    unknowns[number]):
                larger = grown(simulation, cause, index, side)
                assert larger is not simulation
                simulation = larger
    return simulation


@pytest.mark.parametrize(("hypothesis", "sizes"), [
    ((Cause("electrode_stiffness"),), (15e3,)),
    ((Cause("prestretch_loss", "elliptical-small"),), (0.2,)),
    ((Cause("strain_stiffening"),), (1.2,)),
    ((Cause("permittivity_stretch"),), (0.9,)),
    ((Cause("electrode_margin"),), (8e-3,)),
    ((Cause("plate_eccentricity"),), (15e-3, 0.0)),
    ((Cause("prestretch_anisotropy"),), (0.08,)),
    dear((Cause("plate_eccentricity"), Cause("prestretch_anisotropy")), (3e-3, 6e-3, 0.05),
         seconds=8),
], ids=str)
def test_large_effects_agree_with_finite_elements_on_a_finer_mesh(three_shapes: Simulation,
                                                                  hypothesis, sizes) -> None:
    """Where they are grown, near enough to find them; where they are refined, exactly."""
    unknowns = np.array([0.05, -0.05, *sizes])
    large = _grown_to(three_shapes, hypothesis, unknowns)
    exact = refined(large, hypothesis, unknowns)
    setup, table = three_shapes.extended(hypothesis, unknowns), _table(1)
    plain = three_shapes.predict((), unknowns[:2], table)
    case = Case(setup.specimens[1], mass=0.02245, voltage=6e3, rig=setup.rig)
    truth = solve(case, FINE).reading_m
    assert truth is not None
    effect = abs(truth - plain[-1])
    assert effect > 10e-6
    assert abs(large.predict(hypothesis, unknowns, table)[-1] - truth) < 0.2 * effect + 2e-6
    assert abs(exact.predict(hypothesis, unknowns, table)[-1] - truth) < 1e-6


def test_a_fifth_of_the_stretch_lost_agrees_with_the_axisymmetric_equations(
        three_shapes: Simulation) -> None:
    unknowns = np.array([0.0, 0.0, 0.2])
    exact = refined(_grown_to(three_shapes, (LOSS,), unknowns), (LOSS,), unknowns)
    film, table = three_shapes.setup.specimens[0].membrane, _table()
    oracle = axisymmetric.Film(10e-3, 45e-3, film.thickness, 0.8 * film.prestretch[0],
                               axisymmetric.Ogden(tuple(film.material.mu),
                                                  tuple(film.material.alpha)),
                               film.relative_permittivity)
    truth = [axisymmetric.solve_load(oracle, mass * Rig().gravity, voltage).deflection
             for mass, voltage in zip(table.mass, table.voltage, strict=True)]
    assert exact.predict((LOSS,), unknowns, table) == pytest.approx(truth, rel=4e-4)


def test_what_is_refined_is_not_refined_again(three_shapes: Simulation) -> None:
    hypothesis = (Cause("electrode_stiffness"), Cause("permittivity_stretch"))
    unknowns = np.array([0.1, 0.0, 2e3, 0.2])
    once = refined(three_shapes, hypothesis, unknowns)
    assert once is not three_shapes
    assert refined(once, hypothesis, unknowns) is once


def test_only_what_changes_a_film_grows_and_no_further_than_the_specimen_can_be_built(
        three_shapes: Simulation) -> None:
    assert grown(three_shapes, Cause("sensor_gain"), 0, 1) is three_shapes
    assert grown(three_shapes, Cause("electrode_margin"), 0, -1) is three_shapes
    assert refined(three_shapes, (), np.zeros(2)) is three_shapes
    hypothesis = (Cause("plate_eccentricity"),)
    # The plates lie 35 mm from the frames along x; that is where they touch.
    assert 0.03 < limits_of(three_shapes, hypothesis)[1, 2] < 0.035
    axis = next(axis for axis in three_shapes.laws[0].axes if axis.effect == hypothesis[0].name)
    assert axis.ends[1].startswith("cannot be built beyond 3")
    assert axis.ends[1].endswith("mm")


def test_the_tilt_grows_with_the_square_of_the_offset(three_shapes: Simulation) -> None:
    """As finite elements on a finer mesh have it."""
    hypothesis, unknowns = (Cause("plate_eccentricity"),), np.array([0.0, 0.0, 2e-3, 0.0])
    setup = three_shapes.extended(hypothesis, unknowns)
    result = solve(Case(setup.specimens[0], mass=0.02, voltage=5e3), FINE)
    assert result.tilt_rad is not None
    assert result.deflection_m is not None
    axes = three_shapes.laws[0].axes
    sizes = np.array([2e-3 if (axis.effect, axis.index) == ("plate_eccentricity", 0) else 0.0
                      for axis in axes])
    tilt = three_shapes.laws[0].at(sizes).tilt_squared(np.array([result.deflection_m]),
                                                       np.array([5e3**2])) ** 0.5
    assert tilt[0] == pytest.approx(result.tilt_rad, rel=5e-3)


@dataclass(frozen=True)
class Yielding:
    """A film whose force falls with its stretch p and the voltage U [kV]: F = w (p² - U²).

    It cannot be solved below ``least``, nor from U² = ``top`` p on.
    """

    least: float = 0.0
    top: float = np.inf

    def stored(self, film: HeldFilm, grid: Grid) -> np.ndarray | None:
        return None

    def solved(self, film: HeldFilm, grid: Grid, near: Sequence[HeldFilm]) -> np.ndarray:
        stretch = film.specimen.membrane.prestretch[0]
        if stretch < self.least:
            raise ArithmeticError("it is slack")
        deflections, squares = grid.nodes[0], 1e-6 * grid.nodes[1]
        force = deflections[:, None] * (stretch**2 - squares)
        force[:, squares > self.top * stretch] = np.nan
        return np.stack(5 * [force])


def _circle(solver: Yielding) -> Simulation:
    setup = Setup(actuators()[:1], Rig())
    return Simulation(setup, first_laws(solver, setup, [Grid(1.0, 1e6, odd=True)]))


def test_an_axis_ends_where_its_films_cannot_be_solved_and_says_why() -> None:
    stretch = actuators()[0].membrane.prestretch[0]
    simulation = _circle(Yielding(least=0.9 * stretch))
    for _ in range(4):
        simulation = grown(simulation, LOSS, 0, 1)
    assert grown(simulation, LOSS, 0, 1) is simulation
    assert 0.07 < bounds_of(simulation, (LOSS,))[1, 2] <= 0.1
    axis = next(axis for axis in simulation.laws[0].axes if axis.effect == LOSS.name)
    assert axis.ends[1].startswith("cannot be solved beyond 0.0")
    assert axis.ends[1].endswith("it is slack")
    # The law is as good as it was where there are films.
    force, _ = _force(simulation, 0.05)
    assert force == pytest.approx(0.5 * ((0.95 * stretch) ** 2 - 0.3))


def test_a_side_without_a_sample_grows_from_none() -> None:
    whole = _circle(Yielding())
    law = whole.laws[0]
    number, axis = next((number, axis) for number, axis in enumerate(law.axes) if axis.side(-1))
    kept = {sizes: sample for sizes, sample in law.samples.items()
            if not {(number, size) for size in axis.side(-1)} & set(sizes)}
    assert len(kept) == len(law.samples) - len(axis.side(-1))
    axes = (*law.axes[:number], replace(axis, places=axis.side(1)), *law.axes[number + 1:])
    bare = replace(whole, laws=(replace(law, axes=axes, samples=kept),))
    again = grown(bare, Cause(axis.effect), axis.index, -1).laws[0].axes[number]
    assert again.span(-1) == pytest.approx(axis.parameter.deviation, rel=1e-6)


def test_a_film_that_fails_at_the_highest_voltage_is_sampled_up_to_a_lower_one() -> None:
    stretch = actuators()[0].membrane.prestretch[0]
    simulation = _circle(Yielding(top=0.99 / stretch))
    reached = [sample.grid.voltage_squared for sample in simulation.laws[0].samples.values()]
    assert min(reached) < 0.99e6 < max(reached)
    force, _ = _force(simulation, 0.05)
    assert force == pytest.approx(0.5 * ((0.95 * stretch) ** 2 - 0.3))


def _force(simulation: Simulation, loss: float) -> tuple[float, float]:
    law = simulation.laws[0]
    sizes = np.array([loss if axis.effect == LOSS.name else 0.0 for axis in law.axes])
    surface, at, squared = law.at(sizes), np.array([0.5]), np.array([0.3e6])
    force, stiffness = surface.force(at, surface.by_deflection(squared))
    return float(force[0]), float(stiffness[0])


def test_other_grids_keep_the_samples() -> None:
    simulation = grown(_circle(Yielding()), LOSS, 0, 1)
    joint = refined(simulation, (LOSS, Cause("prestretch_anisotropy")),
                    np.array([0.0, 0.0, 0.04, 0.03]))
    larger = regridded(joint, [Grid(2.0, 1.5e6, odd=True)])
    assert larger.laws[0].samples.keys() == joint.laws[0].samples.keys()
    assert larger.laws[0].grid.deflection == 2.0
    assert _force(larger, 0.05) == pytest.approx(_force(joint, 0.05))


def test_films_softer_than_stated_are_sampled_up_to_their_limit() -> None:
    """At 6.5 kV one of 85 % of the stiffness stands nearly where it collapses."""
    circle = actuators()[0]
    soft = replace(circle, membrane=replace(circle.membrane,
                                            material=scaled(circle.membrane.material, 0.85)))
    voltages, setup = [0.0, 2e3, 3.5e3, 4.5e3, 5.5e3, 6e3, 6.5e3], Setup((circle,), Rig())
    model = build_model(soft, COARSE, setup.rig.loading)
    deflections = [outcome.state.plate.deflection
              for outcome in voltage_path(model, 0.02245 * setup.rig.gravity, voltages)]
    count = len(voltages)
    states = States.of([0] * count, [0.02245] * count, voltages)
    table = rows(states, "displacement", 10e-6, np.array(deflections))
    nominal = calibrated(setup, table)
    simulation = with_effects(nominal.simulation, lambda done, count: None, 1)
    assert len(nominal.table) == count
    assert np.exp(nominal.fit.unknowns[0]) == pytest.approx(0.85, rel=0.02)
    predicted = simulation.predict((), nominal.fit.unknowns, table)
    assert predicted == pytest.approx(deflections, abs=3e-6)
    assert all(axis.places for axis in simulation.laws[0].axes)


@pytest.fixture
def cache(tmp_path, monkeypatch: pytest.MonkeyPatch):
    """A cache of its own; the file it is in."""
    monkeypatch.setenv("TYMPAN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "films.sqlite"


def _solves(monkeypatch: pytest.MonkeyPatch) -> list[HeldFilm]:
    """The films that are solved from now on."""
    solved, solve_film = [], sampling.at_nodes

    def counted(film: HeldFilm, *rest, **keywords):
        solved.append(film)
        return solve_film(film, *rest, **keywords)

    monkeypatch.setattr(sampling, "at_nodes", counted)
    return solved


def test_a_film_solved_before_is_read_from_disk(cache, monkeypatch: pytest.MonkeyPatch) -> None:
    setup, solved = Setup(actuators()[:1], Rig()), _solves(monkeypatch)
    first = nominal_law(setup, "circular", 2e-3, 3e3**2)
    assert len(solved) == 1
    again = nominal_law(setup, "circular", 2.01e-3, 3.01e3**2)  # nearly the same reach
    renamed = setup.specimens[0], replace(setup.specimens[0], name="other")
    other = nominal_law(Setup(renamed, Rig()), "other", 2e-3, 3e3**2)
    assert len(solved) == 1
    assert np.array_equal(first.nominal, again.nominal)
    assert np.array_equal(first.nominal, other.nominal)
    film = HeldFilm.of(setup, "circular")
    thicker = replace(film, specimen=replace(film.specimen, membrane=replace(
        film.specimen.membrane, thickness=1.0001 * film.specimen.membrane.thickness)))
    assert FiniteElements().stored(film, first.grid) is not None
    assert FiniteElements().stored(thicker, first.grid) is None
    assert FiniteElements().stored(film, replace(first.grid, deflection=2.1e-3)) is None
    assert cache.exists()


@pytest.mark.parametrize("content", [b"no database" * 100, b"SQLite format 3\0" + bytes(200)])
def test_a_broken_cache_is_as_good_as_none(cache, content: bytes,
                                           monkeypatch: pytest.MonkeyPatch) -> None:
    cache.parent.mkdir()
    cache.write_bytes(content)
    setup, solved = Setup(actuators()[:1], Rig()), _solves(monkeypatch)
    nominal_law(setup, "circular", 2e-3, 3e3**2)
    assert len(solved) == 1
    nominal_law(setup, "circular", 2e-3, 3e3**2)
    assert len(solved) == 1  # the next one is sound


@pytest.mark.parametrize("folder", ["", "/dev/null/nowhere"])
def test_without_a_cache_films_are_solved_again(folder: str, monkeypatch: pytest.MonkeyPatch
                                                ) -> None:
    monkeypatch.setenv("TYMPAN_CACHE", folder)
    setup, solved = Setup(actuators()[:1], Rig()), _solves(monkeypatch)
    for _ in range(2):
        nominal_law(setup, "circular", 2e-3, 3e3**2)
    assert len(solved) == 2
