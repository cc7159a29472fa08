"""Loads beyond the dead weight: one potential for all, offset weights, guides, biases, the film's
own weight."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.oracles.potential import potential
from tests.support.biases import SAMPLES
from tests.support.models import loaded, model
from tests.support.specimens import circular, elliptical
from tympan.base.errors import InputError
from tympan.base.toml_reader import Table
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.newton import moved
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.biases import BIASES, Magnet, Spring, acting
from tympan.fem.membrane.loading import GUIDES, Loading
from tympan.fem.membrane.model import Model
from tympan.fem.rig import Rig
from tympan.geometry.mesh import unfold
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Plate
from tympan.reports.study.page import settings
from tympan.studies.case import Case, Settings, build_model, solve
from tympan.studies.files import to_json

EVERYTHING = Loading(tuple(SAMPLES.values()), (3e-3, -2e-3), "free", 9.81)
LOADS = ("force", "voltage", "pressure")


def dense() -> Model:
    """A quarter model whose film has mass."""
    return model(replace(elliptical(60e-3), membrane=replace(circular().membrane, density=960.0)),
                 refine=0.7, order=2)


def half() -> Model:
    """A half model with the plate off centre along x."""
    specimen = replace(elliptical(60e-3), plate=Plate(Circle(10e-3), (6e-3, 0.0)))
    return model(replace(specimen, membrane=replace(specimen.membrane, density=960.0)), refine=0.7,
                 order=2)


CASES = [f"skewed {guide}" for guide in GUIDES] + ["half free", "half level", "quarter free"]


@pytest.fixture(scope="module")
def films(skewed_model: Model) -> dict[str, Model]:
    """Whole, half and quarter."""
    return {"skewed": skewed_model, "half": half(), "quarter": dense()}


@pytest.fixture(params=CASES)
def film(films: dict[str, Model], request: pytest.FixtureRequest) -> Model:
    """A film under everything its symmetry allows, with every guide."""
    shape, guide = request.param.split()
    arm = {"skewed": (3e-3, -2e-3), "half": (3e-3, 0.0), "quarter": (0.0, 0.0)}[shape]
    return replace(films[shape], loading=replace(EVERYTHING, arm=arm, guide=guide))


def test_everything_follows_from_one_potential(film: Model) -> None:
    """Potential less its quadratic model, residual less its linear one: third and second order,
    rotations too."""
    state = loaded(film)
    part = film.linearised(state)
    slope = film.residual(part.forces, state)
    rng = np.random.default_rng(3)
    inner = 1e-3 * rng.normal(size=film.discretisation.free_count)
    plate = np.array([1e-3, -1e-3, 2e-3, 0.2, 0.3, -0.2])[list(film.plate_freedoms)]
    bend = part.inner @ inner + part.border @ plate, part.border.T @ inner + part.corner @ plate
    at = potential(film, state)
    first, second = (inner @ pair[0] + plate @ pair[1] for pair in (slope, bend))
    energies, forces = [], []
    steps = (0.002, 0.001, 0.0005)
    for step in steps:
        there = moved(film, state, (inner, plate), fraction=step)
        energies.append(abs(potential(film, there) - at - step * first - step**2 * second / 2))
        # On the plate the residual is the derivative by a spin at the new place: its linear model
        # is not symmetric off equilibrium by half the moment. The film's part has no such term.
        forces.append(np.linalg.norm(film.residual(film.nodal_forces(there), there)[0] - slope[0]
                                     - step * bend[0]))
    assert np.log2(energies[0] / energies[2]) / 2 > 2.8, energies
    assert np.log2(forces[0] / forces[2]) / 2 > 1.9, forces
    assert np.abs(part.corner
                  - part.corner.T).max(initial=0) <= 1e-12 * np.abs(part.corner).max(initial=1)
    assert abs(part.inner - part.inner.T).max() < 1e-12 * abs(part.inner).max()


@pytest.mark.parametrize("load", LOADS)
def test_by_load_is_the_residual_s_derivative(film: Model, load) -> None:
    """By symmetric differences, which are exact: the residual is linear in every load."""
    state = loaded(film)
    step = {"force": 0.1, "voltage": 1e6, "pressure": 20.0}[load]
    ahead, back = (state.under(**{load: state.load(load) + change}) for change in (step, -step))
    ends = [film.residual(film.nodal_forces(each), each) for each in (ahead, back)]
    for got, raised, lowered in zip(film.by_load(state, load), *ends, strict=True):
        difference = (raised - lowered) / (2 * step)
        assert np.allclose(got, difference, rtol=0,
                           atol=1e-9 * np.abs(difference).max(initial=1e-9))


@pytest.mark.parametrize("make", [dense, half], ids=["quarter", "half"])
def test_a_mirrored_part_has_its_share_of_the_whole_s_potential(make) -> None:
    part = replace(make(), loading=Loading(tuple(SAMPLES.values()), gravity=9.81))
    mesh, origin, signs = unfold(part.discretisation.mesh, part.discretisation.planes)
    whole = Model(Discretisation.of(mesh), part.specimen, loading=part.loading)
    state = loaded(part)
    mirrored = state.positions[origin]
    mirrored[:, :2] *= signs.T
    full = replace(state, positions=mirrored)
    copies = part.discretisation.mirrored
    assert copies * potential(part, state) == pytest.approx(potential(whole, full), rel=1e-11)
    ours = part.residual(part.nodal_forces(state), state)[1]
    theirs = whole.residual(whole.nodal_forces(full), full)[1]
    scale = np.abs(theirs).max()
    assert copies * ours == pytest.approx(theirs[list(part.plate_freedoms)],
                                          rel=1e-9, abs=1e-11 * scale)
    kept = [number for number in range(6) if number not in part.plate_freedoms]
    assert np.abs(theirs[kept]).max() < 1e-9 * scale
    for load in LOADS:
        ours, theirs = part.by_load(state, load)[1], whole.by_load(full, load)[1]
        assert copies * ours == pytest.approx(theirs[list(part.plate_freedoms)],
                                              rel=1e-9, abs=1e-11 * np.abs(theirs).max())


def test_an_offset_weight_is_no_load_for_a_part_it_does_not_mirror() -> None:
    quarter = dense()
    with pytest.raises(ValueError, match="mirror"):
        replace(quarter, loading=Loading(arm=(1e-3, 0.0)))
    built = {arm: build_model(elliptical(60e-3), Settings(), Loading(arm=arm))
             for arm in ((0.0, 0.0), (2e-3, 0.0), (0.0, 2e-3), (1e-3, 2e-3))}
    assert [sorted(film.discretisation.planes)
            for film in built.values()] == [["x", "y"], ["y"], ["x"], []]
    assert [film.plate_freedoms for film in built.values()] == [(2,), (0, 2, 4), (1, 2, 3),
                                                                (0, 1, 2, 3, 4, 5)]


def test_an_offset_weight_tilts_a_free_plate_by_its_moment() -> None:
    """The film's moment on the plate balances force times lever, the lever turned with the plate.
    """
    arm, force = np.array([4e-3, 2e-3, 0.0]), 0.2
    film = build_model(elliptical(60e-3), Settings(), Loading(arm=(4e-3, 2e-3)))
    state = equilibrium(film, force, 3000.0).state
    at_plate = film.forces(state.positions, state.voltage_squared)[film.discretisation.plate_nodes]
    middle = film.centre + state.plate.translation
    arms = state.positions[film.discretisation.plate_nodes] - middle
    moment = np.cross(arms, at_plate).sum(axis=0)
    lever = state.plate.rotation @ arm
    assert moment == pytest.approx(np.cross(lever, [0.0, 0.0, force]), abs=1e-10)
    assert at_plate.sum(axis=0) == pytest.approx([0.0, 0.0, force], abs=1e-8)
    # The side the weight hangs on goes further down the load.
    assert lever[2] > 1e-4
    assert state.plate.tilt > 0.02


def test_a_small_offset_tilts_in_proportion_and_mirrored_offsets_mirror_the_state() -> None:
    tilts = []
    for x in (1e-4, 2e-4, -2e-4):
        film = build_model(circular(), Settings(), Loading(arm=(x, 0.0)))
        tilts.append(equilibrium(film, 0.2, 0.0).state.plate.rotation[0, 2])
    assert tilts[1] == pytest.approx(2 * tilts[0], rel=1e-3)
    assert tilts[2] == pytest.approx(-tilts[1], rel=1e-5)
    round_about = build_model(circular(), Settings(), Loading(arm=(0.0, 2e-4)))
    assert equilibrium(round_about, 0.2, 0.0).state.plate.tilt == pytest.approx(abs(tilts[1]),
                                                                                rel=1e-5)


@pytest.mark.parametrize("guide", ["level", "vertical"])
def test_a_guide_takes_the_moment_of_an_offset_weight(guide) -> None:
    """On a film with two mirror planes a plate that cannot tilt does not feel where the weight
    hangs."""
    free = equilibrium(build_model(elliptical(60e-3), Settings()), 0.2, 3000.0).state
    guided = build_model(elliptical(60e-3), Settings(), Loading(arm=(4e-3, 2e-3), guide=guide))
    state = equilibrium(guided, 0.2, 3000.0).state
    assert state.plate.tilt == 0
    assert state.plate.deflection == pytest.approx(free.plate.deflection, rel=1e-6)
    assert np.abs(state.plate.translation[:2]).max() < 1e-8


def test_a_vertical_guide_pushes_a_plate_off_centre_sideways() -> None:
    """The film's pull towards the frame's middle is the guide's reaction; without the guide the
    plate gives way."""
    specimen = replace(circular(), plate=Plate(Circle(10e-3), (8e-3, 0.0)))
    results = {}
    for guide in ("free", "level", "vertical"):
        film = build_model(specimen, Settings(), Loading(guide=guide))
        state = equilibrium(film, 0.2, 0.0).state
        pull = film.forces(state.positions, 0.0)[film.discretisation.plate_nodes].sum(axis=0)
        pull *= film.discretisation.mirrored
        results[guide] = state.plate.translation, pull, state.plate.tilt
    assert [results[guide][2] > 1e-3 for guide in results] == [True, False, False]
    assert results["level"][1][0] == pytest.approx(0, abs=1e-8)
    shift, push = results["level"][0][0], results["vertical"][1][0]
    assert results["vertical"][0][0] == 0
    # What the film pulls along x without moving goes the way it moves when it may.
    assert shift * -push > 0
    assert abs(push) > 1e-5  # a second-order effect of the heave; forces balance to 1e-8
    assert results["vertical"][0][2] <= results["level"][0][2] <= results["free"][0][2]


def test_a_fixed_plate_leaves_the_film_alone_to_bulge() -> None:
    """Under a small pressure a pre-tensioned membrane: 4 N z = p (b² − r² − (b² − a²)
    ln(b/r)/ln(b/a))."""
    film = replace(model(circular(), refine=2.0), loading=Loading(guide="fixed"))
    assert film.plate_freedoms == ()
    outcome = equilibrium(film, 0.0, 0.0, pressure=1.0)
    assert outcome.status == "equilibrium"
    assert outcome.state.plate.deflection == 0
    inner, outer, tension = 10e-3, 45e-3, 1e-3 / 5 * 25e3 * (5 - 5**-2)
    radius = np.hypot(*film.discretisation.reference[:, :2].T)
    flat = (outer**2 - radius**2 - (outer**2 - inner**2) * np.log(outer / radius)
            / np.log(outer / inner)) / 4
    assert np.allclose(outcome.state.positions[:, 2], -flat / tension, rtol=0,
                       atol=5e-6 * flat.max() / tension)


@pytest.mark.parametrize("name", sorted(BIASES))
@pytest.mark.parametrize("heave", [-3e-3, 0.0, 4e-3, 9e-3])
def test_bias_derivatives_are_the_complex_step_s(name: str, heave: float) -> None:
    bias, step = SAMPLES[name], 1e-30
    energy, push, stiffness = bias.derivatives(heave)
    stepped = bias.derivatives(heave + 1j * step)
    assert stepped[0].imag / step == pytest.approx(push, rel=1e-13, abs=1e-300)
    assert stepped[1].imag / step == pytest.approx(stiffness, rel=1e-13)
    assert stepped[0].real == pytest.approx(energy, rel=1e-14)


@pytest.mark.parametrize("name", sorted(BIASES))
def test_a_mechanism_at_many_deflections_is_what_it_is_at_each(name: str) -> None:
    """Whether a law takes arrays or one number; nan where it cannot be."""
    bias, places = SAMPLES[name], np.linspace(-8e-3, 12e-3, 81)
    each = np.array([bias.derivatives(place) for place in places.tolist()]).T
    for part, exact in zip(acting((bias,), places), each, strict=True):
        assert part == pytest.approx(exact, rel=1e-8, abs=1e-8 * np.nanmax(abs(exact)),
                                     nan_ok=True)
    assert acting((bias, bias), places[:2]) == pytest.approx(2 * each[:, :2], nan_ok=True)


def test_a_magnet_pulls_as_it_says_and_is_finite_until_contact() -> None:
    magnet = Magnet(0.5, 12e-3, 6e-3, 4.0)
    assert magnet.derivatives(12e-3)[1] == pytest.approx(-0.5)
    assert magnet.derivatives(0.0)[1] == pytest.approx(-0.5 * (1 + 12 / 6) ** -4)
    far = [magnet.derivatives(-d)[1] for d in (10.0, 20.0)]
    assert far[1] / far[0] == pytest.approx(2**-4, rel=0.005)
    # Within the magnet there is no law, and a step that lands there must be taken back.
    for power in (3.3, 4.0):
        for heave in (18.001e-3, 0.03):
            assert np.isnan(Magnet(0.5, 12e-3, 6e-3, power).derivatives(heave)).all()


def test_bias_forces_hold_the_plate_as_hand_calculation_says() -> None:
    """What hangs on the film is the weight and the magnet's pull less the spring's."""
    rig = Rig(biases=(SAMPLES["spring"], SAMPLES["magnet"]), spring=3.0)
    result = solve(Case(circular(), mass=17.9e-3, voltage=0.0, rig=rig), Settings())
    w = result.deflection_m
    magnet = 0.5 * (1 + (12e-3 - w) / 6e-3) ** -3.3
    assert result.reaction_N == pytest.approx(17.9e-3 * 9.80665 + magnet - 7 * (w - 1e-3) - 3 * w,
                                              rel=1e-9)


def test_the_film_s_own_weight_is_carried_by_frame_and_plate() -> None:
    """A film of 9.6 t/m³: total weight, and the sag of a pre-tensioned membrane under a weight per
    area."""
    heavy = circular(density=9600.0)
    film = build_model(heavy, Settings(), Loading(gravity=9.81, guide="fixed"))
    area = np.pi * (45e-3**2 - 10e-3**2)
    per_area = 9600 * 9.81 * 1e-3 / 5
    weight = film.weight[:, 2].sum() * film.discretisation.mirrored
    assert weight == pytest.approx(per_area * area, rel=1e-6)
    small = replace(film, loading=replace(film.loading, gravity=0.0981))
    state = equilibrium(small, 0.0, 0.0).state
    pressed = equilibrium(build_model(circular(), Settings(), Loading(guide="fixed")), 0.0, 0.0,
                          -per_area / 100).state
    assert state.positions[:, 2].max() == pytest.approx(pressed.positions[:, 2].max(),
                                                                rel=1e-4)


def test_plate_pressure_is_a_weight_of_pressure_times_area() -> None:
    pressed = solve(Case(circular(), mass=0.0, voltage=2000.0,
                         rig=Rig(plate_pressure=500.0)), Settings())
    hung = solve(Case(circular(), mass=500 * np.pi * 1e-4 / 9.80665, voltage=2000.0), Settings())
    assert pressed.deflection_m == pytest.approx(hung.deflection_m, rel=1e-5)


BAD = [
    ({"guide": "loose"}, "guide", "must be one of fixed, free, level, vertical"),
    ({"guide": 3}, "guide", "must be one of fixed, free, level, vertical"),
    ({"weight_offset": "1 mm"}, "weight_offset", "must be a list of 2 quantities (length)"),
    ({"weight_offset": ["1 mm"]}, "weight_offset", "must be a list of 2 quantities (length)"),
    ({"weight_offset": ["1 mm", "nan mm"]}, "weight_offset", ""),
    ({"weight_offset": ["1 mm", "1 g"]}, "weight_offset", "length"),
    ({"plate_pressure": "1 N"}, "plate_pressure", "stress"),
    ({"plate_pressure": "inf Pa"}, "plate_pressure", "must be finite"),
    ({"gas_pressure": 3}, "gas_pressure", ""),
    ({"gas_pressure": "3 mm"}, "gas_pressure", "stress"),
    ({"bias": 3}, "bias", "must be a table, or a list of tables"),
    ({"bias": [3]}, "bias", "must be a table, or a list of tables"),
    ({"bias": {}}, "bias.0.law", "is missing"),
    ({"bias": [{"law": "spring", "stiffness": "1 N/m"}, {"law": "rope"}]}, "bias.1.law",
     "must be one of " + ", ".join(sorted(SAMPLES))),
    ({"bias": {"law": "spring", "stiffness": "-1 N/m"}}, "bias.0.stiffness",
     "must not be negative"),
    ({"bias": {"law": "spring", "stiffness": "1 N/m", "slope": 1}}, "bias.0.slope", "unknown key"),
    ({"bias": {"law": "magnet", "gap": "1 cm", "decay": "5 mm"}}, "bias.0.force", "is missing"),
    ({"bias": {"law": "magnet", "force": "0 N", "gap": "1 cm", "decay": "5 mm"}}, "bias.0.force",
     "must be positive"),
    ({"bias": {"law": "magnet", "force": "1 N", "gap": "1 cm", "decay": "5 mm", "power": 1}},
     "bias.0.power",
     "must be above 1 and at most 12"),
    ({"gide": "free"}, "gide", "did you mean 'guide'?"),
]


@pytest.mark.parametrize(("keys", "key", "words"), BAD)
def test_bad_rig_keys_are_named(keys, key: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        Rig.from_table(Table("rig.toml", keys))
    message = str(caught.value)
    assert message.startswith(f"rig.toml: {key}: ")
    assert words in message


def test_good_rig_keys_are_read() -> None:
    rig = Rig.from_table(Table("rig.toml", {
        "guide": "level", "weight_offset": ["1 mm", "-2 mm"], "plate_pressure": "0.2 kPa",
        "gas_pressure": "-30 Pa",
        "bias": [{"law": "spring", "stiffness": "5 N/m", "rest": "1 mm"},
                 {"law": "magnet", "force": "500 mN", "gap": "12 mm", "decay": "6 mm",
                  "power": 3.3}]}))
    assert rig == Rig(guide="level", weight_offset=(1e-3, -2e-3), plate_pressure=200.0,
                      gas_pressure=-30.0,
                      biases=(Spring(5.0, 1e-3), Magnet(0.5, 12e-3, 6e-3, 3.3)))
    assert rig.force(0.01, 3e-4) == pytest.approx(0.01 * 9.80665 + 0.06)
    assert replace(rig, spring=2.0).loading.biases == (Spring(2.0), *rig.biases)


def _stored(rig: dict[str, Any]) -> Any:
    """What the page asks of a study, nothing but the rig in it."""
    return SimpleNamespace(rig=rig, settings={}, alphas=(), libraries={}, python="")


def test_the_documented_rig_is_read_stored_and_shown(tmp_path: Path) -> None:
    """The example of the page; its record goes through JSON into the report's lines with names
    and units."""
    page = Path(__file__).parents[3] / "docs/howto/specimen.md"
    text = page.read_text(encoding="utf-8")
    example = next(block for block in text.split("```toml\n")[1:]
                   if block.startswith("guide")).split("```")[0]
    file = tmp_path / "rig.toml"
    file.write_text(example, encoding="utf-8")
    rig = Rig.read(file)
    assert rig.biases == (Spring(5.0, 1e-3), Magnet(0.5, 12e-3, 6e-3, 4.0))
    record = json.loads(json.dumps(to_json(rig.record())))
    shown = {(where, name): value for where, name, value in settings(_stored(record))}
    assert shown["Rig", "weight offset"] == "0.002, 0 m"
    assert shown["Rig", "gas pressure"] == "50 Pa"
    assert shown["Rig", "guide"] == "free"
    assert shown["Rig", "biases, 1, law"] == "spring"
    assert shown["Rig", "biases, 2, gap"] == "0.012 m"
    plain = {(where, name): value for where, name, value in settings(
        _stored(json.loads(json.dumps(to_json(Rig().record())))))}
    assert plain["Rig", "biases"] == "none"
    assert plain["Rig", "sag voltage"] == "inf V"


def test_a_limit_in_pressure_is_told_in_pascal() -> None:
    result = solve(Case(circular(), mass=0.0, voltage=0.0,
                        rig=Rig(gas_pressure=2000.0)), Settings())
    assert result.status == "no_equilibrium"
    assert result.warnings[0] == "the film bears no more than 1272 Pa of gas pressure"
