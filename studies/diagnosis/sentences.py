"""Sentences of a diagnosis that a laboratory understands."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.data.findings import Finding
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import FACTORS, Cause
from tympan.studies.diagnosis.inference.families import found_sizes, undecided
from tympan.studies.diagnosis.inference.projection import beside, taken_by
from tympan.studies.diagnosis.inference.relabelled import Relabelling
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.patterns.reading_patterns import EACH_RUN, JUMPS, over
from tympan.studies.diagnosis.reading_table import UNITS
from tympan.studies.diagnosis.result import FoundCause
from tympan.studies.diagnosis.slips import load_columns, run_columns
from tympan.studies.effects.effect import Observable
from tympan.studies.effects.findings import finding, limits_told
from tympan.studies.files import words_beside

#: Sentences, by key.
WORDS = words_beside(__file__)

#: Suspects are causes of at least this probability.
_SUSPECT = 0.05
#: And they are at most so many: a bench has no time for more.
_MOST = 4

#: Shares by which what vague patterns take away counts, so that what says more is told instead; and
#: what the best of many columns does, which fits a little of anything.
_VAGUE = {"level": 0.5, "fitted": 0.6, "voltage": 0.9, "coupon_level": 0.5, "coupon_stretch": 0.9}
_BEST_OF_MANY = {"step": 0.8, "stick": 0.8}

#: χ² from which a pattern is told beside another one. Set by trial.
_CLEAR = 30.0
#: How many times as much as any other specimen or run one takes away that is off itself.
_ALONE = 2.0


def probability_text(share: float) -> str:
    """A probability, never rounded to certainty."""
    if not 0.01 <= share <= 0.99:
        return "above 99 %" if share > 0.5 else "below 1 %"
    return f"{100 * share:.0f} %"


def plain(names: str) -> str:
    """Names of effects as words."""
    return names.replace("_", " ")


def listed(items: Sequence[str], last: str = "and") -> str:
    """Items with commas and a word before the last one."""
    return f" {last} ".join(filter(None, (", ".join(items[:-1]), *items[-1:])))


def headline_of(fit: Fit, cause: Cause, chance: str = "") -> str:
    """Meaning of a cause at a fit, with its size, and its probability in words."""
    sizes = found_sizes(fit, cause)
    inside = ", ".join(filter(None, (limits_told(cause.effect, sizes), chance)))
    sentence = finding(cause.effect, sizes, cause.which)
    return f"{sentence} ({inside})" if inside else sentence


def with_other_loads(headline: str, loads: Mapping[float, tuple[float, float]]) -> str:
    """Headline of a mass on every load, with what one load alone would weigh that does as much.

    A load that may be as it is labelled is no alternative.
    """
    each = [WORDS["one_load"].format(label=1e3 * label, low=1e3 * low, high=1e3 * high)
            for label, (low, high) in loads.items() if not low <= label <= high]
    if not each:
        return headline
    return WORDS["one_load_instead"].format(headline=headline, loads=listed(each, "or"))


def check_of(cause: Cause, told: set[Observable], suspects: Collection[Cause] = ()) -> str:
    """Advice on what to look at on the bench, by what the readings tell already."""
    family = cause.effect.family if undecided(cause, told, suspects) else None
    return (family or cause.effect).check.format(which=cause.which)


def suspects_among(causes: Sequence[FoundCause]) -> list[FoundCause]:
    """Those of the listed causes that may be it, of a family that has one name the first.

    One whose size may be none is no alternative; nor is one beside the first, where that alone
    would do.
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


def together(suspects: Sequence[FoundCause]) -> bool:
    """Whether suspects are no rivals but the members of one hypothesis."""
    return len(suspects) > 1 and all(
        str(_cause(cause)) in suspects[0].others for cause in suspects[1:])


