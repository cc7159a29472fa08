"""Readings by the axisymmetric equations, with effects written down again: none of the project's
solver is used."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tests.oracles import annulus_modes
from tests.oracles.axisymmetric import (
    EnergyFunction,
    Film,
    Material,
    Ogden,
    RitzExpansion,
    _State,
)
from tympan.base.arrays import Array, Numbers

if TYPE_CHECKING:
    from benchmarks.trials.synthetic_trials import Design, Truth
    from tympan.geometry.specimen import Specimen

_DEGREE, _SMALL = 24, 1e-10


@dataclass(frozen=True, eq=False)
class RoundRamp:
    """A circular film's equilibria on a ramp: ``rows`` of the design, stiffness of film and spring
    [N/m], what swings with the plate under the ramp's mass [kg], and the grease's weight [Pa]."""

    rows: Numbers
    ritz: RitzExpansion
    states: list[_State]
    stiffness: Array
    swinging: float
    weight: float

    @property
    def deflections(self) -> Array:
        """Deflection of each state [m]."""
        return np.array([state.deflection for state in self.states])

    @property
    def frequencies(self) -> Array:
        """Of small deflections about each state [Hz]."""
        return np.asarray(np.sqrt(self.stiffness / self.swinging) / (2 * np.pi))

    def heights(self, number: int, distance: Array) -> Array:
        """What stands at distances from the middle [m] in a state [m]."""
        film, state = self.ritz.film, self.states[number]
        mounted = np.linspace(film.inner, film.outer, 1000)
        shape = self.ritz.profile(state.c, state.deflection, mounted)
        sag = self.weight / film.resultant(state.q**0.5) * annulus_modes.sag(
            film.inner, film.outer, mounted)
        return np.asarray(np.interp(distance, shape.radius, shape.height + sag,
                                    left=state.deflection))


def readings(design: Design, truth: Truth) -> Array | None:
    """Readings of a design of circular specimens [m]; None where a state has no equilibrium."""
    sizes, shown = _sizes(truth), np.empty(len(design.table))
    for ramp in (every := list(round_ramps(design, truth))):
        elapsed = design.table.states.elapsed[ramp.rows]
        shown[ramp.rows] = ((1 + sizes.get("sensor_gain", 0.0)) * ramp.deflections
                            + sizes.get("sensor_zero", 0.0) + sizes.get("drift", 0.0) * elapsed)
    return shown if sum(len(ramp.rows) for ramp in every) == len(shown) else None


def round_ramps(design: Design, truth: Truth) -> Iterator[RoundRamp]:
    """The ramps of a design of circular specimens, up to the first without equilibrium."""
    sizes, states = _sizes(truth), design.table.states
    spring, grease = sizes.get("parallel_spring", 0.0), sizes.get("electrode_mass", 0.0)
    for ramp in design.ramps():
        ritz = _expansion(design.setup.specimens[int(states.specimen[ramp[0]])], truth)
        radii = ritz.film.inner, ritz.film.outer
        mass = float(states.mass[ramp[0]]) + sizes.get("unaccounted_mass", 0.0)
        load = design.setup.rig.gravity * (mass + grease * annulus_modes.lifted_area(*radii))
        solved = equilibria(ritz, load, _seen(states.voltage[ramp], sizes), spring)
        if solved is None:
            return
        swinging = annulus_modes.swinging_mass(*radii, mass + sizes.get("added_mass", 0.0), grease)
        if "air_mass" in sizes:
            swinging += sizes["air_mass"] * annulus_modes.air_volume(*radii)
        yield RoundRamp(ramp, ritz, solved, spring + np.array(
            [state.stiffness for state in solved]), swinging, design.setup.rig.gravity * grease)


def pulled(specimen: Specimen, truth: Truth, voltage: float, shown: Array
           ) -> Array | None:
    """What a tester's gauge shows [N] at displacements that it shows [m], at a voltage [V].

    The plate is where tester and film are in balance. None where that is not found.
    """
    sizes, ritz = _sizes(truth), _expansion(specimen, truth)
    spring, yields = sizes.get("parallel_spring", 0.0), sizes.get("tester_compliance", 0.0)
    q = float(_seen(np.array([voltage]), sizes)[0]) ** 2
    state: _State | None = ritz.flat(0.0)
    read = []
    for at in (shown - sizes.get("displacement_zero", 0.0)).tolist():
        for _ in range(30):
            if state is None:
                return None
            force = state.force + spring * state.deflection
            step = (at - yields * force - state.deflection) / (
                1 + yields * (state.stiffness + spring))
            if abs(step) < _SMALL and state.q == q:
                break
            state = ritz.equilibrium(state.c + state.tangent_w * step, state.deflection + step, q)
        else:
            return None
        if not ritz.resolved(state):
            return None
        read.append((1 + sizes.get("gauge_gain", 0.0)) * force + sizes.get("gauge_zero", 0.0))
    return np.array(read)


def _expansion(specimen: Specimen, truth: Truth) -> RitzExpansion:
    """Of a circular specimen's film."""
    sizes = _sizes(truth)
    lost = any((cause.name, cause.which) == ("prestretch_loss", specimen.name)
               for cause in truth.hypothesis)
    stretch = specimen.membrane.prestretch[0] * (1 - lost * sizes.get("prestretch_loss", 0.0))
    return RitzExpansion(Film(
        specimen.needed_plate().outline.semi_axes[0], specimen.frame.semi_axes[0],
        specimen.membrane.thickness, stretch,
        _material(specimen.membrane.material, truth.stiffness, sizes.get("strain_stiffening"),
                  sizes.get("second_invariant", 0.0), stretch),
        truth.permittivity * specimen.membrane.relative_permittivity,
        sizes.get("permittivity_stretch", 0.0)), _DEGREE)


