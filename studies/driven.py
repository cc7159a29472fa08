"""Voltages of an electrode's segments by their names, as commands, functions and files take them.

``"A = 3 kV, B = 0 kV"`` or ``{"A": "3 kV", "B": 0}``. A name may have several values or a range;
segments without a value have no voltage. A film has one voltage, the highest; each segment has its
share of it. So one number raises all of them in their proportion, and every question that a film
with one electrode has is one of a film with segments, too.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import numbers
from tympan.base.toml_reader import Rule, Table
from tympan.geometry.electrode import Electrode
from tympan.geometry.specimen import Specimen

S = TypeVar("S", bound=Specimen)

#: The name of a segment, and what gives it a value.
_NAMED = re.compile(r"(?:^|,)\s*([^\W\d]\w*)\s*=")

#: Keys of a range, which is a mapping too.
_RANGE = {"from", "to", "count"}

#: Digits of shares in which proportions that are the same agree: rounding changes later ones.
_DIGITS = 6


def by_segment(given: Any) -> bool:
    """Check whether voltages are given by the names of segments.

    Examples
    --------
    >>> by_segment("A = 3 kV, B = 0 kV"), by_segment({"A": 3e3}), by_segment(["A = 3 kV"])
    (True, True, True)
    >>> by_segment("3 kV"), by_segment({"from": 0, "to": "3 kV"}), by_segment([0.0, "3 kV"])
    (False, False, False)
    """
    if isinstance(given, str):
        return _NAMED.search(given) is not None
    if isinstance(given, Mapping):
        return not _RANGE & set(given)
    return isinstance(given, list | tuple) and any(map(by_segment, given))


def driven(specimen: S, given: Any, key: str = "voltage") -> tuple[S, Any]:
    """Set the shares of a specimen's segments; also the film's voltage or voltages.

    ``given`` is returned as it is unless it is by the names of segments. The voltage is a text, of
    a share of the first limit or of a voltage, or a list of numbers [V].

    Raises
    ------
    InputError
        When a name is that of no segment, or several voltages are in different proportions.
    """
    if not by_segment(given):
        return specimen, given
    found = drives(specimen, given, key)
    wired, _ = max(found, key=lambda pair: pair[1])
    if len({_proportion(other.electrode) for other, top in found if top > 0}) > 1:
        raise InputError("must be voltages in one proportion, or one voltage for each segment: "
                         "here the voltages of all segments rise and fall together", key=key,
                         given=str(given))
    if isinstance(given, str) and "%" in given:
        return wired, f"{found[0][1]:.17g} %"
    values = [voltage for _, voltage in found]
    return wired, f"{values[0]:.17g} V" if len(values) == 1 else values


@dataclass(frozen=True)
class Voltages:
    """Voltages of a question that takes several: those of the film, or of its segments [V].

    ``segments``: voltages of the segments by name, a set for each of the ``film``; empty where
    they are not given by name.
    """

    film: tuple[float, ...] = ()
    segments: tuple[Mapping[str, float], ...] = ()

    @classmethod
    def read(cls, given: Any, key: str = "voltage") -> Voltages:
        """Read what a command, a function or a file gives; none where it is None."""
        if given is None:
            return cls()
        if not by_segment(given):
            return cls(numbers(given, "voltage", key))
        sets = tuple(drives_by_name(given, key, shares=False))
        return cls(tuple(max(each.values()) for each in sets), sets)


def in_proportion(specimen: S, voltages: Sequence[float],
                  segments: Sequence[Mapping[str, float]] = ()
                  ) -> list[tuple[S, tuple[float, ...]]]:
    """List specimens with the shares of each proportion of voltages, and their voltages [V].

    ``segments``: voltages of the segments by name, a set for each voltage; without them there is
    one specimen, as it is. Voltages ascend.
    """
    return [(film, tuple(sorted(voltages[number] for number in numbers)))
            for film, numbers in grouped(specimen, voltages, segments)]


def grouped(specimen: S, voltages: Sequence[float], segments: Sequence[Mapping[str, float]] = ()
            ) -> list[tuple[S, tuple[int, ...]]]:
    """List specimens with the shares of each proportion of voltages, and the numbers of these.

    A set without voltage has no proportion: it is with the first one.
    """
    if not segments:
        return [(specimen, tuple(range(len(voltages))))]
    pairs = [specimen.electrode.driven(each) for each in segments]
    first = next((electrode for electrode, top in pairs if top > 0), specimen.electrode)
    films = dict[tuple[float, ...], Electrode]()
    found = dict[tuple[float, ...], list[int]]()
    for number, (electrode, top) in enumerate(pairs):
        wired = electrode if top > 0 else first
        films.setdefault(_proportion(wired), wired)
        found.setdefault(_proportion(wired), []).append(number)
    return [(replace(specimen, electrode=films[shares]), tuple(numbers))
            for shares, numbers in found.items()]


def require_different(voltages: Sequence[float], segments: Sequence[Mapping[str, float]] = ()
                      ) -> None:
    """Raise InputError where a voltage, or a set of those of the segments, is given twice."""
    sets: set[Any] = {tuple(sorted((name, volts) for name, volts in each.items() if volts))
                      for each in segments} if segments else {*voltages}
    if len(sets) < len(voltages):
        raise InputError("must differ from each other", key="voltage",
                         given=", ".join(f"{value:g}" for value in voltages))


def _proportion(electrode: Electrode) -> tuple[float, ...]:
    return tuple(round(float(segment.share), _DIGITS) for segment in electrode.segments)


def driven_once(specimen: S, given: Any, key: str = "voltage") -> tuple[S, float]:
    """Set the shares of a specimen's segments from one voltage for each; also the film's [V]."""
    sets = drives_by_name(given, key, shares=False)
    if len(sets) != 1:
        raise InputError("must have one voltage for each segment", key=key, given=str(given))
    try:
        electrode, top = specimen.electrode.driven(sets[0])
    except InputError as error:
        raise InputError(error.allowed, key=key, given=error.given) from None
    return replace(specimen, electrode=electrode), top


def film_voltage(table: Table, key: str, rule: Rule) -> float | None:
    """Read the voltage of a film in a file [V]; None where it is left out, or by names.

    Names of segments are those of specimens, which are read later.
    """
    given = table.data.get(key)
    if given is None or by_segment(given):
        table.asked.add(key)
        return None
    return table.number(key, "voltage", rule=rule)


def drives(specimen: S, given: Any, key: str = "voltage") -> list[tuple[S, float]]:
    """List specimens with the shares of their segments, each with the film's voltage [V].

    There is one for each voltage that is given. A share of the first limit is in percent.
    """
    found = list[tuple[S, float]]()
    for voltages in drives_by_name(given, key):
        try:
            electrode, top = specimen.electrode.driven(voltages)
        except InputError as error:
            raise InputError(error.allowed, key=key, given=error.given) from None
        found.append((replace(specimen, electrode=electrode), top))
    return found


def drives_by_name(given: Any, key: str = "voltage", shares: bool = True
                   ) -> list[dict[str, float]]:
    """List the voltages of segments by name [V], one set for each voltage that is given.

    With ``shares`` they may be shares of the first limit [%].
    """
    if isinstance(given, list | tuple):
        return [each for one in given for each in drives_by_name(one, key, shares)]
    if not by_segment(given):
        raise InputError("must name the segments in all voltages, or in none: \"A = 3 kV, "
                         "B = 0 kV\"", key=key, given=given)
    parts = voltages_by_name(given, key, shares)
    count = max(map(len, parts.values()))
    if any(len(values) not in (1, count) for values in parts.values()):
        raise InputError("must have one voltage for each segment, or equally many", key=key,
                         given=given)
    return [{name: values[min(row, len(values) - 1)] for name, values in parts.items()}
            for row in range(count)]


def proportions(given: str | Mapping[str, float | str], key: str) -> dict[str, float]:
    """Read numbers of segments by their names: ``"A = 1, B = -1"``, or a mapping.

    Examples
    --------
    >>> proportions("A = 1, B = -0.5", "sine"), proportions({"A": 1}, "sine")
    ({'A': 1.0, 'B': -0.5}, {'A': 1.0})
    """
    try:
        return {name: float(value) for name, value in _texts(given, key).items()}
    except (TypeError, ValueError):
        raise InputError('must have a number for each segment, such as "A = 1, B = -1"', key=key,
                         given=str(given)) from None


def _texts(given: str | Mapping[str, Any], key: str) -> dict[str, Any]:
    """Split what is given by names."""
    if isinstance(given, Mapping):
        return {str(name): value for name, value in given.items()}
    first, *pieces = _NAMED.split(given)
    texts = dict(zip(pieces[::2], map(str.strip, pieces[1::2]), strict=True))
    if len(texts) < len(pieces) // 2 or first.strip() or not texts:
        raise InputError("must name each segment once: \"A = 3 kV, B = 0 kV\"", key=key,
                         given=given)
    return texts


def voltages_by_name(given: Any, key: str, shares: bool = True) -> dict[str, tuple[float, ...]]:
    """Read the values of each name: voltages [V], or, with ``shares``, shares of a limit [%]."""
    if isinstance(given, list | tuple) or not by_segment(given):
        raise InputError("must have the names of segments: \"A = 3 kV, B = 0 kV\"", key=key,
                         given=str(given))
    texts = _texts(given, key)
    percent = [isinstance(value, str) and value.strip().endswith("%") for value in texts.values()]
    if any(percent):
        if not shares:
            raise InputError("must be voltages, such as \"A = 3 kV, B = 0 kV\"", key=key,
                             given=str(given))
        if not all(percent):
            raise InputError("must be voltages, or all of them shares of the first limit such as "
                             "\"A = 80 %, B = 40 %\"", key=key, given=str(given))
        return {name: (_percent(value, key),) for name, value in texts.items()}
    return {name: numbers(value, "voltage", key) for name, value in texts.items()}


def _percent(text: str, key: str) -> float:
    try:
        share = float(text.strip().removesuffix("%"))
    except ValueError:
        share = np.nan
    if not 0 <= share <= 100:
        raise InputError("must be from 0 to 100 %", key=key, given=text)
    return share
