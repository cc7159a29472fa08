"""Where a film gives way in itself, against the energy's own second differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.specimens import circular
from tympan.fem.derivatives.quantities import firmness_at
from tympan.fem.derivatives.sensitivity import gradient_many, parameters
from tympan.fem.equilibrium.newton import moved, newton
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.density import FilmDensity
from tympan.fem.film.laws import NeoHooke, Yeoh
from tympan.fem.results.firmness import EdgeSpot, firmness, spot_at
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen
from tympan.studies.case import Settings, build_model

SOFTENING = Yeoh((13.1e3, -0.21e3, 9.3))
UNEQUAL = replace(circular(NeoHooke(20e3), prestretch=(2.6, 1.8)),
                  electrode=Electrode(stiffness=8e3))


def smallest_by_differences(density: FilmDensity, f: np.ndarray, count: int = 60) -> float:
    """min over a, n of d²ψ(F + s a⊗n)/ds² of the mounted film's plane, a and n of length 1."""
    angles = np.pi * np.arange(count) / count
    a, n = np.meshgrid(angles, angles, indexing="ij")
    jump = np.einsum("i...,j...->...ij", np.array([np.cos(a), np.sin(a)]),
                     np.array([np.cos(n), np.sin(n)]))

    def energy(step: float) -> np.ndarray:
        g = f + step * jump
        c = np.einsum("...ki,...kj->...ij", g, g)
        return density((c[..., 0, 0], c[..., 1, 1], c[..., 0, 1]), tangent=False).energy

    step = 2e-4
    return float(((energy(step) - 2 * energy(0.0) + energy(-step)) / step**2).min())


@pytest.mark.parametrize("exponent", [-0.6, -1.0])
def test_a_film_gives_way_where_a_jump_costs_no_energy(exponent: float) -> None:
    """As the voltage rises at given stretches: to a thousandth of it, whatever its formula."""
    specimen = circular(SOFTENING, prestretch=(1.93, 1.93), permittivity_exponent=exponent)
    rng = np.random.default_rng(1)
    checked = 0
    for _ in range(8):
        f = np.diag([rng.uniform(1.3, 1.9), rng.uniform(0.95, 1.1)])
        f = f + rng.uniform(-0.05, 0.05, (2, 2))
        c = f.T @ f
        parts = tuple(np.array([value]) for value in (c[0, 0], c[1, 1], c[0, 1]))

        def density(voltage: float) -> FilmDensity:
            return FilmDensity(specimen, voltage**2, 1.0, wrinkles=False)

        low, high = 0.0, 20e3
        for _ in range(40):
            middle = (low + high) / 2
            margin = float(density(middle).firmness(parts)[0])
            low, high = (middle, high) if 0 < margin < np.inf else (low, middle)
        if not density(1.001 * high).firmness(parts)[0] < 0:  # it loses its tension before
            continue
        checked += 1
        assert smallest_by_differences(density(0.999 * high), f) > 0
        assert smallest_by_differences(density(1.001 * high), f) < 0
    assert checked >= 3


@pytest.mark.parametrize("voltage", [0.0, 4e3, 6e3])
def test_an_electrode_with_axes_of_its_own_is_tried_line_by_line(voltage: float) -> None:
    """Positive together with the energy's second differences, and near to them."""
    density = FilmDensity(UNEQUAL, voltage**2, 1.0, wrinkles=False)
    c = tuple(np.array([value]) for value in (1.2, 1.1, 0.05))
    root = np.linalg.cholesky(np.array([[1.2, 0.05], [0.05, 1.1]])).T
    assert density.firmness(c)[0] == pytest.approx(smallest_by_differences(density, root, 180),
                                                   rel=1e-3)


#: Films near to where they give way: strain recovered, wrinkled, line by line, on both sides.
WEAK = {
    "softening": (Specimen("oval", Ellipse((36e-3, 28e-3)), Plate(Circle(7.3e-3)), Film(
        0.83e-3, (1.93, 1.93), SOFTENING, 3.1, permittivity_exponent=-0.6)), 0.57, 5.2e3, False),
    "greased": (Specimen("oval", Ellipse((36e-3, 28e-3)), Plate(Circle(7.3e-3)), Film(
        0.83e-3, (2.0, 1.9), SOFTENING, 3.1, permittivity_exponent=-0.6),
        Electrode(stiffness=2e3)), 0.57, 5.2e3, False),
    "wrinkled": (Specimen("bare", Circle(31.7e-3), Plate(Circle(7.3e-3)), Film(
        0.61e-3, (1.09, 1.09), NeoHooke(23e3), 3.1),
        Electrode(margin_frame=11.3e-3, margin_plate=2.9e-3)), 0.27, 9.8e3, True),
    "beside an electrode's edge": (Specimen("edged", Ellipse((65.5e-3, 34.8e-3)), Plate(
        Circle(8.1e-3)), Film(0.82e-3, (2.7, 2.7), NeoHooke(20e3), 4.0),
        Electrode(margin_frame=5.3e-3, margin_plate=2.7e-3)), 0.0647, 5.305e3, False)}


