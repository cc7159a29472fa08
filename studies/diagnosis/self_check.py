"""Verdicts on errors hidden in readings like a dataset's own.

Readings come from the films' reduced model, which is the one that is fitted to them; its error
counts as noise. So this is the optimistic side.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.progress import PartsDone
from tympan.studies.diagnosis.evidence.kind import ReadingModel
from tympan.studies.diagnosis.hypothesis import FACTORS, SIZES, Cause, Hypothesis, parameter_at
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.files import from_json, read_json, to_json, words_beside, write_json
from tympan.studies.parallel import mapped

#: Smallest hidden size over the usual one: smaller ones are mostly not seen.
SMALLEST = 0.5
#: Largest hidden size over the usual one. Each power of ten between is as probable as another.
LARGEST = 10.0

#: What may be said of a set, best first: the cause named; among those that are listed; another
#: listed, or named; none of the library; nothing seen.
OUTCOMES = ("named", "listed", "unexplained", "nothing", "others_listed", "other_named")

WORDS = words_beside(__file__)

#: Every so many sets nothing is hidden.
_NOTHING = 6
#: Draws of a size without equilibria after which a set is left out.
_DRAWS = 50

#: Share of sets named below which a design names hardly anything.
_HARDLY = 0.1
#: Share of the sets seen in which another effect is listed from which on the two are not told
#: apart.
_ALIKE = 0.5
#: Fewest sets seen for such a share.
_SEEN = 3


@dataclass(frozen=True, eq=False)
class Bench:
    """Ingredients of synthetic readings, and what judges them.

    ``unknowns`` are the logarithms of the factors on stiffness and permittivity; ``table`` has the
    noise.
    """

    simulation: ReadingModel
    unknowns: Array
    table: ReadingTable
    causes: tuple[Cause, ...]
    seed: int = 0

    def judged_set(self, number: int) -> SyntheticSet:
        """The set of that number, hidden and judged."""
        generator = np.random.default_rng([self.seed, number])
        hidden = self.hidden(number, generator)
        size, values = self._readings(hidden, generator)
        table = self.table.with_values(values + self.table.noise.drawn(generator))
        judged = judge(self.simulation, table, self.causes, seed=number)
        listed = judged.named or (judged.weighed.suspects if judged.verdict == "ambiguous" else ())
        return SyntheticSet(hidden, size, judged.verdict, listed)

    def hidden(self, number: int, generator: np.random.Generator) -> Cause | None:
        """Hidden effect of the set of that number: nothing at times, else each effect in turn."""
        names = list(dict.fromkeys(cause.name for cause in self.causes))
        if number % _NOTHING == 0 or not names:
            return None
        name = names[(number - number // _NOTHING - 1) % len(names)]
        choice = [cause for cause in self.causes if cause.name == name]
        return choice[int(generator.integers(len(choice)))]

    def _readings(self, hidden: Cause | None, generator: np.random.Generator
                  ) -> tuple[float, Array]:
        """Size over the usual one and readings without noise, drawn until all are equilibria.

        Size 0 and the nominal model's where nothing is hidden or can be.
        """
        factors = self.unknowns[FACTORS]
        if hidden is None:
            return 0.0, self._exact((), factors)
        for _ in range(_DRAWS):
            share = float(np.exp(generator.uniform(np.log(SMALLEST), np.log(LARGEST))))
            values = self._exact((hidden,), np.r_[factors, sizes_at(generator, hidden, share)])
            if np.isfinite(values).all():
                return share, values
        return 0.0, self._exact((), factors)

    def _exact(self, hypothesis: Hypothesis, unknowns: Array) -> Array:
        """Readings without noise; nan where they are beyond limits or equilibria."""
        simulation, unknowns = grown_to(self.simulation, hypothesis, unknowns)
        low, high = simulation.bounds(hypothesis)
        if not np.all((low <= unknowns) & (unknowns <= high)):
            return np.full(len(self.table), np.nan)
        return simulation.predict(hypothesis, unknowns, self.table)


@dataclass(frozen=True)
class SyntheticSet:
    """Hidden effect, its size over the usual one, the verdict, and the causes it lists."""

    hidden: Cause | None
    size: float
    verdict: str
    listed: tuple[Cause, ...]

    @property
    def name(self) -> str:
        """The effect's, "nothing" where nothing is hidden."""
        return "nothing" if self.hidden is None else self.hidden.name

    @property
    def outcome(self) -> str:
        """One of :data:`OUTCOMES`."""
        if self.verdict == "named":
            return "named" if self.listed == (self.hidden,) else "other_named"
        if self.verdict == "ambiguous":
            return "listed" if self.hidden in self.listed else "others_listed"
        return self.verdict


def sizes_at(generator: np.random.Generator, cause: Cause, share: float) -> Array:
    """Sizes of a cause's parameters that are together ``share`` times the usual ones.

    In a direction drawn at random, with the signs they may have. Those that only say how another
    one acts are drawn as they usually are.
    """
    parameters = cause.effect.parameters
    way, acts = generator.standard_normal(len(parameters)), np.array(
        [not parameter.spread for parameter in parameters])
    way[acts] *= share / np.linalg.norm(way[acts])
    return np.array([parameter.deviation * (abs(x) if parameter.limits[0] >= 0 else x)
                     for parameter, x in zip(parameters, way.tolist(), strict=True)])


