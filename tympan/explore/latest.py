"""A process that answers the newest question and drops older ones."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from typing import Any, TypeAlias

from tympan.base.errors import InputError
from tympan.base.process.workers import begin_worker, signals_blocked, start_worker

#: Computes an answer, in several parts if some come sooner; a :class:`Pause` between them.
Answer: TypeAlias = Callable[[Any], Iterator[Any]]

#: Modules that processes have when they start: importing them takes longer than starting one.
_PRELOADED = ["cadquery", "gmsh", "tympan.explore.session"]


@dataclass(frozen=True)
class Trouble:
    """Reason why a question has no answer."""

    words: str


@dataclass(frozen=True)
class Pause:
    """Place in an answer where a newer question within a time [s] ends it."""

    seconds: float = 0.0


def prepared() -> ForkServerContext:
    """Make the context that starts processes; the first call starts the one they fork from."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    with signals_blocked():
        forkserver.ensure_running()
    return context


class Latest:
    """Answers of a process, each to the newest question when the last one was done.

    ``make`` is called once in the process and makes the function that answers there. ``deliver``
    gets each part of an answer in this thread's event loop, and whether its question is the newest.
    An older question is dropped after ``patience`` [s], and its process with it; never if that is
    None.
    """

    def __init__(self, make: Callable[[], Answer], deliver: Callable[[Any, bool], None],
                 patience: float | None) -> None:
        self._make, self._deliver, self._patience = make, deliver, patience
        self._loop = asyncio.get_running_loop()
        self._number = 0
        self._waiting: tuple[int, Any] | None = None
        self._running: int | None = None
        #: True if the running answer has come to a pause: the next question is sent at once.
        self._paused = False
        self._process: BaseProcess | None = None
        #: True while the process is stopped, so that another is faster.
        self._waits = False
        self._pipe: Connection | None = None

    @property
    def busy(self) -> bool:
        """Whether an answer is expected."""
        return self._running is not None

    def ask(self, question: Any) -> None:
        """Ask the newest question."""
        self._number += 1
        self._waiting = self._number, question
        if self._running is None or self._paused:
            self._send()
        elif self._patience is not None:
            self._loop.call_later(self._patience, self._give_up, self._running)

    def drop(self) -> None:
        """Drop every question."""
        self._waiting = None
        self._number += 1
        self._give_up(self._running)

    def wait(self, waits: bool) -> None:
        """Stop the process while it ``waits``; a system without that signal lets it run."""
        stop, go = (getattr(signal, name, None) for name in ("SIGSTOP", "SIGCONT"))
        pid = None if self._process is None else self._process.pid
        if waits == self._waits or pid is None or stop is None or go is None:
            return
        self._waits = waits
        with suppress(ProcessLookupError):
            os.kill(pid, stop if waits else go)

    def close(self) -> None:
        """End the process."""
        self._waits = False
        self._waiting = self._running = None
        self._paused = False
        if self._pipe is not None:
            self._loop.remove_reader(self._pipe.fileno())
            self._pipe.close()
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process.close()
        self._pipe = self._process = None

    def _send(self) -> None:
        if self._waiting is None:
            return
        if self._pipe is None:
            self._start()
        assert self._pipe is not None
        self._running, self._paused = self._waiting[0], False
        self._pipe.send(self._waiting)
        self._waiting = None

    def _start(self) -> None:
        context = prepared()
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_work, args=(self._make, other), daemon=True)
        start_worker(self._process)
        other.close()
        self._loop.add_reader(self._pipe.fileno(), self._received)

    def _give_up(self, number: int | None) -> None:
        if number is not None and number == self._running and number != self._number:
            self._restart()

    def _restart(self) -> None:
        waiting = self._waiting
        self.close()
        self._waiting = waiting
        self._send()

    def _received(self) -> None:
        assert self._pipe is not None
        number = self._running or 0
        try:
            number, part, done = self._pipe.recv()
        except (EOFError, OSError):
            self._restart()
            self._deliver(Trouble("the process that solves ended: is there enough memory?"),
                          number == self._number)
            return
        if done:
            # An answer that paused may have been dropped for the question that runs now.
            if number == self._running:
                self._running = None
                self._send()
        elif isinstance(part, Pause):
            if number == self._running:
                self._paused = True
                self._send()
        else:
            self._deliver(part, number == self._number)


def _work(make: Callable[[], Answer], pipe: Connection) -> None:
    """Answer questions in the process; it ends with its parent, which alone handles signals."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    begin_worker()
    answer = make()
    while True:
        try:
            number, question = pipe.recv()
        except EOFError:
            return
        for part in _parts(answer, question):
            pipe.send((number, part, False))
            if isinstance(part, Pause) and pipe.poll(part.seconds):
                break
        pipe.send((number, None, True))


def _parts(answer: Answer, question: Any) -> Iterator[Any]:
    try:
        yield from answer(question)
    except InputError as error:
        yield Trouble(str(InputError(error.allowed, key=error.key, given=error.given)))
    except Exception as error:  # the page must go on after any error of a solver
        yield Trouble(f"{type(error).__name__}: {error}")
