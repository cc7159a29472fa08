"""Which large effects readings cannot show: the draws of "effects of any size", without diagnoses.

    python -m benchmarks.trials.large_effects [--trials 280]

An effect shows if the baseline model, with stiffness and permittivity fitted, misses the readings
without noise by a χ² of 25 or more. A line for each band of sizes and for each effect; some 15
minutes of one core.
"""

from __future__ import annotations

import argparse
from collections import Counter
from itertools import pairwise

import numpy as np

from benchmarks.trials.rates.sizes import BANDS
from benchmarks.trials.synthetic_trials import hidden
from benchmarks.trials.trial import ALIASES, POPULATIONS, SIZES_DRAWN, Lab, measured
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.inference.identifiability import SEEN

#: Typical sizes from which on an effect is large.
LARGE = 5.0


def shown(lab: Lab, number: int) -> tuple[str, float, bool]:
    """The effect of a trial, its size over the typical one, and whether readings show it."""
    generator = np.random.default_rng([lab.seed, list(POPULATIONS).index("large"), number])
    design, simulation, means = lab.by(number)
    causes = [cause for cause in design.causes if cause.name not in ALIASES]
    hypothesis = (causes[int(generator.integers(len(causes)))],)
    truth, values, _ = hidden(design, generator, hypothesis, means, widths=SIZES_DRAWN)
    missed = fit(simulation, (), measured(design, values, None, number), np.zeros(2))
    return hypothesis[0].name, truth.widths[0], missed.chi_squared >= SEEN


def main() -> None:
    """Draw the trials and print what shows."""
    parser = argparse.ArgumentParser(description="Which large effects readings cannot show.")
    parser.add_argument("--trials", type=int, default=280)
    lab = Lab(2026)
    trials = [shown(lab, number) for number in range(parser.parse_args().trials)]
    for low, high in pairwise(BANDS):
        band = [there for _, size, there in trials if low <= size < high]
        print(f"{low:g} to {high:g} typical sizes: {sum(band)} of {len(band)} show")
    large = [(name, there) for name, size, there in trials if size >= LARGE]
    every, there = Counter(name for name, _ in large), Counter(name for name, seen in large if seen)
    for name, count in every.most_common():
        print(f"{name}: {there[name]} of {count} of {LARGE:g} typical sizes or more show")


if __name__ == "__main__":
    main()
