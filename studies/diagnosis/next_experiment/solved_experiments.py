"""Experiments that force laws cannot predict: each rival's readings are solved.

They are a line over a film, a specimen of another shape, and strips of the film.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Specimen
from tympan.studies.case import build_model, voltage_ramp
from tympan.studies.data.coupon import Coupons
from tympan.studies.data.effort import Effort
from tympan.studies.diagnosis.evidence.coupons import CouponTests
from tympan.studies.diagnosis.evidence.scans import ZERO
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import FACTORS, parameters_of
from tympan.studies.diagnosis.next_experiment.experiments import WORDS, Outlook, Readout
from tympan.studies.diagnosis.reading_table import Scan
from tympan.studies.diagnosis.reduced.sampling import coarse
from tympan.studies.diagnosis.reduced.scans import scanned_exactly
from tympan.studies.effects import Setup
from tympan.studies.estimation.noise import Noise, Shared

#: Step of a factor's logarithm for derivatives: small against what readings leave open, large
#: against solver errors.
_FACTOR = 0.005
#: Step of a size for derivatives, over the prior scale, for the same reason.
_SHARE = 0.02

#: Places on each line over a film: 2 to 4 mm apart on films of the source paper's size.
_PLACES = 41
#: Extent of the lines, as a share of the frame's half extents: short of the frame itself.
_REACH = 0.97

#: Ratio of lengths of the frame of another shape. Set by trial.
_LONGER = 1.5
#: Ratio of sizes of the plate of another shape. Set by trial.
_LARGER = 1.6

#: Noise of strips' stresses, as a share: each test uses a strip of its own, with its own width and
#: grips.
_STRIPS = 0.05
#: Largest stretch of the strips over that of the mounted film, so that they exceed the film's
#: stretch.
_FURTHER = 1.2


@dataclass(frozen=True, eq=False)
class NewReadings:
    """Readings that could be made.

    ``setup``: every specimen, also those to be made; ``shown``: computes the readings' values for a
    setup with effects, an ArithmeticError where a film has no equilibrium; ``noise``: computes
    their noise from their values. ``count``: number of readings in a row; ``loads``: number of
    masses put on; ``specimens``: number of specimens mounted; ``words``: what is done.
    """

    setup: Setup
    shown: Callable[[Setup], Array]
    noise: Callable[[Array], Noise]
    count: int
    loads: int
    specimens: int
    words: Mapping[str, str]


@dataclass(frozen=True)
class SolvedExperiment:
    """Readings that could be made and are solved only when asked for.

    ``what``: a description; ``plan``: builds the readings, None where they make no sense;
    ``sets_up``: work besides readings, a field of :class:`~tympan.studies.data.effort.Effort`.
    """

    what: str
    plan: Callable[[Readout], NewReadings | None]
    sets_up: str

    def outlook(self, readout: Readout, fits: Sequence[Fit], effort: Effort) -> Outlook | None:
        """Predict the readings by each rival; None where one has no equilibrium."""
        new = self.plan(readout)
        if new is None:
            return None
        try:
            shown = [_shown(readout, new, fit) for fit in fits]
        except (ArithmeticError, InputError):
            return None
        values, jacobians = zip(*shown, strict=True)
        work = (new.count * effort.reading + new.loads * effort.load
                + new.specimens * effort.specimen + getattr(effort, self.sets_up))
        return Outlook(values, jacobians, new.noise(values[0]), self.what.format(**new.words), work)


def _shown(readout: Readout, new: NewReadings, fit: Fit) -> tuple[Array, Array]:
    """Compute values by a fit, and derivatives by its unknowns, shape (readings, unknowns)."""
    films = replace(readout.simulation, setup=new.setup)

    def at(unknowns: Array) -> Array:
        return new.shown(films.extended(fit.hypothesis, unknowns))

    values, columns = at(fit.unknowns), []
    usual = [item.deviation for item in parameters_of(fit.hypothesis)]
    steps = np.array([_FACTOR] * FACTORS.stop + [_SHARE * size for size in usual])
    for number, step in enumerate(steps.tolist()):
        inwards = step if fit.unknowns[number] + step < fit.limits[1, number] else -step
        moved = fit.unknowns + inwards * np.eye(len(steps))[number]
        columns.append((at(moved) - values) / inwards)
    return values, np.stack(columns, axis=1)


def _heaviest(readout: Readout) -> tuple[int, float, Array]:
    """Find specimen and mass [kg] of the ramp of largest mass and voltage, and its voltages."""
    states = readout.states
    last = np.lexsort((states.voltage, states.mass))[-1]
    specimen, mass = int(states.specimen[last]), float(states.mass[last])
    ramp = (states.specimen == specimen) & (states.mass == mass)
    return specimen, mass, np.unique(states.voltage[ramp])


def _loads(mass: float, voltage: float) -> dict[str, str]:
    return {"mass": f"{1e3 * mass:.4g} g", "voltage": f"{voltage / 1e3:.3g} kV"}


def film_line(readout: Readout) -> NewReadings | None:
    """Plan a line along x and one along y over one film, at the lowest and highest voltage."""
    setup = readout.simulation.setup
    if readout.table.scans or not readout.plates or setup.formula is not None:
        return None
    number, mass, voltages = _heaviest(readout)
    specimen, ends = setup.specimens[number], voltages[[0, -1]][: len(voltages)]
    scan = _cross(specimen)
    noise = Noise(np.full(len(scan), readout.noise), (Shared.zero(len(scan), ZERO),))

    def shown(extended: Setup) -> Array:
        lines = [scanned_exactly(extended.specimens[number], extended.rig, mass, voltage, scan,
                                 coarse(None)) for voltage in ends.tolist()]
        if any(line is None for line in lines):
            raise ArithmeticError("no equilibrium")
        return np.concatenate([line[-1] for line in lines if line is not None])

    every = reduce(Noise.joined, [noise] * len(ends))
    return NewReadings(setup, shown, lambda values: every, len(ends), 1, 1,
                       {"specimen": specimen.name, **_loads(mass, float(ends[-1]))})


def _cross(specimen: Specimen) -> Scan:
    place = np.zeros((2, _PLACES, 2))
    for axis, half in enumerate(specimen.frame.semi_axes):
        place[axis, :, axis] = np.linspace(-_REACH * half, _REACH * half, _PLACES)
    flat = place.reshape(-1, 2)
    return Scan(flat, False, specimen.needed_plate().level(*flat.T) <= 0, False)


def other_shape(readout: Readout, change: Callable[[Specimen], Specimen | None]
                ) -> NewReadings | None:
    """Plan one more specimen of a film that was read, at its lowest, middle, top voltages."""
    setup, (number, mass, voltages) = readout.simulation.setup, _heaviest(readout)
    other = change(setup.specimens[number]) if readout.plates else None
    if other is None:
        return None
    some = voltages[np.unique(np.linspace(0, len(voltages) - 1, 3).round().astype(int))]

    def shown(extended: Setup) -> Array:
        model = build_model(extended.specimens[-1], coarse(extended.formula),
                            extended.rig.loading)
        outcomes = [outcome for _, outcome in voltage_ramp(model, mass, some.tolist(),
                                                           extended.rig, PathSettings())]
        if any(outcome.status != "equilibrium" for outcome in outcomes):
            raise ArithmeticError("no equilibrium")
        return np.array([extended.rig.reading(outcome.state.plate.deflection)
                         for outcome in outcomes])

    long, wide = (2e3 * half for half in other.frame.semi_axes)
    plate = 2e3 * max(other.needed_plate().outline.semi_axes)
    return NewReadings(
        replace(setup, specimens=(*setup.specimens, other)), shown,
        lambda values: Noise(np.full(len(values), readout.noise)), len(some), 1, 1,
        {"frame": f"{long:.4g} by {wide:.4g} mm", "plate": f"{plate:.4g} mm",
         **_loads(mass, float(some[-1]))})


def longer(specimen: Specimen) -> Specimen | None:
    """Make the frame elliptical, half as long again along x, if it is round or elliptical."""
    if not isinstance(specimen.frame, Circle | Ellipse):
        return None
    a, b = specimen.frame.semi_axes
    return replace(specimen, name="another shape", frame=Ellipse((_LONGER * a, b)))


def larger_plate(specimen: Specimen) -> Specimen | None:
    """Enlarge the plate of a specimen, if it is round and there is room."""
    plate = specimen.needed_plate()
    if not isinstance(plate.outline, Circle):
        return None
    try:
        return replace(specimen, name="another shape", plate=replace(
            plate, outline=Circle(_LARGER * plate.outline.radius)))
    except InputError:
        return None


def strips(readout: Readout) -> NewReadings:
    """Plan strips of a film that was read: free to narrow, and stretched both ways."""
    setup, (number, *_) = readout.simulation.setup, _heaviest(readout)
    top = _FURTHER * max(setup.specimens[number].membrane.prestretch)
    stretch = np.tile(np.linspace(1.0, top, 4)[1:], 2)
    mode, none = np.repeat(["uniaxial", "equibiaxial"], 3), np.full(6, np.nan)
    blank = np.full(6, "")
    coupons = Coupons(mode, stretch, np.zeros(6), blank, blank, none)
    tests = CouponTests(setup, coupons, np.full(6, number), np.arange(6), np.zeros(6, int))
    return NewReadings(setup, lambda extended: tests.shown(extended)[0],
                       lambda values: Noise(_STRIPS * np.abs(values)), 6, 0, 0,
                       {"stretch": f"{top:.2g}"})


#: Experiments offered where causes are indistinguishable: each takes seconds to predict.
SOLVED = (
    SolvedExperiment(WORDS["line"], film_line, "line"),
    SolvedExperiment(WORDS["longer_frame"], lambda readout: other_shape(readout, longer), "make"),
    SolvedExperiment(WORDS["larger_plate"], lambda readout: other_shape(readout, larger_plate),
                     "make"),
    SolvedExperiment(WORDS["strips"], strips, "coupons"),
)
