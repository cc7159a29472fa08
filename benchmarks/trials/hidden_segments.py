"""Causes hidden in readings of an electrode in segments, and how often they are named.

    python -m benchmarks.trials.hidden_segments [--sets 60] [--seed 6400] [--minutes M]
    [--keep FILE] [-o docs/hidden-effects-segments.md]

Each set is drawn from its seed and its number: what is hidden, its place and size, the loads,
voltages and noise. Readings are made by finite elements on another mesh than the diagnosis uses, of
a film whose stiffness and permittivity differ from the stated ones. Whether a cause is identifiable
is printed before the verdict: by how much χ² its readings differ, in expectation, from those of the
baseline model and of every other cause, whatever sizes these have.

Sets that FILE has already are not run again. With 0 minutes only the page is written. Those
published are of hidden-segments.jsonl in this folder.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import NeoHooke
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.electrode import Electrode, Segment
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import with_effects
from tympan.studies.diagnosis.diagnose import calibrated_readings
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import FACTORS, SIZES, Cause, with_factors
from tympan.studies.diagnosis.inference.identifiability import SEEN, Signatures, signatures
from tympan.studies.diagnosis.inference.projection import orthonormal, without
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import EFFECTS, Setup, extended

#: Results of the published sets, and their seed and number.
PUBLISHED = Path(__file__).with_name("hidden-segments.jsonl")
SEED, SETS = 6400, 60
#: What may be hidden, each as likely; "" is nothing.
HIDDEN = ("", "segment_open", "segments_exchanged", "segment_covers_less", "thickness_gradient")
#: A film of the paper's kind whose electrode has four quarters.
QUARTERS = Specimen(
    "quarters", Circle(45e-3), Plate(Circle(10e-3)),
    Film(1e-3, (5**0.5, 5**0.5), NeoHooke(20e3), 4.7),
    Electrode(segments=tuple(Segment(name=name, sector=(turn * np.pi / 2, (turn + 1) * np.pi / 2))
                             for turn, name in enumerate("ABCD"))))
#: Another mesh than that of the diagnosis, and of another order.
OTHER_MESH = Settings(mesh=MeshSettings(order=3, around_plate=13, growth=0.6, across=0.7))
#: Masses [kg] of which two are read, and voltages [V] that patterns have.
MASSES, VOLTAGES = (10e-3, 15e-3, 20e-3, 25e-3), (2.5e3, 3.5e3, 4.5e3, 5e3)
#: Noise of a deflection [m] and of a slope, smallest and largest.
NOISE, SLOPE_NOISE = (10e-6, 50e-6), (0.05e-3, 0.5e-3)
#: Share of the sets in which slopes are read.
WITH_SLOPES = 0.8
#: Standard deviation of the logarithms of stiffness and permittivity over the stated ones.
FACTOR = 0.1
#: Fewest and most readings of the deflection.
READINGS = (20, 60)
#: Draws after which a size that no film can have is given up.
_TRIES = 100


@dataclass(frozen=True)
class Result:
    """What was hidden in a set, and what was found.

    ``apart``: expected χ² by which its readings differ from the nearest other explanation,
    ``nearest``; ``verdict``, ``named`` and ``suspects`` are those of the diagnosis.
    """

    number: int
    hidden: str
    values: tuple[float, ...]
    readings: int
    slopes: bool
    apart: float
    nearest: str
    verdict: str
    named: tuple[str, ...]
    suspects: tuple[str, ...]
    seconds: float

    @property
    def identifiable(self) -> bool:
        """Whether the readings can show what is hidden, and nothing else."""
        return bool(self.hidden) and self.apart >= SEEN

    @property
    def outcome(self) -> str:
        """The column of the page's table it counts in."""
        if self.named:
            return "right" if self.named == (self.hidden,) else "wrong"
        if not self.hidden:
            return "right" if self.verdict == "nothing" else "alarm"
        if self.verdict == "nothing":
            return "nothing"
        return "among" if self.hidden in self.suspects else "unexplained"


