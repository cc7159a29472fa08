"""Sentences of a diagnosis that a laboratory understands."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.families import found_sizes, undecided
from tympan.studies.diagnosis.inference.pattern_shares import largest_patterns, stands_out
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.patterns.reading_patterns import PATTERNS, check_of_pattern
from tympan.studies.diagnosis.reading_table import UNITS
from tympan.studies.diagnosis.result import FoundCause
from tympan.studies.effects.effect import Observable
from tympan.studies.effects.findings import finding, limits_told
from tympan.studies.files import words_beside

#: Sentences, by key.
WORDS = words_beside(__file__)

#: Least probability of a suspect.
_SUSPECT = 0.05
#: Most suspects: more cannot be checked on a test bench.
_MOST = 4


def probability_text(share: float) -> str:
    """Write a probability, never rounded to certainty."""
    if not 0.01 <= share <= 0.99:
        return "above 99 %" if share > 0.5 else "below 1 %"
    return f"{100 * share:.0f} %"


def plain(names: str) -> str:
    """Write names of effects as words."""
    return names.replace("_", " ")


def listed(items: Sequence[str], last: str = "and") -> str:
    """Join items with commas, and with a word before the last one."""
    return f" {last} ".join(filter(None, (", ".join(items[:-1]), *items[-1:])))


def headline_of(fit: Fit, cause: Cause, chance: str = "") -> str:
    """Describe a cause at a fit, with its size, and its probability in words."""
    sizes = found_sizes(fit, cause)
    inside = ", ".join(filter(None, (limits_told(cause.effect, sizes), chance)))
    sentence = finding(cause.effect, sizes, cause.which)
    return f"{sentence} ({inside})" if inside else sentence


def with_other_loads(headline: str, loads: Mapping[float, tuple[float, float]]) -> str:
    """Add to the headline of a mass on every load what one load alone would weigh instead.

    A load that may have its labelled mass is no alternative.
    """
    each = [WORDS["one_load"].format(label=1e3 * label, low=1e3 * low, high=1e3 * high)
            for label, (low, high) in loads.items() if not low <= label <= high]
    if not each:
        return headline
    return WORDS["one_load_instead"].format(headline=headline, loads=listed(each, "or"))


def check_of(cause: Cause, read: set[Observable], suspects: Collection[Cause] = ()) -> str:
    """Advise what to check on the test bench, besides the observables that are read already."""
    family = cause.effect.family if undecided(cause, read, suspects) else None
    return (family or cause.effect).check.format(which=cause.which)


def suspects_among(causes: Sequence[FoundCause]) -> list[FoundCause]:
    """Select the listed causes that may be present; the first of a family with one name.

    A cause whose size may be zero is no alternative. Nor is one paired with the first, where that
    one alone is enough.
    """
    likely = [cause for cause in causes if cause.clear
              and (cause.only_its_size or cause.probability >= _SUSPECT)]
    named = {cause.family.name if cause.family else f"{cause.effect} {cause.which}": cause
             for cause in likely[::-1]}
    found = [cause for cause in likely if cause in named.values()][:_MOST] or list(causes[:1])
    if found and not found[0].others:
        alone = str(_cause(found[0]))
        found = [cause for cause in found if alone not in cause.others]
    return found


def _cause(found: FoundCause) -> Cause:
    return Cause(found.effect, found.which, found.again)


def members_of_one(suspects: Sequence[FoundCause]) -> bool:
    """Check whether suspects are no rivals but the members of one hypothesis."""
    return len(suspects) > 1 and all(
        str(_cause(cause)) in suspects[0].others for cause in suspects[1:])


def headline(verdict: str, named: Sequence[FoundCause], suspects: Sequence[FoundCause], where: str,
             small_errors: float | None = None, of_data: bool = False,
             cannot_tell: str = "") -> str:
    """Write the headline; ``of_data``: whether ``where`` says what is wrong in the dataset.

    ``cannot_tell``: why it is not known whether the simulation agrees, if so.
    """
    if verdict == "unexplained" and of_data:
        return WORDS["data"].format(where=where)
    if cannot_tell and verdict == "nothing":
        return WORDS["cannot_tell"].format(why=cannot_tell)
    if cannot_tell:
        heads = [f"{cause.headline[0].lower()}{cause.headline[1:]}" for cause in suspects]
        return WORDS["cannot_tell_from"].format(
            why=cannot_tell, others="; or ".join(heads or [WORDS["unknown_effect"]]))
    if verdict == "unexplained" and small_errors is not None:
        return WORDS["rough"].format(share=100 * small_errors)
    if verdict == "named":
        return ". ".join(cause.headline for cause in named) + "."
    if verdict == "ambiguous":
        heads = [cause.headline for cause in suspects]
        if len(heads) == 1:
            return WORDS["probably"].format(cause=heads[0])
        heads = [heads[0], *(head[0].lower() + head[1:] for head in heads[1:])]
        key = "both" if members_of_one(suspects) else "either"
        return WORDS[key].format(first=heads[0], others="; or ".join(heads[1:]))
    return WORDS[verdict].format(where=where)


def next_step(verdict: str, checks: Sequence[str], advice: str, of_data: bool = False) -> str:
    """List the checks, then an experiment; ``of_data``: the dataset must be corrected first."""
    if not (checks and advice):
        return "; ".join(dict.fromkeys(checks)) or advice
    key = "check_data" if of_data else f"check_{verdict if verdict == 'named' else 'suspects'}"
    return WORDS[key].format(checks="; ".join(dict.fromkeys(checks)), advice=advice)


def where(judged: Judgement) -> str:
    """Locate the misfit: the pattern that explains most of it, and one more."""
    names, shares = largest_patterns(judged)
    parts = [judged.test.words(name) + (_loop(judged) if name == "loop" else "")
             for name in names]
    if names and names[0].startswith("specimen ") and not stands_out(names[0], shares):
        parts[0] = WORDS["apart"]
    return "; ".join(parts)


def _loop(judged: Judgement) -> str:
    """Describe the distance between readings on the way out and on the way back."""
    table, columns = judged.table, judged.misfit.patterns["loop"]
    rows = np.any(columns != 0, axis=1)
    missed = (table.value - judged.nominal.predicted(table))[rows]
    of_way = columns[rows] @ np.linalg.lstsq(columns[rows], missed, rcond=None)[0]
    unit = UNITS[str(table.kind[rows][0])]
    return WORDS["loop_size"].format(
        size=2 * unit.per_si * float(np.sqrt(np.mean(of_way**2))), unit=unit.name)


def pattern_checks(judged: Judgement) -> list[str]:
    """List checks on the test bench, by where the misfit of the nominal model is."""
    names, shares = largest_patterns(judged)
    checks = []
    for name in names:
        alone = not name.startswith("specimen ") or stands_out(name, shares)
        checks.append(check_of_pattern(name) if alone else PATTERNS["specimen"].check_all)
    return [check for check in checks if check]
