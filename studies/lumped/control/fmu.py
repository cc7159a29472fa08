"""A controller as FMU 2.0."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from string import Template

from tympan.studies.lumped.control.controller import Controller
from tympan.studies.lumped.export.c_source import identifier
from tympan.studies.lumped.export.fmu import Variable, write_fmu
from tympan.studies.sense.inverse import Inverse


def write_controller_fmu(folder: Path, title: str, controller: Controller,
                         sensed: Inverse | None) -> None:
    """Write ``TITLE-control.fmu``; where capacitance is ``sensed``, it computes the deflection.

    Raises
    ------
    Failure
        Where there is no C compiler ``cc`` or it fails.
    """
    name = identifier(title)
    sources = {f"{name}_controller.c": controller.c_source(title)}
    measured, reading = "measured_deflection", "model->read"
    if sensed is not None:
        sources[f"{name}_sensed.c"] = sensed.c_source(title)
        measured, reading = "measured_capacitance", f"{name}_sensed_deflection(model->read, 0.0)"
    template = resources.files("tympan.studies.lumped.control").joinpath("fmu.txt")
    part = Template(template.read_text(encoding="utf-8")).substitute(
        name=name, interval=repr(controller.interval_s), reading=reading)
    # The value references are those of the C code.
    variables = (Variable("wanted_deflection", "input", start=0),
                 Variable(measured, "input", start=0),
                 Variable("voltage", "output", "discrete"))
    write_fmu(folder / f"{title}-control.fmu", f"{name}_controller", sources, part, variables,
              identity="".join(sources.values()), step=controller.interval_s)
