"""The lumped model of a specimen from its field model alone, and its errors against it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import lt
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from tympan.base.arrays import Array, Mask
from tympan.base.errors import InputError, VoltageError
from tympan.base.progress import Progress
from tympan.base.units import RANGE, evenly
from tympan.fem.membrane.model import Model
from tympan.fem.rig import Rig, checked_load
from tympan.geometry.specimen import Specimen
from tympan.studies.alpha import AlphaResult, AlphaSettings, LoadGrid, alpha
from tympan.studies.alpha.circles import STILL_PLATE, Samples, equilibria, gas_area
from tympan.studies.case import Case, Settings, build_model, failure_reason, voltage_ramp
from tympan.studies.circles import ConeCircle
from tympan.studies.columns import Column, as_written, read_own_sheet, write_sheet
from tympan.studies.files import read_json, remove, write_json
from tympan.studies.films.reduction import IN_TIME, reduced_film
from tympan.studies.limits.loads import usual_masses, usual_voltages
from tympan.studies.lumped.actuator import BORROWED, Actuator, Viscous
from tympan.studies.lumped.equilibria import pull_in, rest, rest_curve
from tympan.studies.lumped.model_file import STILL, LumpedModel, read_model, write_model
from tympan.studies.lumped.remarks import origin
from tympan.studies.modes import modes

#: The kinematics compared, and the part of each that comes from the field model.
KINEMATICS = {"cone": "the paper's cones with the α best for them",
              "scaled": "cones times one factor, α best for these",
              "membrane": "membrane circles with α",
              "corrected": "membrane circles with α and two factors"}

#: Relative error of deflection or capacitance above which a warning says that the model does not
#: represent its specimen.
NEAR = 0.01

_COLUMNS = (
    Column.labels("specimen"), Column("mass", "g"), Column("voltage", "kV"), Column("fitted"),
    *(Column(name, required=False, absent="nan")
      for name in ("field_mm", *(f"{kinematics}_mm" for kinematics in KINEMATICS), "field_pF",
                   "corrected_pF")))


@dataclass(frozen=True)
class BuildSettings:
    """Masses [kg] and voltages [V] the model is for, and its circles, as for α.

    The model is fitted on the first mass alone, at the lowest, the middle and the highest voltage.
    It is tested at all other loads. ``viscous`` is used unchanged where the film has no branches of
    its own, since a field model of such a film has no viscosity.
    """

    masses: tuple[float, ...]
    voltages: tuple[float, ...]
    circles: int = 2
    radii: str = "semi_axes"
    viscous: Viscous = BORROWED

    def __post_init__(self) -> None:
        if not self.masses or not self.voltages:
            raise InputError("there must be a mass and a voltage", key="masses, voltages")
        for mass in self.masses:
            for voltage in self.voltages:
                checked_load(mass, voltage)
        for name, values in (("masses", self.masses), ("voltages", self.voltages)):
            if len(set(values)) < len(values):
                raise InputError("must differ from each other", key=name, given=values)
        if tuple(sorted(self.voltages)) != self.voltages:
            raise InputError("must ascend", key="voltages", given=self.voltages)

    @classmethod
    def suited(cls, specimens: Sequence[Specimen], settings: Settings, rig: Rig = Rig(),
               count: int = 11, **given: Any) -> BuildSettings:
        """Make settings with ``count`` voltages; loads that are not given suit all specimens."""
        AlphaSettings(circles=given.get("circles", 2), radii=given.get("radii", "semi_axes"))
        branched = [item.name for item in specimens if item.membrane.branches]
        if given.get("viscous") is None:
            given["viscous"] = BORROWED
        elif branched:
            raise InputError("is for films without branches: theirs come from the field model",
                             key="--viscous", given=", ".join(branched))
        for specimen in specimens:  # refuses a rig that the model does not have
            specimen.needed_plate()
            Actuator.of(specimen, (given.get("masses") or (1.0,))[0], rig=rig)
        if given.get("masses") is None:
            given["masses"] = tuple(map(min, zip(*(
                usual_masses(specimen, settings, rig) for specimen in specimens), strict=True)))
        if given.get("voltages") is None:
            shares = tuple(np.linspace(0.0, 1.0, count).tolist())
            given["voltages"] = min(usual_voltages(specimen, max(given["masses"]), settings, rig,
                                                   shares) for specimen in specimens)
        return cls(**given)

    @property
    def loads(self) -> int:
        """Number of loads."""
        return len(self.masses) * len(self.voltages)

    def greatest(self, specimen: Specimen, rig: Rig) -> Case:
        """Make the case of the largest mass and the highest voltage."""
        return Case.greatest(specimen, self.masses, self.voltages, rig)

    @cached_property
    def fit(self) -> LoadGrid:
        """The loads that the model is fitted on."""
        u = self.voltages
        return LoadGrid(self.masses[:1], tuple(sorted({u[0], u[len(u) // 2], u[-1]})))

    @property
    def fitted(self) -> Mask:
        """Mask of the fitted loads, shape (masses, voltages)."""
        return np.outer(np.isin(self.masses, self.fit.masses),
                        np.isin(self.voltages, self.fit.voltages))


def between(given: Sequence[float], count: int | None = None) -> tuple[float, ...]:
    """Choose the voltages [V] of a model: those given, or ``count`` evenly between their ends.

    Two voltages are such ends.
    """
    if len(given) < 2:
        raise InputError("must be two voltages or more, or a range such as 0 kV..5 kV",
                         key="voltage", given=", ".join(f"{1e-3 * each:g} kV" for each in given))
    if not (given[0] >= 0 and all(map(lt, given, given[1:]))):
        raise InputError("must ascend, from 0 kV on", key="voltage",
                         given=", ".join(f"{1e-3 * each:g} kV" for each in given))
    if count is None and len(given) > 2:
        return tuple(given)
    return tuple(evenly(given[0], given[-1], count or RANGE))


@dataclass(frozen=True, eq=False)
class Built:
    """A model, the field model it is built from, and the paper's cones for comparison.

    ``field_deflection`` [m] and ``field_capacitance`` [F] are the field model's at rest, shape
    (masses, voltages). ``frequencies`` [Hz] are of small undamped vibrations along the load under
    the first mass, at the lowest and the highest voltage. They hold the lumped model's and the
    field model's frequencies, nan where the field model has none.
    """

    settings: BuildSettings
    rig: Rig
    model: LumpedModel
    alpha: AlphaResult
    field_deflection: Array
    field_capacitance: Array
    frequencies: dict[str, tuple[float, float]]

    def actuator(self, kinematics: str, mass: float) -> Actuator:
        """Make the specimen's actuator with one of :data:`KINEMATICS` under a mass [kg]."""
        viscous, scale = self.settings.viscous, self.alpha.cone_scale
        cones = ConeCircle(self.model.specimen, np.array(self.model.radii))
        if kinematics == "cone":
            return Actuator(cones, self.alpha.by_basis["cone"].alpha, mass, viscous, self.rig)
        if kinematics == "scaled":
            weights = self.alpha.by_basis["cone_scaled"].alpha
            return Actuator(cones, weights, mass, viscous, self.rig, scale, scale)
        model = self.model if kinematics == "corrected" else replace(self.model, stiffness=1.0,
                                                                     permittivity=1.0)
        return model.actuator(mass, self.rig)

    @cached_property
    def deflection(self) -> dict[str, Array]:
        """Deflections at rest [m] by kinematics, (masses, voltages); nan beyond pull-in."""
        voltages = np.array(self.settings.voltages)
        return {kind: np.array([rest_curve(self.actuator(kind, mass), voltages)
                                for mass in self.settings.masses]) for kind in KINEMATICS}

    @cached_property
    def capacitance(self) -> dict[str, Array]:
        return {kind: np.asarray(self.actuator(kind, 1.0).capacitance(deflection))
                for kind, deflection in self.deflection.items()}

    def errors(self, kinematics: str) -> Array:
        """Compute the relative error of deflection, shape (masses, voltages)."""
        return np.asarray(self.deflection[kinematics] / self.field_deflection - 1)

    def worst(self, kinematics: str, *, held_out: bool) -> float | None:
        """Find the largest error of deflection at fitted or held-out loads; None at pull-in."""
        return _largest(self.errors(kinematics)[self.settings.fitted != held_out])

    def stroke_error(self, kinematics: str) -> float | None:
        """Find the largest relative error of the stroke over the voltages; None at pull-in."""
        strokes = [deflection[:, -1] - deflection[:, 0]
                   for deflection in (self.deflection[kinematics], self.field_deflection)]
        return _largest(strokes[0] / strokes[1] - 1)

    def capacitance_error(self, kinematics: str) -> float | None:
        """Find the largest relative error of the capacitance; None at pull-in."""
        return _largest(self.capacitance[kinematics] / self.field_capacitance - 1)

    @property
    def warnings(self) -> list[str]:
        warnings, errors = [], np.abs(self.errors("corrected"))
        if np.isnan(errors).any():
            warnings.append("the lumped model has a pull-in at a load at which the field model "
                            "has none")
        elif errors.max() > NEAR:
            warnings.append(f"the deflection is up to {errors.max():.1%} off: other circles "
                            "(--circles, --radii) may do")
        spread = self.capacitance_error("corrected")
        if spread is not None and spread > NEAR:
            warnings.append(f"the capacitance is up to {spread:.1%} off: covered film also moves "
                            "in its plane, which the model does not know")
        worst = max(self.model.film.errors.values(), default=0.0) if self.model.film else 0.0
        if worst > NEAR:
            warnings.append(f"in time the deflection is up to {worst:.1%} of its range off")
        if self.model.specimen.membrane.density:
            warnings.append("the lumped model has no film mass: its frequencies are those of plate "
                            "and weight alone")
        return [*warnings, *self.settings.greatest(self.model.specimen, self.rig).remarks]

    @property
    def statics(self) -> pd.DataFrame:
        """Rows of statics.csv, one for each load."""
        mass, voltage = np.meshgrid(self.settings.masses, self.settings.voltages, indexing="ij")
        columns = {"mass": mass, "voltage": voltage, "fitted": self.settings.fitted,
                   "field_mm": 1e3 * self.field_deflection,
                   **{f"{kind}_mm": 1e3 * y for kind, y in self.deflection.items()},
                   "field_pF": 1e12 * self.field_capacitance,
                   "corrected_pF": 1e12 * self.capacitance["corrected"]}
        return pd.DataFrame({"specimen": self.model.specimen.name,
                             **{name: values.ravel() for name, values in columns.items()}})

    def json(self) -> dict[str, Any]:
        model = self.model
        circles = zip(model.radii, model.weights, model.circles.membrane_factor.tolist(),
                      strict=True)
        return {
            "specimen": model.specimen.name,
            "circles": [{"radius_m": radius, "alpha": weight, "membrane_factor": factor}
                        for radius, weight, factor in circles],
            "radii": self.alpha.radii,
            "stiffness": model.stiffness,
            "permittivity": model.permittivity,
            "flat_capacitance_F": model.flat_capacitance,
            "film": None if model.film is None else {
                "shapes": model.film.count, "points": len(model.film.volumes),
                "error": dict(model.film.errors)},
            "cone": {"alpha": list(self.alpha.by_basis["cone"].alpha),
                     "scale": self.alpha.cone_scale,
                     "scaled_alpha": list(self.alpha.by_basis["cone_scaled"].alpha)},
            "deflection_error": {kind: {"fitted": self.worst(kind, held_out=False),
                                        "held_out": self.worst(kind, held_out=True)}
                                 for kind in KINEMATICS},
            "stroke_error": {kind: self.stroke_error(kind) for kind in KINEMATICS},
            "capacitance_error": {kind: self.capacitance_error(kind) for kind in KINEMATICS},
            "pull_in_film_voltage_V": {
                kind: [(pull_in(self.actuator(kind, mass)) or (None,))[0]
                       for mass in self.settings.masses] for kind in ("cone", "corrected")},
            "frequency_Hz": {name: [value if np.isfinite(value) else None for value in pair]
                             for name, pair in self.frequencies.items()},
            "warnings": [*self.warnings, *([] if model.film else
                                           origin(self.actuator("corrected", 1.0)))],
        }


