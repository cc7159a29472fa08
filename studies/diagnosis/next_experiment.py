"""Which experiment would tell the rivals apart: the expected Δχ² of each on a menu, by the work.

If one rival is true, new readings will be about what its fit predicts, and another rival, refitted
to old and new ones together, will fit them worse. How much worse is what an experiment is worth for
this pair.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from tympan.studies.data.effort import Effort
from tympan.studies.diagnosis.calibration import with_masses
from tympan.studies.diagnosis.hypothesis import FACTORS, Cause, Hypothesis
from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD
from tympan.studies.diagnosis.inference.posterior import Fit, Posterior
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.reduced.films_at_rest import FilmsAtRest
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.files import words_beside

Array = NDArray[np.float64]

#: What to do and what it tells, in words.
WORDS = words_beside(__file__)

_MINUTE, _HOUR = 60.0, 3600.0
_FORCE = 1e-3

#: How far below the voltage at which any rival pulls in new readings stay, as a share.
_MARGIN = 0.05

_MOST_RIVALS = 5


@dataclass(frozen=True, eq=False)
class Readout:
    """What was read, and the nominal model's fit to it."""

    simulation: Simulation
    table: ReadingTable
    nominal: Fit

    @cached_property
    def states(self) -> States:
        """The states whose displacement was read, each once."""
        states = self.table.compact().states
        states = states[np.isnan(states.heave)]
        keys = np.stack([states.specimen, states.mass, states.voltage, states.elapsed,
                         states.direction], 1)
        return states[np.sort(np.unique(np.nan_to_num(keys), axis=0, return_index=True)[1])]

    @cached_property
    def ramps(self) -> Array:
        """Specimen and mass of each ramp, shape (ramps, 2)."""
        return np.unique(np.stack([self.states.specimen.astype(float), self.states.mass], 1),
                         axis=0)

    def displacements(self, states: States) -> ReadingTable:
        """Displacements to be read, with a noise typical of those that were."""
        sigma = self.table.sigma[self.table.lengths]
        return rows(states, "displacement", float(np.median(sigma)) if len(sigma) else np.nan)

    def new_run(self, specimen: Array, mass: Array, voltage: Array) -> ReadingTable:
        """Displacements in a run of its own, in this order, as fast as the readings so far."""
        states = self.states
        pace = float(np.ptp(np.nan_to_num(states.elapsed))) / max(len(states) - 1, 1)
        direction = np.full(len(specimen), float(np.any(states.direction != 0)))
        return self.displacements(States.of(specimen.astype(np.int64), mass, voltage,
                                            pace * np.arange(float(len(specimen))), direction))

    def shown(self, table: ReadingTable) -> Array:
        """What the nominal model expects."""
        return self.simulation.predict((), self.nominal.unknowns, table)

    def within_reach(self, table: ReadingTable) -> NDArray[np.bool_]:
        """Rows in states that the force laws cover, by the nominal model."""
        stiffness, permittivity = np.exp(self.nominal.unknowns[FACTORS])
        heave, voltage_squared = np.array([
            [law.grid.heave, law.grid.voltage_squared]
            for law in self.simulation.laws])[table.states.specimen].T
        reached = FilmsAtRest(self.simulation, (), self.nominal.unknowns, table.states).heave
        seen = permittivity / stiffness * table.states.voltage**2
        inside = (reached <= heave) & (seen <= voltage_squared)
        return np.asarray(inside[table.state])


