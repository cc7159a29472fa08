"""Films whose electrode covers sectors, for tympan and its peers, and the line a peer prints."""

from __future__ import annotations

from dataclasses import dataclass

#: Electric permittivity of vacuum [F/m], CODATA 2022, and standard gravity [m/s²].
EPSILON_0, GRAVITY = 8.8541878188e-12, 9.80665


@dataclass(frozen=True)
class Sector:
    """A sector of the electrode, counterclockwise from ``start`` to ``end`` [deg].

    It has a ``voltage`` [V] of its own. The sectors of a film do not overlap.
    """

    start: float
    end: float
    voltage: float


@dataclass(frozen=True)
class SectorFilm:
    """A prestretched film between two circles, with an electrode in sectors; SI units.

    ``terms``: μ [Pa] and α of each Ogden term, energy μ/α (λ₁^α + λ₂^α + λ₃^α − 3). One term with
    α = 2 is neo-Hookean. ``drawn``: deflection [m] at which the plate is held, not tilted nor
    shifted, for force and moments.
    """

    name: str
    terms: tuple[tuple[float, float], ...]
    sectors: tuple[Sector, ...]
    inner: float = 10e-3
    outer: float = 45e-3
    thickness: float = 1e-3
    prestretch: float = 5.0**0.5
    permittivity: float = 4.7 * EPSILON_0
    mass: float = 17.9e-3
    drawn: float = 2e-3

    @property
    def weight(self) -> float:
        """Dead load at the plate's centre [N]."""
        return self.mass * GRAVITY


@dataclass(frozen=True)
class SectorRow:
    """One film on one mesh, by one package; the field names are those of the printed JSON object.

    Deflection, shift and rotation vector belong to the plate under its weight. So do the
    ``capacitances`` of the sectors, one by one, and the least principal true stress ``tension``
    at the points where the package computes it. ``forces_N`` along x, y and the load, and
    ``moments_Nm`` about x and y through the centre, hold the plate drawn out.
    """

    package: str
    film: str
    mesh: str
    unknowns: int
    deflection_m: float
    rx: float
    ry: float
    rz: float
    x_m: float
    y_m: float
    capacitances_F: tuple[float, ...]
    tension_Pa: float
    forces_N: tuple[float, float, float]
    moments_Nm: tuple[float, float]
    seconds: float


#: Terms of both laws, by name.
LAWS = {"neo-Hooke": ((20e3, 2.0),), "Ogden": ((30e3, 1.3), (2e3, 5.5))}

#: One quarter along the axes and one turned by -20°, each law, 3.5 and 5 kV.
QUARTERS = tuple(
    SectorFilm(f"{law}, {start:g} to {start + 90:g} deg, {voltage / 1e3:g} kV", terms,
               (Sector(start, start + 90.0, voltage),))
    for law, terms in LAWS.items() for start in (0.0, -20.0) for voltage in (3.5e3, 5e3))

#: Four quarters of one film, each with a voltage of its own.
FOUR = SectorFilm("neo-Hooke, four quarters, 5, 3.5, 0 and 2 kV", LAWS["neo-Hooke"],
                  tuple(Sector(90.0 * k - 20, 90.0 * k + 70, voltage)
                        for k, voltage in enumerate((5e3, 3.5e3, 0.0, 2e3))))

FILMS = (*QUARTERS, FOUR)