def _seen(voltage: Array, sizes: dict[str, float]) -> Array:
    """What films see [V]; the size of a sag is 1/U_s²."""
    amplified = (1 + sizes.get("amplifier_gain", 0.0)) * voltage
    return np.asarray(amplified / (1 + voltage**2 * sizes.get("voltage_sag", 0.0)))


def _sizes(truth: Truth) -> dict[str, float]:
    return {cause.name: truth.sizes[number] for number, cause in enumerate(truth.hypothesis)}


def deflections(film: Film, load: float, voltages: Array, spring: float = 0.0) -> Array | None:
    """Deflection at each of rising voltages [V] under a dead load [N] and a spring [N/m]; None past
    pull-in."""
    states = equilibria(RitzExpansion(film, _DEGREE), load, voltages, spring)
    return None if states is None else np.array([state.deflection for state in states])


def equilibria(ritz: RitzExpansion, load: float, voltages: Array, spring: float
               ) -> list[_State] | None:
    """The states of :func:`deflections`."""
    state = ritz.flat(0.0)
    states = []
    for voltage in voltages.tolist():
        at = _balanced(ritz, state, load, spring, voltage**2)
        if at is None or not at.held or at.stiffness + spring <= 0 or not ritz.resolved(at):
            return None
        state = at
        states.append(at)
    return states


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


def _material(law: object, factor: float, exponent: float | None, share: float, stretch: float
              ) -> Material:
    """The nominal Ogden law, stiffer by a factor, with more hardening and a second invariant."""
    mu, alpha = (np.asarray(getattr(law, name)) for name in ("mu", "alpha"))
    nominal: Material = Ogden(tuple((factor * mu).tolist()), tuple(alpha.tolist()))
    if exponent is not None:
        nominal = _hardened(nominal, exponent, stretch)
    return _mooney(nominal, share, stretch) if share else nominal


def _slope(law: Material) -> float:
    """The neo-Hookean slope with the modulus of the virgin film."""
    return float(law.w11(np.ones(1), np.ones(1))[0]) / 8


def _hardened(nominal: Material, exponent: float, stretch: float) -> Material:
    """A law with an exponent more hardening about the mounted film."""
    mounted, slope = 2 * stretch**2 + stretch**-4, _slope(nominal)

    def invariant(l1: Array, l2: Array) -> Array:
        return l1**2 + l2**2 + (l1 * l2) ** -2

    def energy(l1: Array, l2: Array) -> Array:
        i = invariant(l1, l2)
        return nominal.energy(l1, l2) + slope * (mounted / (1 + exponent)
                                                 * (i / mounted) ** (1 + exponent) - i)

    def first(l1: Array, l2: Array) -> Array:
        rate = slope * ((invariant(l1, l2) / mounted) ** exponent - 1)
        return nominal.w1(l1, l2) + rate * 2 * (l1 - l1**-3 * l2**-2)

    return EnergyFunction(energy, first, lambda l1, l2: first(l2, l1))


def _mooney(nominal: Material, share: float, stretch: float) -> Material:
    """A law that gives up a share of its virgin modulus for a second invariant's stress.

    By Ogden's terms with the powers 2 and -2, in whose stress the mounted film has none.
    """
    given_up = 2 * share * _slope(nominal)
    added = Ogden((-given_up, -given_up / stretch**2), (2.0, -2.0))
    return EnergyFunction(
        lambda l1, l2: nominal.energy(l1, l2) + added.energy(l1, l2),
        lambda l1, l2: nominal.w1(l1, l2) + added.w1(l1, l2),
        lambda l1, l2: nominal.w1(l2, l1) + added.w1(l2, l1))
