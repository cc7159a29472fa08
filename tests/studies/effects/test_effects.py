"""What every registered effect must satisfy, and the exact aliases among effects."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.support.checks.json_schema import printed_record
from tests.support.models import deflection_gradient
from tests.support.specimens import ROOT5, circular, elliptical, skewed
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.equilibrium.solve import held
from tympan.fem.film.laws import Gent, MooneyRivlin, MooneyShare, NeoHooke, Stiffened
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.electrode import Electrode, Segment
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.studies.case import Case, Settings, build_model, equilibrate, solve
from tympan.studies.data.coupon import Coupons
from tympan.studies.diagnosis.evidence.coupons import CouponTests
from tympan.studies.effects import EFFECTS, Effect, Setup, Use, extended
from tympan.studies.effects.effect import Observable, Place
from tympan.studies.effects.findings import FoundSize, finding, limits_told
from tympan.studies.modes import heave_frequency, modes
from tympan.studies.signals import step
from tympan.studies.transient import TransientCase, respond

MATERIAL = NeoHooke(20e3)
#: At rest no film feels its branch.
BRANCH = (ViscousBranch(10e3, 1e5),)
NOMINAL = Setup((circular(MATERIAL, branches=BRANCH), elliptical(60e-3, MATERIAL)), Rig())

#: Every number that an effect edits is there already, and no mirror plane.
TAKEN = Setup(
    (replace(skewed(), electrode=replace(skewed().electrode, margin_frame=3e-3)),
     circular(MATERIAL, branches=BRANCH)),
    Rig(gravity=9.81, unaccounted_mass=1e-3, spring=4.0, amplifier_gain=0.03, sag_voltage=30e3,
        sensor_gain=-0.02, sensor_zero=20e-6, drift=1e-9, lag_voltage=60.0, friction=2e-3))

#: A quarter and a half of the electrode, at two voltages, for effects on segments.
DIVIDED = Electrode(segments=(
    Segment(name="A", sector=(0.2, 1.8), share=0.9),
    Segment(name="B", sector=(2.0, 5.0), share=0.5)))


def divided(setup: Setup, effect: Effect) -> Setup:
    """The setup, with segments on its first specimen for an effect on segments."""
    if effect.place not in (Place.SEGMENT, Place.PAIR):
        return setup
    first, *others = setup.specimens
    return replace(setup, specimens=(replace(first, electrode=DIVIDED), *others))


#: Columns that only coupons have.
COUPONS_ALONE = frozenset({Observable.STRESS, Observable.TEMPERATURE})

FINE = Settings()
COARSE = Settings(MeshSettings(order=2).refined(0.7))
HALF = Settings(MeshSettings().refined(0.5))


@dataclass(frozen=True)
class Reading:
    """A reading to predict: mass [kg], voltage [V], time since the run began [s], on the way up (1)
    or down (-1)."""

    mass: float
    voltage: float
    elapsed: float
    direction: float


READINGS = (Reading(17.9e-3, 5e3, 3600.0, 1.0), Reading(22.45e-3, 3e3, 1800.0, -1.0))

each_effect = pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
each_parameter = pytest.mark.parametrize(
    ("effect", "number"),
    [pytest.param(effect, number, id=f"{effect.name}-{item.name}")
     for effect in EFFECTS.values() for number, item in enumerate(effect.parameters)])


def case_of(setup: Setup, specimen: Specimen, load: Reading) -> Case:
    return Case(specimen, mass=load.mass, voltage=load.voltage, rig=setup.rig, elapsed=load.elapsed,
                direction=load.direction)


@cache
def readings(setup: Setup, settings: Settings = FINE) -> np.ndarray:
    """What the sensor shows of every specimen, shape (specimens, readings) [m]."""
    results = [[solve(case_of(setup, specimen, load), settings) for load in READINGS]
               for specimen in setup.specimens]
    assert all(result.status == "equilibrium" for row in results for result in row)
    return np.array([[result.reading_m for result in row] for row in results])


@cache
def frequencies(setup: Setup) -> np.ndarray:
    """Of the plates' heaves, on a coarse mesh, shape (specimens, 1) [Hz]."""
    return np.array([[heave_frequency(case_of(setup, specimen, READINGS[0]), COARSE)]
                     for specimen in setup.specimens])


