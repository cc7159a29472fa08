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
