"""Readings with an effect hidden in them, made by other means than those a diagnosis fits them
with.

The diagnosis knows films by force laws: elements of order 4 on a coarse mesh, plates held at
deflections, polynomials between. The readings here come from (a) elements of order 3 or 2 on other,
finer meshes under loads, ramp by ramp; (b) the membrane's differential equations
(tests/oracles/axisymmetric.py, nothing of the project in it) for circular specimens; (c) elements
with a film of another material family that makes nearly the stresses of the fitted one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar

import numpy as np
from scipy.optimize import brentq, least_squares

from benchmarks.trials import axisymmetric_readings as hidden_equations
from tympan.base.arrays import Array, Mask, Numbers
from tympan.base.errors import InputError
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.voltage_path import voltage_path
from tympan.fem.film.laws import Gent, MooneyRivlin, stiffened
from tympan.fem.film.library import MATERIALS, load_specimen
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Material, Plate, Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.calibration import with_masses
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis, uses_of
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.reduced.force_law import Grid
from tympan.studies.diagnosis.reduced.sampling import force_laws
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.self_check import sizes_at
from tympan.studies.effects import EFFECTS, Setup, extended
from tympan.studies.effects.effect import EffectFamily, Observable

#: The least and the most.
Span = tuple[float, float]
#: What is read of a truth.
Read = TypeVar("Read")
Means = Literal["elements", "equations", "another law", "form error"]

MASSES, UP = (17.9e-3, 22.45e-3), np.linspace(0.0, 6500.0, 15)
#: Up and down again, in as many readings.
LOOP = np.concatenate([np.linspace(0.0, 6500.0, 8), np.linspace(6500.0, 0.0, 8)[1:]])
NOISE = 20e-6
#: On a rough bench, the share of its usual size at which every effect is there, and the sizes of
#: one that is large over usual ones.
ROUGH, LARGE = 0.3, (3.0, 20.0)
#: Seconds between two readings.
PACE = 60.0
#: Largest deflection and voltage of the fitted force laws.
HEAVE, TOP = 8e-3, 7500.0
#: The meshes readings are made on, one or the other of the first ones; films' shapes on the last.
MESHES = (Settings(MeshSettings(order=3, around_plate=9, growth=0.7, across=0.8)),
          Settings(MeshSettings(order=2, around_plate=18, growth=0.4, across=0.5)),
          Settings(MeshSettings(order=3, around_plate=24, growth=0.35, across=0.35)))
FINEST = len(MESHES) - 1
#: Effects that a circular specimen bears without ceasing to be axisymmetric, as the equations have
#: them.
ROUND = ("permittivity_stretch", "strain_stiffening", "second_invariant", "prestretch_loss",
         "unaccounted_mass", "parallel_spring",
         "voltage_sag", "sensor_gain", "sensor_zero", "drift", "amplifier_gain", "electrode_mass")
#: Causes that nobody can see in readings of the deflection, by dimensional analysis (they are
#: permittivity).
ALIASES = frozenset({"amplifier_gain"})

_ACTUATORS = Path(__file__).parents[2] / "studies" / "shipped"


@dataclass(frozen=True, eq=False)
class Design:
    """What is measured: the nominal setup, the rows to read, and what may be wrong with them."""

    name: str
    setup: Setup
    table: ReadingTable
    causes: tuple[Cause, ...]

    def ramps(self) -> Iterator[Numbers]:
        """Rows of each ramp, in order."""
        states = self.table.states
        for key in dict.fromkeys(zip(states.specimen.tolist(), states.mass.tolist(), strict=True)):
            yield np.flatnonzero((states.specimen == key[0]) & (states.mass == key[1]))

    def simulation(self, workers: int = 1) -> Simulation:
        """The fitted model: force laws of the nominal setup."""
        grids = [Grid(HEAVE, TOP**2, odd=True)] * len(self.setup.specimens)
        return with_masses(Simulation(self.setup, force_laws(self.setup, grids, workers)))

    def only(self, keep: Mask) -> Design:
        """Some of the states."""
        states = self.table.states[keep]
        return replace(self, table=replace(_read(states), order=self.table.order[keep]))

    def between(self) -> Design:
        """The ramps under the first mass, under one in the middle between all instead."""
        first = self.only(self.table.mass == self.table.mass[0])
        middle = np.full(len(first.table.states), float(np.mean(np.unique(self.table.mass))))
        return replace(first, table=replace(
            first.table, states=replace(first.table.states, mass=middle)))

    def after(self, elapsed: float) -> Design:
        """The same readings, all taken so long after the run began [s]."""
        states = replace(self.table.states, elapsed=np.full(len(self.table), elapsed))
        return replace(self, table=replace(self.table, states=states))


def _read(states: States) -> ReadingTable:
    number = np.arange(len(states))
    return rows(states, "displacement", NOISE, order=number, file="static.csv", line=number + 2)


def design(name: str, specimens: Sequence[Specimen], effects: Sequence[str] | None = None,
           voltages: Array = UP) -> Design:
    """Three specimens under two masses, each ramp to 6.5 kV in 15 readings, one ramp after the
    other.

    Effects that need ramps both ways may only be there where there are some.
    """
    setup = Setup(tuple(specimens), Rig())
    numbers, masses, places = (axis.ravel() for axis in np.meshgrid(
        range(len(specimens)), MASSES, range(len(voltages)), indexing="ij"))
    way = np.where(np.arange(len(voltages)) > np.argmax(voltages), -1.0, 1.0)
    elapsed = np.arange(len(numbers)) * PACE
    states = States.of(numbers.astype(int), masses, voltages[places.astype(int)], elapsed,
                       way[places.astype(int)])
    return design_of(name, setup, states, effects)


def design_of(name: str, setup: Setup, states: States, effects: Sequence[str] | None = None
              ) -> Design:
    """Displacements of states, and the effects that ramps like theirs can show."""
    told = {Observable.ELAPSED, *([Observable.DIRECTION] if states.direction.min() < 0 else [])}
    causes = tuple(Cause(name, which) for name in (EFFECTS if effects is None else effects)
                   for which in EFFECTS[name].choices(setup)
                   if EFFECTS[name].shown_by(told))
    return Design(name, setup, _read(states), causes)


def paper(voltages: Array = UP) -> Design:
    """The paper's circle and two ellipses."""
    return design("paper", [load_specimen(_ACTUATORS / f"{name}.toml")
                            for name in ("circular", "elliptical-small", "elliptical-large")],
                  voltages=voltages)


