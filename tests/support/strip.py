"""A stretched strip that a rigid end bends in its plane, by finite elements.

Half of it, mirrored about x = 0; its sides are free and carry the loads of the equations of
:mod:`tests.oracles.bending`, turned with the bent strip.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import skfem
from scipy.spatial.transform import Rotation

from tests.oracles.bending import Strip
from tests.support.models import structured_mesh
from tests.support.specimens import circular
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.newton import newton
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import PlateMotion, State
from tympan.fem.results.fields import lost_tension
from tympan.geometry.mesh import ELEMENTS


class Section(NamedTuple):
    """Half way along the strip: its curvature, force and moment; the wrinkled share of the film.

    The angle per mounted length [1/m]; force along the strip [N]; moment about the middle between
    the sides [N m].
    """

    curvature: float
    force: float
    moment: float
    wrinkled: float


@dataclass(frozen=True, eq=False)
class BentStrip:
    """A strip three times as long as wide, in ``cells`` of two triangles across its width."""

    strip: Strip
    cells: int
    order: int = 4

    @property
    def half(self) -> float:
        """Half the mounted length [m]."""
        return 1.5 * self.strip.width

    @cached_property
    def model(self) -> Model:
        def place(points: np.ndarray) -> np.ndarray:
            return np.stack([self.half * points[0], self.strip.width * (points[1] - 0.5)])

        mesh = structured_mesh(self.order, (3 * self.cells // 2, self.cells), place)
        facets = mesh.boundary_facets()
        x, y = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
        inside = np.abs(y) < 0.499 * self.strip.width
        tags = {"axis_y": facets[inside & (x < self.half / 2)],
                "plate": facets[inside & (x > self.half / 2)],
                "inner": facets[~inside & (y < 0)], "outer": facets[~inside & (y > 0)]}
        stretch = self.strip.prestretch
        specimen = circular(NeoHooke(self.strip.mu), thickness=self.strip.thickness,
                            prestretch=(stretch, stretch))
        return Model(Discretisation.of(mesh.with_boundaries(tags), frozenset("x")), specimen,
                     Loading(guide="fixed"))

    def side_loads(self, curvature: float, sides: tuple[float, float]) -> np.ndarray:
        """Nodal forces of loads per mounted length that turn with the strip [N], (nodes, 3)."""
        mesh = self.model.discretisation.mesh
        straight = skfem.MeshTri1(mesh.p, mesh.t, validate=False)
        result = np.zeros_like(self.model.discretisation.reference)
        for name, load in zip(("inner", "outer"), (-sides[0], sides[1]), strict=True):
            basis = skfem.FacetBasis(straight, ELEMENTS[self.order](),
                                     facets=mesh.boundaries[name])
            for axis, part in enumerate((np.sin, np.cos)):
                form = skfem.LinearForm(lambda v, w, load=load, part=part:
                                        load * part(curvature * w.x[0]) * v)
                result[:, axis] += form.assemble(basis)
        return result

    def bent(self, curvature: float, force: float, steps: int = 3) -> Section:
        """By an angle per mounted length, in steps, its end where the equations have it."""
        state = self.model.mounted()
        for angle in np.linspace(0, curvature, steps + 1)[1:]:
            exact = self.strip.bent(angle, force)
            turn = Rotation.from_rotvec([0, 0, -angle * self.half])
            place = [exact.radius * np.sin(angle * self.half), 0.0, 0.0]
            plate = PlateMotion(place - turn.apply([self.half, 0, 0]), turn.as_matrix())
            vars(self.model)["weight"] = self.side_loads(angle, exact.sides)
            solution = newton(self.model, replace(state, plate=plate))
            state = solution.state
        assert solution.converged
        assert solution.wrinkling == 0
        return self._section(state)

    def _section(self, state: State) -> Section:
        mesh = self.model.discretisation
        cut = mesh.boundary_nodes("axis_y")
        pull = -self.model.nodal_forces(state)[cut, 0]
        height = state.positions[cut, 1]
        middle = (height.min() + height.max()) / 2
        third = np.isclose(mesh.reference[:, 0], self.half / 3)
        slope, _ = np.polyfit(state.positions[third, 1], state.positions[third, 0], 1)
        curvature = np.arctan(slope) / (self.half / 3)
        return Section(float(curvature), float(pull.sum()), float(pull @ (height - middle)),
                       lost_tension(self.model, [state])[0].share)

