"""A lumped model as FMU 2.0, for model exchange and co-simulation: source, description, library."""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import uuid
import zipfile
from importlib import resources
from pathlib import Path
from string import Template
from xml.etree import ElementTree as Xml

from tympan.geometry.errors import Failure, InputError
from tympan.geometry.process.folder import temporary_folder
from tympan.studies.files import write_atomically
from tympan.studies.lumped.export.c_source import export_c
from tympan.studies.lumped.model_file import LumpedModel

_SUFFIX = {"linux": "so", "darwin": "dylib", "win32": "dll"}
_FOLDER = {"linux": "linux64", "darwin": "darwin64", "win32": "win64"}


def export_fmu(model: LumpedModel, folder: Path, mass: float) -> Path:
    """Write ``NAME.fmu`` with a mass [kg], a parameter, on its plate; compiled for this system.

    Raises
    ------
    Failure
        Where there is no C compiler ``cc`` or it fails, or no series follows the film.
    """
    if not 1e-6 <= mass <= 100:
        raise InputError("must be from 1 mg to 100 kg", key="--mass", given=f"{mass:g} kg")
    with temporary_folder() as work:
        header, source = export_c(model, work)
        title, states = header.stem, 2 + len(model.radii)
        # The same model has the same name: results can be compared.
        guid = str(uuid.uuid5(uuid.NAMESPACE_OID, f"{source.read_text(encoding='utf-8')}{mass!r}"))
        template = resources.files("tympan.studies.lumped.export").joinpath("fmu.txt")
        wrapper = work / f"{title}_fmu.c"
        wrapper.write_text(Template(template.read_text(encoding="utf-8")).substitute(
            name=title, prefix=title.upper(), guid=guid, mass=repr(mass)), encoding="utf-8")
        library = _compiled(wrapper, work / f"{title}.{_SUFFIX[sys.platform]}")
        members = {f"sources/{file.name}": file.read_bytes() for file in (header, source, wrapper)}
        members[f"binaries/{_FOLDER[sys.platform]}/{library.name}"] = library.read_bytes()
        members["modelDescription.xml"] = _description(title, guid, mass, states)
    file = folder / f"{title}.fmu"
    write_atomically(file, lambda path: _zip(path, members))
    return file


def _zip(file: Path, members: dict[str, bytes]) -> None:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def _compiled(source: Path, library: Path) -> Path:
    compiler = shutil.which("cc")
    if compiler is None or sys.platform not in _SUFFIX or platform.architecture()[0] != "64bit":
        raise Failure("an FMU needs a C compiler, cc, on a 64-bit system")
    done = subprocess.run([compiler, "-std=c99", "-O2", "-shared", "-fPIC", str(source), "-o",
                           str(library), "-lm"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise Failure(f"the C compiler fails: {done.stderr.strip()[-300:]}")
    return library


def _description(name: str, guid: str, mass: float, states: int) -> bytes:
    """modelDescription.xml; value references as in the C source."""
    root = Xml.Element("fmiModelDescription", fmiVersion="2.0", modelName=name, guid=guid,
                       generationTool="tympan", numberOfEventIndicators="0",
                       variableNamingConvention="structured")
    for use in ("ModelExchange", "CoSimulation"):
        itself = Xml.SubElement(root, use, modelIdentifier=name)
        Xml.SubElement(Xml.SubElement(itself, "SourceFiles"), "File", name=f"{name}_fmu.c")
    itself.set("canHandleVariableCommunicationStepSize", "true")
    variables = Xml.SubElement(root, "ModelVariables")
    state_names = ["y", "speed", *(f"strain[{circle}]" for circle in range(1, states - 1))]
    for number, state in enumerate(state_names):
        _variable(variables, state, number, "local", initial="exact", start="0")
    for number, state in enumerate(state_names, start=states):
        _variable(variables, f"der({state})", number, "local", derivative=str(number - states + 1))
    _variable(variables, "mass", 2 * states, "parameter", variability="fixed", start=repr(mass))
    _variable(variables, "voltage", 2 * states + 1, "input", start="0")
    _variable(variables, "deflection", 2 * states + 2, "output")
    _variable(variables, "capacitance", 2 * states + 3, "output")
    _variable(variables, "measured_capacitance", 2 * states + 4, "input", start="0")
    _variable(variables, "sensed_deflection", 2 * states + 5, "output")
    outputs = (2 * states + 3, 2 * states + 4, 2 * states + 6)
    structure = Xml.SubElement(root, "ModelStructure")
    for part, numbers in (("Outputs", outputs),
                          ("Derivatives", range(states + 1, 2 * states + 1)),
                          ("InitialUnknowns", range(states + 1, 2 * states + 1))):
        listed = Xml.SubElement(structure, part)
        for number in (*numbers, *(outputs if part == "InitialUnknowns" else ())):
            Xml.SubElement(listed, "Unknown", index=str(number))
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root)


def _variable(parent: Xml.Element, name: str, reference: int, causality: str, *,
              variability: str = "continuous", initial: str | None = None,
              **real: str) -> None:
    attributes = {"name": name, "valueReference": str(reference), "causality": causality,
                  "variability": variability}
    if initial is not None:
        attributes["initial"] = initial
    Xml.SubElement(Xml.SubElement(parent, "ScalarVariable", attributes), "Real", real)
