"""Branches fitted to tests in time: against their equation, and constants that are known."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import binom

from benchmarks.trials.coupons.limits import (
    KINDS,
    LAW,
    TRUTH,
    Kind,
    by_dop853,
    coupons_of,
    creep,
    cycles,
    exact,
    held,
    hung,
    looked_up,
    noisy,
    problem_of,
    pulled,
)
from tympan.cli import main
from tympan.fem.film.laws import NeoHooke
from tympan.fem.film.library import MATERIALS, load_specimen
from tympan.fem.film.memory import Memory
from tympan.geometry.specimen import Film, ViscousBranch
from tympan.studies.columns import write_sheet
from tympan.studies.data.coupon import COLUMNS, MODES, Coupons, read_coupons
from tympan.studies.material import branches
from tympan.studies.material.branches import (
    BranchFit,
    compare_in_time,
    fit_branches,
    held_out_groups,
)
from tympan.studies.material.families import FAMILIES
from tympan.studies.material.relaxation import BranchStress, integrate_branches
from tympan.studies.material.result import MaterialFitResult, fit_coupons

VHB = Path(__file__).parents[3] / "benchmarks" / "vhb"

def values_of(fit) -> np.ndarray:  # type: ignore[no-untyped-def]
    return np.concatenate([fit.law.values, fit.values])


@pytest.mark.parametrize("mode", MODES)
def test_branches_pull_as_their_equation_says(mode: str) -> None:
    coupons = cycles(mode)
    stress = BranchStress.of(coupons)
    taus = np.array([3.0, 17.0, 140.0])
    columns = stress.columns(np.log(taus))
    for name in ("0.05/s to 2.5", "0.002/s to 2.5", "hold"):
        run = coupons.timed_runs[name]
        for tau, column in zip(taus, columns.T, strict=True):
            reference = by_dop853(coupons.time[run], coupons.stretch[run], mode, tau)
            assert column[run] == pytest.approx(reference, abs=1e-5)


def test_a_held_strip_relaxes_as_in_closed_form() -> None:
    """C_v = M/det(M)^⅓ of M = 1 + s C, and t = τ ∫ ds/det(1 + s C)^⅓, by quadrature."""
    stretch, tau = 3.0, 20.0
    c = np.array([stretch**2, 1 / stretch, 1 / stretch])
    share = np.geomspace(1e-3, 50.0, 25)
    time = [tau * quad(lambda s: np.prod(1 + s * c) ** (-1 / 3), 0, end)[0] for end in share]
    grown = 1 + share[:, None] * c
    viscous = grown / np.prod(grown, axis=1)[:, None] ** (1 / 3)
    pull = (c[0] / viscous[:, 0] - c[2] / viscous[:, 2]) / stretch
    coupons = coupons_of([("hold", np.array(time), np.full(len(share), stretch))])
    stress, _ = integrate_branches(coupons, np.array([tau]))
    assert stress[:, 0] == pytest.approx(pull, abs=1e-5)


def test_times_between_those_of_the_grid_are_as_good_and_so_are_slopes() -> None:
    coupons, step = cycles(), 1e-4
    logs = np.log([2.2, 9.7, 55.0, 431.0])
    direct, _ = integrate_branches(coupons, np.exp(logs))
    assert looked_up().columns(logs) == pytest.approx(direct, abs=1e-5)
    difference = (looked_up().columns(logs + step) - looked_up().columns(logs - step)) / (2 * step)
    assert looked_up().slopes(logs) == pytest.approx(difference, abs=1e-5)


def test_a_strip_of_free_width_has_no_stress_across() -> None:
    """The lateral stretch λ^-½ leaves none, branches included: both cross axes are alike."""
    film = Film(1e-3, (1.0, 1.0), NeoHooke(1.0), 1.0,
                branches=(ViscousBranch(1.0, 2.0), ViscousBranch(3.0, 20.0)))
    memory, before = Memory.relaxed(film, (1.0, 1.0, 0.0)), (1.0, 1.0, 0.0)
    for stretch in (1.3, 2.0, 2.9, 1.7):
        now = (stretch**2, 1 / stretch, 0.0)
        flow = memory.step(before, 3.0)
        along, across, _ = flow.density(now)[1]
        assert abs(across) < 1e-12
        assert abs(along) > 0.01
        memory, before = flow.after(now), now


def test_exact_readings_give_the_constants_back() -> None:
    fit = fit_branches(problem_of(exact()), 2)
    assert values_of(fit) == pytest.approx(TRUTH, rel=2e-4)
    assert fit.law.rmse < 1e-4 * np.abs(exact().stress).max()
    assert fit.branches[0] == ViscousBranch(*fit.values[[0, 2]].tolist())


@pytest.mark.parametrize("correlation", [0.0, 0.8])
def test_limits_hold_as_often_as_they_say_in_a_few(correlation: float) -> None:
    """Of 20 seeds and 5 constants; noise of 1 % of the largest stress."""
    covers(lambda seed: pulled(seed, correlation), range(20))


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS, ids=[kind.name for kind in KINDS])
def test_limits_hold_as_often_as_they_say(kind: Kind) -> None:
    covers(kind.fit, range(100))


def covers(fit: Callable[[int], BranchFit], seeds: range) -> None:
    """Constants of one coupon share its noise: each counts by itself."""
    hits = np.sum([held(fit(seed)) for seed in seeds], axis=0)
    least, most = (binom.ppf(share, len(seeds), 0.95) for share in (0.001, 0.999))
    assert (hits >= least).all()
    assert (hits <= most).all()
    assert hits.mean() >= binom.ppf(0.01, len(seeds), 0.95)


def test_creep_gives_the_constants_back() -> None:
    """Limits hold the truth as often as they say with stretch read to 0.004, in 6 seeds."""
    assert set(held_out_groups(creep())) == {f"creep under {x} kPa" for x in (15, 30, 45)}
    fits = [hung(seed) for seed in range(6)]
    for fit in fits:
        assert values_of(fit) == pytest.approx(TRUTH, rel=0.1)
    assert (np.sum([held(fit) for fit in fits], axis=0) >= binom.ppf(0.001, 6, 0.95)).all()


def test_runs_held_out_say_how_many_branches() -> None:
    fit, = compare_in_time(noisy(300.0, 1), ["neo_hooke"])
    assert fit.count == 2
    assert set(fit.law.held_out) == {"stretch level 1.6", "stretch level 2", "stretch level 2.5",
                                     "rate 0.002/s", "rate 0.01/s", "rate 0.05/s"}
    assert fit.tried[0] > 3 * fit.tried[1] > 10 * fit.foretold
    assert fit.foretold == pytest.approx(300.0, rel=0.2)


def test_a_single_run_has_as_many_branches_as_the_criterion_finds() -> None:
    every = noisy(300.0, 6)
    run = every[every.run == "0.002/s to 2.5"]
    fit, = compare_in_time(run, ["neo_hooke"])
    assert fit.foretold is None
    assert 1 <= fit.count <= 2
    assert any("none can be held out" in note for note in fit.law.notes)


def test_what_is_held_out_is_a_whole_level_or_rate() -> None:
    coupons = cycles()
    groups = held_out_groups(coupons)
    for mask in groups.values():
        for run in coupons.timed_runs.values():
            assert mask[run].all() or not mask[run].any()
    assert not groups["rate 0.05/s"][coupons.timed_runs["hold"]].any()
    alone = coupons[coupons.run == "hold"]
    assert held_out_groups(alone) == {}


def test_the_law_is_found_too() -> None:
    gent, neo = compare_in_time(noisy_gent(), ["neo_hooke", "gent"], branches=2)
    assert (gent.law.family.name, neo.law.family.name) == ("gent", "neo_hooke")
    (low, high), (least, most) = gent.law.limits
    assert low < LAW < high
    assert least < 20.0 < most
    assert gent.foretold < 0.7 * neo.foretold


def noisy_gent() -> Coupons:
    coupons, both = noisy(300.0, 2), exact().in_plane
    law = FAMILIES["gent"].stress(*both, np.array([LAW, 20.0]))
    return replace(coupons, stress=coupons.stress + law
                   - FAMILIES["neo_hooke"].stress(*both, np.array([LAW])))


def test_what_the_tests_cannot_see_is_named() -> None:
    """Readings from 20 s on say little of a branch of 6.5 s; a rest of hours sees no modulus."""
    slow = noisy(300.0, 5)
    hold = slow[(slow.run == "hold") & (slow.time > 20)]
    fit, = compare_in_time(hold, ["neo_hooke"], branches=2)
    words = " ".join(fit.law.notes)
    assert "branch 1 modulus is poorly determined" in words
    assert "branch 1 time is poorly determined" in words
    assert fit.foretold is None


def test_readings_without_time_are_at_rest() -> None:
    coupons = noisy(600.0, 3)
    stretch = np.linspace(1.2, 3.5, 12)
    rest = replace(coupons[:12], stretch=stretch, run=np.full(12, "rest"),
                   time=np.full(12, np.nan), stress=FAMILIES["neo_hooke"].stress(
                       stretch, stretch**-0.5, np.array([LAW])))
    both = Coupons(*(np.concatenate([getattr(part, name) for part in (coupons, rest)])
                     for name in ("mode", "stretch", "stress", "specimen", "run", "time")))
    alone, more = (compare_in_time(data, ["neo_hooke"], branches=2)[0] for data in (coupons, both))
    widths = [high - low for fit in (alone, more) for low, high in fit.law.limits]
    assert widths[1] < 0.8 * widths[0]
    low, high = more.law.limits[0]
    assert low < LAW < high


def test_long_records_are_thinned_where_little_happens() -> None:
    time = np.arange(0.0, 300.0, 0.05)
    stretch = 1 + 0.02 * np.minimum(time, 60.0)
    long = coupons_of([("long", time, stretch), ("short", time[:50], stretch[:50])])
    thin = long.thinned()
    assert len(thin.timed_runs["long"]) <= 150
    assert len(thin.timed_runs["short"]) == 50
    run = thin.timed_runs["long"]
    assert np.interp(time, thin.time[run], thin.stretch[run]) == pytest.approx(stretch, abs=0.007)
    column, at = BranchStress.of(thin, 3.0, 300.0).columns(np.log([20.0])), thin.time[run]
    dense = by_dop853(np.array([0, 60.0, 100.0, 250.0]), np.array([1, 2.2, 2.2, 2.2]),
                      "uniaxial", 20.0)
    for when, reference in zip((100.0, 250.0), dense[2:], strict=True):
        assert np.interp(when, at, column[run, 0]) == pytest.approx(reference, abs=2e-3)


def saved(folder: Path, coupons: Coupons) -> Path:
    write_sheet(folder / "coupon.csv", COLUMNS, coupons.columns)
    return folder / "coupon.csv"


@pytest.mark.parametrize("tape", ["vhb-4910", "vhb-4905"])
def test_library_s_branches_are_those_of_its_tests(tape: str) -> None:
    """Fitted again to the readings beside the script that made the entry; and in its limits."""
    coupons = read_coupons(VHB / f"{tape}.csv")
    entry = MATERIALS[f"{tape}-viscous"]
    fit, = compare_in_time(coupons, ["neo_hooke"], branches=len(entry.branches))
    constants = [entry.material.mu, *(branch.modulus for branch in entry.branches),
                 *(branch.time for branch in entry.branches)]
    assert constants == pytest.approx(values_of(fit).tolist(), rel=1e-3)
    assert fit.law.rmse < 2700.0
    assert fit.foretold == pytest.approx({"vhb-4910": 2930.0, "vhb-4905": 3730.0}[tape], rel=0.02)


def test_a_specimen_of_a_library_tape_has_its_branches(tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    for lines, count in (("", 2), ("branch = []\n", 0),
                         ('[[membrane.branch]]\nmodulus = "1 kPa"\ntime = "1 s"\n', 1)):
        file.write_text(f'{PLAIN}material = "vhb-4910-viscous"\n{lines}', encoding="utf-8")
        film = load_specimen(file).membrane
        assert len(film.branches) == count
    file.write_text(f'{PLAIN}material = "vhb-4910"\n', encoding="utf-8")
    assert load_specimen(file).membrane.branches == ()


def test_laws_that_differ_where_nothing_is_tested_are_told(tmp_path: Path, capsys) -> None:
    laws = ("--law", "neo_hooke", "--law", "mooney_rivlin", "--branches", "3")
    assert main(["material", "fit", str(VHB / "vhb-4905.csv"), *laws]) == 0
    printed = capsys.readouterr().out
    assert "warning: mooney_rivlin is ranked last: in equibiaxial at stretch 2.5" in printed
    assert "the modulus at rest is extrapolated: the longest test is 1.17e+04 s" in printed
    assert "branch 3 time is at its bound" in printed
    assert 'law = "neo_hooke"' in printed


PLAIN = ('name = "x"\n[frame]\nshape = "circle"\nradius = "4 cm"\n'
         '[plate]\nshape = "circle"\nradius = "1 cm"\n'
         '[membrane]\nthickness = "1 mm"\nprestretch = [2, 2]\nrelative_permittivity = 3\n')


def test_command_writes_branches_a_specimen_reads(tmp_path: Path, capsys) -> None:
    folder, file = tmp_path / "out", saved(tmp_path, noisy(300.0, 4))
    assert main(["material", "fit", str(file), "--law", "neo_hooke", "-o", str(folder),
                 "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    fit, = result["fits"]
    assert fit["constants"]["mu"]["low"] < LAW < fit["constants"]["mu"]["high"]
    slow = fit["branches"][1]
    assert slow["time"]["unit"] == "s"
    assert slow["time"]["low"] < 140.0 < slow["time"]["high"]
    assert slow["modulus"]["low"] < 11.6e3 < slow["modulus"]["high"]
    assert not any("one elastic response" in words for words in result["warnings"])
    specimen = tmp_path / "x.toml"
    specimen.write_text(PLAIN + (folder / "material.toml").read_text(encoding="utf-8"),
                        encoding="utf-8")
    branches = load_specimen(specimen).membrane.branches
    assert [branch.time for branch in branches] == pytest.approx(
        [branch["time"]["value"] for branch in fit["branches"]], rel=1e-9)
    picture = (folder / "fit.png").read_bytes()
    (folder / "fit.png").unlink()
    assert main(["report", str(folder)]) == 0
    assert (folder / "fit.png").read_bytes() == picture
    again = MaterialFitResult.load(folder)
    assert again.histories is not None
    missed = again.histories["fitted_stress"] - again.histories["nominal_stress"]
    assert np.sqrt(np.mean(missed**2)) == pytest.approx(fit["rmse_Pa"], rel=1e-6)
    capsys.readouterr()
    assert main(["material", "fit", str(file), "--law", "neo_hooke", "--branches", "1"]) == 0
    printed = capsys.readouterr().out
    assert "[[membrane.branch]]" in printed
    assert "held out, rate 0.01/s" in printed


def test_no_branches_are_fitted_where_none_are_asked_for(tmp_path: Path) -> None:
    result = fit_coupons(saved(tmp_path, exact()), ["neo_hooke"], branches=0)
    assert result.histories is None
    assert "branches" not in result.numbers["fits"][0]
    assert any("one elastic response" in words for words in result.numbers["warnings"])


@pytest.mark.parametrize(("change", "arguments", "message"), [
    ({}, ("--branches", "9"), "--branches: given 9: must be from 0 to 4"),
    ({"time": np.nan}, ("--branches", "1"), "needs the column t_s"),
    ({"stretch": 1.0}, ("--law", "neo_hooke"), "none of the readings is stretched"),
    ({"time": -1.0}, (), "must not be negative, and ascend within a run"),
    ({"mode": "pure_shear"}, (), "must be the same in all readings of a run"),
])
def test_bad_histories_are_told(tmp_path: Path, capsys, change, arguments, message) -> None:
    coupons = exact()
    for name, value in change.items():
        values = getattr(coupons, name).astype(object if name == "mode" else float)
        values[:: 7 if value in (-1.0, "pure_shear") else 1] = value
        coupons = replace(coupons, **{name: values})
    assert main(["material", "fit", str(saved(tmp_path, coupons)), *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert message in err


@dataclass
class Fitted:
    """A fit in which every branch but the first does nothing."""

    count: int
    foretold: float | None = None
    tried: dict[int, float | None] = field(default_factory=dict)
    asked: int = 0

    @property
    def idle(self) -> bool:
        self.asked += 1
        assert self.asked == 1, "asked again without another fit"
        return self.count > 1


def test_branches_that_do_nothing_are_left_out_however_well_they_foretell(
        monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {count: {"slow": error, "fast": error}
              for count, error in enumerate((9.0, 5.0, 2.0, 1.0))}
    for name, answer in (("held_out_groups", lambda coupons: {"slow": None, "fast": None}),
                         ("_held_out", lambda tests, count, groups: errors[count]),
                         ("_counts", lambda tests: range(4)),
                         ("fit_branches", lambda tests, count, noise, errors: Fitted(count))):
        monkeypatch.setattr(branches, name, answer)
    chosen = branches._chosen(SimpleNamespace(coupons=None), None, None)
    assert (chosen.count, chosen.foretold) == (1, 5.0)
    assert chosen.tried == {0: 9.0, 1: 5.0, 2: 2.0, 3: 1.0}
