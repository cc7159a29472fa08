"""What a study's records add up to: rates with intervals against their targets, the page and the
power curve."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.trials.rate import GONE, Rate, share
from benchmarks.trials.size_rates import size_lines, size_rates
from benchmarks.trials.trial import Record
from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD

#: Edges of the bins of Δχ² for the power curve, and bins of equal count for stated probabilities.
_EDGES = (-np.inf, 1.0, 4.0, 9.0, 16.0, 25.0, 50.0, 100.0, 400.0, np.inf)
_BINS = 8
#: What the causes are mixed by for the calibration of stated probabilities: the priors of the
#: diagnosis.
_MIXTURE = {"single": 0.6, "pair": 0.2, "outside": 0.2}


def rates(records: Sequence[Record]) -> list[Rate]:
    """The rates of the study."""
    kinds = {name: [record for record in records
                    if record.population == name and record.verdict not in GONE]
             for name in dict.fromkeys(record.population for record in records)}

    def of(name: str) -> list[Record]:
        return kinds.get(name, [])

    single = of("single")
    named = [record for record in (*single, *of("strong")) if record.identifiable]
    weak = [record for record in single if not record.identifiable]
    outside = [record for record in of("outside") if record.seen >= SEEN]
    pairs = [record for record in (*of("pair"), *of("duo")) if record.identifiable]
    alarmed = {name: [record for record in of(name) if record.covered is not None]
               for name in ("single", "pair")}
    sizes, large = ([hit for record in kind for hit in record.inside] for kind in (single, named))
    gained = [record.ratio for record in of("gain")
              if record.identifiable and record.ratio is not None]
    predicted = [record for record in of("gain") if record.identifiable and record.predicted]
    mendless = [record for record in records
                if record.population != "outside" or record.told >= TOLD]
    return [
        share("nothing hidden: false alarms", of("null"), _alarm, high=0.05),
        share(f"one effect, Δχ² ≥ {SEEN:g}: detected",
              [record for record in (*single, *of("strong")) if record.seen >= SEEN],
              _alarm, 0.95),
        share("one identifiable effect: it is the most probable cause", named, _first, low=0.95),
        share("one identifiable effect: it is named", named, _right, low=0.8),
        share("one identifiable effect: another is named", named, lambda record: record.misnamed,
              high=0.02),
        share("one effect too weak to be identified: another is named", weak,
              lambda record: record.misnamed, high=0.02),
        share("exact aliases: said to be, and none of them named", of("alias"),
              lambda record: record.reported, low=1.0),
        Rate("effects as drawn, one or two as often as the diagnosis expects, seen: 95 % set has "
             "them", 0, sum(map(len, alarmed.values())), 0.92, 0.98, covering(alarmed)),
        share("the same, one effect: the set, which leaves room for two, has it",
              alarmed["single"], lambda record: record.covered, 0.92),
        Rate("calibration error of the first cause's stated probability", 0,
             sum(bool(record.ranked) for name in _MIXTURE for record in of(name)), 0.0, 0.05,
             calibration(records)[0]),
        Rate("the same, without strangers that an effect of the library makes as well", 0,
             sum(bool(record.ranked) for record in mendless for name in _MIXTURE
                 if record.population == name), 0.0, 0.05,
             calibration(mendless)[0]),
        Rate("one effect as drawn: 95 % intervals have the true size", sum(sizes), len(sizes), 0.92,
             0.98),
        Rate("the same, identifiable effects", sum(large), len(large), 0.92, 0.98),
        share(f"outside the library, Δχ² ≥ {SEEN:g} from it: unexplained", outside,
              lambda record: record.verdict == "unexplained", low=0.9),
        share("outside the library: some effect is named", outside,
              lambda record: bool(record.named), high=0.05),
        share("two identifiable effects: both found (most probable hypothesis)", pairs,
              lambda record: set(record.best) == set(record.truth), low=0.8),
        share("the same: both named", pairs, lambda record: set(record.named) == set(record.truth)),
        share("the same: another is named", pairs, lambda record: record.misnamed, high=0.02),
        share("the true effect deleted from the library: another is named", of("deleted"),
              lambda record: bool(record.named), high=0.05),
        *(share(f"nothing hidden, noise stated 1.5 times {words}: false alarms",
                 of(f"noise stated {words}"), _alarm,
                 high=0.1) for words in ("too small", "too large")),
        share("nothing hidden, stress 1 to 2 % wrong by another law: alarms",
              [record for record in of("form") if not record.truth], _alarm),
        share("one identifiable effect, stress 1 to 2 % wrong: another is named",
              [record for record in of("form") if record.identifiable],
              lambda record: record.misnamed),
        share("refused, or ended in an error", list(records),
              lambda record: record.verdict in GONE),
        Rate("one identifiable effect: error beyond noise on readings held out, after over before, "
             "median", 0, len(gained), 0.0, 0.3, float(np.median(gained)) if gained else 1.0),
        Rate("the same: readings held out within their 95 % predictive bands",
             sum(record.predicted[0] for record in predicted),
             sum(record.predicted[1] for record in predicted), 0.92, 0.98),
        share("random designs, from files to the page: raised or refused",
              [record for record in records if record.population == "random"],
              lambda record: record.verdict in GONE, high=0.0),
        share("the same, films that are only softer or stiffer: an effect is named", of("random"),
              lambda record: bool(record.named), high=0.05),
        *size_rates(records),
    ]


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


def page(records: Sequence[Record], about: str) -> str:
    """The page's text."""
    lines = [_HEAD.format(seen=SEEN, told=TOLD), about, "",
             "| what | rate | 95 % interval | count | target | |",
             "|---|---|---|---|---|---|", *(rate.row() for rate in rates(records)), "", _AFTER, "",
             _POWER, "",
             "| Δχ² | detected | named | trials |", "|---|---|---|---|"]
    for low, high, seen, named in power(records):
        lines.append(f"| {_bin(low, high)} | {seen.share:.0%} "
                     f"({seen.interval[0]:.0%} to {seen.interval[1]:.0%}) | "
                     f"{named.share:.0%} | {seen.count} |")
    lines += ["", "Stated probability of the first cause, and how often it was there:", "",
              "| stated | there | trials |", "|---|---|---|"]
    lines += [f"| {stated:.2f} | {true:.2f} | {count} |"
              for stated, true, count in calibration(records)[1]]
    lines += ["", "What strangers were called (those the library cannot mend):", "",
              "| stranger | trials | verdicts |", "|---|---|---|"]
    outside = [record for record in records
               if record.population == "outside" and record.seen >= SEEN]
    for name in sorted({record.truth[0] for record in outside}):
        group = [record for record in outside if record.truth[0] == name]
        said = Counter(", ".join(record.named) if record.named else record.verdict
                       for record in group)
        lines.append(f"| {name} | {len(group)} | "
                     f"{'; '.join(f'{words} {n}' for words, n in said.most_common())} |")
    lines += ["", _SIZES, "", *size_lines(records)]
    return "\n".join(lines) + "\n"


