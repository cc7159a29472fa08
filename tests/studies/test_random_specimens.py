"""Random specimens: every one converges with its forces in balance, or has a status that is right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.trials.random_specimens import Drawn, design
from benchmarks.trials.robustness import MESH, SECONDS, STEEP, UNBALANCED, judged, study, table
from tests.oracles.balance import balance, displaced, nodal_forces, slope
from tests.oracles.laws import SAMPLES
from tests.oracles.potential import potential
from tests.support.costs import dear
from tests.support.models import model
from tests.support.specimens import circular
from tympan.fem.equilibrium.newton import STRAINED
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import ArrudaBoyce, Gent
from tympan.fem.membrane.biases import Magnet
from tympan.fem.results.fields import whole
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode, Film, Plate, Region, Specimen
from tympan.studies.case import Case, Settings, equilibrate, failure_reason
from tympan.studies.limits import limits

QUICK = 40

#: Processor seconds of the dearest by number: they are solved on their way to an end.
DEAR = {1: 9, 18: 6, 32: 4, 11: 3, 26: 3, 37: 2, 6: 2}


@pytest.mark.parametrize("drawn", [
    dear(drawn, seconds=DEAR[drawn.number]) if drawn.number in DEAR else drawn
    for drawn in design(QUICK)], ids=lambda drawn: str(drawn.number))
def test_random_specimen(drawn) -> None:
    record = judged(drawn, MeshSettings(order=3).refined(0.5), sample=10**9)
    assert record.status in ("equilibrium", "no_equilibrium", "not_converged")
    assert record.status == "equilibrium" or record.words
    assert record.balanced, record
    assert record.seconds < SECONDS


def test_the_design_is_the_same_every_time_and_has_every_law() -> None:
    first, second = list(design(60)), list(design(120))
    assert [str(drawn) for drawn in first] == [str(drawn) for drawn in second[:60]]
    laws = {drawn.case.specimen.membrane.material.law for drawn in second}
    assert laws == set(SAMPLES)


def test_the_checker_would_see_an_unbalanced_state() -> None:
    made = model(circular(), refine=0.7)
    outcome = equilibrium(made, 0.2, 3000.0)
    assert balance(made, outcome.state).worst < 1e-8
    assert balance(made, outcome.state.under(force=0.2002)).force > 1e-5
    assert balance(made, outcome.state.under(voltage=3010.0**2)).worst > 1e-5
    full, state = whole(made, outcome.state)
    assert balance(full, state).slope < 1e-10
    assert balance(full, state.under(force=0.2002)).slope > STEEP


@pytest.mark.parametrize("law", SAMPLES)
def test_the_checkers_slope_is_that_of_the_potential(law: str) -> None:
    """At a state that is no equilibrium, against differences of the potential itself."""
    rig = Rig(biases=(Magnet(0.1, 0.05, 0.03),)).loading
    film = circular(SAMPLES[law].law, prestretch=(2.0, 1.8))
    made = model(replace(film, electrode=Electrode(stiffness=1e3)), refine=0.5, order=2,
                 symmetry=False)
    made, random = replace(made, loading=rig), np.random.default_rng(3)
    nodes = random.normal(size=made.discretisation.free_count) * made.size
    moved = displaced(made, made.mounted(), nodes, np.ones(6), 1e-4)
    state = moved.under(force=0.2, voltage=1e6, pressure=5.0)
    forces = nodal_forces(made, state)

    def rise(nodes: np.ndarray, motion: np.ndarray, step: float) -> float:
        ends = [potential(made, displaced(made, state, nodes, motion, sign * step))
                for sign in (1, -1)]
        return (ends[0] - ends[1]) / (2 * step)

    draws = np.random.default_rng(5)
    nodes = draws.standard_normal(made.discretisation.free_count) * made.size
    motion = draws.standard_normal(6)
    motion[:3] *= made.size
    size = np.sqrt((nodes**2).sum() + (motion[:3] ** 2).sum() + (motion[3:] ** 2).sum()
                   * made.size**2)
    by_differences = (4 * rise(nodes, motion, 5e-7) - rise(nodes, motion, 1e-6)) / 3
    steepest = slope(made, state, forces, tries=1)
    assert steepest > STEEP
    assert steepest == pytest.approx(abs(by_differences) / size / np.abs(forces).max(), rel=1e-5)


#: A film near its pull-in beside a narrow gap; and one that locks, 0.4 % below the voltage at which
#: it thins. Both were drawn by a design of fewer laws.
_NARROW = Case(Specimen(
    "narrow", Ellipse((65.25376972e-3, 37.48452776e-3)),
    Plate(Ellipse((6.161366548e-3, 16.21865606e-3)), (-5.983112621e-3, 20.35545929e-3)),
    Film(0.3761764148e-3, (2.641319898, 2.823649497), Gent(15e3, 40.0), 7.84258974,
         permittivity_exponent=-0.2917450513, density=1003.32277),
    Electrode(stiffness=205.1019339, outline=Region(Ellipse((10.05790943e-3, 28.81064579e-3)),
                                                    (42.07803328e-3, -29.3107037e-3)))),
    mass=31.8356755e-3, voltage=582.7762207,
    rig=Rig(unaccounted_mass=0.3760907931e-3, guide="level"))
_LOCKING = Case(Specimen(
    "locking", Circle(39.61491434e-3),
    Plate(Ellipse((17.19279107e-3, 11.19413383e-3)), (-0.5196829276e-3, -0.09351920288e-3)),
    Film(0.1895759497e-3, (3.58825762, 3.584401854), ArrudaBoyce(14e3, 4.0), 5.158295030,
         density=0.0),
    Electrode(margin_plate=9.131459673e-3)),
    mass=0.2944858297e-3, voltage=1140.0, rig=Rig(unaccounted_mass=0.2600908763e-3))


@pytest.mark.parametrize("case", [_NARROW, _LOCKING], ids=lambda case: case.specimen.name)
def test_slopes_are_seen_near_locking(case: Case) -> None:
    """Where a difference over a millionth of the frame is off by more than 1e-5."""
    record = judged(Drawn(0, case, False, 0), MeshSettings(), sample=10**9)
    assert record.balance.slope < STEEP
    assert record.balance.worst < UNBALANCED


@pytest.mark.parametrize("number", [12, 47])
def test_films_that_wrinkle_end_where_they_thin(number: int) -> None:
    """The first as soon as it loses tension, the second when its wrinkles have grown."""
    drawn = next(case for case in design(number + 1) if case.number == number)
    film, outcome = equilibrate(drawn.case, Settings(MESH))
    assert (outcome.status, outcome.thins) == ("no_equilibrium", True)
    assert film.in_tension(outcome.state) == (number == 12)
    assert film.thinning_margin(outcome.state) >= 0
    assert "wrinkled, thins without bound" in failure_reason(outcome)
    short = replace(drawn.case, voltage=0.999 * np.sqrt(outcome.limit))
    assert equilibrate(short, Settings(MESH))[1].status == "equilibrium"


@pytest.mark.parametrize("number", [2, dear(3, seconds=3), 16, 17, 18, dear(21, seconds=2),
                                    dear(22, seconds=5)])
def test_limits_and_solve_have_the_end_of_a_thinning_film_within_its_spread(number: int) -> None:
    """Taut until it thins, or wrinkled before that."""
    *_, drawn = design(number + 1)
    case = replace(drawn.case, voltage=0.0)
    end = limits(case, Settings()).end
    assert end is not None
    assert end.kind == "instability"
    for further in (1.01, 1.5):
        asked = replace(case, voltage=further * end.voltage_V)
        outcome = equilibrate(asked, Settings())[1]
        assert (outcome.status, outcome.thins) == ("no_equilibrium", True)
        assert abs(np.sqrt(outcome.limit) / end.voltage_V - 1) < max(end.spread, 1e-6)


def test_a_film_that_locks_says_so() -> None:
    """The eight-chain law has no stress beyond its locking stretch; the film is taut until there.
    """
    specimen = circular(SAMPLES["arruda_boyce"].law, prestretch=(3.99, 3.99), thickness=0.2323e-3)
    specimen = replace(specimen, frame=Circle(22.5e-3), plate=Plate(Circle(4.2e-3)))
    outcome = equilibrium(model(specimen, refine=0.6, order=3), 0.132, 1412.0)
    assert outcome.status == "not_converged"
    assert outcome.advice.startswith(STRAINED)
    assert outcome.solution.tangent.wrinkling == 0


@pytest.mark.study
def test_five_hundred_random_specimens() -> None:
    records = study(500, seed=1, sample=8, workers=1)
    summary = table(records)
    assert not [record.number for record in records if record.status in ("raised", "hung")], summary
    assert not [record.number for record in records if not record.balanced], summary
    assert sum(record.status == "not_converged" for record in records) <= 40, summary
    assert not [record.number for record in records if record.wrong], summary
