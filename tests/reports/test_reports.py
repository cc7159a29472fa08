"""The report of a small study: its pictures, its numbers, and what it says of damage."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from tests.support.checks.accessible import wordless
from tests.support.checks.policy import unlawful
from tests.support.costs import dear
from tympan.base.errors import InputError
from tympan.base.system import MissingLibrary
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Ellipse
from tympan.reports import look as style
from tympan.reports import scene
from tympan.reports.figures.curve import VoltageCurve, draw_curve, frame_curves
from tympan.reports.rebuild import rebuild
from tympan.reports.scales import AxisScale, column_widths, paper_scale, round_scale
from tympan.reports.study import curves, stress_figure
from tympan.reports.study import page as html
from tympan.reports.study.view import AxisLine, StudyView, view_study
from tympan.reports.template import digits, percent
from tympan.studies.alpha import AlphaSettings, LoadGrid
from tympan.studies.case import Limit, Limits, Settings
from tympan.studies.files import write_text
from tympan.studies.study import Study, StudyResult, default_study, run_study

COARSE = Settings(MeshSettings(order=2, around_plate=8, growth=1, across=1))
NAME = 'a "small" study <b> & more'


@pytest.fixture(scope="module")
def study_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A circle and an ellipse whose long axis is y, coarsely solved, stored, not yet reported."""
    folder = tmp_path_factory.mktemp("study")
    published = default_study()
    circle = published.specimens[0]
    standing = replace(circle, name="standing", frame=Ellipse((0.045, 0.075)))
    few = AlphaSettings(LoadGrid((17.9e-3,), (0.0, 3e3)), LoadGrid((20e-3,), (2.5e3,)))
    sources = (published.sources[0], "# </pre><script>alert(1)</script>")
    run_study(Study(NAME, (circle, standing), sources,
                    curves=LoadGrid((17.9e-3, 22.45e-3), (0.0, 3e3, 40e3)), alpha=few,
                    settings=COARSE)).save(folder)
    return folder


@pytest.fixture(scope="module")
def stored(study_folder: Path) -> StudyView:
    """The study as read back."""
    return view_study(StudyResult.load(study_folder), study_folder)


@pytest.fixture(scope="module")
def report(study_folder: Path) -> Path:
    """The study's report, with its figures beside it."""
    file, = html.build_study_page(StudyResult.load(study_folder), study_folder)
    return file


#: Leaves out what is drawn of a study.
_DRAWN = shutil.ignore_patterns("*.html", "*.png", "*.pdf", "*.svg")


@pytest.fixture
def copy(study_folder: Path, tmp_path: Path) -> Path:
    """A copy of the study that a test may damage."""
    return shutil.copytree(study_folder, tmp_path / "copy", ignore=_DRAWN)


class Page(HTMLParser):
    """What a page refers to and the text it shows."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.references: list[str] = []
        self.tags: list[str] = []
        self.shown = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect references."""
        self.tags.append(tag)
        self.references += [value or "" for name, value in attrs
                            if name in ("src", "href", "srcset", "data", "action")]

    def handle_data(self, data: str) -> None:
        """Collect text, without that of scripts."""
        if self.tags[-1:] != ["script"]:
            self.shown += data

    def handle_endtag(self, tag: str) -> None:
        """What follows a script is text again."""
        if tag == "script":
            self.tags.append("/script")


@pytest.fixture(scope="module")
def page(report: Path) -> Page:
    """The report, parsed."""
    return Page(report.read_text(encoding="utf-8"))


def test_all_files_are_written_and_nothing_else(report: Path) -> None:
    written = {path.name for path in report.parent.glob("[!.]*") if path.is_file()}
    assert written == {"study.json", "alpha.json", "report.html", "stress.png", "stress.pdf",
                       "stress.svg", "curves.png", "curves.svg", "forces.png", "forces.svg"}


@pytest.mark.parametrize("name", ["stress.png", "curves.png", "forces.png"])
def test_png_is_fit_for_print_and_shows_something(report: Path, name: str) -> None:
    with Image.open(report.with_name(name)) as image:
        assert image.width / image.info["dpi"][0] * 25.4 == pytest.approx(style.WIDTH, abs=0.2)
        assert image.info["dpi"][0] >= 299
        colours = image.convert("RGB").quantize(64).getcolors()
    assert colours is not None
    assert len(colours) > 20


