"""Small vibrations: closed forms of the flat annulus, the ODE's stiffness, dense eigenvalues,
energies, symmetry."""

from __future__ import annotations

import json
from dataclasses import replace

import meshio
import numpy as np
import pytest
import scipy.linalg
import skfem
from scipy.sparse import csc_matrix
from skfem.helpers import dot

from tests.oracles import annulus_modes, axisymmetric
from tests.oracles.potential import potential
from tests.support.checks.json_schema import printed_record
from tests.support.models import model, structured_quarter
from tests.support.specimens import (
    NEO_HOOKE,
    VHB,
    circular,
    elliptical,
    reference_film,
    skewed,
    specimen_toml,
)
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.membrane.biases import Spring
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import FREEDOMS, HEAVE, PlateMotion, State
from tympan.fem.results.fields import whole
from tympan.fem.rig import Rig
from tympan.fem.vibration.modes import (
    Modes,
    RigidPlate,
    _lowest,
    film_mass,
    mode_names,
    symmetry_classes,
    vibrations,
)
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse, area_moments
from tympan.geometry.specimen import Electrode, Plate
from tympan.studies.case import Case, Settings
from tympan.studies.modes import modes as solve_modes

DENSITY, MASS = 960.0, 17.9e-3
INNER, OUTER = 10e-3, 45e-3
PER_AREA = DENSITY * 1e-3 / 5


def annulus(**film: object):
    return circular(density=DENSITY, **film)


def plate_of(mass: float = MASS, point_mass: float = 0.0) -> RigidPlate:
    return RigidPlate.uniform(Circle(INNER), mass, point_mass)


def clamped(film: Model) -> Model:
    """The same with a plate that does not move."""
    return replace(film, loading=replace(film.loading, guide="fixed"))


def squares(modes: Modes) -> np.ndarray:
    """ω² [1/s²], negative for unstable modes."""
    return np.where(modes.growth > 0, -(modes.growth**2), (2 * np.pi * modes.frequencies_Hz) ** 2)


def along(shape: np.ndarray) -> float:
    """Share of the displacement along the load."""
    return float((shape[:, 2] ** 2).sum() / (shape**2).sum())


def transverse(modes: Modes) -> np.ndarray:
    return modes.frequencies_Hz[[along(shape) > 0.99 for shape in modes.shapes]]


def hertz(wave_number: np.ndarray, voltage: float = 0.0) -> np.ndarray:
    speed = np.sqrt(reference_film(NEO_HOOKE).resultant(voltage) / PER_AREA)
    return wave_number * speed / (2 * np.pi)


@pytest.mark.parametrize("voltage", [0.0, 3000.0, 6000.0])
@pytest.mark.parametrize(("refine", "tolerance"), [(1.0, 5e-5), (2.0, 1e-6)])
def test_flat_film_with_the_plate_held(voltage, refine, tolerance) -> None:
    """Bessel's zeros, twins included, up to four nodal diameters."""
    film = model(annulus(), refine=refine)
    frequencies = transverse(vibrations(clamped(film), film.mounted(voltage**2), plate_of(),
                                        count=24))
    exact = np.sort(np.concatenate([np.repeat(annulus_modes.held(m, 3, INNER, OUTER),
                                              1 if m == 0 else 2)
                                    for m in range(7)]))
    assert len(frequencies) >= 9
    assert frequencies == pytest.approx(hertz(exact, voltage)[: len(frequencies)], rel=tolerance)
    assert frequencies[:5] == pytest.approx(hertz(exact, voltage)[:5], rel=0.07 * tolerance)


def test_voltage_lowers_the_frequency_by_the_maxwell_tension() -> None:
    film = model(annulus())
    low, high = (transverse(vibrations(clamped(film), film.mounted(u**2), plate_of(), count=1))[0]
                 for u in (6000.0, 0.0))
    share = reference_film(NEO_HOOKE).resultant(6000.0) / reference_film(NEO_HOOKE).resultant()
    assert 0.4 < share < 0.85
    assert (low / high) ** 2 == pytest.approx(share, rel=1e-6)


