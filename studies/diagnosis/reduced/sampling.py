"""Force laws from finite elements: films solved with the plate held, at the nodes of a grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

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
from tympan.studies.diagnosis.reduced.axes import (
    Axis,
    HeldFilm,
    Sample,
    film_axes,
    sampled_film,
)
from tympan.studies.diagnosis.reduced.force_law import ForceLaw, Grid, law_through, samples
from tympan.studies.effects import Setup
from tympan.studies.parallel import mapped

Array = NDArray[np.float64]

#: A setup, the name of a specimen, its grid and axes, and samples to be solved together.
Task = tuple[Setup, str, Grid, tuple[Axis, ...], tuple[Sample, ...]]

#: The mesh for force laws: forces within 1e-4 of the limit, a fraction of any sensor's noise.
COARSE = Settings(mesh=MeshSettings(around_plate=8, growth=1.0, across=1.0))
#: The mesh they are checked on.
FINE = Settings(mesh=MeshSettings(around_plate=16, growth=0.5, across=0.5))

_CHUNK = 12

#: Steps to where Newton's method does not get at once; shorter ones are seldom worth their time.
_BOLD = PathSettings(shortest=0.1)

_FEWEST = 2


class NotSampled(ArithmeticError):
    """The film has no equilibrium, or none was found, at a node of this U² [V²]."""

    @property
    def voltage_squared(self) -> float:
        """The U² there [V²]."""
        return float(self.args[0])

    def __str__(self) -> str:
        voltage = self.voltage_squared**0.5
        return f"the film could not be solved with its plate held at {voltage:.4g} V"


@dataclass(frozen=True, eq=False)
class Nodes:
    """A film's force [N] and capacitance [F], shape (heaves, voltages), states, and its model."""

    force: Array
    capacitance: Array
    states: list[list[State]]
    model: Model


def at_nodes(film: HeldFilm, grid: Grid, near: Nodes | None = None,
             strict: bool = False) -> Nodes:
    """Solve a film at the nodes of a grid, beginning from a similar one where the meshes agree.

    Beyond a voltage at which the film cannot be solved, force and capacitance are nan; a
    :class:`NotSampled` where that is at the first ones, or, if ``strict``, anywhere.
    """
    if near is not None and meshed_outlines(film.specimen) == meshed_outlines(near.model.specimen):
        model = replace(near.model, specimen=film.specimen, loading=film.loading)
    else:
        model = build_model(film.specimen, COARSE, film.loading)
    heaves, voltages_squared = grid.nodes
    force, capacitance = np.full((2, len(heaves), len(voltages_squared)), np.nan)
    states: list[list[State]] = []
    for i, heave in enumerate(heaves):
        states.append([])
        for j, voltage_squared in enumerate(voltages_squared):
            guess = _guess(model.discretisation.reference.shape, near, states, i, j)
            solution = _solved(model, guess, heave, voltage_squared, film.gas_pressure)
            if solution is None:
                if j < _FEWEST or strict:
                    raise NotSampled(voltage_squared)
                break
            force[i, j] = solution.state.force
            capacitance[i, j] = model.capacitance(solution.state)
            states[-1].append(solution.state)
    return Nodes(force, capacitance, states, model)


def meshed_outlines(specimen: Specimen) -> tuple[object, ...]:
    """All a specimen's mesh depends on."""
    electrode = specimen.electrode
    return (specimen.frame, specimen.plate, electrode.margin_frame, electrode.margin_plate,
            electrode.outline)


def _guess(shape: tuple[int, ...], near: Nodes | None, states: list[list[State]], i: int,
           j: int) -> State | None:
    # A similar film's, or the neighbours' continued along the voltage.
    if near is not None and j < len(near.states[i]) and near.states[i][j].positions.shape == shape:
        return near.states[i][j]
    row = states[i]
    if j > 1:
        return replace(row[-1], positions=2 * row[-1].positions - row[-2].positions)
    return row[-1] if row else states[i - 1][0] if i else None


def _solved(model: Model, guess: State | None, heave: float, voltage_squared: float,
            pressure: float) -> Solution | None:
    guess = model.mounted() if guess is None else guess
    solution = newton(model, guess.under(voltage=voltage_squared, pressure=pressure), ("force",),
                      (held_plate(heave),))
    if solution.converged:
        return solution
    start = newton(model, model.mounted().under(pressure=pressure), ("force",), (held_plate(0.0),))
    outcome = held(model, heave, voltage_squared**0.5, start, _BOLD)
    return outcome.solution if outcome.status == "equilibrium" else None


def _sampled(task: Task) -> dict[Sample, tuple[Array, Array]]:
    """Force and capacitance at the nodes for each sample; pairs on the coarse grid."""
    setup, name, full, axes, places = task
    similar: dict[tuple[object, ...], Nodes] = {}
    solved = {}
    for sample in sorted(places, key=len):
        grid = full.at(sample)
        nominal = grid, meshed_outlines(setup.specimen(name))
        if nominal not in similar:
            similar[nominal] = at_nodes(HeldFilm.of(setup, name), grid)
        film = sampled_film(setup, name, axes, sample)
        outlines = grid, meshed_outlines(film.specimen)
        nodes = similar[nominal]
        if sample:
            nodes = at_nodes(film, grid, similar.get(outlines, nodes))
        similar.setdefault(outlines, nodes)
        solved[sample] = nodes.force, nodes.capacitance
    return solved


def nominal_law(setup: Setup, name: str, heave: float, voltage_squared: float) -> ForceLaw:
    """The force law of a film without effects up to a heave [m] and a U² [V²], or less."""
    film = HeldFilm.of(setup, name)
    while True:
        grid = Grid(heave, voltage_squared, film.odd)
        try:
            nodes = at_nodes(film, grid, strict=True)
        except NotSampled as error:
            voltage_squared = min(0.9 * voltage_squared, error.voltage_squared)
            if voltage_squared < 1.0:
                raise
        else:
            return law_through(grid, (), {(): (nodes.force, nodes.capacitance)})


def force_laws(setup: Setup, grids: Sequence[Grid], workers: int = 1,
               progress: Callable[[int, int], None] = lambda done, all_of_them: None
               ) -> tuple[ForceLaw, ...]:
    """The force law of every specimen, with the axes of every effect in the library.

    Raises
    ------
    NotSampled
        Where a film has no solution within its grid.
    """
    films = {specimen.name: (grid, film_axes(setup, specimen.name))
             for specimen, grid in zip(setup.specimens, grids, strict=True)}
    tasks: list[Task] = []
    for name, (grid, axes) in films.items():
        # What may need its own mesh; samples on one mesh are solved by one process.
        every = sorted(samples(axes), key=lambda sample: (
            len(sample) > 1, [(axes[index].effect, at) for index, at in sample]))
        tasks += [(setup, name, grid, axes, tuple(every[first : first + _CHUNK]))
                  for first in range(0, len(every), _CHUNK)]
    solved: dict[str, dict[Sample, tuple[Array, Array]]] = {name: {} for name in films}
    for done, result in enumerate(mapped(_sampled, tasks, min(workers, len(tasks)))):
        progress(done, len(tasks))
        solved[tasks[done][1]] |= result
    return tuple(law_through(grid, axes, solved[name]) for name, (grid, axes) in films.items())