def test_vector_figures_keep_text_and_curves_as_such(report: Path) -> None:
    svg = report.with_name("stress.svg").read_text(encoding="utf-8")
    assert svg.count("<image") == 2 + 1  # the membranes and the colour bar
    assert ">standing</text>" in svg
    assert report.with_name("stress.pdf").read_bytes().startswith(b"%PDF")
    assert "<image" not in report.with_name("curves.svg").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def again(study_folder: Path, report: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder drawn again where an older version has drawn into it."""
    folder = shutil.copytree(study_folder, tmp_path_factory.mktemp("again") / "copy", ignore=_DRAWN)
    for kind in ("png", "pdf", "svg"):
        write_text(folder / f"fig4.{kind}", "drawn by an older version")
    rebuild(folder)
    return folder


@pytest.mark.study(seconds=3)
def test_figures_repeat_byte_by_byte(report: Path, again: Path) -> None:
    for name in ("curves.svg", "stress.pdf"):
        assert again.joinpath(name).read_bytes() == report.with_name(name).read_bytes()


def test_membranes_have_one_scale_and_their_true_width(stored: StudyView) -> None:
    view = stress_figure.lay_out(stored.specimens, stored.stress_range).view
    for specimen in stored.specimens:
        pixels, (x_min, x_max, y_min, y_max) = stress_figure.specimen_picture(specimen, view)
        height, width, _ = pixels.shape
        assert width / (x_max - x_min) == pytest.approx(view.resolution, rel=1e-12)
        assert height / (y_max - y_min) == pytest.approx(view.resolution, rel=1e-12)
        drawn = np.flatnonzero((pixels < 250).any((0, 2)))
        # The outline adds half its width on either side.
        wide = (np.ptp(drawn) + 1 - view.line) / view.resolution
        assert wide == pytest.approx(2 * max(specimen.semi_axes), abs=3 / view.resolution)


def test_a_pixel_is_the_mean_of_its_samples() -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (6, 9, 3), dtype=np.uint8)
    means = pixels.reshape(2, 3, 3, 3, 3).mean(axis=(1, 3))
    assert np.abs(scene.downsampled(pixels, 3) - means).max() <= 0.5
    assert np.array_equal(scene.downsampled(pixels, 1), pixels)
    assert (scene.downsampled(np.full((4, 4, 3), 255, np.uint8), 2) == 255).all()


def test_pixels_of_the_print_reach_it_as_they_are() -> None:
    """Wherever on the page a picture lies, none is lost, met twice or mixed with others."""
    pixels = np.random.default_rng(2).integers(0, 256, (80, 100, 3), dtype=np.uint8)
    height, width = (count / style.DPI / style.MM for count in pixels.shape[:2])
    for place in ((3.0, 4.0), (3.02, 4.01), (5.033, 2.047)):
        figure = style.new_figure(20.0, 20.0)
        axes = style.place_axes(figure, *place, width, height)
        style.show_picture(axes, (pixels, (0, width, 0, height)), interpolation="none")
        assert isinstance(figure.canvas, FigureCanvasAgg)
        figure.canvas.draw()
        page = np.asarray(figure.canvas.buffer_rgba())[..., :3]
        column, row = (round(start * style.DPI * style.MM) for start in place)
        assert any(np.array_equal(page[down:down + 80, across:across + 100], pixels)
                   for down in (row - 1, row, row + 1)
                   for across in (column - 1, column, column + 1))


def test_plate_sinks_in_the_picture(stored: StudyView) -> None:
    view = stress_figure.lay_out(stored.specimens, stored.stress_range).view
    for specimen in stored.specimens:
        surface = scene.placed_surface(specimen.film, specimen.stress, view, turned=False)
        frame, plate = scene.film_rims(surface)
        assert frame[:, 2] == pytest.approx(0, abs=1e-9)
        assert plate[:, 2] == pytest.approx(-specimen.deflection, rel=1e-6)
        # The last point is the first one again and would count twice.
        up = [view.project(curve[:-1])[:, 1].mean() for curve in (plate, frame)]
        assert up[1] - up[0] == pytest.approx(specimen.deflection
                                              * np.cos(np.radians(view.elevation)), rel=1e-6)


@pytest.mark.parametrize("share", [0.0, dear(0.5, seconds=1), 1.0])
def test_colours_are_exactly_those_of_the_bar(stored: StudyView, share: float) -> None:
    specimen = stored.specimens[0]
    view = stress_figure.lay_out(stored.specimens, stored.stress_range).view
    stress = view.scale.low + share * (view.scale.high - view.scale.low)
    values = {**specimen.film.values, "stress_1": np.full_like(specimen.stress, 1e3 * stress)}
    uniform = replace(specimen, film=replace(specimen.film, values=values))
    pixels = stress_figure.specimen_picture(uniform, view)[0].reshape(-1, 3)
    colours, counts = np.unique(pixels, axis=0, return_counts=True)
    film = next(colour for colour in colours[np.argsort(-counts)] if colour.min() < 250)
    assert film == pytest.approx(255 * np.array(colormaps[style.COLOURS](share)[:3]), abs=1.5)


def loosened(run: StudyView, state: int) -> StudyView:
    """The run with the films' right halves wrinkled (1) or slack (2), and on the last curves."""
    changed = []
    for item in run.specimens:
        right = item.film.mounted[:, 0] > 1e-9
        film = replace(item.film, values={
            **item.film.values, "tension": np.where(right, state, 0),
            "stress_2": 1e3 * np.where(right, -1.0, 1.0)})
        limits = {kind: Limit(kind=kind, voltage_V=3000.0, x_m=0.01, y_m=0.0)
                  for kind in ("tension", "breakdown")}
        met = item.curves[-1].limits
        curve = replace(item.curves[-1], limits=replace(met, by_kind={**met.by_kind, **limits}))
        changed.append(replace(item, film=film,
                               result=item.result.showing(slack_share=0.5,
                                                          breakdown_margin=1.5),
                               curves=(*item.curves[:-1], curve)))
    return replace(run, specimens=tuple(changed))


def test_zones_without_tension_are_hatched(stored: StudyView) -> None:
    view = stress_figure.lay_out(stored.specimens, stored.stress_range).view
    plain, wrinkled, slack = (stress_figure.specimen_picture(run.specimens[0], view)[0].astype(int)
                              for run in (stored, loosened(stored, 1), loosened(stored, 2)))
    middle = plain.shape[1] // 2
    edge = int(3 * view.line)
    assert np.array_equal(plain[:, :middle - edge], wrinkled[:, :middle - edge])
    marked = [float((np.abs(plain - other)[:, middle + edge:] > 30).any(axis=2).mean())
              for other in (wrinkled, slack)]
    assert marked[0] > 0.1
    assert marked[1] > 1.5 * marked[0]


def test_loss_of_tension_and_breakdown_are_told(stored: StudyView, page: Page) -> None:
    loose = loosened(stored, 1)
    design = stress_figure.lay_out(loose.specimens, loose.stress_range)
    pictures = [stress_figure.specimen_picture(item, design.view) for item in loose.specimens]
    figures = [stress_figure.compose_stress(run, design, pictures) for run in (stored, loose)]
    legends = [[text.get_text() for text in figure.texts] for figure in figures]
    assert ["loss of tension" in texts for texts in legends] == [False, True]
    text = Page(html.render_study(loose, "", "")).shown
    assert "Hatched" not in page.shown
    assert "Hatched" in text
    assert "Tension is lost in 50\u202f% of circular and 50\u202f% of standing" in text
    assert "strength is at least 1.50 (circular) and 1.50 (standing) times its field" in text
    assert "breakdown" in text
    assert "snaps" not in text
    assert "3.000x 10.0, y " in text
    assert "under 22.45 g the loss of tension at 3 kV" not in text
    marked = [line for line in curves.compose_curves(loose).axes[1].lines
              if line.get_marker() in ("s", "X") and line.get_markerfacecolor() == "white"]
    assert [line.get_xdata() for line in marked] == [[3.0]] * 4


def test_pictures_leave_no_plotter_open(stored: StudyView, monkeypatch: pytest.MonkeyPatch) -> None:
    opened, plotter = [], pv.Plotter

    def recorded(**options: object) -> pv.Plotter:
        opened.append(plotter(**options))
        return opened[-1]

    monkeypatch.setattr(pv, "Plotter", recorded)
    view = stress_figure.lay_out(stored.specimens, stored.stress_range).view
    stress_figure.specimen_picture(stored.specimens[0], view)
    with pytest.raises(ValueError, match="nocolour"):
        stress_figure.specimen_picture(stored.specimens[0], replace(view, colours="nocolour"))
    assert len(opened) == 2
    assert all(window._closed for window in opened)


def test_no_opengl_is_one_clear_message(stored: StudyView, monkeypatch: pytest.MonkeyPatch) -> None:
    class Blind:
        def __getattr__(self, name: str) -> object:
            return lambda *_: False

    monkeypatch.setattr(scene, "vtkRenderWindow", Blind)
    with pytest.raises(MissingLibrary, match="libegl1"):
        stress_figure.specimen_picture(stored.specimens[0], stress_figure.lay_out(
            stored.specimens, stored.stress_range).view)


def test_pictures_and_controls_have_words(report: Path) -> None:
    text = report.read_text(encoding="utf-8")
    assert "<img" in text
    assert "<select" in text
    assert wordless(text) == []


def test_page_refers_to_nothing_outside_itself(page: Page, report: Path) -> None:
    assert page.references
    assert all(reference.startswith(("data:image/", "#")) for reference in page.references)
    text = re.sub(r"data:image/[^\"]*", "", report.read_text(encoding="utf-8"))
    for outside in ("http:", "https:", "url(", "@import", "<link"):
        assert outside not in text


def test_the_page_runs_its_own_scripts_and_nothing_else(browser: Any, report: Path,
                                                        tmp_path: Path) -> None:
    """Chromium holds the page to its policy, and the policy lets the page work."""
    text = report.read_text(encoding="utf-8")
    assert unlawful(text) == []
    assert unlawful(text.replace("const", "let", 1))[0].startswith("script: ")
    foreign = tmp_path / "foreign.html"
    foreign.write_text(text.replace("<main>", "<main><script>document.title = 'run'</script><img "
                                    "src=x onerror=\"document.title = 'run'\"><style>main { "
                                    "opacity: 0.5; }</style>", 1), encoding="utf-8")
    for file in (report, foreign):
        shown, said = browser.new_page(), []
        shown.on("console", lambda message, said=said: said.append(message.text))
        shown.goto(file.as_uri())
        assert shown.locator(".viewer canvas").is_visible()
        assert shown.locator("[name=film] option").count() > 1
        assert shown.title() != "run"
        assert shown.evaluate("getComputedStyle(document.querySelector('main')).opacity") == "1"
        assert bool(said) == (file == foreign), said
        assert all("Content Security Policy" in words for words in said)
        shown.close()


def test_films_can_be_turned_in_the_page_and_it_stays_small(report: Path, stored: StudyView
                                                            ) -> None:
    text = report.read_text(encoding="utf-8")
    assert len(text) < 3e6
    before, _, after = text.partition('<script type="application/json" class="films">')
    data, _, rest = after.partition("</script>")
    assert before.count("<script") + rest.count("<script") == 1
    films = json.loads(data)["films"]
    assert [film["name"] for film in films] == [item.name for item in stored.specimens]
    for film, item in zip(films, stored.specimens, strict=True):
        assert film["values"]["stress"]["high"] == pytest.approx(item.stress.max(), rel=1e-12)
        assert film["values"]["deflection"]["high"] == pytest.approx(item.deflection, rel=1e-9)
        assert film["turned"] == (item.name == "standing")
    scale = stress_figure.lay_out(stored.specimens, stored.stress_range).view.scale
    stress = json.loads(data)["quantities"]["stress"]
    assert (stress["low"], stress["high"]) == (scale.low, scale.high)


def test_the_page_says_everything_without_scripts(page: Page, stored: StudyView) -> None:
    assert page.tags.count("img") == 3
    for item in stored.specimens:
        assert digits(item.deflection, 4) in page.shown


def test_page_escapes_what_users_wrote(page: Page) -> None:
    assert page.tags.count("script") == 2  # the films and what draws them
    assert "b" not in page.tags
    assert NAME in page.shown
    assert "</pre><script>alert(1)</script>" in page.shown


def test_page_has_the_numbers_of_alpha(page: Page, study_folder: Path) -> None:
    record = json.loads(study_folder.joinpath("alpha.json").read_text(encoding="utf-8"))[1]
    for number in record["alpha"]:
        assert f"{number:.4f}" in page.shown
    assert percent(record["fit_error"]) in page.shown
    assert percent(record["held_out_error"]) in page.shown
    for warning in record["warnings"]:
        assert warning in page.shown
    assert not re.search(r"Eq\.|Fig\.|cone", page.shown)


def test_pictures_of_an_older_version_leave_with_their_names(again: Path) -> None:
    assert not list(again.glob("fig4.*"))
    assert {file.name for file in again.glob("stress.*")} == {
        "stress.pdf", "stress.png", "stress.svg"}


def test_page_has_results_and_settings(page: Page, study_folder: Path) -> None:
    record = json.loads(study_folder.joinpath("study.json").read_text(encoding="utf-8"))
    for specimen in record["specimens"]:
        result = specimen["result"]
        for number in (result["deflection_m"] * 1e3, result["capacitance_F"] * 1e9,
                       result["max_true_stress_Pa"] / 1e3):
            assert f"{number:.4g}"[:5] in page.shown
        assert str(result["dofs"]) in page.shown
        assert specimen["material"] in page.shown
    assert record["libraries"]["scikit-fem"] in page.shown
    assert "9.80665 m/s²" in page.shown
    assert "around plate" in page.shown


def test_a_film_without_force_curves_is_named(stored: StudyView, page: Page) -> None:
    assert "There are no curves of" not in page.shown
    first, second = stored.stored.specimens
    slack = replace(stored, stored=replace(stored.stored, specimens=(
        first, replace(second, force=None))))
    text = Page(html.render_study(slack, "", "")).shown
    assert "There are no curves of standing: a film that is slack where it is flat" in text


def test_pull_in_is_told_and_marked(stored: StudyView, page: Page) -> None:
    limited = Limits({"pull_in": Limit(kind="pull_in", voltage_V=8234.0, x_m=0.0, y_m=0.0)},
                     ended="pull-in")
    curve = replace(stored.specimens[0].curves[0], limits=limited)
    assert curve.end == "pull-in at 8.234 kV (the limit)"
    assert html.stroke("a", curve, 0.0, 40.0)["limit"] == limited.pull_in
    # An ordinary limit is no warning, as it stands in the table with its place.
    assert not list(html.curve_warnings("circular", curve))
    for item in stored.specimens:
        for curve in item.curves:
            for limit in curve.limits.told:
                place = limit.place.replace(" mm, y", ", y")
                text = f"{digits(limit.voltage_V / 1e3, 4)}{limit.text.partition(' kV')[2]}"
                assert f"{text}{place}" in page.shown
                assert limit.resolved != (
                    f"{curve.mass:g} g {limit.words}; the "
                    "mesh hardly resolves this" in page.shown)


def test_limits_that_are_not_sure_and_curves_without_an_end_are_warned_of(
        stored: StudyView) -> None:
    lost = Limit(kind="tension", voltage_V=6e3, x_m=0.0, y_m=0.0, spread=0.3)
    rough = Limits({"tension": lost}, ended="the film was not followed further")
    texts = list(html.curve_warnings("a", replace(stored.specimens[0].curves[0], limits=rough)))
    assert texts == [
        "a: under 17.9 g loss of tension at 6 kV ± 30 %; the mesh hardly resolves "
        "this: divide its elements further, with a larger --refine",
        "a: under 17.9 g the film was not followed further"]


def test_curves_end_where_the_film_does_with_a_word(stored: StudyView) -> None:
    for axes in curves.compose_curves(stored).axes:
        words = [text.get_text() for text in axes.texts]
        ends = {"pull-in", "not followed further", "loss of tension"}
        assert ends & {*words}
        assert len(words) <= 3 * len(stored.specimens)
    curve = stored.specimens[0].curves[0]
    voltage, deflection = curve.line
    assert voltage[-1] == pytest.approx(curve.voltage[-1])
    # A line through points that follow the film meets those that were asked for.
    assert np.interp(3.0, voltage, deflection) == pytest.approx(curve.there[1], rel=1e-3)


def test_summary_compares_at_equal_load(stored: StudyView) -> None:
    circle, ellipse = stored.specimens
    ratio = ellipse.deflection / circle.deflection
    assert html.reference(stored.specimens) is circle
    assert f"standing sinks {percent(ratio - 1)} more" in html.study_summary(stored)
    assert "higher on the short axis by" in html.study_summary(stored)
    assert "same on both axes in circular" in html.study_summary(stored)


def test_short_axis_is_told_by_the_frame(stored: StudyView) -> None:
    circle, standing = stored.specimens
    assert standing.short is standing.along_x
    assert standing.long is standing.along_y
    assert standing.short.sides[0].distance[-1] == pytest.approx(35)
    assert standing.long.sides[0].distance[-1] == pytest.approx(65)
    assert circle.alike
    assert not standing.alike
    scales = stress_figure.lay_out(stored.specimens, stored.stress_range).view.scale
    assert [text.split(" ", 1)[1] for text, _, _ in stress_figure.end_values(standing, scales)] == [
        "on the short axis", "on the long axis"]
    assert len(stress_figure.end_values(circle, scales)) == 1


def test_field_lines_and_result_agree(stored: StudyView, study_folder: Path) -> None:
    lines = [specimen.lines for specimen in StudyResult.load(study_folder).specimens]
    for specimen, line in zip(stored.specimens, lines, strict=True):
        assert specimen.result.max_true_stress_Pa is not None
        highest = float(specimen.stress.max())
        assert highest == pytest.approx(specimen.result.max_true_stress_Pa / 1e3, rel=1e-3)
        assert specimen.stress.min() * (1 - 1e-3) <= line["stress_1"].min() / 1e3
        assert line["stress_1"].max() / 1e3 <= highest * (1 + 1e-3)
        around_plate = 1e3 * line["deflection"][line["line"] == "plate"]
        assert around_plate == pytest.approx(specimen.deflection, rel=1e-9)
        deepest = 1e3 * specimen.film.points[:, 2].max()
        assert deepest == pytest.approx(specimen.deflection, rel=1e-9)


def test_larger_long_axis_is_told(stored: StudyView) -> None:
    standing = stored.specimens[1]
    turned = replace(standing, along_x=standing.along_y, along_y=standing.along_x)
    assert "higher on the long axis" in html.stress_at_plate([turned], 90.0)


def test_sides_of_an_eccentric_plate_are_both_kept() -> None:
    distance = np.array([-30.0, -10.0, 10.0, 20.0])
    line = AxisLine(distance, np.array([1.0, 3.0, 4.0, 2.0]))
    right_side, left_side = line.sides
    assert right_side.distance.tolist() == [0, 10]
    assert left_side.stress.tolist() == [3, 1]
    assert line.at_plate == 4


def test_curve_without_any_equilibrium() -> None:
    curve = VoltageCurve(10.0, Limits({}, ended="pull-in"), np.zeros(0), np.zeros(0),
                         np.array([1.0, 2.0]), ("no_equilibrium",) * 2, np.full(2, np.nan))
    assert curve.end == "no equilibrium"
    assert html.stroke("a", curve, 1.0, 2.0)["trouble"] == "no equilibrium"


def curve_to(end: float, thins: bool) -> VoltageCurve:
    """A curve whose film loses tension and breaks down at and near a voltage [kV]."""
    voltage = np.linspace(0.0, end + 0.2, 50)
    tension, breakdown, pull_in = (
        Limit(kind=kind, voltage_V=1e3 * (end + beyond), x_m=0.0, y_m=0.0)
        for kind, beyond in (("tension", 0.0), ("breakdown", 0.02), ("pull_in", 0.2)))
    thinned = replace(tension, kind="instability") if thins else None
    reached = {"tension": tension, "breakdown": breakdown, "instability": thinned,
               "pull_in": pull_in}
    limits = Limits(reached, ended="pull-in", thins=thins)
    deflection = 2 + 8 * (voltage / voltage[-1]) ** 6
    return VoltageCurve(10.0, limits, voltage, deflection, np.zeros(0), (), np.zeros(0))


def test_a_stroke_ends_at_the_first_limit() -> None:
    """Not at a pull-in that only a film kept from wrinkling would reach."""
    curve = curve_to(8.0, True)
    found = html.stroke("a", curve, 0.0, np.inf)
    assert found["limit"].kind == "tension"
    assert found["stroke"] == pytest.approx(8 * (8.0 / 8.2) ** 6, rel=0.05)
    before = html.stroke("a", curve, 2.0, 6.0)
    assert before["limit"] is None
    assert before["stroke"] == pytest.approx(8 * ((6 / 8.2) ** 6 - (2 / 8.2) ** 6), rel=0.05)
    assert html.stroke("a", curve, 8.1, 8.2) == {"name": "a", "trouble":
                                                 "loss of tension at 8 kV"}


@pytest.mark.parametrize(("ends", "words"), [
    (((7.95, True), (7.96, True), (7.97, True)), 2),
    (((7.95, False), (7.97, False)), 3),
    (((4.0, False), (8.0, True)), 5),
    (tuple((end, end < 5) for end in np.linspace(2.0, 8.0, 6)), None),
])
def test_words_at_limits_lie_over_nothing(ends: tuple[tuple[float, bool], ...],
                                          words: int | None) -> None:
    """Not each other or the legend, nor curves where few; equal ones side by side are said once."""
    with style.figure_style():
        figure = style.new_figure(90.0)
        axes = style.place_axes(figure, 14.0, 8.0, 80.0, 60.0)
        drawn = [curve_to(*end) for end in ends]
        for number, curve in enumerate(drawn):
            draw_curve(axes, curve, number, f"film {number}: {curve.end}")
        frame_curves(axes, drawn)
        figure.canvas.draw()
        boxes = [text.get_window_extent() for text in (*axes.texts, axes.get_legend())]
        lines = [axes.transData.transform(np.transpose(curve.line)) for curve in drawn]
    assert words is None or len(axes.texts) == words
    for number, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:number])
        assert words is None or not any(box.count_contains(line) for line in lines)


