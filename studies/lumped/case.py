"""Lumped models under one load, for commands and Python."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, Annotated

from tympan.base.errors import InputError
from tympan.base.fields import Key, asks
from tympan.base.progress import Progress
from tympan.fem.rig import OWN, Rig, mounted_together
from tympan.fem.rig import Actuator as OnRig
from tympan.geometry.specimen import Specimen, require_different_names
from tympan.studies.case import Settings
from tympan.studies.limits.loads import usual_masses
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.eq8 import eq8
from tympan.studies.lumped.in_time import CirclesInTime, FilmInTime, InTime
from tympan.studies.lumped.linear import Input, LinearResult, linearise
from tympan.studies.lumped.model_file import LumpedModel
from tympan.studies.lumped.remarks import origin, remark
from tympan.studies.lumped.simulate import ModelResponse
from tympan.studies.lumped.suited import suited_model
from tympan.studies.signals import Signal, Wave
from tympan.studies.trace import Responses

#: Mass [kg] on the source paper's cones where no mass is given: the lighter of the paper's two.
_PAPER_MASS = 17.9e-3


@asks
@dataclass(frozen=True)
class LumpedCase:
    """Specimens and lumped models under one ``mass`` [kg], by default a mass that suits all films.

    Membrane circles are built for the specimens. ``paper`` selects the source paper's cones
    instead, with the paper's mass where none is given. Only these cones allow ``alpha``, the
    weights of the circles, and ``table_1``, the relative permittivity for Eq. (8) with the
    constants of Table 1.
    """

    specimens: tuple[Specimen, ...] = ()
    models: tuple[LumpedModel, ...] = ()
    _: KW_ONLY
    mass: Annotated[float | None, Key("on the plate", "mass")] = None
    paper: bool = False
    alpha: Annotated[tuple[float, ...] | None, Key("weights of the paper's circles")] = None
    table_1: Annotated[float | None, Key("relative permittivity of the paper's film", rule=(
        lambda x: 1 <= x <= 1000, "must be at least 1 (vacuum) and at most 1000"))] = None
    rig: Rig = OWN

    if TYPE_CHECKING:
        def __init__(self, specimens: tuple[Specimen, ...] = (),
                     models: tuple[LumpedModel, ...] = (), *, mass: float | str | None = None,
                     paper: bool = False, alpha: tuple[float, ...] | None = None,
                     table_1: float | None = None, rig: Rig = OWN) -> None: ...

    def __post_init__(self) -> None:
        if not (self.specimens or self.models):
            raise InputError("give a specimen, or a model of one", key="specimens")
        built = [OnRig.of(model.specimen, model.rig) for model in self.models]
        bare, rig = mounted_together([*self.specimens, *built], self.rig)
        object.__setattr__(self, "specimens", bare[:len(self.specimens)])
        object.__setattr__(self, "rig", rig)
        require_different_names([*self.specimens, *(model.specimen for model in self.models)])
        for key in ("alpha", "table_1"):
            if not self.paper and getattr(self, key) is not None:
                raise InputError("is for the paper's cones, --paper: membrane circles have weights "
                                 "and a film of their own", key=key, given=getattr(self, key))

    def chosen(self, voltage: float, settings: Settings,
               progress: Progress = lambda words: None) -> ChosenActuators:
        """Choose the actuators, valid up to a voltage [V].

        Raises
        ------
        InputError
            Where a model was built for a lower voltage, or a film has no equilibrium up to this.
        """
        for model in self.models:
            model.check(self.rig.film_voltage(voltage))
        remarks: list[str] = []
        mass = self._mass(settings, remarks)
        if self.paper:
            circles = self._cones(mass, remarks)
        else:
            circles = [suited_model(specimen, mass, voltage, settings, self.rig, progress
                                    ).actuator(mass, self.rig) for specimen in self.specimens]
        circles += [model.actuator(mass, self.rig) for model in self.models]
        return ChosenActuators(self, tuple(circles), tuple(remarks))

    def _mass(self, settings: Settings, remarks: list[str]) -> float:
        if self.mass is not None:
            return self.mass
        if self.paper:
            remarks.append(remark("mass", mass=1e3 * _PAPER_MASS))
            return _PAPER_MASS
        return min(usual_masses(specimen, settings, self.rig)[0] for specimen in (
            *self.specimens, *(model.specimen for model in self.models)))

    def _cones(self, mass: float, remarks: list[str]) -> list[Actuator]:
        """Make the paper's cone actuators."""
        specimens = (self.specimens if self.table_1 is None else
                     [eq8(specimen, self.table_1) for specimen in self.specimens])
        try:
            actuators = [Actuator.of(specimen, mass, self.alpha, rig=self.rig)
                         for specimen in specimens]
        except InputError as error:
            raise error if error.key != "weights" else InputError(
                error.allowed, key="alpha", given=error.given) from None
        if self.alpha is None and any(actuator.count > 1 for actuator in actuators):
            remarks.append(remark("equal_weights"))
        return actuators


@dataclass(frozen=True)
class ChosenActuators:
    """The actuators of a case, and remarks on how they were chosen."""

    case: LumpedCase
    actuators: tuple[Actuator, ...]
    remarks: tuple[str, ...]

    def responses(self, wave: Wave, signal: Signal, swing: bool = False,
                  progress: Callable[..., None] = lambda *words, share=0.0: None) -> Responses:
        """Simulate each actuator's response to a wave's signal, sampled at the wave's interval.

        ``swing``: the plate of a model whose film has branches has inertia. ``progress`` is called
        with a specimen's name, then with the finished ``share`` of the signal.
        """
        def over(share: float) -> None:
            progress(share=share)

        responses: list[ModelResponse] = []
        for actuator in self.actuators:
            progress(actuator.specimen.name)
            responses.append(self.in_time(actuator).response(wave, signal, swing, over))
        # With Table 1's constants, Eq. (8) can describe a film that no specimen file can.
        specimens = tuple(actuator.specimen for actuator in self.actuators
                          if self.case.table_1 is None)
        return Responses(tuple(responses), specimens, self.case.rig)

    def in_time(self, actuator: Actuator) -> InTime:
        """Make the time model of an actuator, with its reduced film where it has one."""
        for model in self.case.models:
            if model.film and model.specimen.name == actuator.specimen.name:
                return FilmInTime(model, actuator.mass, actuator.rig)
        return CirclesInTime(actuator, self.remarks)

    def linear(self, voltage: float, by: Input = "U") -> LinearResult:
        """Linearise each actuator about its equilibrium at a voltage [V]."""
        remarks = [*self.remarks]
        if voltage == 0 and by == "U":
            remarks.append(remark("no_voltage"))
        return LinearResult(tuple(
            replace(linearise(actuator, voltage, by=by), warnings=(
                *remarks, *origin(actuator), *actuator.case(voltage).remarks))
            for actuator in self.actuators))
