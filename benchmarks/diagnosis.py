"""How long a diagnosis of three shapes, two masses and fifteen voltages takes, stage by stage.

    python -m benchmarks.diagnosis [--workers 2] [--transients]

Readings are made by finite elements on a finer mesh, one film 2 % less stretched than stated, noise
20 µm. Films solved before are forgotten first, and read from disk in the end. With ``--transients``
the whole command instead, for readings at rest and steps of 30 s read a thousand times a second, of
films that creep, by the axisymmetric equations.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from tests.oracles.readings.round_actuators import Hidden
from tests.oracles.readings.runs_in_time import Run, write
from tympan.fem.equilibrium.voltage_path import voltage_path
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.calibration import calibrated, law_error, with_effects
from tympan.studies.diagnosis.gain import gain_of
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.identifiability import detectable_effects, signatures
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.next_experiment.proposals import propose
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.effects import EFFECTS, Setup, Use, extended
from tympan.studies.shipped import actuators

MASSES, VOLTAGES, NOISE = (17.9e-3, 22.45e-3), np.linspace(0, 6.5e3, 15), 20e-6
HIDDEN: Use = ("prestretch_loss", (0.02,), "elliptical-small")
CREEP, RUN = Hidden(branch=40e3, time=4.0), Run(rate=1000.0, before=300)
OTHER_MESH = Settings(mesh=MeshSettings(order=3, around_plate=17, growth=0.45, across=0.55))
AIM, AIM_IN_TIME = 15.0, 60.0


def readings(setup: Setup) -> ReadingTable:
    """What the hidden effect makes of the readings, noise included."""
    true = extended(setup, [HIDDEN])
    grid = np.meshgrid(np.arange(3.0), MASSES, VOLTAGES, indexing="ij")
    specimen, mass, voltage = (axis.ravel() for axis in grid)
    values = [outcome.state.plate.deflection
              for true_specimen in true.specimens for load in MASSES
              for outcome in voltage_path(build_model(true_specimen, OTHER_MESH),
                                          load * setup.rig.gravity, VOLTAGES.tolist())]
    noise = NOISE * np.random.default_rng(1).standard_normal(len(values))
    states = States.of(specimen.astype(np.int64), mass, voltage, 60.0 * np.arange(len(values)))
    return rows(states, "displacement", NOISE, np.array(values) + noise)


@contextmanager
def stage(words: str, spent: dict[str, tuple[float, float]]) -> Iterator[None]:
    """Time on the clock and of all processors, children included."""
    wall, busy = time.perf_counter(), sum(os.times()[:4])
    yield
    spent[words] = time.perf_counter() - wall, sum(os.times()[:4]) - busy


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--transients", action="store_true")
    asked = parser.parse_args()
    workers = asked.workers
    if asked.transients:
        _diagnose_transients(workers)
        return
    setup = Setup(actuators(), Rig())
    table = readings(setup)
    causes = tuple(Cause(name, which) for name, effect in EFFECTS.items()
                   if not {"direction", "x_mm", "force_mN"} & set(effect.columns)
                   for which in effect.choices(setup))
    with TemporaryDirectory() as folder:
        os.environ["TYMPAN_CACHE"] = folder
        _diagnose(setup, table, causes, workers)


def _diagnose_transients(workers: int) -> None:
    spent: dict[str, tuple[float, float]] = {}
    with TemporaryDirectory() as folder:
        os.environ["TYMPAN_CACHE"] = ""
        data = Path(folder) / "data"
        write(data, CREEP, RUN, seed=3)
        command = [sys.executable, "-m", "tympan", "diagnose", str(data), "-o", f"{folder}/out",
                   "--workers", str(workers)]
        with stage("the whole command", spent):
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL, text=True)
    print(done.stdout)
    _print_stages(spent)
    wall = spent["the whole command"][0]
    print(f"aim {AIM_IN_TIME:g} s   {'met' if wall <= AIM_IN_TIME else 'not met'}")


def _diagnose(setup: Setup, table: ReadingTable, causes: tuple[Cause, ...], workers: int) -> None:
    spent: dict[str, tuple[float, float]] = {}
    with stage("stiffness and permittivity", spent):
        nominal = calibrated(setup, table)
        error = law_error(nominal.simulation, nominal.fit, table)
    with stage("force laws with all effects", spent):
        simulation = with_effects(nominal.simulation, lambda done, count: None, workers)
    with stage("all effects and pairs, verdict", spent):
        judged = judge(simulation, table, causes, workers=workers)
    with stage("what can be known", spent):
        detectable_effects(signatures(judged.simulation, table, judged.nominal.unknowns, causes))
    with stage("gain on readings held out", spent):
        gain_of(judged.simulation, table, causes, judged)
    with stage("next experiment", spent):
        propose(judged.simulation, judged, causes)
    chosen = judged.chosen
    with stage("check by finite elements", spent):
        error = max(error, law_error(judged.simulation, chosen, table) if chosen else 0.0)
    again: dict[str, tuple[float, float]] = {}
    with stage("the same films from disk", again):
        with_effects(calibrated(setup, table).simulation, lambda done, count: None, workers)
    _print(spent, f"{judged.verdict} {', '.join(map(str, judged.named))}", error, workers)
    _print_stages(again)


def _print(spent: dict[str, tuple[float, float]], verdict: str, error: float, workers: int) -> None:
    print(f"{'stage':<34}{'clock':>9}{'processors':>12}")
    _print_stages(spent)
    wall, busy = (sum(column) for column in zip(*spent.values(), strict=True))
    print(f"{'all':<34}{wall:>7.1f} s{busy:>10.1f} s   {workers} workers, "
          f"load {os.getloadavg()[0]:.1f}")
    print(f"verdict: {verdict}; the reduced model is off by at most {1e6 * error:.2f} um "
          "of deflection")
    print(f"aim {AIM:.0f} s   {'met' if wall < AIM else 'not met'}")


def _print_stages(spent: dict[str, tuple[float, float]]) -> None:
    for words, (wall, busy) in spent.items():
        print(f"{words:<34}{wall:>7.1f} s{busy:>10.1f} s")


if __name__ == "__main__":
    main()
