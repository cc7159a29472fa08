"""Legal films that nobody builds: every command answers, in bounded work, none against another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.trials.extreme_films import MESH, design, faults_of, judged, study, table
from benchmarks.trials.robustness import write_section
from tests.support.specimens import circular, elliptical
from tympan.base.errors import InputError
from tympan.fem.equilibrium import newton, path_following
from tympan.fem.equilibrium.newton import EXHAUSTED, Budget, NewtonSettings, tangent_work
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.film.laws import ArrudaBoyce, NeoHooke, Ogden
from tympan.fem.membrane.model import Model
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen, ViscousBranch
from tympan.studies.alpha import AlphaSettings, LoadGrid, alpha
from tympan.studies.case import Case, Settings, build_model, equilibrate, solve
from tympan.studies.films.reduction import reduced_film
from tympan.studies.limits import limits
from tympan.studies.limits.curve import curve
from tympan.studies.lumped.build import BuildSettings, build

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
    budget = Budget(4.5 * tangent_work(model))
    bounded = replace(few, newton=replace(few.newton, budget=budget))
    outcome = equilibrium(model, 0.2, 3000.0, settings=bounded)
    assert budget.spent
    assert outcome.status == "not_converged"
    assert outcome.advice.startswith(EXHAUSTED)
    assert f"{outcome.state.force:.4g} N on the plate of 0.2 N" in outcome.advice
    assert 0 < outcome.state.force < 0.2
    again = replace(few, newton=replace(few.newton, budget=Budget(4.5 * tangent_work(model))))
    assert equilibrium(model, 0.2, 3000.0, settings=again).state.force == outcome.state.force
    assert equilibrium(model, 0.2, 3000.0, settings=few).status == "equilibrium"


@pytest.mark.parametrize("name", ENDLESS)
def test_films_that_did_not_end_have_no_lumped_model_and_a_reason(name: str) -> None:
    case, settings = ENDLESS[name], Settings(MeshSettings(order=2))
    chosen = BuildSettings((case.mass or 1e-3,), (0.0, case.voltage / 2, case.voltage))
    with pytest.raises(InputError, match="the field model"):
        build(case.specimen, settings, chosen)


@pytest.mark.study(seconds=4)
def test_all_loads_that_circles_are_weighed_at_draw_on_one_budget(monkeypatch: pytest.MonkeyPatch
                                                                   ) -> None:
    """At each of thirty masses the film takes all the work of a search, 12 s, and has no answer."""
    monkeypatch.setattr(path_following, "WORK", 1e5)
    monkeypatch.setattr(path_following, "_TANGENTS", 2)
    film, made = ENDLESS["long, stiff"].specimen, []

    class Counted(Tangent):
        def __init__(self, model: Model, *parts: object) -> None:
            super().__init__(model, *parts)  # type: ignore[arg-type]
            made.append(model.unknowns)

    monkeypatch.setattr(newton, "Tangent", Counted)
    loads = LoadGrid(tuple(np.linspace(1.0, 1.3, 30).tolist()), (8e3,))
    with pytest.raises(InputError, match=EXHAUSTED):
        alpha(film, Settings(), AlphaSettings(loads, LoadGrid(())))
    # Two circles beside the film, two tangents a load.
    assert 100 < len(made) < 2 * 3 * 30
    assert set(made) == {build_model(film, Settings()).unknowns}


@pytest.mark.parametrize("tangents", [3, 15, 27])
def test_whatever_a_lumped_model_lacks_work_for_is_said(tangents: int) -> None:
    """Its equilibria, its circles or its vibrations; a few more tangents, and it is all there."""
    chosen = BuildSettings((20e-3, 25e-3), (0.0, 1e3, 2e3, 3e3))
    settings = Settings(MeshSettings(order=2))
    model = build_model(elliptical(60e-3), settings)

    def within(tangents: int) -> Settings:
        budget = Budget(tangents * tangent_work(model))
        few = replace(settings.path, newton=replace(settings.path.newton, budget=budget))
        return replace(settings, path=few)

    with pytest.raises(InputError, match=EXHAUSTED):
        build(model.specimen, within(tangents), chosen)
    spared = build(model.specimen, within(60), chosen)
    assert spared.json() == build(model.specimen, settings, chosen).json()


@pytest.mark.parametrize("tangents", [3, 30, 120])
def test_a_reduced_film_says_what_it_lacks_work_for(tangents: int) -> None:
    """At rest, in motion, or held against the field model: it does not pull in."""
    model = build_model(circular(branches=(ViscousBranch(30e3, 5.0),)),
                        Settings(MeshSettings(order=2)))

    def within(tangents: int) -> PathSettings:
        budget = Budget(tangents * tangent_work(model))
        return PathSettings(newton=NewtonSettings(budget=budget))

    with pytest.raises(InputError, match=EXHAUSTED):
        reduced_film(model, [0.17], 4e3, path=within(tangents))
    film = reduced_film(model, [0.17], 4e3, path=within(2000))
    assert max(film.errors.values()) < 5e-3


def test_a_search_for_limits_has_its_own_bound() -> None:
    model = build_model(circular(), Settings(MeshSettings(order=2)))
    solving, following = (PathSettings().bounded(model, followed) for followed in (False, True))
    assert solving.newton.budget is not None
    assert following.newton.budget is not None
    assert following.newton.budget.left > solving.newton.budget.left
    assert solving.bounded(model) is solving


@pytest.mark.study(seconds=5, only=("5",))
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
    lowered = replace(reached, by_kind={**reached.by_kind, reached.end.kind: low})
    faults = list(faults_of(case, lowered, result, drawn))
    assert any("beyond the end" in fault for fault in faults)
    assert "curve and limits end differently" in faults
    unreal = result.showing(energy_J=float("nan"))
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


def test_what_lies_beyond_a_films_end_takes_a_share_of_its_work(monkeypatch: pytest.MonkeyPatch
                                                                 ) -> None:
    """The film ends without tension; kept from wrinkling it would pull in later."""
    case = Case(elliptical(60e-3), mass=20e-3)
    settings = Settings(MeshSettings(order=2))
    whole = limits(case, settings, beyond=True)
    monkeypatch.setattr(path_following, "_BEYOND", 0.0)
    ended = limits(case, settings, beyond=True)
    assert whole.pull_in is not None
    assert ended.pull_in is None
    assert (ended.tension, ended.instability) == (whole.tension, whole.instability)
    assert whole.limit == ended.limit
