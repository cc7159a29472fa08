"""Films that scatter, as they are stored."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from tympan.base.arrays import Mask
from tympan.base.fields import Key
from tympan.studies.case import CaseRecord, WallTime, Warnings
from tympan.studies.films.first_limits import ENDS, kinds, label_of
from tympan.studies.films.population import LoadedFilms
from tympan.studies.rows import cells_of
from tympan.studies.wanted import Bound

#: Quantities that always have a distribution, besides the first limit and those of wanted bounds.
TOLD = ("deflection", "stroke", "blocked_force", "capacitance", "frequency")
#: Quantities that have one, too, if the plates tilt.
TILTS = ("tilt_x", "tilt_y")


@dataclass(frozen=True, kw_only=True)
class GivenTolerance:
    """A number that scatters."""

    name: Annotated[str, Key("what scatters")]
    scope: Annotated[Literal["film", "batch"], Key(
        "whether each film has its own, or all films of a batch share it")]
    relative: Annotated[float | None, Key(
        "standard deviation as a share: of the number, for a gradient of the thickness; none of "
        "lengths")]
    deviation_m: Annotated[float | None, Key("standard deviation of a length, else none")]
    source: Annotated[str, Key("where it comes from: the library, assumed, or given")]
    reason: Annotated[str, Key("why it is so large; empty where it was given")]

    @property
    def label(self) -> str:
        """Name for people."""
        return self.name + ", batch" * (self.scope == "batch")


@dataclass(frozen=True, kw_only=True)
class VarianceShare:
    """Part of the variance that one tolerance causes."""

    name: Annotated[str, Key("what scatters")]
    scope: Annotated[Literal["film", "batch"], Key("from film to film, or from batch to batch")]
    alone: Annotated[float, Key("share of the variance that it makes alone (Sobol's first index)")]
    low: Annotated[float, Key("lower 95 % limit of that")]
    high: Annotated[float, Key("upper 95 % limit of that")]
    total: Annotated[float, Key("the same with all its interactions (Sobol's total index)")]

    @property
    def label(self) -> str:
        """Name for people."""
        return self.name + ", batch" * (self.scope == "batch")


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Spread of a quantity between films that reach the voltage; its unit is in its key."""

    nominal: Annotated[float | None, Key(
        "of the film without scatter; none where that does not reach the voltage")]
    median: Annotated[float, Key("half of the films have more")]
    low: Annotated[float, Key("5 % of the films have less")]
    high: Annotated[float, Key("5 % of the films have more")]
    deviation: Annotated[float, Key("standard deviation")]
    within_batch: Annotated[float | None, Key(
        "standard deviation between films of one batch; none where shares are not told")]
    shares: Annotated[tuple[VarianceShare, ...], Key(
        "what makes the variance, the largest first; empty where too many films do not reach the "
        "voltage, or all films have the same value")]
    interactions: Annotated[float | None, Key(
        "rest of the variance, which tolerances make together: with all shares it is 1")]
    bins: Annotated[tuple[float, ...], Key("edges of the histogram's bins, ascending")]
    counts: Annotated[tuple[int, ...], Key("films in each bin")]


#: Standard deviations that contain 95 % of a normal distribution.
_Z = 1.959963984540054

#: Function that counts independent films for a mask of films.
Independent = Callable[[Mask], float]


@dataclass(frozen=True, kw_only=True)
class Chance:
    """Probability with its 95 % limits, by Wilson's interval."""

    probability: Annotated[float, Key("share of the films")]
    low: Annotated[float, Key("lower 95 % limit, of the number of films alone")]
    high: Annotated[float, Key("upper 95 % limit")]

    @classmethod
    def of(cls, some: Mask, independent: Independent = len) -> Chance:
        """Estimate a share of films from a mask; ``independent`` counts its independent films."""
        share, count = float(some.mean()), independent(some)
        middle = (share + _Z**2 / (2 * count)) / (1 + _Z**2 / count)
        half = (_Z * (share * (1 - share) / count + _Z**2 / (4 * count**2)) ** 0.5
                / (1 + _Z**2 / count))
        # Rounding leaves small errors where the limit is 0 or 1.
        return cls(probability=share, low=max(middle - half, 0.0) if share else 0.0,
                   high=min(middle + half, 1.0) if share < 1 else 1.0)

    @property
    def text(self) -> str:
        """Share and limits in per cent, with the digits that the limits justify."""
        values = [f"{100 * value:.3g}" for value in (self.probability, self.low, self.high)]
        return "{} % ({} to {} %)".format(*values)