@cache
def in_time(setup: Setup) -> np.ndarray:
    """The first film as mass and voltage come on at once, its plate swinging, (1, times) [m]."""
    case = TransientCase(setup.specimens[0], step(0.0, 4e3, 0.0, 0.09), mass=17.9e-3,
                         rig=setup.rig, rest=0.0, inertia=True)
    response, _ = respond(case, COARSE, 0.01)
    return response.samples["displacement"].to_numpy()[None, 1:]


def of_coupons(setup: Setup) -> np.ndarray:
    """Stresses of warm strips of the first film without voltage; a kilopascal counts as 1 mm."""
    mode = np.array(["uniaxial", "pure_shear", "equibiaxial"])
    blank, none = np.full(3, ""), np.full(3, np.nan)
    coupons = Coupons(mode, np.full(3, 2.0), np.zeros(3), blank, blank, none,
                      celsius=np.full(3, 40.0))
    first = np.zeros(3, np.int64)
    tests = CouponTests(setup, coupons, first, np.arange(3), first)
    return 1e-6 * tests.shown(replace(setup, specimens=setup.specimens[:1]))[0][None]


def of_tester(setup: Setup, settings: Settings) -> np.ndarray:
    """Forces on the first film's plate that a tester displaces, without springs; a newton is 1 mm.
    """
    film = build_model(setup.specimens[0], settings)

    def force(plate: float) -> float:
        return held(film, plate, 3e3).state.force

    def stiffness(plate: float) -> float:
        return (force(plate + 1e-5) - force(plate - 1e-5)) / 2e-5

    return 1e-3 * np.array([[setup.rig.gauged(force, stiffness, shown) for shown in (1e-3, 3e-3)]])


def readings_for(effect: Effect, setup: Setup, settings: Settings = FINE) -> np.ndarray:
    """What can show an effect: where it takes frequencies these too, a hertz counted as 1 mm."""
    if COUPONS_ALONE & set(effect.shows_in):
        return of_coupons(setup)
    if Observable.FORCE in effect.shows_in:
        return of_tester(setup, settings)
    if Observable.TIME in effect.shows_in:
        return in_time(setup)
    at_rest = readings(setup, settings)
    if Observable.FREQUENCY not in effect.shows_in:
        return at_rest
    return np.hstack([at_rest, 1e-3 * frequencies(setup)])


def sizes(effect: Effect, number: int, size: float) -> list[float]:
    """One parameter at a size, the others at none, or as usual where it says how they act."""
    usual = [item.deviation if effect.parameters[number].spread and not item.spread else 0.0
             for item in effect.parameters]
    return [size if index == number else other for index, other in enumerate(usual)]


def changed(effect: Effect, number: int, size: float, setup: Setup = NOMINAL) -> Setup:
    """The setup with one parameter of an effect at a size, on the first specimen if on one."""
    setup = divided(setup, effect)
    return effect.at(setup, sizes(effect, number, size), effect.choices(setup)[0])


def unchanged(effect: Effect, number: int) -> Setup:
    """The nominal setup, with the effect if the parameter only says how that acts."""
    return (changed(effect, number, 0.0) if effect.parameters[number].spread
            else divided(NOMINAL, effect))


@each_effect
def test_no_effect_changes_no_number(effect: Effect) -> None:
    """Bit for bit, also where the setup has some of it already."""
    taken = divided(TAKEN, effect)
    for which in effect.choices(taken):
        none = effect.at(taken, [0.0] * len(effect.parameters), which)
        if Observable.TIME in effect.shows_in:
            assert none == taken
            continue
        assert np.array_equal(readings_for(effect, none, COARSE),
                              readings_for(effect, taken, COARSE))


