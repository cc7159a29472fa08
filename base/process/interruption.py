"""Signals that end a command: at any moment, and so that nothing wrong is written afterwards.

A signal becomes a KeyboardInterrupt, which a callback of another library may swallow: what was
being computed is then wrong. So it is raised again until the command has ended, and nothing is
written or printed once it has come.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

#: Signals that end a command, and what is said then; the exit status is 128 and the number.
ENDING = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated", signal.SIGHUP: "hung up"}
#: Signals whose handlers can be set.
_ORDINARY = tuple(number for number in signal.Signals
                  if number not in (signal.SIGKILL, signal.SIGSTOP))
#: How soon it is looked whether the command still goes on [s].
_RETRY = 0.01
#: How long an import may go on [s]. Another signal after it is a second wish, not the same twice.
_PATIENCE = 1.0


class Interruption:
    """Ends the process on a signal by a KeyboardInterrupt, as soon as Python can take one.

    During an import it cannot: compiled modules would turn it into errors of their own, or crash.
    Where that takes long, or who asks a second time, the process ends at once. It is raised again
    where it was swallowed, but not while what it ends is cleaned up. ``number`` is that of the
    signal, 0 before.
    """

    number = 0
    _since = 0.0

    def __init__(self) -> None:
        for number in ENDING:
            if signal.getsignal(number) != signal.SIG_IGN:  # as of nohup
                signal.signal(number, self._ask)
        signal.signal(signal.SIGALRM, self._end)
        sys.unraisablehook = self._swallowed

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.number == 0:
            self.number, self._since = number, time.monotonic()
            self._end(number, frame)
        elif time.monotonic() > self._since + _PATIENCE:
            os._exit(self.say())

    def _end(self, number: int, frame: FrameType | None) -> None:
        signal.setitimer(signal.ITIMER_REAL, _RETRY)
        if _imports(frame):
            if time.monotonic() > self._since + _PATIENCE:
                os._exit(self.say())
        elif not _unwinds(sys.exc_info()[1]):
            raise KeyboardInterrupt

    def _swallowed(self, unraisable: Any) -> None:
        if not (self.number and isinstance(unraisable.exc_value, KeyboardInterrupt)):
            sys.__unraisablehook__(unraisable)

    def say(self, *notes: str) -> int:
        """One line on what ended the command; answers its exit status."""
        number = signal.Signals(self.number or signal.SIGINT)
        print("; ".join([f"tympan: {ENDING[number]}", *notes]), file=sys.stderr)
        return 128 + number

    def over(self) -> None:
        """Nothing is raised again any more."""
        signal.signal(signal.SIGALRM, signal.SIG_IGN)

    def leave(self) -> None:
        """The command is done: a signal ends what is left of the process at once, and says so."""
        for number in ENDING:
            if signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._leave)

    def _leave(self, number: int, frame: FrameType | None) -> None:
        if self.number == 0:
            self.number = number
            self.say()
        os._exit(128 + self.number)


def raise_again() -> None:
    """Raise a KeyboardInterrupt where a signal has come: before anything is written or printed."""
    for number in ENDING:
        owner = getattr(signal.getsignal(number), "__self__", None)
        if isinstance(owner, Interruption) and owner.number:
            raise KeyboardInterrupt


@contextmanager
def signals_wait() -> Iterator[None]:
    """Delay signals: what they do to this process, they do afterwards.

    For short sections that must not be left half done, and for callbacks of libraries that swallow
    what is raised in them. To block signals is not enough: another thread may take one, and the
    main one then acts on it. Handlers are the caller's, whoever that is; only the main thread has
    any.
    """
    import threading

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    handlers = [(number, handler) for number in (*ENDING, signal.SIGALRM)
                if callable(handler := signal.getsignal(number))]
    try:
        _handle([(number, lambda number, frame: came.append(number)) for number, _ in handlers])
        yield
    finally:
        _handle(handlers)
        for number in dict.fromkeys(came):
            signal.raise_signal(number)


@contextmanager
def handlers_kept() -> Iterator[None]:
    """A library's start changes no handler of a signal, in any thread.

    That of gmsh makes a broken pipe, SIGTERM and SIGHUP end the process at once, without a word.
    """
    import ctypes

    ask, give = ctypes.pythonapi.PyOS_getsig, ctypes.pythonapi.PyOS_setsig
    give.argtypes = (ctypes.c_int, ctypes.c_void_p)
    ask.restype = give.restype = ctypes.c_void_p
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    handlers = {number: ask(number) for number in _ORDINARY}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            if ask(number) != handler:
                give(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _handle(handlers: Sequence[tuple[int, Any]]) -> None:
    """Set handlers: all of them, whatever a signal that comes meanwhile raises."""
    if handlers:
        try:
            signal.signal(*handlers[0])
        finally:
            _handle(handlers[1:])


def _imports(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _unwinds(error: BaseException | None) -> bool:
    """Whether an interruption is being handled, or a generator closed: its end must not be cut."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt | GeneratorExit):
            return True
        error = error.__context__
    return False