def _largest(errors: Array) -> float | None:
    return float(np.abs(errors).max()) if errors.size and np.isfinite(errors).all() else None


def build(specimen: Specimen, settings: Settings, chosen: BuildSettings | None = None,
          rig: Rig = Rig(), progress: Progress = lambda _: None, in_time: bool = True) -> Built:
    """Build a specimen's lumped model from its field model alone, by default for suitable loads.

    The circles and α are those of :func:`tympan.studies.alpha.alpha` on membrane circles. Two
    factors, one on the film's and one on the voltage's energy, are fitted to the forces at the
    fit's loads, by least squares of relative force. A film with viscous branches also gets its
    reduced film in time (:mod:`tympan.studies.films.reduction`), unless ``in_time`` is false.
    """
    specimen.needed_plate()
    Actuator.of(specimen, 1.0, rig=rig)  # refuses a rig that the model cannot represent
    progress(f"{specimen.name}: field model")
    chosen = chosen or BuildSettings.suited([specimen], settings, rig)
    model = build_model(specimen, settings, rig.loading)
    viscous_film = in_time and bool(specimen.membrane.branches)
    settings = settings.bounded(model, chosen.loads + viscous_film * IN_TIME)
    deflection, capacitance, pull = _at_rest(model, settings, chosen, rig)
    weights = alpha(specimen, settings,
                    AlphaSettings(chosen.fit, LoadGrid((), ()), chosen.circles, chosen.radii),
                    rig, progress)
    highest = rig.film_voltage(chosen.voltages[-1])
    film, viscous = None, chosen.viscous
    if viscous_film:
        progress(f"{specimen.name}: in time")
        # The reduced film is the film's own: mechanisms are left out, their forces are kept.
        bare = replace(model, loading=replace(rig, biases=()).loading)
        forces = (pull + rig.spring * deflection).max(axis=1).tolist()
        film, viscous = reduced_film(bare, forces, highest, settings.path), STILL
    plain = LumpedModel(specimen, weights.circles, weights.by_basis["membrane"].alpha,
                        model.capacitance(model.mounted()), highest, viscous=viscous, film=film,
                        rig=rig)
    samples = equilibria(model, chosen.fit, rig, settings, 1, [])
    stiffness, permittivity = _factors(plain, samples)
    lifted = gas_area(model, samples, rig, settings)
    lumped = replace(plain, stiffness=stiffness, permittivity=permittivity, gas_area=lifted,
                     film=film and replace(film, gas_area=lifted))
    progress(f"{specimen.name}: vibrations")
    actuator = lumped.actuator(chosen.masses[0], rig)
    low, high = (_frequencies(actuator, voltage, settings)
                 for voltage in (chosen.voltages[0], chosen.voltages[-1]))
    settings.path.require_work(specimen.name)
    return Built(chosen, rig, lumped, weights, deflection, capacitance,
                 {"lumped": (low[0], high[0]), "field": (low[1], high[1])})


