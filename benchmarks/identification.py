"""What readings determine of the lumped model's constants, and what finding them costs.

Printed for docs/lumped.md.

    python -m benchmarks.identification

The paper's actuators with Table 1's constants, ε_r 8.5 and α 0.5; read at rest under both masses at
15 voltages to 7 kV, and after a step to 3.5 kV for 30 s at 1 kHz, with noise of 1 µm. Searches for
ε_r, k₁, η₁, η₂ begin elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tympan.base.arrays import Array
from tympan.geometry.specimen import Specimen
from tympan.paper.table1 import paper_actuators
from tympan.studies.estimation.identifiability import Identifiability
from tympan.studies.identify.dynamic import (
    DynamicProblem,
    Exact,
    identify_dynamic,
    nelder_mead_dynamic,
)
from tympan.studies.identify.responses import ResponseRecord, drive_of
from tympan.studies.identify.static import (
    StaticFit,
    StaticProblem,
    identify_static,
    nelder_mead,
)
from tympan.studies.lumped.actuator import Actuator, Viscous, paper_cones
from tympan.studies.lumped.equilibria import rest
from tympan.studies.lumped.simulate import simulate
from tympan.studies.signals import step

NOISE, MASSES, VOLTAGES, ALPHA = 1e-6, (17.9e-3, 22.45e-3), np.linspace(0, 7e3, 15), (0.5, 0.5)
VISCOUS = Viscous(15e6, 100e6, 100e3)


def readings(specimens: Sequence[Specimen], masses: Sequence[float],
             voltages: Array) -> StaticProblem:
    """At rest, with noise; ε_r of the search's start is 6."""
    rows = [(number, mass, volts, rest(Actuator.of(specimen, mass, ALPHA), float(volts)))
            for number, specimen in enumerate(specimens) for mass in masses for volts in voltages]
    which, mass, volts, y = np.array(rows).T
    unknown = tuple(
        replace(specimen, membrane=replace(specimen.membrane, relative_permittivity=6.0))
        for specimen in specimens)
    noise = NOISE * np.random.default_rng(1).standard_normal(len(y))
    return StaticProblem(paper_cones(unknown), which.astype(int), mass, volts, y + noise, NOISE)


def record(specimens: Sequence[Specimen], number: int, mass: float, end: float,
           interval: float) -> ResponseRecord:
    """A step half a second after the start, a third of an interval before its first sample."""
    actuator = Actuator.of(specimens[number], mass, ALPHA, VISCOUS)
    time = np.arange(0.0, end + interval / 2, interval)
    seen = float(time[np.searchsorted(time, 0.5 - 1e-9)])
    signal = step(0.0, 3.5e3, seen - interval / 3, end)
    noise = NOISE * np.random.default_rng([number, round(1e6 * mass)]).standard_normal(len(time))
    read = simulate(actuator, signal).deflection(time) + noise
    return ResponseRecord(number, mass, "1", time, read,
                  drive_of(time, np.where(time >= seen - 1e-9, 3.5e3, 0.0)), interval,
                  float(read[0]))


def show(words: str, judgement: Identifiability) -> None:
    """One line: every constant with its limits, in per cent of its value."""
    limits = [f"{constant.name} " + ("-" if constant.low is None or constant.high is None else
                                     f"{100 * (constant.low / constant.value - 1):+.2f}/"
                                     f"{100 * (constant.high / constant.value - 1):+.2f} %")
              for constant in judgement.constants if constant.name[:4] not in ("beta", "gamm")]
    print(f"{words:<42} {', '.join(limits)}; {judgement.determined} of {len(judgement.constants)}")


def statics(specimens: Sequence[Specimen]) -> StaticFit:
    """Readings at rest: what of the constants they determine, by how much is read."""
    print("at rest")
    fits = {}
    for words, masses, voltages in (("both masses, to 7 kV", MASSES, VOLTAGES),
                                    ("17.9 g, to 3.5 kV", MASSES[:1], VOLTAGES[:8])):
        fit = fits[words] = identify_static(readings(specimens, masses, voltages))
        y = fit.problem.read
        show(f"{words}, λ 1{1e3 * (np.hypot(1, y.min() / 35e-3) - 1):+.1f} to "
             f"{1e3 * (np.hypot(1, y.max() / 35e-3) - 1):+.1f} ‰", fit.judgement)
        print("   half 95 % widths of the combinations:",
              " ".join(f"{1.96 * combination.deviation:.2g}"
                       for combination in fit.judgement.combinations))
    fit = fits["both masses, to 7 kV"]
    print("   correlations among β, γ at least",
          f"{np.abs(fit.judgement.correlations[:6, :6]).min():.3f}")
    for number in (0, 4):
        print("   combination", {constant.name: round(weight, 2) for constant, weight in
                                 zip(fit.judgement.constants,
                                     fit.judgement.combinations[number].coefficients,
                                     strict=True)})
    other = nelder_mead(fit.problem)
    bare = identify_static(fit.problem, profiles=False)
    print(f"   least squares {bare.evaluations} evaluations, {bare.seconds:.2f} s, "
          f"misfit {1e6 * bare.rmse:.3f} µm; "
          f"Nelder-Mead {other['evaluations']}, {other['seconds']:.1f} s, "
          f"{other['rmse_um']:.3f} µm")
    return fit


def responses(specimens: Sequence[Specimen], static_fit: StaticFit) -> None:
    """What responses tell of the viscous constants, by how long and how often they are read."""
    print("after a step")
    exact = Exact(paper_cones(specimens, ALPHA))

    def problem(end: float, interval: float, at_rest: StaticFit | Exact) -> DynamicProblem:
        return DynamicProblem(at_rest,
                              tuple(record(specimens, number, mass, end, interval)
                                    for number in range(3) for mass in MASSES), NOISE)

    whole = problem(30.0, 1e-3, static_fit)
    fit = identify_dynamic(whole)
    show("six of 30 s at 1 kHz, statics fitted", fit.judgement)
    print(f"   with profiles {fit.seconds:.1f} s, "
          f"{sum(curve.evaluations for curve in fit.judgement.profiles if curve is not None)} "
          "evaluations for them")
    bare = identify_dynamic(replace(whole), profiles=False)
    other = nelder_mead_dynamic(replace(whole))
    print(f"   least squares {bare.evaluations} evaluations, {bare.seconds:.1f} s, "
          f"misfit {1e6 * bare.rmse:.4f} µm; "
          f"Nelder-Mead, statics held, {other['evaluations']}, {other['seconds']:.1f} s, "
          f"{other['rmse_um']:.4f} µm")
    print("   off the truth:",
          *(f"{name} {100 * (fitted / true - 1):+.3f} % and {100 * (simple / true - 1):+.3f} %,"
                                 for name, fitted, simple, true in
                                 zip(other["values"], vars(bare.viscous).values(),
                                     other["values"].values(),
                                     vars(VISCOUS).values(), strict=True)))
    for words, end, interval, rests in (("the same, statics exact", 30.0, 1e-3, exact),
                                        ("2 s at 1 kHz, statics exact", 2.5, 1e-3, exact),
                                        ("50 ms at 1 kHz, statics exact", 0.55, 1e-3, exact),
                                        ("30 s at 5 Hz, statics exact", 30.0, 0.2, exact)):
        show(words, identify_dynamic(problem(end, interval, rests)).judgement)


def main() -> None:
    """Print it all."""
    specimens = paper_actuators(8.5)
    responses(specimens, statics(specimens))


if __name__ == "__main__":
    main()
