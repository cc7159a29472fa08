"""What to optimise: OPTIMISE.toml."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from tympan.fem.complex_step import complex_step
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.fields import field_at
from tympan.geometry.outlines import area, perimeter
from tympan.geometry.paths import at, numbers, with_change
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_reader import POSITIVE, Table
from tympan.studies.case import Case
from tympan.studies.optimise.limits import Limit, read_limit
from tympan.studies.paper.actuators import FILES

#: The specimen to beat when a problem names none: the paper's large ellipse.
PAPER = "elliptical-large"

#: What of a frame may be held, by its name in problem files.
MEASURES = {"area": area, "perimeter": perimeter}


@dataclass(frozen=True)
class Variable:
    """A number of frame or plate by its ``key`` in problem files, between bounds [SI]."""

    key: str
    low: float
    high: float

    @property
    def path(self) -> tuple[str, ...]:
        """Where it stands in a specimen."""
        first, *rest = self.key.split(".")
        return ("plate", "outline", *rest) if first == "plate" else (first, *rest)

    @property
    def name(self) -> str:
        """As parameter of a model."""
        return ".".join(self.path)

    def dimension(self, specimen: Specimen) -> str:
        """What it is in a specimen, "" for plain numbers."""
        field = field_at(specimen, self.path)
        return field.says.dimension if field is not None else ""


@dataclass(frozen=True)
class OptimiseProblem:
    """Largest stroke over ``variables``, under limits, the frame's area or length held.

    ``held``: of :data:`MEASURES`; each gives an optimum of its own. ``starts``: values of the
    variables to start from, one row each.
    """

    name: str
    specimen: Specimen
    reference: Specimen
    mass: float
    voltage: float
    variables: tuple[Variable, ...]
    starts: tuple[tuple[float, ...], ...]
    limits: tuple[Limit, ...] = ()
    held: tuple[str, ...] = ("area",)
    rig: Rig = field(default_factory=Rig)

    def case(self, specimen: Specimen) -> Case:
        """A specimen under the load and the voltage."""
        return Case(specimen, mass=self.mass, voltage=self.voltage, rig=self.rig)

    @property
    def lows(self) -> np.ndarray:
        """Lower bounds of the variables [SI], shape (variables,)."""
        return np.array([variable.low for variable in self.variables])

    @property
    def widths(self) -> np.ndarray:
        """Upper less lower bounds of the variables [SI], shape (variables,)."""
        return np.array([variable.high - variable.low for variable in self.variables])

    def design(self, values: np.ndarray) -> Specimen:
        """The specimen with these values of the variables.

        Raises
        ------
        InputError
            When it cannot be built.
        """
        return replace(self.specimen, frame=self.frame(values),
                       plate=_set(self.specimen.plate, self._numbers("plate", values)))

    def frame(self, values: np.ndarray) -> Any:
        """The frame with these values of the variables, whether or not a plate fits in."""
        return _set(self.specimen.frame, self._numbers("frame", values))

    def held_slopes(self, measure: str, values: np.ndarray) -> tuple[float, np.ndarray]:
        """A held measure of the frame over the reference's, minus one; its derivatives."""
        size, frame = MEASURES[measure], self.frame(values)
        whole = float(np.real(size(self.reference.frame)))

        def slope(path: tuple[str, ...]) -> float:
            return float(complex_step(lambda change: size(with_change(frame, path, change)), 0.0))

        slopes = [slope(variable.path[1:]) if variable.path[0] == "frame" else 0.0
                  for variable in self.variables]
        return float(np.real(size(frame))) / whole - 1, np.array(slopes) / whole

    def _numbers(self, part: str, values: np.ndarray) -> dict[tuple[str, ...], float]:
        return {variable.path[1:]: float(value)
                for variable, value in zip(self.variables, values, strict=True)
                if variable.path[0] == part}


