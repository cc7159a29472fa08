"""Reduced film of an electrode in segments: any voltages of them, a plate that tilts and slides.

It is made from equilibria under the weight with the segments driven alone, in pairs and together,
and from the states at once after such a change, while some of the branches have not flowed yet. So
the motion in time that it follows needs no run in time. Its error is measured in one, in which all
segments have voltages drawn at random (:func:`error_in_time`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tympan.base.arrays import AnyArray, Array
from tympan.base.errors import VoltageError
from tympan.fem.equilibrium.newton import WORK, Budget, moved, tangent_at
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.memory import Memory
from tympan.fem.membrane.biases import Bias
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import FREEDOMS, HEAVE, State
from tympan.fem.transient.ends import Stopped
from tympan.fem.transient.film_memory import first_memory, virgin_strain
from tympan.fem.transient.integrate import Moment, StepSettings, Transient
from tympan.geometry.specimen import Specimen
from tympan.studies.films.film import FilmLoads, NoBalance, ReducedFilm, arms_of
from tympan.studies.films.motion import ReducedMotion
from tympan.studies.films.reduction import IN_TIME, Reduction, Snapshot, plate_freedoms
from tympan.studies.motion import Trace
from tympan.studies.signals import Pieces

#: Largest number of shapes, the plate's included.
_MOST_SHAPES = 36
#: Part of a deformation that the shapes do not contain, over the largest one.
_MOTION_LEFT_OUT = 5e-4
#: Part of the forces that the points do not reproduce.
_WORK_LEFT_OUT = 1e-3
#: Weight of the plate's equilibria against forces in the choice of points. A film under tension
#: resists tilts so little that points which reproduce forces alone tilt the plate by a tenth.
_BALANCE = 1.0
#: Order of the plate's freedoms among the amplitudes: those that are steered first.
STEERED = tuple(map(FREEDOMS.index, ("z", "rx", "ry")))
_ORDER = (*STEERED, *map(FREEDOMS.index, ("x", "y", "rz")))
#: Amplitude of a freedom, over the largest one, below which the plate is taken to stay still in it.
#: With so small a twist as one freedom more, the choice of points would serve it alone.
_STILL = 3e-3
#: Shares of the supply's voltage at which segments are driven.
_LEVELS = (0.55, 1.0)
#: Number of states from which the plate is pushed in each freedom.
_SWUNG = 4
#: Number of random drives, and of those whose states at once are taken, too.
_DRAWN = 10
_CHANGED = 4
#: Number of levels of the run that measures the error.
LEVELS = 6
#: Seed of random drives and levels; its value is arbitrary.
_SEED = 5
#: Number of times at which the run is compared.
_SAMPLES = 121

Voltages = Mapping[str, float]


@dataclass(frozen=True)
class Level:
    """Voltages of the segments by their names [V], held for a ``duration`` [s]."""

    voltages: Voltages
    duration: float


def segmented_film(model: Model, force: float, supply: float,
                   path: PathSettings = PathSettings()) -> ReducedFilm:
    """Reduce a model under a force [N] for voltages of its segments up to a supply's [V].

    The model must not be mirrored.

    Raises
    ------
    VoltageError
        If the film has no equilibrium with some of its segments at the supply's voltage.
    """
    path = path.bounded(model, followed=True, loads=IN_TIME)
    snapshots = list(_snapshots(model, force, supply, path))
    amplitudes = np.abs([plate_freedoms(model, shot.state.positions
                                        - model.discretisation.reference)
                         for shot in snapshots]).max(0) * arms_of(model.specimen)
    freedoms = tuple(number for number in _ORDER if number in model.plate_freedoms
                     and (number == HEAVE or amplitudes[number] > _STILL * amplitudes.max()))
    snapshots += _swings(snapshots[::max(1, len(snapshots) // _SWUNG)], freedoms, amplitudes)
    return Reduction.of(snapshots, _MOTION_LEFT_OUT, _WORK_LEFT_OUT, _MOST_SHAPES,
                        turning=True, freedoms=freedoms, balance=_BALANCE).film(model)


def _swings(shots: Sequence[Snapshot], freedoms: Sequence[int], amplitudes: Array
            ) -> Iterator[Snapshot]:
    """Push the plate at once in each freedom, as its inertia does, by as much as voltages do.

    Without such shapes a film resists a swing several times as much as it should: voltages move
    the plate in other ways than forces on it do.
    """
    for shot in shots:
        memory = shot.memory or first_memory(shot.model, shot.state)
        flow = memory.step(virgin_strain(shot.model, shot.state), 0.0)
        stiff = replace(shot.model, flow=flow)
        tangent, _ = tangent_at(stiff, shot.state)
        if tangent is None:
            continue
        allowed, none = list(stiff.plate_freedoms), np.zeros(stiff.discretisation.free_count)
        for number in freedoms:
            at = allowed.index(number)
            film, plate = tangent.respond((none, np.eye(len(allowed))[at]))
            far = amplitudes[number] / arms_of(shot.model.specimen)[number] / plate[at]
            yield Snapshot(shot.model, moved(stiff, shot.state, (film, plate), far),
                           memory=memory)


def _snapshots(model: Model, force: float, supply: float, path: PathSettings
               ) -> Iterator[Snapshot]:
    """Solve for equilibria under all drives, and for the states at once after each change."""
    still, _ = driven_model(model, {})
    rest = _at_rest(still, force, 0.0, path)
    yield Snapshot(still, rest)
    old = first_memory(still, rest)
    for drive, changes in drives(model.specimen, supply):
        wired, top = driven_model(model, drive)
        state = _at_rest(wired, force, top, path)
        yield Snapshot(wired, state)
        new = first_memory(wired, state)
        for count in range(len(old.times) if changes else 0):
            yield _at_once(wired, force, rest, top, _mixed(old, new, count))
            yield _at_once(wired, force, state, 0.0, _mixed(new, old, count))


def drives(specimen: Specimen, supply: float) -> list[tuple[Voltages, bool]]:
    """List voltages of segments, and whether the states at once after them are of interest.

    Segments are driven alone, in pairs and all together at several voltages, and at random.
    """
    names = specimen.electrode.names
    sizes = sorted({1, 2, len(names)})
    groups = [(share, group) for share in _LEVELS for size in sizes
              for group in combinations(names, size)]
    regular: list[tuple[Voltages, bool]] = [
        (dict.fromkeys(group, share * supply), share == 1 and len(group) != sizes[1])
        for share, group in groups]
    random = np.random.default_rng(_SEED).uniform(size=(_DRAWN, len(names)))
    drawn = [(dict(zip(names, (supply * np.sqrt(row)).tolist(), strict=True)), number < _CHANGED)
             for number, row in enumerate(random)]
    return [*regular, *drawn]


def driven_model(model: Model, voltages: Voltages) -> tuple[Model, float]:
    """Set the voltages of a model's segments [V]; also the highest of them."""
    electrode, top = model.specimen.electrode.driven(voltages)
    return replace(model, specimen=replace(model.specimen, electrode=electrode)), top


