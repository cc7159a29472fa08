"""What is computed for several states at once is what each of them gives alone."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from tests.support.models import model
from tests.support.specimens import NEO_HOOKE, circular, elliptical
from tympan.fem.equilibrium.solve import held
from tympan.fem.film.laws import Ogden
from tympan.fem.film.tension_field import Tension
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import (
    Fields,
    cell_fields,
    lost_tension,
)
from tympan.geometry.mesh import ELEMENTS
from tympan.geometry.specimen import Electrode
from tympan.studies.case import Case, Settings, build_model, equilibrate, solve, summaries


@pytest.fixture(scope="module", params=["taut", "margins and grease", "wrinkled"])
def several(request) -> tuple[Model, list[State]]:
    """States of different heaves and voltages."""
    specimen = elliptical(60e-3, NEO_HOOKE)
    if request.param == "margins and grease":
        specimen = replace(specimen, electrode=Electrode(2e-3, 3e-3, 2e3))
    made = model(specimen, refine=0.7)
    states = [held(made, heave, voltage).state for heave, voltage in ((1e-3, 0.0), (5e-3, 2e3),
                                                                      (8e-3, 4e3))]
    if request.param == "wrinkled":
        flat = [replace(state, positions=state.positions * np.array([1.0, 0.1 + 0.05 * share, 1.0]))
                for share, state in enumerate(states)]
        states = [*flat, *states]
    return made, states


def test_totals_are_those_of_the_forces_and_the_energy(several) -> None:
    made, states = several
    sums = zip(*made.integrals(states), strict=True)
    for state, (reaction, capacitance, energy) in zip(states, sums, strict=True):
        assert reaction == pytest.approx(made.reaction(state), rel=1e-11)
        assert capacitance == pytest.approx(made.capacitance(state), rel=1e-12)
        part = float(made.energy(state.positions, state.voltage_squared))
        assert energy == pytest.approx(part * made.discretisation.mirrored, rel=1e-12)


def test_fields_and_lost_tension_are_those_of_each_state(several) -> None:
    made, states = several
    points = ELEMENTS[made.discretisation.mesh.order].doflocs.T
    for state, together in zip(states, cell_fields(made, states, points), strict=True):
        [alone] = cell_fields(made, [state], points)
        for item in fields(Fields):
            value, expected = getattr(together, item.name), getattr(alone, item.name)
            # A stress that all but vanishes is as exact as the one it is a part of.
            size = alone.stress_1 if item.name.startswith("stress_") else expected
            scale = np.abs(size[np.isfinite(size)]).max(initial=0.0)
            np.testing.assert_allclose(value, expected, rtol=1e-12, atol=1e-13 * scale)
    for state, together in zip(states, lost_tension(made, states), strict=True):
        assert [together] == lost_tension(made, [state])


def test_lost_tension_is_what_the_fields_say(several) -> None:
    """On equal triangles of the mounted film, from the full fields at their middles."""
    made, states = several
    x, y = np.array([((3 * i + t) / 12, (3 * j + t) / 12) for t in (1, 2)
                     for i in range(4) for j in range(5 - t - i)]).T
    for state, loss in zip(states, lost_tension(made, states, parts=4), strict=True):
        tension = cell_fields(made, [state], np.array([x, y]))[0].tension
        counted = np.mean(tension != Tension.TAUT)
        assert (loss.share > 0) == (counted > 0) == (state in states[:-3])
        assert (loss.share == pytest.approx(1)) == (counted == 1)


def test_cases_summarised_together_are_those_solved_alone_also_past_pull_in() -> None:
    specimen = circular(Ogden((15e3,), (2.0,)))
    cases = [Case(specimen, mass=17.9e-3, voltage=voltage) for voltage in (0.0, 4e3, 7e3, 8e3)]
    made = build_model(specimen, Settings())
    solved = [(case, equilibrate(case, Settings())[1]) for case in cases]
    together = [result for result, _ in summaries(made, solved)]
    assert [result.status for result in together] == ["equilibrium"] * 2 + ["no_equilibrium"] * 2
    for result, case in zip(together, cases, strict=True):
        alone = replace(solve(case, Settings()), wall_s=0.0).json()
        numbers = {name: value for name, value in alone.items() if isinstance(value, float)}
        # Sums of several states at once round differently.
        assert {name: result.json()[name] for name in numbers} == pytest.approx(numbers, rel=1e-12)
        assert result.json() | numbers == alone
