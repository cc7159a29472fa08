"""How soon the explorer's picture follows a slider, in headless Chromium.

    python -m benchmarks.explore [--moves 40] [--moves-in-all 1000]

Times run from the event in the page to the frame after WebGL drew the film anew, on a page of 1440
by 900 pixels, without a graphics card. That the picture is the right one is tested elsewhere
(tests/explore/test_page.py). Beside other work they say little; so the processor time of a
move is printed too, that of all processes of the explorer and of the browser. Then sliders are
moved at random, with the memory of the explorer's process at the beginning and at the end.
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

from benchmarks.explore.browser import Running, browsing, chromium, exploring

OVAL = """
name = "oval"
[frame]
shape = "ellipse"
semi_axes = ["6 cm", "4.5 cm"]
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
relative_permittivity = 4.7
material = "vhb-4910"
"""

#: Tells when WebGL draws; to look at the canvas in every frame would take most of the time.
_WATCH = """() => {
  const clear = WebGL2RenderingContext.prototype.clear;
  WebGL2RenderingContext.prototype.clear = function (...values) {
    if (window.drawn) { window.drawn(); window.drawn = null; }
    return clear.apply(this, values);
  };
}"""

#: Moves a slider as its user would, and answers when a frame has passed since a new picture was
#: drawn [ms].
_MOVE = """
([id, value]) => new Promise(done => {
  const slider = document.getElementById(id), began = performance.now();
  const give_up = setTimeout(() => done(NaN), 10000);
  window.drawn = () => requestAnimationFrame(() => {
    clearTimeout(give_up);
    done(performance.now() - began);
  });
  slider.value = value;
  slider.dispatchEvent(new Event('input', {bubbles: true}));
})"""

#: Slides without a rest between moves, so many milliseconds apart, and answers how many pictures
#: were drawn. While controls move no finite elements are asked for curves and bands.
_SLIDE = """
([id, values, apart]) => new Promise(done => {
  const slider = document.getElementById(id);
  let pictures = 0, next = 0;
  const draw = () => { pictures += 1; queueMicrotask(() => { window.drawn = draw; }); };
  window.drawn = draw;
  const moving = setInterval(() => {
    if (next == values.length) {
      clearInterval(moving);
      window.drawn = null;
      done(pictures);
      return;
    }
    slider.value = values[next++];
    slider.dispatchEvent(new Event('input', {bubbles: true}));
  }, apart);
})"""

#: Moves a slider, or chooses a shape, and answers when the number of the deflection is another
#: [ms]; none after ten seconds, where the move changes nothing.
_NUMBER = """
([id, value, event]) => new Promise(done => {
  const control = document.getElementById(id), began = performance.now();
  const number = document.getElementById('result-deflection_m'), before = number.textContent;
  const give_up = setTimeout(() => { watch.disconnect(); done(NaN); }, 10000);
  const watch = new MutationObserver(() => {
    const now = document.getElementById('result-deflection_m');
    if (!now || now.textContent == before || !/[0-9]/.test(now.textContent)) return;
    watch.disconnect();
    clearTimeout(give_up);
    done(performance.now() - began);
  });
  watch.observe(document.body, {childList: true, subtree: true, characterData: true});
  control.value = value;
  control.dispatchEvent(new Event(event, {bubbles: true}));
})"""

#: How long the controls rest before a slider is measured [ms]: finite elements are done then.
_REST = 4000
#: Between moves of a slider that does not rest [ms]: less than after which controls are at rest.
_APART = 100

#: Number of moves after which the first number is awaited.
_FIRST_NUMBERS = 60
#: Rest between them [ms].
_BETWEEN = 1500
#: Largest part of a slider's range by which such a move goes from where it began.
_SHARE = 0.2

#: Sliders that are measured, between values; but for the offset these have reduced films.
SLIDERS = {"voltage": (1.0, 6.0), "mass": (10.0, 25.0), "stiffness": (0.85, 1.15),
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
        Path(folder, "oval.toml").write_text(OVAL, encoding="utf-8")
        with exploring(Path(folder), "oval.toml", "--mass", "17.9 g",
                       "--voltage", "2 kV") as running:
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            began = time.perf_counter()
            page.goto(running.address)
            page.wait_for_selector("#result-deflection_m", timeout=60_000)
            print(f"first numbers after {time.perf_counter() - began:.1f} s; load "
                  f"{os.getloadavg()[0]:.1f}")
            page.wait_for_selector("#limit-alpha-1", timeout=60_000)
            page.wait_for_selector("[data-quick=true]", timeout=120_000)
            print(f"reduced films after {time.perf_counter() - began:.1f} s")
            page.evaluate(_WATCH)
            for key, within in SLIDERS.items():
                # What is far from the first film has no reduced film.
                page.click("#reset")
                page.wait_for_timeout(_REST)
                before = busy(running)
                times = list(timed(page, key, within, options.moves))
                shares = [1e3 * (after - start) / options.moves
                          for start, after in zip(before, busy(running), strict=True)]
                print_times(key, times, *shares)
                page.wait_for_timeout(_REST)
                before = busy(running)
                pictures = slid(page, key, within, options.moves)
                own, browser = (1e3 * (after - start) / options.moves
                                for start, after in zip(before, busy(running), strict=True))
                print(f"{'':<18} {options.moves} moves {_APART} ms apart, {pictures} pictures: "
                      f"{own:.0f} ms of the explorer a move, {browser:.0f} ms of the browser",
                      flush=True)
            first_numbers(page)
            wander(page, running, options.moves_in_all)


def first_numbers(page: Any) -> None:
    """Print how soon the deflection follows moves of every slider in turn, and new shapes."""
    generator = np.random.default_rng(3)
    page.click("#reset")
    page.wait_for_timeout(_REST)
    sliders = page.evaluate("""() => [...document.querySelectorAll('input[type=range]')]
        .filter(each => each.id.startsWith('slider-') && each.offsetParent)
        .map(each => [each.id, +each.min, +each.max, +each.value])""")
    times = list[float]()
    for move in range(_FIRST_NUMBERS):
        name, low, high, own = sliders[move % len(sliders)]
        near = own + _SHARE * (high - low) * generator.uniform(-1, 1)
        value = float(np.clip(near, low, high))
        page.wait_for_timeout(_BETWEEN)
        times.append(page.evaluate(_NUMBER, [name, f"{value:.6g}", "input"]))
    print_first(f"{len(times)} moves over {len(sliders)} sliders", times)
    shapes = page.evaluate("""() => [...document.querySelectorAll('select')]
        .filter(each => each.id.startsWith('shape-') && each.offsetParent)
        .flatMap(each => [...each.options].filter(one => one.value != each.value)
                         .map(one => [each.id, one.value]))""")
    times = []
    for name, shape in shapes:
        page.click("#reset")
        page.wait_for_timeout(_REST)
        times.append(page.evaluate(_NUMBER, [name, shape, "change"]))
    print_first(f"{len(times)} new shapes", times)


def print_first(moves: str, times: list[float]) -> None:
    """One line on first numbers after moves; those that change nothing have none."""
    known = sorted(time for time in times if np.isfinite(time))
    print(f"first number after {moves}, {len(known)} of which change it: median "
          f"{statistics.median(known):.0f} ms, 95 % below {known[int(0.95 * len(known))]:.0f} ms, "
          f"all below {known[-1]:.0f} ms", flush=True)


def timed(page: Any, key: str, within: tuple[float, float], moves: int) -> Iterator[float]:
    """Times [ms] from a slider's event to a new picture."""
    generator = np.random.default_rng(1)
    for value in generator.uniform(*within, moves):
        page.wait_for_timeout(250)
        yield page.evaluate(_MOVE, [f"slider-{key}", f"{value:.2f}"])


