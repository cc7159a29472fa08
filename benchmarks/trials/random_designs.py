"""Random designs to diagnose: seeded specimens, masses and voltages, and films that are not as
stated.

Every reading is of an equilibrium by finite elements, on another mesh than the diagnosis solves,
under loads, ramp by ramp, up to a share of the highest voltage at which the film has one. Films are
0.4 to 2.5 times as stiff as the dataset says, permittivities likewise off by less, noise is 3 to 60
µm; some designs have more channels than the displacement, some one reading per ramp.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.random import Generator, default_rng

from benchmarks.trials.random_specimens import slack_voltage
from benchmarks.trials.synthetic_trials import (
    MESHES,
    Design,
    Truth,
    design_of,
    ramp_states,
)
from tympan.base.arrays import Array
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws.stiffened import scaled
from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_content, toml
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import (
    Circle,
    Ellipse,
    Outline,
    RoundedRectangle,
    Stadium,
    Superellipse,
)
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.evidence.kind import CHANNEL
from tympan.studies.diagnosis.evidence.rest import TILT
from tympan.studies.diagnosis.reading_table import States
from tympan.studies.effects import Setup

#: Factors on the films' stiffness and permittivity, and noise [m].
STIFFNESS, PERMITTIVITY, NOISE = (0.4, 2.5), (0.7, 1.4), (3e-6, 60e-6)
#: The highest voltage of a ramp over the film's limit, and readings of a ramp.
SHARES, READINGS = (0.3, 0.97), (1, 15)
#: Heave at no voltage over the gap, of the heaviest mass.
HEAVES = (0.02, 0.15)
CHANNELS = ("capacitance_pF", "tilt_mrad", "film_voltage_kV")
_FEWEST = 6
#: The mesh limits are found on, within 0.1 %.
_ROUGH = Settings(MeshSettings(around_plate=6, growth=1.2, across=1.2))
_LAWS = ("vhb-4910", "vhb-4910-gent", "vhb-4910-neo-hooke", "ecoflex-00-30")


@dataclass(frozen=True, eq=False)
class RandomDesign:
    """A design, what is the case, the noise of a displacement [m], and the further channels."""

    number: int
    design: Design
    truth: Truth
    noise: float
    channels: tuple[str, ...] = ()

    def __str__(self) -> str:
        states, specimens = self.design.table.states, self.design.setup.specimens
        shapes = ", ".join(specimen.frame.shape for specimen in specimens)
        masses = ", ".join(f"{1e3 * mass:.1f}" for mass in np.unique(states.mass))
        return (f"#{self.number} {shapes}; {masses} g to {1e-3 * states.voltage.max():.1f} kV in "
                f"{len(states)} readings; stiffness {self.truth.stiffness:.2f}, permittivity "
                f"{self.truth.permittivity:.2f}, noise {1e6 * self.noise:.0f} µm")


def random_designs(count: int, seed: int = 1) -> Iterator[RandomDesign]:
    """Designs, each with a generator of its own: design k is the same whatever the count."""
    for number in range(count):
        yield random_design(number, seed)


def random_design(number: int, seed: int = 1) -> RandomDesign:
    """A design; those of whose films a ramp has no limit to be found are drawn again."""
    random = default_rng([seed, number])
    while True:
        drawn = _drawn(number, random)
        if drawn is not None and len(drawn.design.table) >= _FEWEST:
            return drawn


def _drawn(number: int, random: Generator) -> RandomDesign | None:
    truth = Truth(_log(random, *STIFFNESS), _log(random, *PERMITTIVITY), mesh=0)
    entry = MATERIALS[_LAWS[random.integers(len(_LAWS))]]
    film = Film(_log(random, 0.5e-3, 1e-3), (float(random.uniform(1.8, 2.6)),) * 2,
                entry.material, float(random.uniform(2.5, 5)))
    specimens = tuple(_specimen(random, name, film) for name in "ABCD"[: random.integers(1, 5)])
    setup = Setup(specimens, Rig())
    single = random.random() < 0.15
    parts: list[States] = []
    for index, specimen in enumerate(specimens):
        heaviest = _mass(specimen, truth) * _log(random, *HEAVES) / HEAVES[1]
        masses = heaviest * np.sort(random.uniform(0.3, 1.0, random.integers(1, 5)))
        for mass in np.round(masses, 5).tolist():
            limit = _limit(specimen, truth, mass)
            if limit is None:
                return None
            top = limit * random.uniform(*SHARES)
            count = 1 if single else int(random.integers(READINGS[0] + 1, READINGS[1] + 1))
            voltages = np.array([top]) if count == 1 else np.linspace(0.0, top, count)
            parts.append(States.of([index] * count, [mass] * count, np.floor(voltages)))
    states = parts[0]
    for part in parts[1:]:
        states = states.joined(part)
    noise = _log(random, *NOISE)
    channels = tuple(name for name in CHANNELS if random.random() < 0.15)
    return RandomDesign(number, design_of(f"random {number}", setup, states), truth, noise,
                        channels)


def _specimen(random: Generator, name: str, film: Film) -> Specimen:
    size = _log(random, 25e-3, 60e-3)
    frame = _outline(random, size)
    plate = Circle(float(min(frame.semi_axes) * random.uniform(0.15, 0.5)))
    return Specimen(name, frame, Plate(plate), film)


def _outline(random: Generator, size: float) -> Outline:
    axes = (float(size * random.uniform(1.0, 1.7)), float(size))
    kinds = (lambda: Circle(size), lambda: Ellipse(axes),
             lambda: Superellipse(axes, float(random.uniform(2.2, 4))), lambda: Stadium(axes),
             lambda: RoundedRectangle(axes, float(size * random.uniform(0.3, 0.9))))
    return kinds[random.integers(len(kinds))]()


def _true(specimen: Specimen, truth: Truth) -> Specimen:
    film = specimen.membrane
    return replace(specimen, membrane=replace(
        film, material=scaled(film.material, truth.stiffness),
        relative_permittivity=truth.permittivity * film.relative_permittivity))


def _mass(specimen: Specimen, truth: Truth) -> float:
    """The mass that deflects the true film by the largest share of the gap, if it were linear."""
    model = build_model(_true(specimen, truth), MESHES[truth.mesh])
    tiny = equilibrium(model, 1e-3, 0.0).state.plate.deflection
    return HEAVES[1] * specimen.gap / tiny * 1e-3 / Rig().gravity


def _limit(specimen: Specimen, truth: Truth, mass: float) -> float | None:
    """The highest voltage at which the true film has an equilibrium [V], or one is reached."""
    specimen = _true(specimen, truth)
    model = build_model(specimen, _ROUGH)
    outcome = equilibrium(model, mass * Rig().gravity, 1.5 * slack_voltage(specimen.membrane))
    if outcome.limit is not None:
        return float(outcome.limit**0.5) if outcome.limited == "voltage" else None
    return float(outcome.state.voltage_squared**0.5) or None


def written(drawn: RandomDesign, folder: Path, noisy: bool = True) -> Path | None:
    """A dataset's folder with the readings of a design; None where one has no equilibrium."""
    random = default_rng([drawn.number, 7])
    design, truth = drawn.design, drawn.truth
    states = design.table.states
    columns = ("displacement_mm", *drawn.channels)
    law = scaled(design.setup.specimens[0].membrane.material, truth.stiffness)
    values = np.empty((len(states), len(columns)))
    for ramp in design.ramps():
        rig, model, solved = ramp_states(design, truth, law, ramp)
        if solved is None:
            return None
        for row, state in zip(ramp.tolist(), solved, strict=True):
            shown = {"displacement_mm": 1e3 * rig.reading(state.plate.deflection),
                     "capacitance_pF": 1e12 * model.capacitance(state),
                     "tilt_mrad": 1e3 * state.plate.tilt,
                     "film_voltage_kV": 1e-3 * float(states.voltage[row])}
            values[row] = [shown[name] for name in columns]
    noise = CHANNEL * np.abs(values).max(axis=0)
    noise[0] = 1e3 * drawn.noise
    if "tilt_mrad" in columns:
        place = columns.index("tilt_mrad")
        noise[place] = max(noise[place], 1e3 * TILT)
    values += noisy * noise * random.standard_normal(values.shape)
    write_readings(design, folder, dict(zip(columns, values.T, strict=True)), drawn.noise)
    return folder


