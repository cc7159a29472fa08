"""Progress bar and messages on standard error."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from tympan.base.progress import PartsDone

_EVERY = 30.0  #: seconds between lines in a log
#: Time between two counts of seconds, and before the first one [s].
_SECOND = 1.0
#: What moves a terminal to the start of its line and erases it.
_ERASED = "\r\x1b[K"
#: Digits of the share of a step that is shown.
_DIGITS = 2
_FORMAT = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}<{remaining}]"


def _bar(total: int, **settings: Any) -> Any:
    """Open a bar where standard error is a terminal, otherwise none: logs stay readable."""
    from tqdm import tqdm

    return tqdm(total=total, file=sys.stderr, disable=not sys.stderr.isatty(), leave=False,
                **settings)


@contextmanager
def bar(total: int) -> Iterator[Callable[..., None]]:
    """Yield a function to call at the start of each of ``total`` steps, with words for the step.

    ``share``: finished part of a long step, as it goes on.
    """
    with _bar(total, bar_format=f"{_FORMAT} {{postfix}}", miniters=0) as progress:
        begun = 0

        def step(words: str = "", share: float | None = None) -> None:
            nonlocal begun
            if share is None:
                begun += 1
                progress.n = begun - 1
                progress.set_postfix_str(words)
            else:
                progress.n = begun - 1 + round(share, _DIGITS)
                progress.update(0)

        yield step
        progress.update(begun - progress.n)


@contextmanager
def waiting(words: str) -> Iterator[None]:
    """Show words and the seconds passed, from the second second on, for work without steps.

    They are on a terminal only, and erased at the end.
    """
    if not sys.stderr.isatty():
        yield
        return
    over = threading.Event()
    clock = threading.Thread(target=_count, args=(words, over), daemon=True)
    clock.start()
    try:
        yield
    finally:
        over.set()
        clock.join()


def _count(words: str, over: threading.Event) -> None:
    """Show the seconds until ``over`` is set."""
    began, shown = time.monotonic(), False
    while not over.wait(_SECOND):
        shown = True
        sys.stderr.write(f"\r{words} [{time.monotonic() - began:.0f} s]")
        sys.stderr.flush()
    if shown:
        sys.stderr.write(_ERASED)
        sys.stderr.flush()


@contextmanager
def shares(words: str) -> Iterator[PartsDone]:
    """Yield a function to call with the parts done and their number, which may grow."""
    with _bar(1, desc=words, bar_format=_FORMAT) as progress:

        def done(parts: int, of: int) -> None:
            progress.total = of
            progress.n = parts
            progress.refresh()

        yield done


@contextmanager
def cases(total: int) -> Iterator[PartsDone]:
    """Yield a function to call with the cases ready now and those ready from the start.

    It shows the rate and the time left; where standard error is no terminal, in a line every half
    minute.
    """
    if not sys.stderr.isatty():
        yield _lines(total)
        return
    with _bar(total, unit=" cases", smoothing=0.05, mininterval=0.1, maxinterval=1.0) as progress:

        def ready(done: int, kept: int) -> None:
            if kept > progress.initial:
                progress.initial = progress.n = progress.last_print_n = kept
            progress.update(done - progress.n)

        yield ready


def say(words: str) -> None:
    """Write a line on standard error, above the bar where there is one."""
    from tqdm import tqdm

    tqdm.write(f"tympan: {words}", file=sys.stderr)


def _lines(total: int) -> PartsDone:
    from tqdm import tqdm

    began = shown = time.monotonic()

    def ready(done: int, kept: int) -> None:
        nonlocal shown
        now = time.monotonic()
        if now - shown >= _EVERY and kept < done:
            shown, rate = now, (done - kept) / (now - began)
            remaining = tqdm.format_interval((total - done) / rate)
            print(f"{done} of {total} cases, {rate:.3g} a second, {remaining} left",
                  file=sys.stderr, flush=True)

    return ready
