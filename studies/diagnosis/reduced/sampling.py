"""Force laws from finite elements: films solved with the plate held, at the nodes of a grid."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from tympan.fem.equilibrium.constraints import held_plate
from tympan.fem.equilibrium.newton import Solution, newton
from tympan.fem.equilibrium.ramp import PathSettings, held
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.reduced.axes import Axis, HeldFilm, edited, film_axes
from tympan.studies.diagnosis.reduced.force_law import (
    ForceLaw,
    Grid,
    Sample,
    grid_of,
    law_through,
    samples,
)
from tympan.studies.effects import Setup

Array = NDArray[np.float64]

#: The mesh for force laws: forces within 1e-4 of the limit, a fraction of any sensor's noise.
COARSE = Settings(mesh=MeshSettings(around_plate=8, growth=1.0, across=1.0))
#: The mesh they are checked on.
FINE = Settings(mesh=MeshSettings(around_plate=16, growth=0.5, across=0.5))

_CHUNK = 12

#: Steps to where Newton's method does not get at once; shorter ones are seldom worth their time.
_BOLD = PathSettings(shortest=0.1)

_FEWEST = 2


class NotSampled(ArithmeticError):
    """The film has no equilibrium, or none was found, at a node.

    ``voltage_squared`` is the U² there [V²].
    """

    def __init__(self, voltage_squared: float) -> None:
        super().__init__(voltage_squared)
        self.voltage_squared = voltage_squared

    def __str__(self) -> str:
        voltage = self.voltage_squared**0.5
        return f"the film could not be solved with its plate held at {voltage:.4g} V"


@dataclass(frozen=True, eq=False)
class Nodes:
    """A film at a grid's nodes: force [N], capacitance [F], shape (heaves, voltages); states.

    Model.
    """

    force: Array
    capacitance: Array
    states: list[list[State]]
    model: Model


def at_nodes(film: HeldFilm, grid: Grid, settings: Settings, near: Nodes | None = None,
             strict: bool = False
             ) -> Nodes:
    """Solve a film at the nodes of a grid, beginning from a similar one where the meshes agree.

    Beyond a voltage at which the film cannot be solved, force and capacitance are nan; ``strict``
    refuses that.

    Raises
    ------
    NotSampled
        Where there is no solution.
    """
    model = _model(film, settings, near)
    heaves, voltages_squared = grid.nodes
    force, capacitance = np.full((2, len(heaves), len(voltages_squared)), np.nan)
    states: list[list[State]] = []
    for i, heave in enumerate(heaves):
        states.append([])
        for j, voltage_squared in enumerate(voltages_squared):
            guess = _guess(model.discretisation.reference.shape, near, states, i, j)
            found = _solved(model, guess, heave, voltage_squared, film.gas_pressure)
            if found is None:
                if j < _FEWEST or strict:
                    raise NotSampled(voltage_squared)
                break
            force[i, j], capacitance[i, j] = found.state.force, model.capacitance(found.state)
            states[-1].append(found.state)
    return Nodes(force, capacitance, states, model)


def _model(film: HeldFilm, settings: Settings, near: Nodes | None) -> Model:
    """The film's model: on the mesh of a similar film that has the same outlines."""
    if near is not None and meshed_outlines(film.specimen) == meshed_outlines(near.model.specimen):
        return replace(near.model, specimen=film.specimen, loading=film.loading)
    return build_model(film.specimen, settings, film.loading)


def meshed_outlines(specimen: Specimen) -> tuple[object, ...]:
    """All a specimen's mesh depends on."""
    electrode = specimen.electrode
    return (specimen.frame, specimen.plate, electrode.margin_frame, electrode.margin_plate,
            electrode.outline)


def _guess(shape: tuple[int, ...], near: Nodes | None, states: list[list[State]], i: int,
           j: int) -> State | None:
    """A state to start from: a similar film's, or the neighbours' continued along the voltage."""
    if near is not None and j < len(near.states[i]) and near.states[i][j].positions.shape == shape:
        return near.states[i][j]
    row = states[i]
    if j > 1:
        return replace(row[-1], positions=2 * row[-1].positions - row[-2].positions)
    return row[-1] if row else states[i - 1][0] if i else None


def _solved(model: Model, guess: State | None, heave: float, voltage_squared: float,
            pressure: float) -> Solution | None:
    """The film with its plate held."""
    guess = model.mounted() if guess is None else guess
    found = newton(model, guess.under(voltage=voltage_squared, pressure=pressure), ("force",),
                   (held_plate(heave),))
    if found.converged:
        return found
    start = newton(model, model.mounted().under(pressure=pressure), ("force",), (held_plate(0.0),))
    outcome = held(model, heave, voltage_squared**0.5, start, _BOLD)
    return outcome.solution if outcome.status == "equilibrium" else None


