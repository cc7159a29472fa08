"""Mechanisms between plate and ground do what independent equations say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize

from tests.support.biases import SAMPLES
from tests.support.specimens import circular
from tympan.fem.membrane.biases import (
    BIASES,
    Bistable,
    BuckledBeam,
    Constant,
    ForceTable,
    Spring,
)
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Case, Settings, solve

BEAM = BuckledBeam(length=30e-3, width=4e-3, thickness=0.1e-3, modulus=1.5e9, compression=0.4e-3)
COARSE = Settings(MeshSettings(order=2).refined(0.5))


def test_every_mechanism_has_a_sample() -> None:
    assert {*SAMPLES} == {*BIASES}


def by_least_energy(beam: BuckledBeam, moved: float) -> float:
    """Force [N] on the middle of the beam whose halves take any shape, of least energy.

    Each half, clamped at 0 and level at 1 where it has moved, is a cubic and twelve polynomials
    that vanish with their slopes at both ends. Slopes are small, the axial force is uniform.
    """
    half = beam.length / 2
    bend = beam.modulus * beam.width * beam.thickness**3 / 12 / half**3
    stretch = beam.modulus * beam.width * beam.thickness / half
    place, weight = (part / 2 for part in np.polynomial.legendre.leggauss(40))
    place = place + 0.5
    bubbles = [np.polynomial.Polynomial([0, 0, 1, -2, 1])
               * np.polynomial.Legendre.basis(k, [0, 1]).convert(
                   kind=np.polynomial.Polynomial, domain=[-1, 1]) for k in range(12)]
    shapes = [np.polynomial.Polynomial([0, 0, 3, -2]), *bubbles]
    slope, curve = (np.stack([shape.deriv(order)(place) for shape in shapes]) for order in (1, 2))
    turning, bending = ((part * weight) @ part.T for part in (slope, curve))

    def energy(inner: np.ndarray) -> tuple[float, np.ndarray]:
        q = np.r_[moved, inner]
        pressed = beam.compression / 2 - q @ turning @ q / (2 * half)
        by_q = bend * bending @ q - stretch * pressed * (turning @ q) / half
        return float(bend * q @ bending @ q / 2 + stretch * pressed**2 / 2), by_q

    scale = max(abs(moved), 1e-3)
    best = min((minimize(lambda a: (energy(scale * a)[0] * 1e6, scale * energy(scale * a)[1][1:]
                                    * 1e6), start, jac=True, method="BFGS",
                         options={"gtol": 1e-9, "maxiter": 4000})
                for start in (np.zeros(12), np.eye(12)[0], np.eye(12)[1])), key=lambda one: one.fun)
    return 2 * float(energy(scale * best.x)[1][0])


@pytest.mark.parametrize("moved", [0.3e-3, 1.9e-3, 2.02e-3, 2.2e-3, 2.35e-3, 3e-3])
def test_buckled_beams_push_as_those_of_least_energy(moved: float) -> None:
    """Where halves buckle by themselves, near the rest position, and where the beam is taut."""
    assert BEAM.derivatives(moved)[1] == pytest.approx(by_least_energy(BEAM, moved), rel=1e-4,
                                                       abs=1e-6)


def test_a_beam_without_compression_is_the_tabulated_one() -> None:
    """192 EI/L³ for small movements; at rest where Euler's beam has buckled to."""
    straight = replace(BEAM, compression=0.0)
    bend = BEAM.modulus * BEAM.width * BEAM.thickness**3 / 12
    assert straight.derivatives(0.0)[2] == pytest.approx(192 * bend / BEAM.length**3, rel=1e-12)
    short = np.pi**2 * BEAM.thickness**2 / (3 * BEAM.length)  # at Euler's load
    rest = 2 / np.pi * (BEAM.length * (BEAM.compression - short)) ** 0.5
    assert BEAM.derivatives(rest)[1] == pytest.approx(0.0, abs=1e-12)
    assert BEAM.derivatives(rest)[2] > 0
    assert BEAM.derivatives(0.0)[2] < 0
    six = replace(BEAM, number=6, middle=1e-3)
    assert six.derivatives(1e-3 + rest / 2)[1] == pytest.approx(6 * BEAM.derivatives(rest / 2)[1])


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_energy_is_the_work(name: str) -> None:
    bias = SAMPLES[name]
    for begin, end in ((-2e-3, 1e-3), (1e-3, 8e-3)):
        work, _ = quad(lambda w: bias.derivatives(w)[1], begin, end, limit=400, epsrel=1e-11,
                       points=[0.0, 3e-3, 5e-3])
        stored = bias.derivatives(end)[0] - bias.derivatives(begin)[0]
        assert stored == pytest.approx(work, rel=1e-7)


@pytest.mark.parametrize("back", [0.0, 0.08, 0.03, 0.4])
def test_a_bistable_mechanism_is_that_of_its_data_sheet(back: float) -> None:
    """Its forces and rest positions, by values at 100,000 places."""
    bistable = Bistable(0.08, 6e-3, back, 1e-3)
    places = np.linspace(1e-3, 7e-3, 100_001)
    push = np.array([bistable.derivatives(place)[1] for place in places])
    assert push[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-15)
    assert (push.max(), -push.min()) == pytest.approx((0.08, back or 0.08), rel=1e-8)
    assert min(bistable.derivatives(rest)[2] for rest in (1e-3, 7e-3)) > 0


def test_a_preload_is_a_rest_position_said_otherwise() -> None:
    preloaded, resting = Spring(7.0, preload=0.014), Spring(7.0, rest=2e-3)
    for deflection in (-1e-3, 0.0, 3e-3):
        assert preloaded.derivatives(deflection)[1:] == pytest.approx(
            resting.derivatives(deflection)[1:])
    with pytest.raises(InputError, match="both say where"):
        Spring(7.0, 1e-3, 0.01)


def test_a_table_made_from_a_law_gives_the_law_s_results() -> None:
    """And ends where it ends."""
    places = np.linspace(0, 6e-3, 601)
    law = Bistable(0.02, 4e-3, rest=0.5e-3)
    table = ForceTable(tuple(places.tolist()),
                       tuple(law.derivatives(place)[1] for place in places.tolist()))
    case = Case(circular(), mass=17.9e-3, voltage=3e3)
    by_law, by_table = (solve(replace(case, rig=Rig(biases=(bias,))), COARSE).deflection_m
                        for bias in (law, table))
    assert by_table == pytest.approx(by_law, rel=1e-6)
    assert np.isnan(table.derivatives(6.001e-3)).all()
    assert np.isnan(table.derivatives(-1e-9)).all()


def test_a_constant_force_is_a_weight() -> None:
    pulled = Case(circular(), mass=10e-3, rig=Rig(biases=(Constant(7.9e-3 * 9.80665),)))
    assert solve(pulled, COARSE).deflection_m == pytest.approx(
        solve(Case(circular(), mass=17.9e-3), COARSE).deflection_m, rel=1e-10)


@pytest.mark.parametrize(("made", "key"), [
    (lambda: ForceTable((0.0, 1e-3, 1e-3), (0.0, 1.0, 2.0)), "displacement"),
    (lambda: ForceTable((0.0, 1e-3), (0.0, 1.0, 2.0)), "force"),
    (lambda: replace(BEAM, compression=2e-3), "compression"),
    (lambda: replace(BEAM, number=0), "number")])
def test_mechanisms_that_cannot_be_are_refused(made, key: str) -> None:
    with pytest.raises(InputError) as refused:
        made()
    assert refused.value.key == key
