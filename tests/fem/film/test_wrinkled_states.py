"""Wrinkled films: a turned hub, a bent strip and a charged annulus against relaxed equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.oracles.axisymmetric import Film, energy_derivatives, shoot_deflection
from tests.oracles.bending import Strip
from tests.oracles.laws import SAMPLES
from tests.oracles.torsion import turned_hub
from tests.support.models import model
from tests.support.specimens import circular
from tests.support.strip import BentStrip
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.state import PlateMotion
from tympan.fem.results.fields import lost_tension

MU, PRESTRETCH = 25e3, 1.05


def torque(refine: float, angle: float) -> tuple[float, float]:
    """On a plate turned in its film, by finite elements, and the share that is wrinkled."""
    specimen = circular(NeoHooke(MU), prestretch=(PRESTRETCH, PRESTRETCH))
    film = replace(model(specimen, refine=refine, symmetry=False), loading=Loading(guide="fixed"))
    state = film.mounted()
    for turn in np.linspace(0, angle, 7)[1:]:
        rotation = Rotation.from_rotvec([0, 0, turn]).as_matrix()
        solution = newton(film, replace(state, plate=PlateMotion(np.zeros(3), rotation)))
        state = solution.state
    assert solution.converged
    assert solution.wrinkling == 0
    plate = film.discretisation.plate_nodes
    moments = np.cross(state.positions[plate], film.nodal_forces(state)[plate])
    [loss] = lost_tension(film, [state])
    assert loss.slack == 0
    return float(moments[:, 2].sum()), loss.share


def test_a_turned_hub_s_torque_is_that_of_the_relaxed_equations() -> None:
    exact = turned_hub(MU, PRESTRETCH, 1e-3, 10e-3, 45e-3, 0.6)
    values = np.array([torque(refine, 0.6) for refine in (0.7, 1.0, 1.5)])
    assert values[:, 0] == pytest.approx(exact.torque, rel=1e-3)
    assert np.ptp(values[:, 0]) < 5e-4 * exact.torque
    assert values[:, 1] == pytest.approx(exact.wrinkled, abs=5e-3)


def test_a_turned_hub_s_film_wrinkles_where_mikulas_has_it() -> None:
    """At small strains the torque 2πa² times the prestress' resultant begins to wrinkle it."""
    stretch, steps = 1.005, (0.97, 1.03)
    resultant = MU * (stretch**2 - stretch**-4) * 1e-3 / stretch**2
    for share in steps:
        # Shear spreads as 1/r²: angle = torque/(4π μ h) (1/a² − 1/b²).
        turn = share * resultant * stretch**2 / (2 * MU * 1e-3) * (1 - (10 / 45) ** 2)
        assert (turned_hub(MU, stretch, 1e-3, 10e-3, 45e-3, turn).wrinkled > 0) == (share > 1)


@pytest.mark.study(seconds=5)
def test_a_charged_film_goes_on_wrinkled_as_the_relaxed_equations_say() -> None:
    """A film stretched little, a fifth of it wrinkled, and its end, on three meshes."""
    sample, force = SAMPLES["separable"], 50e-3 * 9.81
    reference = Film(10e-3, 45e-3, 1e-3, 1.4, sample.reference, 4.7, relaxed=True)
    heaves, ends, shares = [], [], []
    for refine in (0.7, 1.0, 1.4):
        film = model(circular(sample.law, prestretch=(1.4, 1.4)), refine=refine)
        outcome = equilibrium(film, force, 4717.0)
        assert outcome.status == "equilibrium"
        shares.append(lost_tension(film, [outcome.state], parts=24)[0].share)
        heaves.append(outcome.state.plate.deflection)
        ends.append(np.sqrt(equilibrium(film, force, 6e3, start=outcome.solution).limit))
    assert np.ptp(heaves) < 1e-4 * heaves[0]
    assert np.ptp(ends) < 2e-3 * ends[0]
    exact = shoot_deflection(reference, heaves[-1], 4717.0, 1e-5)
    assert exact.force == pytest.approx(force, rel=1e-3)
    rings = np.sqrt(np.linspace(reference.inner**2, reference.outer**2, 4001))
    hoop = energy_derivatives(replace(reference, relaxed=False), exact.lambda1(rings),
                              exact.lambda2(rings), 4717.0**2).d2
    assert shares == pytest.approx(3 * [np.mean(hoop < 0)], abs=3e-3)


def stein_and_hedgepeth(moment: float) -> tuple[float, float]:
    """Wrinkled share and curvature 2·3μhκ·width²/P of a strip from moment/(P width)."""
    share = max(3 * moment - 0.5, 0.0)
    return share, 12 * moment if not share else 2 / (1 - share) ** 2


@pytest.mark.parametrize("moment", [0.1, 0.25, 0.4])
def test_a_bent_strip_s_equations_are_those_published_at_small_strains(moment: float) -> None:
    strip = Strip(MU, 1.0001, 1e-3, 20e-3)
    force = strip.tension * strip.width
    share, curvature = stein_and_hedgepeth(moment)
    stiffness = 3 * MU * 1e-3 * strip.width**2 / strip.prestretch**2
    bent = strip.bent(curvature * force / stiffness, force)
    assert bent.moment / (force * strip.width) == pytest.approx(moment, rel=2e-4)
    assert bent.wrinkled == pytest.approx(share, abs=1e-3)


def test_a_bent_strip_wrinkles_as_the_relaxed_equations_say() -> None:
    """The moment of a strip a quarter of which is wrinkled, on three meshes."""
    strip = Strip(MU, PRESTRETCH, 1e-3, 20e-3)
    force = strip.tension * strip.width
    sections = [BentStrip(strip, cells).bent(16.6, force) for cells in (4, 6, 8)]
    for section in sections:
        exact = strip.bent(section.curvature, section.force)
        assert section.moment == pytest.approx(exact.moment, rel=2e-3)
        assert section.wrinkled == pytest.approx(exact.wrinkled, abs=5e-3)
    levers = np.array([section.moment / section.force for section in sections])
    assert np.ptp(levers) < 2e-4 * levers[-1]