def grown_to(simulation: ReadingModel, hypothesis: Hypothesis, unknowns: Array
             ) -> tuple[ReadingModel, Array]:
    """The simulation with films sampled as far as these sizes, or as they bear; and the unknowns.

    Without a sign where that changes nothing.
    """
    for number in range(SIZES.start, len(unknowns)):
        cause, index = parameter_at(hypothesis, number)
        low, high = simulation.bounds(hypothesis)[:, number]
        if low == 0:
            unknowns = np.r_[unknowns[:number], abs(unknowns[number]), unknowns[number + 1 :]]
        size, end = float(unknowns[number]), high if unknowns[number] > 0 else low
        while abs(end) < abs(size):
            simulation = simulation.grown(cause, index, 1 if size > 0 else -1)
            further = simulation.bounds(hypothesis)[int(size > 0), number]
            if abs(further) <= abs(end):
                break
            end = further
    return simulation, unknowns


@dataclass(frozen=True)
class SelfCheck:
    """Verdicts on all synthetic sets.

    ``rows``: for each hidden effect how often each of :data:`OUTCOMES` was said, and "taken_for",
    the share of its sets seen in which another effect is listed; ``usual_or_more``: the shares over
    all that were hidden with at least their usual size.
    """

    sets: int
    seed: int
    sizes: tuple[float, ...]
    rows: tuple[dict[str, Any], ...]
    usual_or_more: dict[str, float]
    not_told_apart: tuple[tuple[str, ...], ...]
    sentence: str

    def json(self) -> dict[str, Any]:
        """Check as a JSON object."""
        record: dict[str, Any] = to_json(self)
        return record

    def save(self, folder: Path) -> None:
        """Write ``self-check.json``."""
        write_json(folder / "self-check.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> SelfCheck:
        """Load a saved self-check."""
        file = folder / "self-check.json"
        return from_json(cls, read_json(file), file)


def self_checked(bench: Bench, count: int, workers: int = 1,
                 progress: PartsDone = lambda done, all_of_them: None
                 ) -> SelfCheck:
    """So many synthetic sets judged."""
    sets, tasks = [], [(bench, number) for number in range(count)]
    with closing(mapped(_judged, tasks, workers)) as judged:
        for made in judged:
            sets.append(made)
            progress(len(sets), count)
    return summary_of(sets, bench.seed)


def _judged(task: tuple[Bench, int]) -> SyntheticSet:
    bench, number = task
    try:
        return bench.judged_set(number)
    except ArithmeticError as failure:
        raise InputError(str(failure), key="--self-check", given=f"set {number}") from None


def summary_of(sets: Sequence[SyntheticSet], seed: int = 0) -> SelfCheck:
    """Rows of the confusion table, and what follows from it in a sentence."""
    of_name: dict[str, list[SyntheticSet]] = {}
    for made in sets:
        if made.hidden is None or made.size:
            of_name.setdefault(made.name, []).append(made)
    rows = tuple(_row(name, of_name[name]) for name in of_name)
    usual = [made for made in sets if made.hidden is not None and made.size >= 1.0]
    shares = {outcome: sum(made.outcome == outcome for made in usual) / max(len(usual), 1)
              for outcome in OUTCOMES}
    alike = _alike({row["cause"]: row["taken_for"] for row in rows})
    return SelfCheck(sum(map(len, of_name.values())), seed, (SMALLEST, LARGEST), rows,
                     {"sets": len(usual), **shares}, tuple(alike), _sentence(shares, alike))


def _row(name: str, sets: Sequence[SyntheticSet]) -> dict[str, Any]:
    counts = Counter(made.outcome for made in sets)
    listed = [{cause.name for cause in made.listed} for made in sets if made.listed]
    rivals = Counter(other for names in listed for other in sorted(names - {name}))
    return {"cause": name, "sets": len(sets), **{outcome: counts[outcome] for outcome in OUTCOMES},
            "taken_for": {other: times / len(listed) for other, times in rivals.most_common()
                          if len(listed) >= _SEEN}}


def _alike(taken: Mapping[str, Mapping[str, float]]) -> list[tuple[str, str]]:
    """Pairs of effects of which each is mostly listed where the other is, the likest first."""
    mutual: dict[tuple[str, str], float] = {
        (name, other): (share + taken[other].get(name, 0.0)) / 2
        for name, rivals in taken.items() for other, share in rivals.items()
        if name < other and taken.get(other)}
    return sorted((pair for pair, share in mutual.items() if share >= _ALIKE),
                  key=lambda pair: -mutual[pair])


def _sentence(shares: Mapping[str, float], alike: Sequence[tuple[str, str]]) -> str:
    seen = 1 - shares["nothing"]
    words = WORDS["hardly" if shares["named"] < _HARDLY else "named"].format(
        seen=f"{100 * seen:.0f}", named=f"{100 * shares['named']:.0f}",
        wrong=f"{100 * shares['other_named']:.0f}")
    pairs = ", ".join(f"{first} from {second}" for first, second in alike[:3])
    return words + (WORDS["alike"].format(pairs=pairs) if pairs else "") + "."
