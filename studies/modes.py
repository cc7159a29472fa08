"""Natural frequencies of one specimen at one load and one voltage."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from tympan.fem.equilibrium.ramp import Status
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.plate import FREEDOMS
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import whole
from tympan.fem.vibration.mode_names import names
from tympan.fem.vibration.modes import Modes, RigidPlate, film_mass, vibrations
from tympan.geometry.errors import InputError
from tympan.studies.case import Case, Settings, find, state_warnings, why
from tympan.studies.files import interpolated, lattice, write_atomically

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mode:
    """One mode: its frequency [Hz], or growth [1/s] if it is unstable, its name and who carries its kinetic energy.

    ``plate_share`` maps the plate's freedoms (x, y, z, rx, ry, rz) to their shares; the rest of 1
    is the film's.
    """

    name: str
    frequency_Hz: float | None
    growth_per_s: float | None
    plate_share: dict[str, float]
    film_share: float

    @property
    def speed(self) -> str:
        """The frequency or the growth as text."""
        if self.frequency_Hz is not None:
            return f"{self.frequency_Hz:.4g} Hz"
        return f"unstable, grows by {self.growth_per_s:.4g}/s"


@dataclass(frozen=True, kw_only=True)
class ModesResult:
    """The numbers of ``modes --json``; a state that does not exist has no modes."""

    specimen: str
    mass_kg: float
    voltage_V: float
    status: Status
    deflection_m: float | None = None
    film_mass_kg: float | None = None
    plate_mass_kg: float | None = None
    plate_inertia_kg_m2: tuple[float, ...] | None = None
    unstable: int | None = None
    modes: tuple[Mode, ...] = ()
    dofs: int
    wall_s: float
    warnings: tuple[str, ...]

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        return {**asdict(self), "modes": [asdict(mode) for mode in self.modes],
                "warnings": list(self.warnings)}


@dataclass(frozen=True, eq=False)
class Vibration:
    """The whole film, its state and its modes, for pictures and files."""

    model: Model
    state: State
    modes: Modes


def modes(case: Case, settings: Settings, count: int = 6, point_mass: float = 0.0
          ) -> tuple[ModesResult, Vibration | None]:
    """Small vibrations about the case's equilibrium at constant voltage.

    The mass on the plate, the rig's unaccounted mass included, is that of a uniform plate, except
    for ``point_mass`` [kg] of it, without inertia of its own; their centre of mass is where the rig
    hangs the weight.

    Raises
    ------
    InputError
        When nothing that can move has mass, or the point mass exceeds the mass.
    """
    began = time.perf_counter()
    plate = _plate(case, point_mass)
    model, outcome = find(case, settings)
    state = outcome.state
    result = ModesResult(specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage,
                         status=outcome.status,
                         dofs=model.unknowns, wall_s=time.perf_counter() - began, warnings=())
    if outcome.status != "equilibrium":
        return replace(result, warnings=(why(outcome),)), None
    found = vibrations(model, state, plate, count)
    full, whole_state = whole(model, state)
    listed = tuple(_mode(found, number, name) for number, name in enumerate(names(full, found)))
    warnings = [*_warnings(case, found), *state_warnings(model, state)]
    inertia = plate.inertia
    return replace(
        result, deflection_m=state.plate.heave,
        film_mass_kg=float(film_mass(model).sum()) * model.discretisation.mirrored,
        plate_mass_kg=plate.mass, plate_inertia_kg_m2=tuple(map(float, inertia.diagonal())),
        unstable=found.unstable,
        modes=listed, wall_s=time.perf_counter() - began, warnings=tuple(warnings),
    ), Vibration(full, whole_state, found)


@dataclass(frozen=True, eq=False)
class Surface:
    """A film cut into flat triangles: deformed and mounted points [m], shape (n, 3), and modes there, (modes, n, 3)."""

    points: Array
    mounted: Array
    triangles: NDArray[np.int64]
    shapes: Array


def surface(vibration: Vibration, parts: int = 6) -> Surface:
    """The deformed film with each curved element as ``parts``² triangles; elements share no points."""
    model = vibration.model
    points, triangles = lattice(parts)
    cells = len(points.T) * np.arange(model.discretisation.mesh.nelements)[:, None, None] + triangles
    return Surface(interpolated(model, vibration.state.positions, points),
                   interpolated(model, model.discretisation.reference, points),
                   cells.reshape(-1, 3),
                   np.stack([interpolated(model, shape, points)
                             for shape in vibration.modes.shapes]))


def write_modes(file: Path, vibration: Vibration) -> None:
    """The modes as VTU: points of the deformed film, and a field ``mode_1``, ``mode_2``, … of largest length 1 each."""
    film = surface(vibration)
    data = {f"mode_{number}": shape / np.linalg.norm(shape, axis=1).max()
            for number, shape in enumerate(film.shapes, start=1)}
    mesh = meshio.Mesh(film.points, [("triangle", film.triangles)], point_data=data)
    write_atomically(file, partial(meshio.write, mesh=mesh, file_format="vtu"))


def _plate(case: Case, point_mass: float) -> RigidPlate:
    mass = case.mass + case.rig.unaccounted_mass
    if point_mass > mass:
        raise InputError(f"must not exceed the mass on the plate, {mass:g} kg with the rig's unaccounted mass",
                         key="--point-mass", given=f"{point_mass:g} kg")
    return RigidPlate.uniform(case.specimen.plate.outline, mass, point_mass, case.rig.weight_offset)


def _mode(found: Modes, number: int, name: str) -> Mode:
    share = found.shares[number]
    growth = float(found.growth[number])
    return Mode(name, None if growth else float(found.frequencies_Hz[number]), growth or None,
                dict(zip(FREEDOMS, map(float, share), strict=True)),
                max(0.0, float(1 - share.sum())))


def _warnings(case: Case, found: Modes) -> list[str]:
    warnings = []
    if not case.specimen.membrane.density:
        warnings.append("the film has no mass (membrane.density is 0): only the plate's modes are there")
    if found.unstable:
        listed = int(np.count_nonzero(found.growth))
        warnings.append(f"the state is unstable in {found.unstable} directions, of which {listed} are listed; the fast "
                        "ones of a film without tension are as fine as the mesh: it wrinkles")
    return warnings
