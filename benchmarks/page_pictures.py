"""Pictures of the pages that explain: where zero is, curves with their limits, a closed loop.

    python -m benchmarks.page_pictures [-o docs]

`make page-pictures` writes them beside the pages.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import tympan
from tympan.reports import look
from tympan.reports.figures.control import draw_deflections, draw_voltages
from tympan.reports.figures.curve import draw_voltage_curves
from tympan.reports.figures.force import draw_force_curves
from tympan.studies.files import write_atomically
from tympan.studies.lumped.case import LumpedCase
from tympan.studies.lumped.control.run import ControlSettings, controlled
from tympan.studies.shipped import actuators
from tympan.studies.signals import through

#: Dots to an inch: pages show pictures as wide as their text.
DPI = 160
#: Height of the drawing [mm].
HEIGHT = 37.0
#: Half width of the frame's opening and of the plate, in the drawing [mm].
OPENING, PLATE = 30.0, 7.0
#: How far the plate of the drawing is down, without and with a voltage [mm].
HUNG, CHARGED = 7.0, 13.0
#: The paper's lost permittivity and weights, as docs/paper.md finds them.
PERMITTIVITY, ALPHA = 9.735, (0.413, 0.587)


def draw_zero(figure: Figure) -> None:
    """A cut through an actuator: the flat film, under its mass, and under a voltage as well."""
    titles = ("flat, nothing hangs on it", "under the mass", "under the mass and a voltage")
    for place, (title, deflection) in enumerate(zip(titles, (0.0, HUNG, CHARGED), strict=True)):
        axes = figure.add_axes((place / 3, 0, 1 / 3, 1))
        axes.set(xlim=(-44, 44), ylim=(-42, 9), aspect="equal", anchor="C")
        axes.axis("off")
        axes.text(0, 6, title, ha="center", weight="bold")
        _actuator(axes, deflection, place > 0)
        if place == 0:
            axes.text(0, -14, "displacement = 0", color=look.PALETTE[0], ha="center", va="top")
            axes.text(0, -3, "plate", ha="center", va="top")
            axes.text(-18, -3, "film", ha="center", va="top")
            axes.text(-34, -3.5, "frame", ha="center", va="top")
        else:
            axes.annotate("", (19, -deflection), (19, 0), arrowprops={
                "arrowstyle": "-|>", "color": look.PALETTE[0], "shrinkA": 0, "shrinkB": 0})
            axes.plot([PLATE, 22], [-deflection] * 2, color=look.PALETTE[0], lw=0.6)
            axes.text(25, -deflection - 1.5, "displacement\n> 0", color=look.PALETTE[0],
                      ha="center", va="top")
    figure.axes[1].text(-8, -HUNG - 12, "mass:\nplate, hook\nand weight", color=look.PALETTE[1],
                        ha="right", va="center")


def _actuator(axes: Axes, deflection: float, hung: bool) -> None:
    """The frame, the film with its plate so far down, and what hangs on it."""
    axes.plot([-OPENING, OPENING], [0, 0], ":", color=look.GREY, lw=0.8)
    for side in (-1, 1):
        axes.add_patch(Rectangle((side * OPENING, -2.5), side * 8, 5, color=look.GREY))
        along = np.linspace(0.0, 1.0, 30)
        axes.plot(side * (PLATE + (OPENING - PLATE) * along),
                  -deflection * (1 - np.log1p(3 * along) / np.log(4)), color="black")
    orange = {"color": look.PALETTE[1]} if hung else {"color": "#b9bfca"}
    axes.add_patch(Rectangle((-PLATE, -deflection - 0.8), 2 * PLATE, 1.6, **orange))
    if hung:
        axes.plot([0, 0], [-deflection, -deflection - 14], color=look.PALETTE[1], lw=1)
        axes.add_patch(Rectangle((-5, -deflection - 24), 10, 10, **orange))


def draw_limits(figure: Figure) -> None:
    """Deflection against voltage of the silicone film on the page of limits."""
    film = tympan.Film("100 um", 1.1, tympan.material("elastosil-2030"))
    silicone = tympan.Specimen("silicone", tympan.Circle("4.5 cm"),
                               tympan.Plate(tympan.Circle("1 cm")), film)
    result = tympan.curve(silicone, mass="20 g").numbers
    draw_voltage_curves(look.place_axes(figure, look.LEFT, look.TITLE, 158.0, 62.0), result)


def draw_force(figure: Figure) -> None:
    """The oval film of the five-minute start under weights, and under buckled beams."""
    film = tympan.Film("1 mm", 2.236, tympan.material("vhb-4910"))
    plate = tympan.Plate(tympan.Circle("1 cm"), offset=("3 mm", "0 mm"))
    oval = tympan.Specimen("oval", tympan.Ellipse(("6 cm", "4 cm")), plate, film)
    beams = tympan.BuckledBeam(length="30 mm", width="4 mm", thickness="0.13 mm",
                               modulus="1.5 GPa", compression="0.4 mm", number=3, middle="3 mm")
    weights = tympan.force(oval, voltage=["0 kV", "5 kV", "7.5 kV"], to="12 mm",
                           mass=["20 g", "40 g"])
    pushed = tympan.force(oval, voltage=["0 kV", "6 kV"], to="6.5 mm", mass=["20 g"],
                          rig=tympan.Rig(biases=(beams,)))
    width = look.WIDTH / 2
    for number, (result, title) in enumerate(((weights, "weights"), (pushed, "buckled beams"))):
        axes = look.place_axes(figure, look.LEFT + number * width, look.TITLE,
                               width - look.LEFT - look.RIGHT, 74.0)
        draw_force_curves(axes, result.numbers)
        axes.set_title(title, loc="left", weight="bold")


def draw_control(figure: Figure) -> None:
    """The paper's large ellipse in a closed loop, two of four steps near the supply's ends."""
    held = np.repeat([3e3, 4.5e3, 3.5e3, 6.9e3, 0.3e3], 2)
    times = np.array([0.0, 1.0, 1.0, 6.0, 6.0, 11.0, 11.0, 16.0, 16.0, 21.0])
    chosen = LumpedCase((actuators()[2],), mass=17.9e-3, paper=True, alpha=ALPHA,
                        table_1=PERMITTIVITY).chosen(float(held.max()), tympan.Settings())
    film, = controlled(chosen, through(times, held), ControlSettings()).films
    width = look.WIDTH - look.LEFT - look.RIGHT
    above, below = look.place_pair(figure, look.LEFT, 4.0, width, (22.0, look.GAP, 50.0))
    draw_voltages(above, film)
    draw_deflections(below, film)
    look.describe(above, "", "voltage (kV)")
    look.describe(below, "time (s)", "deflection (mm)")
    below.legend(loc="upper left")


PICTURES = {"zero": (HEIGHT, draw_zero), "limits": (82.0, draw_limits),
            "force": (94.0, draw_force), "control": (92.0, draw_control)}


def main() -> None:
    """Write all pictures."""
    parser = argparse.ArgumentParser(description="Pictures of the pages that explain.")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs"))
    folder = parser.parse_args().output
    for name, (height, draw) in PICTURES.items():
        with look.figure_style():
            figure = look.new_figure(height, look.WIDTH)
            draw(figure)
            write_atomically(folder / f"{name}.png", partial(figure.savefig, dpi=DPI))


if __name__ == "__main__":
    main()
