"""A film at a point of its path, for limit states."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.equilibrium.arc_segment import PathPoint
from tympan.fem.equilibrium.constraints import length
from tympan.fem.equilibrium.newton import Solution, moved, newton
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load
from tympan.fem.results.fields import Fields, largest
from tympan.fem.results.firmness import edge_firmness, firmness, least_firmness, rough_firmness
from tympan.fem.results.limit_states import LimitState
from tympan.fem.results.solved_states import SolvedStates, mounted_place

#: Largest distance of a node at a corner, relative to the frame: rounding of the mesher.
_AT_CORNER = 1e-6
#: Motion along a branch, relative to the frame, that shows where the film thins.
_ONWARDS = 1e-4
#: Least voltage [V] in the growth of the charge, which divides by the voltage.
_HARDLY_CHARGED = 1e-3


@dataclass(frozen=True, eq=False)
class FilmPoint:
    """A film at a point of a branch along which a ``load`` grows.

    Each quantity is computed at first use.
    """

    model: Model
    point: PathPoint
    load: Load = "voltage"

    @cached_property
    def shown(self) -> SolvedStates:
        """The state with what it shows, in arrays of one element."""
        return SolvedStates(self.model, [self.point.state])

    @property
    def fields(self) -> Fields:
        """Fields at the nodes of every element."""
        return self.shown.at_nodes[0]

    @property
    def pressed(self) -> Fields:
        """Fields of the film if it could not wrinkle."""
        return self.shown.pressed[0]

    @cached_property
    def least_stress(self) -> float:
        """Least of the smaller principal stresses of the film if it could not wrinkle [Pa]."""
        least = self.model.least_stress(self.point.state)
        return float(self.pressed.stress_2.min(initial=np.inf)) if least is None else least

    @cached_property
    def firmness(self) -> Array:
        """Least stiffness in the film's plane at the nodes of every element [Pa]."""
        return firmness(self.model, self.point.state)

    @cached_property
    def unbalanced(self) -> float:
        """Largest unbalanced force on a free component, over the largest nodal force."""
        return self.model.unbalanced(self.point.state)

    @cached_property
    def firm(self) -> bool:
        """Whether the film is stable in its plane, if it could not wrinkle."""
        return least_firmness(replace(self.model, wrinkles=False), self.point.state) > 0

    @property
    def edge_firmness(self) -> float:
        """Least stiffness of an electrode's edge [Pa]."""
        return float(edge_firmness(self.model, self.point.state).min(initial=np.inf))

    @property
    def rough_firmness(self) -> Array:
        """Least stiffness in the film's plane from each element's own strain [Pa]."""
        return rough_firmness(self.model, self.point.state)

    @property
    def thins(self) -> bool:
        """Whether the first instability of the film is thinning while wrinkled."""
        return self.model.wrinkles and bool(
            self._thinning_margin <= self.firmness.min(initial=np.inf))

    @property
    def wrinkled(self) -> bool:
        """Whether the film has lost tension but still has a wrinkled equilibrium."""
        loose = self.model.wrinkles and not self.model.in_tension(self.point.state)
        return loose and self._thinning_margin >= 0

    @property
    def thinned(self) -> bool:
        """Whether a film that wrinkles would thin without bound before this point."""
        return self.model.wrinkles and self._thinning_margin < 0

    @cached_property
    def _thinning_margin(self) -> float:
        return float(self.model.thinning_margin(self.point.state))

    @cached_property
    def thinning(self) -> Array:
        """Thickness a little further along the branch, relative to that here, at the nodes."""
        further = self._moved(_ONWARDS).fields.thickness
        return np.asarray(further / self.fields.thickness)

    @property
    def behind(self) -> FilmPoint:
        """The film a little further back along the branch."""
        return self._moved(-_ONWARDS)

    def _moved(self, motion: float) -> FilmPoint:
        """Move the film a little in the branch's direction at this point."""
        point = self.point
        state = moved(self.model, point.state, point.direction, motion, {self.load: point.rate})
        solution = Solution(state, True, 0, point.solution.tangent)
        return replace(self, point=replace(point, solution=solution))

    @cached_property
    def coarser(self) -> FilmPoint | None:
        """The film under the same loads, with elements of one order less on the same triangles."""
        fine, state = self.model.discretisation, self.point.state
        if fine.mesh.order == 1:
            return None
        coarse = fine.of_order(fine.mesh.order - 1)
        motion = coarse.interpolated(fine, state.positions - fine.reference)
        model = replace(self.model, discretisation=coarse)
        solution = newton(model, replace(state, positions=coarse.reference + motion))
        solution.release()
        if not solution.converged:
            return None
        return replace(self, model=model, point=replace(self.point, solution=solution))

    @property
    def growth(self) -> float:
        """Change of the load along the branch."""
        return self.point.rate

    @property
    def given_way(self) -> float:
        """-1 if a taut film is unstable before the load's limit point, 1 if it is stable.

        0 if neither can be decided: beyond the limit point, without tension, or if the film is
        unstable in one place.
        """
        tangent = self.point.solution.tangent
        taut = self.least_stress > 0 and self.firmness.min(initial=np.inf) > 0
        if self.point.rate < 0 or not taut:
            return 0.0
        assert tangent is not None
        return 1.0 if tangent.negative == 0 else -1.0

    @property
    def deflection(self) -> float:
        """Deflection of the plate [m]."""
        return float(self.model.deflection(self.point.state))

    @property
    def max_stretch(self) -> float | None:
        """Largest principal stretch, from the virgin film; None for a film without fields."""
        return largest(self.fields.stretch_1)

    @property
    def voltage(self) -> float:
        """Voltage across the film [V]."""
        return float(np.sqrt(max(self.point.state.voltage_squared, 0.0)))

    @cached_property
    def capacitance(self) -> float:
        """Capacitance of the deformed film [F]."""
        return float(self.model.capacitance(self.point.state))

    def place(self, state: LimitState) -> tuple[float, float]:
        """Find the place in the mounted film where a limit state begins [m]."""
        margin = state.field(self)
        return mounted_place(self.fields.position[np.argmin(margin)] if margin.size
                             else self.model.centre)

    def segment(self, state: LimitState) -> str | None:
        """Name the segment in which a limit state begins, or those nearest to that bare place.

        None for an electrode in one piece.
        """
        specimen, mesh = self.model.specimen, self.model.discretisation
        names = specimen.electrode.names
        if not names or not self.model.meshed:
            return None
        node = int(np.argmin(state.field(self)))
        element = node // mesh.connectivity.shape[1]
        if mesh.covered[element, 0]:
            return str(names[mesh.segments[element]])
        x, y = self.fields.position[node, :2].tolist()
        return specimen.segment_near(x, y)

    def on_electrode_edge(self, state: LimitState) -> bool:
        """Check whether a limit state begins at an electrode's edge, within the film."""
        if not self.model.meshed:
            return False
        mesh = self.model.discretisation
        node = mesh.connectivity.ravel()[np.argmin(state.field(self))]
        return bool((mesh.electrode_edge.every == node).any())

    def at_sharp_corner(self, state: LimitState) -> bool:
        """Check whether a limit state begins in an element at a singular corner.

        A limit state of the whole film does not: such a corner changes it little.
        """
        if not (state.local and self.model.meshed):
            return False
        mesh, specimen = self.model.discretisation, self.model.specimen
        element = int(np.argmin(state.field(self))) // mesh.connectivity.shape[1]
        nodes = mesh.reference[mesh.connectivity[element], None, :2]
        away = np.linalg.norm(nodes - specimen.sharp_corners, axis=-1)
        return bool((away < _AT_CORNER * max(specimen.frame.semi_axes)).any())


