"""Films as input of CalculiX: laws against their formulas, runs against tympan and exact films."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.segmented import driven_quarters
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.laws import ArrudaBoyce, Gent, MooneyRivlin, NeoHooke, Ogden, Yeoh
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode, Film, Material, Plate, Specimen
from tympan.studies.case import Case, Settings, solve
from tympan.studies.export import export_input
from tympan.studies.export.hyperelastic import BULK_RATIO, hyperelastic

needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")

NEO = NeoHooke(25e3)
OGDEN = Ogden((30e3, 2e3), (1.3, 5.5))
ROOT5 = 5**0.5


def actuator(frame: Circle | Ellipse, material: Material, prestretch: tuple[float, float],
             offset: tuple[float, float] = (0.0, 0.0), density: float = 0.0) -> Specimen:
    film = Film(1e-3, prestretch, material, 4.7, density=density)
    return Specimen("film", frame, Plate(Circle(10e-3), offset), film)


def abaqus_energy(card: list[str]) -> Callable[[np.ndarray], float]:
    """W [MPa] of stretches whose product is 1, as the manuals of Abaqus and CalculiX define it."""
    kind = card[0].split(", ", 1)[1]
    numbers = [float(word) for line in card[1:] for word in line.split(",")]

    def invariants(s: np.ndarray) -> tuple[float, float]:
        return float((s**2).sum() - 3), float((s**-2.0).sum() - 3)

    if kind.startswith("OGDEN"):
        terms = np.reshape(numbers[: 2 * int(kind[-1])], (-1, 2))
        return lambda s: float(sum(2 * mu / a**2 * ((s**a).sum() - 3) for mu, a in terms))
    if kind == "ARRUDA-BOYCE":
        mu, lock, *_ = numbers
        series = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
        return lambda s: mu * sum(c / lock ** (2 * i) * ((s**2).sum() ** (i + 1) - 3.0 ** (i + 1))
                                  for i, c in enumerate(series))
    if kind == "YEOH":
        return lambda s: sum(c * invariants(s)[0] ** k for k, c in enumerate(numbers[:3], 1))
    second = numbers[1] if kind == "MOONEY-RIVLIN" else 0.0
    return lambda s: numbers[0] * invariants(s)[0] + second * invariants(s)[1]


@pytest.mark.parametrize("law", [
    NEO, OGDEN, MooneyRivlin(12e3, 1e3), Yeoh((16e3, -80.0)), Yeoh((16e3, -80.0, 3.0)),
    ArrudaBoyce(20e3, 5.0), Ogden((9e3, 30.0, 4.0, -2e3), (2.0, 4.0, 6.0, -2.0))],
    ids=lambda law: law.law)
def test_cards_hold_the_law(law: Material) -> None:
    energy = abaqus_energy(hyperelastic(law))
    for l1, l2 in ((1.2, 1.1), (2.0, 2.0), (3.0, 1.0)):
        stretches = np.array([l1, l2, 1 / (l1 * l2)])
        ours = float(law.derivatives(np.asarray(l1), np.asarray(l2))[0])
        assert 1e6 * energy(stretches) == pytest.approx(ours, rel=1e-10)


@pytest.mark.parametrize("law", [NEO, OGDEN, Yeoh((16e3, -80.0))], ids=lambda law: law.law)
def test_cards_hold_the_bulk_modulus(law: Material) -> None:
    numbers = [float(word) for line in hyperelastic(law)[1:] for word in line.split(",")]
    energy, step = abaqus_energy(hyperelastic(law)), 1e-3
    # In simple shear of stretches (1 + e, 1 - e, 1) the energy is 2 mu e².
    shear = np.array([1 + step, 1 / (1 + step), 1.0])
    modulus = energy(shear) / (2 * step**2)
    count = {"OGDEN, N=2": 2, "YEOH": 3}.get(hyperelastic(law)[0].split(", ", 1)[1], 1)
    assert 2 / numbers[-count] == pytest.approx(BULK_RATIO * modulus, rel=3e-3)
    assert numbers[len(numbers) - count + 1 :] == [0.0] * (count - 1)


@pytest.mark.parametrize("law", [Gent(20e3, 50.0), Yeoh((1e4,) * 4), Ogden((1e3,) * 5, (2.0,) * 5)],
                         ids=lambda law: law.law)
def test_laws_that_calculix_has_not_are_refused(law: Material) -> None:
    with pytest.raises(InputError, match="must be a law that CalculiX has"):
        hyperelastic(law)


def test_what_has_no_equilibrium_or_no_card_is_refused(tmp_path: Path) -> None:
    film = actuator(Circle(45e-3), NeoHooke(15e3), (ROOT5, ROOT5))
    coarse = MeshSettings().refined(0.5)
    with pytest.raises(InputError, match="must have an equilibrium"):
        export_input(film, coarse, tmp_path, [17.9e-3], [7e3])
    stiff = Specimen("film", film.frame, film.plate, film.membrane, Electrode(stiffness=1e3))
    with pytest.raises(InputError, match=r"electrode\.stiffness"):
        export_input(stiff, coarse, tmp_path)
    with pytest.raises(InputError, match="must be from -100 to 100 MPa"):
        export_input(film, coarse, tmp_path, pressure=1e12)
    assert not list(tmp_path.glob("*.inp"))


def test_of_a_stack_one_film_is_written_under_its_part_of_the_mass(tmp_path: Path) -> None:
    """As a single film, whose deflection under that is the stack's."""
    single = actuator(Circle(45e-3), NEO, (ROOT5, ROOT5))
    stack = replace(single, membrane=replace(single.membrane, layers=4))
    deflections = [solve(Case(film, mass=mass, voltage=3e3), Settings()).deflection_m
                   for film, mass in ((single, 10e-3), (stack, 40e-3))]
    assert deflections[0] == pytest.approx(deflections[1], rel=1e-9)
    coarse = MeshSettings().refined(0.5)
    texts = [export_input(film, coarse, tmp_path / name, [mass], [3e3]).read_text()
             for name, film, mass in (("one", single, 10e-3), ("four", stack, 40e-3))]
    assert "3: 40 g on 4 films, 10 g on this one\n" in texts[1]
    assert "4: 40 g on 4 films, 10 g on this one, 3 kV\n" in texts[1]
    cards = [[line for line in text.splitlines() if not line.startswith("**")] for text in texts]
    assert cards[0] == cards[1]


