"""Coupons in which nothing is hidden: how often the verdict is that something is wrong.

    python -m benchmarks.trials.coupons.nulls [--count 200] [--beside 100]

So many by themselves, and so many beside two round actuators. Stresses are by closed forms, heaves
by the membrane's differential equations; noise is 1, 2 and 4 % of the stress by turns, of heaves
20, 10 and 40 µm. The level is what the verdict's test is meant to have. D is the largest distance
between the shares of p-values below any number and that number, by Kolmogorov; a conservative test
has one, too.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.stats import kstest

from benchmarks.trials.rates.rate import Rate
from benchmarks.trials.strata import strips
from benchmarks.trials.strata.strips import AT_REST, IN_TIME, Run, StripPlan
from benchmarks.trials.strata.trials import dataset_of, evidence_of, two
from benchmarks.trials.synthetic_trials import Design, Means, Truth, draw, drawn_until
from tympan.progress import bar
from tympan.studies.diagnosis.diagnose import judge_dataset
from tympan.studies.diagnosis.inference.verdict import ALARM

#: Noise of coupons as a share of their stress, and of heaves [m].
SHARES, HEAVES = (0.01, 0.02, 0.04), (20e-6, 10e-6, 40e-6)

#: By which stiffness and permittivity of strips differ from those of the actuators' film.
BATCH = 0.05

#: Of the table of rates.
HEAD = """| coupons | alarms | of a level of {level:.0%} | 95 % limits | D | p-value of D |
|---|---|---|---|---|---|"""

#: Two strips, one of them under voltage.
FEW = (Run("uniaxial"), Run("uniaxial", 6e3))


@dataclass(frozen=True)
class Kind:
    """Coupons by number: the ``runs``, and whether the film is as ``stated`` or drawn about it.

    ``noise_stated``: a column says it; else it is known by the scatter. ``differ``: by what share
    strips do from each other; ``batch``: from the actuators, and None without these.
    """

    name: str
    runs: tuple[Run, ...]
    readings: int = 12
    stated: bool = False
    noise_stated: bool = True
    differ: float = 0.0
    batch: float | None = None

    def plan(self, number: int, random: np.random.Generator) -> StripPlan:
        """That of a number."""
        spread = self.batch or 0.0
        stiffness, permittivity = random.normal(1.0, spread, 2).tolist()
        return StripPlan(_film(self.batch is not None), self.runs, self.readings,
                         SHARES[number % len(SHARES)], (stiffness, permittivity), self.differ,
                         self.noise_stated)


ALONE = (
    Kind("2 strips", FEW),
    Kind("8 strips", AT_REST),
    Kind("24 strips", 3 * AT_REST),
    Kind("8 strips, film as stated", AT_REST, stated=True),
    Kind("8 strips, noise not stated", AT_REST, 24, noise_stated=False),
    Kind("8 strips that differ by 3 %", AT_REST, differ=strips.STRIPS_DIFFER),
    Kind("3 strips in time", IN_TIME, 24),
    Kind("3 strips in time that differ by 3 %, noise not stated", IN_TIME, strips.DENSE,
         noise_stated=False, differ=strips.STRIPS_DIFFER))
BESIDE = tuple(replace(kind, name=f"{kind.name}, another batch" if batch else kind.name,
                       batch=batch)
               for kind, batch in ((ALONE[0], BATCH), (ALONE[1], 0.0), (ALONE[1], BATCH),
                                   (ALONE[4], BATCH), (ALONE[5], BATCH)))


@cache
def _film(of_actuators: bool) -> Design:
    return two("circles").design if of_actuators else strips.film_alone()


def p_value(kind: Kind, number: int) -> float:
    """What the verdict's test says of the coupons of a number."""
    random = np.random.default_rng([number, kind.batch is not None])
    plan = kind.plan(number, random)
    # Of another material family, half of the films that are in no actuator.
    means: Means = "another law" if kind.batch is None and random.random() < 0.5 else "equations"
    _, read, _ = drawn_until(partial(evidence_of, plan), lambda: (
        Truth(means=means) if kind.stated else draw(random, (), means)))
    with TemporaryDirectory() as place:
        dataset = dataset_of(Path(place) / "nothing", plan, read,
                             HEAVES[number // len(SHARES) % len(HEAVES)], number, False)
        _, judgement, _ = judge_dataset(dataset, seed=number)
    return judgement.test.p_value


def p_values(kinds: Sequence[Kind], every: int) -> dict[str, list[float]]:
    """Of so many coupons, kinds by turns; by their names."""
    values: dict[str, list[float]] = {kind.name: [] for kind in kinds}
    with bar(every) as step:
        for number in range(every):
            kind = kinds[number % len(kinds)]
            step(kind.name)
            values[kind.name].append(p_value(kind, number))
    return values


def row(name: str, values: Sequence[float]) -> str:
    """Alarms, and how p-values are spread."""
    alarms = Rate(name, sum(value < ALARM for value in values), len(values))
    low, high = alarms.interval
    spread = kstest(values, "uniform")
    return (f"| {name} | {alarms.hits} of {alarms.count} | {alarms.share:.1%} | "
            f"{low:.1%} to {high:.1%} | {spread.statistic:.3f} | {spread.pvalue:.2g} |")


def rows(name: str, values: dict[str, list[float]]) -> Iterator[str]:
    """Of each kind, and of all of them."""
    yield from (row(kind, part) for kind, part in values.items() if part)
    yield row(f"all {name}", [value for part in values.values() for value in part])


def main() -> None:
    """Print a row for each kind, and for all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="coupons by themselves")
    parser.add_argument("--beside", type=int, default=100, help="coupons beside actuators")
    options = parser.parse_args()
    print(HEAD.format(level=ALARM))
    for name, kinds, every in (("by themselves", ALONE, options.count),
                               ("beside actuators", BESIDE, options.beside)):
        if every:
            print(*rows(name, p_values(kinds, every)), sep="\n", flush=True)


if __name__ == "__main__":
    main()
