"""The reduced film with memory beside its field model: error, processor time, and a picture.

``python -m benchmarks.reduced_film [-o docs]``: the paper's three actuators with two branches each,
under a mass and in signals that the film was not made from. One run alone, and thirty together.
Times are medians of rounds in which each has its turn.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tympan.base.arrays import Array
from tympan.fem.film.library import load_specimen
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.paper.published import MASSES
from tympan.reports import look
from tympan.studies.case import Settings, build_model
from tympan.studies.films.film import ReducedFilm
from tympan.studies.films.reduction import reduced_film
from tympan.studies.lumped.film_response import film_deflections, film_motion
from tympan.studies.motion import Trace
from tympan.studies.signals import Sine, nominal, ramp, random_steps, step
from tympan.studies.transient import TransientCase, history

_NAMES = ("circular", "elliptical-small", "elliptical-large")
_BRANCHES = (ViscousBranch(200e3, 10.0), ViscousBranch(1e6, 30.0))
#: Room for the words and numbers left of the first panel [mm].
_LEFT = 15.0
#: Room between panels [mm]: numbers such as -0.50.
_GAP = 12.0
#: Every 40th of 1001 moments of the field model is drawn: more marks touch one another.
_MARKED = 40
_GRAVITY, _HIGHEST, _BETWEEN, _TOGETHER, _ROUNDS = 9.80665, 7e3, 20e-3, 30, 3

#: By name, for a highest voltage.
_SIGNALS: dict[str, Callable[[float], Any]] = {
    "step": lambda high: step(0.0, high, 0.0, 30.0),
    "sine": lambda high: Sine(high / 2, high / 2, 10.0, 3.0),
    "ramp": lambda high: ramp(0.0, high, 60.0),
    "random": lambda high: random_steps(0.0, high, 30.0, 6, 11)}

_HEAD = ("film, branch                    signal field ms  reduced ms  times alone  together"
         "  error of range  of deflection")


def main() -> None:
    """Print the table, one row for every film and signal, and draw the last film."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", type=Path, dest="output", help="folder of reduced-film.png")
    output = parser.parse_args().output
    if output is not None:
        output.mkdir(parents=True, exist_ok=True)
    print(_HEAD)
    for specimen in _specimens():
        film, spent = _spent(lambda item=specimen: _reduced(item))
        drawn = {name: _row(film, name, spent) for name in _SIGNALS}
        _swing(film)
    if output is not None:
        with tempfile.TemporaryDirectory() as folder:
            picture, *_ = look.save_figure(Path(folder), "reduced-film", lambda: _compose(drawn))
            shutil.copy(picture, output)


def _specimens() -> Iterator[Specimen]:
    folder = resources.files("tympan.studies.shipped")
    for name in _NAMES:
        specimen = load_specimen(str(folder / f"{name}.toml"))
        for branch in _BRANCHES:
            yield replace(specimen, membrane=replace(specimen.membrane, branches=(branch,)))


def _reduced(specimen: Specimen) -> ReducedFilm:
    return reduced_film(build_model(specimen, Settings()), [mass * _GRAVITY for mass in MASSES],
                        _HIGHEST)


def _spent(work: Callable[[], Any], times: int = 1) -> tuple[Any, float]:
    """What work gives, and the processor time it takes on average [s]."""
    began = time.process_time()
    for _ in range(times):
        result = work()
    return result, (time.process_time() - began) / times


def _in_turn(*works: tuple[Callable[[], Any], int]) -> tuple[list[Any], list[float]]:
    """What works give, and the median processor times [s] of rounds in which each has its turn."""
    rounds = [[_spent(*work) for work in works] for _ in range(_ROUNDS)]
    return ([result for result, _ in rounds[-1]],
            np.median([[spent for _, spent in each] for each in rounds], axis=0).tolist())


