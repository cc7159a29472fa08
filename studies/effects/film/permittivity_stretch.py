"""The permittivity falls as the film is stretched."""

from __future__ import annotations

from dataclasses import replace

from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, exponent: float) -> Setup:
    """Every film's exponent raised by n."""
    return setup.with_films(lambda film: replace(film,
                                                 permittivity_exponent=film.permittivity_exponent
                                                 + exponent))


register(Effect(
    "permittivity_stretch",
    "The permittivity of the film falls (n > 0) or rises as its area grows beyond the mounted one.",
    (Parameter("n", "exponent of ε_r (J/J_p)^(-n)", "", "", width=0.15, low=-1.0, high=1.0,
               sign="signed", reason=(
        "VHB 4910: ε_r 4.7 unstretched and 2.6 at a stretch of 5 (Wissler, Mazza, Sens. Actuators A 138, 2007, as "
        "commonly quoted, not read again) make n = ln(4.7/2.6)/ln(25) = 0.18; others find no dependence")),),
    edit,
))
