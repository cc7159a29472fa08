"""Lumped model of a plate with several freedoms on a film with several segments.

With p the plate's freedoms and u_i = U_i² of the segments, the relaxed film has the energy
W(p) − ½ Σ C_i(p) u_i, W and the segments' capacitances C_i polynomials. Each viscous branch is a
spring K_b in series with a damper, of the branch's time τ_b:

M p̈ + D ṗ + ∂W/∂p − ½ Σ u_i ∂C_i/∂p + Σ K_b (p − z_b) = f,   ż_b = (p − z_b)/τ_b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from scipy.signal import StateSpace

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import Failure
from tympan.base.extras import needs
from tympan.base.paths import with_arrays
from tympan.fem.membrane.biases import Bias, acting
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import FREEDOMS
from tympan.geometry.specimen import Specimen
from tympan.studies.films.film import FilmLoads, NoBalance, ReducedFilm

#: The model's names of the plate's freedoms, in its order, with sign and freedom of the film.
NAMES = {"deflection": (1, "z"), "tilt_x": (-1, "ry"), "tilt_y": (1, "rx"), "shift_x": (1, "x"),
         "shift_y": (1, "y"), "twist": (1, "rz")}
#: Freedoms that are read and steered.
STEERED = ("deflection", "tilt_x", "tilt_y")

#: Degrees of the polynomials of energy and capacitance. One more each halves the error.
_DEGREES = (4, 3)
#: States of the film that the polynomials are fitted to; as many again measure the error.
_STATES = 600
#: Deviation of the plate from its equilibrium in these states, over the range of each freedom.
_AWAY = 0.05
#: Number of changes of voltages after which the plate is compared at once, and how far they go,
#: over the supply's U².
_CHANGES = 60
_CHANGED = 0.25
#: Weight of the correction of springs against the errors that it removes.
_LITTLE = 1e-3
#: Seed of the states; its value is arbitrary.
_SEED = 11
#: Newton's corrections of an equilibrium, and the last one over the range of the freedoms.
_CORRECTIONS = 40
_LAST = 1e-12


@dataclass(frozen=True, eq=False)
class SteeredModel:
    """A plate with freedoms of :data:`NAMES`, and segments by name.

    ``force`` on the deflection [N], ``mass`` and ``damping`` matrices, (n, n). A polynomial's terms
    are products of powers of s = (p − ``centre``)/``scale``: ``powers``, (terms, n);
    ``elastic`` [J], (terms,) and ``electric`` [F], (segments, terms), are their coefficients.
    ``times`` [s] and ``springs``, (branches, n, n), are those of the branches. ``error``: largest
    error of a generalised force over its spread, at states that were not fitted.
    """

    specimen: Specimen
    freedoms: tuple[str, ...]
    segments: tuple[str, ...]
    force: float
    mass: Array
    damping: Array
    centre: Array
    scale: Array
    powers: Numbers
    elastic: Array
    electric: Array
    times: Array
    springs: Array
    supply: float
    error: float

    @classmethod
    def of(cls, film: ReducedFilm, plate: RigidPlate, force: float, supply: float,
           damper: float = 0.0, biases: tuple[Bias, ...] = ()) -> SteeredModel:
        """Fit the model to a film under a force [N] with voltages up to a supply's [V].

        ``damper`` on the deflection [N s/m]. ``biases``: mechanisms on the plate, whose energy is
        part of the elastic one.
        """
        freedoms = tuple(name for name, (_, of) in NAMES.items()
                         if FREEDOMS.index(of) in film.freedoms)
        to_film = _turned(film, freedoms)
        held = FilmLoads(force, supply**2, biases)
        states = [_states(film, held, seed) for seed in (_SEED, _SEED + 1)]
        places = states[0].q[:, :film.led] @ np.linalg.inv(to_film).T
        centre, scale = places.mean(0), np.ptp(places, axis=0) / 2
        powers = powers_of(len(freedoms), _DEGREES[0])
        blank = cls(film.specimen, freedoms, film.specimen.electrode.names, force,
                    to_film.T @ film.inertia(plate) @ to_film,
                    np.diag([damper, *[0.0] * (len(freedoms) - 1)]), centre, scale, powers,
                    np.zeros(len(powers)),
                    np.zeros((len(film.specimen.electrode.names), len(powers))),
                    *_branches(film, held, to_film), supply, 0.0)
        fitted = blank._fitted(states[0], to_film)
        fitted = replace(fitted, springs=_as_at_once(fitted, film, held, to_film))
        return replace(fitted, error=fitted._missed(states[1], to_film))

    @property
    def count(self) -> int:
        """Number of the plate's freedoms."""
        return len(self.freedoms)

    @property
    def size(self) -> int:
        """Number of components of a state: p, its speed, z of each branch."""
        return self.count * (2 + len(self.times))

    @property
    def states(self) -> list[str]:
        """Names of the components of a state."""
        branches = range(1, len(self.times) + 1)
        return [*self.freedoms, *(f"{name}_speed" for name in self.freedoms),
                *(f"{name}_branch_{branch}" for branch in branches for name in self.freedoms)]

    @cached_property
    def steered(self) -> list[int]:
        """Numbers of the freedoms that are steered."""
        return [number for number, name in enumerate(self.freedoms) if name in STEERED]

    def terms(self, p: Any) -> tuple[Array, Array, Array]:
        """Compute terms and their derivatives by p: (terms,), (n, terms), (n, n, terms)."""
        s, count = (np.asarray(p) - self.centre) / self.scale, self.count
        highest = int(self.powers.max())
        power = s[:, None] ** np.arange(highest + 1)
        order = np.arange(highest + 1)
        slope = np.zeros_like(power)
        slope[:, 1:] = order[1:] * power[:, :-1]
        bend = np.zeros_like(power)
        bend[:, 2:] = order[2:] * order[1:-1] * power[:, :-2]
        at = np.arange(count), self.powers
        parts = np.stack([power[at], slope[at] / self.scale, bend[at] / self.scale**2])
        first = np.empty((count, len(self.powers)))
        second = np.empty((count, count, len(self.powers)))
        for i in range(count):
            kinds = np.zeros(count, dtype=int)
            kinds[i] = 1
            first[i] = parts[kinds, :, np.arange(count)].prod(0)
            for j in range(count):
                kinds[:] = 0
                kinds[i] += 1
                kinds[j] += 1
                second[i, j] = parts[kinds, :, np.arange(count)].prod(0)
        return parts[0].prod(1), first, second

    def pull(self, p: Any, u: Any) -> tuple[Array, Array, Array]:
        """Compute the relaxed film's forces against p less the load, by p, and by u."""
        _, first, second = self.terms(p)
        both = self.elastic - np.asarray(u) @ self.electric / 2
        load = self.force * (np.arange(self.count) == 0)
        return first @ both - load, second @ both, -(first @ self.electric.T) / 2

    def springs_over(self, duration: float) -> tuple[Array, Array]:
        """Compute what is left of each branch's stretch after a time, and their stiffness then.

        The plate stays still from the start of the time [s]; shapes (branches,) and (n, n).
        """
        left = np.exp(-duration / self.times)
        return left, np.einsum("b,bij->ij", left, self.springs)

    def capacitances(self, p: Any) -> Array:
        """Compute the segments' capacitances [F], (segments,)."""
        return np.asarray(self.electric @ self.terms(p)[0])

    def rest(self, u: Any, start: Any = None) -> Array:
        """Solve for the stable equilibrium p at squares of voltages [V²], by default from 0 on.

        Raises
        ------
        Failure
            Where there is none.
        """
        parts = (1.0,) if start is not None else (0.0, 0.5, 1.0)
        p = self.centre if start is None else np.asarray(start)
        for part in parts:
            for _ in range(_CORRECTIONS):
                pull, stiffness, _ = self.pull(p, part * np.asarray(u))
                change = np.linalg.solve(stiffness, pull)
                size = np.abs(change / self.scale).max()
                p = p - change / max(1.0, size)
                if size < _LAST:
                    break
            else:
                raise Failure("the lumped model has no equilibrium at such voltages")
        return p

    def resting(self, u: Any) -> Array:
        """Make the state at rest at squares of voltages [V²]."""
        p = self.rest(u)
        return np.concatenate([p, 0 * p, np.tile(p, len(self.times))])

    def rates(self, x: Array, u: Any) -> Array:
        """Compute the time derivative of a state, (size,)."""
        return self._linear(x, u)[0]

    def _linear(self, x: Array, u: Any) -> tuple[Array, Array, Array]:
        """Compute the time derivative of a state and its derivatives by state and u."""
        n, branches = self.count, len(self.times)
        p, speed, flowed = x[:n], x[n:2 * n], x[2 * n:].reshape(branches, n)
        pull, stiffness, by_u = self.pull(p, u)
        behind = p - flowed
        pull = pull + np.einsum("bij,bj->i", self.springs, behind)
        rates = np.concatenate([speed, -np.linalg.solve(self.mass, pull + self.damping @ speed),
                                (behind / self.times[:, None]).ravel()])
        a, b = np.zeros((self.size, self.size)), np.zeros((self.size, len(self.segments)))
        a[:n, n:2 * n] = np.eye(n)
        moved = [stiffness + self.springs.sum(0), self.damping, *-self.springs]
        a[n:2 * n] = -np.linalg.solve(self.mass, np.hstack(moved))
        for branch, time in enumerate(self.times):
            rows = slice((2 + branch) * n, (3 + branch) * n)
            a[rows, :n], a[rows, rows] = np.eye(n) / time, -np.eye(n) / time
        b[n:2 * n] = -np.linalg.solve(self.mass, by_u)
        return rates, a, b

    def linearise(self, u: Any) -> SteeredLinear:
        """Linearise about the equilibrium at squares of voltages [V²]; exact derivatives."""
        x = self.resting(u)
        _, a, b = self._linear(x, u)
        c = np.eye(self.size)[self.steered]
        names = [f"U2_{name}" for name in self.segments]
        outputs = [self.freedoms[number] for number in self.steered]
        return SteeredLinear(a, b, c, np.zeros((len(c), len(names))), x[:self.count],
                             np.asarray(u, float), tuple(self.states), tuple(names),
                             tuple(outputs))

    def _fitted(self, states: _States, to_film: Array) -> SteeredModel:
        """Fit the polynomials to forces at states by least squares, each freedom by its spread."""
        places, forces = self._places(states, to_film), states.pull @ to_film
        weights = 1 / forces.std(axis=0)
        total = self.powers.sum(1)
        bent, stored = total > 0, (total > 0) & (total <= _DEGREES[1])
        rows = []
        for p, u in zip(places, states.squared, strict=True):
            first = self.terms(p)[1] * weights[:, None]
            rows.append(np.hstack([first[:, bent], *(-each / 2 * first[:, stored] for each in u)]))
        matrix = np.concatenate(rows)
        sizes = np.linalg.norm(matrix, axis=0)
        found = np.linalg.lstsq(matrix / sizes, (forces * weights).ravel())[0] / sizes
        elastic, electric = np.zeros(len(total)), np.zeros((len(self.segments), len(total)))
        elastic[bent] = found[:bent.sum()]
        electric[:, stored] = found[bent.sum():].reshape(len(electric), -1)
        # The forces leave out the capacitance where the plate is in the middle.
        stated = np.array([electric @ self.terms(p)[0] for p in places])
        electric[:, total == 0] = (states.capacitance - stated).mean(0)[:, None]
        return replace(self, elastic=elastic, electric=electric)

    def _missed(self, states: _States, to_film: Array) -> float:
        """Compute the largest error of forces at states, over the spread of each freedom's."""
        forces, load = states.pull @ to_film, self.force * np.eye(self.count)[0]
        made = np.array([self.pull(p, u)[0] + load for p, u in zip(
            self._places(states, to_film), states.squared, strict=True)])
        return float((np.abs(made - forces).max(0) / forces.std(axis=0)).max())

    def _places(self, states: _States, to_film: Array) -> Array:
        return np.asarray(states.q[:, :self.count] @ np.linalg.inv(to_film).T)