def slid(page: Any, key: str, within: tuple[float, float], moves: int) -> int:
    """Pictures of a slider that moves there and back without a rest."""
    low, high = within
    share = (1 - np.cos(2 * np.pi * np.linspace(0.0, 1.0, moves))) / 2
    values = [f"{value:.2f}" for value in low + (high - low) * share]
    pictures: int = page.evaluate(_SLIDE, [f"slider-{key}", values, _APART])
    return pictures


def print_times(key: str, times: list[float], server: float, browser: float) -> None:
    """One line."""
    ordered = sorted(times)
    print(f"{key:<18} median {statistics.median(times):4.0f} ms, nine in ten below "
          f"{ordered[int(0.9 * len(ordered))]:4.0f} ms; processor time of the explorer "
          f"{server:.0f} ms, of the browser {browser:.0f} ms", flush=True)


def busy(running: Running) -> tuple[float, float]:
    """Processor time of the explorer's and of the browser's processes so far [s]."""
    parents: dict[int, int] = {}
    spent: dict[int, int] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                words = (entry / "stat").read_text(encoding="utf-8").rpartition(") ")[2].split()
            except OSError:  # it has ended
                continue
            parents[int(entry.name)] = int(words[1])
            spent[int(entry.name)] = sum(map(int, words[11:15]))  # with children that ended
    explorer = set(descendants(running.process.pid, parents))
    mine = set(descendants(os.getpid(), parents)) - explorer - {os.getpid()}
    ticks = os.sysconf("SC_CLK_TCK")
    return (sum(spent[process] for process in explorer) / ticks,
            sum(spent[process] for process in mine) / ticks)


def descendants(process: int, parents: dict[int, int]) -> Iterator[int]:
    """A process, its children and theirs."""
    yield process
    for child, parent in parents.items():
        if parent == process:
            yield from descendants(child, parents)


def wander(page: Any, running: Running, moves: int) -> None:
    """Move sliders at random, without waiting for pictures."""
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    generator, memory = np.random.default_rng(2), []
    began = time.perf_counter()
    for move in range(moves):
        key = list(SLIDERS)[generator.integers(len(SLIDERS))]
        value = generator.uniform(*SLIDERS[key])
        page.evaluate(r"""([id, value]) => { const slider = document.getElementById(id);
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
