"""Families of films above a gas, with plate and without: against the axisymmetric equations.

The gas volume of a family is a polynomial in its shapes; that of finite elements is another code.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles import axisymmetric
from tests.oracles.axisymmetric import neo_hooke
from tests.oracles.inflation import Disc, Loads, minimise
from tests.support.costs import dear
from tympan.base.errors import InputError
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.loading import film_volume, plate_volume
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.case import Case, Settings, solve
from tympan.studies.films.family import FamilySettings, FilmFamily
from tympan.studies.limits.voltages import first_limit
from tympan.studies.tolerance.tolerance import ToleranceCase, tolerance

OUTER, INNER, MU, STRETCH = 40e-3, 10e-3, 20e3, 2.0
#: Of a family that is quickly made, its error seen here and not asked of it.
QUICK = FamilySettings(rounds=0, checks=2, candidates=32)
BOX = {"membrane.thickness": (0.9e-3, 1.1e-3), "rig.gas_pressure": (100.0, 200.0)}


def disc(plate: Plate | None) -> Specimen:
    return Specimen("disc", Circle(OUTER), plate, Film(
        thickness=1e-3, prestretch=(STRETCH, STRETCH), material=NeoHooke(MU),
        relative_permittivity=4.7))


@pytest.mark.parametrize(("plate", "force"), [(Plate(Circle(INNER)), 0.1), (None, 0.0)])
def test_round_films_are_those_of_the_axisymmetric_equations(plate: Plate | None, force: float
                                                             ) -> None:
    """Lifted by the gas or pulled through it, at loads that the family was not made from."""
    forces = (0.8 * force, 1.5 * force)
    family = FilmFamily.around(disc(plate), BOX, forces, (0.0, 3e3), Rig(gravity=1e-9),
                               family=QUICK)
    for thickness, pressure, pull, voltage in ((0.93e-3, 115.0, 0.9, 0.0),
                                               (1.06e-3, 190.0, 1.4, 2.7e3)):
        film = (axisymmetric.Film(INNER, OUTER, thickness, STRETCH, neo_hooke(MU), 4.7) if plate
                else Disc(0.0, OUTER, thickness, STRETCH, neo_hooke(MU), 4.7))
        lifted = np.pi * INNER**2 * pressure if plate else 0.0
        exact = minimise(film, Loads(pressure, lifted - pull * force, voltage))
        states = family.states([[thickness, pressure]], pull * force, voltage)
        assert states.deflection[0, 0] == pytest.approx(-exact.apex, rel=1e-4)


def test_the_gas_below_tilted_films_does_the_work_that_finite_elements_say() -> None:
    """The difference of two volumes is the mean rate between them, by Simpson's rule for cubics."""
    film = Specimen("oval", Ellipse((60e-3, 45e-3)), Plate(Circle(11e-3), (6e-3, 3e-3)), Film(
        thickness=1e-3, prestretch=(STRETCH, STRETCH), material=NeoHooke(MU),
        relative_permittivity=4.7))
    family = FilmFamily.around(film, BOX, (0.1, 0.15), (0.0, 3e3), family=QUICK)
    row = np.array([[1e-3, 150.0]])
    films, number = family.films(row), np.zeros(1, dtype=np.int64)
    exact = equilibrium(family.ground.film(row[0]), 0.13, 2e3, 150.0)
    model, state = family.ground.film(row[0]), exact.state
    q = family.states(row, 0.13, 2e3).q[0, 0]
    assert q[0] == pytest.approx(state.plate.deflection, rel=3e-5)
    assert np.hypot(*(films.turns @ q)) == pytest.approx(state.plate.tilt, rel=1e-3)

    def rate(share: float) -> float:
        a = films.along(number, share * q[None])
        by = films.volume.first(number, a)
        return float(films._condensed(number, share * q[None], by)[0] @ q)

    mesh = model.discretisation
    volume = mesh.mirrored * film_volume(mesh, state.positions)[0] + plate_volume(
        float(model.plate_area), state.plate)[0]
    assert (rate(0.0) + 4 * rate(0.5) + rate(1.0)) / 6 == pytest.approx(volume, rel=1e-4)
    along = films.along(number, q[None])
    assert films.volume.value(number, along)[0] == pytest.approx(volume, rel=1e-5)


@pytest.mark.study(seconds=4)
@pytest.mark.parametrize("specimen", [
    pytest.param(disc(None), id="without plate"), dear(disc(Plate(Circle(INNER))), seconds=12)])
def test_scattered_films_have_the_nominal_one_that_solve_has(specimen: Specimen) -> None:
    mass = None if specimen.plate is None else 20e-3
    case = ToleranceCase(specimen, mass=mass, voltage=2e3, rig=Rig(gas_pressure=150.0), films=100)
    result = tolerance(case, Settings())
    rest = Case(specimen, mass=mass or 0.0, rig=case.rig)
    flat, found = (solve(replace(rest, voltage=voltage), Settings()) for voltage in (0.0, 2e3))
    first = first_limit(rest, Settings())
    assert first is not None
    spreads = result.quantities
    # Families of tolerances are made to 5e-4.
    assert spreads["deflection_m"].nominal == pytest.approx(found.deflection_m, rel=5e-4)
    assert spreads["stroke_m"].nominal == pytest.approx(
        found.deflection_m - flat.deflection_m, rel=1e-3)
    assert spreads["capacitance_F"].nominal == pytest.approx(found.capacitance_F, rel=1e-5)
    assert spreads["limit_V"].nominal == pytest.approx(first.voltage_V, rel=3e-3)
    assert ("frequency_Hz" in spreads) is ("blocked_force_N" in spreads) is (mass is not None)


def test_what_does_not_move_has_no_tolerances() -> None:
    with pytest.raises(InputError, match="without gas a film without plate stays flat") as caught:
        tolerance(ToleranceCase(disc(None), voltage=2e3), Settings())
    assert caught.value.key == "rig.gas_pressure"
    with pytest.raises(InputError, match="must be 0: the film has no plate"):
        tolerance(ToleranceCase(disc(None), mass=1e-3, voltage=2e3,
                                rig=Rig(gas_pressure=150.0)), Settings())
