"""Specimens the tests share."""

from __future__ import annotations

import fcntl
import os
import pickle
from dataclasses import replace

import pytest

from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.model import Model
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Film, Material, Plate, Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.reduced.force_law import Grid
from tympan.studies.diagnosis.reduced.sampling import force_laws
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import Setup
from tympan.studies.paper.actuators import actuators

ROOT5 = 5**0.5
NEO_HOOKE = Ogden((25e3,), (2.0,))


def circular(material: Material = NEO_HOOKE, **film: object) -> Specimen:
    """Design §3's reference annulus, 10 mm to 45 mm."""
    values: dict[str, object] = {"thickness": 1e-3, "prestretch": (ROOT5, ROOT5),
                                 "relative_permittivity": 4.7}
    return Specimen("circle", Circle(45e-3), Plate(Circle(10e-3)),
                    Film(material=material, **(values | film)))


def elliptical(long: float, material: Material = NEO_HOOKE) -> Specimen:
    """The paper's ellipses: semi-axes ``long`` and 45 mm."""
    return replace(circular(material), name=f"ellipse {long}", frame=Ellipse((long, 45e-3)))


def model(specimen: Specimen, *, symmetry: bool = True, refine: float = 1.0,
          order: int = 4) -> Model:
    """The model at the default mesh, refined."""
    return build_model(specimen,
                       Settings(MeshSettings(order=order).refined(refine), symmetry=symmetry))


def skewed() -> Specimen:
    """A specimen without any symmetry: plate off centre, anisotropic prestretch, electrode margins and stiffness."""
    from tympan.geometry.specimen import Electrode

    material = Ogden((16e3, 300.0), (1.7, 4.2))
    film = Film(1e-3, (2.4, 2.1), material, 4.7, permittivity_exponent=0.3, density=960.0)
    return Specimen("skewed", Ellipse((60e-3, 45e-3)), Plate(Circle(10e-3), (8e-3, -5e-3)), film,
                    Electrode(3e-3, 2e-3, 1.5e3))


@pytest.fixture(scope="session")
def skewed_model() -> Model:
    return model(skewed(), refine=0.7, order=2)


@pytest.fixture(scope="session")
def three_shapes(tmp_path_factory: pytest.TempPathFactory) -> Simulation:
    """The paper's three actuators with every effect, up to 6 mm and 7.5 kV; made by one of several test processes."""
    base = tmp_path_factory.getbasetemp()
    folder = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with (folder / "three_shapes.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        stored = folder / "three_shapes.pickle"
        if not stored.exists():
            setup = Setup(actuators(), Rig())
            laws = force_laws(setup, [Grid(6e-3, 7.5e3**2, odd=True)] * 3, workers=2)
            stored.write_bytes(pickle.dumps(Simulation(setup, laws)))
        found = pickle.loads(stored.read_bytes())
    assert isinstance(found, Simulation)
    return found
