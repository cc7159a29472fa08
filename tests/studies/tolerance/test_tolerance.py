"""Tolerances: shares against known indices, films against closed form and finite elements."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats import binomtest

import tympan
from tests.support.specimens import specimen_toml
from tests.support.tolerances import STILL
from tympan.base.errors import InputError
from tympan.base.toml_reader import Table
from tympan.cli import main
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.film.breakdown import ConstantStrength
from tympan.fem.film.library import MATERIALS, load_specimen
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Specimen
from tympan.reports.tables import text
from tympan.studies.case import Case, Settings, build_model
from tympan.studies.limits import solve_within
from tympan.studies.limits.voltages import first_limit
from tympan.studies.modes import carried, heaving_frequency
from tympan.studies.tolerance.given import (
    LengthScatter,
    Scatter,
    StrengthScatter,
    Tolerances,
    causes,
)
from tympan.studies.tolerance.result import Chance
from tympan.studies.tolerance.shares import SaltelliDesign
from tympan.studies.tolerance.tolerance import DrawnFilms, ToleranceCase, tolerance
from tympan.studies.wanted import Bound

MASS, VOLTAGE = 17.9e-3, 3500.0
#: Numbers that are compared here are found on the same mesh, or differ by scatter alone.
COARSE = Settings(MeshSettings().refined(0.5))


def film_of(material: str) -> Specimen:
    return load_specimen(Table("film.toml", tomllib.loads(specimen_toml(film=material))))


@cache
def oval() -> Specimen:
    return load_specimen(Table("oval.toml", tomllib.loads(specimen_toml())))


def test_shares_of_ishigami_s_function() -> None:
    """Ishigami, Homma (1990) with a = 7, b = 0.1: indices in closed form."""
    design = SaltelliDesign.drawn([[True, False, False], [False, True, False], [False, False, True],
                           [True, False, True]], 6 * 2**13, seed=3)
    x = np.pi * (2 * design.points - 1)
    found = design.shares(np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2
                          + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0]))
    np.testing.assert_allclose(found.alone, [0.3139, 0.4424, 0.0, 0.5576], atol=0.01)
    np.testing.assert_allclose(found.total, [0.5576, 0.4424, 0.2437, 0.5576], atol=0.01)
    assert (found.low <= found.alone).all()
    assert (found.alone <= found.high).all()


def test_films_that_are_missing_do_not_count() -> None:
    design = SaltelliDesign.drawn(np.eye(2, dtype=bool).tolist(), 4 * 2**11, seed=1)
    values = design.points @ [1.0, 2.0]
    values[::50] = np.nan
    np.testing.assert_allclose(design.shares(values).alone, [0.2, 0.8], atol=0.05)


def test_shares_of_few_films_are_known_to_some_per_cent() -> None:
    """A product of lognormal numbers, as small deflections are; one of them makes most of it."""
    sizes = np.array([0.2, 0.05, 0.02, 0.01, 0.03, 0.1])
    whole = np.exp(sizes @ sizes) - 1
    off = []
    for seed in range(10):
        design = SaltelliDesign.drawn(np.eye(6, dtype=bool).tolist(), 8 * 128, seed)
        values = np.exp(ndtri(np.clip(design.points, 1e-6, 1 - 1e-6)) @ sizes)
        values[values > np.quantile(values, 0.998)] = np.nan
        found = design.shares(values)
        off.append(np.append(found.alone - (np.exp(sizes**2) - 1) / whole,
                             1 - found.alone.sum() - (1 - np.expm1(sizes**2).sum() / whole)))
    first, *others, rest = np.sqrt((np.array(off) ** 2).mean(0))
    assert first < 0.03
    assert max(others) < 0.02
    assert rest < 0.02


@pytest.mark.study(seconds=4)
def test_small_loads_scatter_as_products_of_lognormal_numbers() -> None:
    """The deflection of a hardly loaded neo-Hookean film goes as F / (μ T): closed form."""
    film = film_of('material = "vhb-4910-neo-hooke"')
    sizes = {"thickness": 0.05, "stiffness": 0.1, "load": 0.08}
    given = Tolerances(**{**vars(STILL), "thickness": Scatter(film=0.05),
                          "stiffness": Scatter(batch=0.1), "load": Scatter(film=0.08)})
    whole = np.sqrt(sum(size**2 for size in sizes.values()))
    wanted = tuple(Bound("deflection", value, False) for value in (1.12e-6, 1.38e-6))
    result = tolerance(ToleranceCase(film, mass=1e-5, voltage=1.0, tolerances=given, films=5000,
                                     wanted=wanted), COARSE)
    spread = result.quantities["deflection_m"]
    assert spread.median == pytest.approx(spread.nominal, rel=0.01)
    assert spread.high / spread.median == pytest.approx(np.exp(1.645 * whole), rel=0.015)
    assert spread.low / spread.median == pytest.approx(np.exp(-1.645 * whole), rel=0.015)
    within = np.sqrt(0.05**2 + 0.08**2) / whole
    assert spread.within_batch == pytest.approx(within * spread.deviation, rel=0.05)
    shares = {share.name: share for share in spread.shares}
    variance = np.exp(whole**2) - 1
    for name, size in sizes.items():
        assert shares[name].alone == pytest.approx((np.exp(size**2) - 1) / variance, abs=0.04)
    assert sum(share.alone for share in spread.shares) + spread.interactions == pytest.approx(1)
    # The share of films with less is the normal distribution of the logarithm.
    for told in result.wanted:
        known = ndtr(np.log(told.bound / spread.nominal) / whole)
        assert told.kept.low < known < told.kept.high
        assert told.kept.probability == pytest.approx(known, abs=0.01)
        assert told.missed.probability == pytest.approx(1 - told.kept.probability)
    assert result.kept == result.wanted[0].kept


def test_strengths_are_weibull_s_and_fall_with_the_electrode_s_area() -> None:
    """A hardly loaded film has one field everywhere, so what breaks down is in closed form."""
    shape, strength, share = 8.0, 5e6, 0.9
    film = oval()
    film = replace(film, membrane=replace(film.membrane, strength=ConstantStrength(strength)))
    electrode = np.pi * (0.06 * 0.045 - 0.01**2)
    given = replace(STILL, strength=StrengthScatter(shape=shape, area=electrode / 4))
    # The field is U λ² / T.
    voltage = share * strength * film.membrane.thickness / film.membrane.area_prestretch
    result = tolerance(ToleranceCase(film, mass=1e-5, voltage=voltage, tolerances=given,
                                     films=12_000), COARSE)
    bears = 0.5 ** (4 * share**shape)
    assert result.reached.low < bears < result.reached.high
    assert result.reached.high - result.reached.low < 0.03
    spread = result.quantities["limit_V"]
    assert set(result.limits.kinds) == {"breakdown"}
    expected = voltage / share * 4 ** (-1 / shape)
    assert spread.nominal == pytest.approx(expected, rel=2e-3)
    shares = np.array([0.05, 0.5, 0.95])
    np.testing.assert_allclose([spread.low, spread.median, spread.high],
                               expected * (-np.log2(1 - shares)) ** (1 / shape), rtol=0.01)
    assert spread.shares[0].name == "strength"
    assert spread.shares[0].alone == pytest.approx(1.0, abs=0.02)


def test_what_does_not_differ_between_films_has_no_shares() -> None:
    """Electric strengths alone scatter: all films deflect alike."""
    given = replace(STILL, strength=StrengthScatter(shape=10))
    result = tolerance(ToleranceCase(oval(), mass=MASS, voltage=VOLTAGE, tolerances=given,
                                     films=100), COARSE)
    spread = result.quantities["deflection_m"]
    assert spread.deviation == 0
    assert spread.low == pytest.approx(spread.high, rel=1e-12)
    assert spread.shares == ()
    assert sum(spread.counts) == result.films
    assert f"reached       {result.reached.probability:.6g}\n" in text(result)


@pytest.mark.study(seconds=4)
def test_a_voltage_that_no_film_reaches_is_explained(tmp_path: Path) -> None:
    result = tympan.tolerance(oval(), settings=COARSE, mass=MASS, voltage="30 kV", films=100)
    assert result.reached.probability == 0
    assert result.error is None
    assert any("does not reach the voltage: loss of tension" in line
               for line in result.warnings)
    assert not [line for line in result.warnings if "e+" in line]
    assert list(result.quantities) == ["limit_V"]
    result.save(tmp_path)
    assert (tmp_path / "oval-tolerance.json").is_file()


@pytest.mark.parametrize("command", ["tolerance", "solve"])
def test_what_has_no_reduced_film_is_refused_by_its_own_file(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    film, rig, given = (tmp_path / f"{name}.toml" for name in ("film", "bench", "tolerances"))
    film.write_text(specimen_toml(), encoding="utf-8")
    rig.write_text('guide = "fixed"\n', encoding="utf-8")
    given.write_text("[thickness]\nfilm = 0.02\n", encoding="utf-8")
    loads = ["--mass", "17.9 g", "--voltage", "3 kV", "--tolerances", str(given)]
    assert main([command, str(film), *loads, "--rig", str(rig)]) == 2
    assert "bench.toml: guide: given 'fixed': must let the plate move" in capsys.readouterr().err


@pytest.mark.parametrize(("key", "given", "size"), [
    ("frame", LengthScatter(film="20 mm"), "20 mm"), ("plate", LengthScatter(batch=4e-3), "4 mm"),
    ("offset", LengthScatter(film=12e-3), "12 mm")])
def test_lengths_that_scatter_too_far_are_refused_by_their_key(
        key: str, given: LengthScatter, size: str) -> None:
    with pytest.raises(InputError, match=rf"^{key}\.(film|batch): given '{size}': is too large"):
        ToleranceCase(oval(), tolerances=replace(STILL, **{key: given}))


@pytest.mark.study(seconds=6)
def test_a_film_without_a_load_has_no_band() -> None:
    for mass in (0.0, "0 g"):
        with pytest.raises(InputError, match=r"^mass: given '0 g': must be above 0"):
            tympan.tolerance(oval(), mass=mass, voltage=VOLTAGE)
    with pytest.raises(InputError, match=r"^mass: given '0 g': must be above 0"):
        tympan.solve(oval(), settings=COARSE, mass="0 g", voltage=VOLTAGE, tolerances=GIVEN)
    curves = tympan.curve(oval(), mass=[0.0, MASS], settings=COARSE, tolerances=GIVEN).curves
    bands = {curve.mass_kg: curve.band_deflection_m for curve in curves}
    assert {edge for band in bands[0.0] if band for edge in (band.low, band.high)} == {0.0}
    assert bands[MASS][0].low > 1e-3


@pytest.mark.parametrize("name", MATERIALS)
def test_films_of_the_library_scatter_as_it_says(name: str) -> None:
    """Each number that it has a source for, and no other."""
    film, known = film_of(f'material = "{name}"'), MATERIALS[name].scatter
    found, words = causes(film, Tolerances())
    of_library = {cause.name: cause.deviation for cause in found
                  if cause.source == f"library, {name}"}
    sizes = {key: getattr(known, key) for key in ("thickness", "stiffness", "permittivity")}
    assert of_library == {key: size for key, size in sizes.items() if size is not None}
    assert [line.split()[0] for line in words] == [
        *(key for key, size in sizes.items() if size is None), "offset", "gradient"]


@pytest.mark.study(seconds=3, only=("200000000.0-tension",))
@pytest.mark.parametrize(("strength", "kind"), [(30e6, "breakdown"), (200e6, "tension")])
def test_first_limits_are_those_of_finite_elements(strength: float, kind: str) -> None:
    film = oval()
    film = replace(film, membrane=replace(film.membrane, strength=ConstantStrength(strength)))
    found, _ = causes(film, Tolerances())
    drawn = DrawnFilms.of(ToleranceCase(film, films=1000), found, MASS, VOLTAGE, COARSE)
    found = drawn.limits()
    assert next(iter(found.record().kinds)) == kind
    _, numbers = drawn.design.part(1 / 8)
    for film_number in np.random.default_rng(5).choice(len(numbers), 3, replace=False):
        row = 1 + numbers[film_number]
        member = drawn.family.box.member(drawn.films.rows[row])
        scattered = ConstantStrength(strength * float(drawn.films.strength[row]))
        member = replace(member, membrane=replace(member.membrane, strength=scattered))
        factors = drawn.films
        known = first_limit(Case(member, mass=MASS * float(factors.load[row]),
                                 rig=Rig(amplifier_gain=float(factors.amplifier[row]) - 1)),
                            COARSE)
        assert known is not None
        assert found.kind[1 + film_number] == known.kind
        assert found.voltage[1 + film_number] == pytest.approx(known.voltage_V, rel=3e-3)


@pytest.mark.study(seconds=7)
def test_a_first_limit_that_is_not_that_of_finite_elements_is_told() -> None:
    drawn, _ = drawn_films()
    limits = drawn.limits()
    assert drawn.first is not None
    assert not any("finite elements" in words for words in limits.warnings)
    assert limits.voltage[0] == pytest.approx(drawn.first.voltage_V, rel=drawn.first.spread)
    for other in (replace(drawn.first, voltage_V=1.02 * drawn.first.voltage_V),
                  replace(drawn.first, kind="pull_in")):
        said, *_ = replace(limits, drawn=replace(drawn, first=other)).warnings
        assert "by finite elements, but loss of tension at" in said


def exact(drawn: DrawnFilms, film: int) -> dict[str, float]:
    """The quantities of a film by finite elements on a mesh of its own."""
    case = Case(drawn.family.box.member(drawn.films.rows[film]))
    model = build_model(case.specimen, COARSE, case.rig.loading)
    force = float(drawn.films.forces(MASS)[film])
    voltage = float(drawn.films.across(drawn.voltage)[film, 0])
    rest, charged = (equilibrium(model, force, across) for across in (0.0, voltage))
    first, last = (model.deflection(outcome.state) for outcome in (rest, charged))
    blocked = held(model, first, voltage, rest.solution)
    plate = carried(replace(case, mass=MASS * float(drawn.films.load[film])))
    frequency = heaving_frequency(model, charged.state, plate)
    assert frequency is not None
    return {"deflection_m": last, "stroke_m": last - first,
            "blocked_force_N": force - float(blocked.state.force),
            "capacitance_F": float(model.capacitance(charged.state)), "frequency_Hz": frequency,
            **{f"tilt_{axis}_rad": float(slope)
               for axis, slope in zip("xy", charged.state.plate.slope, strict=True)}}


@cache
def drawn_films() -> tuple[DrawnFilms, dict[str, np.ndarray]]:
    given = Tolerances(permittivity=Scatter(batch=0.03), offset=LengthScatter(film=5e-4))
    case = ToleranceCase(oval(), tolerances=given, films=1000, seed=4)
    drawn = DrawnFilms.of(case, causes(oval(), given)[0], MASS, VOLTAGE, COARSE)
    return drawn, dict(drawn.solved().values)


def compared(count: int) -> dict[str, np.ndarray]:
    """Quantities by finite elements of some of the films, drawn at random."""
    drawn, values = drawn_films()
    chosen = np.random.default_rng(2).choice(len(drawn.films), count, replace=False)
    known = [exact(drawn, int(film)) for film in chosen]
    for key, found in values.items():
        expected = np.array([each[key] for each in known])
        # A stroke is the difference of two deflections ten times as large. Tilts are about 0, and
        # right to 5 % of their scatter on this coarse mesh: shapes are chosen by deflections.
        np.testing.assert_allclose(found[chosen], expected, rtol=1e-3, err_msg=key,
                                   atol=5e-2 * np.std(found) * key.startswith("tilt"))
    return {key: np.array([each[key] for each in known]) for key in values}


@pytest.mark.study(seconds=6)
def test_some_films_are_those_of_finite_elements() -> None:
    compared(6)


def test_films_keep_wanted_bounds_as_finite_elements_do() -> None:
    """Bounds that half of the films keep, in both senses, and a pair; by six films and by all."""
    drawn, values = drawn_films()
    names = {"deflection_m": "deflection", "stroke_m": "stroke", "blocked_force_N": "blocked_force",
             "capacitance_F": "capacitance", "frequency_Hz": "frequency"}
    middle = {name: float(np.median(values[key])) for key, name in names.items()}
    bounds = [Bound(name, value, least) for name, value in middle.items()
              for least in (True, False)]
    films = drawn.loaded()
    missed = {bound: bound.misses(films) for bound in bounds}
    for bound, share in missed.items():
        key = next(key for key, name in names.items() if name == bound.name)
        np.testing.assert_allclose(share, bound.missed(values[key]), atol=1e-6)
    chosen = np.random.default_rng(8).choice(len(drawn.films), 6, replace=False)
    for film in chosen:
        known = exact(drawn, int(film))
        for key, name in names.items():
            for bound in (Bound(name, middle[name], least) for least in (True, False)):
                by_elements = float(bound.missed(np.array(known[key])))
                # Nearer to a bound than reduced films are to finite elements neither is sure.
                assert abs(by_elements) < 1e-3 or (missed[bound][film] <= 0) == (by_elements <= 0)
    asked = replace(drawn, case=replace(drawn.case, wanted=tuple(bounds[:3])))
    solved = asked.solved()
    reached = solved.reached[1:]
    told, kept = asked.wanted(solved)
    masks = [reached & (missed[bound][1:] <= 0) for bound in bounds[:3]]
    assert [each.kept.probability for each in told] == [mask.mean() for mask in masks]
    assert kept is not None
    assert kept.probability == np.all(masks, axis=0).mean()


def test_what_films_fail_of_is_what_finite_elements_meet_first() -> None:
    """Half of the films lose tension before the voltage, some of weak ones break down."""
    film = oval()
    film = replace(film, membrane=replace(film.membrane, strength=ConstantStrength(48e6)))
    limit = first_limit(Case(film, mass=MASS), COARSE)
    assert limit is not None
    given = replace(STILL, stiffness=Scatter(film=0.1), strength=StrengthScatter(shape=10))
    case = ToleranceCase(film, films=200, tolerances=given)
    drawn = DrawnFilms.of(case, causes(film, given)[0], MASS, limit.voltage_V, COARSE)
    reached = drawn.solved().reached[1:]
    fails = {each.kind: each for each in drawn.fails(reached)}
    assert {*fails} == {"tension", "breakdown"}
    assert sum(each.share.probability for each in fails.values()) == pytest.approx(
        1 - reached.mean())
    films = drawn.loaded().part(slice(1, None))
    met = np.full(len(reached), "", dtype=object)
    met[~reached] = films.failures(~reached)
    chosen = [*np.flatnonzero(met == "tension")[:2], *np.flatnonzero(met == "breakdown")[:2],
              np.flatnonzero(reached)[0]]
    for number in chosen:
        member = drawn.family.box.member(films.films.rows[number])
        scattered = ConstantStrength(48e6 * float(films.films.strength[number]))
        member = replace(member, membrane=replace(member.membrane, strength=scattered))
        known = first_limit(Case(member, mass=MASS), COARSE)
        assert known is not None
        assert (known.voltage_V <= limit.voltage_V) == (met[number] != "")
        assert met[number] in ("", known.kind)


def test_a_pressure_loads_each_plate_by_its_own_area_beside_its_own_weight() -> None:
    """The pressure carries most of the weight, so that forces scatter more than loads do."""
    rig = Rig(plate_pressure=-400.0)
    given = replace(STILL, load=Scatter(film=0.05), plate=LengthScatter(film=2e-4))
    case = ToleranceCase(oval(), tolerances=given, films=100, rig=rig)
    drawn = DrawnFilms.of(case, causes(oval(), given)[0], MASS, 2000.0, COARSE)
    radii = [drawn.family.box.member(row).needed_plate().outline.semi_axes[0]
             for row in drawn.films.rows]
    forces = 9.80665 * MASS * drawn.films.load - 400.0 * np.pi * np.square(radii)
    np.testing.assert_allclose(drawn.films.forces(MASS), forces, rtol=1e-12)
    assert np.std(forces) > 0.1 * np.mean(forces)
    assert drawn.solved().reached.all()


@pytest.mark.study(seconds=9)
def test_the_words_of_what_is_wanted_are_those_of_a_file_the_option_and_python(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And the answers: on the terminal, in JSON and in Python."""
    file, scatter = tmp_path / "oval.toml", tmp_path / "T.toml"
    file.write_text(specimen_toml(), encoding="utf-8")
    scatter.write_text('[want]\nstroke = "9 mm"\nfrequency = "6 Hz"\n', encoding="utf-8")
    loads = {"mass": "17.9 g", "voltage": "3.5 kV"}
    command = ["tolerance", str(file), *(word for key, value in loads.items() for word in (
        f"--{key}", value)), "--films", "200", "--refine", "0.5", "--tolerances", str(scatter),
        "--want", "stroke = 0.2 mm, deflection = at most 5 mm"]
    assert main([*command, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    found = tympan.tolerance(
        oval(), tolerances=scatter, want={"stroke": "0.2 mm", "deflection": "at most 5 mm"},
        films=200, settings=COARSE, **loads)
    assert record["wanted"] == found.json()["wanted"]
    assert record["kept"] == found.json()["kept"]
    assert [each["name"] for each in record["wanted"]] == ["frequency", "stroke", "deflection"]
    assert record["fails"] == found.json()["fails"] == []
    assert main([*command, "-o", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    for each in found.wanted:
        assert re.search(rf"{each.text} +{re.escape(each.kept.text)} ", text)
    assert f"all together{'':25}{found.kept.text}" in text
    assert (tmp_path / "oval-tolerance.png").is_file()
    # Other commands leave the table out.
    assert Tolerances.read(scatter) == Tolerances()


@pytest.mark.parametrize(("want", "message"), [
    ({"width": "10 cm"}, "must be of what differs between films.*width is judged by its nominal"),
    ({"breakdown_margin": 1.5}, "needs a film whose electric strength is known"),
    ({"strok": "1 mm"}, "want: given '1 mm': strok: must be one of"), ("stroke", "such as")])
def test_what_cannot_be_wanted_of_films_is_refused(want: object, message: str) -> None:
    film = oval()
    film = replace(film, membrane=replace(film.membrane, strength=None))
    with pytest.raises(InputError, match=message):
        tympan.tolerance(film, want=want, mass=MASS, voltage=VOLTAGE, settings=COARSE)


def test_limits_of_a_share_leave_room_for_films_that_share_numbers() -> None:
    """Of known shares more than 95 % of the limits have them in between; all and none have some."""
    sizes = np.array([0.8, 0.5, 0.3, 0.1])
    groups = [*np.eye(4, dtype=bool).tolist(), [True, True, False, False]]
    for share in (0.5, 0.95, 0.99):
        within, narrow = [], []
        for seed in range(60):
            design = SaltelliDesign.drawn(groups, 1000, seed)
            some = ndtri(np.clip(design.points, 1e-9, 1 - 1e-9)) @ sizes < ndtri(
                share) * np.sqrt(sizes @ sizes)
            told, plain = Chance.of(some, design.independent), Chance.of(some)
            within.append(told.low <= share <= told.high)
            narrow.append(plain.low <= share <= plain.high)
        assert np.mean(within) >= 0.95
        assert np.mean(within) >= np.mean(narrow)
    every = np.ones(len(design.points), dtype=bool)
    assert Chance.of(every, design.independent).low < Chance.of(every).low
    assert Chance.of(every).high == 1.0
    assert Chance.of(~every, design.independent).low == 0.0


@pytest.mark.parametrize(("count", "of"), [(0, 50), (3, 50), (31, 50), (50, 50)])
def test_limits_of_independent_films_are_wilson_s(count: int, of: int) -> None:
    told = Chance.of(np.arange(of) < count)
    known = binomtest(count, of).proportion_ci(method="wilson")
    assert (told.low, told.high) == pytest.approx((known.low, known.high), abs=1e-12)


@pytest.mark.study
def test_quantiles_are_those_of_500_films_of_finite_elements() -> None:
    known, (drawn, values) = compared(500), drawn_films()
    for key, expected in known.items():
        ranks = np.array([(expected < np.nanquantile(values[key][1:], share)).mean()
                          for share in (0.05, 0.5, 0.95)])
        shares = np.array([0.05, 0.5, 0.95])
        # Three standard deviations of a binomial share, and of that of the films drawn.
        off = 3 * np.sqrt(shares * (1 - shares) * (1 / 500 + 1 / drawn.count))
        assert (np.abs(ranks - shares) <= off).all(), key


@pytest.mark.study(seconds=3)
def test_half_of_the_films_reach_the_nominal_film_s_limit() -> None:
    given = Tolerances(**{**vars(STILL), "thickness": Scatter(film=0.02)})
    limit = first_limit(Case(oval(), mass=MASS), COARSE)
    assert limit is not None
    found = [tolerance(ToleranceCase(oval(), mass=MASS, voltage=share * limit.voltage_V,
                                     tolerances=given, films=400), COARSE)
             for share in (0.9, 1.0)]
    assert found[0].reached.probability > 0.98
    assert found[1].reached.probability == pytest.approx(0.5, abs=0.06)
    assert found[1].reached.low < 0.5 < found[1].reached.high
    assert not found[1].quantities["stroke_m"].shares
    assert any("do not reach" in words for words in found[1].warnings)


def test_films_beyond_the_range_of_their_law_do_not_count() -> None:
    """Of films with a law up to the nominal film's stretch half are within it."""
    soft = '[membrane.material]\nlaw = "neo_hooke"\nmu = "20 kPa"'
    most = solve_within(Case(film_of(soft), mass=MASS, voltage=VOLTAGE), COARSE,
                        film=False).max_stretch
    assert most is not None
    # Ends of a range are taken as rounded, to 1 %.
    film = film_of(f"{soft}\nrange = [0.1, {most / 1.01}]")
    given = Tolerances(**{**vars(STILL), "stiffness": Scatter(film=0.05)})
    found = tolerance(ToleranceCase(film, mass=MASS, voltage=VOLTAGE, tolerances=given, films=400),
                      COARSE)
    assert found.reached.probability == pytest.approx(0.5, abs=0.06)
    failure, = found.fails
    assert failure.kind == "law_range"
    assert failure.share.probability == pytest.approx(1 - found.reached.probability)
    assert "the end of the law's range comes before 3.5 kV" in failure.words
    assert {*found.limits.kinds} == {"law_range"}


GIVEN = Tolerances(**{**vars(STILL), "thickness": Scatter(batch=0.05),
                      "stiffness": Scatter(film=0.1), "load": Scatter(film=0.02)})


@pytest.mark.study(seconds=6)
def test_bands_of_a_curve_and_of_one_case_are_the_quantiles_of_ten_thousand_films() -> None:
    many = tolerance(ToleranceCase(oval(), mass=MASS, voltage=VOLTAGE, tolerances=GIVEN),
                     COARSE).quantities
    curves = tympan.curve(oval(), mass=[0.5 * MASS, MASS], settings=COARSE, tolerances=GIVEN).curves
    solved = tympan.solve(oval(), settings=COARSE, mass=MASS, voltage=VOLTAGE, tolerances=GIVEN)
    band = curves[1].banded
    along = [np.interp(VOLTAGE, [voltage for voltage, _ in band], [getattr(each, edge)
             for _, each in band]) for edge in ("low", "median", "high")]
    for key, spread in many.items():
        if key in solved.bands:
            wide = spread.high - spread.low
            for edge in ("low", "median", "high"):
                assert getattr(solved.bands[key], edge) == pytest.approx(
                    getattr(spread, edge), abs=0.05 * wide), (key, edge)
    wanted = many["deflection_m"]
    np.testing.assert_allclose(along, [wanted.low, wanted.median, wanted.high],
                               atol=0.05 * (wanted.high - wanted.low))
    # Where the film without scatter is near its limit, many are beyond theirs.
    assert curves[1].band_deflection_m[0] is not None
    assert curves[1].band_deflection_m[-1] is None


def test_the_band_of_a_force_is_that_of_films_held_by_finite_elements() -> None:
    """The median film's force is that of stiffness and thickness alone: F goes as μ T."""
    given = replace(STILL, stiffness=Scatter(film=0.1))
    plain, found = (tympan.force(oval(), settings=COARSE, to="6 mm", points=4,
                                 voltage=[0.0, "3 kV"], **more)
                    for more in ({}, {"tolerances": given}))
    assert plain.curves[0].band_force_N == ()
    for curve in found.curves:
        for place, band in curve.banded[1:]:
            for edge, deviation in ((band.low, -1.645), (band.high, 1.645)):
                film = oval()
                law = film.membrane.material
                stiffer = replace(law, mu=tuple(np.exp(0.1 * deviation) * m for m in law.mu))
                member = replace(film, membrane=replace(film.membrane, material=stiffer))
                model = build_model(member, COARSE)
                known = float(held(model, place, curve.voltage_V).state.force)
                assert edge == pytest.approx(known, rel=0.02)
    assert [len(curve.banded) for curve in found.curves] == [4, 4]


@pytest.mark.parametrize(("text", "message"), [
    ("[thicknes]\nfilm = 0.1", r"thicknes: unknown key: did you mean 'thickness'"),
    ("[thickness]\nfilm = 5", r"thickness\.film: given 5: must be a relative standard deviation"),
    ("[thickness]\nfilm = '5 mm'", r"thickness\.film: .*must be a number without a unit"),
    ("[frame]\nfilm = 0.1", r"frame\.film: given 0\.1: .*unit"),
    ("[frame]\nroll = '1 mm'", r"frame\.roll: unknown key: .*known here: batch, film")])
def test_a_wrong_file_is_one_message(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "T.toml").write_text(text)
    with pytest.raises(InputError, match=rf"T\.toml: {message}"):
        Tolerances.read(tmp_path / "T.toml")


@pytest.mark.study(seconds=4)
def test_what_cannot_scatter_is_refused() -> None:
    with pytest.raises(InputError, match="margin: must be left out"):
        ToleranceCase(oval(), tolerances=Tolerances(margin=LengthScatter(film=1e-4)))
    with pytest.raises(InputError, match="lets nothing scatter"):
        ToleranceCase(oval(), tolerances=STILL)
    with pytest.raises(InputError, match="voltage"):
        tolerance(ToleranceCase(oval(), mass=MASS, voltage=0.0), COARSE)
    with pytest.raises(InputError, match="take lower ones"):
        tolerance(ToleranceCase(oval(), mass=3.0, voltage=VOLTAGE), COARSE)