def read_problem(file: Path) -> OptimiseProblem:
    """A problem from OPTIMISE.toml.

    Specimens are files beside it, or the paper's by name without ``.toml``.
    """
    table = Table.read(file)
    specimen = _specimen(table, "specimen", table.text("specimen"))
    limits = table.table("limits", {})
    variables = _variables(table.table("vary"), specimen)
    given = tuple(at(specimen, variable.path) for variable in variables)
    starts = (given, *(_start(start, variables, specimen) for start in table.tables("start")))
    hold = table.value("hold", "area")
    measures = [hold] if isinstance(hold, str) else hold
    if (not isinstance(measures, list) or not measures
            or not all(name in MEASURES for name in measures)):
        raise table.error("hold", f"must be one of {', '.join(MEASURES)}, or a list of them", hold)
    problem = OptimiseProblem(
        table.text("name", file.stem), specimen,
        _specimen(table, "reference", table.text("reference", PAPER)),
        table.number("mass", "mass", "17.9 g", POSITIVE),
        table.number("voltage", "voltage", rule=POSITIVE), variables, starts,
        tuple(read_limit(limits, key, specimen) for key in limits.data),
        tuple(dict.fromkeys(measures)), Rig.from_table(table.table("rig", {})))
    table.asked.add("start")
    table.done()
    return problem


def default_problem() -> OptimiseProblem:
    """The paper's large ellipse against the best frame of its area and the best of its length."""
    with resources.as_file(resources.files("tympan.studies.optimise") / "ellipse.toml") as file:
        return read_problem(file)


def _set(value: Any, numbers: Mapping[tuple[str, ...], float]) -> Any:
    """A copy with the numbers at these paths, all at once: on the way none need be valid."""
    if () in numbers:
        return numbers[()]
    below: dict[str, dict[tuple[str, ...], float]] = {}
    for path, number in numbers.items():
        below.setdefault(path[0], {})[path[1:]] = number
    if isinstance(value, tuple):
        return tuple(_set(item, below.get(str(index), {})) for index, item in enumerate(value))
    return replace(value, **{key: _set(getattr(value, key), inner)
                             for key, inner in below.items()}) if below else value


def _specimen(table: Table, key: str, name: str) -> Specimen:
    if name.endswith(".toml"):
        return load_specimen(Path(table.file).parent / name)
    if name not in FILES:
        raise table.error(key, "must be a specimen file, ending in .toml, or one of "
                               f"{', '.join(FILES)}", name)
    return load_specimen(FILES[name])


def _variables(table: Table, specimen: Specimen) -> tuple[Variable, ...]:
    """Numbers of the outlines of frame and plate with their bounds."""
    outline = numbers(specimen.plate.outline, "plate.outline")
    names = (*numbers(specimen.frame, "frame"),
             *(name.replace("outline.", "", 1) for name in outline))
    variables = []
    for key, given in table.data.items():
        if key not in names:
            raise table.error(key, f"must be one of {', '.join(names)}", "vary")
        variable = Variable(key, 0.0, 1.0)
        low, high = table.numbers(key, variable.dimension(specimen), count=2)
        value = float(at(specimen, variable.path))
        if not low < high:
            raise table.error(key, "must be a lower and a larger upper bound", given)
        if not low <= value <= high:
            raise table.error(key, f"must have the specimen's own value, {value:.6g} in SI units, "
                                   "within", given)
        variables.append(Variable(key, low, high))
    if not variables:
        raise InputError(f"must name at least one of {', '.join(names)}", file=table.file,
                         key="vary")
    return tuple(variables)


def _start(table: Table, variables: tuple[Variable, ...],
           specimen: Specimen) -> tuple[float, ...]:
    """A further start: what it does not name is the specimen's own."""
    values = []
    for variable in variables:
        key, value = variable.key, at(specimen, variable.path)
        if key in table:
            value = table.number(key, variable.dimension(specimen))
            if not variable.low <= value <= variable.high:
                raise table.error(key, "must lie within the variable's bounds", table.data[key])
        table.asked.add(key)
        values.append(value)
    table.done()
    return tuple(values)
