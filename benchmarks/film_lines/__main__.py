"""Effects that heaves confuse, hidden and judged with and without lines over the films.

    python -m benchmarks.film_lines [--sets 2] [-o docs/film-lines.md]

Sizes are from half to ten usual ones, evenly in the logarithm; the readings are made by the whole
field model on meshes of another order, each line with a zero of its own. Each set is judged by its
heaves alone and with a cross of lines over the film in two states.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.film_lines.readings import cross, write
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import calibrated, law_error, with_effects
from tympan.studies.diagnosis.diagnose import with_model_error
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.reduced.simulation import Cause
from tympan.studies.diagnosis.self_check import sizes_at

#: Effects that look alike in the heaves of these films, or show in none.
PAIRS = (("parallel_spring", "prestretch_anisotropy"),
         ("prestretch_anisotropy", "plate_eccentricity"),
         ("sensor_zero", "unaccounted_mass"), ("sensor_gain", "parallel_spring"),
         ("thickness_gradient", "plate_eccentricity"))
SMALLEST, LARGEST = 0.5, 10.0
OUTCOMES = ("named", "listed", "nothing", "unexplained", "another listed", "another named")


@dataclass(frozen=True)
class Trial:
    """An effect hidden at a size over the usual one, and what became of it."""

    effect: str
    size: float
    heaves: str
    lines: str


def hide(effect: str, number: int, count: int, folder: Path) -> Trial:
    """The trial of that number of so many of an effect."""
    random = np.random.default_rng([number, *effect.encode()])
    share = SMALLEST * (LARGEST / SMALLEST) ** ((number + 0.5) / count)
    cause = Cause(effect)
    sizes = sizes_at(random, cause, share)
    values = tuple(parameter.value(size) for parameter, size in zip(
        cause.effect.parameters, sizes.tolist(), strict=True))
    outcomes = []
    for name, places in (("heaves", None), ("lines", cross)):
        data = write(folder / f"{effect}-{number}-{name}", [(effect, values, None)], number,
                     places=places, shapes=["round"])
        outcomes.append(outcome(data, effect, number))
    return Trial(effect, share, *outcomes)


def outcome(data: Path, effect: str, seed: int) -> str:
    """One of :data:`OUTCOMES`."""
    readings = prepared_readings(read_dataset(data))
    nominal = calibrated(readings.setup, readings.table)
    error = law_error(nominal.simulation, nominal.fit, nominal.table)
    table = with_model_error(nominal.table, error, nominal)
    simulation = with_effects(nominal.simulation, lambda done, count: None, 1)
    judged = judge(simulation, table, readings.causes, readings.stated, seed=seed)
    if judged.verdict == "named":
        return "named" if {cause.name for cause in judged.named} == {effect} else "another named"
    if judged.verdict == "ambiguous":
        suspects = {cause.name for cause in judged.suspects}
        return "listed" if effect in suspects else "another listed"
    return judged.verdict


def table(trials: Sequence[Trial]) -> list[str]:
    """Lines of a table: of each pair, what heaves alone and what lines make of its sets."""
    lines = ["| hidden, in turn | sets | judged by | " + " | ".join(OUTCOMES) + " |",
             "|---" * (3 + len(OUTCOMES)) + "|"]
    for pair in PAIRS:
        some = [trial for trial in trials if trial.effect in pair]
        for name, seen in (("heaves", [trial.heaves for trial in some]),
                           ("heaves and lines", [trial.lines for trial in some])):
            counts = Counter(seen)
            lines.append(f"| {' or '.join(pair)} | {len(some)} | {name} | "
                         + " | ".join(str(counts[outcome]) for outcome in OUTCOMES) + " |")
    return lines


def page(trials: Sequence[Trial]) -> str:
    """The page, with every trial."""
    rows = [f"| {trial.effect} | {trial.size:.2g} | {trial.heaves} | {trial.lines} |"
            for trial in trials]
    text = Path(__file__).with_name("page.md").read_text(encoding="utf-8")
    return text.format(table="\n".join(table(trials)), trials="\n".join(rows))


def main(arguments: Iterable[str]) -> None:
    """Run all trials and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=2, help="of each effect")
    parser.add_argument("-o", type=Path, help="file for the page")
    options = parser.parse_args(list(arguments))
    effects = list(dict.fromkeys(name for pair in PAIRS for name in pair))
    trials = []
    with TemporaryDirectory() as folder:
        for number in range(options.sets):
            for effect in effects:
                trials.append(hide(effect, number, options.sets, Path(folder)))
                print(trials[-1], file=sys.stderr, flush=True)
    print("\n".join(table(trials)))
    if options.o:
        options.o.write_text(page(trials), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
