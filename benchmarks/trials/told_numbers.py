"""Numbers in the sentences of a diagnosis, held against the truth, by kind of sentence.

    python -m benchmarks.trials.told_numbers [--sets 200] [--workers 2] [--keep FILE]
        [-o docs/told-numbers.md]

Each set has the paper's three films under two masses, read by finite elements, from files to the
result. Films are softer or stiffer than stated, and their permittivity is another. Something is
hidden, in turns: an effect, drawn as the diagnosis assumes until it shows; the same beside slips of
the pen; what one film alone has; a weight with a wrong label; nothing. Interrupted, the command
goes on with ``--keep``.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from functools import cache
from math import inf
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.trials.judging import fitted_to, ratio_of
from benchmarks.trials.mess import slips
from benchmarks.trials.random_designs import write_readings
from benchmarks.trials.synthetic_trials import (
    ALIASES,
    NOBODY,
    Design,
    Truth,
    draw,
    drawn_until,
    readings,
)
from benchmarks.trials.trial import Lab
from benchmarks.trials.unknown_noise import rate
from benchmarks.trials.unmodelled_faults import FURTHER, STRANGERS
from tympan.base.arrays import Array
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.conclusions import Conclusions
from tympan.studies.diagnosis.diagnose import conclude
from tympan.studies.diagnosis.fits.fitting import nominal_fit
from tympan.studies.diagnosis.hypothesis import uses_of
from tympan.studies.diagnosis.result import Diagnosis, FoundCause
from tympan.studies.effects.effect import EFFECTS, EffectFamily, extended
from tympan.studies.estimation.noise import Noise

SEED = 5906
#: What is hidden, in turns.
KINDS = ("effect", "effect", "effect beside slips", "effect", "one film", "one weight",
         "effect", "nothing")
#: Noise of a reading, as stated [m].
SIGMA = 20e-6
#: Times the noise from which what is hidden shows.
SHOWS = 4.0
#: Strangers that families of effects name as well.
OF_ONE_FILM = ("one electrode patchy", "one electrode without a sector")
OF_ONE_WEIGHT = "one weight mislabelled"
#: Error of a told noise that counts as right, as a share.
ABOUT = 0.25
#: What a row that is off should have read, over the noise of a reading, up to which it is right.
ROW = 3.0

PAGE = """# Numbers in sentences, held against the truth

`python -m benchmarks.trials.told_numbers -o docs/told-numbers.md` makes this page. It diagnoses
{count} datasets, from files to the result.

* The films are the paper's three, under two masses. Their readings come from finite elements, with
  a noise of {sigma:g} µm.
* All films are softer or stiffer than stated, by 10 %, and their permittivity is off by 5 %.
* Hidden is an effect in five of eight sets, in one of these beside slips of the pen. In one of
  eight one film's electrode is patchy or lacks a sector. In one a weight has a wrong label. In one
  nothing is hidden. Effects have sizes as the diagnosis assumes, drawn again until they show.
* A number counts where its sentence was said, and its cause is what was hidden.

{table}

