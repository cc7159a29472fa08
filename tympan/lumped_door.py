"""Lumped models with ``import tympan``: ``tympan.lumped.build`` and the commands for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

from tympan.base.errors import InputError
from tympan.base.fields import number, numbers, only
from tympan.base.process.threads import one_thread
from tympan.base.units import RANGE
from tympan.door import (
    File,
    Holder,
    Load,
    SpecimenOrFile,
    Stated,
    Voltages,
    Waves,
    held,
    held_together,
    loaded,
    several,
)
from tympan.geometry.specimen import Specimen, require_different_names
from tympan.grammar import combining, public
from tympan.result import Result
from tympan.studies.case import Settings

if TYPE_CHECKING:
    from tympan.studies.identify.result import IdentifyResult
    from tympan.studies.lumped.actuator import Viscous
    from tympan.studies.lumped.build import BuildResult
    from tympan.studies.lumped.case import LumpedCase
    from tympan.studies.lumped.control.result import ControlResult
    from tympan.studies.lumped.linear import Input, LinearResult
    from tympan.studies.lumped.model_file import LumpedModel
    from tympan.studies.lumped.steered.result import SteeredResult
    from tympan.studies.trace import Responses


@public(former={"masses": "mass", "voltages": "voltage"})
@one_thread()
def build(*specimens: SpecimenOrFile, mass: Load | None = None, voltage: Load | None = None,
          rig: Holder = None, count: int | None = None, circles: int = 2,
          radii: Literal["semi_axes", "sectors", "fit"] = "semi_axes",
          viscous: Viscous | None = None, settings: Settings | None = None
          ) -> Result[BuildResult]:
    """Build lumped models of specimens from their field models alone.

    ``result.models`` are the input of the other commands. The first ``mass`` is fitted, the others
    are tested; ``voltage`` is a range, by default of 11 voltages, or of ``count``. By default loads
    suit the films. ``viscous``: the constants of films without branches.
    """
    from tympan.studies.lumped.build import BuildResult, BuildSettings, between

    if not specimens:
        raise InputError("give one or several", key="specimens")
    (films, on), settings = held_together(specimens, rig), settings or Settings()
    require_different_names(films)
    loads = None if voltage is None else between(several(voltage, "voltage", "voltage"), count)
    chosen = BuildSettings.suited(
        films, settings, on, count or RANGE, voltages=loads, circles=circles, radii=radii,
        masses=several(mass, "mass", "mass") or None, viscous=viscous)
    return Result(BuildResult.built(films, settings, chosen, on))


@public(Waves)
@one_thread()
def simulate(*models: Specimen | LumpedModel | Result[BuildResult] | Stated,
             mass: Load | None = None,
             rig: Holder = None, signal: str = "step", swing: bool = False, paper: bool = False,
             alpha: Sequence[float] | None = None, table_1: float | None = None,
             settings: Settings | None = None, **wave: Unpack[Waves]) -> Result[Responses]:
    """Simulate lumped models under a step, ramp, sine, random voltages, or those of a CSV file.

    ``models`` are specimens, whose models are built, or their files; results of ``build``, their
    models, or files NAME.lumped.toml. All else is as for ``tympan.transient``. ``paper``: use the
    source paper's cones, not membrane circles, with weights ``alpha`` and relative permittivity
    ``table_1``.
    """
    from tympan.studies.signals import Wave
    from tympan.studies.trace import sample_count

    form = Wave(signal, **wave)
    voltages = form.signal()
    sample_count(voltages.end, form.interval, len(models))
    case = _case(models, mass=mass, paper=paper, alpha=alpha, table_1=table_1, rig=rig)
    chosen = case.chosen(voltages.peak, settings or Settings())
    return Result(chosen.responses(form, voltages, swing))


@public(former={"at": "voltage"})
@one_thread()
def linearise(*models: Specimen | LumpedModel | Result[BuildResult] | Stated,
              mass: Load | None = None,
              voltage: Load = 3e3, rig: Holder = None, input: Input = "U", paper: bool = False,
              alpha: Sequence[float] | None = None, table_1: float | None = None,
              settings: Settings | None = None) -> Result[LinearResult]:
    """Linearise about the equilibrium at a ``voltage``: state space, named poles, gain.

    ``result.to_control()`` is a state space of python-control, ``result.to_scipy()`` one of
    scipy.signal. With several actuators ``result.linear`` has all. The input is the voltage, or
    with ``input="U2"`` its square. All else is as for ``simulate``.
    """
    across = number(only(voltage, "voltage"), "voltage", "voltage")
    case = _case(models, mass=mass, paper=paper, alpha=alpha, table_1=table_1, rig=rig)
    return Result(case.chosen(abs(across), settings or Settings()).linear(across, input))


@public(Voltages)
@one_thread()
def control(*models: Specimen | LumpedModel | Result[BuildResult] | Stated,
            mass: Load | None = None,
            rig: Holder = None, signal: str = "step", interval: float | str = 10e-3,
            supply: float | str = 7e3, sensor_lag: float | str | None = None,
            method: Literal["pi", "lqg"] = "pi",
            sensor: Literal["deflection", "capacitance"] = "deflection", fmu: bool = False,
            paper: bool = False, alpha: Sequence[float] | None = None,
            table_1: float | None = None, settings: Settings | None = None,
            **wave: Unpack[Voltages]) -> Result[ControlResult]:
    """Design a closed loop of voltage and deflection with feed-forward, margins and a run.

    The plate must follow the equilibrium deflections of the ``signal``'s voltages. ``interval`` is
    the sampling interval, ``supply`` the highest voltage (the lowest is 0), ``sensor_lag`` the time
    by which the sensor lags (by default the rig's), ``method`` how the controller is designed,
    ``sensor`` the quantity that is read. ``high`` is by default half of the supply. With
    ``fmu=True`` ``result.save(folder)`` also writes NAME-control.fmu. All else is as for
    ``simulate``.
    """
    from tympan.studies.lumped.control.run import ControlSettings, controlled, supplied
    from tympan.studies.signals import Wave

    loop = ControlSettings(supply=supply, interval=interval, sensor_lag=sensor_lag,
                           method=method, sensor=sensor, fmu=fmu)
    wave.setdefault("high", loop.usual_high)
    voltages = Wave(signal, interval=loop.interval, **wave).signal()
    case = _case(models, mass=mass, paper=paper, alpha=alpha, table_1=table_1, rig=rig)
    return Result(controlled(supplied(case, loop, settings or Settings()), voltages, loop))


@public()
@combining
@one_thread()
def steer(specimen: SpecimenOrFile, *, mass: Load | None = None, rig: Holder = None,
          tilt: float | str = 3e-3, frequency: float | str = 1.0, turns: float = 2.0,
          supply: float | str = 2.8e3, interval: float | str = 10e-3,
          method: Literal["pi", "lqg"] = "lqg", reference: File | None = None, fmu: bool = False,
          settings: Settings | None = None) -> Result[SteeredResult]:
    """Design a controller that tilts a plate by its segments, and run it on the film in time.

    The plate's normal draws a circle of radius ``tilt``, or follows the path of a ``reference``.
    The controller is designed on a lumped model of the plate's freedoms; ``result.linear`` has that
    linearised, ``result.run("feedback")`` what came of it, ``result.to_pandas()`` the samples.
    With ``fmu=True`` ``result.save(folder)`` also writes model and controller as FMUs.
    """
    from tympan.studies.case import NO_MASS
    from tympan.studies.lumped.steered.run import SteerSettings
    from tympan.studies.lumped.steered.run import steer as steered

    film, on = held(specimen, rig)
    if mass is None:
        raise InputError(NO_MASS, key="mass")
    chosen = SteerSettings(
        mass=number(only(mass, "mass"), "mass", "mass"), tilt=tilt, frequency=frequency,
        turns=turns, supply=supply, interval=interval, method=method,
        reference=None if reference is None else Path(reference), fmu=fmu)
    return Result(steered(film, chosen, on, settings or Settings()), film)


@public()
@one_thread()
def identify(dataset: File, *, model: Sequence[LumpedModel | File] = (), paper: bool = False,
             dynamic: bool = False, law: Literal["eq8", "film"] | None = None,
             alpha: Literal["each", "shared", "given"] | None = None,
             weights: Sequence[float] | None = None,
             objective: Literal["deflection", "force", "printed"] = "deflection",
             limits: bool = True, nelder_mead: bool = False, settings: Settings | None = None
             ) -> Result[IdentifyResult]:
    """Identify constants of lumped models from a dataset's readings, with 95 % limits.

    ``dynamic``: also those of the responses in transient.csv. ``model``: models of its specimens,
    instead of those found from the field model. ``law``: one factor on the films' own material, or
    the paper's Eq. (8). ``limits=False``: linearised limits only, without further computation.
    """
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.identify.identify import IdentifySettings
    from tympan.studies.identify.identify import identify as identified

    models = model if isinstance(model, list | tuple) else (model,)
    shares = None if weights is None else numbers(weights, "", "weights")
    chosen = IdentifySettings(tuple(map(_model, models)), paper, dynamic, law, alpha, shares,
                              objective, limits, nelder_mead)
    readings = read_dataset(Path(dataset))
    chosen.require(readings)
    return Result(identified(readings, chosen, settings or Settings()))


@public()
@one_thread()
def export(model: LumpedModel | Result[BuildResult] | File, folder: File, *,
           mass: float | str | None = None, fmu: bool = False, slow_fast: bool = False
           ) -> list[Path]:
    """Write a lumped model for a controller, and return the files.

    The format is C99; or, with a ``mass`` on the plate, ``fmu`` (FMU 2.0) or ``slow_fast``, a
    polynomial of the voltage before two transfer functions.
    """
    from tympan.studies.lumped.export import export, require_form

    carried = None if mass is None else number(mass, "mass", "mass")
    require_form(carried, fmu, slow_fast)
    return export(_model(model), Path(folder), carried, fmu, slow_fast)


class Lumped:
    """Lumped models: a mass on circles of film. The object itself is ``build``."""

    build = staticmethod(build)
    simulate = staticmethod(simulate)
    linearise = staticmethod(linearise)
    control = staticmethod(control)
    steer = staticmethod(steer)
    identify = staticmethod(identify)
    export = staticmethod(export)
    __call__ = staticmethod(build)


lumped = Lumped()


def _model(given: LumpedModel | Result[BuildResult] | File) -> LumpedModel:
    from tympan.studies.lumped.model_file import LumpedModel, read_model

    model, *others = _models_of(given)
    if others:
        raise InputError("must be one model: name it, such as result.models[0]", key="model",
                         given=f"a result of {1 + len(others)} models")
    if not isinstance(model, LumpedModel | str | PathLike):
        raise InputError("must be a Specimen, a model of lumped.build, or its file", given=given)
    return model if isinstance(model, LumpedModel) else read_model(Path(model))


def _models_of(given: Any) -> list[Any]:
    """List the models of a result of :func:`build`; anything else is itself."""
    return list(given.models) if isinstance(given, Result) else [given]


def _read(given: Any) -> Specimen | LumpedModel:
    """Read a specimen or a model that is given by the name of its file."""
    from tympan.studies.lumped.model_file import read_actuator

    if isinstance(given, Specimen):
        return given
    return (read_actuator(Path(given)) if isinstance(given, str | PathLike)
            else loaded(given) if isinstance(given, Mapping) else _model(given))


def _case(actuators: Sequence[Specimen | LumpedModel | Result[BuildResult] | Stated], *,
          rig: Holder, alpha: Sequence[float] | None, **given: Any) -> LumpedCase:
    from tympan.studies.lumped.case import LumpedCase

    read = [_read(one) for each in actuators for one in _models_of(each)]
    specimens, on = held_together([item for item in read if isinstance(item, Specimen)], rig)
    models = tuple(item for item in read if not isinstance(item, Specimen))
    weights = None if alpha is None else numbers(alpha, "", "alpha")
    if given["mass"] is not None:
        given["mass"] = only(given["mass"], "mass")
    return LumpedCase(specimens, models, alpha=weights, rig=on, **given)
