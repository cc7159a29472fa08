"""Loads that can hardly be meant for a film: a number without unit is SI, and many write grams."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tympan.fem.film.admissibility import equibiaxial_stiffness
from tympan.fem.film.density import maxwell, small_strain_modulus
from tympan.fem.membrane.biases import Bias, JoinedFilm
from tympan.fem.rig import Rig
from tympan.geometry.outlines import area, perimeter
from tympan.geometry.specimen import Specimen

#: Weight over the film's stiffness round the plate's edge, beyond which it cannot be meant. Films
#: tear at some six times their mounted length, where they carry about their stiffness; usual loads
#: are a tenth of that, and the same number in kilograms is then a hundred times too much.
_MOST_WEIGHT = 10.0

#: Maxwell stress over stiffness, below which a voltage cannot be meant: at it a thousand times the
#: voltage gives ten times the stiffness, more than any film bears.
_LEAST_STRAIN = 1e-5

#: Maxwell stress over stiffness from which on a voltage is seen in a deflection.
_SEEN = 1e-4

#: Deflections at which the force of a mechanism is looked at; of a steep one the largest may be
#: missed, which is far from what is doubted.
_PLACES = 41

#: Stiffness of a neo-Hookean electrode, stretched equally along both axes, over its modulus.
_EQUIBIAXIAL = 6.0


def implausible_loads(specimen: Specimen, rig: Rig, mass: float, voltage: float) -> list[str]:
    """Likely intended values of a mass [kg] and a nominal voltage [V], in sentences; mostly none.

    The door they came through does not matter, only what they do to the film. Of several voltages
    the highest counts. What springs and other mechanisms carry is left to them. A film whose law
    gives it no stiffness, such as the paper's Eq. (8), is not judged.
    """
    stiffness, around = _stiffness(specimen)
    doubts: list[str] = []
    if not 0 < stiffness < np.inf:
        return doubts
    if mass and rig.guide != "fixed":
        frame = specimen.frame
        weight = abs(mass * rig.gravity)
        others = rig.spring * max(frame.semi_axes)
        others += sum(_carried(bias, max(frame.semi_axes)) for bias in rig.biases)
        if rig.gas_pressure:  # an area takes as long as a hundred of these looks
            others += abs(rig.gas_pressure) * area(frame)
        if weight > _MOST_WEIGHT * around + others:
            doubts.append(
                f"{mass:.4g} kg weighs {weight:.3g} N, {weight / around:.2g} times the film's "
                f'stiffness round the plate\'s edge ({around:.3g} N): was "{mass:.4g} g" meant?')
    seen = float(rig.film_voltage(voltage))
    electric = maxwell(specimen, seen**2)
    stress = electric.coefficient * specimen.membrane.area_prestretch**electric.power
    strain = float(np.real(stress)) / stiffness
    if 0 < strain < _LEAST_STRAIN:
        words = (f"{voltage:.4g} V hardly strains this film (Maxwell stress {strain:.0e} of its "
                 "stiffness)")
        meant = strain * 1e6 >= _SEEN
        doubts.append(words + f': was "{voltage:.4g} kV" meant?' * meant)
    return doubts


def _carried(bias: Bias, far: float) -> float:
    """Largest force of a mechanism [N] on a plate that moves so far [m], either way."""
    if isinstance(bias, JoinedFilm):
        return _MOST_WEIGHT * _stiffness(bias.specimen)[1]
    forces = [abs(np.real(bias.derivatives(at)[1])) for at in np.linspace(-far, far, _PLACES)]
    return float(np.nanmax(forces)) if np.isfinite(forces).any() else np.inf


@lru_cache(maxsize=32)
def _stiffness(specimen: Specimen) -> tuple[float, float]:
    """Stiffness of the mounted film [Pa], electrodes included, and round the plate's edge [N]."""
    film = specimen.membrane
    stiffness = float(np.real(equibiaxial_stiffness(film.material, *film.prestretch)))
    stiffness += _EQUIBIAXIAL * specimen.electrode.stiffness
    if not 0 < stiffness < np.inf:  # next to where the law locks or gives way
        stiffness = _EQUIBIAXIAL * float(np.real(small_strain_modulus(film.material)))
    edge = perimeter(specimen.plate.outline) if specimen.plate else 0.0
    return stiffness, float(np.real(stiffness * film.volume_per_area * edge))
