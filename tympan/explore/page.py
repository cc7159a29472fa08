"""One browser's page: its controls make a view, and the solved view becomes a picture."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import AsyncGenerator, Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import Any

from tympan.base.errors import InputError
from tympan.explore.copied import command_of, python_of, stiffness_remark
from tympan.explore.curve import drawn_curve
from tympan.explore.latest import Answer, Latest, Trouble
from tympan.explore.numbers import (
    blocked_rows,
    curve_rows,
    limit_rows,
    loads_of,
    result_rows,
)
from tympan.explore.quick import Neighbours, QuickCurve, quick_answers
from tympan.explore.session import (
    Bands,
    Blocked,
    FollowedCurve,
    Question,
    Scene,
    Views,
    followed,
)
from tympan.explore.subject import Subject
from tympan.explore.view import (
    SHAPED,
    Control,
    FilmView,
    as_read,
    changed,
    controls,
    outline_of,
    shape_of,
    with_shape,
)
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.outlines import examples
from tympan.geometry.specimen import Specimen
from tympan.reports.viewer.payload import record_of
from tympan.studies.case import Limit
from tympan.studies.files import write_text
from tympan.studies.tolerance.given import Tolerances

#: Time for which an outdated solve may go on [s]; an outdated curve is dropped at once.
_PATIENCE = 0.7
#: Time for which the controls must rest before slower results follow them [s].
_REST = 0.15
#: Further time until finite elements follow a film shown by a reduced one [s].
_LATER = 0.85
#: Niceness of the process of curves.
_BEHIND = 15

#: End of the slider of the voltage before the film's end is known [V].
_USUAL = 10e3
#: End of a slider of the voltage, over the voltage where the film ends.
_BEYOND = 1.15


#: Explanation of the numbers in brackets.
_SCATTER = "In brackets: 5 and 95 % of films made to the tolerances."

#: Words for a curve that finite elements have not computed yet.
_BY = "by a reduced film at first"


@dataclass(frozen=True, eq=False)
class Picture:
    """A scene with its film as the page's viewer needs it."""

    scene: Scene
    film: dict[str, Any] | None


@dataclass(frozen=True)
class Asked:
    """A view to be shown; the ``blocked`` force of its plate may come from elsewhere.

    ``sliding``: its numbers are about to change again, so that a coarse mesh is good enough.
    """

    view: FilmView
    blocked: bool = True
    sliding: bool = False


def scene_answers() -> Answer:
    """Make a worker that solves and draws views, in its own process."""
    views = Views()

    def answer(asked: Asked) -> Iterator[Scene | Picture | Blocked]:
        view, film = asked.view, None
        scene = views.scene(view, asked.sliding)
        told = replace(scene, draw=None)
        if scene.draw is not None:
            yield told  # numbers need not wait for their picture
            film = None if scene.film is None else record_of({_described(scene): scene.film},
                                                             even=True)
        yield Picture(told, film)
        if film is not None and asked.blocked:
            yield views.blocked(view, asked.sliding)

    return answer


def curve_answers() -> Answer:
    """Make a worker that follows curves, in its own process, with lower priority than pictures."""
    os.nice(_BEHIND)
    return followed


