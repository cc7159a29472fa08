"""Legal films that nobody builds: every command answers, in bounded work, none against another."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.trials.extreme_films import MESH, design, faults_of, judged, study, table
from benchmarks.trials.robustness import write_section
from tests.support.specimens import circular
from tympan.fem.equilibrium.newton import EXHAUSTED, Budget
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import ArrudaBoyce, NeoHooke, Ogden
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen
from tympan.studies.case import Case, Settings, build_model, equilibrate, solve
from tympan.studies.limits import curve, limits

#: The films that did not end: twenty times as long as wide, or with a plate beside its frame.
ENDLESS = {
    "long, stiff": Case(Specimen(
        "n10", Ellipse((45e-3, 2.25e-3)), Plate(Ellipse((1.32989e-3, 1.08173e-3)), (0.276e-3, 0.0)),
        Film(100e-6, (1.05, 1.05), Ogden((100e6,), (1.8,)), 1000.0)),
        mass=10.0, voltage=30e3, rig=Rig(gas_pressure=200.0)),
    "long": Case(Specimen(
        "n24", Ellipse((100e-3, 5e-3)), Plate(Ellipse((1.06e-3, 0.6276e-3)), (1.182e-3, 0.0)),
        Film(1e-3, (1.0, 3.0), NeoHooke(20e3), 12.0)), voltage=8e3),
    "off centre": Case(Specimen(
        "n4", Circle(45e-3), Plate(Ellipse((17.8832e-3, 8.90225e-3)), (-24.4051e-3, 0.0)),
        Film(100e-6, (4.0, 2.0), ArrudaBoyce(20e3, 7.0), 2.8), Electrode(2.25e-3)),
        mass=1.0, voltage=8e3)}


@pytest.mark.parametrize("name", ENDLESS)
def test_films_that_did_not_end_have_few_elements_and_an_answer(name: str) -> None:
    case = ENDLESS[name]
    assert build_model(case.specimen, Settings()).discretisation.mesh.nelements < 600
    _, outcome = equilibrate(case, Settings(MeshSettings(order=2)))
    assert outcome.status in ("no_equilibrium", "not_converged")
    assert outcome.advice


def test_a_search_ends_when_its_work_is_done_and_says_how_far_it_came() -> None:
    model = build_model(circular(), Settings(MeshSettings(order=2)))
    few = PathSettings(first=0.01)
    budget = Budget(4.5 * model.unknowns)
    bounded = replace(few, newton=replace(few.newton, budget=budget))
    outcome = equilibrium(model, 0.2, 3000.0, settings=bounded)
    assert budget.spent
    assert outcome.status == "not_converged"
    assert outcome.advice.startswith(EXHAUSTED)
    assert f"{outcome.state.force:.4g} N on the plate of 0.2 N" in outcome.advice
    assert 0 < outcome.state.force < 0.2
    again = replace(few, newton=replace(few.newton, budget=Budget(4.5 * model.unknowns)))
    assert equilibrium(model, 0.2, 3000.0, settings=again).state.force == outcome.state.force
    assert equilibrium(model, 0.2, 3000.0, settings=few).status == "equilibrium"


def test_a_search_for_limits_has_its_own_bound() -> None:
    model = build_model(circular(), Settings(MeshSettings(order=2)))
    solving, following = (PathSettings().bounded(model, followed) for followed in (False, True))
    assert solving.newton.budget is not None
    assert following.newton.budget is not None
    assert following.newton.budget.left > solving.newton.budget.left
    assert solving.bounded(model) is solving


@pytest.mark.parametrize("drawn", list(design(6, seed=2)), ids=lambda drawn: str(drawn.number))
def test_an_extreme_film(drawn) -> None:
    record = judged(drawn, MeshSettings(order=2).refined(0.5))
    assert not record.wrong, record
    assert record.status in ("equilibrium", "no_equilibrium", "not_converged")


def test_the_design_is_the_same_whatever_its_count() -> None:
    assert [str(drawn) for drawn in design(3)] == [str(drawn) for drawn in design(5)][:3]


def test_a_contradiction_would_be_seen() -> None:
    case, settings = Case(circular(), mass=17.9e-3, voltage=3000.0), Settings(MeshSettings(2))
    _, outcome = equilibrate(case, settings)
    assert outcome.status == "equilibrium"
    reached, drawn = limits(case, settings), curve(case.specimen, [case.mass], settings,
                                                   voltages=[case.voltage])
    result = solve(case, settings)
    assert not list(faults_of(case, reached, result, drawn))
    assert reached.end is not None
    low = replace(reached.end, voltage_V=2000.0)
    field = reached.end.kind
    faults = list(faults_of(case, replace(reached, **{field: low}), result, drawn))
    assert any("beyond the end" in fault for fault in faults)
    assert "curve and limits end differently" in faults
    unreal = replace(result, energy_J=float("nan"))
    assert "solve: not a number in JSON" in list(faults_of(case, reached, unreal, drawn))


def test_a_study_goes_on_from_its_records_and_is_one_section_of_a_page(tmp_path) -> None:
    kept, page = tmp_path / "kept.jsonl", tmp_path / "page.md"
    coarse = MeshSettings(order=2).refined(0.5)
    first = study(1, 2, 1, kept, coarse)
    before = kept.read_text()
    assert study(1, 2, 1, kept, coarse) == first
    assert kept.read_text() == before
    assert "1 films" in table(first)
    page.write_text("# Random specimens\n\nold\n")
    write_section(page, "## Extreme films\n\none\n")
    write_section(page, "# Random specimens\n\nnew\n")
    write_section(page, "## Extreme films\n\ntwo\n")
    assert page.read_text() == "# Random specimens\n\nnew\n\n## Extreme films\n\ntwo\n"
    assert MESH.around_plate == 6
