"""Problem of an optimisation: OPTIMISE.toml."""

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
from tympan.studies.case import Case, Settings
from tympan.studies.limits.loads import usual_masses, usual_voltages
from tympan.studies.optimise.limits import LIMITS
from tympan.studies.paper.actuators import FILES

#: What of a frame may be held, by its name in problem files, and the word for holding nothing.
MEASURES = {"area": area, "perimeter": perimeter}
NOTHING = "nothing"


def held_words(measure: str) -> str:
    """Words on what is held of the frame.

    Examples
    --------
    >>> held_words("area"), held_words("nothing")
    ('equal area', 'free')
    """
    return "free" if measure == NOTHING else f"equal {measure}"


@dataclass(frozen=True)
class Variable:
    """A number of frame or plate by its ``key`` in problem files, between bounds [SI].

    ``dimension`` is "" for plain numbers.
    """

    key: str
    low: float
    high: float
    dimension: str = ""

    @property
    def path(self) -> tuple[str, ...]:
        """Path in a specimen."""
        first, *rest = self.key.split(".")
        return ("plate", "outline", *rest) if first == "plate" else (first, *rest)

    @property
    def name(self) -> str:
        """Name of the variable as parameter of a model."""
        return ".".join(self.path)


@dataclass(frozen=True)
class OptimiseProblem:
    """Largest stroke over ``variables``, under limits, the frame's area or length held.

    ``starts``: values of the variables to start from, one row each. ``limits``: bounds [SI] by the
    keys of :data:`tympan.studies.optimise.limits.LIMITS`. ``held``: of :data:`MEASURES`, or
    :data:`NOTHING`; each gives an optimum of its own.
    """

    name: str
    specimen: Specimen
    reference: Specimen
    mass: float
    voltage: float
    variables: tuple[Variable, ...]
    starts: tuple[tuple[float, ...], ...]
    limits: Mapping[str, float] = field(default_factory=dict)
    held: tuple[str, ...] = ("area",)
    rig: Rig = field(default_factory=Rig)

    @property
    def case(self) -> Case:
        """The specimen's own."""
        return Case(self.specimen, mass=self.mass, voltage=self.voltage, rig=self.rig)

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
        specimen: Specimen = _with_values(self.specimen, {
            variable.path: float(value)
            for variable, value in zip(self.variables, values, strict=True)})
        return specimen

    def held_slopes(self, measure: str, values: np.ndarray) -> tuple[float, np.ndarray]:
        """A held measure of the frame over the reference's, minus one; its derivatives.

        Whether or not a plate fits in the frame. Of nothing, 0 and its derivatives.
        """
        if measure == NOTHING:
            return 0.0, np.zeros(len(self.variables))
        size, whole = MEASURES[measure], float(np.real(MEASURES[measure](self.reference.frame)))
        paths = [variable.path[1:] if variable.path[0] == "frame" else None
                 for variable in self.variables]
        frame = _with_values(self.specimen.frame, {
            path: float(value) for path, value in zip(paths, values, strict=True)
            if path is not None})

        def slope(path: tuple[str, ...]) -> float:
            return float(complex_step(lambda change: size(with_change(frame, path, change)), 0.0))

        slopes = [0.0 if path is None else slope(path) for path in paths]
        return float(np.real(size(frame))) / whole - 1, np.array(slopes) / whole


def read_problem(file: Path) -> OptimiseProblem:
    """A problem from OPTIMISE.toml.

    Specimens are files beside it, or the paper's by name without ``.toml``; the reference is the
    specimen itself where none is named. Loads that are left out follow from the specimen.
    """
    table = Table.read(file)
    specimen = _specimen(table, "specimen", table.text("specimen"))
    variables = _variables(table.table("vary"), specimen)
    given = tuple(at(specimen, variable.path) for variable in variables)
    starts = (given, *(_start(start, variables, given) for start in table.tables("start")))
    hold, rig = table.value("hold", "area"), Rig.from_table(table.table("rig", {}))
    measures = [hold] if isinstance(hold, str) else hold
    if (not isinstance(measures, list) or not measures
            or not all(name in (*MEASURES, NOTHING) for name in measures)):
        raise table.error("hold", f"must be one of {', '.join((*MEASURES, NOTHING))}, or a list of "
                                  "them", hold)
    problem = OptimiseProblem(
        table.text("name", file.stem), specimen,
        _specimen(table, "reference", table.text("reference", table.text("specimen"))),
        *_loads(table, specimen, rig), variables, starts,
        _limits(table.table("limits", {}), specimen), tuple(dict.fromkeys(measures)), rig)
    table.done()
    return problem


