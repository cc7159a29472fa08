"""Random admissible cases: a seeded design of specimens, rigs, masses and voltages.

Loads are drawn relative to what the film can bear, so that most cases deflect much, lose tension or
pull in: the mass by the force that would tilt the film at the plate's edge, the voltage by the one
at which the flat film loses tension.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator, default_rng
from scipy.constants import epsilon_0

from tests.oracles.laws import SAMPLES
from tympan.base.errors import InputError
from tympan.fem.film.admissibility import checked
from tympan.fem.film.library import MATERIALS
from tympan.fem.membrane.biases import Magnet
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Circle, Ellipse, Outline, area
from tympan.geometry.specimen import Electrode, Film, Material, Plate, Region, Specimen
from tympan.studies.case import Case

MOST_MASS = 0.1  #: kg
GRAVITY = 9.80665

#: Every registered law, and every film of the library that is elastic without a range of stretches,
#: which draws would leave: no draw changes with others.
MATERIALS_DRAWN: tuple[Material, ...] = (*(sample.law for sample in SAMPLES.values()),
                                         *(entry.material for entry in MATERIALS.values()
                                           if not entry.branches and entry.law_range is None))


@dataclass(frozen=True)
class Drawn:
    """A case of the design; ``refused`` draws before it were no admissible specimens.

    ``plain`` ones are annuli that the axisymmetric equations cover.
    """

    number: int
    case: Case
    plain: bool
    refused: int

    def __str__(self) -> str:
        specimen, rig = self.case.specimen, self.case.rig
        film, electrode = specimen.membrane, specimen.electrode
        outlines = specimen.frame.semi_axes, specimen.plate.outline.semi_axes
        sizes = [f"{a * 1e3:.1f}x{b * 1e3:.1f}" for a, b in outlines]
        parts = [f"#{self.number} frame {sizes[0]} plate {sizes[1]}",
                 f"gap {specimen.gap * 1e3:.2f} mm",
                 f"stretch {film.prestretch[0]:.2f} {film.prestretch[1]:.2f}", str(film.material),
                 f"{self.case.mass * 1e3:.1f} g {self.case.voltage / 1e3:.2f} kV", rig.guide]
        if electrode.margin_frame or electrode.margin_plate:
            parts.append(f"margins {electrode.margin_frame * 1e3:.2g} "
                         f"{electrode.margin_plate * 1e3:.2g}")
        parts += [f"electrode {electrode.outline}"] * (electrode.outline is not None)
        parts += [f"gas {rig.gas_pressure:.3g} Pa"] * bool(rig.gas_pressure)
        parts += [str(bias) for bias in rig.biases]
        return ", ".join(parts)


def design(count: int, seed: int = 1) -> Iterator[Drawn]:
    """Cases, each with a generator of its own: case k is the same whatever the count."""
    for number in range(count):
        random = default_rng([seed, number])
        refused = 0
        while True:
            try:
                case, plain = _case(number, random)
            except InputError:
                refused += 1
            else:
                yield Drawn(number, case, plain, refused)
                break


def slack_voltage(film: Film) -> float:
    """Voltage at which the flat film loses the smaller of its principal stresses [V]."""
    l1, l2 = (np.asarray(stretch) for stretch in film.prestretch)
    _, w1, w2, *_ = film.material.derivatives(l1, l2)
    pull = abs(min(float(l1 * w1),
                   float(l2 * w2)))  # a law referred to the mounted film may press it when mounted
    by_square = epsilon_0 * film.relative_permittivity * (1 - film.permittivity_exponent / 2) \
        * (film.area_prestretch / film.thickness) ** 2
    return float(np.sqrt(pull / by_square))


def _case(number: int, random: Generator) -> tuple[Case, bool]:
    plain, centred = bool(random.random() < 0.25), bool(random.random() < 0.45)
    film = _film(random, plain)
    frame = Circle(_log(random, 20e-3, 80e-3)) if plain else _outline(random,
                                                                      _log(random, 20e-3, 60e-3))
    outline = Circle(frame.semi_axes[0] * random.uniform(0.1, 0.6)) if plain else \
        _outline(random, min(frame.semi_axes) * random.uniform(0.1, 0.6) / 1.5)
    plate = Plate(outline, (0.0, 0.0) if plain or centred else _offset(random, frame, outline))
    bare = Specimen(f"random {number}", frame, plate, film)
    specimen = bare if plain else replace(bare, electrode=_electrode(random, bare))
    pull = tension(film)
    load = pull * 2 * np.pi * float(np.mean(outline.semi_axes)) * random.uniform(0, 1.2)
    rig = Rig() if plain else _rig(random, specimen, load)
    voltage = slack_voltage(film) * random.uniform(0, 1.3) * (random.random() > 0.1)
    mass = min(MOST_MASS, load / GRAVITY)
    return Case(specimen, mass=mass, voltage=float(voltage), rig=rig), plain


def tension(film: Film) -> float:
    """Smaller resultant of the flat film without voltage [N/m]."""
    l1, l2 = (np.asarray(stretch) for stretch in film.prestretch)
    _, w1, w2, *_ = film.material.derivatives(l1, l2)
    return abs(min(float(l1 * w1), float(l2 * w2))) * film.thickness / film.area_prestretch


def _film(random: Generator, plain: bool) -> Film:
    material = MATERIALS_DRAWN[random.integers(len(MATERIALS_DRAWN))]
    first, second = random.uniform(1.5, 4.0, 2)
    same = plain or random.random() < 0.4
    exponent = float(random.choice([0.0, random.uniform(-0.5, 1.0)]))
    density = 0.0 if plain else float(random.choice([0.0, random.uniform(900, 1200)]))
    return Film(_log(random, 0.1e-3, 1e-3), (float(first), float(first if same else second)),
                checked(material),
                float(random.uniform(2, 10)), exponent, density)


def _outline(random: Generator, size: float) -> Outline:
    """A circle, or an ellipse of aspect up to 3 lying or standing, with about the area of a circle
    of that size."""
    if random.random() < 0.35:
        return Circle(size)
    stretch = np.sqrt(random.uniform(1, 3)) ** random.choice([-1, 1])
    return Ellipse((float(size * stretch), float(size / stretch)))


def _offset(random: Generator, frame: Outline, plate: Outline) -> tuple[float, float]:
    """Somewhere in any direction, nearly as far as where the plate would touch the frame."""
    angle, share = random.uniform(0, 2 * np.pi), random.uniform(0, 0.97)
    room = [max(a - b, 0.0) for a, b in zip(frame.semi_axes, plate.semi_axes, strict=True)]
    if not all(room):
        raise InputError("no room", key="plate")
    way = 1 / np.hypot(np.cos(angle) / room[0], np.sin(angle) / room[1])
    return float(share * way * np.cos(angle)), float(share * way * np.sin(angle))


def _electrode(random: Generator, specimen: Specimen) -> Electrode:
    gap = specimen.gap
    stiffness = float(random.choice([0.0, _log(random, 100, 10e3)]))
    kind = random.choice(["whole", "margins", "outline"], p=[0.5, 0.25, 0.25])
    if kind == "whole":
        return Electrode(stiffness=stiffness)
    if kind == "margins":
        frame, plate = (float(random.choice([0.0, gap * random.uniform(0.02, 0.55)]))
                        for _ in range(2))
        return Electrode(frame, plate, stiffness)
    reach = np.array(specimen.frame.semi_axes)
    shift = random.uniform(-0.9, 0.9, 2) * (specimen.plate.offset != (0.0, 0.0))
    centre = tuple(float(x) for x in reach * shift)
    return Electrode(stiffness=stiffness,
                     outline=Region(_outline(random, float(min(reach) * random.uniform(0.4, 1))),
                                                         (centre[0], centre[1])))


def _rig(random: Generator, specimen: Specimen, load: float) -> Rig:
    """Each part in some of the cases, in proportion to the load [N]."""
    size = min(specimen.plate.outline.semi_axes)
    arm = random.uniform(-0.4, 0.4,
                         2) * size * (random.random() < 0.3) * (specimen.plate.offset != (0.0, 0.0))
    guide = random.choice(["free", "level", "vertical"], p=[0.7, 0.15, 0.15])
    reach = min(specimen.frame.semi_axes)
    spring = float(load / reach * random.uniform(0, 2) * (random.random() < 0.3))
    film_area = area(specimen.frame) - area(specimen.plate.outline)
    gas = -float(load / film_area * random.uniform(-0.3, 0.6) * (random.random() < 0.25))
    magnet = Magnet(max(load, 1e-3) * float(random.uniform(0.2, 2)),
                    reach * float(random.uniform(0.6, 1.5)),
                    reach * float(random.uniform(0.2, 1)))
    return Rig(spring=spring, guide=guide, weight_offset=(float(arm[0]), float(arm[1])),
               gas_pressure=gas,
               unaccounted_mass=float(random.uniform(0, 1e-3) * (random.random() < 0.3)),
               plate_pressure=float(random.uniform(0, 50) * (random.random() < 0.2)),
               biases=(magnet,) if random.random() < 0.15 else ())


def _log(random: Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))