def circles() -> Design:
    """Three circular specimens with other frames and plates, for the axisymmetric equations."""
    nominal = load_specimen(_ACTUATORS / "circular.toml")
    sizes = (("A", 45e-3, 10e-3), ("B", 60e-3, 10e-3), ("C", 45e-3, 15e-3))
    return design("circles",
                  [replace(nominal, name=name, frame=Circle(frame), plate=Plate(Circle(plate)))
                              for name, frame, plate in sizes], ROUND)


@dataclass(frozen=True)
class Sum:
    """Two laws side by side."""

    law: ClassVar[str] = "sum"
    one: Material
    other: Material

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        """Energy and its derivatives."""
        parts = zip(self.one.derivatives(l1, l2), self.other.derivatives(l1, l2), strict=True)
        return tuple(first + second for first, second in parts)


def visited() -> tuple[Array, Array]:
    """Stretches along and around that films reach in these designs."""
    along, around = np.meshgrid(np.linspace(2.1, 2.7, 13), np.linspace(2.05, 2.4, 8))
    return along.ravel(), around.ravel()


def stresses(law: Material) -> Array:
    """Nominal stresses over the stretches visited [Pa]."""
    derivatives = law.derivatives(*visited())
    return np.concatenate([derivatives[1], derivatives[2]])


@lru_cache
def look_alike(nominal: Material) -> tuple[Material, float]:
    """A Gent law with a Mooney term fitted to another law over the stretches visited; its largest
    relative error."""
    wanted = stresses(nominal)

    def law(x: Array) -> Material:
        return Sum(Gent(float(np.exp(x[0])), float(np.exp(x[1]))),
                   MooneyRivlin(0.0, float(1e2 * x[2])))

    fitted = least_squares(lambda x: stresses(law(x)) / wanted - 1,
                           [np.log(18e3), np.log(110.0), 0.0])
    best = law(fitted.x)
    return best, float(np.abs(stresses(best) / wanted - 1).max())


def scaled(law: Material, factor: float) -> Material:
    """A law with all moduli multiplied."""
    if isinstance(law, Sum):
        return Sum(scaled(law.one, factor), scaled(law.other, factor))
    return stiffened.scaled(law, factor)


