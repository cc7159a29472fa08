"""A controller as FMU 2.0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    measured, reading = "measured_deflection", "model->value[1]"
    if sensed is not None:
        sources[f"{name}_sensed.c"] = sensed.c_source(title)
        measured = "measured_capacitance"
        reading = f"{name}_sensed_deflection(model->value[1], 0.0)"
    write_sampled_fmu(
        folder / f"{title}-control.fmu", f"{name}_controller", sources, call=f"""\
    const double reading = {reading};
    if (model->samples == 0)
        {name}_controller_rest(&model->controller, reading);
    model->value[GIVEN] = {name}_controller_voltage(&model->controller, model->value[0], reading);\
""", inputs=("wanted_deflection", measured), outputs=("voltage",), interval=controller.interval_s)


def write_sampled_fmu(file: Path, name: str, sources: Mapping[str, str], call: str,
                      inputs: Sequence[str], outputs: Sequence[str], interval: float) -> None:
    """Write an FMU of a controller that is sampled at an interval [s].

    ``sources`` hold C by file name, with the type ``name`` of its memory. ``call`` is the C of a
    sample: from ``model->value`` of the inputs to those of the outputs, from GIVEN on.
    """
    template = resources.files("tympan.studies.lumped.control").joinpath("fmu.txt")
    part = Template(template.read_text(encoding="utf-8")).substitute(
        type=name, call=call, interval=repr(interval), inputs=len(inputs), outputs=len(outputs))
    # The value references are those of the C code.
    variables = (*(Variable(each, "input", start=0) for each in inputs),
                 *(Variable(each, "output", "discrete") for each in outputs))
    write_fmu(file, name, sources, part, variables, identity="".join(sources.values()),
              step=interval)
