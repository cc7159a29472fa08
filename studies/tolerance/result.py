"""Films that scatter, as they are stored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from tympan.geometry.fields import Key
from tympan.studies.case import CaseRecord, WallTime, Warnings

#: What is told of the films, by key: words, unit of the bench, and what an SI number is of it.
QUANTITIES = {
    "deflection_m": ("deflection", "mm", 1e3),
    "stroke_m": ("stroke", "mm", 1e3),
    "blocked_force_N": ("blocked force", "mN", 1e3),
    "capacitance_F": ("capacitance", "pF", 1e12),
    "frequency_Hz": ("frequency", "Hz", 1.0),
    "limit_V": ("first limit", "kV", 1e-3),
}


@dataclass(frozen=True, kw_only=True)
class GivenTolerance:
    """A number that scatters."""

    name: Annotated[str, Key("what scatters")]
    scope: Annotated[Literal["film", "batch"], Key(
        "whether each film has its own, or all films of a batch share it")]
    relative: Annotated[float | None, Key("relative standard deviation; none of lengths")]
    deviation_m: Annotated[float | None, Key("standard deviation of a length, else none")]
    source: Annotated[str, Key("where it comes from: the library, assumed, or given")]
    reason: Annotated[str, Key("why it is so large; empty where it was given")]

    @property
    def label(self) -> str:
        """Name for people."""
        return self.name + ", batch" * (self.scope == "batch")


@dataclass(frozen=True, kw_only=True)
class VarianceShare:
    """Part of the variance that one tolerance makes."""

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


@dataclass(frozen=True, kw_only=True)
class Chance:
    """Probability with its 95 % limits, by Wilson's interval."""

    probability: Annotated[float, Key("share of the films")]
    low: Annotated[float, Key("lower 95 % limit, of the number of films alone")]
    high: Annotated[float, Key("upper 95 % limit")]


@dataclass(frozen=True, kw_only=True)
class FilmLimits:
    """First limit that films meet as the voltage rises."""

    films: Annotated[int, Key("films whose first limit was sought, of all")]
    highest_V: Annotated[float, Key("nominal voltage up to which it was sought")]
    kinds: Annotated[Mapping[str, float], Key(
        "share of these films by the kind of their first limit, the largest first; the rest has "
        "none up to that voltage")]


@dataclass(frozen=True, kw_only=True)
class ToleranceResult(CaseRecord):
    """Distributions of what films have whose numbers scatter, SI."""

    ending = "-tolerance"
    writer = "tympan tolerance"
    kinds = ("json",)
    drawn = ("png", "svg")

    films: Annotated[int, Key("films that were drawn and solved")]
    seed: Annotated[int, Key("of the random numbers")]
    tolerances: Annotated[tuple[GivenTolerance, ...], Key("what scatters")]
    reached: Annotated[Chance, Key(
        "films with a stable equilibrium at the voltage, firm and in tension everywhere and below "
        "their electric strength")]
    quantities: Annotated[Mapping[str, Spread], Key(
        "distributions, by quantity and unit; limit_V, the nominal voltage of the first limit, is "
        "of the films of limits.films that have one")]
    limits: Annotated[FilmLimits, Key("first limits")]
    error: Annotated[float | None, Key(
        "largest estimated error of the reduced films' deflection, relative, of some of them; none "
        "where no film reaches the voltage")]
    made_s: Annotated[float, Key("time that making the family of films took, of wall_s")]
    wall_s: WallTime
    warnings: Warnings = ()
