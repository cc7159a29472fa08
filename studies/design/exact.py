"""Films of finite elements, each on a mesh of its own, to check reduced films."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.membrane.biases import acting
from tympan.fem.membrane.model import Model
from tympan.fem.results.limit_states import BREAKDOWN
from tympan.fem.results.solved_states import SolvedStates
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Limit, Settings, build_model, state_warnings
from tympan.studies.limits import limits
from tympan.studies.modes import carried, heaving_frequency
from tympan.studies.variables import Variable

#: Largest ratio of a film's end to the margin that it does not bear: the end is known to about
#: 1e-4.
_SHORT = 1 - 1e-4
#: Numbers in a warning; equal warnings of two states differ only in them.
_NUMBERS = re.compile(r"\d[\d.e+-]*")


@dataclass(frozen=True, eq=False)
class ExactFilm:
    """A film under a nominal mass [kg] and voltage [V].

    It is a :class:`~tympan.studies.wanted.Loaded` of one film.

    ``amplifier``: factor on the rig's voltage across the film. ``margin``: factor on the voltage in
    the third state. ``strength``: factor on the electric strength.
    """

    specimen: Specimen
    mass: float
    nominal: float
    rig: Rig
    settings: Settings
    margin: float = 1.0
    amplifier: float = 1.0
    strength: float = 1.0

    @property
    def specimens(self) -> Sequence[Specimen | None]:
        return (self.specimen,)

    @property
    def voltage(self) -> Array:
        return np.array([self.nominal])

    @property
    def _case(self) -> Case:
        return Case(self.specimen, mass=self.mass, voltage=self.nominal, rig=self.rig)

    @property
    def warnings(self) -> list[str]:
        """Warnings of the states up to the voltage, the last of each kind, and of the loads."""
        states = [outcome.state for outcome in self.outcomes[:2] if outcome.status == "equilibrium"]
        found = {_NUMBERS.sub("", words): words for state in states
                 for words in state_warnings(self._model, state)}
        return [*found.values(), *self._case.remarks]

    @cached_property
    def _model(self) -> Model:
        return build_model(self.specimen, self.settings, self.rig.loading)

    @property
    def _load(self) -> float:
        return float(self.rig.force(self.mass, self._model.plate_area))

    def _across(self, share: float) -> float:
        return float(self.rig.film_voltage(share * self.nominal)) * self.amplifier

    @cached_property
    def outcomes(self) -> list[Outcome]:
        """Equilibria at 0 V, at the voltage, and at the voltage times a margin above 1."""
        shares = (0.0, 1.0, self.margin) if self.margin > 1 else (0.0, 1.0)
        return [equilibrium(self._model, self._load, self._across(share), self.rig.gas_pressure,
                            settings=self.settings.path) for share in shares]

    @property
    def _there(self) -> Mask:
        """Mask of the outcomes that are equilibria."""
        return np.array([outcome.status == "equilibrium" for outcome in self.outcomes])

    @property
    def sound(self) -> bool:
        """Whether the states at 0 V and at the voltage are equilibria."""
        return bool(self._there[:2].all())

    @cached_property
    def _found(self) -> SolvedStates:
        """The outcomes' states; one without equilibrium has that of the last one before it."""
        return SolvedStates(self._model, [outcome.state for outcome in self.outcomes],
                            self.strength)

    def _row(self, values: Array) -> Array:
        return np.where(self._there, [values], np.nan)

    def shown(self, variable: Variable) -> Array:
        """Compute a variable of the states, (1, states); nan where there is no equilibrium."""
        assert variable.of is not None
        return self._row(variable.of(self._found))

    @property
    def deflection(self) -> Array:
        return self._row(self._found.deflection)

    @property
    def stroke(self) -> Array:
        return self.deflection[:, 1] - self.deflection[:, 0]

    @property
    def capacitance(self) -> Array:
        return self._row(self._found.capacitance)

    @property
    def force(self) -> Array:
        _, push, _ = acting(self._model.loading.biases, self.deflection)
        lifted = self.rig.gas_pressure * float(self._model.plate_area)
        return np.asarray(self._load - push - lifted)

    @property
    def stress(self) -> Array:
        """Largest stress; beyond a limit that of the last equilibrium before it."""
        stress = self._found.stress[None]
        return stress if self.sound else np.full_like(stress, np.nan)

    @property
    def tension(self) -> Array:
        """Least tension; beyond a limit it is that of a film that bears compression."""
        found = self._row(self._found.tension)
        if self.sound and not self._there.all():  # the tension falls with U², to 0 at the limit
            end = min(float(self.limit[0]), _SHORT * self.margin)
            found[0, -1] = found[0, 0] * (1 - (self.margin / end) ** 2)
        return found

    @property
    def breakdown(self) -> Array:
        return self._row(self._found.breakdown)

    @cached_property
    def blocked_force(self) -> Array:
        if not self.sound or self.specimen.plate is None:
            return np.array([np.nan])
        rest = self.outcomes[0]
        blocked = held(self._model, self._model.deflection(rest.state), self._across(1.0),
                       rest.solution, self.settings.path)
        return np.array([self._load - float(blocked.state.force)])

    @cached_property
    def frequency(self) -> Array:
        if not self.sound or self.specimen.plate is None:
            return np.array([np.nan])
        plate = carried(self._case)
        found = [heaving_frequency(self._model, outcome.state, plate)
                 for outcome in self.outcomes[:2]]
        return np.array([min(np.nan if each is None else each for each in found)])

    @cached_property
    def _limits(self) -> tuple[Limit, ...]:
        found = limits(self._case, self.settings)
        if found.breakdown is not None and found.reached == (found.breakdown,):
            # Where no bound keeps the film from breaking down, its other limits count.
            found = limits(self._case, self.settings, beyond=True)
        return found.reached

    @property
    def limit(self) -> Array:
        ends = [each.voltage_V for each in self._limits if each.kind != BREAKDOWN.kind]
        return np.array([min(ends, default=np.inf) / self.nominal if self.nominal else np.inf])

    @property
    def first_limit(self) -> Array:
        return np.array([min((each.voltage_V for each in self._limits), default=np.inf)])
