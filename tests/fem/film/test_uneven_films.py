"""Films that are thicker on one side: closed forms, and forces as derivatives of the energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import epsilon_0

from tests.oracles.uneven import solve_uneven
from tests.support.models import deformed, model
from tests.support.specimens import NEO_HOOKE, circular, reference_film
from tympan.base.errors import InputError
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.loading import Loading
from tympan.geometry.specimen import Electrode, Patch, Specimen

UNEVEN = (0.3, -0.1)
INNER, OUTER = 10e-3, 45e-3


def test_capacitance_and_volume_are_those_of_a_wedge() -> None:
    """C = ε ∫ dA/t with t = t₀ (1 + g x/b): 2π ε/t₀ ∫ r dr/√(1 − g² r²/b²), in closed form."""
    film = model(circular(thickness_gradient=UNEVEN), refine=1.5)
    share = np.hypot(*UNEVEN) / OUTER
    mounted = film.specimen.membrane.thickness / film.specimen.membrane.area_prestretch
    inner, outer = (-np.sqrt(1 - (share * radius) ** 2) for radius in (INNER, OUTER))
    exact = 2 * np.pi * 4.7 * epsilon_0 / mounted / share**2 * (outer - inner)
    assert film.capacitance(film.mounted()) == pytest.approx(exact, rel=1e-6)
    volume = np.pi * (OUTER**2 - INNER**2) * mounted
    assert film.volumes.sum() == pytest.approx(volume, rel=1e-6)


@pytest.mark.parametrize("specimen", [
    circular(thickness_gradient=UNEVEN, density=960.0),
    replace(circular(), electrode=Electrode(patches=(Patch((27e-3, 5e-3), 12e-3),)))],
    ids=["wedge", "spot"])
def test_forces_are_derivatives_of_the_energy(specimen: Specimen) -> None:
    film = model(specimen, refine=0.5)
    positions, _ = deformed(film)
    squared, step = 4e6, 1e-8
    direction = np.random.default_rng(0).standard_normal(positions.shape)
    ends = [film.energy(positions + sign * step * direction, squared) for sign in (1, -1)]
    assert np.sum(film.forces(positions, squared) * direction) == pytest.approx(
        (ends[0] - ends[1]) / (2 * step), rel=1e-6)


def test_weight_acts_where_the_film_is_thick() -> None:
    """Its moment is g ρ t₀ ∫ x (1 + g x/b) dA = g ρ t₀ (g/b) π (b⁴ − a⁴)/4."""
    film = replace(model(circular(thickness_gradient=(0.3, 0.0), density=960.0), refine=1.5),
                   loading=Loading(gravity=9.80665))
    mounted = film.specimen.membrane.thickness / film.specimen.membrane.area_prestretch
    moment = 9.80665 * 960.0 * mounted * 0.3 / OUTER * np.pi * (OUTER**4 - INNER**4) / 4
    weight = film.discretisation.mirrored * film.weight[:, 2]
    assert weight @ film.discretisation.reference[:, 0] == pytest.approx(moment, rel=1e-5)


def test_the_same_film_seen_from_the_other_side() -> None:
    """Heave and capacitance stay, places and tilts are mirrored."""
    outcomes = []
    for share in (0.2, -0.2):
        film = model(circular(thickness_gradient=(share, 0.0)))
        state = equilibrium(film, 0.2, 3e3).state
        outcomes.append([state.plate.deflection, state.plate.rotation[0, 2],
                         *(float(part[0]) for part in film.integrals([state])[1:])])
    first, second = np.array(outcomes)
    assert first[[0, 2, 3]] == pytest.approx(second[[0, 2, 3]], rel=1e-6)
    assert first[1] == pytest.approx(-second[1], rel=1e-4)
    assert abs(first[1]) > 1e-4


@pytest.mark.parametrize(("material", "force", "voltage"), [
    (NEO_HOOKE, 0.175, 0.0), (NEO_HOOKE, 0.175, 5.5e3), (Ogden((30e3, 2e3), (1.3, 5.5)), 1.0, 3e3)])
@pytest.mark.parametrize(("share", "arm"), [(1e-3, 0.0), (0.0, 1e-5)])
def test_shift_tilt_and_shape_are_those_of_the_perturbed_equations(
        material: Ogden, force: float, voltage: float, share: float, arm: float) -> None:
    """First order in the gradient, or in the arm of the weight, about the axisymmetric state."""
    even = model(circular(material), symmetry=False)
    film = replace(even, specimen=circular(material, thickness_gradient=(share, 0.0)),
                   loading=Loading(arm=(arm, 0.0)))
    state, before = (equilibrium(each, force, voltage).state for each in (film, even))
    exact = solve_uneven(reference_film(material), force, voltage, share, arm)
    # Slopes of 1e-5 to 3e-4 are found to some 1e-9, as far as Newton's method goes.
    assert -state.plate.rotation[0, 2] == pytest.approx(exact.slope, rel=3e-4)
    assert state.plate.translation[0] == pytest.approx(exact.shift, rel=1e-4)
    x, y, _ = even.discretisation.reference.T
    middle = np.abs(np.hypot(x, y) - 25e-3) < 10e-3
    added = np.stack(exact.added(x[middle], y[middle]), axis=1)
    assert (state.positions - before.positions)[middle] == pytest.approx(
        added, abs=2e-3 * np.abs(added).max())


def test_a_film_must_be_left_and_symmetry_is_lost() -> None:
    with pytest.raises(InputError, match="must leave some film everywhere"):
        circular(thickness_gradient=(0.6, 0.5))
    uneven = circular(thickness_gradient=(0.1, 0.0))
    assert uneven.mirror_planes == {"y"}
    assert not uneven.axisymmetric
    assert isinstance(uneven, Specimen)
    assert replace(uneven, membrane=circular().membrane).mirror_planes == {"x", "y"}
