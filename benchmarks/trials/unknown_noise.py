"""Verdicts where nobody states the noise, and misfits may be a sensor that wanders.

    python -m benchmarks.trials.unknown_noise [--sets 130] [--keep sets.jsonl] [-o PAGE]

Each set has the paper's three films under two masses, read by finite elements, with one of three
kinds of errors: independent ones, errors that remember the reading before, and a drift besides.
Half of the sets have an effect of 1 to 10 usual sizes, drawn again until it *shows*: it moves a
reading by more than three times the scatter of neighbours, beside what stiffness and permittivity
take up.
"Agrees" may then be said of at most 5 % of the sets, and another effect be named in at most 2 %.
A set is made and judged in some seconds; interrupted, the command goes on with ``--keep``.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.stats import beta

from benchmarks.trials.judging import fitted_to
from benchmarks.trials.synthetic_trials import Truth, draw, drawn_until, readings
from benchmarks.trials.trial import Lab
from tympan.base.arrays import AnyArray
from tympan.studies.diagnosis.fits.fitting import nominal_fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.self_check import sizes_at
from tympan.studies.estimation.noise import SCATTER, Noise

SEED = 59
#: Kinds of errors, in turns.
KINDS = ("independent", "remembering", "drift")
#: Scatter of a reading about its neighbours [m].
SCATTERED = 20e-6
#: Correlation of errors that remember, and how much the sensor drifts in all over their scatter.
REMEMBERED, DRIFTED = 0.8, 3.0
#: Sizes of effects over their usual ones.
SIZES = (1.0, 10.0)
#: Times the scatter from which an effect shows.
SHOWS = 3.0


PAGE = """# Noise that nobody states

`python -m benchmarks.trials.unknown_noise -o docs/unknown-noise.md` makes this page.
It judges {count} datasets that state no noise.

* The films are the paper's three, under two masses. Their readings come from finite elements.
* Successive readings differ by a noise of {scatter:g} µm. It is independent, or it remembers the
  reading before (correlation {correlation:g}), or the sensor drifts besides, by {drift:g} times
  the noise.
* Half of the sets have an effect of {low:g} to {high:g} times its typical size. It is drawn again
  until it *shows*: it moves a reading by more than {shows:g} times the noise, beside what stiffness
  and permittivity take up.
* A drift that is named where the sensor drifts is right.

{table}

Each cell has the 95 % limits of its share. The aims: "agrees" in at most 5 % of the sets in which
an effect shows, another effect in at most 2 % of all.
"""


@dataclass(frozen=True)
class Judged:
    """A set: the kind of its errors, its effect, how much that shows, and what was said."""

    number: int
    kind: str
    effect: str
    shows: float
    verdict: str
    named: str
    of_sensor: bool

    @property
    def agrees(self) -> bool:
        """Whether agreement is said."""
        return self.verdict == "nothing" and not self.of_sensor

    @property
    def wrong(self) -> bool:
        """Whether another effect is named; a drift that is there, too, is none."""
        there = {self.effect, *(("drift",) if self.kind == "drift" else ())}
        return bool(self.named) and not set(self.named.split(" and ")) <= there

    @property
    def right(self) -> bool:
        """Whether its effect is named, and no other."""
        return not self.wrong and self.effect in self.named.split(" and ")


def errors(kind: str, table: ReadingTable, generator: np.random.Generator) -> AnyArray:
    """Errors of a kind in the rows' order [m], whose neighbours differ by the same."""
    fresh = generator.standard_normal(len(table))
    if kind == "independent":
        return SCATTERED * fresh
    if kind == "drift":
        way = float(generator.choice([-1.0, 1.0]))
        return SCATTERED * (fresh + way * DRIFTED * np.linspace(-0.5, 0.5, len(table)))
    values = fresh.copy()
    for row in range(1, len(table)):
        values[row] = REMEMBERED * values[row - 1] + (1 - REMEMBERED**2) ** 0.5 * fresh[row]
    return np.asarray(SCATTERED * values / (1 - REMEMBERED) ** 0.5)


