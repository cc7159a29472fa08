"""How soon the explorer's picture follows a slider, in headless Chromium.

    python -m benchmarks.explore [--moves 40] [--moves-in-all 1000]

Times run from the event in the page to the first frame whose canvas looks different, on a page of
1440 by 900 pixels; the canvas is looked at in every frame, which itself takes some time that is
measured too. Then sliders are moved at random, with the memory of the explorer's processes at the
beginning and at the end.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tests.support.browser import Running, browsing, chromium, exploring
from tests.support.specimens import specimen_toml

#: Moves a slider by a step, as its user would, and answers when the canvas has changed [ms]. The
#: canvas must rest before.
_MOVE = """
([id, value]) => new Promise(done => {
  const canvas = document.querySelector('.canvas canvas'), slider = document.getElementById(id);
  const small = new OffscreenCanvas(240, 150);
  const context = small.getContext('2d', {willReadFrequently: true});
  const look = () => {
    context.drawImage(canvas, 0, 0, 240, 150);
    const data = context.getImageData(0, 0, 240, 150).data;
    let sum = 0;
    for (let i = 0; i < data.length; i += 4)
      sum = (sum * 31 + data[i] + 7 * data[i + 1] + 13 * data[i + 2]) | 0;
    return sum;
  };
  const before = look(), began = performance.now();
  slider.value = value;
  slider.dispatchEvent(new Event('input', {bubbles: true}));
  const step = () => {
    if (look() !== before) return done(performance.now() - began);
    if (performance.now() - began > 10000) return done(NaN);
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
})"""

#: How long it takes to look at a canvas that does not change [ms].
_LOOK = """
() => new Promise(done => {
  const canvas = document.querySelector('.canvas canvas'), small = new OffscreenCanvas(240, 150);
  const context = small.getContext('2d', {willReadFrequently: true}), began = performance.now();
  let count = 0;
  const step = () => {
    context.drawImage(canvas, 0, 0, 240, 150);
    context.getImageData(0, 0, 240, 150);
    if (++count === 60) return done((performance.now() - began) / 60);
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
})"""

#: Sliders that are measured, between values.
SLIDERS = {"voltage": (1.0, 6.0), "mass": (10.0, 25.0), "stiffness": (0.8, 1.5),
           "frame.semi_axes.0": (55.0, 66.0), "plate.offset.0": (-4.0, 4.0)}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moves", type=int, default=40, help="of every slider")
    parser.add_argument("--moves-in-all", type=int, default=1000, help="at random")
    options = parser.parse_args()
    executable = chromium()
    if executable is None:
        sys.exit("Chromium is not installed")
    with TemporaryDirectory() as folder, browsing(executable) as browser:
        Path(folder, "oval.toml").write_text(specimen_toml(), encoding="utf-8")
        with exploring(Path(folder), "oval.toml", "--mass", "17.9 g",
                       "--voltage", "2 kV") as running:
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            began = time.perf_counter()
            page.goto(running.address)
            page.wait_for_selector("#result-deflection_m", timeout=60_000)
            print(f"first numbers after {time.perf_counter() - began:.1f} s; load "
                  f"{os.getloadavg()[0]:.1f}")
            page.wait_for_selector("#limit-alpha-1", timeout=60_000)
            print(f"to look at the canvas, a frame: {page.evaluate(_LOOK):.0f} ms")
            for key, within in SLIDERS.items():
                print_times(key, list(timed(page, key, within, options.moves)))
            wander(page, running, options.moves_in_all)


def timed(page: Any, key: str, within: tuple[float, float], moves: int) -> Iterator[float]:
    """Times [ms] from a slider's event to a new picture."""
    generator = np.random.default_rng(1)
    for value in generator.uniform(*within, moves):
        page.wait_for_timeout(250)
        yield page.evaluate(_MOVE, [f"slider-{key}", f"{value:.2f}"])


def print_times(key: str, times: list[float]) -> None:
    """One line."""
    ordered = sorted(times)
    print(f"{key:<20} median {statistics.median(times):6.0f} ms, nine in ten below "
          f"{ordered[int(0.9 * len(ordered))]:6.0f} ms, {len(times)} moves")


def wander(page: Any, running: Running, moves: int) -> None:
    """Move sliders at random, without waiting for pictures."""
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    generator, memory = np.random.default_rng(2), []
    began = time.perf_counter()
    for move in range(moves):
        key = list(SLIDERS)[generator.integers(len(SLIDERS))]
        value = generator.uniform(*SLIDERS[key])
        page.evaluate("""([id, value]) => { const slider = document.getElementById(id);
            slider.value = value; slider.dispatchEvent(new Event('input', {bubbles: true})); }""",
                      [f"slider-{key}", f"{value:.2f}"])
        page.wait_for_timeout(60)
        if move % max(1, moves // 5) == 0:
            memory.append(f"{resident(running.process.pid) / 1e6:.0f}")
    page.wait_for_timeout(5000)
    memory.append(f"{resident(running.process.pid) / 1e6:.0f}")
    print(f"{moves} random moves in {time.perf_counter() - began:.0f} s, {len(errors)} errors; "
          f"{page.inner_text('#loads')}: {page.inner_text('#result-deflection_m')}; memory of the "
          f"server on the way: {', '.join(memory)} MB")


def resident(process: int) -> float:
    """Memory of a process [bytes]."""
    pages = Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * float(os.sysconf("SC_PAGE_SIZE"))


if __name__ == "__main__":
    main()