def _row(film: ReducedFilm, name: str, made: float) -> tuple[Any, Array, Array, Array]:
    signal, specimen = _SIGNALS[name](0.9 * _HIGHEST), film.specimen
    case = TransientCase(specimen, signal, mass=_BETWEEN)
    when = np.linspace(0.0, signal.end, 1001)
    many = [_SIGNALS[name](share * _HIGHEST) for share in np.linspace(0.2, 0.9, _TOGETHER)]
    (field, *_), (exact_time, alone, shared) = _in_turn(
        (lambda: history(case, Settings()), 1),
        (lambda: list(film_motion(film, signal, _BETWEEN).moments()), 5),
        (lambda: film_deflections(film, many, [_BETWEEN] * _TOGETHER, when[:2]), 1))
    near, = film_deflections(film, [signal], [_BETWEEN], when)
    exact = field.at(field.deflection, when)
    before = film_motion(film, signal, _BETWEEN).begin.deflection
    error = np.abs(near - exact).max() / np.ptp(np.append(exact, before))
    branch, = specimen.membrane.branches
    words = f"{specimen.name}, {branch.modulus / 1e6:g} MPa {branch.time:g} s"
    share = 100 * np.abs(near / exact - 1).max()
    print(f"{words:32s}{name:7s}{1e3 * exact_time:8.0f}{1e3 * alone:12.2f}"
          f"{exact_time / alone:13.0f}{exact_time / (shared / _TOGETHER):10.0f}"
          f"{100 * error:14.3f} %{share:13.3f} %", flush=True)
    if name == "step":
        print(f"    {film.count} shapes, {len(film.volumes)} points, made in {made:.1f} s")
    return signal, when, exact, near


def _swing(film: ReducedFilm) -> None:
    """The same with the plate's inertia, for 0.5 s."""
    signal = step(0.0, 0.9 * _HIGHEST, 0.0, 0.5)
    case = TransientCase(film.specimen, signal, mass=_BETWEEN, inertia=True)
    motion = film_motion(film, signal, _BETWEEN, inertia=True)
    (field, moments), (exact_time, alone) = _in_turn(
        (lambda: history(case, Settings()), 1), (lambda: list(motion.moments()), 3))
    when = np.linspace(0.0, signal.end, 1001)
    exact = field.at(field.deflection, when)
    near = Trace(np.array([moment.time for moment in moments])).at(
        np.array([moment.deflection for moment in moments]), when)
    error = np.abs(near - exact).max() / np.ptp(exact)
    print(f"{'':32s}{'swing':7s}{1e3 * exact_time:8.0f}{1e3 * alone:12.2f}"
          f"{exact_time / alone:13.0f}{'':10s}{100 * error:14.3f} %", flush=True)


def _compose(drawn: dict[str, tuple[Any, Array, Array, Array]]) -> Figure:
    """Voltage, deflection of field model and reduced film, and their difference."""
    figure = look.new_figure(125.0)
    pitch = (look.WIDTH - _LEFT) / len(drawn)
    for number, (name, (signal, when, exact, near)) in enumerate(drawn.items()):
        edge, width = _LEFT + number * pitch, pitch - _GAP
        voltage = look.place_axes(figure, edge, 6.0, width, 18.0)
        above, below = look.place_pair(figure, edge, 32.0, width, (45.0, 5.0, 26.0))
        voltage.plot(np.append(0.0, when), 1e-3 * np.append(signal.first, nominal(signal, when)),
                     color="black", linewidth=0.8)
        above.plot(when, 1e3 * near, color=look.colour_of(1), linewidth=1.0, label="reduced")
        above.plot(when[::_MARKED], 1e3 * exact[::_MARKED], "o", color="black", markersize=2.5,
                   markerfacecolor="none", label="field model")
        below.plot(when, 1e6 * (near - exact), color=look.colour_of(1), linewidth=0.8)
        words = ("voltage (kV)", "deflection (mm)", "difference (µm)")
        across, up, apart = words if number == 0 else ("", "", "")
        look.describe(voltage, "", across, name, bold=True)
        look.describe(above, "", up)
        look.describe(below, "time (s)", apart)
        if number == 0:
            figure.legend(*above.get_legend_handles_labels(), loc="lower center", ncols=2)
    return figure


if __name__ == "__main__":
    main()
