"""Sentences of the effects that were found, with sizes and their limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import floor, inf, log10
from string import Formatter

from tympan.studies.effects.effect import Effect, EffectFamily, EffectParameter

#: Most significant digits of a number in a sentence. No effect is known more accurately.
_DIGITS = 3
#: Resolution of the last digit, as a share of half the width between limits, so that rounding
#: hardly moves the limits. Set by trial.
_RESOLVED = 0.6

#: Share of the width between limits below which an effect cannot be distinguished from none.
_NEAR = 1e-3


@dataclass(frozen=True)
class FoundSize:
    """A parameter's value with its 95 % limits, in SI, formatted for sentences.

    Formatted without a specification it is a size with its unit; if it lies on a limit, "at least"
    or "less than" a size. It has its sign only where no words give that (``even``). Formatted with
    two words, as in ``{m_0:heavier/lighter}``, it is the first one where it is positive, else the
    second.
    """

    parameter: EffectParameter
    value: float
    low: float
    high: float

    def __format__(self, words: str) -> str:
        if words:
            positive, negative = words.split("/")
            return positive if self._told[0] >= 0 else negative
        (value, low, high), unit = self._told, self._unit
        if self.small:
            return f"less than {_rounded(max(-low, high), 2)}{unit}"
        if low < value == high or low == value < high:
            return f"at least {_rounded(min(abs(low), abs(high)), 2)}{unit}"
        return f"{self._text(value if self._signed else abs(value))}{unit}"

    @property
    def _signed(self) -> bool:
        return self.parameter.sign == "even"

    @property
    def small(self) -> bool:
        """Whether only an upper bound of it is known."""
        value, low, high = self._told
        near = _NEAR * (high - low)
        return low <= near and -near <= high and (
            self.parameter.sign == "even" or abs(value) <= near)

    @property
    def clear(self) -> bool:
        """Whether it is certainly not zero."""
        _, low, high = self._told
        return not self.small and (low > 0 or high < 0)

    @property
    def range(self) -> str:
        """Limits as words; "" where the size already is one."""
        value, low, high = self._told
        if self.small or value in (low, high):
            return ""
        if high < 0 and not self._signed:
            low, high = -high, -low
        return f"{self._text(low)} to {self._text(high)}{self._unit}"

    @property
    def _told(self) -> tuple[float, float, float]:
        """Value and limits in the unit of sentences."""
        item = self.parameter
        scale = 100.0 if item.told_in == "%" else item.shown(1.0)
        value, *limits = (scale * item.tell(at) for at in (self.value, self.low, self.high))
        return value, min(limits), max(limits)

    @property
    def _unit(self) -> str:
        unit = (self.parameter.told_in or self.parameter.unit).replace("u", "µ", 1)
        return f" {unit}" if unit else ""

    def _text(self, number: float) -> str:
        """Write a number with the digits that half the width between the limits justifies."""
        value, low, high = self._told
        size, width = max(map(abs, (value, low, high))), _RESOLVED * (high - low) / 2
        digits = _power(size) - _power(width) + 1 if 0 < width < inf else _DIGITS
        return _rounded(number, min(digits, _DIGITS), size)


def _rounded(number: float, digits: int, size: float = 0.0) -> str:
    """Write a number with the decimals that ``size`` needs to have ``digits`` digits."""
    decimals = max(0, digits - 1 - _power(size or abs(number)))
    return f"{number:.{decimals}f}".replace("-", "\N{MINUS SIGN}")


def _power(size: float) -> int:
    return floor(log10(size)) if 0 < size < inf else 0


def finding(effect: Effect, sizes: Mapping[str, FoundSize], which: str | None) -> str:
    """Write the sentence of an effect that was found, without a full stop."""
    return effect.finding.format(which=which, **sizes)


def family_finding(family: EffectFamily, size: FoundSize, which: str | None = None) -> str:
    """Write the sentence of a family with an effect found: its measure is given by its limits."""
    return family.finding.format(share=size.range or size, size=size, which=which)


def limits_told(effect: Effect, sizes: Mapping[str, FoundSize]) -> str:
    """Write the 95 % limits of the sizes in an effect's sentence, in its order."""
    names = [name for _, name, words, _ in Formatter().parse(effect.finding)
             if name in sizes and not words]
    return "; ".join(filter(None, (sizes[name].range for name in names if name)))
