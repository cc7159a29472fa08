"""Random specimens with viscous branches under random signals: none raises, hangs or gains energy.

    python -m benchmarks.trials.random_films_in_time [--count 200] [--seed 1] [--workers 1]
    [-o docs/films-in-time.md]

The specimens and loads are those of `robustness.py`: every law, outline and part of a rig. Each
gets branches, a time since mounting or none, a plate that swings or does not, a damper, a circuit,
and a signal that jumps, rises and falls.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.random import Generator, default_rng
from scipy.constants import epsilon_0

from benchmarks.trials.random_specimens import design
from benchmarks.trials.robustness import Judge, judged_by
from tympan.fem.film.density import small_strain_modulus
from tympan.fem.transient.energy import EnergyBalance
from tympan.fem.transient.integrate import StepSettings
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import area
from tympan.geometry.specimen import Film, Specimen, ViscousBranch
from tympan.studies.case import Settings
from tympan.studies.signals import Pieces
from tympan.studies.transient import TransientCase, history

MESH = MeshSettings(order=3).refined(0.5)

#: Processor time a motion may take [s].
SECONDS = 60.0

#: Energy that counts as none [J]: of a milligram by a millimetre.
LEAST = 1e-8

#: Share of what the loads do, and the film against them, that may be unexplained by errors of the
#: steps; where it is more, smaller steps must explain so much of it.
UNEXPLAINED, SMALLER, EXPLAINED = 1e-4, 0.1, 0.5


@dataclass(frozen=True)
class FilmInTime:
    """A case of the design and its motion; ``refused`` draws before it were not admissible."""

    number: int
    motion: TransientCase
    refused: int
    words: str

    def __str__(self) -> str:
        motion, film = self.motion, self.motion.specimen.membrane
        rig, signal = motion.rig, motion.signal
        branches = ", ".join(f"{branch.modulus / 1e3:.3g} kPa {branch.time:.3g} s"
                             for branch in film.branches)
        parts = [self.words, branches, f"{signal.end:.3g} s to {signal.peak / 1e3:.2f} kV"]
        if film.mounted is not None:
            parts.append(f"mounted {film.mounted:.3g} s ago")
        parts += ["swings"] * motion.inertia
        parts += [f"damper {rig.plate_damping:.2g}"] * bool(rig.plate_damping)
        parts += [f"resistance {rig.series_resistance:.2g}"] * bool(rig.series_resistance)
        return ", ".join(parts)


@dataclass(frozen=True)
class MotionRecord:
    """What became of a motion.

    ``status``: "done", "pull_in" or "thinning"; or "refused" (wrong input, such as no equilibrium
    under the first voltage), "raised", "hung". ``unexplained``: relative to the most of its
    energies; ``again``: with smaller steps, where it was too much.
    """

    number: int
    status: str
    words: str = ""
    seconds: float = 0.0
    case: str = ""
    swings: bool = False
    moments: int = 0
    unexplained: float = 0.0
    again: float | None = None
    heat: float = 0.0
    jumps: float = 0.0
    wrinkles: bool = False

    @property
    def snaps(self) -> bool:
        """Whether energy is lost at once where a film that wrinkles, which has no mass, snaps."""
        return self.wrinkles and self.unexplained > UNEXPLAINED

    @property
    def gains(self) -> bool:
        """Whether energy comes from nowhere, or goes there, and smaller steps do not mend it."""
        more = abs(self.unexplained) > UNEXPLAINED and not self.snaps
        stays = self.again is None or abs(self.again) > EXPLAINED * abs(self.unexplained)
        return (more and stays) or min(self.heat, self.jumps) < -UNEXPLAINED

    @property
    def wrong(self) -> str:
        """What is wrong with this motion; empty where nothing is."""
        faults = [self.status] * (self.status in ("raised", "hung"))
        faults += [f"unexplained {self.unexplained:.1e}, by smaller steps {self.again}, heat "
                   f"{self.heat:.1e}, jumps {self.jumps:.1e}"] * self.gains
        faults += ["slow"] * (self.seconds > SECONDS)
        return "; ".join(faults)


def films_in_time(count: int, seed: int = 1) -> Iterator[FilmInTime]:
    """Motions, each with a generator of its own: motion k is the same whatever the count."""
    for drawn in design(count, seed):
        random = default_rng([seed, drawn.number, 16])
        case = drawn.case
        film = _viscous(random, case.specimen.membrane)
        specimen = replace(case.specimen, membrane=film)
        inertia = bool(case.mass > 0 and random.random() < 0.4)
        longest = max(branch.time for branch in film.branches)
        end = _log(random, 0.03, 0.3) if inertia else longest * _log(random, 0.1, 30.0)
        rig = replace(case.rig, **_in_time(random, specimen, end))
        rest = None if random.random() < 0.7 else longest * _log(random, 0.1, 10.0)
        motion = TransientCase(specimen, _signal(random, case.voltage, end), mass=case.mass,
                               rig=rig, rest=rest, inertia=inertia)
        yield FilmInTime(drawn.number, motion, drawn.refused, str(drawn))


def _viscous(random: Generator, film: Film) -> Film:
    """With one to three branches, mounted for ever or some time ago."""
    modulus = abs(float(np.real(small_strain_modulus(film.material))))
    branches = tuple(ViscousBranch(modulus * _log(random, 0.1, 30.0), _log(random, 0.01, 1e3))
                     for _ in range(random.integers(1, 4)))
    mounted = _log(random, 0.1, 1e5) if random.random() < 0.3 else None
    return replace(film, branches=branches, mounted=mounted)


def _in_time(random: Generator, specimen: Specimen, end: float) -> dict[str, float]:
    """What only a rig in time feels, in some of the cases."""
    film = specimen.membrane
    size = area(specimen.frame) - area(specimen.plate.outline)
    capacitance = (epsilon_0 * film.relative_permittivity * size * film.area_prestretch
                   / film.thickness)
    parts = {}
    if random.random() < 0.3:
        parts["plate_damping"] = _log(random, 1e-3, 1.0)
    if random.random() < 0.3:
        parts["series_resistance"] = end * _log(random, 1e-3, 1.0) / capacitance
        if random.random() < 0.5:
            parts["leakage_resistance"] = parts["series_resistance"] * _log(random, 1.0, 1e3)
    return parts


def _signal(random: Generator, highest: float, end: float) -> Pieces:
    """From one level to others, each reached by a jump or a ramp and then held."""
    count = random.integers(1, 5)
    times = np.sort(np.append(random.uniform(0, end, count - 1), [0.0, end]))
    times = times[np.append(True, np.diff(times) > 1e-3 * end)]
    levels = highest * random.uniform(0, 1, len(times))
    levels[0] *= random.choice([0.0, 0.6])
    time, voltage = [0.0], [levels[0]]
    for begin, finish, level in zip(times[:-1], times[1:], levels[1:], strict=True):
        ramp = begin if random.random() < 0.5 else begin + (finish - begin) / 2
        time += [ramp, finish]
        voltage += [level, level]
    return Pieces(np.array(time), np.array(voltage))


def judged(drawn: FilmInTime, mesh: MeshSettings = MESH) -> MotionRecord:
    """A motion made and checked."""
    began = time.process_time()
    motion, settings = drawn.motion, Settings(mesh)
    done = history(motion, settings)
    seconds = time.process_time() - began
    status = "done" if done.stopped is None else done.stopped.kind
    scale = most(done.balance)
    record = MotionRecord(drawn.number, status, seconds=seconds, case=str(drawn),
                          swings=motion.inertia, moments=len(done.time),
                          unexplained=float(done.balance.unexplained_J / scale),
                          wrinkles=done.slack is not None,
                          heat=float(done.balance.heat_J / scale),
                          jumps=float(done.balance.jumps_J / scale))
    if abs(record.unexplained) <= UNEXPLAINED or record.snaps:
        return record
    closer = replace(motion, steps=StepSettings(error=SMALLER * motion.steps.error))
    finer = history(closer, settings).balance
    return replace(record, again=float(finer.unexplained_J / most(finer)))


def most(balance: EnergyBalance) -> float:
    """The largest of its energies [J]."""
    parts = (balance.load_work_J, balance.electrical_work_J, balance.stored_J, balance.kinetic_J,
             balance.heat_J, balance.jumps_J)
    return max(*(abs(part) for part in parts), LEAST)


def failed(drawn: FilmInTime, status: str, words: str) -> MotionRecord:
    """The record of a motion that has none."""
    return MotionRecord(drawn.number, status, words, case=str(drawn), swings=drawn.motion.inertia)


def table(records: Sequence[MotionRecord]) -> str:
    """The study in lines."""
    counts = Counter(record.status for record in records)
    lines = [f"{len(records)} motions, {sum(record.swings for record in records)} with the plate's "
             "inertia", ""]
    lines += [f"{status:12}{counts[status]:6d}" for status in
              ("done", "pull_in", "thinning", "refused", "raised", "hung")]
    moved = [record for record in records if record.moments]
    shares = np.array([abs(record.unexplained) for record in moved])
    lines += ["", "energy unexplained, of the largest in its balance: median "
              f"{np.median(shares):.0e}, 95 % below {np.quantile(shares, 0.95):.0e}, largest "
              f"{shares.max():.0e}",
              f"  made again with a tenth of the error: {sum(r.again is not None for r in moved)}",
              f"least heat {min(record.heat for record in moved):.1e}, least loss in jumps "
              f"{min(record.jumps for record in moved):.1e}",
              f"losing some as they wrinkle and snap: {sum(record.snaps for record in moved)}",
              f"gaining or losing energy: {sum(record.gains for record in moved)}"]
    times = np.array([record.seconds for record in moved])
    slowest = max(moved, key=lambda record: record.seconds)
    lines += ["", f"processor time: median {np.median(times):.2f} s, 95 % below "
              f"{np.quantile(times, 0.95):.1f} s, slowest {slowest.seconds:.1f} s "
              f"(#{slowest.number}, {slowest.moments} moments)",
              f"  more than {SECONDS:g} s: {np.count_nonzero(times > SECONDS)}", "", "refused"]
    reasons = Counter(record.words.split(":")[0] for record in records
                      if record.status == "refused")
    lines += [f"{number:5d}  {words}" for words, number in reasons.most_common()] or ["  none"]
    lines += ["", "wrong"]
    lines += [f"  #{record.number} {record.status}: {record.wrong}" for record in records
              if record.wrong] or ["  none"]
    return "\n".join(lines)


def _log(random: Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def main() -> None:
    """Run the study and print its table."""
    parser = argparse.ArgumentParser(description="Move and check random films with branches.")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, help="Markdown file to put the table in")
    options = parser.parse_args()

    def keep(records: list[MotionRecord]) -> None:
        if options.output:
            early = (f"\nstopped early: {len(records)} of {options.count}"
                     if len(records) < options.count else "")
            lines = f"seed {options.seed}, mesh {MESH}{early}\n{table(records)}"
            options.output.write_text(f"{PAGE}\n```\n{lines}\n```\n", encoding="utf-8")

    records = judged_by(Judge(judged, failed), films_in_time(options.count, options.seed),
                        options.workers, keep)
    keep(records)
    print(table(records))


PAGE = """# Robustness on random films in time

Does every motion end with an answer, and is its energy conserved? This is what `make
films-in-time` printed in one run. The films are the random specimens of
[robustness](robustness.md), with

* one to three viscous branches (0.1 to 30 times as stiff as the law, 10 ms to 1000 s);
* a mounting for ever or some time ago;
* signals that jump and rise and fall;
* in two of five, the plate's inertia; in some, a damper; in some, a resistance through which they
  are charged, with a leak.

"Refused" is wrong input: nearly always a film without equilibrium under mass and first voltage.

For every motion the energies must balance. What weights, gas and source put in is stored, moves,
became heat, or was lost at once in a jump of the voltage. The unexplained rest is relative to the
largest of these. If it is more than 1e-4, a run with a tenth of the error must explain half of it.
An exception is what a film without mass loses where it wrinkles and snaps. Heat and losses in
jumps must not be negative.
"""

if __name__ == "__main__":
    main()