@dataclass(frozen=True, eq=False)
class SteeredLinear:
    """Small motions about an equilibrium: x' = A x + B u, y = C x + D u, with names.

    ``rest``: the plate's freedoms there; ``squared``: U² of the segments [V²], the inputs u.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    rest: Array
    squared: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def gain(self) -> Array:
        """Outputs at rest per U², (outputs, segments)."""
        return np.asarray(-self.c @ np.linalg.solve(self.a, self.b))

    def to_control(self) -> Any:
        """Convert it to a python-control ``StateSpace``, if python-control is installed."""
        needs("control", "a state-space object of python-control")
        import control

        return control.ss(self.a, self.b, self.c, self.d, inputs=list(self.inputs),
                          outputs=list(self.outputs), states=list(self.states))

    def to_scipy(self) -> StateSpace:
        """Convert it to a ``scipy.signal.StateSpace``."""
        return StateSpace(self.a, self.b, self.c, self.d)


@dataclass(frozen=True, eq=False)
class _States:
    """States of a film with held plates: q, U² of segments, forces on the plate, capacitances."""

    q: Array
    squared: Array
    pull: Array
    capacitance: Array


def _turned(film: ReducedFilm, freedoms: Sequence[str]) -> Array:
    """Make the matrix from the model's freedoms to the film's amplitudes of the plate."""
    matrix = np.zeros((film.led, len(freedoms)))
    for column, (sign, of) in enumerate(NAMES[name] for name in freedoms):
        row = film.freedoms.index(FREEDOMS.index(of))
        matrix[row, column] = sign * film.arms[row]
    return matrix


def _shared(film: ReducedFilm, squared: Array, supply: float) -> ReducedFilm:
    """Give each of several runs its voltages, as shares of the supply's; ``squared`` (runs, k)."""
    specimen = with_arrays(film.specimen, {
        f"electrode.segments.{number}.share": np.sqrt(each)[:, None] / supply
        for number, each in enumerate(squared.T)})
    return replace(film, specimen=specimen, table=None)


