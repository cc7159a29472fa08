"""The pictures of how a verdict is reached: one a step, of one diagnosis.

    python -m benchmarks.verdict_pictures [-o docs]

The readings are those of the benchmark `diagnosis`, the films of three actuators under two masses,
one of them 2 % less stretched than stated; one reading is written 0.4 mm too large.
"""

from __future__ import annotations

import argparse
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from benchmarks.diagnosis import NOISE, readings
from tympan.fem.rig import Rig
from tympan.reports import look
from tympan.studies.diagnosis.calibration import calibrated, with_effects
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.effects import EFFECTS, Setup
from tympan.studies.files import write_atomically
from tympan.studies.shipped import actuators

#: The row that is written wrongly, and by how much [m].
SLIP, BY = 40, 0.4e-3
#: Effects that are shown, of those fitted alone.
SHOWN = 12
#: Height of each picture [mm].
HEIGHT = 62.0
#: Dots to an inch: pages show it as wide as their text.
DPI = 160

#: What is asked in turn, what a yes leads to, and what that means for the person who asked.
QUESTIONS = (
    ("Does the baseline model\nleave only noise, with\nordinary factors?", "nothing",
     "use the model where\nyou measured"),
    ("Does one cause, or one\npair, stand out?", "named", "check it at the bench"),
    ("Does at least one cause\nor pair leave only noise?", "ambiguous",
     "do the next experiment"),
    ("No cause does, or the\ndataset looks wrong.", "unexplained", "look where the misfit is"),
)


def judged() -> tuple[ReadingTable, Judgement]:
    """The readings with their slip, and what is made of them."""
    setup = Setup(actuators(), Rig())
    table = readings(setup)
    values = table.value.copy()
    values[SLIP] += BY
    table = table.with_values(values)
    causes = tuple(Cause(name, which) for name, effect in EFFECTS.items()
                   if not {"direction", "x_mm", "force_mN"} & set(effect.columns)
                   for which in effect.choices(setup))
    simulation = with_effects(calibrated(setup, table).simulation, lambda done, count: None, 2)
    return table, judge(simulation, table, causes, workers=2)


def draw_model(figure: Figure, table: ReadingTable, judgement: Judgement) -> None:
    """Readings of each film, the model as stated and with its two factors fitted."""
    simulation, states = judgement.simulation, table.states
    stated = simulation.predict((), np.zeros(2), table)
    fitted = simulation.predict((), judgement.nominal.unknowns, table)
    for number, specimen in enumerate(simulation.setup.specimens):
        axes = figure.add_subplot(1, 3, number + 1)
        for mass, colour in zip(np.unique(states.mass), look.PALETTE, strict=False):
            rows = np.flatnonzero((states.specimen == number) & (states.mass == mass))
            kilovolts = 1e-3 * states.voltage[rows]
            axes.plot(kilovolts, 1e3 * fitted[rows], "-", color=colour, lw=2, alpha=0.5)
            axes.plot(kilovolts, 1e3 * stated[rows], "--", color="black", lw=0.8)
            axes.plot(kilovolts, 1e3 * table.value[rows], "o", color=colour, ms=2.5)
            if number == 0:
                axes.plot([], [], "o", color=colour, ms=2.5, label=f"{1e3 * mass:.4g} g")
        axes.set(title=specimen.name, xlabel="voltage [kV]")
    figure.axes[0].set_ylabel("deflection [mm]")
    figure.axes[0].plot([], [], "--", color="black", lw=0.8, label="as stated")
    figure.axes[0].plot([], [], "-", color=look.GREY, lw=2, alpha=0.5, label="two factors fitted")
    figure.axes[0].legend(frameon=False)


def draw_noise(figure: Figure, table: ReadingTable, judgement: Judgement) -> None:
    """What the fitted model misses in the order of reading, and the reading that does not count."""
    fitted = judgement.simulation.predict((), judgement.nominal.unknowns, table)
    missed, off = 1e6 * (table.value - fitted), judgement.table.noise.off > 0
    order = 1 + np.arange(len(missed))
    names = [specimen.name for specimen in judgement.simulation.setup.specimens]
    marks = list(zip(np.unique(table.states.mass), "o^", strict=True))
    for place, rows, title in ((1, order > 0, "every reading"), (2, ~off, "without the outlier")):
        axes = figure.add_subplot(1, 2, place)
        axes.axhspan(-2e6 * NOISE, 2e6 * NOISE, color=look.FAINT)
        for (number, name), (mass, mark) in product(enumerate(names), marks):
            those = rows & ~off & (table.specimen == number) & (table.states.mass == mass)
            axes.plot(order[those], missed[those], mark, color=look.PALETTE[2 * number], ms=2.5,
                      label=f"{name}, {1e3 * mass:.4g} g")
        axes.plot(order[rows & off], missed[rows & off], "x", color=look.PALETTE[1], ms=6)
        axes.set(title=title, xlabel="number of the reading")
    figure.axes[0].set_ylabel("residual [µm]")
    figure.axes[0].legend()


