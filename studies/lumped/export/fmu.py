"""FMU 2.0 for model exchange and co-simulation, from C: source, description, library.

``write_fmu`` is for any C code; ``export_fmu`` exports a lumped model.
"""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from string import Template
from xml.etree import ElementTree as Xml

from tympan.base.errors import Failure, InputError
from tympan.base.process.folder import temporary_folder
from tympan.studies.files import write_atomically
from tympan.studies.lumped.export.c_source import export_c
from tympan.studies.lumped.model_file import LumpedModel

#: File endings of a shared library, by system.
_SUFFIX = {"linux": "so", "darwin": "dylib", "win32": "dll"}
#: Folders of a shared library within an FMU, by system: the standard's names.
_FOLDER = {"linux": "linux64", "darwin": "darwin64", "win32": "win64"}


@dataclass(frozen=True)
class Variable:
    """A real variable of an FMU; its value reference is its index among the variables.

    ``state``: for a derivative, the index of its state.
    """

    name: str
    causality: str
    variability: str = "continuous"
    start: float | None = None
    initial: str | None = None
    state: int | None = None

    def add_to(self, parent: Xml.Element, reference: int) -> None:
        """Write the variable into ModelVariables."""
        attributes = {"name": self.name, "valueReference": str(reference),
                      "causality": self.causality, "variability": self.variability}
        if self.initial is not None:
            attributes["initial"] = self.initial
        real = {} if self.start is None else {"start": repr(self.start)}
        if self.state is not None:
            real["derivative"] = str(self.state + 1)
        Xml.SubElement(Xml.SubElement(parent, "ScalarVariable", attributes), "Real", real)


def write_fmu(file: Path, name: str, sources: Mapping[str, str], part: str,
              variables: Sequence[Variable], identity: str, step: float | None = None) -> None:
    """Write an FMU, compiled for this system.

    ``sources`` holds C code by file name; files that end in .c are included. ``part`` is the C code
    of the functions that differ from FMU to FMU. ``identity`` is a text that determines the GUID:
    the same text gives the same GUID, so that results can be compared. ``step`` is a suitable time
    between communications [s].

    Raises
    ------
    Failure
        Where there is no C compiler ``cc`` or it fails.
    """
    guid = str(uuid.uuid5(uuid.NAMESPACE_OID, identity))
    template = resources.files("tympan.studies.lumped.export").joinpath("fmi.txt")
    includes = "\n".join(f'#include "{each}"' for each in sources if each.endswith(".c"))
    wrapper = Template(template.read_text(encoding="utf-8")).substitute(
        includes=includes, part=part, guid=guid)
    sources = {**sources, f"{name}_fmu.c": wrapper}
    with temporary_folder() as work:
        for each, text in sources.items():
            (work / each).write_text(text, encoding="utf-8")
        library = _compiled(work / f"{name}_fmu.c", work / f"{name}.{_SUFFIX[sys.platform]}")
        members = {f"sources/{each}": (work / each).read_bytes() for each in sources}
        members[f"binaries/{_FOLDER[sys.platform]}/{library.name}"] = library.read_bytes()
    members["modelDescription.xml"] = _description(name, guid, variables, step)
    write_atomically(file, lambda path: _zip(path, members))


def export_fmu(model: LumpedModel, folder: Path, mass: float) -> Path:
    """Write ``NAME.fmu``, compiled for this system, with a parameter: the mass [kg] on its plate.

    Raises
    ------
    Failure
        Where there is no C compiler ``cc`` or it fails, or no series follows the film.
    """
    if not 1e-6 <= mass <= 100:
        raise InputError("must be from 1 mg to 100 kg", key="--mass", given=f"{mass:g} kg")
    with temporary_folder() as work:
        header, source = export_c(model, work)
        sources = {each.name: each.read_text(encoding="utf-8") for each in (header, source)}
    title, states = header.stem, ["y", "speed", *(f"strain[{circle + 1}]"
                                                  for circle in range(len(model.radii)))]
    part = in_steps("tympan.studies.lumped.export", "fmu.txt", name=title, prefix=title.upper(),
                    mass=repr(mass))
    file = folder / f"{title}.fmu"
    # The value references are those of the C code.
    write_fmu(file, title, sources, part, (
        *(Variable(state, "local", initial="exact", start=0) for state in states),
        *(Variable(f"der({state})", "local", state=number)
          for number, state in enumerate(states)),
        Variable("mass", "parameter", "fixed", start=mass),
        Variable("voltage", "input", start=0),
        Variable("deflection", "output"),
        Variable("capacitance", "output"),
        Variable("measured_capacitance", "input", start=0),
        Variable("sensed_deflection", "output")),
        identity=f"{sources[source.name]}{mass!r}")
    return file


def in_steps(package: str, file: str, **words: str) -> str:
    """Fill in the C code of a model with states, and add its steps of co-simulation.

    The code defines STATES, ``Model``, ``nominal`` and RATES(model, x, rates).
    """
    own = resources.files(package).joinpath(file).read_text(encoding="utf-8")
    steps = resources.files("tympan.studies.lumped.export").joinpath("fmu_steps.txt")
    return Template(own).substitute(words) + steps.read_text(encoding="utf-8")


def require_compiler() -> str:
    """Find the C compiler; without a compiler there is a Failure."""
    compiler = shutil.which("cc")
    if compiler is None or sys.platform not in _SUFFIX or platform.architecture()[0] != "64bit":
        raise Failure("an FMU needs a C compiler, cc, on a 64-bit system")
    return compiler


def _zip(file: Path, members: dict[str, bytes]) -> None:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def _compiled(source: Path, library: Path) -> Path:
    done = subprocess.run([require_compiler(), "-std=c99", "-O2", "-shared", "-fPIC", str(source),
                           "-o", str(library), "-lm"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise Failure(f"the C compiler fails: {done.stderr.strip()[-300:]}")
    return library


def _description(name: str, guid: str, variables: Sequence[Variable], step: float | None) -> bytes:
    """Write modelDescription.xml; every output and derivative may depend on everything."""
    root = Xml.Element("fmiModelDescription", fmiVersion="2.0", modelName=name, guid=guid,
                       generationTool="tympan", numberOfEventIndicators="0",
                       variableNamingConvention="structured")
    for use in ("ModelExchange", "CoSimulation"):
        itself = Xml.SubElement(root, use, modelIdentifier=name)
        Xml.SubElement(Xml.SubElement(itself, "SourceFiles"), "File", name=f"{name}_fmu.c")
    itself.set("canHandleVariableCommunicationStepSize", "true")
    if step is not None:
        Xml.SubElement(root, "DefaultExperiment", stepSize=repr(step))
    listed = Xml.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        variable.add_to(listed, reference)
    derivatives = [number for number, each in enumerate(variables, 1) if each.state is not None]
    outputs = [number for number, each in enumerate(variables, 1) if each.causality == "output"]
    structure = Xml.SubElement(root, "ModelStructure")
    for part, numbers in (("Outputs", outputs), ("Derivatives", derivatives),
                          ("InitialUnknowns", [*derivatives, *outputs])):
        within = Xml.SubElement(structure, part) if numbers else structure
        for number in numbers:
            Xml.SubElement(within, "Unknown", index=str(number))
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root)
