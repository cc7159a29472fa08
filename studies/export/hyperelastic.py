"""Laws as cards *HYPERELASTIC of CalculiX and Abaqus, in MPa, their volume held by a penalty.

The penalty is (K/2) (J − 1)², K the bulk modulus, on the law of the stretches λᵢ J^(−1/3). The
programs write it as (J − 1)²/D, D = 2/K.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from typing import Any

from tympan.base.errors import InputError
from tympan.fem.film.density import small_strain_modulus
from tympan.fem.film.laws import ArrudaBoyce, MooneyRivlin, NeoHooke, Ogden, Yeoh

#: K over the shear modulus at small strains. With a tenth of it the error is ten times as large.
BULK_RATIO = 10000.0

_MPA = 1e-6
_NEAREST = ("must be a law that CalculiX has: neo_hooke, mooney_rivlin, yeoh with at most three "
            "constants, arruda_boyce, or ogden with at most four terms; `tympan material fit` fits "
            "one to the same data")


def bulk_modulus(material: Any) -> float:
    """Compute the K [Pa] that approximates incompressibility."""
    return float(BULK_RATIO * small_strain_modulus(material))


def hyperelastic(material: Any) -> list[str]:
    """Write the card of a law with its constants; an InputError where these programs have none.

    Examples
    --------
    >>> hyperelastic(NeoHooke(20e3))
    ['*HYPERELASTIC, NEO HOOKE', '0.01, 0.01']
    """
    kind, constants, penalties = _card(material)
    d = 2 / (bulk_modulus(material) * _MPA)
    values = [*constants, d, *[0.0] * (penalties - 1)]
    lines = [", ".join(f"{value:.12g}" for value in values[at : at + 8])
             for at in range(0, len(values), 8)]
    return [f"*HYPERELASTIC, {kind}", *lines]


@singledispatch
def _card(material: Any) -> tuple[str, Sequence[float], int]:
    """Find the card's parameter, its constants in its units, and its number of penalties."""
    raise InputError(_NEAREST, key="membrane.material", given=material.law)


@_card.register
def _(material: NeoHooke) -> tuple[str, Sequence[float], int]:
    return "NEO HOOKE", [material.mu / 2 * _MPA], 1


@_card.register
def _(material: MooneyRivlin) -> tuple[str, Sequence[float], int]:
    return "MOONEY-RIVLIN", [material.c10 * _MPA, material.c01 * _MPA], 1


@_card.register
def _(material: Yeoh) -> tuple[str, Sequence[float], int]:
    if len(material.c) > 3:
        raise InputError(_NEAREST, key="membrane.material", given=f"yeoh with {len(material.c)}")
    padded = [*material.c, 0.0, 0.0][:3]
    return "YEOH", [c * _MPA for c in padded], 3


@_card.register
def _(material: ArrudaBoyce) -> tuple[str, Sequence[float], int]:
    return "ARRUDA-BOYCE", [material.mu * _MPA, material.lambda_lock], 1


@_card.register
def _(material: Ogden) -> tuple[str, Sequence[float], int]:
    if len(material.mu) > 4:
        raise InputError(_NEAREST, key="membrane.material", given=f"ogden with {len(material.mu)}")
    pairs = zip(material.mu, material.alpha, strict=True)
    constants = [value for mu, alpha in pairs for value in (mu * alpha / 2 * _MPA, alpha)]
    return f"OGDEN, N={len(material.mu)}", constants, len(material.mu)
