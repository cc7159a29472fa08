"""A share of trials, with its interval and what it shall be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from scipy.stats import beta

from benchmarks.trials.record import Record

#: How trials end that say nothing.
GONE = ("refused", "raised")


@dataclass(frozen=True)
class Rate:
    """A share, or with ``value`` another number, and what it shall be."""

    what: str
    hits: int
    count: int
    low: float = 0.0
    high: float = 1.0
    value: float | None = None

    @property
    def share(self) -> float:
        """The number."""
        return self.value if self.value is not None else self.hits / max(self.count, 1)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % limits of Clopper and Pearson (Biometrika 26, 404, 1934)."""
        n, k = self.count, self.hits
        return (float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0,
                float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0)

    @property
    def met(self) -> bool:
        """Whether the number is within its target."""
        return self.count > 0 and self.low <= self.share <= self.high

    def row(self) -> str:
        """A row of the page's table."""
        target = (f"{self.low:.0%} to {self.high:.0%}" if self.low and self.high < 1
                  else f"≥ {self.low:.0%}" if self.low else f"≤ {self.high:.3g}"
                  if self.value is not None
                  else f"≤ {self.high:.0%}" if self.high < 1 else "none set")
        if self.value is not None:
            return (f"| {self.what} | {self.value:.3f} | | {self.count} | {target} | "
                    f"{self._said(target)} |")
        low, high = self.interval
        return (f"| {self.what} | {self.share:.1%} | {low:.1%} to {high:.1%} | "
                f"{self.hits} of {self.count} | {target} | {self._said(target)} |")

    def _said(self, target: str) -> str:
        if target == "none set" or not self.count:
            return "not run" if not self.count else ""
        return "met" if self.met else "**missed**" + (" (too wide)" if self.low
                                                      and self.share > self.high else "")


def share(what: str, records: Sequence[Record], holds: Callable[[Record], bool | None],
          low: float = 0.0, high: float = 1.0) -> Rate:
    """Of the records for which something holds."""
    return Rate(what, sum(bool(holds(record)) for record in records), len(records), low, high)
