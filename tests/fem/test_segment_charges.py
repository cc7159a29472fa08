"""Numbers of an electrode's segments: their capacitances, alone and where film and plate follow."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from tests.support.models import model
from tests.support.segmented import DRIVES, driven_quarters
from tympan.fem.complex_step import STEP
from tympan.fem.derivatives.charges import charges_by_voltages
from tympan.fem.derivatives.quantities import named_functional
from tympan.fem.derivatives.sensitivity import gradient
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.model import Model
from tympan.fem.results.fields import node_fields, whole
from tympan.fem.results.segments import largest_in_segments, segment_capacitances

#: Force on the plate [N].
FORCE = 0.2


def solved(voltages: dict[str, float], force: float = FORCE, **settings: bool
           ) -> tuple[Model, Outcome]:
    film = model(driven_quarters(voltages, gap=1e-3), refine=0.6, **settings)
    outcome = equilibrium(film, force, max(voltages.values()))
    assert outcome.status == "equilibrium"
    return film, outcome


@pytest.fixture(scope="module", params=DRIVES, ids=lambda drive: "-".join(drive))
def driven(request) -> tuple[Model, Outcome]:
    return solved(request.param)


def test_capacitances_times_squares_of_shares_are_that_of_the_film(driven) -> None:
    film, outcome = driven
    shares = [segment.share for segment in film.specimen.electrode.segments]
    alone, = segment_capacitances(film, [outcome.state])
    assert alone @ np.square(shares) == pytest.approx(film.capacitance(outcome.state), rel=1e-12)


def test_capacitance_of_a_segment_is_the_energy_by_its_own_voltage(driven) -> None:
    film, outcome = driven
    full, state = whole(film, outcome.state)
    alone, = segment_capacitances(film, [outcome.state])
    segments = full.specimen.electrode.segments
    for number, segment in enumerate(segments):
        # A share s + i h/(2 s) has the square s² + i h; one of 0 needs a voltage of its own.
        share = segment.share or 0.5
        stepped = [*segments]
        stepped[number] = replace(segment, share=share + 1j * STEP / (2 * share))
        electrode = replace(full.specimen.electrode, segments=tuple(stepped))
        changed = replace(full, specimen=replace(full.specimen, electrode=electrode))
        energy = changed.energy(state.positions, state.voltage_squared)
        slope = energy.imag / STEP / state.voltage_squared
        assert -2 * slope == pytest.approx(alone[number], rel=1e-11)


def test_segments_of_a_mirrored_part_are_those_of_the_whole(driven) -> None:
    film, outcome = driven
    full, state = whole(film, outcome.state)
    assert segment_capacitances(full, [state]) == pytest.approx(
        segment_capacitances(film, [outcome.state]), rel=1e-12)
    fields, whole_fields = (node_fields(each, [there])[0].electric_field
                            for each, there in ((film, outcome.state), (full, state)))
    assert largest_in_segments(full, whole_fields) == pytest.approx(
        largest_in_segments(film, fields), rel=1e-12)


def test_each_image_of_a_part_has_the_segment_at_its_place() -> None:
    specimen = driven_quarters(gap=1e-3)
    part = model(specimen).discretisation
    assert len(part.planes) == 2
    assert [set(image[part.covered[:, 0] > 0]) for image in part.images] == [{0}, {1}, {3}, {2}]
    full = model(specimen, symmetry=False).discretisation
    x, y, _ = full.reference[full.connectivity].mean(axis=1).T
    covered = full.covered[:, 0] > 0
    expected = specimen.electrode.segment_at(x, y, specimen.frame)
    assert (full.segments[covered] == expected[covered]).all()
    assert (expected[~covered] == -1).all()


def test_derivatives_by_shares_are_the_same_by_symmetry_or_without() -> None:
    names = [f"electrode.segments.{number}.share" for number in range(4)]
    for quantity in ("heave", "capacitance"):
        found = []
        for symmetry in (True, False):
            film, outcome = solved(DRIVES[1], symmetry=symmetry)
            found.append(gradient(film, outcome, named_functional(quantity), names))
        assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_charges_by_voltages_are_symmetric_and_positive(driven) -> None:
    film, outcome = driven
    matrix = charges_by_voltages(film, outcome.solution)
    assert matrix == pytest.approx(matrix.T, rel=1e-12)
    assert np.linalg.eigvalsh(matrix).min() > 0
    # What follows can only take up more charge than what is held.
    held = np.diag(segment_capacitances(film, [outcome.state])[0])
    assert np.linalg.eigvalsh(matrix - held).min() > -1e-9 * held.max()


@pytest.mark.parametrize("force", [FORCE, 0.0])
def test_charges_by_voltages_are_differences_of_equilibria(force: float) -> None:
    drive = DRIVES[3]
    film, outcome = solved(drive, force)
    matrix = charges_by_voltages(film, outcome.solution)
    for number, name in enumerate(drive):
        charges = []
        for step in (2.0, -2.0):
            other = drive | {name: drive[name] + step}
            changed, there = solved(other, force)
            charges.append(segment_capacitances(changed, [there.state])[0] * [*other.values()])
        slope = (charges[0] - charges[1]) / 4
        assert matrix[:, number] == pytest.approx(slope, rel=2e-5, abs=2e-6 * matrix.max())


def test_equal_quarters_under_one_voltage_have_the_matrix_of_their_symmetry() -> None:
    film, outcome = solved(DRIVES[0])
    matrix = charges_by_voltages(film, outcome.solution)
    beside = [matrix[i, j] for i, j in combinations(range(4), 2) if (j - i) % 2]
    opposite = [matrix[0, 2], matrix[1, 3]]
    for equal in (np.diag(matrix), beside, opposite):
        assert np.ptp(equal) < 3e-5 * matrix.max()  # of the mesh, which has no such symmetry