def _states(film: ReducedFilm, held: FilmLoads, seed: int) -> _States:
    """Hold the plate near random equilibria, under other random voltages.

    ``held``: the loads with the supply's U².
    """
    supply = float(np.sqrt(held.voltage_squared))
    random, count = np.random.default_rng(seed), len(film.specimen.electrode.segments)
    first, squared = supply**2 * random.uniform(size=(2, _STATES, count))
    squared[:count] = supply**2 * np.eye(count)  # a segment alone
    loads = FilmLoads(np.full(_STATES, held.force), np.full(_STATES, supply**2), held.biases)
    try:
        q = _shared(film, first, supply).at_rest(loads)
    except NoBalance:
        raise Failure("the film has no equilibrium at random voltages up to the supply's: choose "
                      "a lower one") from None
    led = film.led
    q[:, :led] += _AWAY * np.ptp(q[:, :led], axis=0) * random.normal(size=(_STATES, led))
    wired = _shared(film, squared, supply)
    q = wired.balanced(q, loads, clamped=led, last=1e-7)
    pull = wired.pull(q, loads.voltage_squared)[0][:, :led]
    pull[:, 0] += acting(held.biases, q[:, 0])[1]
    alone = [_shared(film, supply**2 * np.eye(count)[[number] * _STATES], supply).capacitance(
        q, loads.voltage_squared) for number in range(count)]
    return _States(q, squared, pull, np.array(alone).T)