def _bin(low: float, high: float) -> str:
    return f"< {high:g}" if low < 0 else f"{low:g}–{high:g}" if np.isfinite(high) else f"> {low:g}"


def draw_power(records: Sequence[Record], file: Path) -> None:
    """The power curve."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    bins = power(records)
    for place, (label, colour) in enumerate((("detected", "#1f6f8b"),
                                             ("named, rightly", "#c8553d"))):
        shares = [row[2 + place] for row in bins]
        at = np.arange(len(bins)) + 0.08 * (place - 0.5)
        middle = np.array([rate.share for rate in shares])
        error = np.abs(np.array([rate.interval for rate in shares]).T - middle)
        axes.errorbar(at, middle, error, fmt="o-", color=colour, capsize=3, label=label)
    names = [_bin(low, high) for low, high, *_ in bins]
    axes.set_xticks(range(len(bins)),
                    [f"{name}\n({row[2].count})" for name, row in zip(names, bins, strict=True)],
                    fontsize=8)
    axes.set(xlabel="Δχ² of the hidden effect after stiffness and permittivity are fitted (trials)",
             ylabel="share of trials", ylim=(-0.02, 1.02))
    axes.axhline(0.95, color="0.7", lw=0.8, zorder=0)
    axes.legend(frameon=False, loc="lower right")
    figure.savefig(file, dpi=150)


_HEAD = """# Hidden effects

