"""What a gradient costs beside the solve that precedes it.

python -m benchmarks.gradient [--repeat 7]

The solve is that of 17.9 g and 3.5 kV from the mounted state, mesh and its tables at hand; a step
is one from there to 3.6 kV. Both and the gradients are repeated in turn, so that whatever else the
machine does falls on all alike; medians count. The first gradient by a length on a mesh makes
tables that later ones reuse, and finds how the nodes follow that length; it is shown beside them.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from statistics import median

from tympan.fem.derivatives.quantities import FUNCTIONALS
from tympan.fem.derivatives.sensitivity import gradient, parameters, shape_names
from tympan.fem.derivatives.shape import lengthened
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.case import Settings, build_model

FORCE, VOLTAGE, FURTHER = 17.9e-3 * 9.80665, 3.5e3, 3.6e3

CIRCLE = Specimen("circle a quarter", Circle(45e-3), Plate(Circle(10e-3)),
                  Film(1e-3, (5**0.5, 5**0.5), Ogden((25e3,), (2.0,)), 4.7))
ELLIPSE = replace(CIRCLE, name="plate off centre", frame=Ellipse((75e-3, 45e-3)),
                  plate=Plate(Circle(10e-3), (10e-3, 5e-3)))


def cases() -> dict[str, Model]:
    """Models from a few hundred unknowns on."""
    coarse, fine = Settings(), Settings(MeshSettings().refined(2))
    return {"circle a quarter": build_model(CIRCLE, coarse),
            "off centre": build_model(ELLIPSE, coarse),
            "off centre, refined": build_model(ELLIPSE, fine)}


def seconds(work: Callable[[], object]) -> float:
    """How long the work takes."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def anew(model: Model, state: State) -> Model:
    """The model with nothing kept of its mesh but for solves, as before the first gradient."""
    lengthened.cache_clear()
    fresh = replace(model, discretisation=replace(model.discretisation))
    fresh.linearised(state)
    fresh.thinning_margin(state)
    return fresh


def rows(model: Model, repeat: int) -> dict[str, float]:
    """Median seconds of solve, step and gradients."""
    outcome = equilibrium(model, FORCE, VOLTAGE)
    by_name = parameters(model)
    lengths = shape_names(model.specimen)
    fixed = [name for name in by_name if name not in lengths]

    def slopes(film: Model, names: Sequence[str]) -> dict[str, float]:
        return gradient(film, outcome, FUNCTIONALS["heave"], names)

    def first(names: Sequence[str]) -> Callable[[], object]:
        film = anew(model, outcome.state)
        return lambda: slopes(film, names)

    works: dict[str, Callable[[], object]] = {
        "solve": lambda: equilibrium(model, FORCE, VOLTAGE),
        "step": lambda: equilibrium(model, FORCE, FURTHER, start=outcome.solution),
        "gradient by thickness": lambda: slopes(model, ["membrane.thickness"]),
        "gradient by one length": lambda: slopes(model, lengths[:1]),
        f"gradient by {len(fixed)}, no lengths": lambda: slopes(model, fixed),
        f"gradient by all {len(by_name)}": lambda: slopes(model, list(by_name))}
    firsts = {"first by one length": lengths[:1], "first by all": list(by_name)}
    times = [{name: seconds(work) for name, work in works.items()}
             | {name: seconds(first(names)) for name, names in firsts.items()}
             for _ in range(repeat)]
    return {name: median(each[name] for each in times) for name in times[0]}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=7,
                        help="rounds; medians count (default: %(default)s)")
    repeat = parser.parse_args().repeat
    for name, model in cases().items():
        times = rows(model, repeat)
        print(f"{name}, {model.unknowns:,} unknowns")
        for label, value in times.items():
            print(f"  {label:<26} {1e3 * value:8.1f} ms  {value / times['solve']:7.1%} of the solve"
                  f"  {value / times['step']:7.1%} of the step")


if __name__ == "__main__":
    main()
