"""A film's deflection by fitted laws: its limits hold the truth, and the command prints them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.trials.coupons.limits import LAW, noisy
from benchmarks.trials.coupons.rubbers import (
    ALLOWED,
    LAWS,
    Rubber,
    branches_found,
    outcome,
    viscous,
)
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.laws import NeoHooke
from tympan.fem.toml_writer import specimen_to_toml
from tympan.studies.case import Case, Settings, solve
from tympan.studies.columns import write_sheet
from tympan.studies.data.coupon import COLUMNS
from tympan.studies.material.branches import compare_in_time
from tympan.studies.material.film import film_deflection
from tympan.studies.material.fit import compare
from tympan.studies.material.time_in_runs import time_in_runs

#: Those with at most one shape constant: `make coupon-rubbers` takes all.
NAMES = ("neo_hooke", "mooney_rivlin", "yeoh", "gent", "ogden_1")


@pytest.mark.parametrize("seed", range(1, 5), ids=lambda seed: LAWS[seed])
def test_an_elastic_rubber_s_film_is_foretold(seed: int) -> None:
    rubber = Rubber.drawn(seed)
    strips = outcome(rubber, ("uniaxial",), names=NAMES)
    both = outcome(rubber, ("uniaxial", "equibiaxial"), names=NAMES)
    assert (strips.branches, both.branches) == (0, 0)
    assert both.error <= ALLOWED
    assert strips.inside


def test_viscous_rubbers_keep_their_branches() -> None:
    """A ramp with its hold; three rates."""
    assert branches_found(0) > 0
    assert time_in_runs(viscous(1)).shown


def test_limits_of_a_law_with_one_constant_are_those_of_its_modulus() -> None:
    """Neo-Hooke: the deflection follows the modulus, whose exact 95 % limits are Student's."""
    rubber = Rubber.drawn(0)
    coupons = rubber.coupons(("uniaxial",))
    fit, = compare(coupons, ["neo_hooke"])
    film = film_deflection(rubber.case, Settings(), coupons, [fit])
    low, high = fit.limits[0]
    ends = []
    for modulus in (low, high):
        law = type(fit.material)(modulus)
        exact = film_deflection(rubber.case, Settings(), coupons, [_moved(fit, law, modulus)])
        ends.append(exact.deflection_m)
    assert film.high_m > film.deflection_m > film.low_m
    # Correlated errors, which the film's limits allow for, widen them by little here.
    assert film.high_m - film.low_m == pytest.approx(ends[0] - ends[1], rel=0.25)


def _moved(fit, law, modulus):  # type: ignore[no-untyped-def]
    return replace(fit, material=law, values=np.array([modulus]))


def test_the_command_prints_the_film(tmp_path: Path, capsys) -> None:
    rubber = Rubber.drawn(0)
    write_sheet(tmp_path / "coupon.csv", COLUMNS, rubber.coupons(("uniaxial",)).columns)
    (tmp_path / "film.toml").write_text(specimen_to_toml(rubber.case.specimen), encoding="utf-8")
    arguments = ["material", "fit", str(tmp_path / "coupon.csv"), "--law", "neo_hooke", "--film",
                 str(tmp_path / "film.toml"), "--mass", f"{rubber.case.mass} kg", "--voltage",
                 f"{rubber.case.voltage} V"]
    assert main([*arguments, "--json"]) == 0
    film = json.loads(capsys.readouterr().out)["film"]
    assert film["low_m"] < film["deflection_m"] < film["high_m"]
    assert set(film["laws"]) == {"neo_hooke"}
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert f"deflection {1e3 * film['deflection_m']:.4g} mm, 95 % limits" in printed


def test_a_flat_film_is_refused() -> None:
    rubber = Rubber.drawn(0)
    coupons = rubber.coupons(("uniaxial",))
    with pytest.raises(InputError, match="stays flat"):
        film_deflection(Case(rubber.case.specimen), Settings(), coupons,
                        compare(coupons, ["neo_hooke"]))


def test_a_viscous_tape_s_film_has_limits_too() -> None:
    """At rest, where its branches pull nothing: the limits of its deflection hold the truth."""
    coupons = noisy(300.0, 1)
    fits = compare_in_time(coupons, ["neo_hooke"], branches=2)
    rubber = Rubber.drawn(0)
    film = replace(rubber.case.specimen.membrane, material=NeoHooke(LAW), branches=())
    case = Case(replace(rubber.case.specimen, membrane=film), mass=1e-3)
    truth = solve(case, Settings()).deflection_m
    foretold = film_deflection(case, Settings(), coupons, fits)
    assert foretold.low_m < truth < foretold.high_m
    low, high = fits[0].law.limits[0]
    width = (foretold.high_m - foretold.low_m) / foretold.deflection_m
    # A film under prestretch is about as soft as its modulus is small.
    assert width == pytest.approx((high - low) / fits[0].law.values[0], rel=0.35)
