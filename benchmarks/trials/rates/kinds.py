"""What a study's records add up to: rates with intervals against their targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from benchmarks.trials.rates.rate import GONE, Rate, share
from benchmarks.trials.rates.sizes import size_rates
from benchmarks.trials.record import Record
from benchmarks.trials.synthetic_trials import LARGE, ROUGH
from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD

#: Edges of the bins of Δχ² for the power curve, and bins of equal count for stated probabilities.
_EDGES = (-np.inf, 1.0, 4.0, 9.0, 16.0, 25.0, 50.0, 100.0, 400.0, np.inf)
_BINS = 8
#: What the causes are mixed by for the calibration of stated probabilities: the priors of the
#: diagnosis.
_MIXTURE = {"single": 0.6, "pair": 0.2, "outside": 0.2}

#: Populations of benches as they are.
BENCH = ("mess", "mess, without", "strangers", "gain")

#: Records that say something, by population.
Kinds = dict[str, list[Record]]


def rates(records: Sequence[Record]) -> list[Rate]:
    """The rates of tidy readings at rest."""
    kinds = _kinds(records)
    return [*_of_single(kinds), *_of_sets(kinds, records), *_of_outside(kinds, records),
            *_of_pairs(kinds), *_of_wrong_noise_and_law(kinds),
            share("refused, or ended in an error", list(records),
                  lambda record: record.verdict in GONE),
            *_of_rough(kinds), *_of_random(kinds, records), *size_rates(records)]


def bench_rates(records: Sequence[Record]) -> list[Rate]:
    """The rates of messy readings, of causes that the library lacks, and of gains in prediction."""
    kinds = _kinds(records)
    return [*_of_mess(kinds), *_of_strangers(kinds), *_of_gains(kinds)]


def _kinds(records: Sequence[Record]) -> Kinds:
    kinds: Kinds = {}
    for record in records:
        some = kinds.setdefault(record.population, [])
        if record.verdict not in GONE:
            some.append(record)
    return kinds


def _named(kinds: Kinds) -> list[Record]:
    """Single effects that are identifiable."""
    return [record for name in ("single", "strong") for record in kinds.get(name, [])
            if record.identifiable]


def _of_single(kinds: Kinds) -> list[Rate]:
    named, single = _named(kinds), kinds.get("single", [])
    weak = [record for record in single if not record.identifiable]
    seen = [record for record in (*single, *kinds.get("strong", [])) if record.seen >= SEEN]
    return [
        share("nothing hidden: false alarms", kinds.get("null", []), _alarm, high=0.05),
        share(f"one effect, Δχ² ≥ {SEEN:g}: detected", seen, _alarm, 0.95),
        share("one identifiable effect: it is the most probable cause", named, _first, low=0.95),
        share("one identifiable effect: it is named", named, _right, low=0.8),
        share("one identifiable effect: another is named", named, lambda record: record.misnamed,
              high=0.02),
        share("one effect too weak to be identified: another is named", weak,
              lambda record: record.misnamed, high=0.02),
        share("exact aliases: said to be, and none of them named", kinds.get("alias", []),
              lambda record: record.reported, low=1.0)]


def _of_sets(kinds: Kinds, records: Sequence[Record]) -> list[Rate]:
    alarmed = {name: [record for record in kinds.get(name, []) if record.covered is not None]
               for name in ("single", "pair")}
    sizes, large = ([hit for record in kind for hit in record.inside]
                    for kind in (kinds.get("single", []), _named(kinds)))
    mendless = [record for record in records
                if record.population != "outside" or record.told >= TOLD]
    return [
        Rate("effects as drawn, one or two as often as the diagnosis expects, seen: 95 % set has "
             "them", 0, sum(map(len, alarmed.values())), 0.92, 0.98, covering(alarmed)),
        share("the same, one effect: the set, which leaves room for two, has it",
              alarmed["single"], lambda record: record.covered, 0.92),
        Rate("calibration error of the first cause's stated probability", 0,
             sum(bool(record.ranked) for name in _MIXTURE for record in kinds.get(name, [])),
             0.0, 0.05, calibration(records)[0]),
        Rate("the same, without strangers that an effect of the library makes as well", 0,
             sum(bool(record.ranked) for record in mendless for name in _MIXTURE
                 if record.population == name), 0.0, 0.05, calibration(mendless)[0]),
        Rate("one effect as drawn: 95 % intervals have the true size", sum(sizes), len(sizes), 0.92,
             0.98),
        Rate("the same, identifiable effects", sum(large), len(large), 0.92, 0.98)]


def _of_outside(kinds: Kinds, records: Sequence[Record]) -> list[Rate]:
    outside = [record for record in kinds.get("outside", []) if record.seen >= SEEN]
    # What is refused is not found: how far it is from the library is not known.
    gone = [record for record in records
            if record.population == "outside" and record.verdict in GONE]
    return [
        share(f"outside the library, Δχ² ≥ {SEEN:g} from it: unexplained", [*outside, *gone],
              lambda record: record.verdict == "unexplained", low=0.9),
        share("outside the library: some effect is named", outside,
              lambda record: bool(record.named), high=0.05)]


def _of_pairs(kinds: Kinds) -> list[Rate]:
    pairs = [record for name in ("pair", "duo") for record in kinds.get(name, [])
             if record.identifiable]
    return [
        share("two identifiable effects: both found (most probable hypothesis)", pairs,
              lambda record: set(record.best) == set(record.truth), low=0.8),
        share("the same: both named", pairs, _right),
        share("the same: another is named", pairs, lambda record: record.misnamed, high=0.02),
        share("the true effect deleted from the library: another is named",
              kinds.get("deleted", []), lambda record: bool(record.named), high=0.05)]


def _of_wrong_noise_and_law(kinds: Kinds) -> list[Rate]:
    form = kinds.get("form", [])
    return [
        *(share(f"nothing hidden, noise stated 1.5 times {words}: false alarms",
                kinds.get(f"noise stated {words}", []), _alarm, high=0.1)
          for words in ("too small", "too large")),
        share("nothing hidden, stress 1 to 2 % wrong by another law: alarms",
              [record for record in form if not record.truth], _alarm),
        share("one identifiable effect, stress 1 to 2 % wrong: another is named",
              [record for record in form if record.identifiable],
              lambda record: record.misnamed)]


def _of_rough(kinds: Kinds) -> list[Rate]:
    """On benches where all is a little off, of readings at rest and of steps in time, too."""
    def named(record: Record) -> bool:
        return set(record.truth) <= set(record.named)

    def of(rough: list[Record], words: str) -> list[Rate]:
        large = [record for record in rough if record.identifiable]
        return [
            share(f"all else off by {ROUGH:g} typical sizes{words}, one identifiable effect of "
                  f"{LARGE[0]:g} to {LARGE[1]:g}: it is the most probable cause", large, _first),
            share("the same: it is named", large, named),
            share("the same: something small alone is named", large,
                  lambda record: bool(record.named) and not named(record)),
            share("the same: unexplained", large, lambda record: record.verdict == "unexplained"),
            share(f"all off by {ROUGH:g} typical sizes{words}, nothing large: something is named",
                  [record for record in rough if not record.truth],
                  lambda record: bool(record.named))]

    return [*of(kinds.get("rough", []), ""),
            *of(kinds.get("rough transients", []), ", with steps in time")]


def _of_mess(kinds: Kinds) -> list[Rate]:
    """On benches whose noise is not as the diagnosis has it."""
    every = kinds.get("mess", [])
    if not every:
        return []
    named = [record for record in every if record.identifiable]
    numbers = {record.number for record in named}
    clean = kinds.get("mess, without", [])
    by_white = {record.number for record in clean if record.identifiable}
    hit, fault, wrong = (sum(counts) for counts in zip(*(
        record.rows or (0, 0, 0) for record in every), strict=True))
    return [
        *(share(f"{kind}, nothing hidden: false alarms",
                [record for record in every if not record.truth and record.words == kind],
                _alarm, high=0.05) for kind in dict.fromkeys(record.words for record in every)),
        share("mess of any kind, nothing hidden: false alarms",
              [record for record in every if not record.truth], _alarm, high=0.05),
        *(share(f"{kind}, one identifiable effect: it is named",
                [record for record in named if record.words == kind], _right)
          for kind in dict.fromkeys(record.words for record in every)),
        share("mess, one identifiable effect: it is named", named, _right, low=0.8),
        share("the same sets without mess: it is named",
              [record for record in clean if record.number in numbers], _right),
        share("mess, one effect that were identifiable without: it is named",
              [record for record in every if record.number in by_white], _right),
        share("the same sets without mess: it is named",
              [record for record in clean if record.number in by_white], _right),
        share("mess, one identifiable effect: another is named", named,
              lambda record: record.misnamed, high=0.02),
        Rate("readings at fault that are told", hit, fault, 0.9, 1.0),
        Rate("readings told that are not at fault, of all that are told", wrong, hit + wrong,
             0.0, 1.0)]


def _of_strangers(kinds: Kinds) -> list[Rate]:
    """Of what the library lacks, with what is told of where it is."""
    every = kinds.get("strangers", [])
    if not every:
        return []
    beyond = [record for record in every if record.seen >= SEEN]
    placed = [record for record in beyond if record.rows]
    return [
        share("strangers: some effect is named", every, lambda record: bool(record.named),
              high=0.03),
        share(f"strangers, Δχ² ≥ {SEEN:g} from the library: some effect is named", beyond,
              lambda record: bool(record.named), high=0.03),
        share("the same: something is said to be wrong", beyond, _alarm),
        share("the same, of one specimen or column: that is told", placed,
              lambda record: record.rows[0] == 1, low=0.8),
        share("the same: others are told besides", placed,
              lambda record: record.rows[:1] == (1,) and record.rows[2] > 0),
        share("the same: others alone are told", placed,
              lambda record: record.rows[:1] == (0,) and record.rows[2] > 0)]


def _of_gains(kinds: Kinds) -> list[Rate]:
    sure = [record for record in kinds.get("gain", []) if record.identifiable]
    every = [record for name in ("gain", "strangers") for record in kinds.get(name, [])]
    gained = [record.ratio for record in sure if record.ratio is not None]
    return [
        Rate("one identifiable effect: error beyond noise on readings held out, after over before, "
             "median", 0, len(gained), 0.0, 0.3, float(np.median(gained)) if gained else 1.0),
        _within("the same", sure),
        *(_within(f"all of these and of the strangers, verdict {verdict}", [
            record for record in every if record.verdict == verdict])
          for verdict in ("nothing", "named", "ambiguous", "unexplained") if every),
        _held("one effect", every),
        _within("mess, one effect", kinds.get("mess", [])),
        _held("mess, one effect", kinds.get("mess", []))]


def _held(what: str, records: Sequence[Record]) -> Rate:
    """Ratios at states held back that are within the limits told of them."""
    held = [(record.held, record.limits) for record in records if record.held is not None]
    return Rate(f"{what}: the gain's 95 % limits hold the ratio at states held back",
                sum(low <= ratio <= high for ratio, (low, high) in held), len(held), 0.9, 0.98)


def _within(what: str, records: Sequence[Record]) -> Rate:
    """Readings held out that are within their bands."""
    counts = [record.predicted for record in records if record.predicted]
    return Rate(f"{what}: readings held out within their 95 % predictive bands",
                sum(hits for hits, _ in counts), sum(count for _, count in counts), 0.92, 0.98)


def _of_random(kinds: Kinds, records: Sequence[Record]) -> list[Rate]:
    return [
        share("random designs, from files to the page: raised or refused",
              [record for record in records if record.population == "random"],
              lambda record: record.verdict in GONE, high=0.0),
        share("the same, films that are only softer or stiffer: an effect is named",
              kinds.get("random", []), lambda record: bool(record.named), high=0.05)]


def _alarm(record: Record) -> bool:
    return record.verdict != "nothing"


def _first(record: Record) -> bool:
    return bool(record.ranked) and record.ranked[0][0] in record.truth


def _right(record: Record) -> bool:
    return set(record.named) == set(record.truth)


def covering(alarmed: Mapping[str, Sequence[Record]]) -> float:
    """Share of sets that have the truth, kinds of trials weighted as the diagnosis expects them."""
    asked = {name: records for name, records in alarmed.items() if records}
    total = sum(_MIXTURE[name] for name in asked)
    return sum(
        _MIXTURE[name] / total * sum(bool(record.covered) for record in records) / len(records)
        for name, records in asked.items())


def calibration(records: Sequence[Record]) -> tuple[float, list[tuple[float, float, int]]]:
    """Expected error of the first cause's stated probability, and (stated, true share, count) of
    each bin.

    Trials with one effect, two, and a stranger, as they were drawn, are weighted as the diagnosis
    expects them.
    """
    kinds = {name: [record for record in records if record.population == name and record.ranked]
             for name in _MIXTURE}
    rows = [(record.ranked[0][1], float(record.ranked[0][0] in record.truth),
             _MIXTURE[name] / len(kind))
            for name, kind in kinds.items() for record in kind]
    if not rows:
        return 1.0, []
    stated, true, weight = np.array(sorted(rows)).T
    bins = np.minimum((np.cumsum(weight) - weight / 2) / weight.sum() * _BINS,
                      _BINS - 1e-9).astype(int)
    curve = [(float(np.average(stated[bins == k], weights=weight[bins == k])),
              float(np.average(true[bins == k], weights=weight[bins == k])), int((bins == k).sum()))
             for k in np.unique(bins)]
    shares = [weight[bins == k].sum() / weight.sum() for k in np.unique(bins)]
    return float(sum(part * abs(a - b) for part, (a, b, _) in zip(shares, curve,
                                                                    strict=True))), curve


def power(records: Sequence[Record]) -> list[tuple[float, float, Rate, Rate]]:
    """Bins of Δχ² with the shares detected, and named rightly."""
    single = [record for record in records
              if record.population == "single" and record.verdict not in GONE]
    bins = []
    for low, high in pairwise(_EDGES):
        within = [record for record in single if low <= record.seen < high]
        if within:
            bins.append((low, high, share("detected", within, _alarm),
                         share("named", within, _right)))
    return bins
