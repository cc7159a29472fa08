"""Curve, limits, blocked force, then bands of a view, by a family of reduced films about it.

The family is made in a process of its own, in some seconds, and then computes the answers there.
Films outside the family are left to finite elements.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.paths import with_arrays
from tympan.explore.latest import Answer, Pause
from tympan.explore.session import Bands, Blocked, FollowedCurve, LargestError
from tympan.explore.view import FilmView, control_value, controls
from tympan.fem.results.limit_states import PULL_IN
from tympan.fem.rig import MOST_VOLTAGE
from tympan.studies.case import Limit, Limits, Settings
from tympan.studies.films.box import STIFFNESS, Box, kind_of, varying
from tympan.studies.films.family import FamilySettings, FilmFamily, require_reducible
from tympan.studies.films.population import Population
from tympan.studies.films.rise import FamilyRise, rise
from tympan.studies.limits.curve import CURVES, CurveResult, MassCurve
from tympan.studies.tolerance.bands import bands, points, told_bands
from tympan.studies.tolerance.drawn import Scattered
from tympan.studies.tolerance.given import Tolerances

#: Largest relative difference of the films' numbers from those of the view: about 20 steps of a
#: slider. A wider range would need more shapes, which would take too long.
_WIDE = 0.2
#: Highest voltage of the family over that at which the view's film ends: enough for thicker films.
_BEYOND = 1.3
#: Settings of a family: within the digits that are printed, in some seconds. Voltages at which
#: films near an oval lose tension are then off by 8e-4; with an error of 2e-4 it was 1.7e-3.
_FAMILY = FamilySettings(error=1e-4, rounds=3, checks=12)
#: Nice value of its process: its priority is below that of pictures, and above that of curves of
#: finite elements.
_BEHIND = 5


#: Time without another view before the bands of a view are sought [s]: controls are then at rest.
_REST = 0.15
#: Voltages at which a curve has bands, evenly in U²: edges bend most where the film ends.
_VOLTAGES = 9
#: Parts in which films of a band are computed; the band is shown after each. The first 64 films of
#: 512 give its edges to about 15 % of its width, all of them to 5 %.
_PARTS = 8


@dataclass(frozen=True, eq=False)
class QuickCurve:
    """Answer of a family to a view; ``curve`` is None where the family has no such film."""

    view: FilmView
    curve: FollowedCurve | None = None
    blocked: Blocked | None = None


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Films about a ``view`` and loads up to a ``mass`` [kg] and a nominal ``voltage`` [V].

    Views are within ``reach``. All films, including those that scatter about a view, are within
    ``box``.
    """

    view: FilmView
    reach: Box
    box: Box
    mass: float
    voltage: float
    settings: Settings = field(default_factory=Settings)
    tolerances: Tolerances | None = None

    @classmethod
    def of(cls, view: FilmView, voltage: float, tolerances: Tolerances | None = None
           ) -> Neighbours | None:
        """Choose the neighbours of a film that ends at a voltage; None where none can be reduced.

        Numbers that are 0 are not varied, if they do not scatter: most are offsets, which remove
        the film's mirror planes.
        """
        try:
            require_reducible(view.specimen, view.rig)
            known = {*varying(view.specimen), STIFFNESS}
            limits = {key: ((1 - _WIDE) * value, (1 + _WIDE) * value)
                      for key in (control.key for control in controls(view))
                      if key in known and (value := control_value(view, key)) > 0}
            reach = box = Box.around(view.specimen, limits)
            if tolerances is not None:
                box = Scattered.of(view.specimen, tolerances).box(limits, generous=True)
        except InputError:
            return None
        # At an electrode's edge within the film, the film may become unstable in itself.
        if not view.specimen.electrode.everywhere:
            return None
        mass = next(control for control in controls(view) if control.key == "mass")
        return cls(view, reach, box, mass.high / mass.factor, min(_BEYOND * voltage, MOST_VOLTAGE),
                   tolerances=tolerances)

    def row(self, view: FilmView) -> Array | None:
        """Compute the parameters of a view, (names,); None where it is not one of these films."""
        base = self.view.specimen
        if view.rig != self.view.rig or not 0 <= view.mass <= self.mass:
            return None
        if kind_of(view.specimen) != kind_of(base):
            return None
        names = [name for name in self.reach.names if name != STIFFNESS]
        same = with_arrays(view.specimen, {name: control_value(self.view, name) for name in names})
        inner, row = (np.array([control_value(view, name) for name in box.names])
                      for box in (self.reach, self.box))
        return row if same == base and self.reach.holds(inner[None])[0] else None

    def family(self) -> FilmFamily | None:
        """Make the family of these films; None where it cannot be made."""
        scattered = Scattered.of(self.view.specimen, self.tolerances)
        try:
            return scattered.family(self.box, (0.0, self.mass), self.voltage, self.view.rig,
                                    self.settings, _FAMILY)
        except InputError:
            return None