def headline(verdict: str, named: Sequence[FoundCause], suspects: Sequence[FoundCause], where: str,
             small_errors: float | None = None, of_data: bool = False,
             cannot_tell: str = "") -> str:
    """Headline; ``of_data``: ``where`` says what is wrong in the dataset.

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
        key = "both" if together(suspects) else "either"
        return WORDS[key].format(first=heads[0], others="; or ".join(heads[1:]))
    return WORDS[verdict].format(where=where)


def next_step(verdict: str, checks: Sequence[str], advice: str, of_data: bool = False) -> str:
    """The direct checks, and only then an experiment; ``of_data``: the dataset is to be mended."""
    if not (checks and advice):
        return "; ".join(dict.fromkeys(checks)) or advice
    key = "check_data" if of_data else f"check_{verdict if verdict == 'named' else 'suspects'}"
    return WORDS[key].format(checks="; ".join(dict.fromkeys(checks)), advice=advice)


def slip(judged: Judgement) -> str:
    """Sentence on a slip of the pen, if that takes more of a misfit than any other pattern."""
    if (found := of_data(judged)) is not None:
        return found.what
    if best := _slipped(judged):
        return judged.test.words(best)
    odd = judged.odd_specimen
    return WORDS["odd_specimen"].format(specimen=odd) if odd else ""


def of_data(judged: Judgement) -> Finding | None:
    """Sentences on what looks wrong in the dataset, whatever the simulation is."""
    if (labels := judged.relabelling) is not None:
        return Finding("labels", relabelled(judged, labels), labels.file, labels.lines,
                       WORDS["do_labels"])
    if not (judged.unusual or judged.confusions):
        return None
    factors = np.exp((judged.chosen or judged.nominal).unknowns[FACTORS])
    if not judged.confusions:
        return Finding("film", WORDS["unusual"].format(factors=factors), check=WORDS["do_film"])
    read = listed([WORDS["reads"].format(confusion=one) for one in judged.confusions], "or")
    key = "confused" if judged.unusual else "mistaken"
    return Finding("quantity", WORDS[key].format(reads=read, factors=factors),
                   check=WORDS[judged.confusions[0].check])


def relabelled(judged: Judgement, labels: Relabelling) -> str:
    """Labels that look wrong, and what the simulation misses as it is and with them put right."""
    noise = 1e6 * float(np.median(judged.table.sigma[judged.table.lengths]))
    before, after = (noise * (chi_squared / len(judged.table)) ** 0.5
                     for chi_squared in (labels.before, labels.after))
    part, key = labels.part, "exchanged" if labels.pair else "one_row_off"
    where = "".join(WORDS[name].format(part=part) for name, there in (
        ("of", part.specimen), ("under", part.mass), ("lines", part.file)) if there)
    beside = " and ".join(plain(str(cause)) for cause in labels.hypothesis)
    where += WORDS["only"] if where else ""
    return WORDS[key].format(labels=labels, where=where, before=before, after=after,
                             way="low" if labels.rows > 0 else "high",
                             simulation=WORDS["beside" if beside else "alone"].format(beside))


def _slipped(judged: Judgement) -> str:
    """The run, load or readings that take more of a misfit than any pattern; "" if none do."""
    taken = taken_by(judged.nominal.free_jacobian)
    slips = _slips(judged, taken)
    shares = _shares(judged, taken, _singled(judged) | slips)
    best = max(shares, key=lambda name: shares[name], default="")
    return best if best in slips else ""


def where(judged: Judgement) -> str:
    """Place of the misfit: a slip of the pen, or the pattern that takes most, and one more."""
    if words := slip(judged):
        return words
    told_of, shares = _told(judged)
    parts = [judged.test.words(name) + (_loop(judged) if name == "loop" else "")
             for name in told_of]
    if told_of and told_of[0].startswith("specimen ") and not _alone(told_of[0], shares):
        parts[0] = WORDS["apart"]
    return "; ".join(parts)


def _loop(judged: Judgement) -> str:
    """Distance of readings on the way out from those on the way back, in words."""
    table, columns = judged.table, judged.patterns["loop"]
    rows = np.any(columns != 0, axis=1)
    missed = (table.value - judged.nominal.predicted(table))[rows]
    of_way = columns[rows] @ np.linalg.lstsq(columns[rows], missed, rcond=None)[0]
    unit = UNITS[str(table.kind[rows][0])]
    return WORDS["loop_size"].format(
        size=2 * unit.per_si * float(np.sqrt(np.mean(of_way**2))), unit=unit.name)


def pattern_checks(judged: Judgement) -> list[str]:
    """Checks on the bench, by where the misfit of the nominal model is."""
    if of_data(judged) is not None:
        return []
    if best := _slipped(judged):
        told_of, shares = [best], dict[str, float]()
    elif judged.odd_specimen:
        return [WORDS["look_specimen"].format(name=judged.odd_specimen)]
    else:
        told_of, shares = _told(judged)
    checks = []
    for name in told_of:
        kind, _, rest = name.partition(" ")
        if kind == "specimen" and not _alone(name, shares):
            kind = "specimens"
        checks.append(WORDS.get(f"look_{kind}", "").format(name=rest))
    return [check for check in checks if check]


def _told(judged: Judgement) -> tuple[list[str], dict[str, float]]:
    """The pattern that takes most of the misfit, and one more; and what all take at first.

    The second takes most beside all of the first one's kind. Each is counted by what it takes that
    the refitted stiffness and permittivity leave; so a specimen is not blamed for what these have
    moved.
    """
    columns = _singled(judged)
    taken, told_of = taken_by(judged.nominal.free_jacobian), list[str]()
    first: dict[str, float] = {}
    for least in (0.0, _CLEAR):
        kinds = {name.split()[0] for name in told_of}
        others = {name: values for name, values in columns.items() if name.split()[0] not in kinds}
        shares = _shares(judged, taken, others)
        best = max(shares, key=lambda name: shares[name], default=None)
        if best is None or shares[best] <= least or (told_of and best.split()[0] in _VAGUE):
            break
        told_of.append(best)
        first = first or shares
        of_kind = [values for name, values in others.items() if name.split()[0] == best.split()[0]]
        taken = np.hstack([taken, beside(taken, np.hstack(of_kind))])
    return told_of, first


def _shares(judged: Judgement, taken: Array, columns: dict[str, Array]) -> dict[str, float]:
    """Shares that patterns take away, vague ones and the best of many less."""
    weights = _VAGUE | _BEST_OF_MANY
    return {name: _taken(judged.nominal, taken, values) * weights.get(name.split()[0], 1.0)
            for name, values in columns.items()}


def _slips(judged: Judgement, taken: Array) -> dict[str, Array]:
    """Columns of the run and of the load that is off more than the others, if one is."""
    table, slips = judged.table, dict[str, Array]()
    names = [specimen.name for specimen in judged.simulation.setup.specimens]
    for columns in (run_columns(table, names), load_columns(table)):
        shares = _shares(judged, taken, columns)
        best = max(shares, key=lambda name: shares[name], default=None)
        if best is not None and _alone(best, shares, shares):
            slips[best] = columns[best]
    return slips


def _singled(judged: Judgement) -> dict[str, Array]:
    """Patterns' columns; of jumps the one, where no other pattern is as improbable by noise."""
    columns = over(judged.patterns, judged.table)
    for name in EACH_RUN:
        columns.pop(name, None)
    p_values = judged.test.p_values
    least = min(p_values.get(name, 1.0) for name in columns)
    for name in columns.keys() & set(JUMPS):
        size = np.linalg.norm(columns[name], axis=0)
        best = np.argmax(np.abs(judged.nominal.residual @ columns[name]) / np.maximum(size, 1e-300))
        columns[name] = columns[name][:, [best]]
    return {name: values for name, values in columns.items()
            if name not in JUMPS or p_values.get(name, 1.0) <= least}


def _taken(nominal: Fit, taken: Array, columns: Array) -> float:
    """χ² that columns take away beside what is taken already, beyond their number."""
    basis = beside(taken, columns)
    return float(np.sum((basis.T @ nominal.residual) ** 2) - basis.shape[1])


def _alone(best: str, shares: Mapping[str, float], rivals: Iterable[str] = ()) -> bool:
    """Whether no other specimen, or none of some rivals, takes nearly as much."""
    among = rivals or [name for name in shares if name.startswith("specimen ")]
    return shares[best] >= _ALONE * max([*(shares[name] for name in among if name != best), 0.0])