class Stranger:
    """Something wrong that no effect of the library is. It does nothing; a subclass overrides what
    it does."""

    @property
    def at_fault(self) -> str:
        """The one specimen or column of which something is not as it is written, "" for none."""
        return ""

    @property
    def family(self) -> EffectFamily | None:
        """The family of effects that is as good a name for it, if one is."""
        return None

    def setup(self, setup: Setup) -> Setup:
        """The specimens and the rig as they are."""
        return setup

    def stiffness(self, ramp: int) -> float:
        """Factor on the stiffness of all films during a ramp."""
        return 1.0

    def mass(self, nominal: float) -> float:
        """The mass that is there [kg]."""
        return nominal

    def voltage(self, nominal: float) -> float:
        """The voltage that is there [V]."""
        return nominal

    def film(self, model: Model) -> Model:
        """The film as it is mounted."""
        return model

    def shown(self, reading: Array, states: States) -> Array:
        """What the sensor shows [m]."""
        return reading


NOBODY = Stranger()


@dataclass(frozen=True)
class Truth:
    """What is the case: factors on stiffness and permittivity, effects with their sizes, and by
    which means."""

    stiffness: float = 1.0
    permittivity: float = 1.0
    hypothesis: Hypothesis = ()
    sizes: tuple[float, ...] = ()
    means: Means = "elements"
    mesh: int = 0
    stranger: Stranger = NOBODY

    @property
    def widths(self) -> tuple[float, ...]:
        """How many usual sizes each effect has."""
        sizes, shares = iter(self.sizes), []
        for cause in self.hypothesis:
            parts = [next(sizes) / item.deviation * (not item.spread)
                     for item in cause.effect.parameters]
            shares.append(float(np.linalg.norm(parts)))
        return tuple(shares)

    def of(self, causes: Hypothesis) -> Truth:
        """The same with some of the effects alone."""
        sizes = iter(self.sizes)
        each = {cause: [next(sizes) for _ in cause.effect.parameters] for cause in self.hypothesis}
        return replace(self, hypothesis=causes,
                       sizes=tuple(size for cause in causes for size in each[cause]))

    @property
    def unknowns(self) -> Array:
        """As the fitted model has them."""
        return np.array([np.log(self.stiffness), np.log(self.permittivity), *self.sizes])


def draw(generator: np.random.Generator, hypothesis: Hypothesis, means: Means,
         stranger: Stranger = NOBODY, widths: Span | None = None) -> Truth:
    """Stiffness and permittivity scattered by 10 and 5 %, sizes from the effects' priors.

    Or, given a span of sizes over the usual ones, with each power of ten as probable as another.
    """
    if widths is None:
        sizes = [float(item.prior.ppf(generator.random())) for cause in hypothesis
                 for item in cause.effect.parameters]
    else:
        shares = np.exp(generator.uniform(*np.log(widths), len(hypothesis)))
        sizes = [float(size) for cause, share in zip(hypothesis, shares.tolist(), strict=True)
                 for size in sizes_at(generator, cause, share)]
    return Truth(float(np.exp(generator.normal(0, 0.1))), float(np.exp(generator.normal(0, 0.05))),
                 hypothesis,
                 tuple(sizes), means, int(generator.integers(FINEST)), stranger)


def draw_rough(generator: np.random.Generator, causes: Sequence[Cause], large: Hypothesis,
               means: Means) -> Truth:
    """One effect that is large, or none, and all others at a normal share of their usual sizes."""
    nothing, alone = (draw(generator, some, means, widths=LARGE) for some in ((), large))
    sizes = [alone.sizes if cause in large else
             sizes_at(generator, cause, ROUGH * abs(generator.normal())) for cause in causes]
    return replace(nothing, hypothesis=tuple(causes),
                   sizes=tuple(map(float, np.concatenate(sizes))))


def readings(design: Design, truth: Truth) -> Array | None:
    """Readings of a design's rows without noise [m]; None where a state has no equilibrium or a
    film cannot be built.

    The latter are sizes beyond their limits, and electrode margins of less than 1 % of the gap.
    """
    limits = [item.limits for cause in truth.hypothesis for item in cause.effect.parameters]
    if any(not low <= size <= high
           for size, (low, high) in zip(truth.sizes, limits, strict=True)):
        return None
    try:
        return _readings(design, truth)
    except InputError:
        return None


def _readings(design: Design, truth: Truth) -> Array | None:
    if truth.means == "equations":
        return hidden_equations.readings(design, truth)
    law = design.setup.specimens[0].membrane.material
    if truth.means == "another law":
        law, _ = look_alike(law)
    elif truth.means == "form error":
        law = MATERIALS["vhb-4910-gent"].material
    shown = np.empty(len(design.table))
    for number, ramp in enumerate(design.ramps()):
        deflections = _ramp(design, truth,
                            scaled(law, truth.stiffness * truth.stranger.stiffness(number)), ramp)
        if deflections is None:
            return None
        shown[ramp] = deflections
    return truth.stranger.shown(shown, design.table.states)


