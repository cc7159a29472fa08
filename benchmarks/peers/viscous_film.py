"""The film in time that tympan and its peers follow, and the line a peer prints of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TransientProblem:
    """A quarter of an ellipse with a round plate, a neo-Hookean film and one branch; SI units."""

    frame: tuple[float, float] = (75e-3, 45e-3)
    plate: float = 10e-3
    thickness: float = 1e-3
    prestretch: float = 5.0**0.5
    mu: float = 20e3
    branch: float = 1e6
    time: float = 30.0
    permittivity: float = 4.7
    force: float = 17.9e-3 * 9.80665
    voltage: float = 7e3
    end: float = 30.0


@dataclass(frozen=True)
class TransientRow:
    """One run; the field names are those of the printed JSON object."""

    peer: str
    version: str
    method: str
    unknowns: int
    steps: int
    before_m: float
    deflection_m: float
    seconds: float


PROBLEM = TransientProblem()
