"""Deflection and tilts of a plate from the capacitances of an electrode's segments.

The capacitances are polynomials of deflection and slopes (y, t_x, t_y), fitted to films whose plate
is held there. Three or more of them give the plate back by least squares, each weighted by its own
size: a bridge has a relative error. A flat film is left out. There the capacitances change with
squares and products of deflection and slopes alone, so that they tell neither of them to first
order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import AnyArray, Array
from tympan.base.fields import Key
from tympan.base.points import drawn_points
from tympan.fem.derivatives.shape import with_plate
from tympan.fem.equilibrium.constraints import held_plate
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.solve import held
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, PlateMotion, State
from tympan.fem.results.segments import segment_capacitances
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, bare_film
from tympan.studies.segments import Driven

#: Number of segments whose capacitances give three numbers.
LEAST = 3
#: Degrees of the polynomials that are tried.
_DEGREES = (2, 3, 4)
#: Number of films that are fitted, twice the coefficients of the highest degree, and of films that
#: test the fit.
_FITTED = 70
_TESTED = 20
#: Number of tested films whose prestretch is changed.
_STRETCHED = 4
#: Relative change of the prestretch whose effect is stated, and the one that is solved.
_PERCENT = 0.01
_STRETCH = 1e-4
#: Lowest deflection over the highest one, if the range begins lower: a flat film has no inverse.
_LOWEST = 0.2
#: Largest slope by default: one that moves the plate's edge by this share of the last deflection.
_LEANING = 0.1
#: Steps of the least squares, and the last step over the range that ends them.
_STEPS = 50
_LAST = 1e-10


@dataclass(frozen=True, kw_only=True)
class PlateSense(Driven):
    """Plate sensed by the capacitances of segments, at one proportion of their voltages.

    The capacitance of segment i is Σ a[i][j] u^p[j][0] v^p[j][1] w^p[j][2] with deflection and
    slopes scaled to -1 to 1 over their ranges.
    """

    segments: Annotated[tuple[str, ...], Key("segments whose capacitances are read")]
    deflection_m: Annotated[tuple[float, float], Key("range of the deflection")]
    tilt_rad: Annotated[float, Key("largest slope along x and y of the range")]
    powers: Annotated[tuple[tuple[int, ...], ...], Key("p: a row for each term")]
    coefficients_F: Annotated[tuple[tuple[float, ...], ...], Key("a: a row for each segment")]
    error_deflection_m: Annotated[float, Key(
        "largest error of the sensed deflection, at films that were not fitted")]
    error_tilt_rad: Annotated[float, Key("the same of the slopes along x and y")]
    noise: Annotated[float, Key("standard deviation of each capacitance, over it")]
    noise_deflection_m: Annotated[float, Key(
        "standard deviation of the sensed deflection by that noise: root of the mean square over "
        "the range")]
    noise_tilt_x_rad: Annotated[float, Key("the same of the slope along x")]
    noise_tilt_y_rad: Annotated[float, Key("the same of the slope along y")]
    per_percent_prestretch_m: Annotated[float | None, Key(
        "how far the sensed deflection is off by a film that is prestretched 1 % more along both "
        "axes, by a derivative: root of the mean square; none where that film is not found")]
    per_percent_prestretch_rad: Annotated[float | None, Key("the same of both slopes")]

    @property
    def _middle(self) -> Array:
        return np.array([sum(self.deflection_m) / 2, 0.0, 0.0])

    @property
    def _half(self) -> Array:
        low, high = self.deflection_m
        return np.array([(high - low) / 2, self.tilt_rad, self.tilt_rad])

    def capacitances(self, places: Any) -> Array:
        """Compute capacitances [F] at deflections and slopes, (n, 3) [m, rad], (n, segments)."""
        scaled = (np.atleast_2d(places) - self._middle) / self._half
        found: Array = _terms(scaled, self.powers) @ np.array(self.coefficients_F).T
        return found

    def sensed(self, capacitances: Any) -> Array:
        """Sense deflection and slopes along x and y [m, rad], (n, 3), from capacitances [F].

        These have the shape (n, segments). A row is nan where they belong to no plate in the range,
        with a tenth of it to spare.
        """
        given = np.atleast_2d(np.asarray(capacitances, dtype=float))
        return np.array([self._middle + self._half * self._solved(each) for each in given])

    def _solved(self, given: Array) -> Array:
        """Find the scaled plate of least squares from capacitances, (3,)."""
        rows = np.array(self.coefficients_F) / given[:, None]
        starts = np.array(list(product((-0.6, 0.0, 0.6), repeat=3)))
        misses = ((_terms(starts, self.powers) @ rows.T - 1) ** 2).sum(axis=1)
        place: Array = starts[int(misses.argmin())]
        for _ in range(_STEPS):
            value = (_terms(place[None], self.powers) @ rows.T)[0] - 1
            slope = np.einsum("ij,jk->ik", rows, _slopes(place, self.powers))
            step = np.linalg.lstsq(slope, -value, rcond=None)[0]
            step *= min(1.0, 0.5 / max(np.abs(step).max(), 1e-300))
            place = place + step
            if np.abs(step).max() < _LAST:
                break
        else:
            return np.full(3, np.nan)
        return place if np.abs(place).max() <= 1.1 else np.full(3, np.nan)

    def by_capacitances(self, places: Array) -> Array:
        """Differentiate sensed deflection and slopes at plates by relative changes of capacitances.

        The shape is (n, 3, segments) [m, rad].
        """
        found = []
        for place in (places - self._middle) / self._half:
            values = _terms(place[None], self.powers) @ np.array(self.coefficients_F).T
            slope = np.array(self.coefficients_F) @ _slopes(place, self.powers) / values.T
            found.append(self._half[:, None] * np.linalg.pinv(slope))
        return np.array(found)


def plate_sense(specimen: Specimen, settings: Settings, loading: Loading, voltage: float,
                across: float, range_m: tuple[float, float], tilt: float | None, noise: float,
                segments: Sequence[str]) -> PlateSense | None:
    """Fit the capacitances of segments by deflection and slopes of the plate.

    ``voltage`` is the nominal one, ``across`` that of the film [V]; ``range_m``: first and last
    deflection. Without a largest ``tilt`` [rad], one is chosen. None if the film cannot be held at
    the range's ends.
    """
    low, high = range_m
    low = max(low, _LOWEST * high)
    outline = specimen.needed_plate().outline
    steepest = _LEANING * high / max(outline.semi_axes) if tilt is None else tilt
    holder = _Holder.of(specimen, settings, loading, across, (low + high) / 2)
    if holder is None:
        return None
    middle = np.array([(low + high) / 2, 0.0, 0.0])
    half = np.array([(high - low) / 2, steepest, steepest])
    numbers = [specimen.electrode.names.index(name) for name in segments]
    scaled = 2 * drawn_points(3, _FITTED + _TESTED, 1) - 1
    found = holder.capacitances(middle + half * scaled)
    if found is None:
        return None
    found = found[:, numbers]
    fitted, tested = slice(0, _FITTED), slice(_FITTED, None)
    plates = middle + half * scaled[tested]
    best, least = None, np.inf
    for degree in _DEGREES:
        powers = tuple(power for power in product(range(degree + 1), repeat=3)
                       if sum(power) <= degree)
        coefficients = np.linalg.lstsq(_terms(scaled[fitted], powers), found[fitted],
                                       rcond=None)[0].T
        made = PlateSense(
            voltage_V=voltage, segment_voltages_V=specimen.electrode.voltages(voltage),
            segments=tuple(segments), deflection_m=(low, high), tilt_rad=steepest, powers=powers,
            coefficients_F=tuple(map(tuple, coefficients.tolist())), error_deflection_m=np.inf,
            error_tilt_rad=np.inf, noise=noise, noise_deflection_m=0.0, noise_tilt_x_rad=0.0,
            noise_tilt_y_rad=0.0, per_percent_prestretch_m=None, per_percent_prestretch_rad=None)
        miss = np.abs(made.sensed(found[tested]) - plates).max(axis=0)
        if np.isfinite(miss).all() and (miss / half).max() < least:
            least = float((miss / half).max())
            best = replace(made, error_deflection_m=float(miss[0]),
                           error_tilt_rad=float(miss[1:].max()))
    if best is None:
        return None
    by = best.by_capacitances(plates)
    spread = np.sqrt(((noise * by) ** 2).sum(axis=2).mean(axis=0)).tolist()
    best = replace(best, noise_deflection_m=spread[0], noise_tilt_x_rad=spread[1],
                   noise_tilt_y_rad=spread[2])
    few = plates[:_STRETCHED]
    more = _stretched(specimen, settings, loading, across, few)
    if more is None:
        return best
    change = more[:, numbers] / best.capacitances(few) - 1
    off = (by[:_STRETCHED] @ change[..., None])[..., 0] * (_PERCENT / _STRETCH)
    return replace(best, per_percent_prestretch_m=float(np.sqrt((off[:, 0] ** 2).mean())),
                   per_percent_prestretch_rad=float(np.sqrt((off[:, 1:] ** 2).mean())))


def _stretched(specimen: Specimen, settings: Settings, loading: Loading, across: float,
               plates: Array) -> Array | None:
    """Compute capacitances of all segments of a film that is prestretched a little more [F]."""
    film = specimen.membrane
    first, second = film.prestretch
    more = replace(specimen, membrane=replace(film, prestretch=(
        first * (1 + _STRETCH), second * (1 + _STRETCH))))
    holder = _Holder.of(more, settings, loading, across, float(plates[:, 0].mean()))
    return None if holder is None else holder.capacitances(plates)


@dataclass(frozen=True, eq=False)
class _Holder:
    """A film whose plate is held at deflections and slopes, under a film voltage."""

    model: Model
    begin: State

    @classmethod
    def of(cls, specimen: Specimen, settings: Settings, loading: Loading, across: float,
           deflection: float) -> _Holder | None:
        """Hold the plate level at a deflection [m]; None where that is not found."""
        # A plate that does not tilt by itself still shifts and turns about its normal.
        level = replace(loading, biases=(), guide="level")
        model = replace(bare_film(specimen, settings, frozenset()), loading=level)
        outcome = held(model, deflection, 0.0, None, settings.path)
        if outcome.status == "equilibrium" and across:
            outcome = held(model, deflection, across, outcome.solution, settings.path)
        return cls(model, outcome.state) if outcome.status == "equilibrium" else None

    def capacitances(self, places: Array) -> Array | None:
        """Compute the capacitances of all segments at deflections and slopes, (n, segments) [F].

        None if a plate cannot be held at one of these.
        """
        known = [(np.array([self.begin.plate.deflection, 0.0, 0.0]), self.begin)]
        scale = np.ptp(places, axis=0) + 1e-300
        for place in places:
            _, near = min(known, key=lambda each: float(
                (((each[0] - place) / scale) ** 2).sum()))
            state = self._held(near, place)
            if state is None:
                return None
            known.append((place, state))
        return segment_capacitances(self.model, [state for _, state in known[1:]])

    def _held(self, near: State, place: Array) -> State | None:
        mesh = self.model.discretisation
        plate = tilted(*place.tolist())
        plate = replace(plate, translation=np.array([*near.plate.translation[:2], place[0]]))
        start = plate.positions(self.model.centre, self.model.arms)
        change = start - near.positions[mesh.plate_nodes]
        every = np.column_stack([with_plate(mesh, change[:, :2]),
                                 with_plate(mesh, change[:, [HEAVE, HEAVE]])[:, 0]])
        moved = replace(near, positions=near.positions + every, plate=plate)
        solution = newton(self.model, moved, ("force",), (held_plate(float(place[0])),))
        return solution.state if solution.converged else None


def tilted(deflection: float, slope_x: float, slope_y: float) -> PlateMotion:
    """Move a plate to a deflection [m] and to slopes along x and y [rad].

    Examples
    --------
    >>> tilted(0.001, 0.02, -0.01).slope.round(12).tolist()
    [0.02, -0.01]
    """
    sines = np.sin([slope_x, slope_y])
    sine = float(np.hypot(*sines))
    angle = float(np.arcsin(sine)) / sine if sine else 1.0
    turn = angle * np.array([sines[1], -sines[0]])
    return PlateMotion.rest().moved(np.array([0.0, 0.0, deflection, *turn, 0.0]))


def _terms(scaled: AnyArray, powers: Sequence[Sequence[int]]) -> Array:
    """Evaluate the products of powers, (n, terms)."""
    return np.asarray(np.prod(scaled[:, None, :] ** np.array(powers), axis=2))


def _slopes(place: Array, powers: Sequence[Sequence[int]]) -> Array:
    """Differentiate the products at one place by its three numbers, (terms, 3)."""
    exponents = np.array(powers)
    columns = []
    for axis in range(3):
        lower = exponents.copy()
        lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
        columns.append(exponents[:, axis] * np.prod(place ** lower, axis=1))
    return np.column_stack(columns)
