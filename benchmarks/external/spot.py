"""The prestretched VHB disc of the public FEniCSx notebooks, by finite elements and by an ODE."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.constants import epsilon_0

from benchmarks.external.case import Case, draw, table, words
from tests.oracles.inflation import Disc, voltage_at
from tests.oracles.laws import gent
from tympan.fem.film.laws import Gent
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Electrode, Film, Region, Specimen
from tympan.reports import look
from tympan.studies.case import Case as FilmCase
from tympan.studies.case import Settings, solve
from tympan.studies.limits import limits

#: Facts of DE06_AXI_preStretch_membrane.ipynb: mounted radii and virgin thickness [m], prestretch,
#: the law at rest, ε_r.
OUTER, PRESTRETCH, THICKNESS = 10e-3, 4.0, 0.2e-3
ELECTRODE = OUTER / 3
MU, J_M, PERMITTIVITY = 15e3, 90.0, 4.8

#: The notebook's unit of voltage: virgin thickness times √(μ/ε).
UNIT = THICKNESS * float(np.sqrt(MU / (epsilon_0 * PERMITTIVITY)))

#: Up to which the equations' voltage is looked at; the law locks at 6.8.
_FAR = 6.6

#: The mesh on which limits are looked for: the default one makes some where the law locks, and says
#: that it hardly resolves them.
FINE = Settings(mesh=MeshSettings().refined(2))

#: Stretches of the electrode over the prestretch at which both are compared.
GROWTHS = (1.02, 1.1, 1.2, 1.3)


def disc() -> Disc:
    """For the ODE."""
    return Disc(0.0, OUTER, THICKNESS, PRESTRETCH, gent(MU, J_M), PERMITTIVITY)


def specimen() -> Specimen:
    """For the finite elements."""
    film = Film(THICKNESS, (PRESTRETCH, PRESTRETCH), Gent(MU, J_M), PERMITTIVITY)
    return Specimen("spot", Circle(OUTER), None, film,
                    Electrode(outline=Region(Circle(ELECTRODE))))


@dataclass(frozen=True)
class Point:
    """At one voltage [V] the electrode's area over its mounted one, by both."""

    voltage: float
    finite_elements: float
    equations: float

    @property
    def error(self) -> float:
        """Of the area, relative."""
        return self.finite_elements / self.equations - 1


def point(growth: float, settings: Settings = Settings()) -> Point:
    """At the voltage at which, by the ODE, the electrode is so much longer.

    Its capacitance goes with the square of its area, since it keeps its volume.
    """
    voltage = voltage_at(disc(), ELECTRODE, growth * PRESTRETCH)
    result = solve(FilmCase(specimen(), voltage=voltage, rig=Rig(gravity=1e-9)), settings)
    flat = (epsilon_0 * PERMITTIVITY * np.pi * ELECTRODE**2 * PRESTRETCH**2 / THICKNESS)
    area = np.nan if result.capacitance_F is None else np.sqrt(result.capacitance_F / flat)
    return Point(voltage, float(area), growth**2)


def section(folder: Path) -> str:
    """Area against voltage by both, where each ends, a picture."""
    points = [point(growth) for growth in GROWTHS]
    case = FilmCase(specimen(), rig=Rig(gravity=1e-9))
    reached, coarse = limits(case, FINE, beyond=True), limits(case, Settings()).tension
    stretches = np.linspace(1.01 * PRESTRETCH, _FAR, 40)
    voltages = [voltage_at(disc(), ELECTRODE, stretch) for stretch in stretches]
    rows = [[f"{item.voltage / 1e3:.4f}", f"{item.voltage / UNIT:.4f}", f"{item.equations:.4f}",
             f"{item.finite_elements:.4f}", f"{item.error:.1e}"] for item in points]
    return words("spot").format(
        unit=UNIT / 1e3, worst=max(abs(item.error) for item in points),
        points=table(["voltage [kV]", "over t₀ √(μ/ε)", "A/A₀, equations",
                      "A/A₀, finite elements", "error"], rows),
        ended=reached.ended.removeprefix("no pull-in was found: "),
        suppressed="no pull-in" if reached.pull_in is None else "a pull-in",
        rises="rises" if np.all(np.diff(voltages) > 0) else "does not rise",
        coarse="none" if coarse is None else coarse.text, far=_FAR, most=voltages[-1] / 1e3,
        picture=draw(folder, "spot", lambda: compose(points)))


def compose(points: list[Point]) -> Figure:
    """Area against the notebook's unit of voltage."""
    figure = look.new_figure(58.0, 110.0)
    axes = look.place_axes(figure, 14, 5, 88, 42)
    growths = np.linspace(1.001, 1.45, 60)
    voltages = [voltage_at(disc(), ELECTRODE, growth * PRESTRETCH) / UNIT for growth in growths]
    axes.plot(voltages, growths**2, color=look.colour_of(0), label="axisymmetric equations")
    axes.plot([item.voltage / UNIT for item in points],
              [item.finite_elements for item in points], "o", markersize=4,
              color=look.colour_of(1), label="tympan")
    look.describe(axes, "voltage over t₀ √(μ/ε)", "area of the electrode, A/A₀")
    axes.legend(loc="upper left")
    return figure


CASE = Case("spot", section)