@each_parameter
def test_a_typical_size_is_seen(effect: Effect, number: int) -> None:
    """By more than 0.1 µm somewhere, a hundred times what two meshes of one specimen differ by."""
    size = max(effect.parameters[number].deviation, effect.parameters[number].least)
    moved = np.abs(readings_for(effect, changed(effect, number, size))
                   - readings_for(effect, unchanged(effect, number)))
    assert moved.max() > 0.1e-6
    if effect.on_one:
        assert moved[0].max() > 0.1e-6
        assert (moved[1:] == 0).all()


@each_parameter
def test_readings_are_smooth_in_the_size(effect: Effect, number: int) -> None:
    """Central differences about a typical size agree at two steps: no jump, no kink, no noise of
    the mesh."""
    item = effect.parameters[number]
    if item.switch:
        pytest.skip("a switch is on or off")
    middle = max(item.deviation, 2 * item.least)
    slopes = []
    # What fades in time bends more, and so does what moves over the film.
    far = middle / 8 if Observable.TIME in effect.shows_in or item.spread else middle / 2
    for near in (far, far / 2):
        high, low = (readings_for(effect, changed(effect, number, middle + sign * near))
                     for sign in (1, -1))
        slopes.append((high - low) / (2 * near))
    scale = np.abs(slopes[1]).max()
    assert scale > 0
    assert np.allclose(*slopes, rtol=0, atol=0.03 * scale)


@each_parameter
def test_readings_tend_to_those_without_it(effect: Effect, number: int) -> None:
    item = effect.parameters[number]
    if item.switch:
        pytest.skip("a switch is on or off")
    near = max(1e-3 * item.deviation, item.least)
    full, small = (np.abs(readings_for(effect, changed(effect, number, size))
                          - readings_for(effect, unchanged(effect, number))).max()
                   for size in (item.deviation, near))
    assert small < 2 * near / item.deviation * full + 2e-9


@each_parameter
def test_sign_rule(effect: Effect, number: int) -> None:
    item = effect.parameters[number]
    size = max(item.deviation, item.least)
    low, high = item.limits
    if item.sign == "positive":
        assert low == 0
        setup = divided(NOMINAL, effect)
        with pytest.raises(InputError, match="must be from"):
            effect.apply(setup, [-1.0] * len(effect.parameters), effect.choices(setup)[0])
        return
    assert low < 0 < high
    up, down = (readings_for(effect, changed(effect, number, sign * size)) for sign in (1, -1))
    if item.sign == "even":
        # The mesh of a film without mirror planes is not its own mirror image.
        seen = np.abs(up - readings_for(effect, NOMINAL)).max()
        assert np.allclose(up, down, rtol=0, atol=max(1e-9, 2e-3 * seen))
    else:
        moved = up - readings_for(effect, unchanged(effect, number))
        assert np.abs(down - up).max() > np.abs(moved).max()