def _at_rest(model: Model, force: float, voltage: float, path: PathSettings) -> State:
    outcome = equilibrium(model, force, voltage, settings=path)
    path.require_work(model.specimen.name)
    if outcome.status != "equilibrium":
        segments = model.specimen.electrode.segments
        named = ", ".join(each.name for each in segments if each.share > 0)
        raise VoltageError("must be lower: the film has no equilibrium with these segments at "
                           f"that voltage and the others at 0 V: {named}", key="supply",
                           given=f"{voltage / 1e3:.5g} kV")
    return outcome.state


def _mixed(old: Memory, new: Memory, flowed: int) -> Memory:
    """Make a memory whose ``flowed`` fastest branches have flowed to a new state."""
    fast = np.argsort(old.times)[:flowed]
    viscous = old.viscous.copy()
    viscous[:, fast] = new.viscous[:, fast]
    return replace(old, viscous=viscous)


def _at_once(model: Model, force: float, state: State, voltage: float, memory: Memory
             ) -> Snapshot:
    """Solve for the state at once after a change of voltages, from a state with a memory."""
    jump = Transient(model, force, _held(voltage, 1.0))
    return Snapshot(model, jump.after_jump(Moment(0.0, state, memory), voltage).state, memory)


def levels(specimen: Specimen, supply: float) -> list[Level]:
    """Draw voltages of the segments, each held for the mean time of the branches."""
    random = np.random.default_rng(_SEED)
    times = [branch.time for branch in specimen.membrane.branches]
    duration = float(np.exp(np.mean(np.log(times)))) / LEVELS
    names = specimen.electrode.names
    return [Level(dict(zip(names, (supply * random.uniform(size=len(names))).tolist(),
                           strict=True)), duration) for _ in range(LEVELS)]


def error_in_time(film: ReducedFilm, model: Model, force: float, run: Sequence[Level]
                  ) -> dict[str, float]:
    """Compute the largest error of deflection and tilts in a run, over the range of each.

    Tilts have one range, the larger. The errors are infinite if a film pulls in.
    """
    try:
        exact = field_run(model, force, run)
        near = reduced_run(film, force, run, model.loading.biases)
    except (NoBalance, Stopped):
        return {"deflection": np.inf, "tilt": np.inf}
    missed, span = np.abs(near - exact).max(0), np.ptp(exact, axis=0)
    return {"deflection": float(missed[0] / span[0]),
            "tilt": float(missed[1:].max() / span[1:].max())}