@pytest.mark.parametrize("count", [2, 6, 20])
def test_a_legend_is_as_wide_as_its_axes_and_covers_nothing(stored: StudyView, count: int) -> None:
    films = [replace(stored.specimens[0], name=f"elliptical-{number}",
                     curves=(curve_to(5 + 3 * number / count, number % 2 == 0),))
             for number in range(count)]
    with style.figure_style():
        figure = curves.compose_curves(replace(stored, specimens=tuple(films)))
        axes, = figure.axes
        legend = axes.get_legend()
        assert legend is not None
        box, frame = legend.get_window_extent(), axes.get_window_extent()
        texts = " ".join(text.get_text() for text in legend.get_texts())
        colours = {line.get_color() for line in legend.get_lines()}
    assert frame.x0 <= box.x0 < box.x1 <= frame.x1
    assert 0 <= box.y0 < box.y1 < frame.y0
    assert figure.get_figheight() < 6
    assert all(film.name in texts for film in films)
    assert ("(the" in texts) == (count <= 6)
    assert len(colours) >= count


@pytest.mark.parametrize("low", [0.0, -1.1e3, -1.1e9])
def test_a_picture_is_as_wide_as_its_words(tmp_path: Path, low: float) -> None:
    """Numbers beside the axis may need more room than is left for them; else nothing changes."""
    def compose() -> Figure:
        figure = style.new_figure(40.0, 60.0)
        axes = style.place_axes(figure, style.LEFT, style.TITLE, 42.0, 20.0)
        style.describe(axes, "displacement (mm)", "force (mN)")
        axes.set_ylim(low, 7.0)
        axes.ticklabel_format(style="plain")
        return figure

    picture, _ = style.save_figure(tmp_path, "page", compose, dpi=100)
    pixels = np.asarray(Image.open(picture).convert("RGB"))
    inked = np.flatnonzero((pixels < 230).any(axis=(0, 2)))
    assert 0 < inked[0] < inked[-1] < pixels.shape[1] - 1
    assert (pixels.shape[1] > 240) == (low != 0.0)
    assert pixels.shape[1] >= int(60.0 * style.MM * 100)


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_a_legend_lies_over_no_line(scale: str) -> None:
    """Lines from corner to corner leave no place for it within, so there is more room above."""
    with style.figure_style():
        figure = style.new_figure(70.0, 100.0)
        axes = style.place_axes(figure, 14.0, 8.0, 80.0, 50.0)
        axes.set_yscale(scale)
        x, y = np.linspace(0.0, 1.0, 3), np.geomspace(1.0, 100.0, 3)
        for number, values in enumerate((y, y[::-1], 0 * x + 10.0)):
            axes.plot(x, values, label=f"a line with a long name of its own, number {number}")
        axes.plot(x, 0 * x + 3.0, "o", linestyle="none", label="marks")
        bottom, top = axes.get_ylim()
        legend = style.legend(axes)
        figure.canvas.draw()
        box = legend.get_window_extent()
        for line in axes.get_lines():
            share = np.linspace(0.0, 1.0, 2001)
            steps = share if line.get_linestyle() != "None" else np.linspace(0.0, 1.0, 3)
            places = axes.transData.transform(line.get_xydata())
            dense = [np.interp(steps, x, part) for part in places.T]
            assert not box.count_contains(np.transpose(dense))
        low, high = axes.get_ylim()
    assert (low, high > top) == (bottom, True)