def write_readings(design: Design, folder: Path, columns: Mapping[str, Array],
                   noise: float) -> None:
    """A dataset's folder with readings by their columns' headings, of a noise [m] of lengths."""
    states, lines = design.table.states, []
    timed = bool(np.isfinite(states.elapsed).all())
    for row, read in enumerate(np.transpose([*columns.values()])):
        # A probe's voltage has no sign: nobody reads it where there is none.
        cells = ["" if name == "film_voltage_kV" and not states.voltage[row] else
                 f"{abs(value) if name == 'film_voltage_kV' else value:.7g}"
                 for name, value in zip(columns, read, strict=True)]
        lines.append(f"{design.setup.specimens[int(states.specimen[row])].name},"
                     f"{1e3 * states.mass[row]:.6g},{1e-3 * states.voltage[row]:.6g},"
                     + ",".join([*cells, *([f"{states.elapsed[row]:.6g}"] if timed else [])]))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "dataset.toml").write_text(toml({
        "name": design.name, "noise": f"{1e6 * noise:.3g} um",
        "specimen": [specimen_content(specimen) for specimen in design.setup.specimens],
    }), encoding="utf-8")
    head = ",".join(("specimen", "mass_g", "voltage_kV", *columns,
                     *(["elapsed_s"] if timed else [])))
    (folder / "static.csv").write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")


def _log(random: Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))