@pytest.mark.parametrize(("order", "sizes"), [(1, (8, 16)), (2, (8, 16)), (3, (4, 8)), (4, (2, 4))])
def test_frequencies_converge_with_twice_the_order(order, sizes) -> None:
    """The theory says 2p."""
    exact = hertz(annulus_modes.held(0, 1, INNER, OUTER))[0]
    errors = []
    for size in sizes:
        film = replace(structured_quarter(order, size, size), specimen=annulus())
        modes = vibrations(clamped(film), film.mounted(), plate_of(), count=6)
        errors.append(abs(transverse(modes)[0] / exact - 1))
    assert np.log2(errors[0] / errors[1]) >= 2 * order - 0.2, errors


@pytest.mark.parametrize("mass", [1e-4, 1e-3, MASS])
def test_heave_of_a_heavy_disc_on_a_flat_film(mass) -> None:
    film = model(annulus(), refine=2.0)
    modes = vibrations(film, film.mounted(), plate_of(mass), count=24)
    even = [number
            for number, (motion, shape) in enumerate(zip(modes.plate, modes.shapes, strict=True))
            if along(shape) > 0.99 and abs(motion[HEAVE]) > 1e-4 * abs(shape).max()]
    exact = hertz(annulus_modes.heaving(2, INNER, OUTER, mass / PER_AREA))
    assert modes.frequencies_Hz[even[0]] == pytest.approx(exact[0], rel=1e-7)
    assert modes.frequencies_Hz[even[1]] == pytest.approx(exact[1], rel=1e-5)


def test_electrodes_have_the_inertia_of_as_heavy_a_film() -> None:
    """Grease alone on a weightless film, then half of the mass in either."""
    exact = hertz(annulus_modes.heaving(1, INNER, OUTER, 1e-3 / PER_AREA))[0]
    for grease in (PER_AREA, PER_AREA / 2):
        specimen = replace(circular(density=DENSITY * (1 - grease / PER_AREA)),
                           electrode=Electrode(mass=grease))
        film = model(specimen, refine=2.0)
        modes = vibrations(film, film.mounted(), plate_of(1e-3), count=1)
        assert modes.frequencies_Hz[0] == pytest.approx(exact, rel=1e-7)


def test_electrodes_weigh_where_they_cover_the_film() -> None:
    coated = replace(circular(), electrode=Electrode(margin_frame=5e-3, mass=0.05))
    film = replace(model(coated), loading=Loading(gravity=9.80665))
    weight = film.weight.sum(0) * film.discretisation.mirrored
    covered = np.pi * ((OUTER - 5e-3) ** 2 - INNER**2)
    assert weight == pytest.approx([0, 0, 0.05 * 9.80665 * covered], rel=1e-6, abs=1e-15)


def test_added_mass_moves_without_weight() -> None:
    """Half as much again on the plate: the same rest, √1.5 slower on a weightless film."""
    bare, loaded = (solve_modes(Case(circular(), mass=MASS, voltage=3e3, rig=Rig(added_mass=more)),
                                Settings(MeshSettings(order=2)), count=1) for more in (0, MASS / 2))
    assert loaded.deflection_m == bare.deflection_m
    assert bare.modes[0].frequency_Hz / loaded.modes[0].frequency_Hz == pytest.approx(1.5**0.5)


@pytest.mark.parametrize("mass", [1e-3, MASS])
def test_tilt_of_a_disc_on_a_flat_film(mass) -> None:
    film, plate = model(annulus(), refine=2.0), plate_of(mass)
    modes = vibrations(film, film.mounted(), plate, count=6)
    tilting = [number for number, label in enumerate(mode_names(*named(film, modes)))
               if label.startswith("tilt")]
    exact = hertz(annulus_modes.tilting(1, INNER, OUTER, mass * INNER**2 / 4 / PER_AREA))
    assert modes.frequencies_Hz[tilting] == pytest.approx(np.repeat(exact, 2), rel=2e-6)
    assert {mode_names(*named(film, modes))[number] for number in tilting} == {"tilt about x",
                                                                          "tilt about y"}


