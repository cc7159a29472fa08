"""Lumped actuators the tests share, and static readings made with known constants."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from tests.support.specimens import circular, elliptical
from tympan.fem.film.laws import Gent, Separable
from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.paper.table1 import paper_actuators
from tympan.studies.identify.static import StaticProblem
from tympan.studies.lumped.actuator import Actuator, paper_cones
from tympan.studies.lumped.control.controller import Controller
from tympan.studies.lumped.equilibria import rest
from tympan.studies.lumped.model_file import LumpedModel

TAPE = MATERIALS["vhb-4910"].material
OVAL = elliptical(75e-3, TAPE)
RIG = Rig(gravity=9.81, unaccounted_mass=1e-3, spring=3.0, amplifier_gain=0.02, sag_voltage=40e3)
MODELS = {
    "paper": Actuator.of(paper_actuators(8.5)[2], 17.9e-3, (0.4, 0.6)),
    "tape": Actuator.of(OVAL, 22.45e-3, (0.7, 0.3), rig=RIG),
    "permittivity that falls": Actuator.of(circular(Gent(18e3, 110.0), permittivity_exponent=0.4),
                                           17.9e-3),
    "membrane circles": LumpedModel(OVAL, (45e-3, 75e-3), (0.6, 0.4), 2e-9, 5e3, 1.03, 0.8
                                    ).actuator(17.9e-3, RIG),
}

MASSES, VOLTAGES = (17.9e-3, 22.45e-3), np.linspace(0, 7e3, 8)
# Away from Table 1, where the search begins: what the data do not determine must not be right by
# being held.
TRUTH = np.array([20e3, 20e3, 45e3, -10e3, -80e3, -50e3, 8.5, 0.45])
NOISE = 1e-6  # the paper's sensor


def compiled_controller(controller: Controller, begin: float, folder: Path
                        ) -> Callable[[float, float], float]:
    """The C of a controller: voltage by wanted and read deflection, from rest at one [m]."""
    source, library = folder / "loop.c", folder / "loop.so"
    source.write_text(controller.c_source("2 ovals"), encoding="utf-8")
    subprocess.run(["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared",
                    "-fPIC", "-ffp-contract=off", str(source), "-o", str(library), "-lm"],
                   check=True)
    loaded = ctypes.CDLL(str(library))
    memory = (ctypes.c_double * len(controller.law.c))()
    rested, in_c = loaded.model_2_ovals_controller_rest, loaded.model_2_ovals_controller_voltage
    rested.argtypes, rested.restype = (ctypes.c_void_p, ctypes.c_double), None
    in_c.argtypes, in_c.restype = (ctypes.c_void_p, *2 * [ctypes.c_double]), ctypes.c_double
    rested(memory, begin)
    return lambda wanted, read: float(in_c(memory, wanted, read))


@cache
def clean() -> StaticProblem:
    """Rests of the paper's three actuators with other constants, without noise.

    By :mod:`tympan.studies.lumped.equilibria`.
    """
    law = Separable(tuple(TRUTH[:3]), tuple(TRUTH[3:6]), (2.0, 4.0, 6.0), 5**0.5)
    specimens = tuple(replace(specimen, membrane=replace(specimen.membrane, material=law))
                      for specimen in paper_actuators(8.5))
    rows = [(number, mass, u, rest(Actuator.of(specimen, mass, (0.45, 0.55)), float(u)))
            for number, specimen in enumerate(specimens) for mass in MASSES for u in VOLTAGES]
    which, mass, u, y = np.array(rows).T
    unknown = tuple(
        replace(specimen, membrane=replace(specimen.membrane, relative_permittivity=6.0))
        for specimen in specimens)
    return StaticProblem(paper_cones(unknown), which.astype(int), mass, u, y, NOISE)


def free_energy(actuator: Actuator, state: np.ndarray, voltage: float) -> np.ndarray:
    """[J] of states at a held voltage: motion, weight, film, branches, voltage.

    What the model's own forces derive from. A branch stores V k₁ (1 + ε₁)(x − 1 − ln x), x =
    λ_r/(1 + ε₁): the energy whose derivative by y is its force in Eq. (5), and which Eq. (9)
    can only lower. So at a constant voltage this never grows; the damper η₂ lowers it further
    by V η₂ λ̇_r²/λ_r.
    """
    y, speed, strains = state[..., 0], state[..., 1], state[..., 2:]
    squared = actuator.rig.film_voltage(voltage) ** 2
    x = actuator.circles.stretch(y[..., None])[0] / (1 + strains)
    branch = actuator.viscous.k1 * actuator.circles.volume * (1 + strains) * (x - 1 - np.log(x))
    return (actuator.moved * speed**2 / 2 - actuator.load * y + actuator.elastic(y)[0]
            + squared * actuator.electric(y)[0] + np.sum(actuator.weights * branch, axis=-1))


def noisy(seed: int, noise: float | None = NOISE) -> StaticProblem:
    base = clean()
    read = base.displacement + NOISE * np.random.default_rng(seed).standard_normal(len(base.mass))
    return replace(base, displacement=read, noise=noise, alpha="shared")