@each_effect
def test_files_give_the_same_number(effect: Effect, tmp_path: Path,
                                    capsys: pytest.CaptureFixture[str]) -> None:
    """Written as TOML and read back: equal, and ``tympan solve`` on the files finds what is found
    in memory."""
    values = [max(item.deviation, item.least) for item in effect.parameters]
    taken = divided(TAKEN, effect)
    setup = effect.at(taken, values, effect.choices(taken)[-1])
    films, rig = tmp_path / "specimen.toml", tmp_path / "rig.toml"
    # The last one has mirror planes: the command finds its limits in a tenth of the first's time.
    for specimen in setup.specimens[:1 if taken is not TAKEN else None]:
        films.write_text(specimen_to_toml(specimen), encoding="utf-8")
        assert load_specimen(films) == specimen
    rig.write_text(rig_to_toml(setup.rig), encoding="utf-8")
    assert Rig.read(rig) == setup.rig
    if Observable.FREQUENCY in effect.shows_in:
        command = ["modes", str(films), "--rig", str(rig), "--mass", "20 g", "--voltage", "3 kV"]
        assert main([*command, "--json", "--refine", "0.5"]) == 0
        printed = json.loads(capsys.readouterr().out)["modes"][0]["frequency_Hz"]
        load = Reading(20e-3, 3e3, 0.0, 0.0)
        here, taken = (modes(case_of(edited, edited.specimen(specimen.name), load),
                             HALF).modes[0].frequency_Hz for edited in (setup, TAKEN))
        assert printed == here
        assert here != taken
        return
    if (COUPONS_ALONE | {Observable.TIME, Observable.FORCE}) & set(effect.shows_in):
        # Equal specimens and rigs do the same in time, in coupon tests and in a tester.
        assert setup != taken
        return
    command = ["solve", str(films), "--rig", str(rig), "--mass", "20 g", "--voltage", "3 kV",
               "--elapsed", "30 min",
               "--direction", "down"]
    assert main([*command, "--json", "--refine", "0.5"]) == 0
    printed = json.loads(capsys.readouterr().out)["reading_m"]
    load = Reading(20e-3, 3e3, 1800.0, -1.0)
    here = solve(case_of(setup, specimen, load), HALF).reading_m
    # The command comes from its walk to the limits.
    assert printed == pytest.approx(here, rel=1e-10)
    assert here != taken_alone(taken, specimen.name, load)


@cache
def taken_alone(taken: Setup, name: str, load: Reading) -> float:
    """What is read of a specimen that has been taken without any further effect [m]."""
    return solve(case_of(taken, taken.specimen(name), load), HALF).reading_m


@each_effect
def test_edits_are_pure_and_refuse_what_is_out_of_range(effect: Effect) -> None:
    nominal = divided(NOMINAL, effect)
    which, before = effect.choices(nominal)[0], repr(nominal)
    values = [item.width for item in effect.parameters]
    assert effect.apply(nominal, values, which) == effect.apply(nominal, values, which) != nominal
    assert repr(nominal) == before
    with pytest.raises(InputError, match=effect.name):
        effect.apply(nominal, [float("nan")] * len(values), which)
    with pytest.raises(InputError, match="place it happens to" if effect.on_one
                       else "no single specimen"):
        effect.apply(nominal, values, None if effect.on_one else "circle")


@each_parameter
def test_priors(effect: Effect, number: int) -> None:
    """Draws and density go together, the usual size is that of the width, tails are heavy."""
    item = effect.parameters[number]
    if item.switch:
        pytest.skip("a switch has no size")
    low, high = item.limits
    assert item.prior.logpdf(high * 1.001) == -np.inf
    shares = np.random.default_rng(3).random(400)
    drawn = item.prior.ppf(shares)
    assert low <= drawn.min() <= drawn.max() <= high
    assert item.prior.cdf(drawn) == pytest.approx(shares, abs=1e-9)
    usual = item.deviation
    inside = np.diff(item.prior.cdf(np.array([max(low, -3 * usual), 3 * usual])))[0]
    assert 0.7 < inside < 0.98
    slope = (item.prior.cdf(0.7001 * usual) - item.prior.cdf(0.6999 * usual)) / (2e-4 * usual)
    assert np.exp(item.prior.logpdf(0.7 * usual)) == pytest.approx(slope, rel=1e-6)
    assert item.size(item.value(usual)) == pytest.approx(usual, rel=1e-12)


@each_parameter
def test_effects_are_built_or_refused_in_words_as_far_as_they_may_go(effect: Effect,
                                                                     number: int) -> None:
    item = effect.parameters[number]
    for share in (-20.0, -6.0, 6.0, 20.0):
        size = float(np.clip(share * item.deviation, *item.limits))
        with suppress(InputError):
            changed(effect, number, size)