@dataclass(frozen=True)
class SamplingTask:
    """Some samples of one specimen's film, to be solved together."""

    setup: Setup
    name: str
    grid: Grid
    axes: tuple[Axis, ...]
    samples: tuple[Sample, ...]
    settings: Settings = COARSE

    def run(self) -> list[tuple[Array, Array]]:
        """Force and capacitance at the nodes for each sample; pairs on the coarse grid."""
        known: dict[tuple[object, ...], Nodes] = {}
        found = []
        for sample in sorted(self.samples, key=lambda sample: len(sample.axes)):
            axes = [self.axes[index] for index in sample.axes]
            sizes = [axis.size(at) for axis, at in zip(axes, sample.at, strict=True)]
            grid = grid_of(self.grid, sample)
            nominal = (grid, meshed_outlines(self.setup.specimen(self.name)))
            if nominal not in known:
                known[nominal] = at_nodes(HeldFilm.of(self.setup, self.name), grid, self.settings)
            film = edited(self.setup, self.name, axes, sizes)
            own = grid, meshed_outlines(film.specimen)
            nodes = at_nodes(film, grid, self.settings,
                             known.get(own, known[nominal])) if axes else known[nominal]
            known.setdefault(own, nodes)
            found.append((sample, (nodes.force, nodes.capacitance)))
        results = dict(found)
        return [results[sample] for sample in self.samples]


def nominal_law(setup: Setup, name: str, heave: float, voltage_squared: float) -> ForceLaw:
    """The force law of a film without effects up to a heave [m] and a U² [V²], or less."""
    film = HeldFilm.of(setup, name)
    while True:
        grid = Grid(heave, voltage_squared, odd=not film.heavy and film.loading.arm == (0.0, 0.0))
        try:
            nodes = at_nodes(film, grid, COARSE, strict=True)
        except NotSampled as error:
            voltage_squared = min(0.9 * voltage_squared, error.voltage_squared)
            if voltage_squared < 1.0:
                raise
        else:
            return law_through(grid, (), [Sample((), ())], [nodes.force], [nodes.capacitance])


def force_laws(setup: Setup, grids: Sequence[Grid], workers: int = 1,
               progress: Callable[[int, int],
                                  None] = lambda done, all_of_them: None) -> tuple[ForceLaw, ...]:
    """The force law of every specimen, with the axes of every effect in the library.

    Raises
    ------
    NotSampled
        Where a film has no solution within its grid.
    """
    names = [specimen.name for specimen in setup.specimens]
    axes = [film_axes(setup, name) for name in names]
    tasks: list[SamplingTask] = []
    owners: list[int] = []
    for number, (name, grid, own) in enumerate(zip(names, grids, axes, strict=True)):
        every = sorted(samples(own),
                       key=lambda sample: (len(sample.axes) > 1, _mesh_of(own, sample)))
        chunks = [tuple(every[k : k + _CHUNK]) for k in range(0, len(every), _CHUNK)]
        tasks += [SamplingTask(setup, name, grid, own, chunk) for chunk in chunks]
        owners += [number] * len(chunks)
    results = list(_run(tasks, workers, progress))
    laws = []
    for number, (grid, own) in enumerate(zip(grids, axes, strict=True)):
        where = [sample for task, owner in zip(tasks, owners, strict=True) if owner == number
                 for sample in task.samples]
        nodes = [pair for result, owner in zip(results, owners, strict=True) if owner == number
                 for pair in result]
        laws.append(law_through(grid, own, where, [pair[0] for pair in nodes],
                           [pair[1] for pair in nodes]))
    return tuple(laws)


def _mesh_of(axes: tuple[Axis, ...], sample: Sample) -> tuple[tuple[str, float], ...]:
    """What of a sample may need its own mesh; samples on one mesh are solved by one process."""
    return tuple((axes[index].effect, at) for index, at in zip(sample.axes, sample.at, strict=True))


def _run(tasks: Sequence[SamplingTask], workers: int, progress: Callable[[int, int], None]
         ) -> Iterable[list[tuple[Array, Array]]]:
    """Results in the order of the tasks."""
    if workers < 2 or len(tasks) < 2:
        for done, task in enumerate(tasks):
            progress(done, len(tasks))
            yield task.run()
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for done, result in enumerate(pool.map(SamplingTask.run, tasks)):
            progress(done, len(tasks))
            yield result
