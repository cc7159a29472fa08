"""A question of a user's own over many films, by public names alone; finite elements answer it."""

from __future__ import annotations

import numpy as np
import pytest

import tympan
from tympan.fem.equilibrium.solve import equilibrium
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