@pytest.mark.parametrize(("low", "high"), [
    (96.53, 98.68), (98.5, 98.5), (0.0, 0.0), (0.0, 41.0), (30.0, 31.0), (-3.0, 12.0),
    (96513.6999, 96513.7001),
    (1e-3, 1.1e-3), (99.98, 100.02), (5.0, 433.0),
])
def test_scale_covers_its_values_with_few_round_ticks(low: float, high: float) -> None:
    made = round_scale(low, high)
    assert made.low <= low <= high <= made.high
    assert made.high > made.low
    assert 3 <= len(made.ticks) <= 7
    assert made.low <= made.ticks[0] < made.ticks[-1] <= made.high
    assert made.ticks[0] - made.low < made.step
    texts = [made.text(tick) for tick in made.ticks]
    assert len(set(texts)) == len(texts)
    assert [float(text.replace("−", "-")) for text in texts] == pytest.approx(made.ticks, rel=1e-12,
                                                                              abs=1e-12)
    assert float(made.start.replace("−", "-")) == pytest.approx(made.low, rel=1e-12, abs=1e-12)


def test_label_tells_where_the_scale_starts() -> None:
    assert stress_figure.stress_label(round_scale(0, 41)) == "largest principal true stress (kPa)"
    above_0 = AxisScale(96.5, 98.0, (97.0, 98.0))
    assert "scales start at 96.5, not 0" in stress_figure.stress_label(above_0)


