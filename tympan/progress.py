"""A progress bar on standard error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def bar(total: int) -> Iterator[Callable[[str], None]]:
    """Yields a function to call at the start of each of ``total`` steps with what is being done.

    Where standard error is no terminal there is no bar: logs stay readable.
    """
    from tqdm import tqdm

    with tqdm(total=total, file=sys.stderr, disable=not sys.stderr.isatty(), leave=False,
              bar_format="{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}<{remaining}] {postfix}") as progress:
        started = False

        def step(words: str) -> None:
            nonlocal started
            if started:
                progress.update()
            started = True
            progress.set_postfix_str(words)

        yield step
        progress.update()


@contextmanager
def shares(words: str) -> Iterator[Callable[[int, int], None]]:
    """Yields a function to call with the parts done and their number, which may grow."""
    from tqdm import tqdm

    with tqdm(total=1, file=sys.stderr, disable=not sys.stderr.isatty(), leave=False, desc=words,
              bar_format="{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}<{remaining}]") as progress:

        def done(parts: int, of: int) -> None:
            progress.total = of
            progress.n = parts
            progress.refresh()

        yield done


@contextmanager
def cases(total: int) -> Iterator[Callable[[int, int], None]]:
    """Yields a function to call with the cases that are ready and those that were so from the start.

    Shows the rate and the time left; where standard error is no terminal, as a line every half minute.
    """
    from tqdm import tqdm

    terminal = sys.stderr.isatty()
    with tqdm(total=total, file=sys.stderr, leave=False, desc="cases", unit="case", smoothing=0.05, delay=0.0,
              mininterval=0.1 if terminal else 30.0, maxinterval=30.0, ncols=None if terminal else 79,
              bar_format=None if terminal else "{desc} {n_fmt}/{total_fmt}, {rate_fmt}, {remaining} left\n"
              ) as progress:

        def ready(done: int, kept: int) -> None:
            if kept > progress.initial:
                progress.initial = progress.n = progress.last_print_n = kept
            progress.update(done - progress.n)

        yield ready