def run_ccx_alone(folder: Path) -> None:
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    done = subprocess.run(["ccx", "film"], cwd=folder, capture_output=True, text=True, check=False,
                          env=environment)
    assert done.returncode == 0, done.stdout[-2000:]


def run_ccx(folder: Path) -> list[tuple[float, float]]:
    """Deflection [mm] and tilt [rad] of the plate at the end of every load step."""
    run_ccx_alone(folder)
    nodes = (folder / "film.inp").read_text().split("*NODE, NSET=PLATE\n")[1].split("*ELEMENT")[0]
    table = np.array([[float(word) for word in line.split(",")] for line in nodes.splitlines()])
    steps = re.split("displacements.*set PLATE and time.*", (folder / "film.dat").read_text())[1:]
    return [plate_motion(table, step) for step in steps]


def plate_motion(nodes: np.ndarray, printed: str) -> tuple[float, float]:
    """Of the plane that fits the plate's nodes, printed with their displacements."""
    rows = [line.split() for line in printed.split("total")[0].splitlines() if line.strip()]
    moved = np.array([[float(word) for word in row] for row in rows])
    assert (moved[:, 0] == nodes[:, 0]).all()
    centre = nodes[:, 1:].mean(axis=0)
    fit, *_ = np.linalg.lstsq(np.column_stack([nodes[:, 1:] - centre, np.ones(len(nodes))]),
                              nodes[:, 1:] - centre + moved[:, 1:], rcond=None)
    turn = fit[:3].T
    assert turn.T @ turn == pytest.approx(np.eye(3), abs=1e-6)  # rigid
    return fit[3, 2], float(np.hypot(*turn[:2, 2]))


