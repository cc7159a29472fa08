"""Mechanisms between plate and ground do what independent equations say."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize

from tests.support.biases import COARSE, DECLARED, JOINED, SAMPLES
from tests.support.specimens import circular
from tympan.base.errors import InputError
from tympan.fem.membrane.biases import (
    BIASES,
    Bistable,
    BuckledBeam,
    Constant,
    ForceTable,
    Spring,
)
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import rig_to_toml
from tympan.studies.case import Case, solve
from tympan.studies.force import ForceCase, force
from tympan.studies.limits import limits
from tympan.studies.signals import ramp, step
from tympan.studies.transient import TransientCase, respond

BEAM = BuckledBeam(length=30e-3, width=4e-3, thickness=0.1e-3, modulus=1.5e9, compression=0.4e-3)


def test_every_mechanism_has_a_sample() -> None:
    assert {*SAMPLES} == {*BIASES}


@pytest.mark.parametrize("law", SAMPLES)
def test_a_mechanism_softens_only_where_it_says(law: str) -> None:
    """There the stiffness is negative somewhere, so that each interval is one."""
    bias = SAMPLES[law]
    places = np.linspace(-4.9e-3, 11.9e-3, 4001)
    falls = np.array([bias.derivatives(place)[2] < 0 for place in places])
    inside = np.zeros(len(places), dtype=bool)
    for low, high in bias.softening:
        within = (places > low) & (places < high)
        assert falls[within].any()
        inside |= within
    assert not falls[~inside].any()
    loading = Rig(biases=(bias, Spring(1.0))).loading
    assert loading.softening == tuple(sorted(bias.softening))
    # A step from anywhere stays before an interval, or leads over a part of it only.
    for place in places[::400]:
        for low, high in bias.softening:
            assert loading.step(place) <= max(low - place, place - high, 0.0) + (high - low) / 4


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
        work, _ = quad(lambda w: bias.derivatives(w)[1], begin, end, limit=400, epsabs=0.0,
                       epsrel=1e-11, points=[0.0, 3e-3, 5e-3, *getattr(bias, "kinks", ())])
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


def rig_of(tmp_path: Path, content: str, more: str = "") -> Rig:
    """The rig whose table is in a file of such content."""
    (tmp_path / "beam.csv").write_text(content)
    (tmp_path / "rig.toml").write_text(f'[[bias]]\nlaw = "table"\nfile = "beam.csv"\n{more}')
    return Rig.read(tmp_path / "rig.toml")


@pytest.mark.parametrize("law", ["spring", "bistable"])
def test_a_law_s_table_in_a_file_gives_the_law_s_results(law: str, tmp_path: Path) -> None:
    """In other units, from the far end, beside columns of no interest; and in Python alike."""
    places = np.linspace(6e-3, 0, 601)
    forces = [SAMPLES[law].derivatives(place)[1] for place in places.tolist()]
    rows = "".join(f"{number},{place * 1e6:.12g},{force * 1e3:.12g}\n"
                   for number, (place, force) in enumerate(zip(places, forces, strict=True)))
    rig = rig_of(tmp_path, "t_s,travel_um,push_mN\n" + rows,
                 'columns = ["travel_um", "push_mN"]\n')
    case = Case(circular(), mass=17.9e-3, voltage=3e3)
    by_law, by_file = (solve(replace(case, rig=other), COARSE).deflection_m
                       for other in (Rig(biases=(SAMPLES[law],)), rig))
    assert by_file == pytest.approx(by_law, rel=1e-6)
    again = tmp_path / "again.toml"
    again.write_text(rig_to_toml(rig))
    assert Rig.read(again) == rig
    assert rig.biases == (ForceTable(file=str(tmp_path / "beam.csv"),
                                     columns=("travel_um", "push_mN")),)


@pytest.mark.parametrize(("content", "more", "words"), [
    ("displacement_mm,force_N\n0,0\n1,0.1\n1,0.2\n", "", r"line 4, .*'1': .*one run"),
    ("displacement_mm,force_N\n3,0\n1,0.1\n2,0.2\n", "", r"line 4, .*'2': .*one run"),
    ("displacement_mm,force_N\n-2,0.1\n1,0.02\n4,-0.1\n", "",
     r"'0.1 N at -2 mm, -0.1 N at 4 mm': must be positive where .* off from 1.5 mm .* sign"),
    ("displacement_mm,force_N\n1,0\n", "", "from 2 to 10000 rows"),
    ("displacement_mm,force_N\n" + "".join(f"{n},{0.1 * n + (-1)**n * 0.2}\n" for n in range(12)),
     "", "'10 turns, more than 8': must be smoothed"),
    ("displacement_mm\n1\n2\n", "", "column force_N is missing"),
    ("displacement_mm,force_foo\n0,1\n1,2\n", "", "'force_foo': unknown unit"),
    ("travel_mm,push_N\n0,1\n1,2\n", 'columns = ["travel_mm", "push_mN"]', "push_mN is missing"),
    ("travel_mm,push_N\n0,1\n1,2\n", 'columns = ["travel", "push_N"]', "such as travel_mm"),
    ("travel_mm,push_N\n0,1\n1,2\n", 'columns = ["travel_mm", "push_foo"]', "unit of force"),
    ("travel_mm,push_N\n0,1\n1,2\n", 'columns = "travel_mm"', "two names"),
    ("displacement_mm,force_N\n0,1\n1,2\n", 'force = ["1 N", "2 N"]', "left out")])
def test_a_file_that_is_no_table_of_a_mechanism_is_refused(
        content: str, more: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        rig_of(tmp_path, content, more)


@pytest.mark.parametrize("content", [
    "displacement_mm,force_N\n0,-0.1\n5,-0.02\n",  # it only pulls, ever less
    "displacement_mm,force_N\n0,0.01\n1,0.08\n2,0\n3,-0.08\n4,-0.01\n"])  # it snaps over
def test_a_mechanism_that_may_be_meant_so_is_taken(content: str, tmp_path: Path) -> None:
    assert rig_of(tmp_path, content).biases


def test_a_taut_film_whose_plate_is_driven_off_is_not_called_slack() -> None:
    away = ForceTable((-5e-3, 0.0, 5e-3), (0.6, 0.0, -0.6))
    result = solve(Case(circular(), mass=1e-3, rig=Rig(biases=(away,))), COARSE)
    assert result.status == "not_converged"
    assert "slack" not in " ".join(result.warnings)


def test_what_leads_beyond_a_table_says_so() -> None:
    """At rest, as the voltage rises, in time, and where not even the flat film is in it."""
    short, away = (ForceTable((low, low + 1e-3), (0.0, 1e-3)) for low in (0.0, 1e-3))
    case = Case(circular(), mass=17.9e-3, rig=Rig(biases=(short,)))
    ends = r'mechanism "table" of the rig ends .* no force at about {} mm'
    beyond = solve(case, COARSE)
    assert beyond.status == "not_converged"
    assert re.search(ends.format(r"\d\.\d+"), beyond.warnings[0])
    flat = solve(replace(case, rig=Rig(biases=(away,))), COARSE)
    assert re.search(ends.format("0"), flat.warnings[0])
    asked = force(ForceCase(circular(), to=3e-3, points=4, rig=case.rig), COARSE)
    assert re.search('"table" of the rig has no force at 3 mm', asked.warnings[0])
    assert asked.loads[0].displacement_m == pytest.approx([0.0, 1e-3])
    rising = limits(replace(case, mass=5e-3), COARSE)
    assert re.search(ends.format(r"\d\.\d+"), rising.ended)
    slow = TransientCase(circular(), ramp(0.0, 6e3, 0.3), mass=8e-3, rig=case.rig)
    assert re.search(ends.format(r"\d\.\d+"), respond(slow, COARSE, 1e-2)[0].warnings[0])
    with pytest.raises(InputError, match=ends.format(r"\d\.\d+")):
        respond(replace(slow, signal=step(0.0, 6e3, 0.0, 0.3)), COARSE, 1e-2)


def test_what_a_rig_is_known_by_stays_when_it_is_used() -> None:
    rig = Rig(biases=tuple(DECLARED.values()))
    before = str(rig.record())
    for bias in SAMPLES.values():
        bias.derivatives(1e-3)
    assert str(rig.record()) == before
    assert f"'law': '{JOINED.specimen.membrane.material.law}'" in before


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