def named(film: Model, modes: Modes) -> tuple[Model, Modes]:
    return whole(film, film.mounted())[0], modes


@pytest.mark.parametrize(("heave", "voltage"),
                         [(0.0, 2000.0), (5e-3, 0.0), (5e-3, 3000.0), (15e-3, 4000.0)])
def test_heave_on_a_weightless_film_has_the_ode_s_stiffness(heave, voltage) -> None:
    film = model(circular())
    state = held(film, heave, voltage).state
    step = 1e-5
    above, below = (axisymmetric.solve_deflection(reference_film(NEO_HOOKE), heave + sign * step,
                                                  voltage).force
                    for sign in (1, -1))
    stiffness = (above - below) / (2 * step)
    modes = vibrations(film, state, plate_of(), count=6)
    heaving = int(np.argmax(modes.shares[:, HEAVE]))
    assert modes.shares[heaving, HEAVE] == pytest.approx(1)
    assert (2 * np.pi * modes.frequencies_Hz[heaving]) ** 2 == pytest.approx(stiffness / MASS,
                                                                             rel=3e-5)


@pytest.mark.parametrize("push", [120.0, 300.0])
def test_an_unstable_plate_grows_as_bessel_s_modified_functions_say(push) -> None:
    """A destabilising spring, stiffer than the film's own 2πN/ln(b/a)."""
    pushed, tension = Loading((Spring(-push),)), reference_film(NEO_HOOKE).resultant()
    film = replace(model(annulus(), refine=2.0), loading=pushed)
    assert push > 2 * np.pi * tension / np.log(OUTER / INNER)
    modes = vibrations(film, film.mounted(), plate_of(), count=3)
    rate = annulus_modes.growing(INNER, OUTER, MASS / PER_AREA,
                                 push / tension) * np.sqrt(tension / PER_AREA)
    assert modes.unstable == 1
    assert modes.growth[0] == pytest.approx(rate, rel=1e-7)
    assert list(modes.growth[1:]) == [0, 0, 0]
    assert modes.frequencies_Hz[0] == 0
    weightless = replace(model(circular(), refine=2.0), loading=pushed)
    light = vibrations(weightless, weightless.mounted(), plate_of())
    stiffness = 2 * np.pi * tension / np.log(OUTER / INNER)
    assert light.unstable == 1
    assert light.growth[0] ** 2 == pytest.approx((push - stiffness) / MASS, rel=1e-7)


def test_a_slack_film_s_unstable_directions_are_counted_and_listed() -> None:
    """The count is that of a dense solver; the mass decides how fast they grow, not how many there
    are."""
    soft = circular(replace(NEO_HOOKE, mu=(15e3,)), density=DENSITY)
    film = model(soft, order=2)
    state = held(film, 10e-3, 6800.0).state
    modes = vibrations(clamped(film), state, plate_of(), count=5)
    part = [np.linalg.eigvalsh(item.linearised(state).inner.toarray())
            for item in symmetry_classes(film)]
    assert modes.unstable == sum(int((values < 0).sum()) for values in part) > 5
    assert np.count_nonzero(modes.growth) == 5
    assert np.count_nonzero(modes.frequencies_Hz) == 5


@pytest.mark.parametrize("factor", [1.0, 10.0])
def test_film_s_mass_on_a_loaded_film_by_the_ode_s_motion(factor) -> None:
    """Rayleigh: a film much lighter than the plate moves as in statics, with an error of the next
    order in its mass."""
    heave, voltage, step = 8e-3, 3000.0, 1e-5
    above, below = (axisymmetric.solve_deflection(reference_film(NEO_HOOKE), moved, voltage)
                    for moved in (heave + step, heave - step))
    nodes, weights = np.polynomial.legendre.leggauss(200)
    radius = (INNER + OUTER) / 2 + (OUTER - INNER) / 2 * nodes
    motion = (np.array([above.r(radius), above.z(radius)]) - [below.r(radius),
                                                              below.z(radius)]) / (2 * step)
    carried = float(((motion**2).sum(0) * 2 * np.pi * radius * weights).sum() * (OUTER - INNER) / 2
                    * PER_AREA)
    mass = factor * MASS
    expected = (above.force - below.force) / (2 * step) / (mass + carried)
    film = model(annulus())
    modes = vibrations(film, held(film, heave, voltage).state, plate_of(mass), count=1)
    assert carried > 0.005 * MASS
    assert (2 * np.pi * modes.frequencies_Hz[0]) ** 2 == pytest.approx(expected,
                                                                       rel=2e-4 / factor**2 + 2e-5)