@needs_ccx
def test_calculix_agrees_on_the_circular_film(tmp_path: Path) -> None:
    """Exact: 0.51826859 N at 5 mm, and 0.47914090 N with 3 kV."""
    film = actuator(Circle(45e-3), NEO, (ROOT5, ROOT5))
    gravity = Rig().gravity
    export_input(film, MeshSettings(), tmp_path, [0.51826859 / gravity, 0.47914090 / gravity],
                 [3e3])
    (exact, _), _, (actuated, _) = run_ccx(tmp_path)
    # The penalty makes 2e-4 of the force, this mesh the rest.
    assert exact == pytest.approx(5.0, rel=5e-4)
    assert actuated == pytest.approx(5.0, rel=5e-4)


@needs_ccx
@pytest.mark.study(seconds=6, only=("centred",))
@pytest.mark.parametrize("offset", [0.0, 8e-3], ids=["centred", "off centre"])
def test_calculix_agrees_on_the_elliptical_film(tmp_path: Path, offset: float) -> None:
    film = actuator(Ellipse((60e-3, 40e-3)), OGDEN, (2.4, 2.0), (offset, 0.0), density=960.0)
    export_input(film, MeshSettings(), tmp_path, [0.1], [5e3])
    for (deflection, tilt), voltage in zip(run_ccx(tmp_path), (0.0, 5e3), strict=True):
        ours = solve(Case(film, mass=0.1, voltage=voltage), Settings())
        assert 1e-3 * deflection == pytest.approx(ours.deflection_m, rel=1e-3)
        assert tilt == pytest.approx(ours.tilt_rad, rel=6e-3, abs=1e-5)


@needs_ccx
@pytest.mark.study(seconds=6, only=("0.0", "-40.0"))
@pytest.mark.parametrize("pressure", [0.0, 40.0, -40.0])
def test_calculix_agrees_on_an_uneven_film_above_gas(pressure: float, tmp_path: Path) -> None:
    """A film that is thicker on one side: it tilts the plate. Gas lifts or sucks film and plate."""
    even = actuator(Circle(45e-3), NEO, (ROOT5, ROOT5))
    film = replace(even, membrane=replace(even.membrane, thickness_gradient=(0.2, 0.0)))
    export_input(film, MeshSettings(), tmp_path, [30e-3], [3e3], pressure)
    for (deflection, tilt), voltage in zip(run_ccx(tmp_path), (0.0, 3e3), strict=True):
        ours = solve(Case(film, mass=30e-3, voltage=voltage, rig=Rig(gas_pressure=pressure)),
                     Settings())
        assert 1e-3 * deflection == pytest.approx(ours.deflection_m, rel=1e-3)
        assert tilt == pytest.approx(ours.tilt_rad, rel=6e-3)


@needs_ccx
def test_calculix_agrees_on_a_film_without_plate(tmp_path: Path) -> None:
    film = replace(actuator(Ellipse((50e-3, 40e-3)), NEO, (ROOT5, ROOT5)), plate=None)
    with pytest.raises(InputError, match="is needed here"):
        export_input(film, MeshSettings(), tmp_path, [10e-3])
    file = export_input(film, MeshSettings(), tmp_path, [], [2e3], 60.0)
    assert "3: 0 g, 60 Pa\n" in file.read_text()
    run_ccx_alone(tmp_path)
    steps = re.split("displacements.*set CENTRE and time.*", (tmp_path / "film.dat").read_text())
    for step, voltage in zip(steps[1:], (0.0, 2e3), strict=True):
        rows = [line.split() for line in step.split("total")[0].splitlines() if line.strip()]
        deflection = np.mean([float(row[3]) for row in rows])
        ours = solve(Case(film, mass=0.0, voltage=voltage, rig=Rig(gas_pressure=60.0)), Settings())
        assert 1e-3 * deflection == pytest.approx(ours.deflection_m, rel=1e-3)