@each_effect
@pytest.mark.parametrize("sign", [1, -1])
def test_what_is_found_is_a_sentence_with_a_check(effect: Effect, sign: int) -> None:
    """With the size and its limits, as far as the parameter can have that sign."""
    which = "circle" if effect.on_one else None
    estimates = {}
    for item in effect.parameters:
        sizes = np.clip(sign * np.array([1.0, 0.8, 1.2]) * item.deviation, *item.limits)
        estimates[item.name] = FoundSize(item, *(item.value(size) for size in sizes.tolist()))
    sentence = finding(effect, estimates, which)
    check = effect.check.format(which=which)
    assert sentence[0].isupper()
    assert check[0].islower()
    assert not set("{}_") & set(sentence + check)
    assert not (sentence + check).endswith(".")
    assert ("circle" in sentence) == ("circle" in check) == effect.on_one
    assert limits_told(effect, estimates) or any(
        item.sign == "positive" for item in effect.parameters)


def told_of(name: str, value: float, low: float, high: float) -> tuple[str, str]:
    parameter = EFFECTS[name].parameters[0]
    estimates = {parameter.name: FoundSize(parameter, value, low, high)}
    return finding(EFFECTS[name], estimates, None), limits_told(EFFECTS[name], estimates)


@pytest.mark.parametrize(("name", "values", "words", "limits"), [
    ("unaccounted_mass", (1.51e-3, 1.34e-3, 1.68e-3),
     "Every load is 1.5 g heavier than its label", "1.3 to 1.7 g"),
    ("unaccounted_mass", (-2.137e-3, -2.16e-3, -2.11e-3),
     "Every load is 2.14 g lighter than its label", "2.11 to 2.16 g"),
    ("unaccounted_mass", (0.4e-3, -0.3e-3, 1.1e-3),
     "Every load is 0.4 g heavier than its label", "\N{MINUS SIGN}0.3 to 1.1 g"),
    ("parallel_spring", (0.0, 0.0, 2.13), "Something holds the plate back like a spring of less "
     "than 2.1 N/m", ""),
    ("voltage_sag", (np.inf, 25e3, np.inf), "The supply sags: at 5 kV, less than 3.8 % of the "
     "voltage does not reach the film", ""),
    ("sensor_zero", (-1e-3, -1e-3, -0.7e-3), "Every reading is at least 700 µm too small: the "
     "sensor was not zero at the flat film", ""),
])
def test_sizes_have_sensible_digits_and_bounds_are_called_so(
        name: str, values: tuple[float, float, float], words: str, limits: str) -> None:
    assert told_of(name, *values) == (words, limits)


@pytest.mark.parametrize(("name", "path", "chain"), [
    ("permittivity_stretch", "membrane.permittivity_exponent", 1.0),
    ("electrode_stiffness", "electrode.stiffness", 1.0),
    ("strain_stiffening", "membrane.material.exponent", 1.0),
    ("second_invariant", "membrane.material.share", 1.0),
    ("unaccounted_mass", "force", 9.80665),
    ("amplifier_gain", "voltage", 5e3),
])
def test_slope_is_that_of_the_adjoint(name: str, path: str, chain: float) -> None:
    """The effect's own difference against the exact derivative of the film it edits."""
    effect = EFFECTS[name]
    step = effect.parameters[0].deviation / 10
    middle = changed(effect, 0, 2 * step)
    high, low = (readings(changed(effect, 0, factor * step))[1, 0] for factor in (3, 1))
    model, outcome = equilibrate(
        Case(middle.specimen("ellipse 0.06"), mass=17.9e-3, voltage=5e3, rig=middle.rig), FINE)
    assert (high - low) / (2 * step) == pytest.approx(
        chain * deflection_gradient(model, outcome.state, [path])[path], rel=2e-3)