def loaded(specimen, *, symmetry: bool = True, order: int = 4, refine: float = 1.0) -> tuple[Model,
                                                                                             State]:
    film = model(specimen, symmetry=symmetry, order=order, refine=refine)
    outcome = equilibrium(film, 0.15, 2500.0)
    assert outcome.status == "equilibrium"
    return film, outcome.state


def heavy(specimen):
    return replace(specimen, membrane=replace(specimen.membrane, density=DENSITY))


def dense(film: Model, state: State, plate: RigidPlate) -> np.ndarray:
    """ω² by other means: skfem's mass form, the plate's coupling by differences, everything dense.

    The stiffness of the plate's freedoms is differentiated from forces, second derivatives of its
    motion included.
    """
    def push(moved: PlateMotion) -> np.ndarray:
        return film.loading.on_plate(replace(state, plate=moved), film.centre, film.plate_area)[1]

    form = skfem.BilinearForm(lambda u, v, w: dot(u, v))
    mesh = film.discretisation.mesh
    basis = skfem.CellBasis(mesh, skfem.ElementVector(mesh.elem(), 3), intorder=2 * mesh.order + 4)
    membrane = film.specimen.membrane
    virgin = membrane.density * membrane.thickness / membrane.area_prestretch
    mass = virgin * form.assemble(basis).toarray()
    scalar = film.discretisation.basis
    number = np.empty(scalar.N * 3, dtype=int)
    for axis in range(3):
        number[3 * scalar.element_dofs + axis] = basis.element_dofs[axis::3]
    mass = mass[np.ix_(number, number)]
    node, component = film.discretisation.free
    free, step = 3 * node + component, 1e-6
    reduction = np.zeros((film.discretisation.reference.size, len(free) + 6))
    reduction[free, np.arange(len(free))] = 1.0
    centre = np.zeros((3, 6))

    def forces(change: np.ndarray) -> np.ndarray:
        moved = state.plate.moved(change)
        nodal = film.nodal_forces(replace(state, positions=film.place(state.positions, moved)))
        turned = nodal[film.discretisation.plate_nodes]
        arms = film.arms @ moved.rotation.T
        plate = np.concatenate([turned.sum(0), np.cross(arms, turned).sum(0)]) + push(moved)
        return np.concatenate([nodal.ravel()[free], plate])

    stiffness = np.zeros((len(free) + 6, len(free) + 6))
    stiffness[: len(free), : len(free)] = film.linearised(state).inner.toarray()
    for freedom in range(6):
        change = step * np.eye(6)[freedom]
        moved = [state.plate.moved(sign * change) for sign in (1, -1)]
        high, low = (film.place(state.positions, item) for item in moved)
        reduction[:, len(free) + freedom] = ((high - low) / (2 * step)).ravel()
        high, low = (item.positions(film.centre, np.array([[*plate.arm, 0.0]])) for item in moved)
        centre[:, freedom] = (high - low)[0] / (2 * step)
        stiffness[:, len(free) + freedom] = (forces(change) - forces(-change)) / (2 * step)
    stiffness[len(free):, : len(free)] = stiffness[: len(free), len(free):].T
    total = reduction.T @ mass @ reduction
    turned = state.plate.rotation @ plate.inertia @ state.plate.rotation.T
    total[len(free):,
          len(free):] += plate.mass * centre.T @ centre + scipy.linalg.block_diag(np.zeros((3, 3)),
                                                                                  turned)
    return scipy.linalg.eigh((stiffness + stiffness.T) / 2, total, eigvals_only=True)


