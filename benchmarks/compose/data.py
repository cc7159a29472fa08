"""Diagnose readings of every film on every rig: nothing hidden in them, and one effect.

    python -m benchmarks.compose.data FOLDER [--only WORD] [--seed S] [--workers 2] [--again]
        [-o docs/data-matrix.md]

The films and rigs are those of :mod:`benchmarks.compose.concepts`, each alone. The page says how
readings are made. Judgements are kept in FOLDER; a run goes on from them.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
import traceback
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from benchmarks.compose.concepts import (
    PLAIN,
    Asked,
    Combination,
    alone,
    concepts,
    write_drawings,
)
from benchmarks.trials.judging import stands_out
from benchmarks.trials.synthetic_trials import (
    Design,
    Truth,
    design_of,
    draw,
    readings,
)
from benchmarks.trials.unknown_noise import rate
from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Content
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import toml
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.diagnose import conclude
from tympan.studies.diagnosis.hypothesis import Hypothesis
from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import States
from tympan.studies.effects.effect import EFFECTS, Setup

#: Masses over that which questions have, and voltages over that which they have: twice it is 6 kV
#: of the plain film, of some 9.7 kV at which it loses its pull when flat.
MASSES, VOLTAGES = (1.0, 1.25), np.linspace(0.0, 2.0, 9)
#: Part of the voltages that is left where a film has no equilibrium at the highest.
_LESS = 0.8
#: Noise over the largest change of a reading, and its limits [m].
NOISE, LEAST_NOISE, MOST_NOISE = 4e-3, 1e-6, 20e-6
#: Times the noise by which an effect moves a reading from what stiffness and permittivity leave.
SHOWS = 4.0
#: Sizes of effects over their usual ones, each power of ten as probable as another.
SIZES = (1.0, 10.0)
#: Effects drawn before a film is said to have none that shows.
_DRAWS = 20
#: Change of stiffness and of permittivity by which readings are linear, as a share.
_STEP = 1e-3
#: What every diagnosis fits, and the steps by which it is fitted here, with the same slopes.
FACTORS = ("stiffness", "permittivity")
_STEPS = 4
#: Headings of tables, and those that a dataset maps.
HEADINGS = ("mass_g", "voltage_kV", "displacement_mm")
MAPPED = {"specimen": "Probe", "mass_g": "Gewicht am Teller [g]", "voltage_kV": "U soll [kV]",
          "displacement_mm": "Weg [mm]"}
#: How many causes of a list are printed.
_FIRST = 4
PAGE = """# Readings of every film on every rig

`python -m benchmarks.compose.data FOLDER -o docs/data-matrix.md` makes this page. It diagnoses two
datasets of each film and rig of [everything with everything](composition.md): one in which nothing
is hidden, and one with an effect.

* Readings are at {states} states: up to two masses, and voltages to twice those of the other
  questions, or as far as the film goes. They come from finite elements of another order than those
  of the diagnosis, on a finer mesh, under loads. Films of the paper's law follow another law's
  code there, whose stresses differ by 0.05 %.
* All films are softer or stiffer than stated, by 10 %, and their permittivity is off by 5 %.
* The noise is {noise:g} of the largest change of a reading, and at most {most:g} µm.
* The effect is drawn from those that the film and its rig may have, at {low:g} to {high:g} times
  its typical size. It is drawn again until it moves a reading by more than {shows:g} times the
  noise, beside what stiffness and permittivity take up.
* Half of the tables have headings of their own, such as "Weg [mm]", which the dataset maps.

An effect is *identifiable* if it improves χ² by {seen:g}, and by {told:g} more than every other
effect, computed from readings without noise. One film alone tells few effects apart. A name counts
as right if it is the effect, or one of its family, as the page then tells what all of that have in
common. Nothing is read of a plate that is held.

{table}

## Each of them