def trial(lab: Lab, number: int) -> Judged:
    """Make a set and judge it."""
    design, simulation = lab.paper
    generator = np.random.default_rng([SEED, number])
    kind, hidden = KINDS[number % len(KINDS)], number // len(KINDS) % 2 == 0

    def drawn() -> Truth:
        nothing = draw(generator, (), "elements")
        if not hidden:
            return nothing
        cause: Cause = design.causes[generator.integers(len(design.causes))]
        share = float(np.exp(generator.uniform(*np.log(SIZES))))
        return Truth(nothing.stiffness, nothing.permittivity, (cause,),
                     tuple(map(float, sizes_at(generator, cause, share))))

    shows = 0.0
    while shows <= SHOWS:
        truth, values, _ = drawn_until(lambda truth: readings(design, truth), drawn)
        table = design.table.with_values(values)
        known = table.with_noise(Noise.of(np.full(len(table), SCATTERED), "stated"))
        shows = float(np.abs(nominal_fit(*fitted_to(simulation, known)).residual).max())
        if not hidden:
            break
    read = values + errors(kind, table, generator)
    unknown = table.with_values(read).with_noise(
        Noise.of(np.full(len(table), 0.02 * float(np.sqrt(np.mean(read**2)))), SCATTER))
    judged = judge(*fitted_to(simulation, unknown), design.causes)
    return Judged(number, kind, " and ".join(map(str, truth.hypothesis)), shows, judged.verdict,
                  " and ".join(map(str, judged.named)), judged.sensor.possible)


def rate(some: int, count: int) -> str:
    """Share with its 95 % limits."""
    if not count:
        return "none"
    low = beta.ppf(0.025, some, count - some + 1) if some else 0.0
    high = beta.ppf(0.975, some + 1, count - some) if some < count else 1.0
    return f"{some} of {count}: {some / count:.0%} ({low:.0%} to {high:.0%})"


def table_of(sets: list[Judged]) -> str:
    """The table of the page."""
    lines = ["| errors | sets | effect shows: agrees said | effect shows: named | another named "
             "| another named where nothing is hidden |", "|---|---|---|---|---|---|"]
    for kind in (*KINDS, "all"):
        own = [one for one in sets if kind in (one.kind, "all")]
        shown = [one for one in own if one.effect and one.shows > SHOWS]
        nulls = [one for one in own if not one.effect]
        lines.append(" | ".join([
            f"| {kind}", str(len(own)), rate(sum(one.agrees for one in shown), len(shown)),
            rate(sum(one.right for one in shown), len(shown)),
            rate(sum(one.wrong for one in own), len(own)),
            rate(sum(one.wrong for one in nulls), len(nulls))]) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=130)
    parser.add_argument("--keep", type=Path, default=None)
    parser.add_argument("-o", "--output", type=Path, default=None)
    asked = parser.parse_args()
    sets = [Judged(**json.loads(line)) for line in asked.keep.read_text("utf-8").splitlines()
            ] if asked.keep is not None and asked.keep.exists() else []
    lab = Lab(SEED)
    for number in range(len(sets), asked.sets):
        sets.append(trial(lab, number))
        print(sets[-1], flush=True)
        if asked.keep is not None:
            with asked.keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(sets[-1])) + "\n")
    print(table_of(sets))
    print(Counter((one.kind, one.verdict, one.of_sensor) for one in sets))
    if asked.output is not None:
        asked.output.write_text(PAGE.format(
            count=len(sets), scatter=1e6 * SCATTERED, correlation=REMEMBERED, drift=DRIFTED,
            low=SIZES[0], high=SIZES[1], shows=SHOWS, table=table_of(sets)), encoding="utf-8")


if __name__ == "__main__":
    main()
