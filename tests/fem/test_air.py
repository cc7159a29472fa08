"""The air that swings with plate and film: mass of heaves, inertia of tilts, none of slides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles import annulus_modes
from tests.support.models import model
from tests.support.specimens import circular, elliptical
from tympan.fem.rig import Rig
from tympan.fem.vibration.air import _within
from tympan.fem.vibration.heave import following
from tympan.geometry.outlines import Circle, Outline, Polygon, RoundedRectangle, area, area_moments
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies.case import Case, Settings
from tympan.studies.modes import heave_frequency, modes

INNER, OUTER, MASS, AIR = 10e-3, 45e-3, 0.1e-3, 1.2


def frequencies(specimen: Specimen, air: float, mass: float = MASS, **rig: object
                ) -> dict[str, float]:
    result = modes(Case(specimen, mass=mass, rig=Rig(air=air, **rig)), Settings(), 6)
    assert result.plate_mass_kg == mass
    return {mode.name: mode.frequency_Hz for mode in result.modes}


def test_a_heave_has_mass_a_tilt_inertia_and_a_slide_neither() -> None:
    """Of a light plate on a massless film: (f₀/f)² − 1 is the air's share of the plate's own."""
    still, airy = (frequencies(circular(), air) for air in (0.0, AIR))
    share = {name: (still[name] / airy[name]) ** 2 - 1 for name in still}
    assert share["heave"] == pytest.approx(
        AIR * annulus_modes.air_volume(INNER, OUTER) / MASS, rel=2e-4)
    for axis in "xy":
        assert share[f"tilt about {axis}"] == pytest.approx(
            AIR * annulus_modes.air_inertia(INNER, OUTER) / (MASS * INNER**2 / 4), rel=1e-3)
        assert abs(share[f"slide along {axis}"]) < 1e-8
    assert abs(share["twist"]) < 1e-8


def test_a_guided_plate_that_only_heaves_has_the_same_air() -> None:
    free, guided = (frequencies(circular(), AIR, guide=guide)["heave"]
                    for guide in ("free", "vertical"))
    assert guided == pytest.approx(free, rel=1e-6)
    assert heave_frequency(Case(circular(), mass=MASS, rig=Rig(air=AIR)), Settings()) == (
        pytest.approx(free, rel=1e-9))


def test_air_of_a_film_with_mass_goes_with_film_and_plate() -> None:
    """A heavier film follows its plate as condensed on the heave: the air makes 0.46 % of it."""
    heavy = circular(density=100.0)
    film = following(model(heavy), model(heavy).mounted())
    rates = {}
    for air in (0.0, AIR):
        rates[air] = frequencies(heavy, air, 17.9e-3)["heave"] ** -2
    swings = [float(film.mass(17.9e-3, 100.0 * 1e-3 / 5, 0.0, air)) for air in (0.0, AIR)]
    assert rates[AIR] / rates[0.0] - 1 == pytest.approx(swings[1] / swings[0] - 1, rel=5e-3)


def test_half_a_mesh_has_the_air_of_the_whole() -> None:
    aside = replace(elliptical(60e-3), plate=Plate(Circle(8e-3), (6e-3, 0.0)))
    airs = [following(made, made.mounted()).air
            for made in (model(aside, symmetry=symmetry) for symmetry in (True, False))]
    assert airs[0] == pytest.approx(airs[1], rel=1e-6)


@pytest.mark.parametrize("outline", [
    Circle(8e-3), RoundedRectangle((20e-3, 4e-3), 1e-3),
    Polygon(((-3e-2, -3e-2), (3e-2, -3e-2), (0.0, -1e-2), (3e-2, 3e-2), (-3e-2, 3e-2)))])
def test_rays_fill_a_plate_of_any_outline(outline: Outline) -> None:
    """A notched one, too, whose edge turns back as seen from the centre."""
    places, areas = _within(outline)
    assert areas.sum() == pytest.approx(area(outline), rel=1e-7)
    _, centroid, second = area_moments(outline)
    assert areas @ places == pytest.approx(areas.sum() * np.asarray(centroid), abs=1e-7 * 3e-2**3)
    about = places - centroid
    # The reference is a polygon of 4096 points.
    assert (about.T * areas) @ about == pytest.approx(np.asarray(second), rel=1e-5, abs=1e-15)