| film or rig | hidden | χ² of it | χ² from the best other | verdict | named, or first suspects |
|---|---|---|---|---|---|
{rows}
"""
#: Verdict of what ended in an error that no input should end in, and of what was refused.
RAISED, REFUSED = "raised", "refused"


@dataclass(frozen=True)
class Judged:
    """A dataset: its film and rig, what is hidden, and what was said.

    ``shows``: the largest change of a reading over its noise, beside what stiffness and
    permittivity take up; ``seen``, ``apart``: χ² of the effect, and from the best other one;
    ``said``: why nothing was said.
    """

    case: str
    hidden: str
    mapped: bool
    shows: float
    verdict: str
    named: tuple[str, ...]
    listed: tuple[str, ...]
    seen: float
    apart: float
    seconds: float
    said: str = ""

    @property
    def ended(self) -> bool:
        """Whether there is a verdict."""
        return self.verdict not in (RAISED, REFUSED)

    @property
    def identifiable(self) -> bool:
        """Whether the readings tell the effect from every other one."""
        return self.seen >= SEEN and self.apart >= TOLD

    @property
    def wrong(self) -> bool:
        """Whether an effect is named that is not there, nor one of its family."""
        return not all(_alike(name, self.hidden) for name in self.named)

    @property
    def right(self) -> bool:
        """Whether its effect or the family of that is named, and no other."""
        return bool(self.named) and not self.wrong


def _alike(name: str, other: str) -> bool:
    one, two = (EFFECTS.get(which.partition(" ")[0]) for which in (name, other))
    return one is not None and two is not None and (
        one is two or (one.family is not None and one.family is two.family))


@dataclass(frozen=True)
class Read:
    """Readings of a design without noise [m], and the noise of one [m]."""

    design: Design
    truth: Truth
    values: Array
    noise: float
    shows: float = 0.0


def design_for(asked: Asked, share: float) -> Design:
    """States of a film on its rig: each mass, and voltages up to a share of the usual highest."""
    rig = Rig() if asked.rig is None else Rig.read(asked.rig)
    masses = np.array([0.0] if asked.mass is None else [share * asked.mass for share in MASSES])
    mass, voltage = (axis.ravel() for axis in np.meshgrid(
        np.round(masses, 6), np.round(share * asked.voltage * VOLTAGES, -1), indexing="ij"))
    # A plate that rubs, and a lag, are read on the way up.
    direction = 1.0 if rig.friction or rig.lag_voltage else 0.0
    states = States.of([0] * len(mass), mass, voltage, 0.0, direction)
    return design_of(asked.combination.stem, Setup((asked.specimen,), rig), states)


def nothing_hidden(asked: Asked, generator: np.random.Generator) -> Read:
    """Readings without an effect, at the highest voltages that the film has."""
    law = asked.combination.content("film")["membrane"]["material"]
    means = "another law" if law == PLAIN["membrane"]["material"] else "elements"
    truth, share = draw(generator, (), means), 1.0
    while True:
        design = design_for(asked, share)
        values = readings(design, truth)
        if values is not None:
            noise = float(np.clip(NOISE * np.ptp(values), LEAST_NOISE, MOST_NOISE))
            return Read(design, truth, values, float(f"{noise:.2g}"))
        share *= _LESS


def one_hidden(nothing: Read, generator: np.random.Generator) -> Read | None:
    """The same with an effect that shows; None where none did."""
    design = nothing.design
    slopes = []
    for name in FACTORS:
        changed = _with_factors(nothing, {name: 1 + _STEP})
        if changed is None:
            return None
        slopes.append((changed - nothing.values) / _STEP)
    # Amplifier gain is permittivity.
    causes = [cause for cause in design.causes if cause.name != "amplifier_gain"]
    for _ in range(_DRAWS):
        cause = causes[int(generator.integers(len(causes)))]
        size = draw(generator, (cause,), nothing.truth.means, widths=SIZES).sizes
        truth = replace(nothing.truth, hypothesis=(cause,), sizes=size)
        values = readings(design, truth)
        if values is None:
            continue
        # A film that shows little to first order is not fitted.
        change, slope = values - nothing.values, np.transpose(slopes)
        first = change - slope @ np.linalg.lstsq(slope, change, rcond=None)[0]
        if np.abs(first).max() < SHOWS * nothing.noise:
            continue
        shows = _left(nothing, values, slope) / nothing.noise
        if shows >= SHOWS:
            return Read(design, truth, values, nothing.noise, shows)
    return None


def _with_factors(nothing: Read, factors: Mapping[str, float]) -> Array | None:
    """Readings of films with other factors on stiffness and permittivity."""
    truth = nothing.truth
    return readings(nothing.design, replace(truth, **{
        name: factor * getattr(truth, name) for name, factor in factors.items()}))


def _left(nothing: Read, values: Array, slopes: Array) -> float:
    """What stiffness and permittivity, fitted, leave of readings at most [m]."""
    factors, model, least = np.ones(len(FACTORS)), nothing.values, np.inf
    for _ in range(_STEPS):
        factors = factors + np.linalg.lstsq(slopes, values - model, rcond=None)[0]
        found = _with_factors(nothing, dict(zip(FACTORS, factors.tolist(), strict=True))
                              ) if factors.min() > 0 else None
        if found is None:
            break
        model, least = found, min(least, float(np.abs(values - found).max()))
    # Without a film that fits nearly, nothing is taken up.
    return least if np.isfinite(least) else float(np.abs(values - nothing.values).max())


def write(asked: Asked, read: Read, folder: Path, mapped: bool,
          generator: np.random.Generator) -> None:
    """A dataset's folder with these readings, and with the files that its film and rig name."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in asked.film.parent.iterdir():
        if file.suffix != ".toml" or file.stem == PLAIN["name"]:
            shutil.copy(file, folder)
    rig, states = asked.combination.content("rig"), read.design.table.states
    heading = MAPPED if mapped else {name: name for name in MAPPED}
    loaded, directed = asked.mass is not None, bool(states.direction.any())
    content: Content = {"name": asked.combination.stem, "noise": f"{1e6 * read.noise:.3g} um",
                        "specimen": [asked.combination.content("film")],
                        **({"rig": rig} if rig else {})}
    if mapped:
        content["columns"] = {"static": {
            name: own for name, own in MAPPED.items() if loaded or name != "mass_g"}}
    (folder / "dataset.toml").write_text(toml(content), encoding="utf-8")
    names = [name for name in HEADINGS if loaded or name != "mass_g"]
    columns = {"mass_g": 1e3 * states.mass, "voltage_kV": 1e-3 * states.voltage,
               "displacement_mm": 1e3 * (read.values + read.noise * generator.standard_normal(
                   len(states)))}
    lines = [",".join([heading["specimen"], *(heading[name] for name in names),
                       *(["direction"] if directed else [])])]
    for row in np.transpose([columns[name] for name in names]).tolist():
        lines.append(",".join([asked.specimen.name, *(f"{value:.7g}" for value in row),
                               *(["up"] if directed else [])]))
    (folder / "static.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def judged(case: str, read: Read, folder: Path, mapped: bool, seed: int) -> Judged:
    """What a diagnosis says of a dataset."""
    began = time.process_time()
    blank = Judged(case, " and ".join(map(str, read.truth.hypothesis)), mapped, read.shows, RAISED,
                   (), (), 0.0, 0.0, 0.0)
    try:
        conclusions = conclude(read_dataset(folder), seed=seed)
    except InputError as refused:
        return replace(blank, verdict=REFUSED, said=str(refused))
    except Exception:  # whatever it raises is what is looked for
        return replace(blank, said=traceback.format_exc())
    judgement = conclusions.judgement
    seen, apart = _identifiable(judgement, read)
    return replace(blank, verdict=judgement.verdict, named=tuple(map(str, judgement.named)),
                   listed=tuple(map(str, judgement.weighed.suspects)), seen=seen, apart=apart,
                   seconds=time.process_time() - began)


def _identifiable(judgement: Judgement, read: Read) -> tuple[float, float]:
    """χ² of what is hidden, and from the best other effect, by readings without noise."""
    truth: Hypothesis = read.truth.hypothesis
    if not truth or len(judgement.table) != len(read.values):
        return 0.0, 0.0
    return stands_out(judgement.simulation, read.truth, judgement.table.with_values(read.values),
                      read.design.causes, judgement)


def of_combination(combination: Combination, number: int, folder: Path, seed: int) -> list[Judged]:
    """Both datasets of a film on a rig; none where the plate is held: nothing is read of it."""
    generator, asked = np.random.default_rng([seed, number]), combination.write(folder / "in")
    if asked.rig is not None and Rig.read(asked.rig).guide == "fixed":
        return []
    nothing = nothing_hidden(asked, generator)
    hidden = one_hidden(nothing, generator)
    found = []
    for place, read in enumerate((nothing, hidden)):
        if read is None:
            continue
        mapped, own = bool((number + place) % 2), folder / "sets" / f"{combination.stem}-{place}"
        write(asked, read, own, mapped, generator)
        found.append(judged(combination.name, read, own, mapped, number))
    return found


def table_of(rows: list[Judged]) -> Iterator[str]:
    """Counts of the page."""
    yield "| readings | sets | raised | refused | a wrong name | named | the same, identifiable |"
    yield "|---|---|---|---|---|---|---|"
    for words, mapped in (("headings as tympan has them", False), ("mapped headings", True)):
        for what, hidden in (("nothing hidden", False), ("one effect", True)):
            own = [row for row in rows if row.mapped == mapped and bool(row.hidden) == hidden]
            ended = [row for row in own if row.ended]
            clear = [row for row in ended if row.identifiable]
            raised, refused = (sum(row.verdict == how for row in own) for how in (RAISED, REFUSED))
            yield (f"| {words}, {what} | {len(own)} | {raised} | {refused} | "
                   f"{sum(row.wrong for row in ended)} | {sum(row.right for row in ended)} | "
                   f"{rate(sum(row.right for row in clear), len(clear)) if hidden else ''} |")


def row_of(row: Judged) -> str:
    """Line of the page for a set with an effect."""
    chi, apart = (f"{value:.0f}" if row.ended else "" for value in (row.seen, row.apart))
    said = ", ".join(row.named or row.listed[:_FIRST])
    return f"| {row.case} | {row.hidden} | {chi} | {apart} | {row.verdict} | {said} |"


def main() -> int:
    """Print what ended otherwise, and counts; 1 where a set raised or was named wrongly."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.compose.data",
                                     description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", metavar="WORD", help="combinations with this word")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--again", action="store_true",
                        help="ask again what raised, was refused or named wrongly")
    parser.add_argument("-o", "--output", type=Path, help="page to write")
    asked = parser.parse_args()
    folder = asked.folder.resolve()
    (folder / "in").mkdir(parents=True, exist_ok=True)
    write_drawings(folder / "in")
    log = folder / "judged.jsonl"
    rows = [Judged(**{**row, "named": tuple(row["named"]), "listed": tuple(row["listed"])})
            for row in map(json.loads, log.read_text("utf-8").splitlines() if log.exists() else [])]
    kept = {(row.case, bool(row.hidden)): row for row in rows}
    bad = {row.case for row in kept.values() if not row.ended or row.wrong}
    known = {row.case for row in rows} - (bad if asked.again else set())
    with ProcessPoolExecutor(asked.workers, get_context("spawn")) as pool:
        for future in as_completed([
                pool.submit(of_combination, combination, number, folder, asked.seed)
                for number, combination in enumerate(alone(concepts()))
                if asked.only in combination.name and combination.name not in known]):
            for row in future.result():
                kept[row.case, bool(row.hidden)] = row
                with log.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(row)) + "\n")
                print(f"{row.case}: {row.hidden or 'nothing'}: {row.verdict} "
                      f"{', '.join(row.named or row.listed)} (χ² {row.seen:.0f}, apart "
                      f"{row.apart:.0f}) {row.seconds:.0f} s {row.said}"
                      f"{' WRONG' if row.ended and row.wrong else ''}", flush=True)
    table = "\n".join(table_of(list(kept.values())))
    print(table)
    if asked.output is not None:
        asked.output.write_text(PAGE.format(
            states=len(MASSES) * len(VOLTAGES), noise=NOISE, most=1e6 * MOST_NOISE, low=SIZES[0],
            high=SIZES[1], shows=SHOWS, seen=SEEN, told=TOLD, table=table,
            rows="\n".join(map(row_of, sorted((row for row in kept.values() if row.hidden),
                                              key=lambda row: row.case)))), encoding="utf-8")
    return int(any(row.verdict == RAISED or (row.ended and row.wrong) for row in kept.values()))


if __name__ == "__main__":
    sys.exit(main())
