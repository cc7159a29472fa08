"""Films with quarters, reduced and lumped, that tests of steered plates share."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from tests.support.specimens import circular
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import NeoHooke
from tympan.geometry.electrode import Electrode, Segment
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.studies.case import Settings
from tympan.studies.films.film import ReducedFilm
from tympan.studies.films.reduction import Reduction, Snapshot
from tympan.studies.films.segmented import driven_model
from tympan.studies.lumped.steered.model import SteeredModel, powers_of
from tympan.studies.lumped.steered.path import circle
from tympan.studies.lumped.steered.run import full_model

SUPPLY, LOAD = 3e3, 0.15


def quarters() -> Specimen:
    """A round film with four quarters that creeps."""
    film = circular(NeoHooke(13.6e3))
    segments = tuple(Segment(name=name, sector=(number * np.pi / 2, (number + 1) * np.pi / 2))
                     for number, name in enumerate("ABCD"))
    branches = ViscousBranch(28.6e3, 8.1), ViscousBranch(10.7e3, 264.0)
    return replace(film, name="quarters", electrode=Electrode(segments=segments, gap=1e-3),
                   membrane=replace(film.membrane, branches=branches, prestretch=(3.0, 3.0)))


@cache
def model() -> SteeredModel:
    """A model whose polynomials are stated: quarters of a plate on springs that stiffen."""
    scale = np.array([3e-4, 0.01, 0.01])
    powers = powers_of(3, 4)
    elastic, electric = np.zeros(len(powers)), np.zeros((4, len(powers)))
    stiffness = np.array([50.0, 0.017, 0.017])
    for number, power in enumerate(powers.tolist()):
        if sum(power) == 2 and max(power) == 2:
            at = power.index(2)
            elastic[number] = stiffness[at] / 2 * scale[at] ** 2
        elif sum(power) == 4:
            elastic[number] = 2e-8
        elif sum(power) == 1:
            at = power.index(1)
            sides = [[1, 1, 1, 1], [1, -1, -1, 1], [1, 1, -1, -1]][at]
            electric[:, number] = np.multiply([1.2e-12, 2e-11, 2e-11][at], sides)
            elastic[number] = LOAD * scale[0] * (at == 0)
        elif not sum(power):
            electric[:, number] = 5e-10
    springs = np.multiply.outer([0.7, 0.3], np.diag([0.8, 5e-3, 5e-3]))
    return SteeredModel(quarters(), ("deflection", "tilt_x", "tilt_y"), tuple("ABCD"), LOAD,
                        np.diag([0.015, 4e-7, 4e-7]), np.diag([0.05, 0.0, 0.0]),
                        np.array([2.6e-3, 0.0, 0.0]), scale, powers, elastic, electric,
                        np.array([8.0, 250.0]), springs, SUPPLY, 0.0)


def places(tilt: float) -> np.ndarray:
    made = model()
    middle = made.rest(np.full(4, SUPPLY**2 / 2))
    return circle(middle, tilt, np.arange(24.0) / 24)


@cache
def small_film() -> ReducedFilm:
    """A film of a few snapshots of finite elements, tilted both ways."""
    whole = full_model(quarters(), Settings(MeshSettings().refined(0.4)))
    drives = [{}, *({name: voltage} for name in "ABCD" for voltage in (2e3, 3e3)),
              *(dict.fromkeys("ABCD", voltage) for voltage in (2e3, 3e3))]
    shots = [Snapshot(wired, equilibrium(wired, LOAD, top).state)
             for wired, top in (driven_model(whole, drive) for drive in drives)]
    return Reduction.of(shots, 1e-3, 1e-2, 10, turning=True, freedoms=(2, 3, 4),
                        balance=1.0).film(whole)


@cache
def shifting() -> SteeredModel:
    """The model of :func:`model` whose plate also slides along x, coupled to its tilt along x."""
    plain = model()
    scale, powers = np.append(plain.scale, 2e-3), powers_of(4, 4)
    elastic, electric = np.zeros(len(powers)), np.zeros((4, len(powers)))
    old = {tuple(power): number for number, power in enumerate(plain.powers.tolist())}
    for number, power in enumerate(powers.tolist()):
        if not power[3]:
            elastic[number] = plain.elastic[old[tuple(power[:3])]]
            electric[:, number] = plain.electric[:, old[tuple(power[:3])]]
        elif power == [0, 0, 0, 2]:
            elastic[number] = 80.0 / 2 * scale[3] ** 2
        elif power == [0, 1, 0, 1]:
            elastic[number] = 0.2 * scale[1] * scale[3]
        elif power == [0, 0, 0, 1]:
            electric[:, number] = np.multiply(1e-11, [1, -1, -1, 1])
    springs = np.zeros((2, 4, 4))
    springs[:, :3, :3] = plain.springs
    springs[:, 3, 3] = 50.0, 20.0
    springs[:, 1, 3] = springs[:, 3, 1] = 0.05, 0.02
    mass, damping = np.zeros((4, 4)), np.zeros((4, 4))
    mass[:3, :3], damping[:3, :3] = plain.mass, plain.damping
    mass[3, 3] = 0.015
    damping[3, 3] = 0.3
    return replace(plain, freedoms=(*plain.freedoms, "shift_x"), mass=mass, damping=damping,
                   centre=np.append(plain.centre, 0.0), scale=scale, powers=powers,
                   elastic=elastic, electric=electric, springs=springs)