@pytest.mark.parametrize("films", [[90.0], [90, 120, 150], [20, 150, 30], [300, 10, 10]])
def test_columns_fit_the_page(films: list[float]) -> None:
    paper = paper_scale([films], 165, 5, 36, 85)
    widths = column_widths(films, paper, 36)
    assert sum(widths) + 5 * (len(films) - 1) <= 165 + 1e-9
    assert max(films) * paper <= 85 + 1e-9
    assert min(widths) >= 36
    full = sum(widths) + 5 * (len(films) - 1) == pytest.approx(165)
    assert full or max(films) * paper == pytest.approx(85)


@pytest.mark.parametrize("name",
                         ["study.json", "alpha.json", "fields/standing.vtu", "lines/standing.csv",
                                  "curves/standing.csv"])
def test_missing_file_is_named(copy: Path, name: str) -> None:
    copy.joinpath(name).unlink()
    with pytest.raises(InputError, match="is missing") as caught:
        StudyResult.load(copy)
    assert caught.value.file == copy / name
    assert not copy.joinpath("report.html").exists()


@pytest.mark.parametrize("name",
                         ["study.json", "alpha.json", "fields/standing.vtu", "lines/standing.csv",
                                  "curves/standing.csv"])
@pytest.mark.parametrize("part", [0.0, 0.3, 0.8])
def test_truncated_file_is_named(copy: Path, name: str, part: float) -> None:
    content = copy.joinpath(name).read_bytes()
    copy.joinpath(name).write_bytes(content[:int(part * len(content)) + 3])
    with pytest.raises(InputError) as caught:
        view_study(StudyResult.load(copy), copy)
    assert caught.value.file == copy / name


