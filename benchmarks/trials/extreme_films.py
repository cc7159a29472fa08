"""Legal films that nobody builds: every command answers, soon, and no two contradict each other.

    python -m benchmarks.trials.extreme_films [--count 300] [--seed 1] [--workers 1]
    [--keep extreme-films.jsonl] [-o docs/robustness.md]

Each film goes through `solve` and `curve`, which finds its limits; every fifth also through
`limits`. With --keep, films that were judged before are not judged again.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator, default_rng

from benchmarks.trials.robustness import SECONDS, Judge, judged_once, run_study
from tests.oracles.laws import SAMPLES, shear_modulus
from tympan.base.errors import InputError
from tympan.fem.film.admissibility import checked
from tympan.fem.film.laws.stiffened import scaled
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse, Outline, RoundedRectangle, Stadium, examples
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen
from tympan.studies.case import Case, CaseResult, Limits, Settings, solve
from tympan.studies.limits import limits
from tympan.studies.limits.curve import CurveResult, curve

#: Half as fine as that of the commands: what fails on it is judged again on theirs.
MESH = MeshSettings().refined(0.5)

#: Every so manieth film goes through `limits` by itself, too: `curve` makes the same search.
_AGAIN = 5

#: Smallest gap between plate and frame, and smallest bare band [m].
THIN = 0.1e-3

#: Largest ratio of a frame's axes.
ASPECT = 20.0

#: Relative difference of voltages beyond a limit's own spread, and of deflections, that is none.
SAME_VOLTAGE, SAME_DEFLECTION = 0.01, 1e-3

#: Draws of each number before which an admissible film is found.
_DRAWS = 1000


@dataclass(frozen=True)
class Extreme:
    """A film of the design; ``refused`` draws before it were no admissible specimens."""

    number: int
    case: Case
    refused: int

    def __str__(self) -> str:
        specimen, rig = self.case.specimen, self.case.rig
        film, plate = specimen.membrane, specimen.plate
        margins = specimen.electrode.margin_frame, specimen.electrode.margin_plate
        return (f"#{self.number} frame {specimen.frame} plate {plate} film {film.thickness:.3g} "
                f"{film.prestretch} eps {film.relative_permittivity:.3g} {film.material} "
                f"margins {margins} {self.case.mass:.4g} kg {self.case.voltage:.5g} V "
                f"gas {rig.gas_pressure:.4g} Pa")


@dataclass(frozen=True)
class Record:
    """What became of a film.

    ``seconds`` of processor time, the longest of the three commands; ``faults``: what is wrong.
    """

    number: int
    refused: int
    status: str
    words: str = ""
    seconds: float = 0.0
    case: str = ""
    end: str = ""
    faults: tuple[str, ...] = field(default=())

    @property
    def wrong(self) -> str:
        """What is wrong with this film; empty where nothing is."""
        faults = [self.status] * (self.status in ("raised", "hung")) + list(self.faults)
        faults += [f"{self.seconds:.0f} s"] * (self.seconds > SECONDS)
        return "; ".join(faults)


def design(count: int, seed: int = 1) -> Iterator[Extreme]:
    """Films, each with a generator of its own: film k is the same whatever the count."""
    for number in range(count):
        random = default_rng([seed, number])
        for refused in range(_DRAWS):
            try:
                yield Extreme(number, _case(number, random), refused)
            except InputError:
                continue
            break
        else:
            raise RuntimeError(f"no admissible film among {_DRAWS} draws of number {number}")


def _case(number: int, random: Generator) -> Case:
    frame = _frame(random)
    plate = _plate(random, frame)
    film = _film(random)
    bare = Specimen(f"extreme {number}", frame, plate, film)
    if random.random() < 0.4:
        widths = [float(random.choice([0.0, _log(random, THIN, max(THIN, bare.gap / 2.5))]))
                  for _ in range(2)]
        bare = Specimen(bare.name, frame, plate, film, Electrode(*widths))
    mass = 0.0 if random.random() < 0.2 else _log(random, 1e-3, 10.0)
    voltage = 0.0 if random.random() < 0.1 else _log(random, 100.0, 100e3)
    gas = 0.0
    if random.random() < 0.3:
        gas = float(random.choice([-1, 1])) * _log(random, 1.0, 10e3)
    return Case(bare, mass=mass if plate else 0.0, voltage=voltage, rig=Rig(gas_pressure=gas))


def _frame(random: Generator) -> Outline:
    if random.random() < 0.35:
        shapes = examples()
        return shapes[list(shapes)[random.integers(len(shapes))]]
    length = _log(random, 10e-3, 100e-3)
    width = length / _log(random, 1.0, ASPECT)
    kind = random.integers(4)
    if kind == 0:
        return Circle(length)
    if kind == 1:
        return RoundedRectangle((length, width), width * float(random.uniform(0.05, 0.9)))
    return Stadium((length, width)) if kind == 2 and length > 1.01 * width \
        else Ellipse((length, width))


def _plate(random: Generator, frame: Outline) -> Plate | None:
    """Of any size; in a third of the films as near the frame as a rim of 0.1 to 1 mm."""
    if random.random() < 0.08:
        return None
    a, b = frame.semi_axes
    size = min(a, b) * random.uniform(0.05, 0.85)
    stretch = np.sqrt(_log(random, 1.0, 3.0))
    long, short = float(size * stretch), float(size / stretch)
    kinds: tuple[Outline, ...] = (
        Circle(size), Ellipse((long, short)), Ellipse((short, long)),
        RoundedRectangle((long, short), short * float(random.uniform(0.1, 0.9))))
    outline = kinds[random.integers(len(kinds))]
    if random.random() < 0.3:
        return Plate(outline)
    rim = _log(random, THIN, 1e-3)
    room = a - outline.semi_axes[0] - rim
    if room <= 0:
        raise InputError("no room", key="plate")
    share = 1.0 if random.random() < 0.4 else float(random.uniform(-1, 1))
    return Plate(outline, (float(room * share), 0.0))


def _film(random: Generator) -> Film:
    law = list(SAMPLES.values())[random.integers(len(SAMPLES))].law
    law = scaled(law, _log(random, 1e3, 100e6) / shear_modulus(law))
    first, second = random.uniform(1.0, 6.0, 2)
    if random.random() < 0.4:
        second = first
    return Film(_log(random, 20e-6, 2e-3), (float(first), float(second)), checked(law),
                _log(random, 2.0, 1000.0))


def _log(random: Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def judged(drawn: Extreme, mesh: MeshSettings = MESH) -> Record:
    """What three commands make of a film, and where they contradict each other."""
    settings, case = Settings(mesh), drawn.case
    seconds: list[float] = []
    began = time.process_time()

    def lap() -> None:
        seconds.append(time.process_time() - began - sum(seconds))

    result = solve(case, settings)
    lap()
    drawn_curve = curve(case.specimen, [case.mass], settings, case.rig, [case.voltage])
    lap()
    reached = drawn_curve.curves[0].limits
    if drawn.number % _AGAIN == 0:
        reached = limits(case, settings)
        lap()
    end = "none" if reached.end is None else f"{reached.end.kind} {reached.end.voltage_V:.5g} V"
    record = Record(drawn.number, drawn.refused, result.status, "; ".join(result.warnings),
                    max(seconds), str(drawn), end,
                    tuple(faults_of(case, reached, result, drawn_curve)))
    usual = MeshSettings()
    return judged(drawn, usual) if record.faults and mesh != usual else record


def faults_of(case: Case, reached: Limits, result: CaseResult, drawn: CurveResult) -> Iterator[str]:
    """Numbers that are none, and answers of two commands that cannot both be true."""
    for name, record in (("solve", result.json()), ("curve", drawn.json())):
        try:
            json.dumps(record, allow_nan=False)
        except ValueError:
            yield f"{name}: not a number in JSON"
    if result.status != "equilibrium" and not result.warnings:
        yield "solve: no advice"
    end = reached.end
    if end is not None:
        apart = SAME_VOLTAGE + end.spread
        if result.status == "equilibrium" and case.voltage > end.voltage_V * (1 + apart):
            yield f"solve has an equilibrium beyond the end at {end.voltage_V:.5g} V"
        if result.status == "no_equilibrium" and case.voltage < end.voltage_V * (1 - apart):
            yield f"solve has no equilibrium below the end at {end.voltage_V:.5g} V"
    if not _alike(drawn.curves[0].limits, reached):
        yield "curve and limits end differently"
    table = drawn.table
    way = (table["asked"] == 0) & (table["status"] == "equilibrium")
    if end is not None and way.any():
        highest = float(table["voltage"][way].max())
        if highest > end.voltage_V * (1 + SAME_VOLTAGE + end.spread) and not reached.thins:
            yield f"curve goes to {highest:.5g} V, beyond the end"
    asked = table["asked"] == 1
    status, = table["status"][asked]
    if "not_converged" not in (status, result.status) and status != result.status:
        near = end is not None and abs(case.voltage / end.voltage_V - 1) < SAME_VOLTAGE + end.spread
        if not near:
            yield f"solve says {result.status}, curve {status}"
    if status == result.status == "equilibrium":
        deflection, = table["deflection"][asked]
        scale = max(abs(deflection), 1e-3 * case.specimen.gap)
        if abs(deflection - (result.deflection_m or 0.0)) > SAME_DEFLECTION * scale:
            yield f"solve deflects {result.deflection_m:.5g} m, curve {deflection:.5g} m"


def _alike(first: Limits, second: Limits) -> bool:
    """Whether two searches found the same limits."""
    pairs = [(getattr(first, kind), getattr(second, kind))
             for kind in ("tension", "breakdown", "instability", "pull_in")]
    return first.thins == second.thins and all(
        (first is None) == (other is None) and (first is None or math.isclose(
            first.voltage_V, other.voltage_V, rel_tol=1e-6)) for first, other in pairs)


def _failed(drawn: Extreme, status: str, words: str) -> Record:
    return Record(drawn.number, drawn.refused, status, words, case=str(drawn))


def study(count: int, seed: int, workers: int, kept: Path | None,
          mesh: MeshSettings = MESH) -> list[Record]:
    """All films judged, those in a file of records not again."""
    judge = Judge(partial(judged, mesh=mesh), _failed)
    return judged_once(judge, design(count, seed), workers, kept, _read)


def _read(line: dict[str, Any]) -> Record:
    return Record(**line | {"faults": tuple(line["faults"])})


def table(records: Sequence[Record]) -> str:
    """The study in lines."""
    counts = Counter(record.status for record in records)
    lines = [f"{len(records)} films; {sum(record.refused for record in records)} draws before them "
             "refused as inadmissible", ""]
    lines += [f"{status:36}{counts[status]:6d}" for status in
              ("equilibrium", "no_equilibrium", "not_converged", "refused", "raised", "hung")]
    faults = [fault for record in records for fault in record.faults]
    lines += ["", f"{'not a number in any JSON':36}{sum('JSON' in fault for fault in faults):6d}",
              f"{'solve, limits, curve contradict':36}"
              f"{sum('JSON' not in fault for fault in faults):6d}"]
    times = sorted(record.seconds for record in records)
    slowest = max(records, key=lambda record: record.seconds)
    lines += ["", "processor time of the slowest command of a film: median "
              f"{times[len(times) // 2]:.2f} s, 95 % below {times[int(0.95 * len(times))]:.1f} s, "
              f"slowest {slowest.seconds:.1f} s (#{slowest.number})",
              f"above {SECONDS:g} s: {sum(seconds > SECONDS for seconds in times)}",
              "", "how limits end"]
    ends = Counter(record.end.split(" ")[0] for record in records if record.end)
    lines += [f"{number:5d}  {kind}" for kind, number in ends.most_common()]
    lines += ["", "wrong"]
    lines += [f"  #{record.number} {record.status}: {record.wrong}" for record in records
              if record.wrong] or ["  none"]
    return "\n".join(lines)


PAGE = """## Extreme films

These films are legal, but nobody builds them:

* frames of every outline and of aspect up to 20, rims and bare bands down to 0.1 mm, no plate in
  some;
* prestretches from 1 to 6, every registered law from 1 kPa to 100 MPa, permittivities to 1000;
* films of 20 µm to 2 mm;
* masses to 10 kg, voltages to 100 kV, gas pressures of 1 Pa to 10 kPa either way.
"""


def main() -> None:
    """Run the study and print its table."""
    records = run_study("Extreme films through limits, solve and curve.", 300, study, table, MESH,
                        PAGE)
    sys.exit(any(record.wrong for record in records))


if __name__ == "__main__":
    main()
