"""Spots that an electrode misses: closed forms, the axisymmetric membrane with a bare ring, other
meshes, and derivatives by where and how wide they are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import epsilon_0
from scipy.special import gamma

from tests.oracles.axisymmetric import solve_deflection
from tests.support.models import model
from tests.support.specimens import circular, elliptical, reference_film, skewed, specimen_toml
from tympan.base.errors import InputError
from tympan.fem.derivatives.quantities import FUNCTIONALS
from tympan.fem.derivatives.sensitivity import gradient_many, parameters
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.model import Model
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Electrode, Patch, Plate, Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.effects import EFFECTS, Setup

SPOT = Patch((27e-3, 5e-3), 12e-3)
#: C = ε A/t of the flat mounted film, per area.
PER_AREA = 4.7 * epsilon_0 / (1e-3 / 5)


def spotted(*patches: Patch, specimen: Specimen | None = None) -> Specimen:
    specimen = circular() if specimen is None else specimen
    return replace(specimen, electrode=replace(specimen.electrode, patches=patches))


def missing(*patches: Patch, refine: float = 1.2) -> float:
    """Capacitance that patches take from the flat film [F]."""
    films = [model(spotted(*some), refine=refine) for some in ((), patches)]
    whole, less = (film.capacitance(film.mounted()) for film in films)
    return float(whole - less)


def test_a_spot_takes_its_area_from_the_capacitance() -> None:
    """∫ 2^(-s⁴) dA = π d²/4 Γ(3/2)/√(ln 2), with s = 2 r/d, and spots far apart add up."""
    area = np.pi * SPOT.diameter**2 / 4 * gamma(1.5) / np.sqrt(np.log(2))
    assert missing(SPOT) == pytest.approx(PER_AREA * area, rel=1e-4)
    other = Patch((-20e-3, -18e-3), 9e-3)
    assert missing(SPOT, other) == pytest.approx(missing(SPOT) + missing(other), rel=1e-6)


def test_a_spot_about_the_plate_is_a_bare_ring() -> None:
    """Force, capacitance and shape by the axisymmetric membrane's energy."""
    width, heave, voltage = 44e-3, 8e-3, 4e3

    def coverage(radius: np.ndarray) -> np.ndarray:
        return 1 - 0.5 ** ((2 * radius / width) ** 4)

    round_film = reference_film(circular().membrane.material)
    exact, whole = (solve_deflection(replace(round_film, coverage=covered), heave, voltage)
                    for covered in (coverage, None))
    film = model(spotted(Patch((0.0, 0.0), width)), refine=1.5)
    assert film.specimen.axisymmetric
    assert film.specimen.mirror_planes == {"x", "y"}
    state = held(film, heave, voltage).state
    assert exact.force > 1.05 * whole.force
    assert state.force == pytest.approx(exact.force, rel=1e-5)
    height = np.interp(np.hypot(*film.discretisation.reference[:, :2].T),
                       radius := np.linspace(10e-3, 45e-3, 2000), exact.z(radius))
    assert np.abs(state.positions[:, 2] - height).max() < 1e-6


def test_a_band_without_field_does_the_same_as_a_margin() -> None:
    """Beyond a spot as wide as half the gap, whose edge fades, a margin of equal area is alike."""
    width, voltage = 40e-3, 4e3
    spot = model(spotted(Patch((0.0, 0.0), width)), refine=1.5)
    area = (spot.discretisation.weights * (1 - spot.covered)).sum() * 4
    margin = np.sqrt(area / np.pi + 10e-3**2) - 10e-3
    band = model(replace(circular(), electrode=Electrode(margin_plate=margin)), refine=1.5)
    heaves = [equilibrium(film, 0.2, voltage).state.plate.deflection
              for film in (model(circular()), spot, band)]
    assert heaves[0] - heaves[2] > 20e-6
    assert heaves[1] == pytest.approx(heaves[2], abs=0.1 * (heaves[0] - heaves[2]))


def test_another_mesh_and_order_has_the_same_film() -> None:
    films = [build_model(spotted(SPOT), Settings(MeshSettings(order=order).refined(refine)))
             for order, refine in ((4, 1.0), (2, 3.0))]
    states = [equilibrium(film, 0.2, 4e3).state for film in films]
    bare = equilibrium(model(circular()), 0.2, 4e3).state.plate
    moved = bare.deflection - states[0].plate.deflection
    assert moved > 3e-6
    assert states[0].plate.deflection == pytest.approx(states[1].plate.deflection,
                                                       abs=0.02 * moved)
    assert states[0].plate.tilt == pytest.approx(states[1].plate.tilt, rel=0.01)
    assert states[0].plate.tilt > 1e-4


def test_the_same_film_seen_from_the_other_side() -> None:
    outcomes = []
    for side in (1, -1):
        film = model(spotted(Patch((side * 27e-3, 0.0), 15e-3)))
        assert film.specimen.mirror_planes == {"y"}
        state = equilibrium(film, 0.2, 4e3).state
        outcomes.append([state.plate.deflection, state.plate.rotation[0, 2],
                         *(float(part[0]) for part in film.integrals([state])[1:])])
    first, second = np.array(outcomes)
    # The mesh is not its own mirror image.
    assert first[[0, 2, 3]] == pytest.approx(second[[0, 2, 3]], rel=1e-5)
    assert first[1] == pytest.approx(-second[1], rel=1e-3)


