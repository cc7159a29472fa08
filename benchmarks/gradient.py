"""What a gradient costs beside the solve that precedes it.

python -m benchmarks.gradient [--repeat 5]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import TypeVar

from benchmarks.scaling_case import FORCE, VOLTAGE, film_model
from fem.paths import equilibrium
from fem.sensitivity import heave_gradient, parameters

T = TypeVar("T")


def fastest(work: Callable[[], T], repeat: int) -> tuple[T, float]:
    """What the work returns, and the least seconds it took."""
    seconds = []
    for _ in range(repeat):
        began = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - began)
    return result, min(seconds)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=5, help="runs; the fastest counts")
    repeat = parser.parse_args().repeat
    for size in (2_500, 25_000):
        model = film_model(4, size)
        outcome, solve = fastest(lambda m=model: equilibrium(m, FORCE, VOLTAGE), repeat)
        names = parameters(model.specimen)
        for chosen in (names[:1], names):
            _, gradient = fastest(lambda m=model, s=outcome.state, n=chosen: heave_gradient(m, s, n), repeat)
            words = f"{len(chosen)} parameter{'s' if len(chosen) > 1 else ''}"
            print(f"{model.unknowns:>7,} unknowns   solve {solve * 1e3:8.1f} ms   "
                  f"gradient by {words:<13} {gradient * 1e3:8.1f} ms   {gradient / solve:6.1%} of the solve")


if __name__ == "__main__":
    main()