def test_permittivity_amplifier_gain_and_a_divider_are_one() -> None:
    gain = EFFECTS["amplifier_gain"].apply(NOMINAL, [0.07])
    epsilon = NOMINAL.with_films(lambda film: replace(film, relative_permittivity=4.7 * 1.07**2))
    assert np.allclose(readings(gain), readings(epsilon), rtol=1e-9)
    assert not np.allclose(readings(gain), readings(NOMINAL), rtol=1e-3)


@pytest.mark.parametrize("factor", [0.9, 1.15])
def test_load_scale_thickness_and_modulus_are_one(factor: float) -> None:
    """Readings depend on m g/(mu T R) and eps U^2/(mu T^2) alone."""
    def film(thickness: float = 1.0, modulus: float = 1.0, permittivity: float = 1.0) -> Setup:
        return NOMINAL.with_films(lambda membrane: replace(
            membrane, thickness=1e-3 * thickness, material=NeoHooke(20e3 * modulus),
            relative_permittivity=4.7 * permittivity))

    heavier = replace(film(permittivity=factor), rig=Rig(gravity=9.80665 * factor))
    softer, thinner = film(modulus=1 / factor), film(thickness=1 / factor, permittivity=1 / factor)
    assert np.allclose(readings(heavier), readings(softer), rtol=1e-8)
    assert np.allclose(readings(heavier), readings(thinner), rtol=1e-8)
    assert not np.allclose(readings(heavier), readings(NOMINAL), rtol=1e-2)


def test_eccentricity_enters_as_its_square_alone() -> None:
    effect = EFFECTS["plate_eccentricity"]
    near, far = (readings(effect.apply(NOMINAL, [along, across]))[0] - readings(NOMINAL)[0]
                 for along, across in ((1.5e-3, 0.0), (3e-3, 0.0)))
    assert far / near == pytest.approx(4, rel=0.03)
    turned = readings(effect.apply(NOMINAL, [1.8e-3, 2.4e-3]))[0] - readings(NOMINAL)[0]
    assert turned == pytest.approx(far, rel=1e-3)


def test_anisotropy_has_no_direction_on_a_circle_but_on_an_ellipse() -> None:
    effect = EFFECTS["prestretch_anisotropy"]
    along, across = (readings(effect.apply(NOMINAL, [share])) for share in (0.05, 1 / 1.05 - 1))
    assert along[0] == pytest.approx(across[0], abs=2e-9)
    assert np.abs(along[1] - across[1]).min() > 1e-6


def test_sag_is_a_gain_that_depends_on_the_voltage() -> None:
    sagging = EFFECTS["voltage_sag"].apply(NOMINAL, [20e3])
    lower = EFFECTS["amplifier_gain"].apply(NOMINAL, [1 / (1 + (5 / 20) ** 2) - 1])
    assert np.allclose(readings(sagging)[:, 0], readings(lower)[:, 0], rtol=1e-12)
    assert np.abs(readings(sagging)[:, 1] - readings(lower)[:, 1]).min() > 1e-6
    twice = EFFECTS["voltage_sag"].apply(sagging, [30e3]).rig
    assert twice.film_voltage(6e3) == pytest.approx(6e3 / (1 + 0.3**2 + 0.2**2), rel=1e-14)


def test_gains_multiply() -> None:
    rig = Rig(amplifier_gain=0.1, sensor_gain=0.2, sensor_zero=1e-3)
    both = extended(replace(NOMINAL, rig=rig),
                    [("amplifier_gain", (-0.2,), None), ("sensor_gain", (0.05,), None)]).rig
    assert both.film_voltage(1e3) == pytest.approx(1e3 * 1.1 * 0.8, rel=1e-14)
    assert both.reading(2e-3) == pytest.approx(2e-3 * 1.2 * 1.05 + 1e-3, rel=1e-14)


