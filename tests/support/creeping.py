"""The film of the reference values in time, and the equations that gave them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tests.oracles.creep import CreepingFilm
from tests.support.specimens import circular
from tympan.fem.film.laws import NeoHooke
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.studies.case import Settings
from tympan.studies.signals import Pieces
from tympan.studies.transient import History, TransientCase, history

MASS = 17.9e-3
FORCE = MASS * 9.80665
TIMES = np.array([1.0, 10.0, 30.0, 100.0])
EXACT = CreepingFilm(10e-3, 45e-3, 1e-3, 5**0.5, 20e3, 200e3, 10.0, 4.7)


def film(*branches: ViscousBranch) -> Specimen:
    """That of the reference values, with other branches."""
    specimen = circular(NeoHooke(20e3))
    return replace(specimen, membrane=replace(specimen.membrane, branches=branches))


CREEPS = film(ViscousBranch(200e3, 10.0))


def stepped(low: float, high: float, times: np.ndarray) -> Pieces:
    """From one voltage to another at once, with breaks at times."""
    return Pieces(np.r_[0.0, 0.0, times], np.r_[low, np.full(len(times) + 1, high)])


def moved(specimen: Specimen, signal: Pieces, **more: Any) -> History:
    """Its motion under the mass."""
    return history(TransientCase(specimen, signal, mass=MASS, **more), Settings())
