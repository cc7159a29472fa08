"""Runs that cannot tell time from stretch get no branches; those that can still get theirs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.trials.coupons.limits import exact, noisy
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.studies.columns import write_sheet
from tympan.studies.data.coupon import COLUMNS, MODES, Coupons
from tympan.studies.estimation.correlation import akaike
from tympan.studies.material.branches import compare_in_time
from tympan.studies.material.families import FAMILIES
from tympan.studies.material.fit import compare, far_off, useless_constant
from tympan.studies.material.result import fit_coupons
from tympan.studies.material.time_in_runs import LEAST_SHARE, time_in_runs

#: Constants of the rubber that got a branch of 293 kPa from one ramp.
RUBBER = np.array([300e3, 3e3, 2.0, 7.0])


def ramp(rate: float = 0.2, mode: str = "uniaxial", *, top: float = 3.0, count: int = 60,
         name: str = "1", seed: int = 0, noise: float = 0.01) -> Coupons:
    """An elastic rubber on one ramp; noise is a share of the stress."""
    stretch = np.linspace(1.02, top, count)
    law = FAMILIES["ogden_2"].stress(stretch, stretch ** MODES[mode], RUBBER)
    errors = np.random.default_rng(seed).standard_normal(count)
    return Coupons(np.full(count, mode), stretch, law * (1 + noise * errors), np.full(count, ""),
                   np.full(count, name), (stretch - 1) / rate)


def rows_of(coupons: Coupons, folder: Path) -> Path:
    write_sheet(folder / "coupon.csv", COLUMNS, coupons.columns)
    return folder / "coupon.csv"


def share(parts: Sequence[Coupons]) -> float:
    return time_in_runs(Coupons.joined(parts)).share


def test_one_ramp_tells_nothing_of_time() -> None:
    alone = ramp()
    assert share([alone]) == pytest.approx(0.0, abs=1e-9)
    shaken = replace(alone, stretch=alone.stretch
                     + 0.002 * np.random.default_rng(1).standard_normal(len(alone)))
    assert share([shaken]) < LEAST_SHARE
    again = ramp(0.2 * 1.02, name="2", seed=1)
    assert share([alone, again]) < LEAST_SHARE
    other = ramp(0.02, "equibiaxial", name="2")
    assert share([alone, other]) < LEAST_SHARE


def test_what_separates_time_from_stretch_is_seen() -> None:
    """Another rate, a hold, the way back, a reading at rest: each on the same stretch."""
    alone = ramp()
    end = float(alone.time[-1])
    hold = replace(alone, stretch=np.full(len(alone), 3.0),
                   time=end + np.geomspace(0.1, 100.0, len(alone)))
    back = replace(alone, stretch=alone.stretch[::-1], time=end + alone.time)
    rest = replace(alone, time=np.full(len(alone), np.nan), run=np.full(len(alone), "rest"))
    for more in (ramp(2.0, name="2"), hold, back, rest):
        assert share([alone, more]) > 10 * LEAST_SHARE


def test_an_elastic_rubber_at_two_rates_is_elastic() -> None:
    shown = [time_in_runs(Coupons.joined([
        ramp(0.02, seed=2 * seed, noise=0.02, count=30),
        ramp(name="2", seed=2 * seed + 1, noise=0.02, count=30)])).shown for seed in range(20)]
    assert sum(shown) <= 1


@pytest.mark.parametrize("seed", range(4))
def test_branches_are_seen_where_runs_have_them(seed: int) -> None:
    every = noisy(600.0, seed)
    assert time_in_runs(every).shown
    for run in ("hold", "0.01/s to 2.5"):
        assert time_in_runs(every[every.run == run]).shown
    up = every[(every.run == "0.01/s to 2.5") & (every.time <= 150.0)]
    assert not time_in_runs(up).separable


def test_no_branch_comes_of_one_ramp(tmp_path: Path, capsys) -> None:
    file = rows_of(ramp(), tmp_path)
    assert main(["material", "fit", str(file), "--law", "ogden_2", "--law", "neo_hooke",
                 "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert "branch" not in result["material_toml"]
    assert result["best"] == "ogden_2"
    assert not result["time"]["separable"]
    assert "1 run at 0.2/s" in result["time"]["reason"]
    assert len(result["time"]["needed"]) == 3
    assert "0.02/s or 2/s" in result["time"]["needed"][0]
    assert result["warnings"][0] == result["time"]["reason"]
    assert main(["material", "fit", str(file), "--law", "neo_hooke"]) == 0
    printed = capsys.readouterr().out
    assert "warning: no viscous branches are fitted" in printed
    assert "needed to tell time from stretch: a run to stretch 3 at another rate" in printed
    with pytest.raises(InputError, match="must be 0: no viscous branches"):
        fit_coupons(file, ["neo_hooke"], branches=1)
    fit, = compare_in_time(ramp(), ["neo_hooke"])
    assert fit.count == 0


def test_criteria_count_correlated_readings_for_what_they_are_worth() -> None:
    """A wave along a run is no evidence for another constant, however many readings follow it."""
    stretch = np.linspace(1.02, 2.5, 400)
    base = ramp(top=2.5, count=400, noise=0.0)
    wave = 4e3 * np.sin(6 * stretch)
    law = FAMILIES["neo_hooke"].stress(stretch, stretch**-0.5, np.array([300e3]))
    fits = compare(replace(base, stress=law + wave), ["yeoh", "mooney_rivlin", "neo_hooke"])
    assert fits[0].family.name == "neo_hooke"
    # For 400 independent readings the waves would speak for three constants.
    squares = {fit.family.name: akaike(fit.rmse**2, 400, len(fit.values)) for fit in fits}
    assert min(squares, key=lambda name: squares[name]) == "yeoh"


def test_laws_are_compared_by_runs_held_out_where_there_are_several() -> None:
    """Strips that differ by 3 % in thickness: what one law foretells of another strip."""
    parts = [ramp(name=str(number), seed=number) for number in range(4)]
    shares = (0.97, 1.0, 1.02, 1.03)
    data = Coupons.joined([replace(part, stress=part.stress * factor)
                           for part, factor in zip(parts, shares, strict=True)])
    fits = compare(data, ["neo_hooke", "ogden_2"])
    assert fits[0].family.name == "ogden_2"
    assert fits[0].foretold == pytest.approx(0.03 * np.sqrt(np.mean(data.stress**2)), rel=0.5)
    assert compare(parts[0], ["neo_hooke"])[0].foretold is None


def test_constants_of_no_use_are_dropped() -> None:
    """Gent's law of a rubber that does not lock; a third term of two; a term below the scatter."""
    stretch = np.linspace(1.05, 2.0, 30)
    none = np.full(30, "")
    errors = np.random.default_rng(0).standard_normal(30)
    law = FAMILIES["neo_hooke"].stress(stretch, stretch**-0.5, np.array([300e3]))
    # Softer than neo-Hooke, so that nothing locks.
    data = Coupons(np.full(30, "uniaxial"), stretch, law * (1 - 0.05 * (stretch - 1))
                   + 500 * errors, none, none, np.full(30, np.nan))
    gent, *others = sorted(compare(data, ["gent"]), key=lambda fit: fit.family.name)
    assert [fit.family.name for fit in others] == ["neo_hooke"]
    assert not gent.offered
    assert "j_lim is at its bound" in gent.dropped
    assert any("neo_hooke does with fewer" in note for note in gent.notes)
    mooney = useless_constant(FAMILIES["mooney_rivlin"], np.array([150e3, 10.0]), data, 500.0)
    assert "the term of c01 is smaller than the scatter of one reading" in mooney
    assert not useless_constant(FAMILIES["mooney_rivlin"], np.array([150e3, 1e3]), data, 500.0)