class Page:
    """Content of one page, with ``state`` as the browser's script has it."""

    def __init__(self, subject: Subject, start: FilmView, tolerances: Tolerances | None = None
                 ) -> None:
        self.subject, self._first, self._tolerances = subject, start, tolerances
        self.start = self.base = start
        self.view = start
        self.state: dict[str, Any] = {}
        #: Parts of the state that each browser has not received, and an event when there are any.
        self._browsers: list[tuple[set[str], asyncio.Event]] = []
        self.controls: tuple[Control, ...] = controls(start)
        self._number = 0
        self.scene: Scene | None = None
        self.blocked: Blocked | None = None
        self.curve: FollowedCurve | None = None
        self.bands: Bands | None = None
        self._written: tuple[Specimen, str] | None = None
        self._resting: asyncio.TimerHandle | None = None
        self._asked: FilmView | None = None
        self._scenes = Latest(scene_answers, self._solved, _PATIENCE)
        self._curves = Latest(curve_answers, self._followed, 0.0)
        #: Reduced films about a view, which answer once they are made.
        self._near: tuple[Neighbours, Latest] | None = None
        self._begin(0)

    def close(self) -> None:
        """End the page's processes."""
        if self._resting is not None:
            self._resting.cancel()
        self._scenes.close()
        self._curves.close()
        if self._near is not None:
            self._near[1].close()

    def tell(self, **parts: Any) -> None:
        """Change parts of the state."""
        self.state |= parts
        for untold, news in self._browsers:
            untold.update(parts)
            news.set()

    async def news(self) -> AsyncGenerator[str, None]:
        """Yield the state as JSON, and then its changes, for one browser."""
        untold, news = set(self.state), asyncio.Event()
        news.set()
        self._browsers.append((untold, news))
        try:
            while True:
                await news.wait()
                news.clear()
                parts = {name: self.state[name] for name in untold}
                untold.clear()
                yield json.dumps(parts, allow_nan=False)
        finally:
            self._browsers.remove((untold, news))

    def hear(self, name: str, *words: Any) -> None:
        """Handle a message of :data:`tympan.explore.talk.SAID` from a browser."""
        getattr(self, f"_{name}")(*words)

    def _begin(self, number: int) -> None:
        """Show a specimen as it was read."""
        self._number = number
        masses = self.subject.masses(number)
        mass = None if masses else self._first.mass
        self.start = self.subject.view(number, mass) if number else self._first
        self.tell(title=self.subject.name, chosen=number, written="", folder=str(Path.cwd()),
                  film=None, curve="", by="", quick=False, guessed=True, loads="", scatter="",
                  numbers=[], limits=[], following=False,
                  names=[specimen.name for specimen in self.subject.specimens],
                  masses=[f"{mass * 1e3:.6g} g" for mass in masses])
        self._say("")
        self.scene = self.blocked = self.curve = self.bands = self._asked = None
        # A shape chosen again returns with its own numbers.
        self._outlines = {part: examples() | {shape_of(self.start, part): outline_of(
            self.start, part)} for part in SHAPED}
        self._show(self.start)

    def _show(self, view: FilmView) -> None:
        """Put a view on the controls and solve it."""
        self.view = self.base = view
        self._list_controls()
        self.tell(errors={}, shapes=[
            {"key": part, "label": part.partition(".")[0], "shapes": list(self._outlines[part]),
             "chosen": shape_of(view, part)} for part in SHAPED], drawn=_drawn_outlines(view),
                  sliders={control.key: control.position(view) for control in self.controls})
        self._change()

    def _list_controls(self) -> None:
        self.controls = controls(self.base, self._reach())
        self.tell(controls=[asdict(control) | {"unit": control.unit} for control in self.controls])

    def _reach(self) -> float:
        """Choose the end of the slider of voltage [V]."""
        end = self._end
        return max(_USUAL if end is None else _BEYOND * end.voltage_V, self.start.voltage)

    @property
    def _end(self) -> Limit | None:
        """Limit beyond which the film of the view has no equilibrium, if known."""
        if self.curve is None or not _same_film(self.curve.view, self.view):
            return None
        return self.curve.curve.curves[0].limits.end

    def _slid(self, key: str, text: str) -> None:
        """Handle a moved slider; it is where it is."""
        if control := self._taken(key, text):
            self.state["sliders"][key] = control.position(self.view)
            if control.dimension == "voltage" and len(self.view.specimen.electrode.segments):
                self._voltages_follow()

    def _typed(self, key: str, text: str) -> None:
        """Handle a typed number; the slider follows."""
        if control := self._taken(key, text):
            self.tell(sliders=self.state["sliders"] | {key: control.position(self.view)})
            if control.dimension == "voltage":
                self._voltages_follow()

    def _voltages_follow(self) -> None:
        """Move the sliders of other voltages: that of the film is the highest of its segments."""
        self.tell(sliders=self.state["sliders"] | {
            control.key: control.position(self.view) for control in self.controls
            if control.dimension == "voltage"})

    def _shape(self, part: str, shape: str) -> None:
        """Handle another shape of frame or plate; its sliders are centred on the new size."""
        template = self._outlines.get(part, {}).get(shape)
        if template is None:
            return
        self._outlines[part][shape_of(self.view, part)] = outline_of(self.view, part)
        try:
            view = with_shape(self.view, part, template)
        except InputError as error:
            self._show(self.view)
            self.tell(errors={part: f"{error.key}: {error.allowed}"})
            return
        self._show(view)

    def _taken(self, key: str, text: str) -> Control | None:
        """Give a control a value and return it, None if the value is wrong.

        The error is shown beside the control. A control of the specimen that was shown before no
        longer exists.
        """
        control = next((control for control in self.controls if control.key == key), None)
        if control is None:
            return None
        errors = {name: words for name, words in self.state["errors"].items() if name != key}
        try:
            self.view = changed(self.view, key, control.parsed(text))
        except InputError as error:
            other = "" if error.key in (key, f"--{key}", None) else f"{error.key}: "
            self.tell(errors=errors | {key: f"{other}{error.allowed}"})
            return None
        self.tell(errors=errors)
        self._change()
        return control

    def _change(self) -> None:
        """Solve the view; everything but the picture waits until the controls rest."""
        self.tell(texts={control.key: control.text(self.view) for control in self.controls},
                  following=not self._is_followed)
        self._solve()
        if self._resting is not None:
            self._resting.cancel()
        self._resting = asyncio.get_running_loop().call_later(_REST, self._rest)

    @property
    def _is_followed(self) -> bool:
        """Whether the curve is that of the view's film."""
        return self.curve is not None and _same_film(self.curve.view, self.view)

    def _solve(self) -> None:
        if self._is_beyond:
            self._beyond()
            return
        near = self._is_near
        if near and self._near is not None:
            self._near[1].ask(self.view)
        self._scenes.ask(Asked(self.view, not (near and self.state["quick"]), sliding=True))
        self._others_wait(True)

    @property
    def _is_near(self) -> bool:
        """Whether the view is one of the reduced films, made or in preparation."""
        return self._near is not None and self._near[0].row(self.view) is not None

    @property
    def _is_beyond(self) -> bool:
        """Whether the view's film is known to end below its voltage."""
        end = self._end
        return end is not None and self.view.voltage > end.voltage_V

    def _beyond(self) -> None:
        """Show that the voltage is past the film's end, in place of a picture."""
        assert self.curve is not None
        self._scenes.drop()
        self._others_wait(False)
        self._say(f"{self.view.voltage / 1e3:.4g} kV is past the film's end: "
                  f"{self.curve.curve.curves[0].limits.ended}. {self._kept}", trouble=True)

    @property
    def _kept(self) -> str:
        return "" if self.scene is None else f"Shown is the last film, {loads_of(self.scene)}."

    def _say(self, words: str, trouble: bool = False) -> None:
        self.tell(message=words, trouble=trouble, busy=self._scenes.busy)

    def _others_wait(self, waits: bool) -> None:
        """Let slower processes wait while a picture is computed: they would slow it down."""
        for other in (self._curves, *(() if self._near is None else (self._near[1],))):
            other.wait(waits)

    def _solved(self, part: Scene | Picture | Blocked | Trouble, newest: bool) -> None:
        if isinstance(part, Scene):
            self.scene = part
            self.tell(loads=loads_of(part), guessed=part.guessed)
            self._list_numbers()
            return
        if newest:
            self._others_wait(False)
        if isinstance(part, Blocked):
            self.blocked = part
            self._list_numbers()
            return
        if isinstance(part, Trouble):
            if newest:
                self._say(f"{part.words}. {self._kept}", trouble=True)
            return
        scene = part.scene
        if part.film is None:
            if newest:
                words = ", ".join(scene.result.warnings[:1])
                self._say(f"At {loads_of(scene).removeprefix('at ')} there is no equilibrium: "
                          f"{words}. {self._kept}", trouble=True)
            return
        self.scene = scene
        self.tell(film=part.film, loads=loads_of(scene), busy=False, guessed=scene.guessed,
                  message="; ".join(scene.result.warnings), trouble=False)
        self._list_numbers()
        # If the reduced films are about to answer, their curve is drawn then.
        if self._near is None or not self._near[1].busy or self._is_followed:
            self._draw_curve()

    def _list_numbers(self) -> None:
        """List the numbers of the film shown; those still of another film are stale."""
        scene, blocked, curve = self.scene, self.blocked, self.curve
        if scene is None:
            return
        bands = self.bands
        numbers = bands.numbers if bands is not None and bands.view == scene.view else {}
        rows = result_rows(scene, numbers)
        if blocked is not None:
            rows += blocked_rows(blocked, blocked.view != scene.view)
        if curve is not None:
            rows += curve_rows(curve, scene.result.deflection_m or 0.0,
                               not _same_film(curve.view, scene.view), numbers.get("stroke_m"))
        self.tell(numbers=rows, scatter=_SCATTER if numbers else "")

    def _draw_curve(self) -> None:
        if self.curve is None:
            return
        here = None
        if self.scene is not None and _same_film(self.curve.view, self.scene.view):
            here = (self.scene.view.voltage / 1e3, 1e3 * (self.scene.result.deflection_m or 0.0))
        curve = self.curve
        if self.bands is not None and _same_film(curve.view, self.bands.view):
            curve = curve.banded(self.bands)
        self.tell(curve=drawn_curve(curve, here), limits=limit_rows(self.curve),
                  by="" if self.curve.off is None else _BY)

    def _rest(self) -> None:
        """Write the view's name and follow its curve, as the controls rest."""
        self._resting = None
        self.tell(busy=self._scenes.busy)
        self._name()
        self._refine()
        if self._is_quick:
            self._resting = asyncio.get_running_loop().call_later(_LATER, self._settle)
        else:
            self._settle()

    @property
    def _is_quick(self) -> bool:
        """Whether a reduced film shows the view, or is about to."""
        if self._near is None or not self.state["quick"] or not self._is_near:
            return False
        shown = self.curve is not None and self.curve.off is not None and self._is_followed
        said = self.blocked is not None and self.blocked.view == self.view
        return shown or said or self._near[1].busy

    @property
    def _is_guessed(self) -> bool:
        """Whether the view's film is not shown on its own mesh yet."""
        shown = self.scene is not None and self.scene.view == self.view and not self.scene.guessed
        return not shown and not self._is_beyond

    def _refine(self) -> None:
        """Show a film at rest on its own mesh."""
        if self._is_guessed and not self._scenes.busy:
            self._scenes.ask(Asked(self.view, not (self._is_near and self.state["quick"])))

    def _settle(self) -> None:
        """Let finite elements compute everything that they have not computed yet."""
        self._resting = None
        if self._is_guessed or (self._is_near and (self.blocked is None or self.blocked.off
                                       or self.blocked.view != self.view)):
            if self._scenes.busy:  # with the picture, which would be dropped
                self._resting = asyncio.get_running_loop().call_later(_LATER, self._settle)
                return
            self._scenes.ask(Asked(self.view))
        if self._asked is None or not _same_film(self._asked, self.view):
            self._asked = self.view
            near = self._is_near and bool(self.state["quick"])
            self._curves.ask(Question(self.view, self.subject.static,
                                      None if near else self._tolerances))

    def _followed(self, part: FollowedCurve | Bands | Trouble, newest: bool) -> None:
        if not newest:
            return
        if isinstance(part, Bands):
            self._put_bands(part)
            return
        if not isinstance(part, Trouble) and self._is_followed and not _same_film(
                part.view, self.view):
            self._asked = None  # the reduced films have continued meanwhile
            return
        if isinstance(part, Trouble):
            self.curve = None
            self.tell(curve="", by="", limits=[], following=False)
            self._list_numbers()
            if self.scene is None:
                self._say(part.words, trouble=True)
            return
        self._put(part)
        self._reached()
        if part.circles is not None and not self._is_near and not self._measured:
            self._reduce(part)

    def _put(self, curve: FollowedCurve) -> None:
        """Show a curve; keep the circles that are equivalent to its film."""
        if curve.circles is None and self.curve is not None and _same_circles(
                curve.view, self.curve.view):
            curve = replace(curve, circles=self.curve.circles)
        self.curve = curve
        self.tell(following=not self._is_followed)
        self._list_numbers()
        self._draw_curve()

    def _put_bands(self, bands: Bands) -> None:
        """Show the scatter of films; keep what was found for the same film or view."""
        known = self.bands
        if known is not None and not bands.numbers and known.view == bands.view:
            bands = replace(bands, numbers=known.numbers)
        if known is not None and not bands.voltages and _same_film(known.view, bands.view):
            bands = replace(bands, voltages=known.voltages, deflections=known.deflections)
        self.bands = bands
        self._list_numbers()
        self._draw_curve()

    @property
    def _measured(self) -> bool:
        """Whether there are readings of the specimen, which are compared with finite elements."""
        return bool(self.subject.masses(self._number))

    def _reduce(self, curve: FollowedCurve) -> None:
        """Make reduced films about a film that was followed."""
        end = float(curve.curve.table["voltage"].max(initial=0.0))
        films = Neighbours.of(curve.view, end, self._tolerances) if end else None
        if films is None:
            return
        if self._near is not None:
            self._near[1].close()
        self._near = films, Latest(partial(quick_answers, films), self._quickened, None)
        self.tell(quick=False)
        self._near[1].ask(self.view)

    def _quickened(self, part: QuickCurve | Bands | Trouble, newest: bool) -> None:
        """Handle an answer of the reduced films."""
        self.tell(quick=not isinstance(part, Trouble))
        if isinstance(part, Bands):
            if newest:
                self._put_bands(part)
            return
        if isinstance(part, Trouble):
            return
        if part.blocked is not None and (self.blocked is None or self.blocked.off
                                         or self.blocked.view != part.view):
            self.blocked = part.blocked
            self._list_numbers()
        shown = self.curve
        if part.curve is None or (shown is not None and shown.off is None
                                  and _same_film(shown.view, part.view)):
            return
        if not self._curves.busy:
            self._asked = None
        self._put(part.curve)

    def _reached(self) -> None:
        """Move the slider's end to the film's end, now known, and search no voltage beyond it.

        The page decides where the sliders stand: one may be moving.
        """
        self._list_controls()
        if self._is_beyond:
            self._beyond()

    def _choose(self, number: int) -> None:
        if 0 <= number < len(self.subject.specimens):
            self._begin(number)

    def _reset(self) -> None:
        self._show(self.start)

    def _name(self) -> None:
        """Choose a free name to save the view under; write its script and command."""
        target = _free(self.view.specimen.name)
        file = self._file or f"{target}.toml"
        self.tell(target=target, command=command_of(self.view, file, self._rig_file(file)),
                  python=python_of(self.view, self._file if _drawn_outlines(self.view) else ""),
                  unsaved="" if self._file else f"The command reads {file}: save the film first.")

    def _rig_file(self, file: str) -> str:
        """Name the file of the rig beside that of a specimen; "" for an ideal rig."""
        ideal = self.view.rig == Rig()
        return self.subject.rig_file or (
            "" if ideal else str(Path(file).with_name(f"rig-of-{Path(file).name}")))

    @property
    def _file(self) -> str:
        """File that holds the actuator as it is, if any."""
        actuator = self.view.actuator
        if self._written is not None and self._written[0] == actuator:
            return self._written[1]
        there = self._number < len(self.subject.files)
        same = there and actuator == self.subject.specimens[self._number]
        return self.subject.files[self._number] if same else ""

    def _save(self, name: str, folder: str) -> None:
        """Write the actuator, and the rig if it has no file; never over another file."""
        try:
            named = as_read(replace(self.view.actuator, name=name))
            place = Path(folder).expanduser()
            if not place.is_dir():
                raise InputError("is no folder", key="folder", given=folder)
            file = f"{name}.toml" if place.samefile(Path.cwd()) else str(place / f"{name}.toml")
            rig = self._rig_file(file)
            texts = {file: f"# {stiffness_remark(self.view)}\n" * bool(stiffness_remark(self.view))
                     + specimen_to_toml(named)}
            if rig and not self.subject.rig_file:
                texts[rig] = rig_to_toml(self.view.rig)
            if taken := [path for path in texts if Path(path).exists()]:
                raise InputError("is there already: choose another name", given=taken[0])
            for path, text in texts.items():
                write_text(Path(path), text)
        except (InputError, OSError, ValueError, RuntimeError) as error:
            self.tell(written=f"Not saved: {error}")
            return
        self._written = self.view.actuator, file
        self.tell(written=f"Saved in {place.absolute()}: "
                          f"{', '.join(Path(path).name for path in texts)}")
        self._name()


def _free(name: str) -> str:
    """Find a name under which the current folder has no specimen yet."""
    names = chain([name], (f"{name}-{number}" for number in count(2)))
    return next(name for name in names if not Path(f"{name}.toml").exists())


def _same_film(view: FilmView, other: FilmView) -> bool:
    """Check whether two views differ only in voltage."""
    return replace(view, voltage=0.0) == replace(other, voltage=0.0)


def _same_circles(view: FilmView, other: FilmView) -> bool:
    """Check whether two views differ only in loads."""
    return _same_film(replace(view, mass=0.0), replace(other, mass=0.0))


def _drawn_outlines(view: FilmView) -> str:
    """Say which outlines have no controls, and where they are changed."""
    keys = [control.key for control in controls(view)]
    parts = [part for part, start in (("frame", "frame."), ("plate", "plate.outline."))
             if not any(key.startswith(start) for key in keys)]
    return (f"The outline of the {' and the '.join(parts)} is changed in its file." if parts
            else "")


def _described(scene: Scene) -> str:
    """Describe a film for people who cannot see it."""
    result = scene.result
    return (f"{result.specimen} {loads_of(scene)}, its plate sunk by "
            f"{1e3 * (result.deflection_m or 0.0):.3f} mm")