@dataclass(eq=False)
class _Scatter:
    """Films of a family that scatter about a view; the bands of the last curve are kept."""

    family: FilmFamily
    tolerances: Tolerances
    curve: Bands | None = None

    def bands(self, view: FilmView, row: Array, end: float) -> Iterator[Bands | Pause]:
        """Yield bands of a view's numbers and of its curve to an end [V], from ever more films."""
        yield Pause(_REST)
        film = replace(view, voltage=0.0)
        known = self.curve if self.curve is not None and self.curve.view == film else None
        scattered = Scattered.of(view.specimen, self.tolerances)
        films = scattered.films(self.family, row, points(scattered), view.rig)
        found = Bands(view, *((), ()) if known is None else (known.voltages, known.deflections))
        for solved in _growing(films, view.mass, np.array([view.voltage])):
            found = replace(found, numbers=told_bands(solved))
            yield found
            yield Pause()
        if known is not None:
            return
        voltages = end * np.linspace(0.0, 1.0, _VOLTAGES) ** 0.5
        for solved in _growing(films, view.mass, voltages):
            found = replace(found, voltages=tuple(voltages.tolist()),
                            deflections=bands(solved["deflection_m"]))
            yield found
            yield Pause()
        self.curve = replace(found, view=film)


def _growing(films: Population, mass: float, voltages: Array) -> Iterator[dict[str, Array]]:
    """Yield numbers of ever more films at some voltages [V]; the first has no scatter."""
    solved: list[dict[str, Array]] = []
    for some in np.array_split(np.arange(1, len(films)), _PARTS):
        found = films.part(np.append(0, some)).numbers(mass, voltages)
        solved.append({key: values[bool(solved):] for key, values in found.items()})
        yield {key: np.concatenate([each[key] for each in solved]) for key in found}


def quick_answers(films: Neighbours) -> Answer:
    """Answer views by a family, in its own process."""
    os.nice(_BEHIND)
    return by_family(films)


def by_family(films: Neighbours) -> Answer:
    """Answer views by a family, once it is made."""
    family = films.family()
    last: list[tuple[FilmView, Array | None, FamilyRise | None]] = []
    scatter = None
    if family is not None and films.tolerances is not None:
        scatter = _Scatter(family, films.tolerances)

    def answer(view: FilmView) -> Iterator[QuickCurve | Bands | Pause]:
        if family is None:
            return
        film = replace(view, voltage=0.0)
        if not last or last[0][0] != film:
            row, before = films.row(view), last[0][2] if last else None
            force = view.case.force(view.specimen.plate_area)
            last[:] = [(film, row, None if row is None else rise(family, row, force, before))]
        _, row, risen = last[0]
        yield (QuickCurve(view) if row is None or risen is None else
               _quick(view, family, row, risen))
        if row is not None and risen is not None and scatter is not None:
            highest = view.rig.shown_voltage(float(risen.squared[-1]) ** 0.5)
            yield from scatter.bands(view, row, highest)

    return answer


def _quick(view: FilmView, family: FilmFamily, row: Array, risen: FamilyRise) -> QuickCurve:
    across = view.case.film_voltage
    force = family.held_forces(row[None], risen.rest[None], np.array([across]))[0]
    carried = view.case.force(view.specimen.plate_area)
    blocked = Blocked(view, float(carried - force), risen.off) if np.isfinite(force) else None
    place = float(np.interp(across**2, risen.squared, risen.deflection))
    off = LargestError(risen.error(place), risen.whole)
    return QuickCurve(view, FollowedCurve(view, _curve(view, risen), off=off), blocked)


def _curve(view: FilmView, risen: FamilyRise) -> CurveResult:
    """Make a view's curve like :func:`tympan.studies.limits.curve`, to the family's end."""
    rig, mass = view.rig, view.mass
    nominal = [rig.shown_voltage(squared**0.5) for squared in risen.squared.tolist()]
    limits = Limits({kind: Limit(
        kind=kind, voltage_V=rig.shown_voltage(limit.squared**0.5), x_m=limit.x, y_m=limit.y,
        spread=limit.off / (2 * limit.squared),
        ring=view.case.axisymmetric).of(view.specimen)
        for kind, limit in risen.limits.items()}, ended=PULL_IN.label if risen.whole else
        "finite elements follow it on from there")
    table = {column.name: np.full(len(nominal), np.nan) if column.choices is None
             else np.full(len(nominal), "") for column in CURVES}
    table |= {"mass": np.full(len(nominal), mass), "voltage": np.array(nominal),
              "asked": np.zeros(len(nominal)), "deflection": risen.deflection}
    return CurveResult(specimen=view.specimen.name, dofs=0, wall_s=0.0, table=table,
                       curves=(MassCurve(mass_kg=mass, limits=limits),))