@dataclass(frozen=True)
class Experiment:
    """Readings that could be made.

    ``what`` are the words for it, which may hold the largest {mass} and {voltage} of the rows and
    the {time} of the first; ``rows`` makes them, with their noise and no values yet, or None where
    the experiment makes no sense. ``sets_up`` is what it takes besides readings, a field of
    :class:`~tympan.studies.data.effort.Effort`.
    """

    what: str
    rows: Callable[[Readout], ReadingTable | None]
    sets_up: str = ""

    def words(self, table: ReadingTable) -> str:
        """What to do, for those of the rows that remain."""
        return self.what.format(mass=f"{1e3 * table.mass.max():.4g} g",
                                voltage=f"{table.voltage.max() / 1e3:.3g} kV",
                                time=f"{np.nan_to_num(table.states.elapsed).min() / _HOUR:.2g} h")

    def work(self, readout: Readout, table: ReadingTable, effort: Effort) -> float:
        """What those of the rows that remain cost [s]."""
        states = table.compact().states
        runs = np.unique(np.stack([states.specimen, states.mass, states.run], 1), axis=0)
        pause = float(np.nan_to_num(states.elapsed).min()
                      - np.nan_to_num(readout.states.elapsed).max())
        return (len(table) * effort.reading + len(runs) * effort.load
                + len(np.unique(states.specimen)) * effort.specimen
                + (getattr(effort, self.sets_up) if self.sets_up else 0.0)
                + max(pause, 0.0) * effort.waiting)


def _repeated(readout: Readout) -> ReadingTable:
    return readout.displacements(readout.states)


def _between(readout: Readout) -> ReadingTable | None:
    halves = []
    for specimen, mass in readout.ramps:
        ramp = (readout.states.specimen == specimen) & (readout.states.mass == mass)
        voltage = np.unique(readout.states.voltage[ramp])
        halves += [(specimen, mass, half) for half in (voltage[1:] + voltage[:-1]) / 2]
    return readout.new_run(*np.array(halves).T) if halves else None


def _other_mass(readout: Readout, factor: float) -> ReadingTable:
    """Every specimen under ``factor`` times the largest mass, at the voltages it has been at."""
    specimen, voltage = np.unique(np.stack([readout.states.specimen.astype(float),
                                            readout.states.voltage], 1), axis=0).T
    mass = np.full(len(specimen), factor * readout.states.mass.max())
    return readout.new_run(specimen, mass, voltage)


def _higher_voltages(readout: Readout, factor: float, count: int = 5) -> ReadingTable | None:
    """Every ramp continued to ``factor`` times the largest voltage in so many steps."""
    top = float(readout.states.voltage.max())
    if top <= 0:
        return None
    voltage = top * (1 + (factor - 1) * np.arange(1, count + 1) / count)
    specimen, mass = np.repeat(readout.ramps, count, axis=0).T
    return readout.new_run(specimen, mass, np.tile(voltage, len(readout.ramps)))


def _backwards(readout: Readout) -> ReadingTable | None:
    """The run in reverse right after it, where times or ways of the readings are known."""
    states = readout.states
    if not (np.ptp(states.elapsed) > 0 or np.any(states.direction != 0)):
        return None
    return readout.displacements(replace(
        states, elapsed=2 * states.elapsed.max() - states.elapsed, direction=-states.direction))


def _later(readout: Readout, runs: float = 4.0) -> ReadingTable | None:
    """All readings again after a pause of so many runs, an hour at least, where times are known."""
    states = readout.states
    length = float(np.ptp(states.elapsed))
    if not length > 0:
        return None
    pause = max(runs * length, _HOUR)
    return readout.displacements(replace(states, elapsed=states.elapsed + length + pause))


def _capacitance(readout: Readout, share: float = 0.01) -> ReadingTable:
    table = rows(readout.states, "capacitance", 1.0)
    return table.with_sigma(share * np.abs(readout.shown(table)))


def _film_voltage(readout: Readout, share: float = 0.01) -> ReadingTable | None:
    states = readout.states[readout.states.voltage > 0]
    return rows(states, "film_voltage", share * states.voltage) if len(states) else None


def _blocked_force(readout: Readout, share: float = 0.01) -> ReadingTable:
    states = readout.states
    unloaded = readout.displacements(replace(states, voltage=np.zeros(len(states))))
    heave = FilmsAtRest(readout.simulation, (), readout.nominal.unknowns, unloaded.states).heave
    table = rows(replace(states, heave=heave), "force", 1.0)
    return table.with_sigma(np.maximum(share * np.abs(readout.shown(table)), _FORCE))


def _taps(readout: Readout, share: float = 0.01) -> ReadingTable | None:
    if readout.simulation.masses is None:
        return None
    table = rows(readout.states, "frequency", 1.0)
    return table.with_sigma(share * np.abs(readout.shown(table)))