def _branches(film: ReducedFilm, held: FilmLoads, to_film: Array) -> tuple[Array, Array]:
    """Find times and springs of the branches about the middle of the supply.

    Together the springs stiffen the plate as the branches do at once; each has the share of its
    modulus.
    """
    branches = film.specimen.membrane.branches
    count = len(film.specimen.electrode.segments)
    squared = held.voltage_squared
    middle = _shared(film, np.full((1, count), squared / 2), float(np.sqrt(squared)))
    q = middle.at_rest(FilmLoads(np.array([held.force]), np.array([squared]), held.biases))
    flow = middle.relaxed(q).step(middle.strain(q), 0.0)
    firm, soft = (_condensed(middle.pull(q, squared, each)[1][0], film.led)
                  for each in (flow, None))
    moduli = np.array([branch.modulus for branch in branches])
    stiffer = to_film.T @ (firm - soft) @ to_film
    return (np.array([branch.time for branch in branches]),
            np.multiply.outer(moduli / moduli.sum(), (stiffer + stiffer.T) / 2))


def _as_at_once(model: SteeredModel, film: ReducedFilm, held: FilmLoads, to_film: Array) -> Array:
    """Correct the springs of the branches so that voltages move the plate at once as on the film.

    Few points stand for a film. How stiff they are against slides and tilts is much less exact than
    how far voltages move the plate, for which they were chosen. The correction is symmetric, and
    the least that makes the errors of the places small. Each branch keeps its share.
    """
    count, number = model.count, len(model.segments)
    random, most = np.random.default_rng(_SEED), held.voltage_squared
    squared = most * (0.5 + _CHANGED * random.uniform(-1, 1, size=(_CHANGES, number)))
    supply = float(np.sqrt(most))
    loads = FilmLoads(np.full(_CHANGES, held.force), np.full(_CHANGES, most), held.biases)
    middle = _shared(film, np.full((_CHANGES, number), most / 2), supply)
    q = middle.at_rest(loads)
    flow = middle.relaxed(q).step(middle.strain(q), 0.0)
    moved = _shared(film, squared, supply).carried(q, loads, loads, flow)
    back = np.linalg.inv(to_film).T
    start, places = (np.asarray(each[:, :count] @ back) for each in (q, moved))
    still, stiffness, _ = model.pull(start[0], np.full(number, most / 2))
    springs = model.springs.sum(0)
    shares = model.springs[:, :1, :1] / springs[0, 0]
    forces = np.array([model.pull(p, u)[0] - still for p, u in zip(places, squared, strict=True)])
    away = places - start
    # Errors of places over their ranges, by each entry of a symmetric correction over its size.
    compliance = np.linalg.inv(stiffness + springs) / model.scale[:, None]
    sizes = np.sqrt(np.outer(stiffness.diagonal(), stiffness.diagonal()))
    pairs = [(i, j) for i in range(count) for j in range(i, count)]
    unit = np.zeros((len(pairs), count, count))
    for each, (i, j) in zip(unit, pairs, strict=True):
        each[i, j] = each[j, i] = sizes[i, j]
    matrix = np.einsum("ki,cij,nj->nkc", compliance, unit, away).reshape(-1, len(pairs))
    missed = ((forces + away @ springs) @ compliance.T).ravel()
    least = _LITTLE * np.linalg.norm(matrix)
    found = np.linalg.lstsq(np.vstack([matrix, least * np.eye(len(pairs))]),
                            np.append(-missed, np.zeros(len(pairs))))[0]
    return np.asarray(shares * (springs + np.einsum("c,cij->ij", found, unit)))


def _condensed(stiffness: Array, led: int) -> Array:
    inner = np.linalg.solve(stiffness[led:, led:], stiffness[led:, :led])
    return np.asarray(stiffness[:led, :led] - stiffness[:led, led:] @ inner)


def powers_of(count: int, degree: int) -> Numbers:
    """List the powers of all terms of some variables up to a total degree, (terms, variables)."""
    chosen = [factors for total in range(degree + 1)
              for factors in combinations_with_replacement(range(count), total)]
    return np.array([[factors.count(number) for number in range(count)] for factors in chosen])
