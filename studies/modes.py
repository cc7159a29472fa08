"""Natural frequencies of one specimen at one load and one voltage."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Self

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import FREEDOMS, HEAVE, State
from tympan.fem.results.fields import whole
from tympan.fem.vibration.air import with_air
from tympan.fem.vibration.modes import Modes, film_mass, mode_names, vibrations
from tympan.studies.case import (
    Case,
    CaseRecord,
    Deflection,
    Existence,
    Settings,
    UnknownCount,
    WallTime,
    Warnings,
    equilibrate,
    failure_reason,
    state_warnings,
)
from tympan.studies.film_surface import (
    NO_SURFACE,
    FilmSurface,
    cut_triangles,
    interpolated,
)
from tympan.studies.rows import rows_of

#: Square root of the number of triangles of a curved element in files and pictures.
_PARTS = 6

#: Number of modes among which that of the plate's deflection is sought: tilts and modes of a light
#: film may be lower.
_LOWEST = 12

#: Least number of modes in vacuo that are combined to those in air.
_BASIS = 40


@dataclass(frozen=True)
class Mode:
    """One mode: its frequency, or growth if it is unstable, and its name."""

    name: Annotated[str, Key("name of the mode")]
    frequency_Hz: Annotated[float | None, Key("frequency of the mode; none if it is unstable")]
    growth_per_s: Annotated[float | None, Key("growth of a mode that is unstable")]
    plate_share: Annotated[dict[str, float], Key("shares of the plate's freedoms (x, y, z, rx, ry, "
                                                 "rz) in the kinetic energy")]
    film_share: Annotated[float, Key("the film's share of the kinetic energy")]
    plate_turn: Annotated[tuple[float, ...], Key("how far the plate turns about x, y and z [rad/m] "
                                                 "where the film's largest displacement is 1 m; "
                                                 "empty in records of older versions")] = ()

    @property
    def speed(self) -> str:
        """Frequency or growth as text."""
        if self.frequency_Hz is not None:
            return f"{self.frequency_Hz:.4g} Hz"
        return f"unstable, grows by {self.growth_per_s:.4g}/s"


@dataclass(frozen=True, kw_only=True)
class ModesResult(CaseRecord):
    """The numbers of ``modes --json``; a state that does not exist has no modes.

    ``film`` has a field ``mode_1``, ``mode_2``, … of largest length 1 for each mode.
    """

    ending = "-modes"
    writer = "tympan modes -o"
    drawn = ("png", "svg", "gif", "mp4")

    status: Existence
    deflection_m: Deflection = None
    film_mass_kg: Annotated[float | None, Key("mass of the film; none of a film in closed "
                                              "form")] = None
    plate_mass_kg: Annotated[float | None, Key("mass of the plate with its weight")] = None
    plate_inertia_kg_m2: Annotated[
        tuple[float, ...] | None, Key("inertia of the plate about x, y and z")] = None
    unstable: Annotated[int | None, Key("how many modes are unstable")] = None
    modes: Annotated[tuple[Mode, ...], Key("the modes, the slowest first")] = ()
    dofs: UnknownCount
    wall_s: WallTime
    warnings: Warnings
    semi_axes_m: Annotated[tuple[float, ...], Key("half extents of the frame")] = ()

    @property
    def rows(self) -> dict[str, Array]:
        """A row for each mode, with its shares of the plate's freedoms."""
        axes = list(self.modes[0].plate_share) if self.modes else []
        return rows_of(self.modes) | {
            f"plate_share_{axis}": np.array([mode.plate_share[axis] for mode in self.modes])
            for axis in axes}

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> Self:
        result = super().load(folder, name)
        if result.modes and result.film is None and result.film_mass_kg is not None:
            raise InputError("is missing: run the command that wrote the folder again",
                             file=folder / f"{result.specimen}-modes.vtu")
        if result.modes and not result.semi_axes_m:
            raise InputError("is of a version that kept too little for a picture: run tympan modes "
                             "again", file=folder / f"{result.specimen}-modes.json")
        return result


