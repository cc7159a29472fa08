"""The explorer as a process, and Chromium to look at it with."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Draws WebGL without a graphics card.
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NAMES = ("chromium", "chromium-browser", "google-chrome")


def chromium() -> str | None:
    """Where Chromium is, if anywhere."""
    return next(filter(None, map(shutil.which, NAMES)), None)


@dataclass(frozen=True)
class Running:
    """``tympan explore`` with the address it printed."""

    process: subprocess.Popen[str]
    address: str

    @property
    def root(self) -> str:
        """The address without its token."""
        return self.address.partition("?")[0]


@contextmanager
def exploring(folder: Path, *arguments: str) -> Iterator[Running]:
    """``tympan explore`` in a folder, ended afterwards."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tympan", "explore", *arguments, "--no-browser"],
        cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])})
    try:
        assert process.stderr is not None
        line = process.stderr.readline()
        address = re.search(r"http://\S+token=[\w-]+(?=\n$)", line)  # nothing behind it
        assert address, line + process.stderr.read()
        yield Running(process, address.group())
    finally:
        process.kill()
        process.communicate()


@contextmanager
def browsing(executable: str) -> Iterator[Any]:
    """A headless Chromium."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=list(FLAGS))
        try:
            yield browser
        finally:
            browser.close()


def pixels(page: Any, selector: str = "canvas") -> NDArray[np.uint8]:
    """A part of a page as it is seen, shape (rows, columns, 3)."""
    import io

    from matplotlib.image import imread

    picture = imread(io.BytesIO(page.locator(selector).screenshot()), format="png")
    return np.asarray(np.round(255 * picture[..., :3]), np.uint8)