def error_at_once(film: ReducedFilm, model: Model, force: float, begin: Voltages,
                  changes: Sequence[Voltages]) -> float:
    """Compute the largest error of tilts at once after voltages change, over the largest tilt.

    Tilts by moments on the plate count, too: its inertia moves the film in other ways than voltages
    do. The film has rested at the first voltages. In the time of a quick motion no branch flows,
    and then errors of the points may be larger than at rest. The error is infinite if a film pulls
    in.
    """
    biases, wired, top = model.loading.biases, *film.driven(begin)
    whole, _ = driven_model(model, begin)
    try:
        state = _at_rest(whole, force, top, PathSettings())
        memory, loads = first_memory(whole, state), FilmLoads(force, top**2, biases)
        q = wired.at_rest(loads)
        flow = wired.relaxed(q).step(wired.strain(q), 0.0)
        tilts = []
        for change in changes:
            other, high = film.driven(change)
            plate = _at_once(driven_model(model, change)[0], force, state, high, memory
                             ).state.plate
            after = FilmLoads(force, high**2, biases)
            moved = other.plate(other.carried(q, after, after, flow) - q)[list(STEERED[1:])]
            exact = (plate.slope - state.plate.slope)[::-1] * (1, -1)
            tilts.append((moved, exact))
    except (NoBalance, Stopped):
        return np.inf
    near, exact = np.swapaxes(np.array(tilts), 0, 1)
    moved_by = float(np.abs(near - exact).max() / np.linalg.norm(exact, axis=1).max())
    stiff = replace(whole, flow=memory.step(virgin_strain(whole, state), 0.0))
    tangent, _ = tangent_at(stiff, state)
    if tangent is None:
        return np.inf
    _, stiffness = wired.pull(q, top**2, flow)
    arms = wired.arms[:wired.led]
    near, exact = (_tilts_by_moments(compliance, freedoms) for compliance, freedoms in (
        (np.linalg.inv(stiffness)[:wired.led, :wired.led] / np.outer(arms, arms), wired.freedoms),
        (np.linalg.inv(tangent.plate_stiffness), stiff.plate_freedoms)))
    return max(moved_by, float(np.abs(near - exact).max() / np.abs(exact).max()))


def _tilts_by_moments(compliance: AnyArray, freedoms: Sequence[int]) -> Array:
    """Select tilts by moments [rad/(N m)], (2, 2), from the compliance of a plate's freedoms."""
    tilts = [list(freedoms).index(number) for number in STEERED[1:]]
    return np.asarray(compliance[np.ix_(tilts, tilts)])


def reduced_run(film: ReducedFilm, force: float, run: Sequence[Level],
                biases: tuple[Bias, ...] = ()) -> Array:
    """Move a film from rest through levels; return its deflection and tilts, (times, 3)."""
    quick, moment, parts = film.tabulated, None, []
    for level in run:
        wired, top = quick.driven(level.voltages)
        motion = ReducedMotion(wired, force, _held(top, level.duration), biases,
                               budget=Budget(WORK))
        if moment is None:
            moment = replace(motion, signal=_held(0.0, 1.0)).begin
        loads = replace(moment.loads, voltage_squared=top**2)
        begin = motion.after_jump(replace(moment, time=0.0), loads)
        moments = list(motion.moments(begin))
        time = np.array([each.time for each in moments])
        plates = wired.plate(np.array([each.q for each in moments]))[:, STEERED]
        parts.append(_compared(time, plates))
        moment = moments[-1]
    return np.concatenate(parts)


def field_run(model: Model, force: float, run: Sequence[Level]) -> Array:
    """Move a finite-element film as :func:`reduced_run` does."""
    state = _at_rest(driven_model(model, {})[0], force, 0.0, PathSettings())
    memory, parts = first_memory(model, state), []
    for level in run:
        wired, top = driven_model(model, level.voltages)
        motion = Transient(wired, force, _held(top, level.duration), settings=StepSettings())
        begin = motion.after_jump(Moment(0.0, state, memory), top).state
        moments = list(motion.moments(begin, memory))
        plates = np.array([[plate.deflection, *plate.slope[::-1] * (1, -1)]
                           for plate in (each.state.plate for each in moments)])
        parts.append(_compared(np.array([each.time for each in moments]), plates))
        state, memory = moments[-1].state, moments[-1].memory
    return np.concatenate(parts)


def _compared(time: Array, plates: Array) -> Array:
    """Interpolate the plate's freedoms at evenly spaced times of a level."""
    return Trace(time).at(plates, np.linspace(0.0, time[-1], _SAMPLES))


def _held(voltage: float, duration: float) -> Pieces:
    return Pieces(np.array([0.0, duration]), np.array([voltage, voltage]))
