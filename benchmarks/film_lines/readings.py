"""Lines over films by the whole field model on meshes of another order than the diagnosis has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tympan.fem.equilibrium.ramp import equilibrium
from tympan.fem.film.laws.stiffened import scaled
from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.places import Places
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Film, Specimen
from tympan.geometry.toml_reader import Table
from tympan.studies.case import Settings, build_model
from tympan.studies.effects import Setup, extended
from tympan.studies.effects.effect import Use

Array = NDArray[np.float64]

#: Finer than a diagnosis' own, and of another order.
OTHER = Settings(mesh=MeshSettings(order=3, around_plate=24, growth=0.35, across=0.35))

HEAD = 'name = "lines"\nnoise = "{noise} um"\n{more}'
SPECIMEN = """[[specimen]]
name = "{name}"
frame = {{ shape = "ellipse", semi_axes = ["{a} mm", "{b} mm"] }}
plate = {{ shape = "circle", radius = "10 mm"{offset} }}
[specimen.membrane]
thickness = "1 mm"
prestretch = [2.2360679775, 2.2360679775]
relative_permittivity = 4.7
material = {{ law = "neo_hooke", mu = "20 kPa" }}
"""
SHAPES: dict[str, tuple[float, float]] = {"round": (45.0, 45.0), "long": (60.0, 45.0)}
MASSES, VOLTAGES = (10e-3, 20e-3), (0.0, 1.5e3, 2.5e3, 3.2e3, 3.8e3)
#: States in which a line is read.
READ = ((20e-3, 0.0), (20e-3, 3.8e3))


def line(specimen: Specimen, along: str, count: int = 46) -> Array:
    """Places on a line across the frame through its centre [m], shape (n, 2)."""
    axis = "xy".index(along)
    places = np.zeros((count, 2))
    half = specimen.frame.semi_axes[axis]
    places[:, axis] = np.linspace(-0.97 * half, 0.97 * half, count)
    return places


def cross(specimen: Specimen) -> Array:
    """Both lines."""
    return np.concatenate([line(specimen, "x"), line(specimen, "y")])


def heights(model: Model, state: State, places: Array) -> Array:
    """What a laser above places of the table sees [m]: where the film's points went is sought."""
    plate = model.specimen.plate
    film, outside = places.copy(), np.zeros(len(places), bool)
    for _ in range(30):
        moved = Places.of(model.discretisation, film).displacement(model, state)
        film = places - moved[:, :2]
        outside = plate.level(*film.T) < 0
        film[outside] = plate.points(720).T[0]
    shown = Places.of(model.discretisation, film).displacement(model, state)[:, 2]
    # The plate is a plane through its centre: z = w + n·r with r from where the centre stands.
    turn, centre = state.plate.rotation, model.centre + state.plate.translation
    away = places - centre[:2]
    flat = np.linalg.solve(turn[:2, :2], away.T).T
    on_plate = plate.outline.level(*flat.T) <= 0
    return np.where(on_plate, centre[2] + flat @ turn[2, :2], shown)


def write(folder: Path, uses: Sequence[Use] = (), seed: int = 0, *, noise: float = 10e-6,
          stiffness: float = 1.05, permittivity: float = 0.97, zero: float = 0.2e-3,
          places: Callable[[Specimen], Array] | None = cross, more: str = "", offset: str = "",
          shapes: Sequence[str] = tuple(SHAPES), scale: float = 1.0,
          change: Callable[[Array], Array] = lambda places: places) -> Path:
    """A dataset with effects hidden in it; each line has a zero of its own.

    Without ``places`` nothing is read over the films; ``change`` is what a wrong frame makes of
    the places, ``scale`` what a wrong unit makes of lines.
    """
    random = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    texts = [SPECIMEN.format(name=name, a=a, b=b, offset=offset)
             for name, (a, b) in SHAPES.items() if name in shapes]
    (folder / "dataset.toml").write_text(HEAD.format(noise=1e6 * noise, more=more)
                                         + "".join(texts), encoding="utf-8")

    def softer(film: Film) -> Film:
        return replace(film, material=scaled(film.material, stiffness),
                       relative_permittivity=permittivity * film.relative_permittivity)

    specimens = [load_specimen(entry) for entry in
                 Table.read(folder / "dataset.toml").tables("specimen")]
    nominal = Setup(tuple(specimens), Rig())
    setup = extended(nominal.with_films(softer), uses)
    static = ["specimen,mass_g,voltage_kV,displacement_mm"]
    field = ["specimen,mass_g,voltage_kV,x_mm,y_mm,displacement_mm"]
    for specimen in setup.specimens:
        model = build_model(specimen, OTHER, setup.rig.loading)
        for mass in MASSES:
            for voltage in VOLTAGES:
                outcome = equilibrium(model, setup.rig.force(mass, model.plate_area),
                                      setup.rig.film_voltage(voltage))
                assert outcome.status == "equilibrium"
                start = f"{specimen.name},{1e3 * mass!r},{1e-3 * voltage!r}"
                read = setup.rig.reading(outcome.state.plate.deflection)
                static.append(f"{start},{1e3 * (read + noise * random.standard_normal()):.9g}")
                if places is None or (mass, voltage) not in READ:
                    continue
                at = places(nominal.specimen(specimen.name))
                shown = heights(model, outcome.state, at) + zero * random.standard_normal()
                shown = shown + noise * random.standard_normal(len(at))
                for (x, y), z in zip(1e3 * change(at), 1e3 * scale * shown, strict=True):
                    field.append(f"{start},{x:.9g},{y:.9g},{z:.9g}")
    (folder / "static.csv").write_text("\n".join(static) + "\n", encoding="utf-8")
    if places is not None:
        (folder / "field.csv").write_text("\n".join(field) + "\n", encoding="utf-8")
    return folder
