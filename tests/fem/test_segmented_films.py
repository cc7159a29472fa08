"""Films whose segments have voltages of their own: energies, symmetry, and one electrode's limit.

The independent code for them is `benchmarks/peers/ngsolve_quarter.py`; here are what needs none.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from tests.support.models import model
from tests.support.specimens import circular, elliptical, quarters
from tympan.fem.complex_step import STEP
from tympan.fem.derivatives.quantities import FUNCTIONALS
from tympan.fem.derivatives.sensitivity import gradient_many, parameters
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import State
from tympan.fem.vibration.harmonic import Harmonic
from tympan.geometry.specimen import Electrode, Segment, Specimen

WEIGHT, VOLTAGE = 17.9e-3 * 9.80665, 3.5e3
SHARES = (1.0, 0.3, 0.0, 0.7)


def solved(specimen: Specimen, *, symmetry: bool = True) -> tuple[Model, State]:
    """The film at rest under the weight and the voltage."""
    made = model(specimen, symmetry=symmetry)
    outcome = equilibrium(made, WEIGHT, VOLTAGE)
    assert outcome.status == "equilibrium"
    return made, outcome.state


def test_equal_voltages_are_one_electrode() -> None:
    one, other = circular(), quarters()
    whole, of_one = solved(one)
    # The mesh of the segments without mirrors, and the same mesh under one electrode.
    parts, of_parts = solved(other, symmetry=False)
    same = replace(parts, specimen=one)
    of_same = equilibrium(same, WEIGHT, VOLTAGE).state
    for film, state, close in ((same, of_same, 1e-12), (whole, of_one, 1e-9)):
        assert of_parts.plate.deflection == pytest.approx(state.plate.deflection, rel=close)
        assert parts.capacitance(of_parts) == pytest.approx(film.capacitance(state), rel=close)
        assert parts.reaction(of_parts) == pytest.approx(film.reaction(state), rel=close)
    assert abs(of_parts.plate.slope).max() < 1e-9


def test_the_energy_has_the_forces_and_charges_as_derivatives() -> None:
    """∂E/∂x by complex steps in a drawn direction, and −2 ∂E/∂(U²) as capacitance."""
    made, state = solved(quarters(1e-3, SHARES))
    drawn = np.random.default_rng(3).normal(size=state.positions.shape) * 1e-3
    energy = made.energy(state.positions + 1j * STEP * drawn, state.voltage_squared)
    forces = made.forces(state.positions, state.voltage_squared)
    assert energy.imag / STEP == pytest.approx((forces * drawn).sum(), rel=1e-10)
    charged = made.energy(state.positions, state.voltage_squared + 1j * STEP)
    assert -2 * charged.imag / STEP == pytest.approx(made.capacitance(state), rel=1e-10)


def test_shares_are_squared_in_the_energy() -> None:
    """The film's capacitance is Σ share² C_i of the segments' own ones, at any shares."""
    made, state = solved(quarters(1e-3, SHARES))
    own = [replace(made, specimen=quarters(1e-3, tuple(float(place == number)
                                                       for place in range(4)))).capacitance(state)
           for number in range(4)]
    assert made.capacitance(state) == pytest.approx(np.dot(np.square(SHARES), own), rel=1e-12)


def test_answers_turn_with_the_voltages() -> None:
    """A quarter turn of the voltages turns slopes and shifts of the plate, and nothing else."""
    _, first = solved(quarters(1e-3, SHARES))
    _, turned = solved(quarters(1e-3, SHARES[-1:] + SHARES[:-1]))
    assert turned.plate.deflection == pytest.approx(first.plate.deflection, rel=1e-6)
    (x, y), (along, across) = first.plate.slope, turned.plate.slope
    assert np.hypot(x, y) > 1e-3
    assert [along, across] == pytest.approx([-y, x], abs=1e-4 * np.hypot(x, y))
    (x, y), (along, across) = first.plate.translation[:2], turned.plate.translation[:2]
    assert [along, across] == pytest.approx([-y, x], abs=1e-4 * np.hypot(x, y))


def test_opposite_quarters_turn_the_plate_the_other_way() -> None:
    (_, one), (_, other) = (solved(quarters(1e-3, shares))
                            for shares in ((1.0, 0, 0, 0), (0, 0, 1.0, 0)))
    assert one.plate.slope == pytest.approx(-other.plate.slope, rel=1e-4)
    # The charged quarter gives way: the plate moves off it, and its side there goes down.
    assert (one.plate.slope > 1e-3).all()
    assert (one.plate.translation[:2] < -1e-4).all()


def test_mirrored_halves_are_the_whole() -> None:
    shares = (1.0, 0.0, 0.0, 1.0)
    (half, mirrored), (whole, full) = (solved(quarters(1e-3, shares, specimen=elliptical(60e-3)),
                                              symmetry=symmetry) for symmetry in (True, False))
    assert half.discretisation.planes == {"y"}
    assert mirrored.plate.slope == pytest.approx(full.plate.slope, rel=1e-5, abs=1e-8)
    assert half.capacitance(mirrored) == pytest.approx(whole.capacitance(full), rel=1e-6)


def test_a_grounded_band_is_a_margin() -> None:
    """Rings at 0 V along frame and plate against an electrode with uncovered bands there."""
    rings = tuple(Segment(name=name, band=band, share=share) for name, band, share in (
        ("rim", (0.0, 8e-3), 0.0), ("middle", (8e-3, 30e-3), 1.0), ("inner", (30e-3, inf), 0.0)))
    bands, margins = (solved(replace(circular(), electrode=electrode)) for electrode in (
        Electrode(segments=rings), Electrode(margin_frame=8e-3, margin_plate=5e-3)))
    assert bands[0].discretisation.planes == {"x", "y"}
    whole = solved(circular())[1].plate.deflection
    deflection, other = (state.plate.deflection for _, state in (bands, margins))
    assert whole - other > 20e-6
    assert deflection == pytest.approx(other, rel=1e-6)
    assert bands[0].capacitance(bands[1]) == pytest.approx(margins[0].capacitance(margins[1]),
                                                           rel=1e-6)


@pytest.mark.parametrize("swing", [None, (1.0, -0.5, 0.0, 0.25)])
def test_a_slow_sine_moves_the_plate_as_small_steps_do(swing: tuple[float, ...] | None) -> None:
    """All segments in their proportion, and each by its own share of the sine."""
    made, step = model(quarters(1e-3, SHARES), symmetry=False), 5.0
    outcome = equilibrium(made, WEIGHT, VOLTAGE)
    motion = Harmonic(made, outcome.state, RigidPlate(17.9e-3), swing=swing).response(
        np.array([1e-4]))
    plates = []
    for sign in (1, -1):
        voltages = VOLTAGE * np.array(SHARES) + sign * step * np.array(swing or SHARES)
        film = replace(made, specimen=quarters(1e-3, tuple(voltages / voltages.max())))
        plates.append(equilibrium(film, WEIGHT, float(voltages.max())).state.plate)
    high, low = plates
    assert motion.deflection[0] == pytest.approx((high.deflection - low.deflection) / (2 * step),
                                                 rel=1e-4)
    assert motion.slopes[0] == pytest.approx((high.slope - low.slope) / (2 * step), rel=1e-4)


def test_derivatives_by_shares_are_those_of_differences() -> None:
    labels = {name: FUNCTIONALS[name] for name in ("heave", "tilt_x", "tilt_y", "shift_x",
                                                   "capacitance")}
    shares, step = (0.9, 0.3, 0.1, 0.7), 1e-3
    made = model(quarters(1e-3, shares), symmetry=False)
    outcome = equilibrium(made, WEIGHT, VOLTAGE)
    path = "electrode.segments.1.share"
    slopes = gradient_many(made, outcome, labels, {path: parameters(made)[path]})
    values = []
    for moved in (0.3 + step, 0.3 - step):
        film = replace(made, specimen=quarters(1e-3, (0.9, moved, 0.1, 0.7)))
        state = equilibrium(film, WEIGHT, VOLTAGE).state
        values.append({name: each.value(film, state) for name, each in labels.items()})
    for name in labels:
        assert slopes[name][path] == pytest.approx(
            (values[0][name] - values[1][name]) / (2 * step), rel=1e-4), name