Made by `make hidden`. Readings are made with an effect in them, by means that share neither mesh,
element order nor solver settings with the fitted model, and the diagnosis must find it: half by
finite elements of order 3 or 2 on finer meshes under loads, a quarter by the membrane's
differential equations (three circular specimens), a quarter by elements with a film of another
material family (Gent and Mooney against the fitted Ogden, stresses within 0.05 %). Otherwise the
three actuators of the paper. Two masses, 15 voltages to 6.5 kV, half of the first half up and
down again (with `hysteresis` among the effects, else not in the library). Stiffness is off by 10
%, permittivity by 5 %, noise is 20 µm in three fifths of the trials, 10 and 40 µm in a fifth each.
Effects and sizes are drawn from the priors, but for those "of any size": their sizes know nothing
of the priors. A draw without equilibrium at all readings, or with a margin too narrow to be built,
is drawn again. Draws called "single", "pair" and "of any size" are kept whatever they are; "strong"
ones and "duos", to have more that are identifiable, only if the fitted model foretells that no
other single effect will do. No size was chosen by what is found.

Δχ² is computed from the readings without noise: of a hidden effect, what the nominal model misses
with stiffness and permittivity fitted. An effect is identifiable with Δχ² ≥ {seen:g} and Δχ² ≥
{told:g} from every other single effect, each as large as it may be; two effects with {told:g} from
every other one or two. `amplifier_gain` is an exact alias of permittivity; other exact aliases are
made by taking one mass only (`unaccounted_mass`) or all readings at one time (`drift`,
`sensor_zero`).

**What the rates depend on.** They are of this library on these designs: another set of shapes,
masses and voltages tells other pairs apart, and `tympan diagnose --plan --self-check` computes the
same for a design of one's own. Noise is independent, normal and stated rightly but where it says
otherwise; noise that wanders along a ramp is not tried apart from `drift` and the strangers. What
is hidden obeys the library's own formula of an effect: a real slip or a real guide is less tidy,
and the strangers below, not the single effects, show what becomes of that. Films of readings and
fit are solved independently, but by the same theory (a membrane without bending, rest between
readings), so that an error of the theory is only in the trials with another law. Rates over effects
"as drawn" hold for sizes spread as the priors have them. Those by size do not rest on the priors,
but on how sizes are spread within a band; since larger effects show more, they hold for each band
by itself and not for a mixture. The share named depends on the priors' scale, for a name must
stand for scales from a third to ten times the usual one; the share named wrongly hardly does, as
the trials with a wrong scale show. Each rate's interval is that of its number of trials alone.
"""
_AFTER = """Intervals are Bayesian: they cover as stated over effects drawn from the priors. Those
of identifiable effects alone cover less: an effect that a prior thinks improbable is drawn towards
it. A set of hypotheses that has 95 % of what is thought of one effect and two has nearly all
effects that are alone, and fewer of those that are two. "Missed" judges the rate, not its interval.
The calibration error of a perfect engine is about 0.05 with a hundred trials and falls with their
root. A stranger with a smaller Δχ² from the library is as good as one of its effects, and may get
its name: with two masses a weight with the wrong label is a mass left out of account. A plate that
sticks and jumps is seen where its jumps stand out from the noise."""
_SIZES = """## Effects of any size

One effect, drawn from the library, of a size with each power of ten as probable as another between
0.3 and 20 usual ones, whatever the engine's priors say; the engine's priors are as always, or their
scale is a fifth, or five times what it should be (half of the trials). A size beyond what physics
allows, or without equilibrium at all readings, is drawn again.

![What was said of effects against their size](hidden-effects-sizes.png)

Two effects that look alike, both hidden in readings of finite elements, each in a size of its own:
where *ambiguous* ends and *named* begins. Noise 20 µm, the same for no two cells.

![Verdicts over the sizes of both](alias-maps.png)

Bold is what misses its target: another one named in at most 2 % of a band, unexplained in at most
5 %. Rates by size, with their 95 % intervals:"""
_POWER = "![Share detected and named against Δχ²](hidden-effects.png)"
