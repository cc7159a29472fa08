"""A steered model and its controller as C99, and as FMU 2.0 with an input for each segment."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from tympan.studies.files import write_text
from tympan.studies.lumped.control.fmu import write_sampled_fmu
from tympan.studies.lumped.export.c_source import identifier
from tympan.studies.lumped.export.fmu import Variable, in_steps, write_fmu
from tympan.studies.lumped.steered.law import SteeredLaw
from tympan.studies.lumped.steered.model import STEERED, SteeredModel


def c_source(model: SteeredModel) -> str:
    """Write the model as C99 functions, named after its specimen."""
    template = resources.files("tympan.studies.lumped.steered").joinpath("source.txt")
    name = identifier(model.specimen.name)
    return Template(template.read_text(encoding="utf-8")).substitute(
        title=model.specimen.name, name=name, prefix=name.upper(), states=model.size,
        inputs=len(model.segments), freedoms=model.count, branches=len(model.times),
        terms=len(model.powers), highest=int(model.powers.max()), outputs=len(STEERED),
        states_words=", ".join(model.states), segments_words=", ".join(model.segments),
        supply=f"{model.supply:g}", centre=_numbers(model.centre), scale=_numbers(model.scale),
        powers=", ".join(map(str, model.powers.ravel().tolist())),
        elastic=_numbers(model.elastic), electric=_numbers(model.electric),
        load=_numbers(model.force * (np.arange(model.count) == 0)),
        inverse_mass=_numbers(np.linalg.inv(model.mass)), damping=_numbers(model.damping),
        times=_numbers(model.times), springs=_numbers(model.springs))


def export_c(model: SteeredModel, folder: Path) -> Path:
    """Write ``NAME-steered.c``; return the file."""
    file = folder / f"{model.specimen.name}-steered.c"
    write_text(file, c_source(model))
    return file


def export_fmu(model: SteeredModel, folder: Path) -> Path:
    """Write ``NAME-steered.fmu``, compiled for this system; it begins at rest without voltage.

    Inputs are voltage[1], voltage[2], …, in the order of the segments.

    Raises
    ------
    Failure
        Where there is no C compiler ``cc`` or it fails.
    """
    name, source = identifier(model.specimen.name), c_source(model)
    rest = model.resting(np.zeros(len(model.segments)))
    part = in_steps("tympan.studies.lumped.steered", "fmu.txt", name=name, prefix=name.upper(),
                    outputs=str(len(STEERED)), rest=_numbers(rest))
    inputs = range(1, len(model.segments) + 1)
    file = folder / f"{model.specimen.name}-steered.fmu"
    # The value references are those of the C code.
    write_fmu(file, f"{name}_steered", {f"{name}.c": source}, part, (
        *(Variable(f"state.{state}", "local", initial="exact", start=float(value))
          for state, value in zip(model.states, rest, strict=True)),
        *(Variable(f"der(state.{state})", "local", state=number)
          for number, state in enumerate(model.states)),
        *(Variable(f"voltage[{number}]", "input", start=0) for number in inputs),
        *(Variable(name, "output") for name in STEERED),
        *(Variable(f"capacitance[{number}]", "output") for number in inputs)),
        identity=source)
    return file


def steering_source(law: SteeredLaw, model: SteeredModel) -> str:
    """Write a model's controller as C99 functions, named after its specimen."""
    template = resources.files("tympan.studies.lumped.steered").joinpath("steering.txt")
    name, inverse = identifier(model.specimen.name), law.inverse
    parts = dict(zip(("a", "b", "c", "d", "g", "rest"), map(_numbers, law.parts), strict=True))
    return Template(template.read_text(encoding="utf-8")).substitute(
        parts, title=model.specimen.name, name=name, prefix=name.upper(),
        interval=f"{law.interval:g}", places=len(inverse.centre), segments=len(model.segments),
        places_words=", ".join(STEERED), segments_words=", ".join(model.segments),
        size=len(law.parts[0]), terms=len(inverse.powers), highest=int(inverse.powers.max()),
        centre=_numbers(inverse.centre), scale=_numbers(inverse.scale),
        powers=", ".join(map(str, inverse.powers.ravel().tolist())),
        coefficients=_numbers(inverse.coefficients), slopes=_numbers(law.slopes),
        supply=repr(float(inverse.supply)))


def export_steering_fmu(law: SteeredLaw, model: SteeredModel, folder: Path) -> Path:
    """Write ``NAME-steering.fmu``: wanted[…] and measured[…] are inputs, voltage[…] outputs.

    ``wanted`` are the places wanted a sample later. It begins at rest at the measured places.

    Raises
    ------
    Failure
        Where there is no C compiler ``cc`` or it fails.
    """
    title, name = model.specimen.name, f"{identifier(model.specimen.name)}_steering"
    places = range(1, len(law.inverse.centre) + 1)
    file = folder / f"{title}-steering.fmu"
    read = f"model->value + {len(places)}"
    write_sampled_fmu(file, name, {f"{name}.c": steering_source(law, model)}, call=f"""\
    if (model->samples == 0)
        {name}_rest(&model->controller, model->value, {read});
    {name}_voltages(&model->controller, model->value, {read}, model->value + GIVEN);\
""", inputs=[f"{word}[{number}]" for word in ("wanted", "measured") for number in places],
        outputs=[f"voltage[{number}]" for number in range(1, len(model.segments) + 1)],
        interval=law.interval)
    return file


@dataclass(frozen=True, eq=False)
class Exported:
    """Model and controller that a result writes as C99 and FMU."""

    model: SteeredModel
    law: SteeredLaw

    def save(self, folder: Path, fmu: bool = False) -> None:
        """Write ``NAME-steered.c`` and ``NAME-steering.c``; with ``fmu`` also both as FMU."""
        export_c(self.model, folder)
        write_text(folder / f"{self.model.specimen.name}-steering.c",
                   steering_source(self.law, self.model))
        if fmu:
            export_fmu(self.model, folder)
            export_steering_fmu(self.law, self.model, folder)


def _numbers(values: Iterable[Any]) -> str:
    return ", ".join(repr(float(value)) for value in np.ravel(np.asarray(values)))
