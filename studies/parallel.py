"""A function of many things on the processors of this machine: a process each, replaced at need."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import wait as wait_for
from typing import TypeVar

from tympan.geometry.errors import Failure, InputError
from tympan.geometry.process.interruption import ENDING, signals_wait
from tympan.geometry.process.threads import stay_single

Item = TypeVar("Item")
Value = TypeVar("Value")

#: How often processes may die with an item among theirs before it is tried alone, a last time.
_DEATHS = 2


@dataclass(frozen=True)
class NoValue:
    """Why an item has no value: ``error`` is what was raised, None where its process died."""

    reason: str
    error: Exception | None = None


def serial(function: Callable[[Item], Value], items: Mapping[str, Item]
           ) -> Iterator[tuple[str, Value | NoValue]]:
    """Values by key, one after the other in this process; errors are raised."""
    for key, item in items.items():
        yield key, function(item)


def processes(function: Callable[[Item], Value], items: Mapping[str, Item], workers: int
              ) -> Iterator[tuple[str, Value | NoValue]]:
    """Values by key as they come, side by side in processes; what dies is started again.

    A process that dies takes the whole pool with it, and any of the items in it may be the cause:
    those are tried again, and one that was there several times is then tried alone.
    """
    waiting, deaths = deque(items), Counter[str]()
    while waiting:
        yield from _until_broken(function, items, waiting, deaths, workers)
        while waiting and deaths[waiting[0]] >= _DEATHS:
            key = waiting.popleft()
            yield key, _alone(function, items[key])


def mapped(function: Callable[[Item], Value], items: Sequence[Item], workers: int
           ) -> Iterator[Value]:
    """Values in the items' order; with one worker in this process.

    Errors are raised, a RuntimeError where the process died over an item.
    """
    if workers < 2:
        yield from map(function, items)
        return
    keyed = {str(number): item for number, item in enumerate(items)}
    answers, ready = processes(function, keyed, workers), dict[str, Value | NoValue]()
    for key in keyed:
        while key not in ready:
            number, answer = next(answers)
            ready[number] = answer
        value = ready.pop(key)
        if isinstance(value, NoValue):
            raise value.error or RuntimeError(value.reason)
        yield value


def value_or_reason(future: Future[Value]) -> Value | NoValue:
    """The value of a future, or its failure; errors that would meet every item are raised."""
    try:
        return future.result()
    except (InputError, Failure, BrokenProcessPool, OSError):
        raise
    except Exception as error:  # whatever a library raises on one item must not end the others
        return NoValue(f"{type(error).__name__}: {error}", error)


def _until_broken(function: Callable[[Item], Value], items: Mapping[str, Item],
                  waiting: deque[str], deaths: Counter[str], workers: int
                  ) -> Iterator[tuple[str, Value | NoValue]]:
    """Run what is waiting; when the pool breaks, those in it wait again, with one death more."""
    running: dict[Future[Value], str] = {}
    with _pool(workers) as pool:
        try:
            while waiting or running:
                while waiting and len(running) < 2 * workers:
                    running[_submitted(pool, function, items[waiting[0]])] = waiting[0]
                    waiting.popleft()
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    value = value_or_reason(future)
                    yield running.pop(future), value
        except BrokenProcessPool:
            deaths.update(running.values())
            waiting.extendleft(running.values())


def _alone(function: Callable[[Item], Value], item: Item) -> Value | NoValue:
    with _pool(1) as pool:
        try:
            return value_or_reason(_submitted(pool, function, item))
        except BrokenProcessPool:
            return NoValue(f"the process that solved it died, {_DEATHS + 1} times, at last alone: "
                           "is there enough memory?")


def _submitted(pool: ProcessPoolExecutor, function: Callable[[Item], Value], item: Item
               ) -> Future[Value]:
    """An item in a pool; processes started for it leave it to the parent to be ended."""
    with signals_blocked():
        return pool.submit(function, item)


@contextmanager
def signals_blocked() -> Iterator[None]:
    """Processes started meanwhile leave it to the parent to end them."""
    resource_tracker.ensure_running()  # its start would lift the block
    with signals_wait():
        before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """A pool whose processes end with it, whatever ends it."""
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"),
                               initializer=begin_worker)
    try:
        yield pool
    finally:
        for child in list((pool._processes or {}).values()):
            child.kill()  # nothing is lost: results are kept as they come
        pool.shutdown(wait=True, cancel_futures=True)


def begin_worker() -> None:
    """Begin a new process that computes: one thread, and an end with the parent's."""
    stay_single()

    def follow(sentinel: int) -> None:
        wait_for([sentinel])
        os._exit(1)

    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=follow, args=(parent.sentinel,), daemon=True).start()
