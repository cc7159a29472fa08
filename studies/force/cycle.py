"""A load on a film's force-displacement curves: equilibria, stroke, work, electrical energy.

From one voltage to another under a load, the film's potential Π at constant voltage changes by dΠ =
F dw − Q dU. All energies are therefore differences between states. The stored energy is S = Π + U
Q. With the plate held the supply gives ΔS; at a constant voltage it gives U ΔQ.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.equilibrium.held_path import HeldInterval, crossings
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.membrane.biases import Bias, acting
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.firmness import least_firmness
from tympan.fem.rig import Loads
from tympan.fem.transient.energy import load_work
from tympan.studies.force.follow import FollowedForce, at_displacement, near
from tympan.studies.force.result import Crossing, LoadLine

#: Largest distance of a crossing from the interval in which the curve's cubic has it, relative to
#: the interval: users choose a curve's displacements, which may be far apart.
_FAR = 1.0


@dataclass(frozen=True, eq=False)
class _Equilibrium:
    """A film under a load at a voltage: the point where its curve crosses the load line."""

    curve: FollowedForce
    solution: Solution
    stable: bool

    @property
    def displacement(self) -> float:
        return self.curve.model.deflection(self.solution.state)


@dataclass(frozen=True)
class PlateLoad:
    """Mechanisms between plate and ground, and a weight [N].

    The weight of many films is an array.
    """

    biases: tuple[Bias, ...]
    weight: Any

    def pull(self, displacement: Array) -> tuple[Array, Array]:
        """Compute the force on the film at displacements [N], and its slope [N/m]."""
        _, push, stiffness = acting(self.biases, displacement)
        return self.weight - push, -stiffness

    def work(self, start: Any, end: Any) -> Any:
        """Compute the work on the film between two displacements [J]."""
        before, after = (acting(self.biases, np.asarray(place, dtype=float))[0]
                         for place in (start, end))
        return self.weight * (end - start) - (after - before)


def load_line(loading: Loading, loads: Loads, mass: float, curves: Sequence[FollowedForce],
              displacements: Sequence[float], settings: PathSettings) -> LoadLine:
    """Find the equilibria of a mass [kg] on a rig, and the cycle from the first to the last curve.

    The line is evaluated at displacements [m], as far as the mechanisms have a force. ``loading``
    includes all mechanisms between plate and ground; the models of the curves include none.
    """
    area = curves[0].model.plate_area
    load = PlateLoad(loading.biases, float(loads.force(mass, area)))
    found = [_equilibria(replace(curve.model, loading=loading), load, curve, settings)
             for curve in curves]
    reached = _reached(load, curves, found)
    names = dict.fromkeys(bias.law.replace("_", " ") for bias in load.biases)
    words = ([f"{1e3 * mass:g} g"] if mass or not names else []) + list(names)
    where = np.array(displacements)
    pull = load.pull(where)[0]
    line = LoadLine(
        load=" and ".join(words), mass_kg=mass,
        displacement_m=tuple(where[np.isfinite(pull)].tolist()),
        force_N=tuple(pull[np.isfinite(pull)].tolist()), crossings=tuple(
        Crossing(voltage_V=each.curve.voltage, segment_voltages_V=each.curve.segment_voltages,
                 displacement_m=each.displacement,
                 force_N=float(load.pull(np.array([each.displacement]))[0][0]),
                 stable=each.stable, reached=each is there)
        for several, there in zip(found, reached, strict=True) for each in several))
    first, last = reached[0], reached[-1]
    if len(curves) < 2 or first is None or last is None:
        return line
    return _with_cycle(line, load, first, last, _snaps(found, reached), settings)


def _equilibria(model: Model, load: PlateLoad, curve: FollowedForce, settings: PathSettings
                ) -> list[_Equilibrium]:
    """Find the crossings of a curve and a load line, in order of displacement."""
    crossed = crossings(model, _intervals(load, curve), load.weight, settings, _FAR)
    found = [_Equilibrium(curve, solution, _stable(model, solution)) for solution in crossed]
    return sorted(found, key=lambda each: each.displacement)


def _intervals(load: PlateLoad, curve: FollowedForce) -> Iterator[HeldInterval]:
    """Yield the intervals between neighbouring displacements of a curve under a load."""
    where = curve.displacement
    pull, slope = load.pull(where)
    excess, rise = curve.force - pull, np.array(curve.stiffness) - slope
    for number, (low, high) in enumerate(pairwise(where)):
        ends = slice(number, number + 2)
        yield HeldInterval(low, high, excess[ends], rise[ends], partial(near, curve))


def _stable(model: Model, solution: Solution) -> bool:
    """Check whether plate and film are stable under a load."""
    assert solution.tangent is not None
    return solution.tangent.negative == 0 and least_firmness(model, solution.state) > 0


def _reached(load: PlateLoad, curves: Sequence[FollowedForce], found: Sequence[list[_Equilibrium]]
             ) -> list[_Equilibrium | None]:
    """Find the equilibria that a massless plate, flat at first, reaches from curve to curve."""
    place = 0.0
    result: list[_Equilibrium | None] = []
    for curve, several in zip(curves, found, strict=True):
        where = curve.displacement
        there = None
        if len(where) > 1:
            start = float(np.clip(place, where[0], where[-1]))
            excess = float(np.interp(start, where, curve.force - load.pull(where)[0]))
            ahead = [each for each in several
                     if (each.displacement - start) * excess <= 0 or each.displacement == start]
            there = min(ahead, key=lambda each: abs(each.displacement - start), default=None)
        if there is None or not there.stable:
            return [*result, *[None] * (len(curves) - len(result))]
        result.append(there)
        place = there.displacement
    return result


def _snaps(found: Sequence[list[_Equilibrium]], reached: Sequence[_Equilibrium | None]) -> bool:
    """Check whether the plate passes another equilibrium on its way to the next curve."""
    for several, here, after in zip(found, reached, reached[1:], strict=False):
        if here is None or after is None:
            continue
        low, high = sorted((here.displacement, after.displacement))
        if any(each is not here and low < each.displacement < high for each in several):
            return True
    return False


def _with_cycle(line: LoadLine, load: PlateLoad, first: _Equilibrium, last: _Equilibrium,
                snaps: bool, settings: PathSettings) -> LoadLine:
    """Add stroke, work and electrical energy between two equilibria to a load line."""
    start, end = first.displacement, last.displacement
    mass, volume = first.curve.model.mass_and_volume
    work = load.work(start, end)
    line = replace(line, stroke_m=end - start, work_J=abs(work),
                   work_J_per_kg=abs(work) / mass if mass else None,
                   work_J_per_m3=abs(work) / volume)
    others = (at_displacement(last.curve, start, settings),
              at_displacement(first.curve, end, settings))
    if others[0] is None or others[1] is None:
        return line
    corners = [_corner(curve.model, solution.state) for curve, solution in (
        (first.curve, first.solution), (last.curve, others[0]), (last.curve, last.solution),
        (first.curve, others[1]))]
    into, out = map(float, exchanged(corners))
    stroke = corners[2].stored - corners[0].stored - work
    return replace(line, ideal_work_J=into - out, electrical_in_J=into, electrical_out_J=out,
                   coupling=(into - out) / into if into > 0 else None,
                   efficiency=abs(work) / stroke if stroke > 0 and not snaps else None)


@dataclass(frozen=True, eq=False)
class Corner:
    """Energy ``stored`` in a film [J], its ``charge`` [C] and its ``voltage`` [V].

    Each value is an array for many films.
    """

    stored: Any
    charge: Any
    voltage: Any

    @classmethod
    def of(cls, potential: Any, capacitance: Any, voltage: Any) -> Corner:
        """Create from the potential at constant voltage [J] and the capacitance [F]."""
        charge = capacitance * voltage
        return cls(potential + voltage * charge, charge, voltage)


def exchanged(corners: Sequence[Corner]) -> tuple[Any, Any]:
    """Compute the energies [J] that the supply gives and gets back in a cycle.

    The corners are in the order of the cycle: charged, moved, discharged, moved back.
    """
    first, charged, moved, discharged = corners
    given = [charged.stored - first.stored,
             charged.voltage * (moved.charge - charged.charge),
             discharged.stored - moved.stored,
             first.voltage * (first.charge - discharged.charge)]
    return sum(np.maximum(part, 0.0) for part in given), -sum(np.minimum(part, 0.0)
                                                              for part in given)


def _corner(model: Model, state: State) -> Corner:
    """Compute the corner of a cycle at a state, with weight and gas of the film included."""
    alone = state.under(force=0.0)
    _, capacitance, energy = (float(value[0]) for value in model.integrals([alone]))
    voltage = max(state.voltage_squared, 0.0) ** 0.5
    return Corner.of(energy - load_work(model, alone), capacitance, voltage)