def _at_rest(model: Model, settings: Settings, chosen: BuildSettings,
             rig: Rig) -> tuple[Array, Array, Array]:
    """Compute deflections [m], capacitances [F], the film's pull [N], shape (masses, voltages)."""
    rests = []
    for mass in chosen.masses:
        for case, outcome in voltage_ramp(model, mass, chosen.voltages, rig, settings.path):
            load = f"{case.specimen.name}, {1e3 * mass:g} g"
            if outcome.status != "equilibrium":
                missing = "did not converge"
                if outcome.status == "no_equilibrium":
                    missing = "has no equilibrium"
                reason = f"the field model {missing}: {failure_reason(outcome)}"
                raise VoltageError(chosen.greatest(case.specimen, rig).doubted(reason),
                                   key=load, given=f"{1e-3 * case.voltage:.5g} kV")
            deflection = outcome.state.plate.deflection
            if abs(deflection) <= STILL_PLATE * model.size:
                raise InputError("the plate must move: the mass is too small to tell a force",
                                 key=case.specimen.name, given=f"{1e3 * mass:g} g")
            rests.append((deflection, model.capacitance(outcome.state),
                          model.reaction(outcome.state)))
    deflections, capacitances, pulls = np.array(rests).T.reshape(3, len(chosen.masses), -1)
    return deflections, capacitances, pulls


