"""A function of many items in parallel processes on this machine; dead processes are replaced."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import TypeVar

from tympan.base.errors import Failure, InputError
from tympan.base.process.workers import Pool, WorkerDied

Item = TypeVar("Item")
Value = TypeVar("Value")

#: Number of deaths of an item's process after which the item is tried alone, a last time.
_DEATHS = 2

#: Number of items sent to each process: one to compute, and one to continue with while the consumer
#: processes a value.
_AHEAD = 2


@dataclass(frozen=True)
class NoValue:
    """Reason why an item has no value; ``error`` is the exception, None if its process died."""

    reason: str
    error: Exception | None = None


def serial(function: Callable[[Item], Value], items: Mapping[str, Item]
           ) -> Generator[tuple[str, Value | NoValue], None, None]:
    """Yield values by key, computed one after the other in this process; errors are raised."""
    for key, item in items.items():
        yield key, function(item)


def processes(function: Callable[[Item], Value], items: Mapping[str, Item], workers: int
              ) -> Generator[tuple[str, Value | NoValue], None, None]:
    """Yield values by key as they arrive from parallel processes.

    A process that dies is restarted, and its item is tried again. An item whose process died
    several times is then tried alone, since other items may have used the memory. ``close()`` kills
    the processes. A caller that may stop early or raise uses ``with
    contextlib.closing(processes(...)) as values``.
    """
    waiting, deaths = deque(items), Counter[str]()
    while waiting:
        yield from _together(function, items, waiting, deaths, workers)
        while waiting and deaths[waiting[0]] >= _DEATHS:
            key = waiting.popleft()
            yield key, _alone(function, items[key])


def mapped(function: Callable[[Item], Value], items: Sequence[Item], workers: int
           ) -> Generator[Value, None, None]:
    """Yield values in the items' order; one worker means this process.

    Errors are raised; a process that dies raises a RuntimeError. ``close()`` kills the processes,
    as for :func:`processes`.
    """
    if workers < 2:
        yield from map(function, items)
        return
    keyed = {str(number): item for number, item in enumerate(items)}
    ready = dict[str, Value | NoValue]()
    with closing(processes(function, keyed, workers)) as answers:
        for key in keyed:
            while key not in ready:
                number, answer = next(answers)
                ready[number] = answer
            value = ready.pop(key)
            if isinstance(value, NoValue):
                raise value.error or RuntimeError(value.reason)
            yield value


def value_or_reason(result: Callable[[], Value]) -> Value | NoValue:
    """Get the value of an item, or its failure; errors that concern every item are raised."""
    try:
        return result()
    except (InputError, Failure, OSError):
        raise
    except Exception as error:  # an error of one item must not end the others
        return NoValue(f"{type(error).__name__}: {error}", error)


def _together(function: Callable[[Item], Value], items: Mapping[str, Item], waiting: deque[str],
              deaths: Counter[str], workers: int
              ) -> Generator[tuple[str, Value | NoValue], None, None]:
    """Compute waiting items in parallel, up to an item that must be tried alone."""
    running = 0
    with Pool(function, workers) as pool:
        while True:
            while waiting and running < _AHEAD * workers and deaths[waiting[0]] < _DEATHS:
                key = waiting.popleft()
                pool.put(key, items[key])
                running += 1
            if running == 0:
                return
            key, answer = pool.get()
            running -= 1
            if isinstance(answer.error, WorkerDied):
                deaths[key] += 1
                waiting.appendleft(key)
            else:
                yield key, value_or_reason(answer.result)


def _alone(function: Callable[[Item], Value], item: Item) -> Value | NoValue:
    with Pool(function, 1) as pool:
        pool.put("", item)
        _, answer = pool.get()
    if isinstance(answer.error, WorkerDied):
        return NoValue(f"the process that solved it died, {_DEATHS + 1} times, at last alone: "
                       "is there enough memory?")
    return value_or_reason(answer.result)
