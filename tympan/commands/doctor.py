"""``tympan doctor``: whether this installation can do its work, and what it lacks if not."""

from __future__ import annotations

import argparse
import os
import sys
import time
from typing import Any

from tympan.geometry.errors import Failure
from tympan.options import JSON, command, print_record

#: Distributions that results depend on, or that load system libraries.
PACKAGES = ("numpy", "scipy", "scikit-fem", "meshio", "gmsh", "cadquery", "vtk", "pyvista",
            "matplotlib")
#: Variables that bound the threads of the numerical libraries.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

#: The window that VTK draws in, and whether something can be seen in it; it may end the process.
_DRAW = """
import numpy, pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(16, 16))
plotter.add_mesh(pyvista.Sphere(), color="red")
picture = plotter.screenshot(return_img=True)
print(type(plotter.render_window).__name__ if numpy.ptp(picture) > 100 else "nothing")
"""


@command("doctor", JSON, example="")
def doctor(options: argparse.Namespace) -> None:
    """Versions, system libraries, drawing, threads, and a short self-check of the solver."""
    import platform

    from tympan.geometry.system import missing_packages

    versions = {name: _version(name) for name in PACKAGES}
    record: dict[str, Any] = {
        "tympan": _version("tympan"), "python": platform.python_version(),
        "system": platform.platform(), "packages": versions,
        "missing_libraries": missing_packages(), "processors": len(os.sched_getaffinity(0)),
        "threads": {name: os.environ.get(name) for name in THREADS}}
    record["self_check"] = self_check()
    record["display"] = {"name": os.environ.get("DISPLAY"), "draws_with": drawing_window()}
    wrong = [name for name, fine in (
        ("packages", None not in versions.values()), ("libraries", not record["missing_libraries"]),
        ("self-check", record["self_check"]["passed"]),
        ("drawing", record["display"]["draws_with"] is not None)) if not fine]
    print_record(options, record | {"wrong": wrong})
    if wrong:
        raise Failure(f"not in order: {', '.join(wrong)}")


def self_check() -> dict[str, Any]:
    """Deflections of a round film as the solver finds them, beside those of another method.

    Radii 10 and 45 mm, 1 mm of neo-Hookean film (20 kPa, ε_r 4.7) stretched by √5, 17.9 g; the
    references integrate the membrane's equations along the radius.
    """
    from tympan.fem.film.laws import NeoHooke
    from tympan.fem.rig import Rig
    from tympan.geometry.outlines import Circle
    from tympan.geometry.specimen import Film, Plate, Specimen
    from tympan.studies.case import Case, Settings, solve

    film = Film(1e-3, (5**0.5, 5**0.5), NeoHooke(20e3), 4.7)
    specimen = Specimen("self-check", Circle(45e-3), Plate(Circle(10e-3)), film)
    began, points = time.perf_counter(), []
    for voltage, reference in ((0.0, 2.1185e-3), (3500.0, 2.4307e-3), (7000.0, 4.3843e-3)):
        case = Case(specimen, mass=17.9e-3, voltage=voltage, rig=Rig(gravity=9.81))
        deflection = solve(case, Settings()).deflection_m
        points.append({"voltage_V": voltage, "deflection_m": deflection, "reference_m": reference,
                       "passed": deflection is not None and abs(deflection - reference) < 1e-7})
    return {"points": points, "passed": all(point["passed"] for point in points),
            "wall_s": time.perf_counter() - began}


def drawing_window() -> str | None:
    """The class of window that films are drawn in; None where nothing is drawn."""
    import subprocess

    done = subprocess.run([sys.executable, "-c", _DRAW], capture_output=True, text=True,
                          check=False)
    window = done.stdout.strip().splitlines()[-1:] or ["nothing"]
    return None if done.returncode or window[0] == "nothing" else window[0]


def _version(distribution: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(distribution)
    except PackageNotFoundError:
        return None