#: What is on offer. Another shape is not: its film's force law would have to be computed.
MENU = (
    Experiment(WORDS["repeated"], _repeated),
    Experiment(WORDS["between"], _between),
    Experiment(WORDS["backwards"], _backwards),
    Experiment(WORDS["later"], _later),
    *(Experiment(WORDS["hang"], partial(_other_mass, factor=factor)) for factor in (0.5, 1.5, 2.0)),
    *(Experiment(WORDS["raise"], partial(_higher_voltages, factor=factor))
      for factor in (1.15, 1.4)),
    Experiment(WORDS["capacitance"], _capacitance, "capacitance"),
    Experiment(WORDS["film_voltage"], _film_voltage, "probe"),
    Experiment(WORDS["blocked_force"], _blocked_force, "force"),
    Experiment(WORDS["taps"], _taps, "tap"),
)


@dataclass(frozen=True)
class Proposal:
    """``what`` to do, and what it would tell.

    ``separates``: the most probable pair of rivals that it tells apart, else the pair it comes
    nearest to telling apart, in words, each without the causes they share; ``expected``: Δχ²
    between these two, whichever of them is true; ``value`` and ``mean``: mean Δχ² over which rival
    is true and which one is told from it, by their probabilities, each pair counted up to where it
    is told beyond doubt, and in full; ``work``: what it costs [s].
    """

    what: str
    separates: tuple[str, str]
    expected: float
    value: float
    mean: float
    work: float

    @property
    def enough(self) -> bool:
        """Whether the pair is told apart at odds of a hundred to one."""
        return self.expected >= TOLD

    @property
    def minutes(self) -> float:
        """What it costs."""
        return self.work / _MINUTE


def propose(simulation: Simulation, judgement: Judgement, causes: Sequence[Cause],
            menu: Sequence[Experiment] = MENU, effort: Effort = Effort(),
            ) -> tuple[tuple[Proposal, ...], str]:
    """All that is possible of a menu, that first which tells most per minute; what to do in words.

    ``causes`` may be wrong: rivals that hold another one are left out.
    """
    if judgement.posterior is None:
        return (), WORDS["nothing_wrong"]
    fits, weights = rivals(judgement.posterior, causes)
    if len(fits) < 2:
        return (), WORDS["one_explanation"]
    readout = Readout(with_masses(simulation), judgement.table, judgement.nominal)
    worths = [_proposal(experiment, readout, fits, weights, effort) for experiment in menu]
    ranked = tuple(sorted(
        (proposal for proposal in worths if proposal), reverse=True,
        key=lambda proposal: (round(proposal.value / proposal.minutes, 6), proposal.mean)))
    return ranked, _sentence(ranked, _apart(fits[0].hypothesis, fits[1].hypothesis))


def rivals(posterior: Posterior, causes: Sequence[Cause]) -> tuple[tuple[Fit, ...], Array]:
    """The most probable explanations, none of which holds another, and their shares.

    What holds another, or is held by it, counts for the more probable of the two.
    """
    credible = {fit.hypothesis for fit in posterior.credible()}
    chosen: list[Fit] = []
    shares: list[float] = []
    for fit, share in zip(posterior.fits, posterior.probabilities.tolist(), strict=True):
        members = set(fit.hypothesis)
        if not members <= set(causes):
            continue
        home = next((number for number, other in enumerate(chosen)
                     if members <= set(other.hypothesis) or members > set(other.hypothesis)), None)
        if home is not None:
            shares[home] += share
        elif len(chosen) < 2 or (len(chosen) < _MOST_RIVALS and fit.hypothesis in credible):
            chosen.append(fit)
            shares.append(share)
    total = np.array(shares)
    return tuple(chosen), total / max(total.sum(), 1e-300)


