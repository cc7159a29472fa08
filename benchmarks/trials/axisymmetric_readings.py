"""Readings by the axisymmetric equations, with effects written down again: none of the project's
solver is used."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tests.oracles.axisymmetric import (
    EnergyFunction,
    Film,
    FloatArray,
    Material,
    Ogden,
    RitzExpansion,
    _State,
)

if TYPE_CHECKING:
    from benchmarks.trials.synthetic_trials import Design, Truth

_DEGREE, _SMALL = 24, 1e-10


def readings(design: Design, truth: Truth) -> FloatArray | None:
    """Readings of a design of circular specimens [m]; None where a state has no equilibrium."""
    sizes = {cause.name: truth.sizes[number] for number, cause in enumerate(truth.hypothesis)}
    which = {cause.name: cause.which for cause in truth.hypothesis}
    states = design.table.states
    shown = np.empty(len(design.table))
    for ramp in design.ramps():
        specimen = design.setup.specimens[int(states.specimen[ramp[0]])]
        loss = sizes.get("prestretch_loss",
                         0.0) if which.get("prestretch_loss") == specimen.name else 0.0
        law = specimen.membrane.material
        stretch = specimen.membrane.prestretch[0] * (1 - loss)
        film = Film(specimen.plate.outline.semi_axes[0], specimen.frame.semi_axes[0],
                    specimen.membrane.thickness,
                    stretch,
                    _material(law, truth.stiffness, sizes.get("strain_stiffening"), stretch),
                    truth.permittivity * specimen.membrane.relative_permittivity,
                    sizes.get("permittivity_stretch", 0.0))
        voltage = states.voltage[ramp]
        # The size of a sag is 1/U_s².
        seen = (1 + sizes.get("amplifier_gain", 0.0)) * voltage / (1 + voltage**2
                                                                   * sizes.get("voltage_sag", 0.0))
        load = design.setup.rig.gravity * (states.mass[ramp[0]] + sizes.get("unaccounted_mass",
                                                                            0.0))
        heave = heaves(film, float(load), seen, sizes.get("parallel_spring", 0.0))
        if heave is None:
            return None
        shown[ramp] = ((1 + sizes.get("sensor_gain", 0.0)) * heave + sizes.get("sensor_zero", 0.0)
                       + sizes.get("drift", 0.0) * states.elapsed[ramp])
    return shown


def heaves(film: Film, load: float, voltages: FloatArray, spring: float = 0.0) -> FloatArray | None:
    """Deflection at each of rising voltages [V] under a dead load [N] and a spring [N/m]; None past
    pull-in."""
    ritz = RitzExpansion(film, _DEGREE)
    state = ritz.flat(0.0)
    deflections = []
    for voltage in voltages.tolist():
        at = _balanced(ritz, state, load, spring, voltage**2)
        if at is None or not at.held or at.stiffness + spring <= 0 or not ritz.resolved(at):
            return None
        state = at
        deflections.append(at.deflection)
    return np.array(deflections)


def _balanced(ritz: RitzExpansion, state: _State, load: float, spring: float,
              q: float) -> _State | None:
    """Newton's method for the deflection, the film in equilibrium at each; steps of at most a tenth
    of the gap."""
    gap = 0.1 * (ritz.film.outer - ritz.film.inner)
    at = ritz.equilibrium(state.c, state.deflection, q)
    for _ in range(30):
        if at is None:
            return None
        step = (load - spring * at.deflection - at.force) / (at.stiffness + spring)
        if abs(step) < _SMALL:
            return at
        step = float(np.clip(step, -gap, gap))
        at = ritz.equilibrium(at.c + at.tangent_w * step, at.deflection + step, q)
    return None


def _material(law: object, factor: float, exponent: float | None, stretch: float) -> Material:
    """The nominal Ogden law, stiffer by a factor, with an exponent more hardening about the mounted
    film."""
    mu, alpha = (np.asarray(getattr(law, name)) for name in ("mu", "alpha"))
    nominal = Ogden(tuple((factor * mu).tolist()), tuple(alpha.tolist()))
    if exponent is None:
        return nominal
    mounted = 2 * stretch**2 + stretch**-4
    # The neo-Hookean slope with the modulus of the virgin film.
    slope = float(nominal.w11(np.ones(1), np.ones(1))[0]) / 8

    def invariant(l1: FloatArray, l2: FloatArray) -> FloatArray:
        return l1**2 + l2**2 + (l1 * l2) ** -2

    def energy(l1: FloatArray, l2: FloatArray) -> FloatArray:
        i = invariant(l1, l2)
        return nominal.energy(l1, l2) + slope * (mounted / (1 + exponent)
                                                 * (i / mounted) ** (1 + exponent) - i)

    def first(l1: FloatArray, l2: FloatArray) -> FloatArray:
        rate = slope * ((invariant(l1, l2) / mounted) ** exponent - 1)
        return nominal.w1(l1, l2) + rate * 2 * (l1 - l1**-3 * l2**-2)

    return EnergyFunction(energy, first, lambda l1, l2: first(l2, l1))
