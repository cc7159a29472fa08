"""The explorer's page, as a browser meets it."""

from __future__ import annotations

import re
import signal
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.explore.browser import Running, exploring, pixels
from tests.support.specimens import specimen_toml
from tympan.cli import main
from tympan.explore.view import FilmView, changed
from tympan.fem.film.library import load_specimen
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, solve

pytest.importorskip("aiohttp", reason="aiohttp is not installed")

START = ("oval.toml", "--mass", "17.9 g", "--voltage", "2 kV")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a specimen."""
    place = tmp_path_factory.mktemp("explore")
    (place / "oval.toml").write_text(specimen_toml(), encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def oval(folder: Path) -> Specimen:
    """The specimen that is explored."""
    return load_specimen(folder / "oval.toml")


@pytest.fixture(scope="module")
def running(folder: Path) -> Iterator[Running]:
    """The explorer of it."""
    with exploring(folder, *START) as process:
        yield process


@pytest.fixture
def page(browser: Any, running: Running) -> Iterator[Any]:
    """A page of its own, in a browser of its own, with its film drawn; it asks nobody else."""
    context = browser.new_context(viewport={"width": 1300, "height": 900})
    shown, asked, errors = context.new_page(), [], []
    shown.on("request", lambda request: asked.append(request.url))
    shown.on("pageerror", lambda error: errors.append(str(error)))
    shown.on("console", lambda message: message.type != "error" or errors.append(message.text))
    shown.goto(running.address)
    shown.wait_for_selector("#result-deflection_m", timeout=120_000)
    yield shown
    assert not errors
    assert len(asked) >= 5
    assert all(re.match(r"(http|ws)://127\.0\.0\.1:|data:", url) for url in asked)
    context.close()


def opened(address: str, **headers: str) -> Any:
    """An address as a browser opens it, which keeps cookies on the way."""
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    return opener.open(urllib.request.Request(address, headers=headers))


def answered(address: str, **headers: str) -> int:
    """The status with which an address answers."""
    try:
        with opened(address, **headers) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def test_who_does_not_know_the_token_is_refused(running: Running) -> None:
    for path in ("", "?token=", "?token=guess", "x/index.html", "x/ws", "%C3%A9?token=%C3%A9"):
        assert answered(running.root + path) == 403
    assert answered(running.root, Cookie="tympan-1=guess") == 403
    assert answered(running.address, Origin="http://example.org") == 403
    assert answered(running.address) == 200


def test_files_beside_the_page_are_not_served(running: Running) -> None:
    token = running.address.partition("?")[2]
    with opened(running.address) as answer:
        name = answer.url.removeprefix(running.root).partition("/")[0]
    assert answered(f"{running.root}{name}/index.html?{token}") == 200
    for path in ("..%2f..%2f..%2f..%2fetc%2fpasswd", "oval.toml", "page.html"):
        assert answered(f"{running.root}{name}/{path}?{token}") == 404


def waited(of: Callable[[], Any], wanted: Any, seconds: float = 60.0) -> None:
    """Wait until something is as wanted."""
    end = time.monotonic() + seconds
    while of() != wanted:
        assert time.monotonic() < end, (of(), wanted)
        time.sleep(0.05)


def deflection(page: Any) -> float:
    """What stands on the page once the film is at rest [m]."""
    page.wait_for_selector("#numbers[aria-busy=false]", timeout=30_000)
    return float(page.inner_text("#result-deflection_m").split()[0]) / 1e3


def test_a_slider_moved_by_keys_gives_the_film_of_solve(page: Any, oval: Specimen) -> None:
    assert deflection(page) == pytest.approx(solved(FilmView(oval, mass=17.9e-3, voltage=2e3)),
                                             rel=1e-4)
    slider, oblique = page.locator("#slider-voltage"), pixels(page)
    page.select_option("#depth", "10")
    page.click("text=from the side")
    waited(lambda: sag(pixels(page)) < 0.8 * sag(oblique), True)
    # Where the film ends, which makes the slider's steps, may take a busy machine seconds.
    waited(lambda: page.get_attribute(".curve", "aria-busy"), "false")
    time.sleep(1.0)
    before = pixels(page)
    slider.focus()
    for _ in range(150):
        page.keyboard.press("ArrowRight")
    # A slow browser still takes keys while the film is drawn.
    waited(lambda: slider.input_value() == reached(slider, 2.0, 150), True)
    voltage = 1e3 * float(slider.input_value())
    assert voltage > 3e3
    waited(lambda: page.inner_text("#loads"), f"at {voltage / 1e3:.6g} kV under 17.9 g")
    expected = solved(FilmView(oval, mass=17.9e-3, voltage=voltage))
    assert deflection(page) == pytest.approx(expected, rel=1e-4)
    assert page.input_value("#number-voltage") == f"{voltage / 1e3:.6g}"
    time.sleep(1.0)
    assert (pixels(page) != before).any()
    # The eye stays where it was.
    assert sag(pixels(page)) == pytest.approx(10 * expected / (2 * 60e-3), rel=0.12)


def reached(slider: Any, start: float, keys: int) -> str:
    """Where a slider is after so many keys, at most at its end."""
    step, most = (float(slider.get_attribute(name)) for name in ("step", "max"))
    return f"{min(start + keys * step, most):.6g}"


def solved(view: FilmView) -> float:
    """The deflection of ``tympan solve`` [m]."""
    result = solve(view.case, Settings())
    assert result.deflection_m is not None
    return result.deflection_m


def sag(picture: Any) -> float:
    """How high a film from the side is in a picture, over its width."""
    drawn = (picture.astype(int).sum(axis=2) < 3 * 235)[4:-4, 4:-4]
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    return float(np.ptp(rows) / np.ptp(columns))


def test_numbers_typed_make_another_film_and_another_browser_keeps_its_own(
        page: Any, browser: Any, running: Running, oval: Specimen) -> None:
    context = browser.new_context()
    other = context.new_page()
    other.goto(running.address)
    other.wait_for_selector("#result-deflection_m", timeout=120_000)
    began = deflection(other)
    typed(page, "frame.semi_axes.0", "5.2 cm")
    typed(page, "stiffness", "1.2")
    view = changed(FilmView(oval, mass=17.9e-3, voltage=2e3), "frame.semi_axes.0", 52e-3)
    expected = solved(changed(view, "stiffness", 1.2))
    waited(lambda: deflection(page) == pytest.approx(expected, rel=1e-4), True)
    assert float(page.input_value(r"#slider-frame\.semi_axes\.0")) == 52
    assert deflection(other) == began
    context.close()


def test_what_is_being_typed_stays_while_another_film_arrives(page: Any) -> None:
    began, words = deflection(page), page.locator("#number-stiffness")
    typed(page, "frame.semi_axes.0", "5.1 cm")
    words.fill("1.3")
    waited(lambda: deflection(page) != began, True)
    assert words.input_value() == "1.3"
    words.press("Enter")
    waited(lambda: page.locator("#slider-stiffness").input_value(), "1.3")


#: Boxes of the film, of the curve and of all controls, as top, bottom, left and right [pixels].
BOXES = """() => ["canvas", "#curve svg", "#controls"].map(name => {
  const box = document.querySelector(name).getBoundingClientRect();
  return [box.top, box.bottom, box.left, box.right];
})"""


@pytest.mark.parametrize(("width", "height"), [(1400, 900), (820, 1180)])
def test_film_curve_and_controls_are_in_view_together(page: Any, width: int, height: int) -> None:
    page.wait_for_selector("#curve svg .mark", timeout=60_000)
    page.set_viewport_size({"width": width, "height": height})
    for scrolled in (0, 100):
        page.evaluate(f"scrollTo(0, {scrolled})")
        boxes = page.evaluate(BOXES)
        film, curve, _ = boxes
        for top, bottom, left, right in (film, curve):
            assert 0 <= top < bottom <= height
            assert 0 <= left < right <= width
            assert right - left > 300
            assert bottom - top > 150
        assert film[1] <= curve[0]
    page.evaluate("scrollTo(0, 0)")
    for top, bottom, _, right in page.evaluate(BOXES):
        assert 0 <= top < bottom <= height
        assert right <= width


#: Names of numbers and controls that take more than a line.
WRAPPED = """() => [...document.querySelectorAll("dt, .control label")].filter(element =>
  element.getBoundingClientRect().height > 1.7 * parseFloat(getComputedStyle(element).fontSize)
).map(element => element.textContent)"""


@pytest.mark.parametrize("width", [1400, 820])
def test_names_of_numbers_and_controls_are_in_one_line(page: Any, width: int) -> None:
    page.wait_for_selector("#limit-alpha-1", timeout=60_000)
    page.set_viewport_size({"width": width, "height": 900})
    assert page.evaluate(WRAPPED) == []


def typed(page: Any, key: str, text: str) -> None:
    """Type into a number field."""
    escaped = key.replace(".", r"\.")
    page.fill(f"#number-{escaped}", text)
    page.keyboard.press("Enter")


#: Whether what is focused is seen to be, and what it is called: by itself or by a label.
FOCUSED = """() => {
  const at = document.activeElement, style = getComputedStyle(at);
  const words = [at.ariaLabel, ...[...(at.labels || [])].map(label => label.innerText),
                 at.tagName === "BUTTON" || at.tagName === "SUMMARY" ? at.innerText : ""];
  return [at.tagName, at.id, words.filter(Boolean).join(" ").trim(),
          style.outlineStyle !== "none" && parseFloat(style.outlineWidth) > 0];
}"""


def test_every_control_is_reached_by_the_tab_key_and_has_a_name(page: Any) -> None:
    controls = page.evaluate("""() => [...document.querySelectorAll("input, select, button")]
        .filter(item => !item.disabled && item.offsetParent).map(item => item.id)""")
    page.evaluate("() => document.activeElement.blur()")
    reached = []
    for _ in range(2 * len(controls)):
        page.keyboard.press("Tab")
        reached.append(page.evaluate(FOCUSED))
        if reached[-1][0] == "BODY":
            break
    named = {name for tag, name, *_ in reached}
    assert len([name for name in controls if name.startswith(("slider-", "number-"))]) >= 10
    assert {*controls} <= named
    controlled = [stop for stop in reached if stop[0] in ("INPUT", "SELECT", "BUTTON")]
    assert len(controlled) >= len(controls)
    for tag, name, words, seen in controlled:
        assert words, (tag, name)
        assert seen, (tag, name)


def test_bad_values_are_told_in_place_and_the_last_film_stays(page: Any) -> None:
    began = deflection(page)
    typed(page, r"plate.outline.radius", "50")
    waited(lambda: page.locator(".error:visible").count(), 1)
    assert "the plate must lie inside the frame" in page.inner_text(".error:visible")
    assert page.get_attribute(r"#number-plate\.outline\.radius", "aria-invalid") == "true"
    typed(page, "plate.outline.radius", "10")
    waited(lambda: page.locator(".error:visible").count(), 0)
    page.wait_for_selector("#limit-pull_in", timeout=60_000)
    typed(page, "voltage", "20")
    waited(lambda: "past the film's end" in page.inner_text("#message"), True)
    assert "Shown is the last film, at 2 kV under 17.9 g" in page.inner_text("#message")
    assert deflection(page) == began
    assert page.locator("#curve svg .mark").count() >= 1


def test_what_is_saved_is_what_the_command_solves_and_nothing_else_is_written(
        page: Any, folder: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    import json
    import shlex

    began = deflection(page)
    typed(page, "stiffness", "1.1")
    waited(lambda: deflection(page) != began, True)
    waited(lambda: "save the film first" in page.inner_text("#unsaved"), True)
    assert page.input_value("#name") == "oval-2"
    page.click("#copy-command")
    page.click("#copy-python")
    (folder / "films").mkdir()
    page.fill("#name", "stiff one")
    page.fill("#folder", str(folder / "films"))
    assert {file.name for file in folder.iterdir()} == {"oval.toml", "films"}
    page.click("#save")
    waited(lambda: (folder / "films" / "stiff one.toml").exists(), True)
    waited(lambda: "stiff one.toml" in (page.text_content("#command-text") or ""), True)
    assert page.inner_text("#unsaved") == ""
    page.fill("#name", "stiff one")
    page.click("#save")
    waited(lambda: "Not saved" in page.inner_text("#written"), True)
    shown = deflection(page)
    monkeypatch.chdir(folder)
    command = page.text_content("#command-text")
    main([*shlex.split(command)[1:], "--json"])
    assert json.loads(capsys.readouterr().out)["deflection_m"] == pytest.approx(shown, rel=1e-4)


@pytest.mark.study(seconds=4)
def test_interrupting_it_ends_everything_with_one_line(folder: Path) -> None:
    with exploring(folder, *START) as running:
        assert answered(running.address) == 200  # so that there are processes
        time.sleep(1.0)
        running.process.send_signal(signal.SIGINT)
        _, errors = running.process.communicate(timeout=30)
        assert running.process.returncode == 130
        assert errors.splitlines() == ["tympan: interrupted"]
