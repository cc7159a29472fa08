"""The energy hardens more, or less, than the nominal law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.fem.film.laws import Stiffened
from tympan.fem.film.laws.invariants import first_invariant
from tympan.geometry.specimen import Film
from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, exponent: float) -> Setup:
    """Every material wrapped; the stress at its film's own flat state stays."""
    def change(film: Film) -> Film:
        mounted = float(np.real(first_invariant(*film.prestretch)[0])) + 3
        return replace(film, material=Stiffened(film.material, exponent, mounted))

    return setup.with_films(change)


register(Effect(
    "strain_stiffening",
    "The film hardens with stretch more (h > 0) or less than the nominal law, with the same stress when mounted.",
    (Parameter("h", "power of the first invariant by which the slope of the energy grows", "", "",
               width=0.2,
               low=-0.8, high=2.0, sign="signed", reason=(
                   "Gent's law with J_lim has h = I_m/(J_lim + 3 - I_m) about the mounted I_m = 10: 0.1 for the 110 "
                   "of the library's VHB 4910, 0.3 for 40, against 0 for neo-Hooke: sources on one tape differ so")),),
    edit,
))