def draw_tried(figure: Figure, table: ReadingTable, judgement: Judgement) -> None:
    """What each effect leaves where it alone is put into the model."""
    del table
    every = sorted(judgement.weighed.alone, key=lambda fit: fit.chi_squared)[:SHOWN]
    count = np.count_nonzero(judgement.table.noise.off == 0)
    names = ["no effect", *(" and ".join(map(str, fit.hypothesis)) for fit in reversed(every))]
    left = [judgement.nominal.chi_squared, *(fit.chi_squared for fit in reversed(every))]
    axes = figure.add_subplot()
    axes.barh(names, np.sqrt(np.array(left) / count),
              color=[look.GREY, *[look.PALETTE[0]] * len(every)])
    axes.axvline(1.0, color=look.PALETTE[1], lw=1.5)
    axes.set_xlabel("residual over noise; 1 is noise alone")


def draw_questions(figure: Figure, table: ReadingTable, judgement: Judgement) -> None:
    """The questions that are asked in turn, and the verdict each leads to."""
    del table, judgement
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, 4), ylim=(0, 3))
    axes.axis("off")
    for place, (question, verdict, then) in enumerate(QUESTIONS):
        last = place == len(QUESTIONS) - 1
        _box(axes, place, 2.1, question, look.FAINT)
        _box(axes, place, 0.65, f"{verdict}\n\n{then}", look.PALETTE[4])
        _arrow(axes, (place + 0.5, 1.7), (place + 0.5, 1.1), "" if last else "yes")
        if not last:
            _arrow(axes, (place + 0.93, 2.1), (place + 1.07, 2.1), "no")


def _box(axes: Axes, place: int, middle: float, words: str, colour: str) -> None:
    axes.add_patch(FancyBboxPatch((place + 0.12, middle - 0.38), 0.76, 0.76, facecolor=colour,
                                  boxstyle="round,pad=0.02", edgecolor="none"))
    axes.text(place + 0.5, middle, words, ha="center", va="center")


def _arrow(axes: Axes, begin: tuple[float, float], end: tuple[float, float], words: str) -> None:
    axes.annotate("", end, begin, arrowprops={"arrowstyle": "-|>", "color": look.GREY})
    axes.text(np.mean([begin[0], end[0]]) + 0.04 * (begin[0] == end[0]),
              np.mean([begin[1], end[1]]) + 0.12 * (begin[1] == end[1]), words,
              color=look.GREY, ha="left" if begin[0] == end[0] else "center")


def draw_probable(figure: Figure, table: ReadingTable, judgement: Judgement) -> None:
    """How probable the causes that are tried are, alone and in pairs."""
    del table
    posterior = judgement.posterior
    assert posterior is not None
    axes = figure.add_subplot()
    fits = posterior.fits[:6]
    names = [" and ".join(map(str, fit.hypothesis)) for fit in fits]
    axes.barh(names[::-1], 100 * posterior.probabilities[:len(fits)][::-1], color=look.PALETTE[2])
    axes.set(xlabel="probability [%]", xlim=(0, 100))


PICTURES = {"model": draw_model, "noise": draw_noise, "tried": draw_tried,
            "questions": draw_questions, "probable": draw_probable}


def main() -> None:
    """Write all pictures."""
    parser = argparse.ArgumentParser(description="The pictures of how a verdict is reached.")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs"))
    folder = parser.parse_args().output
    table, judgement = judged()
    for name, draw in PICTURES.items():
        with look.figure_style():
            figure = look.new_figure(HEIGHT, look.WIDTH)
            draw(figure, table, judgement)
            if name != "questions":
                figure.tight_layout()
            write_atomically(folder / f"verdict-{name}.png", partial(figure.savefig, dpi=DPI))
    print(judgement.verdict, *judgement.named, "p", judgement.test.p_value)
    if judgement.posterior is not None:
        print({str(cause): f"{share:.0%}" for cause, share
               in judgement.posterior.of_causes().items()})


if __name__ == "__main__":
    main()
