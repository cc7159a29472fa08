"""Two results of one kind side by side: which values differ, and by how much."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from tympan.base.errors import InputError

#: Values of a run, which differ between equal results.
OF_THE_RUN = frozenset({"wall_s", "made_s", "seconds", "finished", "version", "libraries",
                        "python"})
#: Relative difference below which numbers are equal: files have some ten digits.
_SAME = 1e-9


@dataclass(frozen=True)
class Difference:
    """A value that two results do not share; None where one of them has none.

    ``name``: path of its key in the result's JSON, such as ``limits.limit.voltage_V``.
    """

    name: str
    first: Any
    second: Any

    @property
    def numbers(self) -> bool:
        """Whether both are numbers."""
        return all(isinstance(value, int | float) and not isinstance(value, bool)
                   for value in (self.first, self.second))

    @property
    def difference(self) -> float | None:
        """Second minus first, of numbers."""
        return self.second - self.first if self.numbers else None

    @property
    def relative(self) -> float | None:
        """Difference over the first, of numbers."""
        return self.difference / abs(self.first) if self.difference and self.first else None

    def record(self) -> dict[str, Any]:
        """Write it as a JSON object."""
        return {"name": self.name, "first": self.first, "second": self.second,
                "difference": self.difference, "relative": self.relative}


def differences(first: Any, second: Any) -> list[Difference]:
    """List the values that differ between two results, in the order of their JSON.

    Of lists of numbers the element with the largest difference is listed. What belongs to the run,
    such as its seconds, is left out.

    Raises
    ------
    InputError
        When they are results of different kinds.
    """
    if type(first) is not type(second):
        raise InputError(f"must be of the same kind as the first, {type(first).__name__}",
                         key="second", given=type(second).__name__)
    values = [dict(_leaves("", result.json())) for result in (first, second)]
    pairs = [Difference(name, *(of.get(name) for of in values))
             for name in dict.fromkeys((*values[0], *values[1]))]
    return list(_largest(pair for pair in pairs if _differs(pair)))


def _leaves(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, part in items:
            if key not in OF_THE_RUN:
                yield from _leaves(f"{path}.{key}" if path else str(key), part)
    else:
        yield path, value


def _differs(pair: Difference) -> bool:
    if not pair.numbers:
        return bool(pair.first != pair.second)
    step, size = abs(pair.second - pair.first), max(abs(pair.first), abs(pair.second))
    return bool(step > _SAME * size)


def _largest(pairs: Iterator[Difference]) -> Iterator[Difference]:
    """Keep one of the numbers of a list: the one with the largest difference."""
    lists: dict[str, list[Difference]] = {}
    for pair in pairs:
        above, _, last = pair.name.rpartition(".")
        of = above if last.isdecimal() and pair.numbers else pair.name
        lists.setdefault(of, []).append(pair)
    for several in lists.values():
        yield max(several, key=lambda pair: abs(pair.difference or 0.0))