def _proposal(experiment: Experiment, readout: Readout, fits: Sequence[Fit], weights: Array,
              effort: Effort) -> Proposal | None:
    table = possible(experiment, readout, fits)
    if table is None:
        return None
    distances = expected(readout.simulation, fits, table)
    worst = np.minimum(distances, distances.T)
    # The probability that one rival is true (rows) and another is to be told from it.
    others = np.tile(weights + 1e-9, (len(weights), 1))
    np.fill_diagonal(others, 0.0)
    chance = (weights + 1e-9)[:, None] * others / others.sum(1, keepdims=True)
    able, both = worst >= TOLD, chance + chance.T
    merit = np.where(able, both, 0.0) if able.any() else both * (worst + 1e-9)
    first, second = sorted(map(int, np.unravel_index(np.argmax(merit), worst.shape)))
    return Proposal(experiment.words(table),
                    _apart(fits[first].hypothesis, fits[second].hypothesis),
                    float(worst[first, second]),
                    float(np.sum(chance * np.minimum(distances, SEEN)) / chance.sum()),
                    float(np.sum(chance * distances) / chance.sum()),
                    experiment.work(readout, table, effort))


def possible(experiment: Experiment, readout: Readout, fits: Sequence[Fit]) -> ReadingTable | None:
    """The new rows where the laws reach and every rival has an equilibrium, None without any."""
    table = experiment.rows(readout)
    if table is None:
        return None
    usable = readout.within_reach(table) & np.isfinite(table.sigma)
    voltage = (1 + _MARGIN) * table.states.voltage
    beyond = replace(table, states=replace(table.states, voltage=voltage))
    for fit in fits:
        usable &= np.isfinite(readout.simulation.predict(fit.hypothesis, fit.unknowns, beyond))
    return table[usable] if usable.any() else None


def expected(simulation: Simulation, fits: Sequence[Fit], table: ReadingTable) -> Array:
    """Expected Δχ² of new rows, shape (true rival, other rival).

    What the other one loses, refitted to all rows.
    """
    values, jacobians = [], []
    for fit in fits:
        prediction = Prediction(simulation, fit.hypothesis, fit.unknowns, table)
        values.append(prediction.values)
        jacobians.append(prediction.jacobian)
    losses = np.zeros((len(fits), len(fits)))
    for true, other in permutations(range(len(fits)), 2):
        losses[true, other] = _loss(fits[other], (values[true] - values[other]) / table.sigma,
                                    jacobians[other] / table.sigma[:, None])
    return losses


def _loss(fit: Fit, difference: Array, jacobian: Array) -> float:
    """By how much twice the cost grows when a fit moves to meet rows off its predictions.

    Predictions are taken as linear and the cost of the old rows as a parabola; unknowns stay within
    their bounds.
    """
    scale = fit.deviations
    root = np.linalg.cholesky(fit.precision)
    matrix = np.concatenate([root.T, jacobian]) * scale
    target = np.concatenate([-np.linalg.solve(root, fit.slope), difference])
    low, high = (fit.bounds - fit.unknowns) / scale
    step = np.linalg.lstsq(matrix, target, rcond=None)[0]
    if np.any((step < low) | (step > high)):
        step = lsq_linear(matrix, target, (np.minimum(low, -1e-9), np.maximum(high, 1e-9)),
                          method="bvls").x
    loss = float(np.sum((matrix @ step - target) ** 2) - np.sum(target[: len(step)] ** 2))
    return max(loss, 0.0)


def _apart(first: Hypothesis, second: Hypothesis) -> tuple[str, str]:
    """Two hypotheses without what they share, in words."""
    return (" with ".join(str(cause) for cause in first if cause not in second),
            " with ".join(str(cause) for cause in second if cause not in first))


def _plain(names: str) -> str:
    return names.replace("_", " ")


def _sentence(ranked: Sequence[Proposal], pair: tuple[str, str]) -> str:
    """What to do; and whether the two most probable rivals stay together whatever is done."""
    none = WORDS["none"].format(first=_plain(pair[0]), second=_plain(pair[1]))
    able = [proposal for proposal in ranked if proposal.enough]
    if not able:
        return none
    first, second = able[0].separates
    words = WORDS["best"].format(what=able[0].what, first=_plain(first), second=_plain(second),
                                 minutes=f"{able[0].minutes:.2g}")
    apart = any(proposal.separates == pair for proposal in able)
    return words if apart else f"{words}; {none}"