def test_stiffening_keeps_the_stress_of_every_flat_film_and_wraps_any_law() -> None:
    specimen = skewed()
    setup = EFFECTS["strain_stiffening"].apply(Setup((specimen,), Rig()), [0.4])
    film = setup.specimens[0].membrane
    assert isinstance(film.material, Stiffened)
    nominal, wrapped = (law.derivatives(*film.prestretch)
                        for law in (specimen.membrane.material, film.material))
    assert wrapped[1:3] == pytest.approx(nominal[1:3], rel=1e-13)
    assert wrapped[3] > 1.05 * nominal[3]
    law = Stiffened(NeoHooke(20e3), 0.4, 2 * 5 + 1 / 25)
    assert law.derivatives(ROOT5,
                           ROOT5)[1] == pytest.approx(NeoHooke(20e3).derivatives(ROOT5, ROOT5)[1],
                                                      rel=1e-14)


def test_a_film_with_a_second_invariant_is_mooney_s_and_keeps_its_mounted_stress() -> None:
    """Of a neo-Hookean film, μ/2 (1 - s) and μ s/(2 J); of any, the stress stretched equally."""
    (film,) = NOMINAL.specimens[:1]
    setup = EFFECTS["second_invariant"].apply(Setup((film,), Rig()), [0.3])
    mooney = Setup((replace(film, membrane=replace(
        film.membrane, material=MooneyRivlin(7e3, 3e3 / 5))),), Rig())
    assert np.allclose(readings(setup), readings(mooney), rtol=1e-9, atol=0)
    gent, area = Gent(18e3, 110.0), 2.3**2
    nominal, shared = (law.derivatives(2.3, 2.3) for law in (gent, MooneyShare(gent, 0.4, area)))
    assert shared[1:3] == pytest.approx(nominal[1:3], rel=1e-14)


def test_several_effects_do_not_depend_on_their_order() -> None:
    uses: list[Use] = [
        ("prestretch_loss", (0.03,), "circle"), ("voltage_sag", (20e3,), None),
        ("strain_stiffening", (0.3,), None), ("amplifier_gain", (0.02,), None)]
    forward, backward = extended(NOMINAL, uses), extended(NOMINAL, uses[::-1])
    assert forward == backward
    assert forward.specimens[0].membrane.material == forward.specimens[1].membrane.material
    assert forward.rig.film_voltage(5e3) == pytest.approx(1.02 * 5e3 / (1 + 1 / 16), rel=1e-14)
    with pytest.raises(InputError, match="must be one of circle, ellipse"):
        extended(NOMINAL, [("prestretch_loss", (0.03,), "square")])


def test_the_command_and_the_page_tell_the_registry(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", "--json"]) == 0
    content = printed_record(capsys.readouterr().out)
    assert list(content) == list(EFFECTS)
    assert content["voltage_sag"]["parameters"]["U_s"]["prior"]["width"] == 25
    assert content["drift"]["needs_columns"] == ["elapsed_s"]
    assert content["hysteresis"]["needs_columns"] == ["direction"]
    assert content["unaccounted_mass"]["parameters"]["m_0"]["unit"] == "g"
    assert main(["effects"]) == 0
    printed = capsys.readouterr().out
    assert all(effect.explanation in printed for effect in EFFECTS.values())
    page = Path(__file__).parents[3] / "docs" / "effects.md"
    assert main(["effects", "--markdown"]) == 0
    assert page.read_text(encoding="utf-8") == capsys.readouterr().out, (
        "run tympan effects --markdown > docs/effects.md")


def test_a_margin_too_narrow_to_be_built_is_none_or_the_narrowest() -> None:
    """1 % of the gap of 35 mm; a fit may end there."""
    for size, built in ((0.05e-3, 0.0), (0.2e-3, 0.35e-3), (0.35e-3, 0.35e-3), (0.5e-3, 0.5e-3)):
        setup = EFFECTS["electrode_margin"].at(NOMINAL, [size])
        assert setup.specimens[0].electrode.margin_frame == pytest.approx(built, rel=1e-9)
