"""A square membrane of Elastosil 2030: what its frequencies ask of prestretch, air and grease.

Of the facts only those below are public: Solano, Zhang, Cattafesta give the frequencies of one
membrane at two prestretches set by eye, with grease at the larger one, and a law of the film.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

from benchmarks.external.case import Case, draw, table, words
from tympan.fem.film.laws import Yeoh
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Polygon
from tympan.geometry.specimen import Electrode, Film, Specimen
from tympan.reports import look
from tympan.studies.case import Case as FilmCase
from tympan.studies.case import Settings
from tympan.studies.modes import modes

#: Side of the frame and virgin thickness [m]; the published law.
SIDE, THICKNESS = 25.4e-3, 100e-6
LAW = Yeoh((180.7e3, -16.7e3, 6.6e3))
#: Measured [Hz] at prestretches by eye, and how far these may be off; 530 to 532 the second time.
MEASURED, BY_EYE, OFF = (390.0, 531.0), (1.1, 1.3), 0.15
#: With carbon grease of this thickness [m], at the larger prestretch [Hz].
GREASED, GREASE = 444.0, 25e-6
#: From data sheets: the film's and the grease's density, that of still air [kg/m³].
DENSITY, GREASE_DENSITY, AIR = 1080.0, 1100.0, 1.2


def specimen(prestretch: float, grease: float = 0.0) -> Specimen:
    """The membrane with grease on it [kg/m²]."""
    half = SIDE / 2
    corners = ((-half, -half), (half, -half), (half, half), (-half, half))
    film = Film(THICKNESS, (prestretch, prestretch), LAW, 2.8, density=DENSITY)
    return Specimen("elastosil", Polygon(corners), None, film, Electrode(mass=grease))


@lru_cache
def frequency(prestretch: float, grease: float = 0.0, air: float = 0.0) -> float:
    """The lowest frequency across the film [Hz]."""
    rig = Rig(air=air, gravity=1e-9)
    result = modes(FilmCase(specimen(prestretch, grease), rig=rig), Settings(), 6)
    return min(mode.frequency_Hz for mode in result.modes
               if mode.frequency_Hz is not None and mode.name != "film, in plane")


def in_vacuo(prestretch: float) -> float:
    """Of a square drum [Hz], in closed form: √(σ/ρ) / (√2 side)."""
    excess = 2 * prestretch**2 + prestretch**-4 - 3
    slope = sum(number * constant * excess ** (number - 1)
                for number, constant in enumerate(LAW.c, start=1))
    stress = 2 * (prestretch**2 - prestretch**-4) * slope
    return float(np.sqrt(stress / DENSITY) / (np.sqrt(2) * SIDE))


def asked(measured: float, air: float = 0.0, grease: float = 0.0) -> float:
    """The prestretch that has a frequency [Hz]."""
    return float(brentq(lambda stretch: frequency(stretch, grease, air) - measured, 1.03, 1.7,
                        xtol=1e-4))


def asked_grease(prestretch: float, air: float) -> float:
    """The grease [kg/m²] that takes the frequency down to what was measured with it."""
    return float(brentq(lambda grease: frequency(prestretch, grease, air) - GREASED, 0.0, 0.3,
                        xtol=1e-5))


def section(folder: Path) -> str:
    """What was measured, what the model has, what it would take."""
    rows = []
    for measured, by_eye in zip(MEASURED, BY_EYE, strict=True):
        rows.append([f"bare, {by_eye:g} by eye", f"{measured:.0f}", f"{frequency(by_eye):.0f}",
                     f"{frequency(by_eye, air=AIR):.0f}", f"{asked(measured):.3f}",
                     f"{asked(measured, AIR):.3f}"])
    stretched = asked(MEASURED[1], AIR)
    sides = [GREASE * GREASE_DENSITY * count for count in (1, 2)]
    thin, thick = (frequency(stretched, coat, AIR) for coat in sides)
    needed = asked_grease(stretched, AIR)
    slipped = asked(GREASED, AIR)
    return words("elastosil").format(
        frequencies=table(["membrane", "measured [Hz]", "in vacuo", "with air",
                           "prestretch asked for, in vacuo", "with air"], rows),
        closed=max(abs(frequency(stretch) / in_vacuo(stretch) - 1) for stretch in BY_EYE),
        off=OFF, before=MEASURED[1], one=thin, two=thick, needed=1e3 * needed,
        micrometres=1e6 * needed / GREASE_DENSITY, slipped=slipped, stretched=stretched,
        loss=1 - slipped / stretched,
        picture=draw(folder, "elastosil", compose))


def compose() -> Figure:
    """Frequency against prestretch in vacuo, with air, with grease; what was measured."""
    figure = look.new_figure(64.0, 130.0)
    axes = look.place_axes(figure, 14, 5, 108, 48)
    stretches = np.linspace(1.04, 1.5, 8)
    states = (("in vacuo", 0.0, 0.0), ("with air", AIR, 0.0),
              ("with air and grease of 25 µm", AIR, GREASE * GREASE_DENSITY),
              ("with air and 25 µm on each side", AIR, 2 * GREASE * GREASE_DENSITY))
    for number, (name, air, grease) in enumerate(states):
        axes.plot(stretches, [frequency(float(stretch), grease, air) for stretch in stretches],
                  color=look.colour_of(number), label=name)
    axes.errorbar(BY_EYE, MEASURED, xerr=OFF, fmt="ko", markersize=4, capsize=2,
                  label="measured, prestretch by eye")
    axes.errorbar(BY_EYE[1], GREASED, xerr=OFF, fmt="ks", markersize=4, capsize=2,
                  markerfacecolor="white", label="measured with grease")
    look.describe(axes, "prestretch", "lowest frequency [Hz]")
    axes.set_ylim(150, 1050)
    axes.legend(loc="upper left", ncols=2)
    return figure


CASE = Case("elastosil", section)