def _factors(model: LumpedModel, samples: Samples) -> tuple[float, float]:
    """Find the factors nearest to 1 that give the samples' forces; 1 for the voltage at 0 V."""
    actuator = Actuator(model.circles, model.weights, 1.0)
    film = actuator.elastic(samples.deflection)[1]
    drawn = samples.voltage**2 * actuator.electric(samples.deflection)[1]
    columns = (np.array([film, drawn]) / samples.force).T
    shift = np.linalg.lstsq(columns, 1 - columns.sum(axis=1), rcond=1e-9)[0]
    return float(1 + shift[0]), float(1 + shift[1])


def _frequencies(actuator: Actuator, voltage: float, settings: Settings) -> tuple[float, float]:
    """Compute the undamped frequency along the load [Hz] of the model and of the field model."""
    still = rest(actuator, voltage)
    lumped = float(np.sqrt(actuator.balance(still, voltage)[1] / actuator.moved) / (2 * np.pi))
    along = (mode.frequency_Hz for mode in modes(actuator.case(voltage), settings).modes
             if mode.plate_share["z"] > 0.5)
    return lumped, min((hertz for hertz in along if hertz is not None), default=np.nan)


@dataclass(frozen=True, eq=False)
class BuildResult:
    """Models of several specimens, built at the same loads.

    ``numbers`` is the content of ``lumped build --json``; ``statics`` has the columns of
    statics.csv, with loads in SI units.
    """

    indexed: ClassVar[tuple[str, ...]] = ("specimen", "mass_kg", "voltage_V")

    numbers: dict[str, Any]
    models: tuple[LumpedModel, ...]
    statics: pd.DataFrame

    @property
    def rows(self) -> pd.DataFrame:
        """A row for each load."""
        return self.statics.drop(columns="fitted").rename(
            columns={"mass": "mass_kg", "voltage": "voltage_V"})

    @classmethod
    def built(cls, specimens: Sequence[Specimen], settings: Settings, chosen: BuildSettings,
              rig: Rig = Rig(), progress: Progress = lambda _: None) -> BuildResult:
        """Build the models of specimens of different names, all for the same loads."""
        return cls.of([build(specimen, settings, chosen, rig, progress)
                       for specimen in specimens])

    @classmethod
    def of(cls, models: Sequence[Built]) -> BuildResult:
        chosen = models[0].settings
        numbers = {"masses_kg": list(chosen.masses), "voltages_V": list(chosen.voltages),
                   "fitted_masses_kg": list(chosen.fit.masses),
                   "fitted_voltages_V": list(chosen.fit.voltages),
                   "built": [built.json() for built in models]}
        return cls(numbers, tuple(built.model for built in models),
                   pd.concat([built.statics for built in models], ignore_index=True))

    def json(self) -> dict[str, Any]:
        return self.numbers

    def save(self, folder: Path) -> None:
        """Write build.json, statics.csv and for each specimen its model, NAME.lumped.toml.

        build.json is written last, so its presence means that the other files are complete.
        """
        remove(folder, "build.json")
        write_sheet(folder / "statics.csv", _COLUMNS, self.statics)
        for model in self.models:
            write_model(folder / f"{model.specimen.name}.lumped.toml", model)
        write_json(folder / "build.json", self.numbers)

    def as_stored(self) -> BuildResult:
        """Round the result to the digits of its file."""
        return replace(self, statics=pd.DataFrame(as_written(_COLUMNS, self.statics)))

    @classmethod
    def load(cls, folder: Path) -> BuildResult:
        """Load a saved result; a missing, damaged or wrong file is an InputError."""
        numbers = read_json(folder / "build.json")
        if not isinstance(numbers, dict) or not numbers.get("built"):
            raise InputError("is not of tympan lumped build: run it again",
                             file=folder / "build.json")
        names = [built["specimen"] for built in numbers["built"]]
        statics = pd.DataFrame(read_own_sheet(folder / "statics.csv", _COLUMNS))
        for name in names:
            if sum(statics["specimen"] == name) != \
                    len(numbers["masses_kg"]) * len(numbers["voltages_V"]):
                raise InputError(f"must have a row of {name} for each load of build.json: run "
                                 "tympan lumped build again", file=folder / "statics.csv")
        return cls(numbers, tuple(read_model(folder / f"{name}.lumped.toml") for name in names),
                   statics)