@dataclass(frozen=True)
class Hidden:
    """A drawn set: the cause, its values, loads and noise."""

    cause: Cause | None
    values: tuple[float, ...]
    setup: Setup
    rows: tuple[tuple[float, tuple[float, ...]], ...]
    noise: float
    slope_noise: float
    slopes: bool

    @classmethod
    def drawn(cls, seed: int, number: int) -> tuple[Hidden, np.random.Generator]:
        """Draw a set by its seed and number, with the generator of its noise."""
        random = np.random.default_rng([seed, number])
        setup = Setup((QUARTERS,), Rig())
        name = str(random.choice(HIDDEN))
        cause, values, true = None, (), setup
        if name:
            effect = EFFECTS[name]
            cause = Cause(name, _choice(random, effect.choices(setup)))
            for _ in range(_TRIES):
                sizes = [1.0 if item.switch else float(item.prior.ppf(random.random()))
                         for item in effect.parameters]
                values = tuple(item.value(size) for item, size in zip(
                    effect.parameters, sizes, strict=True))
                try:
                    true = extended(setup, [(name, values, cause.which)])
                    break
                except InputError:
                    continue
        factors = np.exp(FACTOR * random.standard_normal(2)).tolist()
        true = true.with_films(lambda film: with_factors(film, *factors))
        count = int(random.integers(READINGS[0], READINGS[1] + 1))
        masses = random.choice(MASSES, 2, replace=False).tolist()
        rows = [(mass, (0.0, 0.0, 0.0, 0.0)) for mass in masses]
        while len(rows) < count:
            shares = random.choice([0.0, 0.0, 0.6, 1.0], 4)
            if random.random() < 0.5:
                shares = np.eye(4)[random.integers(4)]
            rows += [(mass, tuple((voltage * shares).tolist())) for mass in masses
                     for voltage in random.choice(VOLTAGES, 2, replace=False)]
        noise, slope_noise = (float(np.exp(random.uniform(*np.log(ends))))
                              for ends in (NOISE, SLOPE_NOISE))
        slopes = bool(random.random() < WITH_SLOPES)
        return cls(cause, values, true, tuple(rows[:count]), noise, slope_noise, slopes), random

    def write(self, folder: Path, random: np.random.Generator) -> None:
        """Write the dataset: readings by finite elements, with noise."""
        names = QUARTERS.electrode.names
        titles = ["specimen", "mass_g", *(f"voltage_{name}_kV" for name in names),
                  "displacement_mm"]
        titles += ["tilt_x_mrad", "tilt_y_mrad", "sigma_tilt_mrad"] * self.slopes
        lines = [",".join(titles)]
        for mass, voltages in self.rows:
            deflection, slope = self._read(mass, voltages)
            read = [deflection + self.noise * random.standard_normal()]
            tilts = slope + self.slope_noise * random.standard_normal(2)
            lines.append(",".join([QUARTERS.name, *(f"{1e3 * value:.6g}" for value in (
                mass, *(1e-6 * volts for volts in voltages), *read,
                *([*tilts, self.slope_noise] if self.slopes else [])))]))
        folder.mkdir(exist_ok=True)
        (folder / "static.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        (folder / "quarters.toml").write_text(specimen_to_toml(QUARTERS), encoding="utf-8")
        (folder / "dataset.toml").write_text(
            f'name = "set"\nnoise = "{1e6 * self.noise:.4g} um"\n[[specimen]]\n'
            'file = "quarters.toml"\n', encoding="utf-8")

    def _read(self, mass: float, voltages: Sequence[float]) -> tuple[float, Array]:
        """Compute the deflection [m] and the slopes of the plate."""
        (specimen,), rig = self.setup.specimens, self.setup.rig
        electrode, voltage = specimen.electrode.driven(
            dict(zip(specimen.electrode.names, voltages, strict=True)))
        model = build_model(replace(specimen, electrode=electrode), OTHER_MESH, rig.loading)
        outcome = equilibrium(model, rig.force(mass, model.plate_area), voltage)
        if outcome.status != "equilibrium":
            raise ArithmeticError(f"{mass} kg, {voltages} V: {outcome.status}")
        plate = outcome.state.plate
        return plate.deflection, np.array(plate.slope, float)


def _choice(random: np.random.Generator, choices: Sequence[str | None]) -> str | None:
    return choices[int(random.integers(len(choices)))]


def run(seed: int, number: int) -> Result:
    """Draw a set, print whether it is identifiable, and diagnose it."""
    hidden, random = Hidden.drawn(seed, number)
    begin = time.process_time()
    with TemporaryDirectory() as folder:
        hidden.write(Path(folder) / "set", random)
        dataset = read_dataset(Path(folder) / "set")
    readings, nominal, _ = calibrated_readings(dataset)
    simulation = with_effects(nominal.simulation, lambda done, count: None, 1)
    table, causes = readings.table, readings.causes
    signs = signatures(simulation, table, nominal.fit.unknowns, causes)
    apart, nearest = (inf, "") if hidden.cause is None else _apart(
        simulation, signs, hidden, nominal.fit.unknowns, table)
    print(f"set {number}: {len(table)} rows, expected χ² to {nearest or 'nothing else'} "
          f"{apart:.1f}", flush=True)
    judged = judge(simulation, table, causes)
    return Result(number, str(hidden.cause or ""), hidden.values, len(hidden.rows), hidden.slopes,
                  apart, nearest, judged.verdict, tuple(map(str, judged.named)),
                  tuple(map(str, judged.weighed.suspects)), time.process_time() - begin)


def _apart(simulation: Simulation, signs: Signatures, hidden: Hidden, unknowns: Array, table: Any
           ) -> tuple[float, str]:
    """Compute the expected χ² to the nearest other explanation, and name that.

    A lead is off or it is not: such a cause is fitted as it is. Others may have any size.
    """
    cause = hidden.cause
    assert cause is not None
    moved = np.zeros(FACTORS.stop + len(hidden.values))
    moved[FACTORS] = unknowns[FACTORS]
    moved[SIZES] = [item.size(value) for item, value in zip(
        cause.effect.parameters, hidden.values, strict=True)]
    moved = np.clip(moved, *simulation.bounds((cause,)))
    shown = table.with_values(simulation.predict((cause,), moved, table))
    left = fit(simulation, (), shown, unknowns).residual
    others = {"nothing": float(left @ left)}
    for other, columns in signs.items():
        if other == cause:
            continue
        switches = [item.switch for item in other.effect.parameters]
        others[str(other)] = (
            fit(simulation, (other,), shown, np.r_[unknowns[FACTORS], 1.0]).chi_squared
            if switches == [True]
            else float(np.sum(without(orthonormal(columns), left[:, None]) ** 2)))
    nearest = min(others, key=lambda name: others[name])
    return others[nearest], nearest


def kept(file: Path | None) -> list[Result]:
    """Read results from a file, one JSON line each."""
    lines = file.read_text(encoding="utf-8").splitlines() if file and file.exists() else []
    rows = [json.loads(line) for line in lines]
    return [Result(**{name: tuple(value) if isinstance(value, list) else value
                      for name, value in row.items()}) for row in rows]


#: Columns of the table of outcomes.
_COLUMNS = {"right": "right", "among": "ambiguous, the truth among the causes",
            "nothing": "nothing found", "unexplained": "no name", "alarm": "alarm",
            "wrong": "wrong name"}


def page(results: Sequence[Result], seed: int, sets: int) -> str:
    """Write the page."""
    lines = [
        "# Hidden causes in electrodes with segments", "",
        f"Made by `python -m benchmarks.trials.hidden_segments --seed {seed} --sets {sets}`: "
        f"{len(results)} of {sets} sets were run.", "",
        "Each set hides nothing or one cause in 20 to 60 readings of a film with four quarters. "
        "Cause, place, size, loads, voltages and noise are drawn by the seed, sizes from their "
        "priors. Readings are made by finite elements on another mesh. In some sets the slopes of "
        "the plate were not read.", "",
        f"A cause is identifiable if its readings differ from those of any other explanation by "
        f"an expected χ² of {SEEN:g} or more. This is computed before the verdict.", "",
        "| hidden | sets | " + " | ".join(_COLUMNS.values()) + " |",
        "|---|---|" + "---|" * len(_COLUMNS)]
    groups = [(name or "nothing", [item for item in results
                                   if item.hidden.partition(" of ")[0] == name])
              for name in HIDDEN]
    some = [item for item in results if item.identifiable]
    groups += [("**identifiable**", some),
               ("**not identifiable**", [item for item in results
                                         if item.hidden and not item.identifiable])]
    for name, group in groups:
        counts = Counter(item.outcome for item in group)
        lines.append(f"| {name} | {len(group)} | "
                     + " | ".join(str(counts[key]) for key in _COLUMNS) + " |")
    right = sum(item.outcome == "right" for item in some)
    wrong = sum(item.outcome == "wrong" for item in results)
    lines += ["", f"Named where identifiable: {right} of {len(some)}. Named wrongly: {wrong} of "
                  f"{len(results)}.", "",
              "| set | hidden | values | readings | slopes | expected χ² | to | verdict | named |",
              "|---|---|---|---|---|---|---|---|---|"]
    for item in sorted(results, key=lambda item: item.number):
        values = ", ".join(f"{value:.3g}" for value in item.values)
        far = f"{item.apart:.3g}" if np.isfinite(item.apart) else ""
        lines.append(f"| {item.number} | {item.hidden or 'nothing'} | {values} | {item.readings} | "
                     f"{'yes' if item.slopes else 'no'} | {far} | {item.nearest} | "
                     f"{item.verdict} | {', '.join(item.named)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run the sets and write the page."""
    parser = argparse.ArgumentParser(description="Hide causes in readings of segments.")
    parser.add_argument("--sets", type=int, default=SETS)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--minutes", type=float, default=inf)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("-o", "--output", type=Path)
    asked = parser.parse_args()
    results, end = kept(asked.keep), time.monotonic() + 60 * asked.minutes
    done = {item.number for item in results}
    for number in range(asked.sets):
        if number in done or time.monotonic() >= end:
            continue
        result = run(asked.seed, number)
        print(f"set {number}: {result.hidden or 'nothing'} hidden, {result.verdict}, named "
              f"{', '.join(result.named) or 'none'}, {result.seconds:.0f} s", flush=True)
        results.append(result)
        if asked.keep:
            with asked.keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(result)) + "\n")
    text = page(results, asked.seed, asked.sets)
    if asked.output:
        asked.output.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
