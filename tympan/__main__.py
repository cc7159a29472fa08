"""``tympan`` and ``python -m tympan``: the command as a process, from first import to exit status.

Exit status 0 done, 1 failed with a message, 2 the input is wrong, 130 interrupted (Ctrl-C), 143
terminated.
"""

from __future__ import annotations

import codecs
import gc
import io
import os
import sys
from typing import Any, NoReturn

from tympan.base.process.interruption import Interruption

#: Replacements of characters that have no name as a letter or number.
_PLAIN = str.maketrans({"µ": "u", "μ": "u", "–": "-", "—": "-", "−": "-", "⁄": "/", "·": "*",
                        "×": "x", "±": "+-", "°": "deg", "√": "sqrt ", "≤": "<=", "≥": ">=",
                        "∞": "inf", "’": "'", "‘": "'", "“": '"', "”": '"'})


class _Output(io.FileIO):
    """Standard output that ends the command where it cannot be written, as on a full disk.

    It ends without a message if nobody reads any more.
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
    r"""Replace characters that a terminal cannot show, as an error handler of codecs.

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
    signals = Interruption()
    status: Any = 1
    ended: BaseException | None = None
    try:
        _streams()
        os.environ["MPLBACKEND"] = "agg"  # nothing is drawn on a screen, whatever the user has set
        from tympan.base.process.threads import stay_single

        stay_single()
        # Objects that libraries create on import stay: searching them for garbage is useless.
        gc.set_threshold(20_000, 50)
        try:
            from tympan.cli import main

            status = main()
        finally:
            signals.over()
            if sys.stdout is not None:
                sys.stdout.flush()
    except BaseException as error:
        ended = error
    signals.leave()
    # A signal ended the command, whatever it was turned into on its way, even if nothing is left of
    # it; results may be wrong.
    if signals.number or isinstance(ended, KeyboardInterrupt):
        status = signals.say(*getattr(ended, "__notes__", ()))
    elif isinstance(ended, SystemExit):
        status = ended.code or 0
    elif isinstance(ended, MemoryError):  # while the command was loaded
        os.write(2, b"tympan: memory is short\n")
    elif ended is not None:
        sys.excepthook(type(ended), ended, ended.__traceback__)
    _leave(status)


def _leave(status: int) -> NoReturn:
    """End the process without freeing imported modules, which takes longer than to solve."""
    import atexit

    from tympan.base.system import silent

    with silent():  # the output is complete
        atexit._run_exitfuncs()
    if sys.stderr is not None:
        sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    run_command()
