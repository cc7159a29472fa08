"""Coupon tests: reading, constants recovered from closed forms, honest intervals, and the command.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import tympan
from tests.oracles.laws import shear_modulus
from tests.support.checks.json_schema import printed_record
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.laws import Gent, MooneyRivlin, Ogden
from tympan.fem.film.library import MATERIALS, load_specimen
from tympan.geometry.specimen import Material
from tympan.studies.data.coupon import MODES, Coupons, read_coupons
from tympan.studies.estimation.identifiability import covariance
from tympan.studies.estimation.noise import Noise
from tympan.studies.estimation.profile import profile
from tympan.studies.material.families import FAMILIES
from tympan.studies.material.fit import (
    _admissible,
    best_offered,
    compare,
    coupon_problem,
    fit_law,
    material_lines,
    warnings,
)
from tympan.studies.material.result import fit_coupons

FALL = {"uniaxial": 2, "equibiaxial": 5, "pure_shear": 3}  # nominal stress is 2 W′(I₁) (λ − λ^−k)
ACROSS = {"uniaxial": 0.5, "equibiaxial": 2.0, "pure_shear": 1.0}  # the thickness is λ^−k
HEAD = "mode,stretch,nominal_stress_kPa\n"


def nominal_stress(law: Material, mode: str, stretch: np.ndarray) -> np.ndarray:
    """Of an isotropic law with stress-free faces along the test [Pa]."""
    return np.real_if_close(law.derivatives(stretch, stretch ** MODES[mode])[1])


def first_invariant(mode: str, x: np.ndarray) -> np.ndarray:
    return {"uniaxial": x**2 + 2 / x, "equibiaxial": 2 * x**2 + x**-4.0,
            "pure_shear": x**2 + 1 + x**-2.0}[mode]


def mooney(mode: str, x: np.ndarray, c10: float, c01: float) -> np.ndarray:
    weight = {"uniaxial": 1 / x, "equibiaxial": x**2, "pure_shear": 1 + 0 * x}[mode]
    return 2 * (x - x ** -FALL[mode]) * (c10 + c01 * weight)


def by_slope(slope):  # type: ignore[no-untyped-def]
    return lambda mode, x, *c: 2 * slope(first_invariant(mode, x) - 3,
                                         *c) * (x - 1.0 * x ** -FALL[mode])


def chains(excess, mu, lock):  # type: ignore[no-untyped-def]
    i1, n = excess + 3, lock**2
    return mu * (1 / 2 + i1 / (10 * n) + 11 * i1**2 / (350 * n**2) + 19 * i1**3 / (1750 * n**3)
                 + 519 * i1**4 / (134750 * n**4))


def ogden(mode: str, x: np.ndarray, *c: float) -> np.ndarray:
    half = len(c) // 2
    return sum(m * (x ** (a - 1) - x ** (-ACROSS[mode] * a - 1))
               for m, a in zip(c[:half], c[half:], strict=True))


#: Stress by closed form, and constants to recover.
KNOWN = {
    "neo_hooke": (by_slope(lambda e, mu: mu / 2 + 0 * e), (20e3,)),
    "mooney_rivlin": (mooney, (8e3, 500.0)),
    "yeoh": (by_slope(lambda e, a, b, c: a + 2 * b * e + 3 * c * e**2), (9e3, -30.0, 1.5)),
    "gent": (by_slope(lambda e, mu, j: mu / 2 * j / (j - e)), (15e3, 40.0)),
    "arruda_boyce": (by_slope(chains), (14e3, 3.5)),
    "ogden_1": (ogden, (12e3, 2.6)),
    "ogden_2": (ogden, (16e3, 300.0, 1.7, 4.2)),
    "ogden_3": (ogden, (-1.5e3, 16e3, 60.0, -2.0, 1.4, 5.0)),
}


def coupons(stress, constants, modes=tuple(MODES), *, top=3.5, count=12, noise=0.0,
            seed=0):  # type: ignore[no-untyped-def]
    """Readings of a closed form, with normal noise [Pa]."""
    x = np.linspace(1.05, top, count)
    mode = np.repeat(modes, count)
    values = np.concatenate([stress(name, x, *constants) for name in modes])
    values = values + noise * np.random.default_rng(seed).standard_normal(len(values))
    none = np.full(len(mode), "")
    return Coupons(mode, np.tile(x, len(modes)), values, none, none, np.full(len(mode), np.nan))


def test_every_family_is_recovered() -> None:
    assert set(KNOWN) == set(FAMILIES)


@pytest.mark.parametrize("name", KNOWN)
def test_constants_are_recovered_from_closed_forms(name: str) -> None:
    stress, constants = KNOWN[name]
    data = coupons(stress, constants)
    fit = fit_law(data, FAMILIES[name], starts=4)
    assert fit.values == pytest.approx(constants, rel=1e-5)
    assert fit.rmse < 1e-5 * np.abs(data.stress).max()
    assert fit.offered
    for mode in MODES:
        x = np.linspace(1.1, 3.0, 5)
        assert np.allclose(nominal_stress(fit.material, mode, x), stress(mode, x, *constants),
                           rtol=1e-5)
        assert fit.predict(mode, x)[0] == pytest.approx(stress(mode, x, *constants), rel=1e-5)
    for rmse in fit.held_out.values():
        assert rmse < 1e-3 * np.abs(data.stress).max()


@pytest.mark.parametrize("name", ["gent", "arruda_boyce", "ogden_2"])
def test_sensitivities_to_shape_constants(name: str) -> None:
    """The complex step against differences."""
    family, (_, constants) = FAMILIES[name], KNOWN[name]
    l1, l2 = coupons(*KNOWN[name]).in_plane
    exact = family.jacobian(l1, l2, np.array(constants))
    for index, value in enumerate(constants):
        step = 1e-5 * value * (np.arange(len(constants)) == index)
        up, down = (family.stress(l1, l2, np.array(constants) + sign * step) for sign in (1, -1))
        assert np.allclose((up - down) / (2e-5 * value), exact[:, index], rtol=1e-6,
                           atol=1e-6 * abs(exact).max())


@pytest.mark.parametrize(("name", "trials", "given"), [
    ("neo_hooke", 100, None), ("neo_hooke", 100, 800.0), ("mooney_rivlin", 100, None),
    ("gent", 30, None),
])
def test_intervals_cover_as_often_as_they_say(name: str, trials: int, given: float | None) -> None:
    """Limits of the binomial distribution that one seed in a thousand would pass."""
    from scipy.stats import binom

    stress, constants = KNOWN[name]
    hits = np.zeros(len(constants), int)
    for seed in range(trials):
        data = coupons(stress, constants, count=5, noise=800.0, seed=seed)
        limits = fit_law(data, FAMILIES[name], given, 2, hold_out=False).limits
        hits += [(low is None or low < value) and (high is None or value < high)
                 for (low, high), value in zip(limits, constants, strict=True)]
    assert (hits >= binom.ppf(0.001, trials, 0.95)).all()
    assert (hits <= binom.ppf(0.999, trials, 0.95)).all()


def test_profile_intervals_are_t_intervals_where_the_law_is_linear() -> None:
    """Profiles of constants in which stress is linear end where the exact interval does."""
    data = coupons(mooney, (8e3, 500.0), noise=500.0, seed=4)
    family = FAMILIES["mooney_rivlin"]
    exact = fit_law(data, family)
    noise = exact.noise
    jacobian = family.jacobian(*data.in_plane, exact.values)
    spread = np.sqrt(np.diag(covariance(jacobian, noise.size)))
    problem = coupon_problem(family, data, noise.size)
    for index, limits in enumerate(exact.limits):
        line = profile(problem, exact.values, index, noise.quantile, 1e-4)
        for profiled, limit in zip((line.low, line.high), limits, strict=True):
            assert profiled == pytest.approx(limit, abs=1e-3 * spread[index])


def test_noise_is_estimated_or_given() -> None:
    data = coupons(mooney, (8e3, 500.0), count=200, noise=700.0, seed=1)
    estimated, given = (fit_law(data, FAMILIES["mooney_rivlin"], noise)
                        for noise in (None, 1400.0))
    assert estimated.noise.size == pytest.approx(700, rel=0.08)
    widths = [fitted.limits[0][1] - fitted.limits[0][0] for fitted in (estimated, given)]
    assert widths[1] / widths[0] == pytest.approx(1400 / estimated.noise.size, rel=0.01)
    assert Noise.left(9.0, 3).quantile == pytest.approx(3.182446, rel=1e-6)


def test_mooney_from_uniaxial_tests_alone_is_told_to_be_open() -> None:
    data = coupons(mooney, (8e3, 500.0), ("uniaxial",), top=2.5, count=15, noise=500.0, seed=2)
    alone = compare(data, ["mooney_rivlin"])
    [fit] = alone
    together = fit_law(coupons(mooney, (8e3, 500.0), top=2.5, count=15, noise=500.0, seed=2),
                   FAMILIES["mooney_rivlin"])
    assert any("c10 and c01 are poorly determined apart" in note for note in fit.notes)
    assert any("untested in equibiaxial" in note for note in fit.notes)
    assert any("equibiaxial" in words for words in warnings(data, alone))
    assert not any("poorly" in note for note in together.notes)
    assert fit.limits[1][1] - fit.limits[1][0] > 10 * (together.limits[1][1]
                                                       - together.limits[1][0])
    assert fit.condition > 3 * together.condition
    assert fit.limits[1][0] < 500 < fit.limits[1][1]


def test_constants_the_readings_cannot_see_have_no_limits() -> None:
    """Pure shear has I₁ = I₂: it sees c₁₀ + c₀₁ alone."""
    fit = fit_law(coupons(mooney, (8e3, 500.0), ("pure_shear",), noise=300.0),
                FAMILIES["mooney_rivlin"])
    assert fit.limits == ((None, None), (None, None))
    assert fit.notes == (
        "the terms of c10 and c01 are the same in the readings: neo_hooke says the same with fewer "
        "constants; not offered",)
    assert np.isinf(fit.predict("equibiaxial", np.array([2.0]))[1]).all()
    exact = mooney("pure_shear", np.array([2.0]), 8e3, 500.0)
    assert fit.predict("pure_shear", np.array([2.0]))[0] == pytest.approx(exact, rel=0.02)
    unlocked = fit_law(coupons(*KNOWN["neo_hooke"], top=1.5, noise=300.0), FAMILIES["gent"])
    assert unlocked.limits[1][1] is None


def test_a_law_that_softens_is_not_offered() -> None:
    data = coupons(KNOWN["yeoh"][0], (9e3, -450.0, 11.0), noise=10.0)
    fits = compare(data, ["yeoh", "neo_hooke"])
    [softening] = [fit for fit in fits if fit.family.name == "yeoh"]
    assert not softening.offered
    assert softening.inadmissible is not None
    assert any("true stress falls with stretch at" in note for note in softening.notes)
    best = best_offered(fits)
    assert best is not None
    assert best.family.name == "neo_hooke"
    assert any("not admissible" in words for words in warnings(data, fits))
    assert best_offered(compare(data, ["yeoh"])) is None


def test_of_several_minima_the_best_admissible_is_taken() -> None:
    data = coupons(*KNOWN["mooney_rivlin"])
    falling, degenerate = np.array([8e3, -6e3]), np.array([1e12, -1e12 + 8e3, 2.0, 2.0])
    sound, pair = np.array([8e3, 100.0]), np.array([16e3, 300.0, 1.7, 4.2])
    for name, candidates in (("mooney_rivlin", [falling, sound]), ("ogden_2", [degenerate, pair])):
        values, material, failing = _admissible(candidates, FAMILIES[name], data)
        assert values is candidates[1]
        assert material is not None
        assert failing is None
    assert _admissible([falling], FAMILIES["mooney_rivlin"], data)[2] is not None
    assert _admissible([degenerate], FAMILIES["ogden_2"], data)[1] is None


def test_systematic_misfit_is_told() -> None:
    data = coupons(*KNOWN["gent"], top=3.8, count=25, noise=50.0)
    assert any("misses the shape" in note for note in fit_law(data, FAMILIES["neo_hooke"]).notes)
    assert not any("misses the shape" in note for note in fit_law(data, FAMILIES["gent"]).notes)


def test_the_criterion_prefers_the_law_of_the_readings() -> None:
    data = coupons(*KNOWN["gent"], noise=200.0, seed=3)
    fits = compare(data, ["neo_hooke", "mooney_rivlin", "gent", "arruda_boyce"])
    assert fits[0].family.name == "gent"
    assert best_offered(fits) is fits[0]
    assert fits[0].held_out["equibiaxial"] < 600.0


#: Treloar, Trans. Faraday Soc. 40, 59 (1944), as FElupe's documentation reproduces them: stretch,
#: kgf/cm².
TRELOAR = {
    "uniaxial": "1.02 0.26 1.125 1.37 1.24 2.3 1.39 3.23 1.585 4.16 1.9 5.1 2.18 6 2.42 6.9 "
                "3.02 8.8 3.57 10.7 4.03 12.5 4.76 16.2 5.36 19.9 5.75 23.6 6.15 27.4 6.4 31 "
                "6.6 34.8 6.85 38.5 7.05 42.1 7.15 45.8 7.25 49.6 7.4 53.3 7.5 57 7.6 64.4",
    "equibiaxial": "1.03 0.95 1.07 1.6 1.12 2.42 1.14 2.62 1.2 3.32 1.31 4.43 1.42 5.18 "
                   "1.68 6.6 1.94 7.78 2.49 9.79 3.03 12.6 3.43 14.7 3.75 17.4 4.07 20.1 "
                   "4.26 22.5 4.45 24.7",
}


def test_treloar_s_rubber() -> None:
    """Three Ogden terms follow his rubber, as is known; neo-Hooke and Mooney–Rivlin do not."""
    parts = {mode: np.array(text.split(), float).reshape(-1, 2) for mode, text in TRELOAR.items()}
    mode = np.repeat(list(parts), [len(part) for part in parts.values()])
    stretch, stress = np.concatenate(list(parts.values())).T
    none = np.full(len(mode), "")
    data = Coupons(mode, stretch, stress * 98.0665e3, none, none, np.full(len(mode), np.nan))
    three, gent, neo_hooke = (fit_law(data, FAMILIES[name], starts=6, hold_out=False)
                              for name in ("ogden_3", "gent", "neo_hooke"))
    assert three.rmse < 0.1e6 < gent.rmse < 0.2e6 < 0.5e6 < neo_hooke.rmse
    assert three.offered
    # The initial modulus of this rubber is 0.4 MPa; Gent's law stiffens towards a stretch of about
    # 9.
    assert shear_modulus(three.material) == pytest.approx(0.4e6, rel=0.15)
    assert gent.material.j_lim == pytest.approx(84, abs=8)


def test_library_silicone_is_its_source_s() -> None:
    """Four readings of the database's tensile test, nominal stress in kPa."""
    law = MATERIALS["ecoflex-00-30"].material
    for stretch, stress in ((2.02272, 29.53), (3.0, 52.39), (4.0, 80.15), (6.0, 156.68)):
        assert nominal_stress(law, "uniaxial",
                              np.array([stretch]))[0] / 1e3 == pytest.approx(stress, rel=0.015)