def modes(case: Case, settings: Settings, count: int = 6, point_mass: float = 0.0) -> ModesResult:
    """Solve small vibrations about the case's equilibrium at constant voltage.

    The mass on the plate, with the rig's unaccounted mass, is that of a uniform plate, except for
    ``point_mass`` [kg] of it, which has no inertia of its own; their centre of mass is where the
    rig hangs the weight. The rig's added mass moves with the plate and does not turn. The rig's air
    moves with film and plate along the load: it adds mass to deflections and inertia to tilts, none
    to sideways motions and twists.
    """
    began = time.perf_counter()
    plate = carried(case, point_mass)
    model, outcome = equilibrate(case, settings)
    state = outcome.state
    result = ModesResult(
        specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage,
        pressure_Pa=case.rig.gas_pressure or None, status=outcome.status, dofs=model.unknowns,
        wall_s=time.perf_counter() - began, warnings=(), semi_axes_m=case.specimen.frame.semi_axes)
    if outcome.status != "equilibrium":
        return replace(result, warnings=(failure_reason(outcome), *case.remarks))
    full, whole_state = whole(model, state)
    alone = case.specimen.plate is None
    computed = swinging(model, state, plate, case.rig.air, count)
    film, longest = (_surface(full, whole_state, computed) if model.meshed
                     else (None, [1.0] * len(computed.shapes)))
    return replace(
        result, deflection_m=model.deflection(state),
        film_mass_kg=(float(film_mass(model).sum()) * model.discretisation.mirrored
                      if model.meshed else None),
        plate_mass_kg=None if alone else plate.mass,
        plate_inertia_kg_m2=None if alone else tuple(map(float, plate.inertia.diagonal())),
        unstable=computed.unstable,
        modes=tuple(_mode(computed, number, name, longest[number])
                    for number, name in enumerate(mode_names(full, computed))),
        wall_s=time.perf_counter() - began,
        warnings=(*_warnings(case, computed, model), *state_warnings(model, state),
                  *((NO_SURFACE,) if film is None else ()),
                  *case.rig.in_motion, *case.remarks),
        film=film)


def _surface(full: Model, state: State, computed: Modes) -> tuple[FilmSurface, list[float]]:
    """Make the surface of a whole film with its modes; also each mode's largest displacement."""
    points, triangles = cut_triangles(full, _PARTS)
    shapes = [interpolated(full, nodal, points) for nodal in computed.shapes]
    longest = [float(np.linalg.norm(shape, axis=1).max()) for shape in shapes]
    deformed = interpolated(full, state.positions, points)
    displacement = deformed - interpolated(full, full.discretisation.reference, points)
    return FilmSurface(deformed, triangles, {"displacement": displacement} | {
        f"mode_{number}": shape / length
        for number, (shape, length) in enumerate(zip(shapes, longest, strict=True), start=1)
    }), longest


def heave_frequency(case: Case, settings: Settings) -> float | None:
    """Solve the frequency [Hz] of the mode in which the plate mostly moves up and down.

    None where the case has no equilibrium, or no such mode is among the lowest.
    """
    model, outcome = equilibrate(case, settings)
    if outcome.status != "equilibrium":
        return None
    return heaving_frequency(model, outcome.state, carried(case), case.rig.air)


def heaving_frequency(model: Model, state: State, plate: RigidPlate, air: float = 0.0
                      ) -> float | None:
    """Solve a plate's frequency of deflection [Hz] in ``air`` [kg/m³]; None if unstable."""
    computed = swinging(model, state, plate, air, _LOWEST)
    heaving = int(np.argmax(computed.shares[:, HEAVE]))
    stable = not computed.growth[heaving] and computed.shares[heaving, HEAVE] > 0.5
    return float(computed.frequencies_Hz[heaving]) if stable else None


def swinging(model: Model, state: State, plate: RigidPlate, air: float, count: int) -> Modes:
    """Solve the lowest modes of film and plate about a state, in ``air`` [kg/m³] on both sides."""
    if not air:
        return vibrations(model, state, plate, count)
    basis = vibrations(model, state, plate, max(_BASIS, 3 * count))
    mesh = whole(model, state)[0].discretisation
    return with_air(model.specimen, mesh, basis, plate, air, count)


def carried(case: Case, point_mass: float = 0.0) -> RigidPlate:
    """Make the plate of a case with its mass, the rig's unaccounted and added mass included."""
    mass = case.rig.moving_mass(case.mass)
    if point_mass > mass:
        raise InputError(f"must not exceed the mass on the plate, {mass:g} kg with the rig's "
                         "unaccounted and added mass", key="--point-mass",
                         given=f"{point_mass:g} kg")
    if case.specimen.plate is None:
        return RigidPlate(0.0)
    return RigidPlate.uniform(case.specimen.plate.outline, mass, point_mass,
                              case.rig.weight_offset)


def _mode(computed: Modes, number: int, name: str, longest: float) -> Mode:
    share = computed.shares[number]
    growth = float(computed.growth[number])
    return Mode(name, None if growth else float(computed.frequencies_Hz[number]), growth or None,
                dict(zip(FREEDOMS, map(float, share), strict=True)),
                max(0.0, float(1 - share.sum())),
                tuple(map(float, computed.plate[number][3:] / longest)))


def _warnings(case: Case, computed: Modes, model: Model) -> list[str]:
    warnings = []
    if not model.meshed:
        warnings.append("the film is a formula without inertia: added_mass of the rig may stand "
                        "for it")
    elif not (case.specimen.membrane.density or case.specimen.electrode.mass):
        warnings.append("the film has no mass (membrane.density is 0): only the plate's modes are "
                        "there")
    if computed.unstable:
        listed = int(np.count_nonzero(computed.growth))
        warnings.append(f"the state is unstable in {computed.unstable} directions, of which "
                        f"{listed} are listed; the fast ones of a film without tension are as fine "
                        "as the mesh: it wrinkles")
    return warnings
