"""What a film in time costs: a step beside an elastic one, a step response, the paper's levels.

    python -m benchmarks.transient [--repeat 30] [--peer-python PYTHON]

The paper's large ellipse, a quarter of it, with a branch of 1 MPa and 30 s. A time step is one
implicit solve of the film; the integrator makes three of them for each step it goes on by, for its
error and a higher order, and the cost of all three with the estimate is printed too. Steps in time
and elastic ones are made in turn, so that whatever else the machine does falls on both alike; the
median of their ratios counts. Times are the processor's.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import TypeVar
from unittest.mock import patch

from benchmarks.peers.viscous_film import PROBLEM
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import NeoHooke
from tympan.fem.film.library import load_specimen
from tympan.fem.transient.integrate import StepSettings
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Film, Plate, Specimen, ViscousBranch
from tympan.paper import published
from tympan.studies.case import Settings, build_model
from tympan.studies.signals import random_steps, step
from tympan.studies.transient import TransientCase, begun, history

Result = TypeVar("Result")

ACTUATOR = Path(__file__).parents[2] / "studies/shipped/elliptical-large.toml"
PEER = Path(__file__).parents[1] / "peers/felupe_transient.py"

#: Largest ratio of a time step to an elastic one; processor time of response and levels [s].
MOST_RATIO, MOST_RESPONSE, MOST_LEVELS = 2.0, 2.0, 20.0

#: The step in time that is repeated [s], and the voltage an elastic step comes from [V].
DURATION, FROM = 3.0, 6.9e3


def actuator(*branches: ViscousBranch) -> Specimen:
    """The paper's large ellipse with branches."""
    specimen = load_specimen(ACTUATOR)
    return replace(specimen, membrane=replace(specimen.membrane, branches=branches))


def seconds(work: Callable[[], Result]) -> tuple[float, Result]:
    """Processor time, and what came of it."""
    began = time.process_time()
    result = work()
    return time.process_time() - began, result


def steps(case: TransientCase, repeat: int) -> Iterator[str]:
    """A step in time with branches beside a warm step of the voltage without."""
    elastic, *_ = begun(replace(case, specimen=actuator()), Settings())
    start = equilibrium(elastic.model, elastic.force, FROM).solution
    transient, state, memory = begun(case, Settings())
    moments = transient.moments(state, memory)
    past = [next(moments), next(moments)]

    def warm() -> object:
        return equilibrium(elastic.model, elastic.force, case.signal.peak, start=start)

    def implicit() -> object:
        return transient.implicit_step(past, 0, DURATION)

    def accepted() -> object:
        return transient.step(past, 0, DURATION)

    rounds = [[seconds(work)[0] for work in (warm, implicit, accepted)] for _ in range(repeat)]
    by_elastic, whole = (median(times[place] / times[0] for times in rounds) for place in (1, 2))
    yield (f"{transient.model.unknowns:,} unknowns; warm elastic step "
           f"{1e3 * median(times[0] for times in rounds):.1f} ms")
    yield f"one implicit time step over it: {by_elastic:.2f}" + verdict(by_elastic, MOST_RATIO)
    yield f"a step gone on by, three solves and the error, over it: {whole:.2f}"


def responses(case: TransientCase) -> Iterator[str]:
    """The step response and the paper's levels, from meshes in memory."""
    fine = replace(case, steps=StepSettings(error=1e-8))
    exact = history(fine, Settings())
    taken, done = seconds(lambda: history(case, Settings()))
    miss = done.deflection[-1] / exact.deflection[-1] - 1
    yield (f"30 s at 7 kV: {taken:.3f} s, {len(done.time)} moments, off by {abs(miss):.0e} of "
           f"smaller steps{verdict(taken, MOST_RESPONSE)}")
    longer = replace(case.specimen, frame=Ellipse((76e-3, 45e-3)))
    with patch.dict(os.environ, {"TYMPAN_CACHE": ""}):  # no mesh is kept
        meshing, _ = seconds(lambda: build_model(longer, Settings(), case.rig.loading))
    yield f"  a mesh like its own, from CAD on: {meshing:.2f} s"
    signal = random_steps(published.LOWEST, published.HIGHEST, published.SWITCH, 20, 1)
    taken, done = seconds(lambda: history(replace(case, signal=signal), Settings()))
    yield (f"20 levels of 30 s: {taken:.2f} s, {len(done.time)} moments"
           f"{verdict(taken, MOST_LEVELS)}")


def verdict(value: float, most: float) -> str:
    """In words."""
    return f"   aim {most:g}   {'met' if value <= most else 'not met'}"


def reference() -> TransientCase:
    """The problem the peer solves."""
    film = Film(PROBLEM.thickness, (PROBLEM.prestretch,) * 2, NeoHooke(PROBLEM.mu),
                PROBLEM.permittivity, branches=(ViscousBranch(PROBLEM.branch, PROBLEM.time),))
    specimen = Specimen("peer", Ellipse(PROBLEM.frame), Plate(Circle(PROBLEM.plate)), film)
    return TransientCase(specimen, step(0.0, PROBLEM.voltage, 0.0, PROBLEM.end), mass=17.9e-3)


def beside(peer_python: str) -> Iterator[str]:
    """The same film of a neo-Hookean law by tympan and by FElupe."""
    case = reference()
    exact = history(replace(case, steps=StepSettings(error=1e-8)),
                    Settings(MeshSettings().refined(2)))
    yield (f"neo-Hooke {PROBLEM.mu / 1e3:g} kPa: rest under the weight and 30 s at 7 kV; "
           f"{1e3 * exact.deflection[-1]:.5f} mm")
    yield f"{'':34}unknowns  steps  rel. error  seconds"
    for refine, error in ((2 / 3, 1e-4), (1.0, 1e-5), (1.0, 1e-6)):
        settings = Settings(MeshSettings().refined(refine))
        attempt = replace(case, steps=StepSettings(error=error))
        unknowns = begun(attempt, settings)[0].model.unknowns
        taken, done = seconds(lambda a=attempt, s=settings: history(a, s))
        yield row(f"tympan, error {error:g}", unknowns, len(done.time) - 1,
                  done.deflection[-1] / exact.deflection[-1] - 1, taken)
    peer = subprocess.run([peer_python, str(PEER)], capture_output=True, text=True, check=False)
    for line in peer.stdout.splitlines():
        made = json.loads(line)
        yield row(f"{made['peer']} {made['version']}, {made['method']}", made["unknowns"],
                  made["steps"], made["deflection_m"] / exact.deflection[-1] - 1, made["seconds"])
    if peer.returncode:
        yield (peer.stderr.strip().splitlines() or ["the peer failed"])[-1]


def row(name: str, unknowns: int, count: int, error: float, taken: float) -> str:
    """A line of the table."""
    return f"{name:<34}{unknowns:8,}  {count:5d}  {abs(error):10.1e}  {taken:7.3f}"


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=30, help="pairs of steps; medians count")
    parser.add_argument("--peer-python", default=sys.executable,
                        help="Python that has FElupe")
    options = parser.parse_args()
    case = TransientCase(actuator(ViscousBranch(1e6, 30.0)), step(0.0, 7e3, 0.0, 30.0),
                         mass=17.9e-3)
    for line in steps(case, options.repeat):
        print(line, flush=True)
    for line in responses(case):
        print(line, flush=True)
    for line in beside(options.peer_python):
        print(line, flush=True)


if __name__ == "__main__":
    main()
