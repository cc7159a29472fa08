"""Tasks on the processors of this machine: one process each, replaced when it dies."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import wait as wait_for
from typing import TypeVar

from tympan.geometry.errors import InputError
from tympan.geometry.system import MissingLibrary
from tympan.studies.sweep.task import Result, Task

#: What a task came to: its result, or why there is none.
Found = tuple[Task, Result | str]

#: Small dense matrices gain nothing from threads, which would take the processors from each other.
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

#: How often processes may die with a task among theirs before it is tried alone, for the last time.
_DEATHS = 2

T = TypeVar("T")


def here(tasks: Sequence[Task]) -> Iterator[Found]:
    """One after the other in this process."""
    for task in tasks:
        yield task, task.run()


def processes(tasks: Sequence[Task], workers: int) -> Iterator[Found]:
    """Side by side in processes; what dies is started again, and a task over which they keep dying is given up.

    A process that dies takes the whole pool with it, and any of the tasks in it may be the cause:
    those are tried again, and one that was there several times is then tried alone.
    """
    waiting, deaths = deque(tasks), Counter[str]()
    with _single_threaded():
        while waiting:
            yield from _until_broken(waiting, deaths, workers)
            while waiting and deaths[waiting[0].id] >= _DEATHS:
                task = waiting.popleft()
                yield task, _alone(task)


def outcome(future: Future[T]) -> T | str:
    """The result of a future, or its error in words; errors that would meet every task are raised.

    Raises
    ------
    BrokenProcessPool
        When the process died.
    """
    try:
        return future.result()
    except (InputError, MissingLibrary, BrokenProcessPool, OSError):
        raise
    except Exception as error:  # whatever a library raises on one specimen must not end the others
        return f"{type(error).__name__}: {error}"


def _until_broken(waiting: deque[Task], deaths: Counter[str], workers: int) -> Iterator[Found]:
    """Run what is waiting; when the pool breaks, those in it wait again, first of all, each with one death more."""
    running: dict[Future[Result], Task] = {}
    with _pool(workers) as pool:
        try:
            while waiting or running:
                while waiting and len(running) < 2 * workers:
                    running[_submitted(pool, waiting[0])] = waiting[0]
                    waiting.popleft()
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    found = outcome(future)
                    yield running.pop(future), found
        except BrokenProcessPool:
            deaths.update(task.id for task in running.values())
            waiting.extendleft(running.values())


def _alone(task: Task) -> Result | str:
    with _pool(1) as pool:
        try:
            return outcome(_submitted(pool, task))
        except BrokenProcessPool:
            return f"the process that solved it died, {_DEATHS + 1} times, at last alone: is there enough memory?"


def _submitted(pool: ProcessPoolExecutor, task: Task) -> Future[Result]:
    """A task in a pool; processes that are started for it leave interruption to the parent, from their first moment."""
    resource_tracker.ensure_running()  # its start would lift the block
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return pool.submit(task.run)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """A pool whose processes end with it, whatever ends it."""
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"),
                               initializer=_begin)
    try:
        yield pool
    finally:
        children = list((pool._processes or {}).values())
        for child in children:
            child.kill()  # nothing is lost: results are kept as they come
        pool.shutdown(wait=True, cancel_futures=True)


def _begin() -> None:
    """In a new process: do not outlive the parent."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _follow(sentinel: int) -> None:
    wait_for([sentinel])
    os._exit(1)


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Processes started meanwhile compute with one thread each, unless the user has said otherwise."""
    unset = [name for name in _THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(unset, "1"))
    try:
        yield
    finally:
        for name in unset:
            del os.environ[name]
