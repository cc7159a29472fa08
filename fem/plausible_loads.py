"""Check for implausible loads: a number without unit is SI, but many people enter grams."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tympan.fem.film.admissibility import equibiaxial_stiffness
from tympan.fem.film.density import maxwell, small_strain_modulus
from tympan.fem.membrane.biases import Bias, JoinedFilm
from tympan.fem.rig import Rig
from tympan.geometry.outlines import area, perimeter
from tympan.geometry.specimen import Specimen

#: Largest plausible weight over the film's stiffness round the plate's edge. Films tear at some six
#: times their mounted length, where they carry about their stiffness. Usual loads are a tenth of
#: that. The same number in kilograms is then a hundred times too large.
_MOST_WEIGHT = 10.0

#: Least plausible Maxwell stress over stiffness. At this value a thousand times the voltage gives
#: ten times the stiffness, more than any film bears.
_LEAST_STRAIN = 1e-5

#: Least Maxwell stress over stiffness that has a visible effect on a deflection.
_SEEN = 1e-4

#: Number of deflections at which the force of a mechanism is evaluated. The largest force of a
#: steep mechanism may be missed, but implausible loads are far larger.
_PLACES = 41

#: Equibiaxial stiffness of a neo-Hookean electrode over its modulus.
_EQUIBIAXIAL = 6.0


def implausible_loads(specimen: Specimen, rig: Rig, mass: float, voltage: float) -> list[str]:
    """List likely intended values of an implausible mass [kg] or nominal voltage [V].

    Each entry is a sentence; the list is usually empty. The check uses only what the loads do to
    the film. Of several voltages the highest is checked. The forces that springs and other
    mechanisms carry are added to what the film can carry. A film whose law has no stiffness, such
    as the paper's Eq. (8), is not checked.
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
        if rig.gas_pressure:  # an area takes as long as 100 checks
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
    """Find the largest force of a mechanism [N] on a plate within ± a deflection [m]."""
    if isinstance(bias, JoinedFilm):
        return _MOST_WEIGHT * _stiffness(bias.specimen)[1]
    forces = [abs(np.real(bias.derivatives(at)[1])) for at in np.linspace(-far, far, _PLACES)]
    return float(np.nanmax(forces)) if np.isfinite(forces).any() else np.inf


@lru_cache(maxsize=32)
def _stiffness(specimen: Specimen) -> tuple[float, float]:
    """Compute the mounted film's stiffness [Pa] and that round the plate's edge [N].

    Both include the electrodes.
    """
    film = specimen.membrane
    stiffness = float(np.real(equibiaxial_stiffness(film.material, *film.prestretch)))
    stiffness += _EQUIBIAXIAL * specimen.electrode.stiffness
    if not 0 < stiffness < np.inf:  # near locking or softening of the law
        stiffness = _EQUIBIAXIAL * float(np.real(small_strain_modulus(film.material)))
    edge = perimeter(specimen.plate.outline) if specimen.plate else 0.0
    return stiffness, float(np.real(stiffness * film.volume_per_area * edge))