@pytest.mark.parametrize("name", WEAK)
def test_firmness_at_a_spot_has_exact_derivatives(name: str) -> None:
    """By motions at rest, and by film, loads and lengths along with the equilibrium."""
    specimen, force, voltage, thins = WEAK[name]
    model = build_model(specimen, Settings())
    outcome = equilibrium(model, force, voltage)
    state, margins = outcome.state, firmness(model, outcome.state)
    assert outcome.status == "equilibrium"
    place = int(margins.argmin())
    spot = spot_at(model, state, place)
    quantity = firmness_at(spot)
    assert isinstance(spot, EdgeSpot) == name.endswith("edge")
    assert isinstance(spot, EdgeSpot) or (spot.thinning, spot.recovered) == (thins, not thins)
    assert quantity.value(model, state) == pytest.approx(margins[place], abs=1e-6)
    random = np.random.default_rng(3)
    slope = quantity.slope(model, state)
    motion = (1e-3 * random.normal(size=slope[0].shape), 1e-3 * random.normal(size=slope[1].shape))
    ends = [quantity.value(model, moved(model, state, motion, step)) for step in (1e-6, -1e-6)]
    assert slope[0] @ motion[0] + slope[1] @ motion[1] == pytest.approx(
        (ends[0] - ends[1]) / 2e-6, rel=1e-6)
    by = {key: parameter for key, parameter in parameters(model).items()
          if parameter.value(model, state) and not key.startswith("loading")}
    assert {"voltage", "force", "membrane.prestretch.0", "plate.outline.radius"} < by.keys()
    slopes = gradient_many(model, outcome, {"": quantity}, by)[""]
    for key, parameter in by.items():
        step = 1e-4 * parameter.value(model, state)
        solved = [newton(*parameter.changed(model, state, change)) for change in (step, -step)]
        moved_models = [parameter.changed(model, state, change)[0] for change in (step, -step)]
        values = [quantity.value(there, solution.state)
                  for there, solution in zip(moved_models, solved, strict=True)]
        assert slopes[key] == pytest.approx((values[0] - values[1]) / (2 * step), rel=1e-4), key


def test_wrinkles_alone_are_no_instability() -> None:
    """A film pressed across has no stiffness there, and keeps its tension along."""
    film = circular(NeoHooke(20e3), prestretch=(1.2, 1.2))
    c = tuple(np.array([value]) for value in (1.5**2, 0.6**2, 0.0))
    density = FilmDensity(film, 0.0, 1.0)
    assert density.firmness(c)[0] == np.inf


def test_neo_hooke_loses_tension_before_it_gives_way() -> None:
    """Ψ₂₂ − Ψ₂/λ₂ = 4μ/(λ₁²λ₂⁴) is positive at any voltage, and so are the other conditions."""
    film = circular(NeoHooke(20e3))
    stretch = np.geomspace(0.8, 2.0, 15)
    first, second = (value.ravel() for value in np.meshgrid(stretch, stretch))
    c = (first**2, second**2, 0 * first)
    for voltage in np.linspace(0, 12e3, 25):
        assert (FilmDensity(film, voltage**2, 1.0, wrinkles=False).firmness(c) > 0).all()


@pytest.mark.parametrize("order", [3, 4])
def test_recovered_values_are_exact_up_to_a_degree_below_the_elements(order: int) -> None:
    """On one side of an electrode's edge, whatever stands on the other."""
    specimen = replace(circular(), electrode=Electrode(margin_plate=5e-3))
    mesh = build_model(specimen, Settings(MeshSettings(order=order).refined(0.7))).discretisation
    places = np.matmul(mesh.shapes, mesh.reference[mesh.connectivity])
    corners = mesh.reference[mesh.connectivity[:, :3]]
    bare = mesh.covered == 0

    def field(at: np.ndarray) -> np.ndarray:
        x, y = 1e2 * at[..., 0], 1e2 * at[..., 1]
        return np.asarray(x ** (order - 1) - 2 * x * y + 1 + 50 * bare)

    values = mesh.recovery.recovered(field(places)[None], np.arange(len(corners)))[0]
    assert values == pytest.approx(field(corners), rel=1e-8, abs=1e-8)