@pytest.mark.parametrize("mass", [0.0, 1e-3])
def test_a_skewed_film_against_dense_eigenvalues(mass) -> None:
    """No symmetry, heave and tilt coupled, weight off centre, film with margins: all lowest modes,
    none missed."""
    film, state = loaded(heavy(skewed()), order=1)
    arm = (3e-3, -2e-3)
    film = replace(film, loading=Loading((Spring(4.0),), arm))
    solution = newton(film, state)
    assert solution.converged
    state, plate = solution.state, RigidPlate.uniform(Ellipse((8e-3, 10e-3)), mass, arm=arm)
    modes = vibrations(film, state, plate, count=20)
    assert state.plate.tilt > 1e-3
    assert modes.unstable == 0
    assert squares(modes) == pytest.approx(dense(film, state, plate)[:20], rel=1e-5)


def test_modes_are_normalised_and_their_energy_is_the_potential_s() -> None:
    """φᵀMφ = 1, and half ω² is the potential's second difference along a mode."""
    film, state = loaded(heavy(skewed()), order=2, refine=0.7)
    plate = plate_of(1e-3)
    modes = vibrations(film, state, plate, count=8)
    nodal_mass, step = film_mass(film), 1e-5
    for shape, motion, value in zip(modes.shapes, modes.plate, squares(modes), strict=True):
        kinetic = sum(shape[:, axis] @ nodal_mass @ shape[:, axis] for axis in range(3))
        kinetic += motion @ plate.matrix(state.plate) @ motion
        assert kinetic == pytest.approx(1, rel=1e-9)
        size = step / np.abs(shape).max()

        def displaced(way: float, shape=shape, motion=motion, size=size) -> float:
            moved = state.plate.moved(way * size * motion)
            positions = film.place(state.positions + way * size * shape, moved)
            return float(potential(film, replace(state, positions=positions, plate=moved)))

        second = (displaced(1) - 2 * displaced(0) + displaced(-1)) / size**2
        assert second == pytest.approx(value, rel=2e-3)


def test_mass_matrix_holds_the_film_s_mass() -> None:
    specimen = heavy(elliptical(60e-3))
    film = model(specimen)
    exact = PER_AREA * np.pi * (60e-3 * 45e-3 - INNER**2)
    assert film_mass(film).sum() * film.discretisation.mirrored == pytest.approx(exact, rel=1e-6)
    full = model(specimen, symmetry=False)
    assert film_mass(full).sum() == pytest.approx(exact, rel=1e-6)
    assert scipy.linalg.eigvalsh(film_mass(model(specimen, order=2)).toarray())[0] > 0


@pytest.mark.parametrize("mass", [MASS, np.inf])
@pytest.mark.parametrize("specimen", [
    elliptical(60e-3), replace(elliptical(60e-3), plate=Plate(Circle(INNER), (8e-3, 0.0)))],
                         ids=["quarter", "half"])
def test_symmetry_classes_make_up_the_whole_film_s_spectrum(specimen, mass) -> None:
    plate = plate_of()
    states = [loaded(heavy(specimen), symmetry=symmetry) for symmetry in (True, False)]
    part, full = (vibrations(clamped(film) if np.isinf(mass) else film, state, plate, 30)
                  for film, state in states)
    assert part.frequencies_Hz == pytest.approx(full.frequencies_Hz, rel=1e-9)
    gaps = np.diff(part.frequencies_Hz, prepend=0.0, append=part.frequencies_Hz[-1])
    distinct = np.flatnonzero((gaps[:-1] > 1e-4) & (gaps[1:] > 1e-4))
    assert len(distinct) > 15
    film, state = states[1]
    nodal_mass = film_mass(film)
    for mode in distinct:
        product = sum(part.shapes[mode, :, axis] @ nodal_mass @ full.shapes[mode, :, axis]
                      for axis in range(3))
        if not np.isinf(mass):
            product += part.plate[mode] @ plate.matrix(state.plate) @ full.plate[mode]
        assert abs(product) == pytest.approx(1, abs=1e-6)


