"""Distance of a design from the first end of its film, with derivatives of every kind of end.

At pull-in the voltage is stationary along the branch, so that its derivative needs the critical
mode alone. Where the film gives way in a place, its firmness there is used up: the derivative is
that of the implicit function. Of any other end it is a difference of ends on meshes moved a little.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.complex_step import complex_step
from tympan.fem.derivatives.sensitivity import firmness_left, limit_gradient
from tympan.fem.equilibrium.newton import newton
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.firmness import firmness, spots_at
from tympan.geometry.errors import InputError
from tympan.studies.design.limits.state import DesignState, Evaluation
from tympan.studies.limits.voltages import End, first_end

Array = NDArray[np.float64]

#: Voltage of the end is sought up to this many times the limit: steps rarely lead so far.
_REACH = 1.5

#: Smooth motions in which pull-in of a film kept from wrinkling is sought, fewer than elsewhere: of
#: (4, 14) one was soft by chance on one of two meshes, and the slope 2 % off. The voltage is the
#: same to 2e-5.
_SMOOTH = ((4, 10), (2, 14))

#: Sectors of the full angle around the plate. A film that is the same all around gives way all
#: around at once; as its shape changes it does so first in another place, a few sectors away.
_SECTORS = 16

#: Step of a difference, relative to the length: ends are found to about 1e-6 of their voltage.
_STEP = 1e-3

#: U² of an end [V²], and its derivatives (parameters,), by the number of the c that keeps it.
_Squares = Mapping[int, tuple[float, Array]]


def end_margin(state: DesignState, bound: float) -> Evaluation:
    """Voltage of the film's first end over that applied; c is one less this margin over the bound.

    Found by the search of ``tympan limits`` at the design's load. Each sector around the plate has
    a c of its own, of the place where the film would give way first there. Where the film has no
    end within reach, or cannot be followed to one, the last margin stands, without derivatives.
    """
    sectors, voltage = _sectors(state), state.case.voltage
    c = np.full(int(sectors.max()) + 1, -1.0)
    slopes = np.zeros((len(c), len(state.by)))
    end, followed = _end(state, state.model, state.outcome.state, state.uncharged, bound)
    margin = (followed if end is None else end.voltage_V) / voltage
    if end is None or margin == 0:
        c[0] = 1 - margin / bound
        return Evaluation(margin, c, slopes, None if end is None else end.kind)
    squares = _squares(state, end, sectors)
    if not squares:
        c[0], slopes[0] = 1 - margin / bound, -_differences(state, end, bound) / bound
    for number, (square, by) in squares.items():
        at, rate = _nominal(state, square)
        c[number] = max(1 - at / voltage / bound, -1.0)
        if c[number] > -1:
            slopes[number] = -rate * by / voltage / bound
    return Evaluation(margin, c, slopes, end.kind)


def _end(state: DesignState, model: Model, charged: State, uncharged: State, bound: float
         ) -> tuple[End | None, float]:
    """The first end of a film, from its charged state on if it is not beyond one there."""
    case = replace(state.case, specimen=model.specimen)
    path, most = replace(state.path, smooth=_SMOOTH), _REACH * bound * case.voltage
    end, followed = first_end(case, model, charged, path, most)
    if end is not None and end.stop.event is None:
        end, followed = first_end(case, model, uncharged, path, case.voltage)
    return end, followed


def _nominal(state: DesignState, square: float) -> tuple[float, float]:
    """The nominal voltage of a U² across the film [V²], and its derivative [1/V]."""
    rig, direction = state.case.rig, state.case.direction
    film = float(np.sqrt(max(square, 0.0)))
    at = rig.nominal_voltage(film, direction)
    if not 0 < at < np.inf:
        return at, 0.0
    return at, 1 / (2 * film * float(complex_step(
        lambda voltage: rig.film_voltage(voltage, direction), at)))


def _squares(state: DesignState, end: End, sectors: NDArray[np.int64]) -> _Squares:
    """U² of pull-in, or those at which the film gives way in each sector; none without slopes."""
    model, point, names = end.stop.model, end.stop.point, list(state.by)
    if end.kind == "pull_in":
        try:
            gradient = limit_gradient(model, point, "voltage", state.by)
        except InputError:  # no smooth limit
            return {}
        return {0: (point.state.voltage_squared, np.array([gradient[name] for name in names]))}
    if end.stop.sign is None or not end.stop.sign.local:
        return {}
    margins = firmness(model, point.state)
    first = [int(np.argmin(np.where(sectors == number, margins, np.inf)))
             for number in range(int(sectors.max()) + 1)]
    numbers = [number for number, place in enumerate(first) if np.isfinite(margins[place])]
    spots = spots_at(model, point.state, [first[number] for number in numbers])
    left = dict(zip(numbers, firmness_left(model, point, "voltage", state.by, spots), strict=True))
    gone = left[int(sectors[margins.argmin()])]
    if not gone.by_load < 0:
        return {}
    moving = np.array([-gone.by[name] / gone.by_load for name in names])
    squares = {}
    for number, there in left.items():
        # What is left elsewhere is used up as fast as on the mesh that this one was moved from.
        rate = state.memory.rates.setdefault((end.kind, number), there.by_load)
        rate = rate if rate < 0 else there.by_load
        if rate < 0:
            by = np.array([there.by[name] for name in names])
            squares[number] = (point.state.voltage_squared - there.value / rate,
                               (1 - there.by_load / rate) * moving - by / rate)
    return squares


def _sectors(state: DesignState) -> NDArray[np.int64]:
    """Sectors in which the nodes of every element are, element-major, numbered from 0."""
    if state.memory.sectors is None:
        mesh = state.model.discretisation
        arms = mesh.reference[mesh.connectivity] - state.model.centre
        turns = np.arctan2(arms[..., 1], arms[..., 0]).ravel() / (2 * np.pi)
        numbers = np.floor(_SECTORS * turns) % _SECTORS
        state.memory.sectors = np.unique(numbers, return_inverse=True)[1]
    return state.memory.sectors


def _differences(state: DesignState, end: End, bound: float) -> Array:
    """Derivatives of the margin by differences of ends of the same kind, 0 where there are none."""
    here = end.voltage_V / state.case.voltage

    def margin(name: str, change: float) -> float:
        model, charged = state.by[name].changed(state.model, state.outcome.state, change)
        _, uncharged = state.by[name].changed(state.model, state.uncharged, change)
        solutions = [newton(model, guess, settings=state.path.newton)
                     for guess in (charged, uncharged)]
        if not all(solution.converged for solution in solutions):
            return np.nan
        other, _ = _end(state, model, solutions[0].state, solutions[1].state, bound)
        if other is None or other.kind != end.kind:
            return np.nan
        return other.voltage_V / state.case.voltage

    slopes = []
    for name, parameter in state.by.items():
        step = _STEP * (abs(parameter.value(state.model, state.outcome.state)) or state.model.size)
        ends = [(change, margin(name, change)) for change in (-step, step)]
        kept = [pair for pair in ends if np.isfinite(pair[1])]
        if len(kept) < 2:
            kept.append((0.0, here))
        (low, before), (high, after) = kept if len(kept) == 2 else ((-step, here), (step, here))
        slopes.append((after - before) / (high - low))
    return np.array(slopes)