@dataclass(frozen=True, kw_only=True)
class FilmFailure:
    """Films that do not bear their voltage, by what they meet first on the way to it."""

    kind: Annotated[str, Key(
        "what they meet first: a kind of limit; law_range, the end of the stretches that their law "
        "is made for; or unknown, where reduced films know no state and no limit")]
    before_V: Annotated[float, Key(
        "nominal voltage before which they meet it: theirs, times the margin to the loss of "
        "tension where that is wanted")]
    share: Annotated[Chance, Key("share of all films")]

    @property
    def label(self) -> str:
        """Label of the limit that they meet."""
        return "no state is known" if self.kind == UNKNOWN else label_of(self.kind)

    @property
    def words(self) -> str:
        """Sentence with share and voltage."""
        share, voltage = self.share.text, f"{self.before_V / 1e3:.4g} kV"
        if self.kind == UNKNOWN:
            return f"of {share} of the films reduced films know no state at {voltage}"
        return f"in {share} of the films {self.label} comes before {voltage}"

    @classmethod
    def of(cls, films: LoadedFilms, lost: Mask, voltage: float,
           independent: Independent = len) -> tuple[FilmFailure, ...]:
        """Classify failures of ``lost`` films, a mask, below a voltage; the most frequent first."""
        met = np.full(len(lost), None, dtype=object)
        met[lost] = films.failures(lost)
        met[met == ""] = UNKNOWN
        found = []
        for kind in (*kinds(), UNKNOWN):
            if (met == kind).any():
                margin = films.margin if kind in ENDS else 1.0  # the margin applies to these limits
                found.append(cls(kind=kind, before_V=margin * voltage,
                                 share=Chance.of(met == kind, independent)))
        return tuple(sorted(found, key=lambda failure: -failure.share.probability))


#: Kind of a failure for which reduced films have neither a state nor a limit.
UNKNOWN = "unknown"


@dataclass(frozen=True, kw_only=True)
class WantedBound:
    """A wanted bound, and the films that keep it."""

    name: Annotated[str, Key("of the quantity")]
    sense: Annotated[Literal["at least", "at most"], Key("sense of the bound")]
    bound: Annotated[float, Key("value that was asked for [SI]")]
    unit: Annotated[str, Key("SI unit; 1 of plain numbers")]
    kept: Annotated[Chance, Key("films that keep it; of all but limit they reach the voltage")]
    missed: Annotated[Chance, Key("films that reach the voltage and miss it")]

    @classmethod
    def of(cls, bound: Bound, kept: Mask, reached: Mask,
           independent: Independent = len) -> WantedBound:
        """Count the films that keep a bound, from masks."""
        return cls(name=bound.name, sense="at least" if bound.least else "at most",
                   bound=bound.value, unit=bound.quantity.unit,
                   kept=Chance.of(kept, independent),
                   missed=Chance.of(reached & ~kept, independent))

    @property
    def text(self) -> str:
        """The bound in words."""
        return Bound(self.name, self.bound, self.sense == "at least").text


@dataclass(frozen=True, kw_only=True)
class FilmLimits:
    """First limit that films meet as the voltage rises."""

    films: Annotated[int, Key("films whose first limit was sought, of all")]
    highest_V: Annotated[float, Key("nominal voltage up to which it was sought")]
    kinds: Annotated[Mapping[str, float], Key(
        "share of these films by the kind of their first limit, or law_range where they leave the "
        "stretches that their law is made for; the largest first. The rest has none up to that "
        "voltage")]


@dataclass(frozen=True, kw_only=True)
class ToleranceResult(CaseRecord):
    """Distributions over films made to the same tolerances, SI."""

    ending = "-tolerance"
    writer = "tympan tolerance"
    indexed = ("quantity",)
    kinds = ("json",)
    drawn = ("png", "svg")

    films: Annotated[int, Key("films that were drawn and solved")]
    seed: Annotated[int, Key("of the random numbers")]
    tolerances: Annotated[tuple[GivenTolerance, ...], Key("what scatters")]
    reached: Annotated[Chance, Key(
        "films with a stable equilibrium at the voltage, firm and in tension everywhere and below "
        "their electric strength")]
    fails: Annotated[tuple[FilmFailure, ...], Key(
        "films that do not reach the voltage, by what they meet first, the most frequent first; "
        "with reached their shares are 1")] = ()
    wanted: Annotated[tuple[WantedBound, ...], Key("bounds that were asked for")] = ()
    kept: Annotated[Chance | None, Key(
        "films that reach the voltage and keep all these bounds; none without")] = None
    quantities: Annotated[Mapping[str, Spread], Key(
        "distributions, by quantity and unit, those of wanted bounds too; limit_V, the nominal "
        "voltage of the first limit, is of the films of limits.films that have one")]
    limits: Annotated[FilmLimits, Key("first limits")]
    error: Annotated[float | None, Key(
        "largest estimated error of the reduced films' deflection, relative, of some of them; none "
        "where no film reaches the voltage")]
    made_s: Annotated[float, Key("time that making the family of films took, of wall_s")]
    wall_s: WallTime
    warnings: Warnings = ()

    @property
    def key_numbers(self) -> dict[str, Any]:
        """Share of the films that reach the voltage, and that keep the wanted bounds."""
        kept = self.kept and self.kept.probability
        return {"specimen": self.specimen, "mass_kg": self.mass_kg, "voltage_V": self.voltage_V,
                "films": self.films, "reached": self.reached.probability,
                "reached_low": self.reached.low, "reached_high": self.reached.high, "kept": kept}

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each quantity, with the shares of the tolerances in its variance."""
        rows = []
        for name, spread in self.quantities.items():
            cells = cells_of(spread)
            shares = {f"share_{share.label.replace(', ', '_')}": share.alone
                      for share in spread.shares}
            last = {"interactions": cells.pop("interactions")}
            rows.append({"quantity": name, **cells, **shares, **last})
        return rows