The limits that a sentence states should have the truth in 92 to 98 % of the sets. A family's limits
are wider: they hold for all its members. Those of a gain are wider than they need be. The ratio of
a gain is that of the very readings held out, without their noise.
"""


@dataclass(frozen=True)
class Told:
    """A number that was told: of which kind of sentence, its limits, and what is true."""

    number: int
    sentence: str
    about: str
    low: float
    high: float
    true: float

    @property
    def right(self) -> bool:
        """Whether the truth is within its limits, but for the digits that are shown."""
        room = 1e-6 * max(abs(self.low), abs(self.high))
        return self.low - room <= self.true <= self.high + room


def trial(lab: Lab, number: int) -> list[Told]:
    """Make a set, diagnose it, and list the numbers that are told of it."""
    generator, kind = np.random.default_rng([SEED, number]), KINDS[number % len(KINDS)]
    design, simulation = lab.paper
    visible = [cause for cause in design.causes if cause.name not in ALIASES]

    def drawn() -> Truth:
        if kind.startswith("effect"):
            cause = visible[int(generator.integers(len(visible)))]
            return draw(generator, (cause,), "elements")
        name = (OF_ONE_WEIGHT if kind == "one weight" else
                OF_ONE_FILM[number // len(KINDS) % len(OF_ONE_FILM)])
        faults = STRANGERS | FURTHER
        stranger = NOBODY if kind == "nothing" else faults[name](generator, design)
        return draw(generator, (), "elements", stranger)

    shows = 0.0
    while shows < SHOWS:
        truth, values, _ = drawn_until(lambda truth: readings(design, truth), drawn)
        known = design.table.with_values(values).with_noise(
            Noise.of(np.full(len(values), SIGMA), "stated"))
        shows = inf if kind == "nothing" else float(
            np.abs(nominal_fit(*fitted_to(simulation, known)).residual).max())
    if kind.endswith("slips"):
        errors, off = slips(generator, len(values), SIGMA)
    else:
        errors, off = generator.normal(0, SIGMA, len(values)), []
    with TemporaryDirectory() as place:
        write_readings(design, Path(place), {"displacement_mm": 1e3 * (values + errors)}, SIGMA)
        conclusions = conclude(read_dataset(Path(place)), seed=number)
        result = conclusions.diagnosis()
    return list(_told(number, design, truth, values, off, conclusions, result))


def _told(number: int, design: Design, truth: Truth, values: Array, off: list[int],
          conclusions: Conclusions, result: Diagnosis) -> Iterator[Told]:
    """The numbers that a result tells, with the truth."""
    noise = 1e6 * SIGMA
    yield Told(number, "noise of a reading, within 25 %", "", (1 - ABOUT) * result.misfit.noise,
               (1 + ABOUT) * result.misfit.noise, noise)
    for row in result.readings_off:
        # Lines of the file, below its heading.
        true, room = 1e3 * float(values[row.line - 2]), 1e-3 * ROW * noise
        yield Told(number, "what a line that is off should read, within 3 times the noise",
                   "a slip" if row.line - 2 in off else "no slip", row.expected - room,
                   row.expected + room, true)
    if not truth.hypothesis and truth.stranger is NOBODY:
        for name, factor in result.baseline.items():
            true = truth.stiffness if name == "stiffness_factor" else truth.permittivity
            yield Told(number, "factor on stiffness or permittivity", name, factor.low, factor.high,
                       true)
    for cause in result.causes:
        if cause.named or result.verdict == "ambiguous":
            yield from _of_cause(number, design, truth, cause)
    if result.gain is not None and result.gain.low is not None and truth.hypothesis:
        judgement = conclusions.judgement
        assert len(judgement.table) == len(values), "one reading a line, in their order"
        exact = judgement.table.with_values(values)
        ratio = ratio_of(judgement.simulation, conclusions.gain,
                         lambda split: exact[split.rows].compact())
        if ratio is not None and result.gain.high is not None:
            yield Told(number, "ratio of the gain", "beside slips" if off else "", result.gain.low,
                       result.gain.high, ratio)


def _of_cause(number: int, design: Design, truth: Truth, cause: FoundCause) -> Iterator[Told]:
    """The numbers that are told of a cause, where that is what is hidden."""
    effect, stranger = EFFECTS[cause.effect], truth.stranger
    hidden = {(each.name, each.which) for each in truth.hypothesis}
    if cause.family is not None and effect.family is not None:
        alike = any(EFFECTS[name].family is effect.family and which == cause.which
                    for name, which in hidden)
        at_fault = stranger.at_fault or None
        if alike or (stranger.family is effect.family and at_fault == cause.which):
            size = cause.family.size
            yield Told(number, f"size of the family {effect.family.name}", cause.effect,
                       _end(size.low, -inf), _end(size.high, inf),
                       effect.family.measure.shown(
                           _measured(design, truth, effect.family, cause.which)))
    elif (cause.effect, cause.which) in hidden:
        sizes = iter(truth.sizes)
        for parameter in effect.parameters:
            true, size = parameter.shown(parameter.value(next(sizes))), cause.parameters.get(
                parameter.name)
            # Where its sign changes no reading, a size is told without it.
            true = abs(true) if parameter.even else true
            # A number that says how another acts, such as a direction, has no two ends.
            if size is not None and not parameter.spread:
                yield Told(number, "size of a cause", effect.name, _end(size.low, -inf),
                           _end(size.high, inf), true)
    for label, low, high in re.findall(r"that of ([\d.]+) g has ([\d.]+) to ([\d.]+) g",
                                       cause.headline):
        true = 1e3 * stranger.mass(1e-3 * float(label))
        if stranger.at_fault == "mass" and true != float(label):
            # The sentence shows four digits.
            room = 5e-4 * true
            yield Told(number, "what one load weighs", label, float(low) - room,
                       float(high) + room, true)


def _end(limit: float | None, unknown: float) -> float:
    return unknown if limit is None else limit


def _measured(design: Design, truth: Truth, family: EffectFamily, which: str | None) -> float:
    """The measure of a family, of the films that are there over those without what is hidden."""
    films = design.setup.with_films(lambda film: replace(
        film, relative_permittivity=truth.permittivity * film.relative_permittivity))
    there = truth.stranger.setup(extended(films, uses_of(truth.hypothesis, truth.unknowns)))
    pairs = zip(there.specimens, films.specimens, strict=True)
    return float(np.mean([family.of(one, there.rig) - family.of(other, films.rig)
                          for one, other in pairs if which in (None, other.name)]))


def table_of(told: list[Told]) -> str:
    """The table of the page."""
    lines = ["| sentence | the truth is within its limits |", "|---|---|"]
    for sentence in sorted({one.sentence for one in told}):
        some = [one for one in told if one.sentence == sentence]
        lines.append(f"| {sentence} | {rate(sum(one.right for one in some), len(some))} |")
    return "\n".join(lines)


def study(count: int, workers: int, keep: Path | None = None) -> list[Told]:
    """The numbers told of the first ``count`` sets; what ``keep`` has is not made again."""
    sets = ([json.loads(line) for line in keep.read_text("utf-8").splitlines()]
            if keep is not None and keep.exists() else [])
    told = [Told(**row) for one in sets for row in one["told"] if one["set"] < count]
    missing = sorted(set(range(count)) - {one["set"] for one in sets})
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        for future in as_completed([pool.submit(_run, number) for number in missing]):
            number, rows = future.result()
            told += rows
            for row in rows:
                print("" if row.right else "MISSED", row, flush=True)
            if keep is not None:
                with keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"set": number, "told": list(map(asdict, rows))}) + "\n")
    return told


@cache
def _lab() -> Lab:
    """The films of all sets, which each process makes once."""
    return Lab(SEED)


def _run(number: int) -> tuple[int, list[Told]]:
    return number, trial(_lab(), number)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep", type=Path, default=None)
    parser.add_argument("-o", "--output", type=Path, default=None)
    asked = parser.parse_args()
    table = table_of(study(asked.sets, asked.workers, asked.keep))
    print(table)
    if asked.output is not None:
        asked.output.write_text(PAGE.format(count=asked.sets, sigma=1e6 * SIGMA, table=table),
                                encoding="utf-8")


if __name__ == "__main__":
    main()