def test_a_law_far_from_the_others_where_nothing_is_tested_comes_last() -> None:
    """Ogden's law of a negative power: fits strips, and is 5000 times too stiff in a film."""
    stretch = np.linspace(1.1, 6.0, 40)
    values = np.array([-5.47e3, -4.98])
    stress = FAMILIES["ogden_1"].stress(stretch, stretch**-0.5, values)
    none = np.full(40, "")
    data = Coupons(np.full(40, "uniaxial"), stretch, stress, none, none, np.full(40, np.nan))
    fits = compare(data, ["ogden_1", "neo_hooke", "yeoh"])
    assert fits[-1].family.name == "ogden_1"
    assert fits[-1].rmse < 1e-3 * fits[0].rmse
    assert fits[-1].offered
    words = far_off(data, fits)
    assert set(words) == {"ogden_1"}
    assert "equibiaxial at stretch 3.5" in words["ogden_1"]


def test_a_rest_beyond_the_tests_is_told() -> None:
    late = exact()
    early = late[late.time < 100.0]
    notes = {name: " ".join(compare_in_time(data, ["neo_hooke"], branches=2)[0].law.notes)
             for name, data in (("late", late), ("early", early))}
    assert "extrapolated" not in notes["late"]
    assert "the modulus at rest is extrapolated: the longest test is" in notes["early"]
