"""Verdicts on errors hidden in synthetic readings like a dataset's own.

The readings come from the films' reduced model, the same that is fitted to them; its error counts
as noise. So this check is optimistic.
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

#: Smallest hidden size over the prior scale: smaller ones are mostly not seen.
SMALLEST = 0.5
#: Largest hidden size over the prior scale. Sizes between are log-uniform.
LARGEST = 10.0

#: Outcomes for a set, best first: the hidden cause named; among those listed; no cause of the
#: library; nothing wrong; another listed, or named.
OUTCOMES = ("named", "listed", "unexplained", "nothing", "others_listed", "other_named")

WORDS = words_beside(__file__)

#: One set of this many has nothing hidden.
_NOTHING = 6
#: Draws of a size without equilibria after which a set is left out.
_DRAWS = 50

#: Share of sets with a named cause below which a design names hardly anything.
_HARDLY = 0.1
#: Share of the detected sets that list another effect, from which the two are not distinguished.
_ALIKE = 0.5
#: Fewest detected sets for the share of sets that list another effect.
_SEEN = 3


@dataclass(frozen=True, eq=False)
class Bench:
    """Generator of synthetic readings, with what judges them.

    ``unknowns``: logarithms of the factors on stiffness and permittivity; ``table``: rows with
    their noise.
    """

    simulation: ReadingModel
    unknowns: Array
    table: ReadingTable
    causes: tuple[Cause, ...]
    seed: int = 0

    def judged_set(self, number: int) -> SyntheticSet:
        """Make the set of that number with a hidden effect, and judge it."""
        generator = np.random.default_rng([self.seed, number])
        hidden = self.hidden(number, generator)
        size, values = self._readings(hidden, generator)
        table = self.table.with_values(values + self.table.noise.drawn(generator))
        judged = judge(self.simulation, table, self.causes, seed=number)
        listed = judged.named or (judged.weighed.suspects if judged.verdict == "ambiguous" else ())
        return SyntheticSet(hidden, size, judged.verdict, listed)

    def hidden(self, number: int, generator: np.random.Generator) -> Cause | None:
        """Choose the hidden effect of a set: nothing at times, else each effect in turn."""
        names = list(dict.fromkeys(cause.name for cause in self.causes))
        if number % _NOTHING == 0 or not names:
            return None
        name = names[(number - number // _NOTHING - 1) % len(names)]
        choice = [cause for cause in self.causes if cause.name == name]
        return choice[int(generator.integers(len(choice)))]

    def _readings(self, hidden: Cause | None, generator: np.random.Generator
                  ) -> tuple[float, Array]:
        """Draw size over the prior scale and noise-free readings until all are equilibria.

        Without a hidden effect, or if none is possible, the size is 0 and the model nominal.
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
        """Predict readings without noise; nan beyond limits or without an equilibrium."""
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
        """Name of the hidden effect, "nothing" where nothing is hidden."""
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
    """Draw sizes of a cause's parameters that together are ``share`` times the prior scales.

    The direction is random, with the signs that parameters may have. Parameters that only say how
    another one acts are drawn from their priors.
    """
    parameters = cause.effect.parameters
    way, acts = generator.standard_normal(len(parameters)), np.array(
        [not parameter.spread for parameter in parameters])
    way[acts] *= share / np.linalg.norm(way[acts])
    return np.array([parameter.deviation * (abs(x) if parameter.limits[0] >= 0 else x)
                     for parameter, x in zip(parameters, way.tolist(), strict=True)])


def grown_to(simulation: ReadingModel, hypothesis: Hypothesis, unknowns: Array
             ) -> tuple[ReadingModel, Array]:
    """Sample the films of a simulation up to these sizes, or the films' limits; and the unknowns.

    Sizes lose their sign where it changes nothing.
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

    ``rows``: for each hidden effect the frequency of each of :data:`OUTCOMES`, and "taken_for": the
    share of its detected sets in which another effect is listed; ``usual_or_more``: these shares
    over all hidden effects of at least their prior scale.
    """

    sets: int
    seed: int
    sizes: tuple[float, ...]
    rows: tuple[dict[str, Any], ...]
    usual_or_more: dict[str, float]
    not_told_apart: tuple[tuple[str, ...], ...]
    sentence: str

    def json(self) -> dict[str, Any]:
        """Convert the check to a JSON object."""
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
    """Judge ``count`` synthetic sets."""
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
    """Summarise the rows of the confusion table, with a sentence on them."""
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
    """List pairs of effects, each mostly listed where the other is hidden, most similar first."""
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
