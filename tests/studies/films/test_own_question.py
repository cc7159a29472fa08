"""A question of a user's own over many films, by public names alone; finite elements answer it."""

from __future__ import annotations

import numpy as np
import pytest

import tympan
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.studies.case import build_model

FORCE = 0.2
COARSE = tympan.Settings(tympan.MeshSettings().refined(0.6))
#: A film that softens, and pulls in before it loses tension.
SOFT = tympan.Specimen("soft", tympan.Circle("45 mm"), tympan.Plate(tympan.Circle("11 mm")),
                       tympan.Film("1 mm", 2.236, tympan.Ogden((40e3,), (1.3,)),
                                   relative_permittivity=4.7))


def test_the_deflection_of_1000_films_at_half_their_pull_in_voltage() -> None:
    numbers = {"membrane.thickness": ("0.95 mm", "1.05 mm"), "stiffness": (0.95, 1.05)}
    family = tympan.FilmFamily.around(SOFT, numbers, force=(0.9 * FORCE, 1.1 * FORCE),
                                      voltage=("0 kV", "7 kV"), settings=COARSE)
    rows = family.drawn(1000)
    pull_in = family.ends(rows, FORCE).pull_in
    half = family.states(rows, FORCE, pull_in / 2)
    assert half.deflection.shape == (1000, 1)
    assert half.holds.all()
    assert (half.error < 1e-4 * half.deflection).all()
    for film in np.random.default_rng(3).choice(1000, 2, replace=False):
        model = build_model(family.box.member(rows[film]), COARSE, Rig().loading)
        ramp = equilibrium(model, FORCE, 9e3)
        assert not ramp.thins
        assert ramp.limit is not None
        assert pull_in[film, 0] == pytest.approx(ramp.limit**0.5, rel=1e-2)
        known = equilibrium(model, FORCE, float(pull_in[film, 0]) / 2)
        assert half.deflection[film, 0] == pytest.approx(
            model.deflection(known.state), abs=2 * half.error[film, 0])


def test_the_question_of_the_handbook_is_answered_for_a_film_that_loses_tension_first() -> None:
    """At half its own first limit every film has a deflection; a few against finite elements."""
    film = tympan.Specimen("vhb", tympan.Circle("45 mm"), tympan.Plate(tympan.Circle("10 mm")),
                           tympan.Film("1 mm", 2.236, MATERIALS["vhb-4910"].material,
                                       relative_permittivity=4.7))
    films = tympan.films_within(film, mass="17.9 g", films=200, settings=COARSE)
    limit, kind = films.first_limits("17.9 g")
    assert (np.isinf(limit) == (kind == "")).all()
    assert np.isfinite(limit).sum() > 195
    assert set(kind) <= {"tension", "breakdown", "instability", ""}
    deflection = films.under("17.9 g", limit / 2).deflection[:, 1]
    assert (np.isfinite(deflection) == np.isfinite(limit)).all()
    nominal = tympan.limits(film, settings=COARSE, mass="17.9 g").limits.limit
    assert np.nanmedian(limit) == pytest.approx(nominal.voltage_V, rel=0.05)
    at_half = tympan.solve(film, settings=COARSE, mass="17.9 g", voltage=nominal.voltage_V / 2)
    assert np.nanmedian(deflection) == pytest.approx(at_half.deflection_m, rel=0.1)


def test_films_without_a_finite_voltage_have_no_state() -> None:
    films = tympan.films_within(SOFT, mass="10 g", voltage="1 kV", films=4, settings=COARSE)
    found = films.under("10 g", np.array([500.0, np.inf, np.nan, 0.0])).deflection[:, 1]
    assert np.isfinite(found).tolist() == [True, False, False, True]


def test_a_highest_voltage_is_asked_for_where_no_limit_tells_it() -> None:
    stiff = tympan.Specimen("stiff", SOFT.frame, SOFT.plate,
                            tympan.Film("5 mm", 1.2, tympan.NeoHooke(5e6),
                                        relative_permittivity=1.5))
    with pytest.raises(tympan.InputError, match="must be given"):
        tympan.films_within(stiff, mass="10 g", films=4, settings=COARSE)
