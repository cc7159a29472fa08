"""The page of a study, and its power curve."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.trials.rates.kinds import bench_rates, calibration, power, rates
from benchmarks.trials.rates.rate import Rate
from benchmarks.trials.rates.sizes import size_lines
from benchmarks.trials.record import Record
from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD

#: Head of the table of strangers.
_STRANGER = "stranger | trials | verdicts | specimen or column told"

#: Rows of the verdict's page: what was in the readings, what was said, and the rate of that.
_VERDICTS = (
    ("nothing", "something is wrong", "nothing hidden: false alarms"),
    ("nothing but errors as benches make them: outliers, drift", "something is wrong",
     "mess of any kind, nothing hidden: false alarms"),
    ("one effect that shows", "something is wrong", f"one effect, Δχ² ≥ {SEEN:g}: detected"),
    ("one effect that shows and that no other effect imitates", "this effect is *named*",
     "one identifiable effect: it is named"),
    ("one effect that shows and that no other effect imitates", "another one is *named*",
     "one identifiable effect: another is named"),
    ("a cause that is not in the library and that no effect imitates", "*unexplained*",
     f"outside the library, Δχ² ≥ {SEEN:g} from it: unexplained"),
    ("a cause that is not in the library and that no effect imitates", "some effect is *named*",
     "outside the library: some effect is named"),
    ("an effect that was deleted from the library", "another one is *named*",
     "the true effect deleted from the library: another is named"))


def page(records: Sequence[Record], about: str) -> str:
    """The page's text."""
    text = Path(__file__).with_suffix(".md").read_text(encoding="utf-8")
    return text.format(
        seen=SEEN, told=TOLD, about=about, rates=rate_table(rates(records)),
        power=table("Δχ² | detected | named | trials", map(_power_row, power(records))),
        calibration=table("stated | there | trials", (
            f"{stated:.2f} | {true:.2f} | {count}"
            for stated, true, count in calibration(records)[1])),
        strangers=table(_STRANGER, _strangers(records)), sizes="\n".join(size_lines(records)))


def bench_page(records: Sequence[Record], about: str) -> str:
    """The text of the page of benches as they are."""
    text = Path(__file__).with_name("bench.md").read_text(encoding="utf-8")
    return text.format(seen=SEEN, told=TOLD, about=about, rates=rate_table(bench_rates(records)),
                       strangers=table(_STRANGER, _strangers(records)))


def verdict_rows(records: Sequence[Record]) -> list[str]:
    """Rows of the table of docs/explanation/verdict.md."""
    known = {rate.what: rate for rate in (*rates(records), *bench_rates(records))}
    return [f"| {there} | {said} | {_often(known[what])} |" for there, said, what in _VERDICTS]


def _often(rate: Rate) -> str:
    """A rate in words, with its interval."""
    low, high = map(_percent, rate.interval)
    if not rate.hits:
        return f"0 of {rate.count} (at most {high} %)"
    return f"{_percent(rate.share)} % ({low} to {high} %)"


def _percent(share: float) -> str:
    """Two digits; of what is nearly all, two of what is lacking."""
    places = 1 if min(share, 1 - share) < 0.095 else 0
    return f"{100 * share:.{places}f}".removesuffix(".0")


def table(head: str, rows: Iterable[str]) -> str:
    """A table of rows whose cells are divided by bars."""
    rule = "|---" * (head.count("|") + 1) + "|"
    return "\n".join([f"| {head} |", rule, *(f"| {row} |" for row in rows)])


def rate_table(rows: Iterable[Rate]) -> str:
    """A table of rates."""
    head = "| what | rate | 95 % interval | count | target | |"
    return "\n".join([head, "|---" * 6 + "|", *(rate.row() for rate in rows)])


def _power_row(row: tuple[float, float, Rate, Rate]) -> str:
    low, high, seen, named = row
    return (f"{_bin(low, high)} | {seen.share:.0%} ({seen.interval[0]:.0%} to "
            f"{seen.interval[1]:.0%}) | {named.share:.0%} | {seen.count}")


def _strangers(records: Sequence[Record]) -> Iterator[str]:
    outside = [record for record in records
               if record.population in ("outside", "strangers") and record.seen >= SEEN]
    for name in sorted({record.truth[0] for record in outside}):
        group = [record for record in outside if record.truth[0] == name]
        said = Counter(", ".join(record.named) if record.named else record.verdict
                       for record in group)
        told, placed = (sum(record.rows[place] for record in group if record.rows)
                        for place in range(2))
        yield (f"{name} | {len(group)} | "
               f"{'; '.join(f'{words} {n}' for words, n in said.most_common())} | "
               f"{f'{told} of {placed}' if placed else ''}")


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
