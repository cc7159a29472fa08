"""What tests of pages share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from benchmarks.explore.browser import browsing, chromium


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless Chromium, where there is one."""
    pytest.importorskip("playwright", reason="playwright is not installed")
    executable = chromium()
    if executable is None:
        pytest.skip("Chromium is not installed")
    with browsing(executable) as chrome:
        yield chrome
