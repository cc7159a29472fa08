"""Fixtures the tests share."""

from __future__ import annotations

import fcntl
import os
import pickle
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:  # a fixture imports what it makes: whoever does not ask for it does not wait
    from tympan.fem.membrane.model import Model
    from tympan.studies.diagnosis.reduced.simulation import Simulation

pytest_plugins = ["tests.support.costs"]

# Started in the background, a shell's commands ignore Ctrl-C, and so would those tested here.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """What is kept on disk for later runs is kept for this session, by all its processes."""
    os.environ["TYMPAN_CACHE"] = str(shared_folder(tmp_path_factory) / "cache")


@pytest.fixture
def library(request: pytest.FixtureRequest) -> Iterator[None]:
    """The library of effects with those of the parameter alone."""
    from tests.support.library import library_of

    with library_of(*request.param):
        yield


def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A temporary folder of the session, the same for all its processes."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture(scope="session")
def skewed_model() -> Model:
    from tests.support.models import model
    from tests.support.specimens import skewed

    return model(skewed(), refine=0.7, order=2)


@pytest.fixture(scope="session")
def three_shapes(tmp_path_factory: pytest.TempPathFactory) -> Simulation:
    """The paper's three actuators with every effect, up to 6 mm and 7.5 kV.

    Made by one of several test processes.
    """
    from tympan.fem.rig import Rig
    from tympan.studies.diagnosis.reduced.force_law import Grid
    from tympan.studies.diagnosis.reduced.sampling import force_laws
    from tympan.studies.diagnosis.reduced.simulation import Simulation
    from tympan.studies.effects import Setup
    from tympan.studies.shipped import actuators

    folder = shared_folder(tmp_path_factory)
    with (folder / "three_shapes.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        stored = folder / "three_shapes.pickle"
        if not stored.exists():
            setup = Setup(actuators(), Rig())
            laws = force_laws(setup, [Grid(6e-3, 7.5e3**2, odd=True)] * 3, workers=2)
            stored.write_bytes(pickle.dumps(Simulation(setup, laws)))
        simulation = pickle.loads(stored.read_bytes())
    assert isinstance(simulation, Simulation)
    return simulation


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless Chromium, where there is one."""
    pytest.importorskip("playwright", reason="playwright is not installed")
    from benchmarks.explore.browser import browsing, chromium

    executable = chromium()
    if executable is None:
        pytest.skip("Chromium is not installed")
    with browsing(executable) as chrome:
        yield chrome