def default_problem() -> OptimiseProblem:
    """The paper's large ellipse against the best frame of its area and the best of its length."""
    with resources.as_file(resources.files("tympan.studies.optimise") / "ellipse.toml") as file:
        return read_problem(file)


def _with_values(value: Any, numbers: Mapping[tuple[str, ...], float]) -> Any:
    """A copy with the numbers at these paths, all at once: on the way none need be valid."""
    if () in numbers:
        return numbers[()]
    below: dict[str, dict[tuple[str, ...], float]] = {}
    for path, number in numbers.items():
        below.setdefault(path[0], {})[path[1:]] = number
    if isinstance(value, tuple):
        return tuple(_with_values(item, below.get(str(index), {}))
                     for index, item in enumerate(value))
    return replace(value, **{key: _with_values(getattr(value, key), inner)
                             for key, inner in below.items()}) if below else value


def _specimen(table: Table, key: str, name: str) -> Specimen:
    if name.endswith(".toml"):
        specimen = load_specimen(Path(table.file).parent / name)
        specimen.needed_plate()
        return specimen
    if name not in FILES:
        raise table.error(key, "must be a specimen file, ending in .toml, or one of "
                               f"{', '.join(FILES)}", name)
    return load_specimen(FILES[name])


def _loads(table: Table, specimen: Specimen, rig: Rig) -> tuple[float, float]:
    """Mass [kg] and voltage [V]; those left out suit the specimen."""
    mass, voltage = (table.number(key, key, rule=POSITIVE) if table.value(key, None) is not None
                     else None for key in ("mass", "voltage"))
    if mass is None:
        mass, = usual_masses(specimen, Settings(), rig, (1.0,))
    if voltage is None:
        voltage, = usual_voltages(specimen, mass, Settings(), rig, (1.0,))
    return mass, voltage


def _variables(table: Table, specimen: Specimen) -> tuple[Variable, ...]:
    """Numbers of the outlines of frame and plate with their bounds."""
    outline = numbers(specimen.needed_plate().outline, "plate.outline")
    names = (*numbers(specimen.frame, "frame"),
             *(name.replace("outline.", "", 1) for name in outline))
    variables = []
    for key, given in table.data.items():
        if key not in names:
            raise table.error(key, f"must be one of {', '.join(names)}", "vary")
        path = Variable(key, 0.0, 1.0).path
        field = field_at(specimen, path)
        dimension = field.says.dimension if field is not None else ""
        low, high = table.numbers(key, dimension, count=2)
        value = float(at(specimen, path))
        if not low < high:
            raise table.error(key, "must be a lower and a larger upper bound", given)
        if not low <= value <= high:
            raise table.error(key, f"must have the specimen's own value, {value:.6g} in SI units, "
                                   "within", given)
        variables.append(Variable(key, low, high, dimension))
    if not variables:
        raise InputError(f"must name at least one of {', '.join(names)}", file=table.file,
                         key="vary")
    return tuple(variables)


def _start(table: Table, variables: tuple[Variable, ...], given: tuple[float, ...]
           ) -> tuple[float, ...]:
    """A further start: what it does not name is as ``given`` by the specimen."""
    values = []
    for variable, value in zip(variables, given, strict=True):
        key = variable.key
        if key in table:
            value = table.number(key, variable.dimension)
            if not variable.low <= value <= variable.high:
                raise table.error(key, "must lie within the variable's bounds", table.data[key])
        table.asked.add(key)
        values.append(value)
    table.done()
    return tuple(values)


def _limits(table: Table, specimen: Specimen) -> dict[str, float]:
    """Bounds by the keys of [limits]."""
    for key in table.data:
        if key not in LIMITS:
            raise table.error(key, f"unknown limit: known are {', '.join(LIMITS)}")
        if key == "breakdown_margin" and specimen.membrane.strength is None:
            raise table.error(key, "needs a film whose electric strength is known "
                                   "(membrane.breakdown)")
    return {key: table.number(key, LIMITS[key].dimension, rule=LIMITS[key].rule)
            for key in table.data}
