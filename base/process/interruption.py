"""Signals that end a command at any moment, so that nothing wrong is written afterwards.

A signal becomes a KeyboardInterrupt. A callback of another library may swallow it, and its result
is then wrong. So the exception is raised again until the command has ended, and nothing is
written or printed once a signal has come.
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

#: Signals that end a command, and the word printed then; the exit status is 128 + number.
ENDING = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated", signal.SIGHUP: "hung up"}
#: Signals whose handlers can be set.
_ORDINARY = tuple(number for number in signal.Signals
                  if number not in (signal.SIGKILL, signal.SIGSTOP))
#: Time between two checks whether the command still goes on [s].
_RETRY = 0.01
#: Time for which an import may go on [s]. A later signal is a second request, not the same one.
_PATIENCE = 1.0


class Interruption:
    """Ends the process by a KeyboardInterrupt on a signal, as soon as Python can take one.

    During an import Python cannot: compiled modules would turn it into errors of their own, or
    crash. If that takes long, or on a second signal, the process ends at once. The exception is
    raised again where it was swallowed, but not during the cleaning up after it. ``number`` is
    that of the signal, 0 before.
    """

    number = 0
    _since = 0.0

    def __init__(self) -> None:
        for number in ENDING:
            if signal.getsignal(number) != signal.SIG_IGN:  # nohup ignores SIGHUP
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
        """Print one line on what ended the command; return its exit status."""
        number = signal.Signals(self.number or signal.SIGINT)
        print("; ".join([f"tympan: {ENDING[number]}", *notes]), file=sys.stderr)
        return 128 + number

    def over(self) -> None:
        """Stop raising the exception again."""
        signal.signal(signal.SIGALRM, signal.SIG_IGN)

    def leave(self) -> None:
        """Let a signal end the process at once, with its message, as the command is done."""
        for number in ENDING:
            if signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._leave)

    def _leave(self, number: int, frame: FrameType | None) -> None:
        if self.number == 0:
            self.number = number
            self.say()
        os._exit(128 + self.number)


def raise_again() -> None:
    """Raise a KeyboardInterrupt if a signal has come: before anything is written or printed."""
    for number in ENDING:
        owner = getattr(signal.getsignal(number), "__self__", None)
        if isinstance(owner, Interruption) and owner.number:
            raise KeyboardInterrupt


@contextmanager
def signals_wait() -> Iterator[None]:
    """Delay signals until the end of a block.

    It serves short sections that must not be left half done, and callbacks of libraries that
    swallow exceptions. Blocking signals is not enough: another thread may receive one, and the
    main one then acts on it. The handlers are the caller's; only the main thread has any.
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
    """Restore all signal handlers, in any thread, after a library has started.

    The handler of gmsh ends the process without a word on a broken pipe, SIGTERM or SIGHUP.
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
    """Set all of the handlers, whatever a signal that arrives meanwhile raises."""
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
    """Check whether an interruption is being handled or a generator closed: it must not be cut."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt | GeneratorExit):
            return True
        error = error.__context__
    return False
