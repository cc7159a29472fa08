"""``tympan`` and ``python -m tympan``: the command as a process, from first import to exit status.

Exit status 0 done, 1 failed with a message, 2 the input is wrong, 130 interrupted (Ctrl-C), 143
terminated.
"""

from __future__ import annotations

import codecs
import gc
import io
import os
import signal
import sys
import time
from types import FrameType
from typing import Any, NoReturn

from tympan.geometry.process.threads import stay_single

#: What is said when a signal ends the command; the exit status is 128 and the signal's number.
_ENDING = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated", signal.SIGHUP: "hung up"}
_RETRY = 0.01  # [s]: how soon a signal that came during an import is looked at again
_PATIENCE = 1.0  # [s]: how long for; another signal after it is a second wish, not the same twice

#: Letters that no alphabet and no number stands for, by others.
_PLAIN = str.maketrans({"µ": "u", "μ": "u", "–": "-", "—": "-", "−": "-", "⁄": "/", "·": "*",
                        "×": "x", "±": "+-", "°": "deg", "√": "sqrt ", "≤": "<=", "≥": ">=",
                        "∞": "inf", "’": "'", "‘": "'", "“": '"', "”": '"'})


class _Signals:
    """Ends the command on a signal by a KeyboardInterrupt, as soon as Python can take one.

    During an import it cannot: compiled modules would turn it into errors of their own, or crash.
    Where that takes long, or who asks a second time, the process ends at once. ``number`` is that
    of the signal, 0 before.
    """

    number = 0
    _since = 0.0

    def __init__(self) -> None:
        for number in _ENDING:
            if signal.getsignal(number) != signal.SIG_IGN:  # as of nohup
                signal.signal(number, self._ask)
        signal.signal(signal.SIGALRM, self._end)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.number == 0:
            self.number, self._since = number, time.monotonic()
            self._end(number, frame)
        elif time.monotonic() > self._since + _PATIENCE:
            os._exit(self.say())

    def _end(self, number: int, frame: FrameType | None) -> None:
        if not _imports(frame):
            raise KeyboardInterrupt
        if time.monotonic() > self._since + _PATIENCE:
            os._exit(self.say())
        signal.setitimer(signal.ITIMER_REAL, _RETRY)

    def say(self, *notes: str) -> int:
        """One line on what ended the command; answers its exit status."""
        number = signal.Signals(self.number or signal.SIGINT)
        print("; ".join([f"tympan: {_ENDING[number]}", *notes]), file=sys.stderr)
        return 128 + number


def _imports(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


class _Output(io.FileIO):
    """Standard output that ends the command where it cannot be written, as on a full disk.

    Without a word if nobody reads any more.
    """

    _broken = False

    def write(self, content: Any) -> int:
        if self._broken:
            return len(content)
        try:
            return super().write(content)
        except BrokenPipeError:
            self._broken = True
        except OSError as error:
            self._broken = True
            print(f"tympan: standard output cannot be written: {error.strerror}", file=sys.stderr)
        raise SystemExit(1)


def spelled(error: UnicodeError) -> tuple[str, int]:
    r"""Letters that a terminal cannot show in those it can, as an error handler of codecs.

    Examples
    --------
    >>> codecs.register_error("spelled", spelled)
    >>> "α₁ of 3 µm², ½ – größer".encode("ascii", "spelled")
    b'alpha1 of 3 um2, 1/2 - gr\\xf6\\xdfer'
    """
    import unicodedata

    assert isinstance(error, UnicodeEncodeError)
    text = ""
    for letter in error.object[error.start:error.end]:
        plain = unicodedata.normalize("NFKD", letter).translate(_PLAIN)
        match unicodedata.name(letter, "").split():
            case ["GREEK", size, "LETTER", name]:
                plain = name.lower() if size == "SMALL" else name.title()
        text += plain if plain.isascii() else ascii(letter)[1:-1]
    return text, error.end


def _streams() -> None:
    codecs.register_error("spelled", spelled)
    if isinstance(sys.stderr, io.TextIOWrapper):
        sys.stderr.reconfigure(errors="spelled")
    if isinstance(sys.stdout, io.TextIOWrapper):
        raw = io.BufferedWriter(_Output(sys.stdout.fileno(), "w", closefd=False))
        sys.stdout = io.TextIOWrapper(raw, sys.stdout.encoding, "spelled",
                                      line_buffering=sys.stdout.line_buffering)


def run_command() -> NoReturn:
    """Run a command and end the process, whatever happens on the way."""
    signals = _Signals()
    status: Any = 1
    try:
        _streams()
        os.environ["MPLBACKEND"] = "agg"  # whatever the user has: nothing is drawn on a screen
        stay_single()
        # What libraries make while they are imported stays: to look for garbage among it is vain.
        gc.set_threshold(20_000, 50)
        try:
            from tympan.cli import main

            status = main()
        finally:
            # An import may have failed by itself, and nobody looks at its signal again.
            signal.signal(signal.SIGALRM, signal.SIG_IGN)
            if sys.stdout is not None:
                sys.stdout.flush()
    except SystemExit as stop:
        status = stop.code or 0
    except BaseException as error:
        # Whatever a signal is turned into on its way, it is what ended the command.
        if signals.number or isinstance(error, KeyboardInterrupt):
            status = signals.say(*getattr(error, "__notes__", ()))
        elif isinstance(error, MemoryError):  # while the command was loaded
            os.write(2, b"tympan: memory is short\n")
        else:
            sys.excepthook(type(error), error, error.__traceback__)
    for number in _ENDING:
        signal.signal(number, signal.SIG_DFL)
    _leave(status)


def _leave(status: int) -> NoReturn:
    """End the process without taking apart what was imported, which takes longer than to solve."""
    import atexit

    atexit._run_exitfuncs()
    if sys.stderr is not None:
        sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    run_command()
