"""Tables of a film's energy against the law itself, by its principal stretches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.specimens import circular
from tympan.fem.film.density import FilmDensity, plane_stress
from tympan.fem.film.energy_table import PRECISION, EnergyTable
from tympan.fem.film.laws import Gent, MooneyRivlin, NeoHooke, Ogden, Separable, Stiffened, Yeoh
from tympan.geometry.specimen import Electrode, Material, Specimen

LOW, HIGH = np.array([9.0, 20.0]), np.array([12.5, 34.0])
LAWS: dict[str, Material] = {
    "neo-hooke": NeoHooke(20e3), "yeoh": Yeoh((18e3, -200.0, 4.0)), "gent": Gent(18e3, 40.0),
    "mooney": MooneyRivlin(16e3, 100.0), "ogden": Ogden((43e3, 3e2), (1.3, 5.3)),
    "separable": Separable((50e3,), (20e3,), (2.0,), 2.2),
    "stiffened": Stiffened(NeoHooke(20e3), 0.3, 10.0)}


def film(law: Material, fall: float = 0.0) -> Specimen:
    specimen = circular(law)
    return replace(specimen, membrane=replace(specimen.membrane, permittivity_exponent=fall))


def states() -> np.ndarray:
    """C at 4 stages of 30 points, all in the box; the first with equal stretches."""
    random = np.random.default_rng(3)
    c = np.array([5.3, 5.3, 0.0])[:, None, None] + 0.4 * random.uniform(-1, 1, (3, 4, 30))
    c[:, 0, 0] = 5.0, 5.0, 0.0
    return c


@pytest.mark.parametrize("fall", [0.0, 0.6])
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_stress_and_tangent_are_the_laws(law: Material, fall: float) -> None:
    """Equal stretches included, of a permittivity that falls, and half an electrode."""
    specimen, c, covered = film(law, fall), states(), np.repeat([1.0, 0.0], 15)
    squared = 1e6 * np.array([0.0, 1.0, 4.0, 9.0])[:, None]
    table = EnergyTable.of(specimen, covered, LOW, HIGH)
    assert table is not None
    quick = table.stress(c, squared)
    assert quick is not None
    material = FilmDensity(specimen, squared, covered).material
    exact = plane_stress(material, (c[0], c[1], c[2]), (1.0, 1.0))
    stress, tangent = (np.moveaxis(quick[0], 0, -1), np.moveaxis(quick[1], (0, 1), (-2, -1)))
    # What is small in a tangent stands beside the stress in a film's stiffness.
    near = 10 * PRECISION * np.abs(exact.stress).max()
    assert np.abs(stress - exact.stress).max() < near
    assert np.abs(tangent - exact.tangent).max() < near
    alone = table.stress(c, squared, tangent=False)
    assert alone is not None
    assert (alone[0] == quick[0]).all()


def test_thickness_adds_its_energy() -> None:
    """½ t/det C: by the complex step of that, and the tangent by differences of the stress."""
    c, thick = states(), np.linspace(1e3, 3e4, 30)
    table = EnergyTable.of(film(NeoHooke(20e3)), np.ones(30), LOW, HIGH)
    assert table is not None
    plain, more = table.stress(c, 1e6), table.stress(c, 1e6, thick)
    assert plain is not None
    assert more is not None
    for number, weight in enumerate((2.0, 2.0, 1.0)):
        step = 1e-30j * np.eye(3)[number][:, None, None]
        energy = thick / 2 / ((c + step)[0] * (c + step)[1] - (c + step)[2] ** 2)
        assert weight * energy.imag / 1e-30 == pytest.approx((more[0] - plain[0])[number], abs=1e-6)
        change = 1e-6 * np.eye(3)[number][:, None, None]
        ends = [table.stress(c + sign * change, 1e6, thick) for sign in (1, -1)]
        assert ends[0] is not None
        assert ends[1] is not None
        slope = weight * (ends[0][0] - ends[1][0]) / 2e-6
        near = 1e-5 * np.abs(more[1]).max()
        assert slope == pytest.approx(more[1][:, number], rel=1e-6, abs=near)


def test_where_it_does_not_know_it_says_so() -> None:
    specimen, c = film(NeoHooke(20e3)), states()
    table = EnergyTable.of(specimen, np.ones(30), LOW, HIGH)
    assert table is not None
    assert table.stress(1.5 * c, 0.0) is None
    # Pressed thin by far more than its tension, it wrinkles.
    assert table.stress(c, 1e9) is None
    assert table.stress(np.array([2.9, 9.0, 0.0])[:, None] + 0 * c[:, 0], 6e7) is None
    assert EnergyTable.of(film(Gent(18e3, 8.0)), np.ones(30), LOW, HIGH) is None
    greased = replace(specimen, electrode=Electrode(0.0, 0.0, 1e3))
    assert EnergyTable.of(greased, np.ones(30), LOW, HIGH) is None