class ChargedPoint(FilmPoint):
    """A film at a point of a branch along which its charge grows."""

    @property
    def growth(self) -> float:
        """Change of the charge C U along the branch."""
        model, point = self.model, self.point
        voltage = max(self.voltage, _HARDLY_CHARGED)
        inner, plate = model.by_load(point.state, "voltage")
        work = float(inner @ point.direction[0] + plate @ point.direction[1])
        growth = -2 * model.discretisation.mirrored * work
        return float(growth * voltage + self.capacitance * point.rate / (2 * voltage))

    @property
    def given_way(self) -> float:
        """0: at a given charge the stability of the film cannot be decided."""
        return 0.0


class HeldPoint(FilmPoint):
    """A film with a held plate, at a point of its path in deflection; the force is the reaction."""

    @classmethod
    def of(cls, model: Model, solution: Solution) -> HeldPoint:
        """Create from a solution that has its own tangent."""
        assert solution.tangent is not None
        (film, plate), loads = solution.tangent.along()
        scale = length(model, (film, plate))
        direction = film / scale, plate / scale
        return cls(model, PathPoint(solution, direction, loads["force"] / scale), "force")

    @property
    def given_way(self) -> float:
        """0: a film with a held plate is unstable only if it is unstable in one place."""
        return 0.0
