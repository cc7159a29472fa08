"""A film at a point of its way, as limit states look at it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.equilibrium.arc_length import PathPoint
from tympan.fem.equilibrium.constraints import length
from tympan.fem.equilibrium.newton import Solution, moved
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load
from tympan.fem.results.fields import Fields, node_fields
from tympan.fem.results.firmness import edge_firmness, firmness, rough_firmness
from tympan.fem.results.limit_states import LimitState
from tympan.studies.case import mounted_place

#: Distance of a node from a corner, relative to the frame, that is at it: rounding of the mesher.
_AT_CORNER = 1e-6
#: Motion along a branch that shows where the film thins, relative to the frame.
_ONWARDS = 1e-4
#: Voltage [V] below which the charge's growth is that at this voltage: it is divided by it.
_HARDLY_CHARGED = 1e-3


@dataclass(frozen=True, eq=False)
class FilmPoint:
    """A film at a point of a branch along which a ``load`` grows.

    It computes a number when it is first asked for.
    """

    model: Model
    point: PathPoint
    load: Load = "voltage"

    @cached_property
    def fields(self) -> Fields:
        """Fields at the nodes of every element."""
        return node_fields(self.model, [self.point.state])[0]

    @cached_property
    def pressed(self) -> Fields:
        """Fields of the film if it could not wrinkle."""
        if not self.model.wrinkles:
            return self.fields
        return node_fields(replace(self.model, wrinkles=False), [self.point.state])[0]

    @cached_property
    def firmness(self) -> Array:
        """Least stiffness of the film within its plane at the nodes of every element [Pa]."""
        return firmness(self.model, self.point.state)

    @property
    def firm(self) -> bool:
        """Whether the film, if it could not wrinkle, does not give way in itself."""
        return bool(firmness(replace(self.model, wrinkles=False), self.point.state).min() > 0)

    @property
    def edge_firmness(self) -> float:
        """The least firmness of an electrode's edge [Pa]."""
        return float(edge_firmness(self.model, self.point.state).min())

    @property
    def rough_firmness(self) -> Array:
        """Firmness by each element's own strain [Pa]."""
        return rough_firmness(self.model, self.point.state)

    @property
    def thins(self) -> bool:
        """Whether it is by thinning, wrinkled, that the film gives way first."""
        return self.model.wrinkles and bool(self._thinning_margin <= self.firmness.min())

    @property
    def wrinkled(self) -> bool:
        """Whether the film has lost tension and goes on, wrinkled."""
        loose = self.model.wrinkles and not self.model.in_tension(self.point.state)
        return loose and self._thinning_margin >= 0

    @property
    def thinned(self) -> bool:
        """Whether a film that wrinkles would thin without bound before it gets here."""
        return self.model.wrinkles and self._thinning_margin < 0

    @cached_property
    def _thinning_margin(self) -> float:
        return float(self.model.thinning_margin(self.point.state))

    @cached_property
    def thinning(self) -> Array:
        """Thickness a little further along the branch over that here, at the nodes."""
        further = self._moved(_ONWARDS).fields.thickness
        return np.asarray(further / self.fields.thickness)

    @property
    def behind(self) -> FilmPoint:
        """The film a little further back along the branch."""
        return self._moved(-_ONWARDS)

    def _moved(self, motion: float) -> FilmPoint:
        """The film after a small motion in the branch's direction here."""
        point = self.point
        state = moved(self.model, point.state, point.direction, motion, {self.load: point.rate})
        solution = Solution(state, True, 0, point.solution.tangent)
        return replace(self, point=replace(point, solution=solution))

    @property
    def growth(self) -> float:
        """Growth along the branch of what is put on: the load."""
        return self.point.rate

    @property
    def given_way(self) -> float:
        """-1 where a taut film moves by itself before the load turns; 1 where it does not.

        0 where neither can be said: beyond the turn, without tension, and where the film has given
        way in one place.
        """
        tangent = self.point.solution.tangent
        taut = self.pressed.stress_2.min() > 0 and self.firmness.min() > 0
        if self.point.rate < 0 or not taut:
            return 0.0
        assert tangent is not None
        return 1.0 if tangent.negative == 0 else -1.0

    @property
    def deflection(self) -> float:
        """Deflection of the plate [m]."""
        return float(self.model.deflection(self.point.state))

    @property
    def voltage(self) -> float:
        """Voltage across the film [V]."""
        return float(np.sqrt(max(self.point.state.voltage_squared, 0.0)))

    @cached_property
    def capacitance(self) -> float:
        """Capacitance of the film as it is [F]."""
        return float(self.model.capacitance(self.point.state))

    def place(self, state: LimitState) -> tuple[float, float]:
        """Place in the mounted film where a limit state begins [m]."""
        return mounted_place(self.fields.position[np.argmin(state.field(self))])

    def on_electrode_edge(self, state: LimitState) -> bool:
        """Whether a limit state begins at the edge of an electrode, within the film."""
        mesh = self.model.discretisation
        node = mesh.connectivity.ravel()[np.argmin(state.field(self))]
        return bool((mesh.electrode_edge.every == node).any())

    def at_sharp_corner(self, state: LimitState) -> bool:
        """Whether a limit state begins in an element at a corner where the film is singular.

        A limit state of the whole film begins at none: such a corner changes it little.
        """
        if not state.local:
            return False
        mesh, specimen = self.model.discretisation, self.model.specimen
        element = int(np.argmin(state.field(self))) // mesh.connectivity.shape[1]
        nodes = mesh.reference[mesh.connectivity[element], None, :2]
        away = np.linalg.norm(nodes - specimen.sharp_corners, axis=-1)
        return bool((away < _AT_CORNER * max(specimen.frame.semi_axes)).any())


class ChargedPoint(FilmPoint):
    """A film at a point of a branch along which its charge grows, by its voltage."""

    @property
    def growth(self) -> float:
        """Growth of the charge C U along the branch."""
        model, point = self.model, self.point
        voltage = max(self.voltage, _HARDLY_CHARGED)
        inner, plate = model.by_load(point.state, "voltage")
        work = float(inner @ point.direction[0] + plate @ point.direction[1])
        growth = -2 * model.discretisation.mirrored * work
        return float(growth * voltage + self.capacitance * point.rate / (2 * voltage))

    @property
    def given_way(self) -> float:
        """0: at a given charge it cannot be said whether the film moves by itself."""
        return 0.0


class HeldPoint(FilmPoint):
    """A film whose plate is held, at a point of its way in deflection; the force follows."""

    @classmethod
    def of(cls, model: Model, solution: Solution) -> HeldPoint:
        """A held film by a solution with a tangent of its own."""
        assert solution.tangent is not None
        (film, plate), loads = solution.tangent.along()
        scale = length(model, (film, plate))
        direction = film / scale, plate / scale
        return cls(model, PathPoint(solution, direction, loads["force"] / scale), "force")

    @property
    def given_way(self) -> float:
        """0: a film with a held plate moves by itself only where it gives way in one place."""
        return 0.0