def _ramp(design: Design, truth: Truth, law: Material, ramp: Numbers) -> Array | None:
    """Readings of one specimen under one mass, under loads, from voltage to voltage."""
    states = design.table.states
    rig, model, solved = ramp_states(design, truth, law, ramp)
    if solved is None:
        return None
    deflections = [model.deflection(state) for state in solved]
    pairs = zip(deflections, states.elapsed[ramp].tolist(), strict=True)
    return np.array([rig.reading(deflection, elapsed) for deflection, elapsed in pairs])


def ramp_states(design: Design, truth: Truth, law: Material, ramp: Numbers
                ) -> tuple[Rig, Model, list[State] | None]:
    """The rig and the film that are there, and the film's states on a ramp where all exist."""
    states = design.table.states
    films = design.setup.with_films(lambda film: replace(
        film, material=law, relative_permittivity=truth.permittivity * film.relative_permittivity))
    setup = truth.stranger.setup(extended(films, uses_of(truth.hypothesis, truth.unknowns)))
    number = int(states.specimen[ramp[0]])
    specimen, rig = setup.specimens[number], setup.rig
    # The law alone is none that a specimen may have; an uneven film has no mirror planes.
    blank = replace(specimen, membrane=replace(
        design.setup.specimens[number].membrane,
        thickness_gradient=specimen.membrane.thickness_gradient))
    model = truth.stranger.film(
        replace(build_model(blank, MESHES[truth.mesh], rig.loading), specimen=specimen))
    force = rig.force(truth.stranger.mass(float(states.mass[ramp[0]])), model.plate_area)
    voltages = [rig.film_voltage(truth.stranger.voltage(nominal), direction)
                for nominal, direction in
                zip(states.voltage[ramp].tolist(), states.direction[ramp].tolist(), strict=True)]
    if rig.friction:
        return rig, model, _rubbing(model, force, rig, voltages)
    outcomes = list(voltage_path(model, force, voltages, rig.gas_pressure))
    if any(outcome.status != "equilibrium" for outcome in outcomes):
        return rig, model, None
    return rig, model, [outcome.state for outcome in outcomes]


def _rubbing(model: Model, force: float, rig: Rig,
             voltages: Sequence[float]) -> list[State] | None:
    """States of a plate that stays where it is as long as friction can hold it there."""
    moving = [list(voltage_path(model, rig.rubbed(force, way), voltages, rig.gas_pressure))
              for way in (1.0, -1.0)]
    states: list[State] = []
    for voltage, down, up in zip(voltages, *moving, strict=True):
        if down.status != "equilibrium":
            return None
        before = states[-1].plate.deflection if states else 0.0
        if not states or down.state.plate.deflection >= before:
            states.append(down.state)
        elif up.status == "equilibrium" and up.state.plate.deflection <= before:
            states.append(up.state)
        else:
            rubbing = brentq(
                lambda rub, at=before, volts=voltage: _gap(
                    model, force + rub, volts, rig.gas_pressure, at),
                -rig.friction, rig.friction, xtol=1e-9)
            states.append(equilibrium(model, force + rubbing, voltage, rig.gas_pressure).state)
    return states


def _gap(model: Model, force: float, voltage: float, pressure: float, deflection: float) -> float:
    """How much further than a deflection a force moves the plate [m], above a gas."""
    outcome = equilibrium(model, force, voltage, pressure)
    return outcome.state.plate.deflection - deflection if outcome.status == "equilibrium" else 1.0


def hidden(design: Design, generator: np.random.Generator, hypothesis: Hypothesis, means: Means,
           stranger: Stranger = NOBODY, widths: Span | None = None) -> tuple[Truth, Array, int]:
    """A truth with its readings, drawn again while a state has no equilibrium, and how often that
    was."""
    return drawn_until(partial(readings, design),
                       lambda: draw(generator, hypothesis, means, stranger, widths))


def drawn_until(read: Callable[[Truth], Read | None], draw: Callable[[], Truth]
                ) -> tuple[Truth, Read, int]:
    """The first truth drawn of which something is read, with that, and how many were before."""
    for again in range(100):
        truth = draw()
        values = read(truth)
        if values is not None:
            return truth, values, again
    raise ArithmeticError("no draw of a hundred has equilibria")
