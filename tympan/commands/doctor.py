"""``tympan doctor``: check of this installation, and of what it lacks."""

from __future__ import annotations

import argparse
import os
import sys
import time
from typing import Any

from tympan.base.errors import Failure
from tympan.base.extras import EXTRAS, version_of
from tympan.options import JSON, command, print_record

#: Distributions that results depend on, or that load system libraries.
PACKAGES = ("numpy", "scipy", "scikit-fem", "meshio", "gmsh", "vtk", "pyvista", "matplotlib")
#: Script that names the window that VTK draws in and checks its picture; it may end the process.
_DRAW = """
import numpy, pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(16, 16))
plotter.add_mesh(pyvista.Sphere(), color="red")
picture = plotter.screenshot(return_img=True)
print(type(plotter.render_window).__name__ if numpy.ptp(picture) > 100 else "nothing")
"""

#: User script that counts threads of the numerical libraries outside of tympan, and within.
_COUNT = """
import json, numpy, scipy.linalg
from tympan.base.process.threads import blas_threads, one_thread
outside = blas_threads()
with one_thread():
    within = blas_threads()
print(json.dumps({name: {"own_code": outside[name], "tympan": within[name]} for name in within}))
"""


@command("doctor", JSON, example="")
def doctor(options: argparse.Namespace) -> None:
    """Check versions, system libraries, drawing and threads, and run a short test of the solver."""
    import platform

    from tympan.base.process.threads import outer_environment
    from tympan.base.system import missing_packages

    versions = {name: version_of(name) for name in PACKAGES}
    record: dict[str, Any] = {
        "tympan": version_of("tympan"), "python": platform.python_version(),
        "system": platform.platform(), "packages": versions,
        "extras": {name: version_of(extra.package) for name, extra in EXTRAS.items()},
        "missing_libraries": missing_packages(), "processors": len(os.sched_getaffinity(0)),
        "threads": {"variables": outer_environment(), "libraries": python_threads()}}
    record["self_check"] = self_check()
    record["display"] = {"name": os.environ.get("DISPLAY"), "draws_with": drawing_window()}
    wrong = [name for name, fine in (
        ("packages", None not in versions.values()), ("libraries", not record["missing_libraries"]),
        ("threads", all(counts["tympan"] == 1
                        for counts in record["threads"]["libraries"].values())),
        ("self-check", record["self_check"]["passed"]),
        ("drawing", record["display"]["draws_with"] is not None)) if not fine]
    print_record(options, record | {"wrong": wrong}, extras=EXTRAS)
    if wrong:
        raise Failure(f"not in order: {', '.join(wrong)}")


def self_check() -> dict[str, Any]:
    """Solve deflections of a round film, and list those of another method with them.

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


def python_threads() -> dict[str, dict[str, int]]:
    """Count threads of NumPy's and SciPy's dense algebra in a script: its own, and tympan's.

    Libraries whose threads cannot be counted are left out.
    """
    import json
    import subprocess

    from tympan.base.process.threads import outer_environment

    caller = {name: value for name, value in outer_environment().items() if value is not None}
    rest = {name: value for name, value in os.environ.items() if name not in outer_environment()}
    done = subprocess.run([sys.executable, "-c", _COUNT], capture_output=True, text=True,
                          check=False, env=rest | caller | {
                              "PYTHONPATH": os.pathsep.join(filter(None, sys.path))})
    counts: dict[str, dict[str, int]] = {} if done.returncode else json.loads(done.stdout)
    return counts


def drawing_window() -> str | None:
    """Find the class of window that films are drawn in; None where nothing is drawn."""
    import subprocess

    done = subprocess.run([sys.executable, "-c", _DRAW], capture_output=True, text=True,
                          check=False)
    window = done.stdout.strip().splitlines()[-1:] or ["nothing"]
    return None if done.returncode or window[0] == "nothing" else window[0]