def test_sparse_and_dense_solvers_agree_on_both_sides_of_zero() -> None:
    generator = np.random.default_rng(3)
    values = np.concatenate([[-7.0, -2.0, -0.5], np.arange(1.0, 298.0)])
    turn = np.linalg.qr(generator.standard_normal((300, 300)))[0]
    matrix = csc_matrix(turn * values @ turn.T)
    mass = csc_matrix(2.0 * np.eye(300))
    squares, _, unstable = _lowest(csc_matrix((matrix + matrix.T) / 2), mass, 5)
    assert unstable == 3
    assert squares == pytest.approx(np.array([-7, -2, -0.5, 1, 2, 3, 4, 5]) / 2, rel=1e-10)


def test_a_film_without_mass_is_the_limit_of_a_light_one() -> None:
    specimen = skewed()
    specimen = replace(specimen, membrane=replace(specimen.membrane, density=0.0))
    film, state = loaded(specimen, order=2, refine=0.7)
    membrane = replace(specimen.membrane, density=1e-3)
    light = replace(film, specimen=replace(specimen, membrane=membrane))
    # The second has no inertia against rotation, the third only that of its centre of mass about
    # the plate's.
    for plate, count in ((plate_of(), 6), (plate_of(MASS, MASS), 3),
                         (RigidPlate(MASS, arm=(4e-3, 1e-3)), 3)):
        none, some = (vibrations(item, state, plate, count=6) for item in (film, light))
        assert len(none.frequencies_Hz) == count
        assert none.frequencies_Hz == pytest.approx(some.frequencies_Hz[:count], rel=1e-5)


@pytest.mark.parametrize(("guide", "moving"),
                         [("level", {"x", "y", "z", "rz"}), ("vertical", {"z"}), ("fixed", set())])
def test_a_guide_leaves_only_its_motions(guide, moving) -> None:
    film = replace(model(annulus()), loading=Loading(guide=guide))
    modes = vibrations(film, film.mounted(), plate_of(), count=12)
    carried = {name for name, share in zip(FREEDOMS, modes.shares.T, strict=True)
               if share.max() > 0.5}
    assert carried == moving
    held_plate = vibrations(clamped(film), film.mounted(), plate_of(), count=12 - len(moving))
    if not moving:
        assert modes.frequencies_Hz == pytest.approx(held_plate.frequencies_Hz, rel=1e-12)


def test_a_spring_stiffens_the_heave_alone() -> None:
    without, with_spring = (vibrations(film, film.mounted(), plate_of()) for film in (
        replace(model(circular()), loading=Loading((Spring(k),))) for k in (0.0, 50.0)))
    first, second = (squares(item)[np.argmax(item.shares[:, HEAVE])]
                     for item in (without, with_spring))
    assert second - first == pytest.approx(50.0 / MASS, rel=1e-9)
    assert np.sort(np.delete(squares(with_spring),
                             with_spring.shares[:, HEAVE].argmax())) == pytest.approx(
        np.sort(np.delete(squares(without), without.shares[:, HEAVE].argmax())))


