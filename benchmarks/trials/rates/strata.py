"""What trials with more evidence than readings at rest add up to: rates before and after it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.trials.rates.page import rate_table, table
from benchmarks.trials.rates.rate import GONE, Rate, share
from benchmarks.trials.rates.sizes import BANDS, UNEXPLAINED, WRONG, said
from benchmarks.trials.record import Record
from benchmarks.trials.strata.trials import SMOOTH, STRATA, population_of
from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD

#: What may be said, best first.
OUTCOMES = ("named", "listed", "nothing", "unexplained", "others listed", "another named")


def strata_rates(records: Sequence[Record]) -> list[Rate]:
    """The rates of every stratum, by all of its evidence, with the targets of readings at rest."""
    return [rate for name in SMOOTH
            for rate in _rates(name, [record for record in records if record.population == name
                                      and record.verdict not in GONE])]


def _rates(name: str, records: Sequence[Record]) -> list[Rate]:
    hidden = [record for record in records if record.truth]
    sure = [record for record in hidden if record.identifiable]
    return [
        share(f"{name}, nothing hidden: false alarms",
              [record for record in records if not record.truth],
              lambda record: record.verdict != "nothing", high=0.05),
        share(f"{name}, Δχ² ≥ {SEEN:g}: detected",
              [record for record in hidden if record.seen >= SEEN],
              lambda record: record.verdict != "nothing", low=0.95),
        share(f"{name}, identifiable: it is named", sure, lambda record: said(record) == "named",
              low=0.8),
        share(f"{name}: another is named", hidden, lambda record: record.misnamed, high=WRONG),
        share(f"{name}: unexplained", hidden, lambda record: record.verdict == "unexplained",
              high=UNEXPLAINED)]


def strata_page(records: Sequence[Record], about: str) -> str:
    """The page's text."""
    text = Path(__file__).with_suffix(".md").read_text(encoding="utf-8")
    return text.format(
        seen=SEEN, told=TOLD, smallest=BANDS[0], largest=BANDS[-1], about=about,
        rates=rate_table(strata_rates(records)),
        before_after=table("evidence | trials | judged by | " + " | ".join(OUTCOMES),
                           _outcomes(records)),
        decided=table("evidence | ambiguous before | then named | then ambiguous | then another "
                      "named | then unexplained or nothing", _decided(records)),
        effects=table("evidence | effect | trials | before | by all", _by_effect(records)),
        wrong=table("evidence | judged by | readings by | hidden | typical sizes | named", names)
        if (names := list(_wrong(records))) else "None.")


def _hidden(records: Sequence[Record], population: str) -> dict[int, Record]:
    """Trials of a population in which something is hidden, by number."""
    return {record.number: record for record in records
            if record.population == population and record.truth and record.verdict not in GONE}


def _outcomes(records: Sequence[Record]) -> Iterator[str]:
    for name in SMOOTH:
        for view in STRATA[name].views:
            some = _hidden(records, population_of(name, view))
            counts = Counter(map(said, some.values()))
            yield (f"{name} | {len(some)} | {view or 'all'} | "
                   + " | ".join(str(counts[outcome]) for outcome in OUTCOMES))


def _decided(records: Sequence[Record]) -> Iterator[str]:
    """What becomes of those that the lesser evidence lists among others."""
    for name in SMOOTH:
        first = _hidden(records, population_of(name, next(iter(STRATA[name].views))))
        after = _hidden(records, name)
        counts = Counter(said(after[number]) for number, record in first.items()
                         if record.verdict == "ambiguous" and number in after)
        named, wrong = counts["named"], counts["another named"]
        still = counts["listed"] + counts["others listed"]
        rest = sum(counts.values()) - named - wrong - still
        yield f"{name} | {sum(counts.values())} | {named} | {still} | {wrong} | {rest}"


def _by_effect(records: Sequence[Record]) -> Iterator[str]:
    for name in SMOOTH:
        first = _hidden(records, population_of(name, next(iter(STRATA[name].views))))
        after = _hidden(records, name)
        effects = dict.fromkeys(record.truth[0].partition(" of ")[0] for record in after.values())
        for effect in sorted(effects):
            numbers = [number for number, record in after.items()
                       if record.truth[0].partition(" of ")[0] == effect]
            cells = [_counted(some[number] for number in numbers if number in some)
                     for some in (first, after)]
            yield f"{name} | {effect} | {len(numbers)} | {cells[0]} | {cells[1]}"


def _counted(records: Iterator[Record]) -> str:
    counts = Counter(map(said, records))
    return ", ".join(f"{counts[outcome]} {outcome}" for outcome in OUTCOMES if counts[outcome])


def _wrong(records: Sequence[Record]) -> Iterator[str]:
    for name in SMOOTH:
        for view in STRATA[name].views:
            for record in _hidden(records, population_of(name, view)).values():
                if record.misnamed:
                    yield (f"{name} #{record.number} | {view or 'all'} | {record.means} | "
                           f"{record.truth[0]} | {record.widths[0]:.2g} | "
                           f"{', '.join(record.named)}")