PLAIN = ('name = "x"\n[frame]\nshape = "circle"\nradius = "4 cm"\n'
         '[plate]\nshape = "circle"\nradius = "1 cm"\n'
         '[membrane]\nthickness = "1 mm"\nprestretch = [2, 2]\nrelative_permittivity = 3\n')


def written(folder: Path, text: str) -> Path:
    file = folder / "coupon.csv"
    file.write_text(text, encoding="utf-8")
    return file


def test_reading(tmp_path) -> None:
    data = read_coupons(written(tmp_path,
                                "\ufeffspecimen, mode, t_s, stretch, nominal_stress_kPa, run\n"
                                "A, uniaxial, 1.5, 2, 35, 1\n\n"
                                "A, pure_shear, , 1.5, -2e1, 2\n"))
    assert data.modes == ("uniaxial", "pure_shear")
    assert data.stress.tolist() == [35e3, -20e3]
    assert data.in_plane[1] == pytest.approx([2**-0.5, 1])
    assert data.run.tolist() == ["1", "2"]
    assert np.isnan(data.time[1])
    pascal = read_coupons(written(tmp_path, "mode,stretch,nominal_stress_Pa\nuniaxial,2,35\n"))
    assert pascal.stress.tolist() == [35]


@pytest.mark.parametrize(("text", "message"), [
    ("", "coupon.csv: is empty"),
    ("\n \n", "is empty"),
    (HEAD, "has no readings"),
    ("mode,stretch\nuniaxial,2\n",
     "line 1: given 'mode, stretch': the column nominal_stress_kPa is missing"),
    ("mode,nominal_stress_kPa\nuniaxial,2\n", "the column stretch is missing"),
    ("mode,stretch,stress\nuniaxial,2,3\n", "line 1, column 3: given 'stress': unknown column"),
    ("mode,stretch,stretch,nominal_stress_kPa\n",
     "line 1, column 3: given 'stretch': is there twice"),
    ("mode,stretch,nominal_stress_kPa,nominal_stress_Pa\n", "one column of nominal_stress only"),
    (HEAD + "uniaxial,2,35\nbiaxial,2,35\n",
     "line 3, column 1 (mode): given 'biaxial': must be one of uniaxial"),
    (HEAD + "uniaxial,two,35\n", "line 2, column 2 (stretch): given 'two': must be a number"),
    (HEAD + "uniaxial,,35\n", "line 2, column 2 (stretch): given '': must be a number"),
    (HEAD + "uniaxial,2,nan\n",
     "line 2, column 3 (nominal_stress_kPa): given 'nan': must be finite"),
    (HEAD + "uniaxial,2,inf\n",
     "line 2, column 3 (nominal_stress_kPa): given 'inf': must be finite"),
    (HEAD + "\nuniaxial,0,35\n", "line 3, column 2 (stretch): given '0': must be a stretch"),
    (HEAD + "uniaxial,-1,35\n", "line 2, column 2 (stretch): given '-1': must be a stretch"),
    (HEAD + "uniaxial,2\n", "line 2: given '2 cells': must have 3 cells"),
    (HEAD + "uniaxial,2,35\n", "readings: given 1: must be at least 4"),
    (HEAD + "uniaxial,1,0\n" * 9, "none of the readings is stretched"),
])
def test_bad_files_end_with_line_and_column(tmp_path, capsys, text: str, message: str) -> None:
    assert main(["material", "fit", str(written(tmp_path, text))]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "coupon.csv" in err
    assert message in err


def test_unreadable_files_and_options(tmp_path, capsys) -> None:
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfem")
    good = written(tmp_path, HEAD
                   + "".join(f"uniaxial,{x},{20 * (x - x**-2)}\n" for x in (1.2, 1.5, 2.0, 2.5)))
    for arguments, message in (
            ([tmp_path / "none.csv"], "none.csv: cannot be read"),
            ([tmp_path / "bytes.csv"], "is not UTF-16 text"),
            ([good, "--law", "rubber"], "--law: given 'rubber': must be all or one of neo_hooke"),
            ([good, "--law", "yeoh"], "needs at least 6 readings, there are 4"),
            ([good, "--noise", "2 mm"], "--noise"),
            ([good, "--noise", "0 kPa"], "must be from 1e-6 Pa to 1 GPa")):
        assert main(["material", "fit", *map(str, arguments)]) == 2
        assert message in capsys.readouterr().err


def test_fit_command_writes_a_material_for_specimens(tmp_path, capsys) -> None:
    data = coupons(*KNOWN["mooney_rivlin"], noise=100.0)
    rows = "".join(f"{mode},{x:.6f},{p / 1e3:.6f}\n" for mode, x, p in
                   zip(data.mode, data.stretch, data.stress, strict=True))
    file = written(tmp_path, HEAD + rows)
    folder = tmp_path / "out"
    assert main(["material", "fit", str(file), "--law", "mooney_rivlin", "--law", "neo_hooke", "-o",
                 str(folder),
                 "--json"]) == 0
    result = printed_record(capsys.readouterr().out)
    assert result["best"] == "mooney_rivlin"
    assert result["readings"] == {"uniaxial": 12, "equibiaxial": 12, "pure_shear": 12}
    constant = result["fits"][0]["constants"]["c10"]
    assert constant["unit"] == "Pa"
    assert constant["low"] < 8e3 < constant["high"]
    assert json.loads((folder / "fit.json").read_text(encoding="utf-8")) == result
    assert (folder / "fit.png").stat().st_size > 20_000
    specimen = tmp_path / "x.toml"
    specimen.write_text(PLAIN + (folder / "material.toml").read_text(encoding="utf-8"),
                        encoding="utf-8")
    material = load_specimen(specimen).membrane.material
    assert isinstance(material, MooneyRivlin)
    assert material.c10 == pytest.approx(constant["value"], rel=1e-9)
    assert main(["material", "fit", str(file), "--law", "neo_hooke", "--noise", "0.1 kPa"]) == 0
    printed = capsys.readouterr().out
    assert "law = \"neo_hooke\"" in printed
    assert "misses the shape" in printed


@pytest.mark.parametrize("law", [Gent(18e3, 110.0), Ogden((16e3, -20.0), (2.0, -3.0)),
                                 MooneyRivlin(8e3, 1e3)], ids=str)
def test_material_lines_are_read_back(law) -> None:
    import tomllib

    from tympan.base.toml_reader import Table
    from tympan.fem.film.laws import LAWS

    table = tomllib.loads(material_lines(law))["membrane"]["material"]
    assert LAWS.read(Table("x.toml", table)) == law


@pytest.mark.parametrize(("lines", "message"), [
    ("range = [1, 3]", None), ("", "it falls at"),
    ("range = [1, 6]", "stretches from 1.0 to 6.0, but it falls at"),
    ("range = [3, 1]", "range: given .*the smaller first"), ("range = [1]", "range"),
    ("range = [0, 2]", "positive"),
])
def test_a_law_may_be_meant_for_a_range(tmp_path, lines: str, message: str | None) -> None:
    text = (PLAIN + '[membrane.material]\n'
            'law = "ogden"\nmu = ["20 kPa", "-0.2 kPa"]\nalpha = [2, 4.3]\n')
    file = tmp_path / "x.toml"
    file.write_text(text + lines + "\n", encoding="utf-8")
    if message is None:
        assert load_specimen(file).membrane.material == Ogden((20e3, -200.0), (2.0, 4.3))
        return
    with pytest.raises(InputError, match=message):
        load_specimen(file)


def test_show(tmp_path, capsys) -> None:
    assert main(["material", "show", "paper-table-1", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["hill_fails_at"] == pytest.approx([5**0.5, 5**0.5])
    index = shown["stretch"].index(2.0)
    relative = 2 / 5**0.5
    by_hand = sum(b * relative ** (2 * i) - g * relative ** (-2 * i) for i, b, g in
                  ((1, 13.4e3, -410.0), (2, 34.8e3, -113e3), (3, 35.8e3, -34.2e3)))
    assert shown["strip_true_stress_Pa"][index] == pytest.approx(by_hand, rel=1e-12)
    assert shown["strip_stress_falls_from"] == pytest.approx(5**0.5, abs=0.01)
    file = tmp_path / "x.toml"
    file.write_text(PLAIN + '[membrane.material]\nlaw = "gent"\nmu = "18 kPa"\nj_lim = 8\n',
                    encoding="utf-8")
    assert main(["material", "show", str(file)]) == 0
    text = capsys.readouterr().out
    assert "held at 2\n" in text
    assert "Hill's inequality holds" in text
    assert "nan" in text
    for arguments, message in ((["rubber"], "specimen file or one of"),
                               (["vhb-4910", "--held", "0"], "--held")):
        assert main(["material", "show", *arguments]) == 2
        assert message in capsys.readouterr().err
    refused = tmp_path / "refused.toml"
    refused.write_text(file.read_text().replace(
        '[membrane.material]\nlaw = "gent"\nmu = "18 kPa"\nj_lim = 8\n',
        'material = "paper-table-1"\n'), encoding="utf-8")
    assert main(["material", "show", str(refused)]) == 0
    assert "Hill's inequality fails" in capsys.readouterr().out
    assert main(["solve", str(refused), "--mass", "10 g"]) == 2
    assert "cannot be a membrane material" in capsys.readouterr().err


def test_readings_under_voltage_are_left_out_and_warm_ones_told(tmp_path: Path) -> None:
    stretch = np.linspace(1.1, 3, 8)
    stress = 20.0 * (stretch - stretch**-3)
    rows = [f"pure_shear,{x},{y},0,{t}\n" for t in (20, 40)
            for x, y in zip(stretch, stress, strict=True)]
    rows += [f"pure_shear,{x},{y - 5},6,20\n" for x, y in zip(stretch, stress, strict=True)]
    file = tmp_path / "coupon.csv"
    file.write_text("mode,stretch,nominal_stress_kPa,voltage_kV,temperature_C\n" + "".join(rows))
    result = fit_coupons(file, ["neo_hooke"])
    assert len(result.coupons) == 16
    fit = result.numbers["fits"][0]
    assert fit["rmse_Pa"] < 1e-3
    assert result.key_numbers["law"] == "neo_hooke"
    assert result.key_numbers["mu_Pa"] == fit["constants"]["mu"]["value"]
    said = " ".join(result.numbers["warnings"])
    assert "8 readings under voltage are left out" in said
    assert "20 to 40 °C" in said


def test_errors_that_grow_with_the_stress_are_noted(tmp_path: Path) -> None:
    """Half-widths assume errors of one size; those of a share of the stress are told."""
    stretch = np.linspace(1.0, 3.0, 41)
    stress = 20e3 * (stretch - stretch**-2)
    noise = np.random.default_rng(2).normal(size=41)
    said = []
    for errors in (0.01 * stress * noise, 200.0 * noise):
        file = tmp_path / "strip.csv"
        rows = zip(stretch, (stress + errors) / 1e3, strict=True)
        file.write_text("stretch,stress_kPa\n" + "".join(f"{one:.6g},{other:.6g}\n"
                                                         for one, other in rows), encoding="utf-8")
        found = tympan.fit_material(file, mode="uniaxial", law="neo_hooke")
        said.append(any("errors grow with the stress" in note
                        for note in found.numbers.numbers["fits"][0]["notes"]))
    assert said == [True, False]