@pytest.fixture(scope="module")
def patched() -> Model:
    """Patches on a film without symmetry, of electrodes that are stiff and heavy."""
    film = skewed()
    electrode = replace(film.electrode, mass=0.05,
                        patches=(Patch((-25e-3, 6e-3), 25e-3), Patch((30e-3, -20e-3), 15e-3)))
    return model(replace(film, electrode=electrode), refine=0.7, order=2)


@pytest.mark.parametrize("name", [
    "electrode.patches.0.centre.0", "electrode.patches.0.centre.1", "electrode.patches.1.diameter",
    "electrode.stiffness", "electrode.mass", "membrane.thickness", "membrane.prestretch.0",
    "frame.semi_axes.0", "plate.offset.1", "electrode.margin_frame", "voltage"])
def test_gradients_are_the_limit_of_differences(patched: Model, name: str) -> None:
    """Central differences of re-solved equilibria, order two: the error falls fourfold when the
    step halves."""
    patched = replace(patched, loading=replace(patched.loading, gravity=9.81))
    solution, parameter = equilibrium(patched, 0.2, 3e3).solution, parameters(patched)[name]
    labels = ("heave", "tilt", "capacitance", "max_field")
    some = {label: FUNCTIONALS[label] for label in labels}
    exact = gradient_many(patched, solution, some, {name: parameter})
    value, errors = parameter.value(patched, solution.state), []
    for step in (4e-3 * abs(value), 2e-3 * abs(value)):
        ends = []
        for change in (step, -step):
            other, start = parameter.changed(patched, solution.state, change)
            ends.append([quantity.value(other, newton(other, start).state)
                         for quantity in some.values()])
        errors.append(np.abs(np.subtract(*ends) / (2 * step) - [exact[n][name] for n in labels]))
    for label, before, after in zip(labels, *errors, strict=True):
        size = abs(some[label].value(patched, solution.state) / value)
        assert after < 1e-3 * max(abs(exact[label][name]), 0.01 * size), label
        assert before / after > 3.4 or after < 1e-6 * size, label


def test_a_patch_beside_a_mirror_plane_may_be_moved_along_it_alone() -> None:
    film = model(spotted(Patch((27e-3, 0.0), 15e-3)), refine=0.7, order=2)
    solution = equilibrium(film, 0.2, 3e3).solution
    names = [f"electrode.patches.0.centre.{axis}" for axis in (0, 1)]
    slopes = gradient_many(film, solution, {"": FUNCTIONALS["heave"]}, parameters(film, names))[""]
    assert slopes[names[1]] == 0.0 != slopes[names[0]]


def test_the_effect_puts_a_spot_between_plate_and_frame() -> None:
    """Its diameter is the length of (dx, dy), along which it lies; on an ellipse by its equation,
    from a plate off the centre."""
    oval = replace(elliptical(60e-3), name="oval", plate=Plate(Circle(10e-3), (5e-3, 0.0)))
    setup = Setup((circular(), oval), Rig())
    effect, values = EFFECTS["electrode_patch"], (6e-3, -8e-3, 0.25)
    spot, = effect.apply(setup, values, "circle").specimens[0].electrode.patches
    assert spot.diameter == pytest.approx(10e-3)
    assert spot.centre == pytest.approx(np.array([0.6, -0.8]) * (10e-3 + 0.25 * 35e-3))
    first, second = effect.apply(setup, values, "oval").specimens
    assert not first.electrode.patches
    (x, y), = (spot.centre for spot in second.electrode.patches)
    away = np.hypot(x - 5e-3, y)
    edge = (away - 10e-3) / 0.25 + 10e-3
    assert ((5e-3 + 0.6 * edge) / 60e-3) ** 2 + (0.8 * edge / 45e-3) ** 2 == pytest.approx(1)
    assert effect.apply(setup, (0.0, 0.0, 0.5), "oval") == setup
    twice = effect.apply(effect.apply(setup, values, "circle"), values, "circle")
    assert len(twice.specimens[0].electrode.patches) == 2


def test_files_hold_patches_and_refuse_those_off_the_film(tmp_path: Path) -> None:
    text = specimen_toml() + """
[[electrode.patch]]
centre = ["3 cm", "-5 mm"]
diameter = "12 mm"
"""
    file = tmp_path / "spotted.toml"
    file.write_text(text, encoding="utf-8")
    specimen = load_specimen(file)
    assert specimen.electrode.patches == (Patch((30e-3, -5e-3), 12e-3),)
    assert not specimen.axisymmetric
    again = tmp_path / "again.toml"
    again.write_text(specimen_to_toml(specimen), encoding="utf-8")
    assert load_specimen(again) == specimen
    for wrong in ('["7 cm", "0 mm"]', '["3 cm", "5 cm"]'):
        file.write_text(text.replace('["3 cm", "-5 mm"]', wrong), encoding="utf-8")
        with pytest.raises(InputError, match=r"electrode\.patch\[0\].*must lie in the frame"):
            load_specimen(file)
    file.write_text(text.replace('"12 mm"', '"0 mm"'), encoding="utf-8")
    with pytest.raises(InputError, match=r"diameter.*must be positive"):
        load_specimen(file)