@pytest.mark.parametrize(("name", "old", "new", "key"), [
    ("study.json", '"deflection_m": ', '"deflection_m": "x", "y": ',
     "specimens[0].result.deflection_m"),
    ("study.json", '"semi_axes_m"', '"half_axes_m"', "specimens[0].semi_axes_m"),
    ("study.json", '"name": "circular"', '"name": "../circular"', "specimens[0].name"),
    ("study.json", '"rig"', '"rigg"', "rig"),
    ("alpha.json", '"cone_scale"', '"scale"', "[0].cone_scale"),
    ("alpha.json", '"fit_error": ', '"fit_error": null, "z": ', "[0].bases.membrane.fit_error"),
    ("lines/circular.csv", "stress_1_kPa", "stress_kPa", "stress_1_kPa"),
    ("lines/circular.csv", "\nx,-", "\nx,nan-", "distance_mm"),
    ("lines/circular.csv", "\ny,", "\nw,", "line"),
    ("curves/circular.csv", "17.9,0,", "17.9,zero,", "voltage_kV"),
])
def test_wrong_value_is_named(copy: Path, name: str, old: str, new: str, key: str) -> None:
    file = copy / name
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        view_study(StudyResult.load(copy), copy)
    assert caught.value.file == file
    assert key in str(caught.value)