@needs_ccx
@pytest.mark.study(seconds=6)
@pytest.mark.parametrize(("law", "force", "penalty"), [
    (NEO, 0.51826859, 1.8e-3), (OGDEN, 1.07485662, 8.2e-3)], ids=["neo-Hooke", "Ogden"])
def test_what_differs_is_the_penalty(law: Material, force: float, penalty: float,
                                     tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Solids of another program lost 0.2 % (neo-Hooke) and 0.9 % (Ogden) of the force at K/mu 1000.

    A tenth of that is lost at 10000, and the force is about linear in the deflection.
    """
    film, deflections = actuator(Circle(45e-3), law, (ROOT5, ROOT5)), []
    for ratio in (1e4, 1e3):
        monkeypatch.setattr("tympan.studies.export.hyperelastic.BULK_RATIO", ratio)
        export_input(film, MeshSettings(), tmp_path, [force / Rig().gravity])
        deflections.append(run_ccx(tmp_path)[0][0])
    assert deflections[0] == pytest.approx(5.0, rel=1e-3)
    assert deflections[1] / deflections[0] - 1 == pytest.approx(penalty, rel=0.15)


@needs_ccx
@pytest.mark.study
def test_calculix_converges_to_the_exact_film(tmp_path: Path) -> None:
    """Meshes twice as fine, down to what the penalty leaves."""
    film, errors = actuator(Circle(45e-3), NEO, (ROOT5, ROOT5)), []
    for refine in (0.5, 1.0, 2.0):
        export_input(film, MeshSettings().refined(refine), tmp_path, [0.51826859 / Rig().gravity])
        [(deflection, _)] = run_ccx(tmp_path)
        errors.append(deflection / 5.0 - 1)
    assert errors[0] < errors[1] < errors[2]
    assert errors[0] > -2e-3
    assert 0 < errors[2] < 3e-4


def test_command_needs_inp_for_loads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "film.toml"
    file.write_text("")
    assert main(["export", str(file), "-o", str(tmp_path), "--mass", "10 g"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_only_driven_segments_have_electric_loads(tmp_path: Path) -> None:
    """Nodes of segments without voltage carry none; a share s of the voltage has s² of the load."""
    found = list[list[float]]()
    for drive in ({"A": 2e3}, {"A": 2e3, "C": 1e3}):
        text = export_input(driven_quarters(drive, gap=1e-3), MeshSettings().refined(0.5), tmp_path,
                            voltages=(2e3,)).read_text()
        points = {int(line.split(",")[0]): [float(word) for word in line.split(",")[1:]]
                  for line in text.split("*NODE, NSET=FILM\n")[1].split("*")[0].split("\n")[:-1]}
        *_, step = text.split("*STEP")
        pairs = [line.split(",") for line in step.split("*CLOAD, OP=NEW\n")[1].split("*")[0]
                 .split("\n")[:-1]]
        pulls = np.array([[*points[int(node)][:2], float(force)] for node, axis, force in pairs
                          if int(axis) < 3 and int(node) in points])
        x, y, force = pulls.T
        found.append([np.abs(force[(np.sign(x) == right) & (np.sign(y) == up)]).sum()
                      for right, up in ((1, 1), (-1, 1), (-1, -1), (1, -1))])
    whole = found[0][0]
    assert whole > 0
    # In the flat film the quarters differ by nothing but their shares.
    assert found[0] == pytest.approx([whole, 0, 0, 0], abs=1e-9 * whole)
    assert found[1] == pytest.approx([whole, 0, 0.25 * whole, 0], rel=0.1, abs=1e-9 * whole)
    assert "A 2 kV, B 0 kV, C 1 kV, D 0 kV" in text