def test_names_of_film_patterns_are_bessel_s() -> None:
    """Each name (m, n) comes with the closed form's frequency for m nodal diameters and n circles.
    """
    film = model(annulus())
    modes = vibrations(clamped(film), film.mounted(), plate_of(), count=60)
    labels = mode_names(*named(film, modes))
    seen = set()
    for label, frequency in zip(labels, modes.frequencies_Hz, strict=True):
        if label.startswith("film ("):
            m, n = map(int, label[6:-1].split(","))
            assert frequency == pytest.approx(hertz(annulus_modes.held(m, n + 1, INNER, OUTER))[n],
                                              rel=2e-3), label
            seen.add((m, n))
    assert seen >= {(0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (1, 1)}
    assert "film, in plane" in labels
    assert len(labels) == 60


def test_an_ellipse_s_film_modes_get_no_round_names() -> None:
    film = model(heavy(elliptical(60e-3)))
    modes = vibrations(clamped(film), film.mounted(), plate_of(), count=8)
    labels = mode_names(*named(film, modes))
    assert set(labels) <= {"film", "film, in plane"}


@pytest.mark.parametrize(("outline", "second"),
                         [(Ellipse((3.0, 2.0)), (np.pi * 54 / 4, np.pi * 24 / 4))])
def test_moments_of_an_ellipse(outline, second) -> None:
    area, _, matrix = area_moments(outline)
    assert area == pytest.approx(6 * np.pi, rel=1e-6)
    assert matrix.diagonal() == pytest.approx(second, rel=2e-6)
    assert matrix[0, 1] == pytest.approx(0, abs=1e-9)


def test_moments_do_not_mind_where_the_outline_is_nor_its_sense() -> None:
    class Rectangle(Circle):
        def points(self, count: int) -> np.ndarray:
            return np.array([[5.0, 7, 7, 5], [1.0, 1, 4, 4]])[:, ::-1]

    area, centroid, second = area_moments(Rectangle(1.0))
    assert area == pytest.approx(6)
    assert centroid == pytest.approx([6, 2.5])
    assert second == pytest.approx(np.diag([3 * 8 / 12, 2 * 27 / 12]))


def test_refusals() -> None:
    film = model(circular())
    for made, plate in ((clamped(film), plate_of()), (film, plate_of(0.0))):
        with pytest.raises(InputError, match=r"nothing that can move has mass"):
            vibrations(made, film.mounted(), plate)
    with pytest.raises(InputError, match="at least 1"):
        vibrations(film, film.mounted(), plate_of(), count=0)
    with pytest.raises(InputError, match="point-mass"):
        solve_modes(Case(circular(), mass=1e-3, voltage=0.0), Settings(), point_mass=2e-3)


def test_command(tmp_path, capsys) -> None:
    file, out = tmp_path / "oval.toml", tmp_path / "out"
    file.write_text(specimen_toml(film=f'{VHB}\ndensity = "960 kg/m^3"'))
    arguments = ["modes", str(file), "--mass", "17.9 g", "--voltage", "3.5 kV", "--count", "4"]
    assert main([*arguments, "--json", "-o", str(out)]) == 0
    printed, err = capsys.readouterr()
    assert err == ""
    result = printed_record(printed)
    assert result["status"] == "equilibrium"
    assert [mode["name"] for mode in result["modes"]] == ["heave", "slide along y", "slide along x",
                                                          "tilt about y"]
    frequencies = [mode["frequency_Hz"] for mode in result["modes"]]
    assert frequencies == sorted(frequencies)
    first = result["modes"][0]
    assert sum(first["plate_share"].values()) + first["film_share"] == pytest.approx(1)
    assert json.loads((out / "oval-modes.json").read_text()) == result
    mesh = meshio.read(out / "oval-modes.vtu")
    for number in range(1, 5):
        assert np.linalg.norm(mesh.point_data[f"mode_{number}"], axis=1).max() == pytest.approx(1)
    assert -mesh.points[:, 2].min() == pytest.approx(result["deflection_m"], rel=1e-6)
    assert (out / "oval-modes.png").stat().st_size > 50_000
    assert main(arguments) == 0
    assert "heave" in capsys.readouterr().out


def test_command_past_pull_in_leaves_no_old_files(tmp_path, capsys) -> None:
    file = tmp_path / "oval.toml"
    file.write_text(specimen_toml(film=f'{VHB}\ndensity = "960 kg/m^3"'))
    arguments = ["modes", str(file), "--mass", "17.9 g", "--json", "-o", str(tmp_path)]
    assert main(arguments) == 0
    assert (tmp_path / "oval-modes.vtu").exists()
    capsys.readouterr()
    assert main([*arguments, "--voltage", "30 kV"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["status"], result["modes"]) == ("no_equilibrium", [])
    assert not (tmp_path / "oval-modes.vtu").exists()
    assert main(["modes", str(file), "--mass", "17.9 g", "--count", "0"]) == 2
    assert "--count" in capsys.readouterr().err
