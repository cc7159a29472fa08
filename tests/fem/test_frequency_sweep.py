"""Solutions at many frequencies from a few, against one factorisation for each frequency."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csc_matrix, diags_array, identity
from scipy.sparse.linalg import spsolve

from tests.support.specimens import circular
from tympan.base.arrays import AnyArray
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.rig import Rig
from tympan.fem.vibration.frequency_sweep import FrequencySweep
from tympan.fem.vibration.harmonic import Harmonic
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import ViscousBranch
from tympan.studies.case import Case, Settings, equilibrate

COARSE = Settings(MeshSettings(order=3).refined(0.5))


def chain(links: int, *rights: int) -> FrequencySweep:
    """Masses in a row, each with a damper; unit forces on some of them."""
    stiffness = diags_array([-np.ones(links - 1), 2.0 * np.ones(links), -np.ones(links - 1)],
                            offsets=[-1, 0, 1]).tocsc()
    unit = np.zeros((links, len(rights)))
    unit[rights, range(len(rights))] = 1.0
    parts = [csc_matrix(stiffness), csc_matrix(identity(links)), csc_matrix(0.02 * stiffness)]
    return FrequencySweep(parts, lambda s: (1.0, s * s, s), unit)


def direct(sweep: FrequencySweep, s: complex) -> AnyArray:
    """What SciPy's own ordering and pivots give at s."""
    right = sweep.right
    found: AnyArray = spsolve(sweep.matrix(s), right.astype(complex))
    outputs: AnyArray = right.T @ found.reshape(right.shape)
    return outputs


def test_a_chain_with_all_its_resonances_swept_over() -> None:
    sweep = chain(25, 0, 17)
    points = 2j * np.pi * np.geomspace(1e-4, 1.0, 120)
    solved: list[int] = []
    found = sweep.outputs(points, solved.append)
    assert 5 < len(set(solved)) < 25
    expected = np.array([direct(sweep, s) for s in points])
    assert found == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert found[:, 0, 1] == pytest.approx(found[:, 1, 0], rel=1e-9)


def test_few_points_are_all_solved() -> None:
    sweep, solved = chain(12, 0), list[int]()
    points = 1j * np.array([0.1, 0.7])
    found = sweep.outputs(points, solved.append)
    assert solved == [0, 1]
    assert found[1] == pytest.approx(direct(sweep, points[1]), rel=1e-12)


@pytest.mark.parametrize("plated", [True, False])
def test_a_heavy_creeping_film_far_above_its_own_modes(plated: bool) -> None:
    plain = circular(NeoHooke(20e3))
    film = replace(plain.membrane, density=960.0,
                   branches=(ViscousBranch(200e3, 1e-2), ViscousBranch(1e6, 3e-4)))
    specimen = replace(plain, membrane=film) if plated else replace(plain, membrane=film,
                                                                   plate=None)
    rig = Rig() if plated else Rig(gas_pressure=100.0)
    case = Case(specimen, mass=5e-3 if plated else 0.0, voltage=4e3, rig=rig)
    model, outcome = equilibrate(case, COARSE)
    harmonic = Harmonic(model, outcome.state, RigidPlate(5e-3))
    frequencies, solved = np.geomspace(0.1, 2e3, 200), list[str]()
    heave = harmonic.response(frequencies, solved.append).deflection
    assert len(solved) < 100
    sweep = harmonic._sweep
    expected = np.array([direct(sweep, 2j * np.pi * each)[0, 1] for each in frequencies])
    expected = -2 * harmonic._voltage * expected
    assert heave == pytest.approx(expected, rel=1e-8)
