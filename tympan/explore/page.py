"""One browser's page: what its controls say becomes a view, what is solved becomes a picture."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tympan.explore import picture
from tympan.explore.curve import drawn_curve
from tympan.explore.latest import Answer, Latest, Trouble
from tympan.explore.messages import TRIGGERS
from tympan.explore.numbers import limit_rows, loads_of, result_rows
from tympan.explore.session import (
    CircleWeights,
    FollowedCurve,
    Question,
    Scene,
    Session,
    followed,
)
from tympan.explore.subject import Subject
from tympan.explore.view import (
    Control,
    FilmView,
    changed,
    command_of,
    controls,
    python_of,
)
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.reports.colouring import COLOURINGS, css_gradient, usual_depth
from tympan.studies.case import Limit
from tympan.studies.files import write_text

#: How long a solve that nobody waits for any more may go on [s]; a curve is given up at once.
_PATIENCE = 0.7
#: How long the controls must rest before what takes longer follows them [s].
_REST = 0.15
#: How far the process of curves stands behind, as nice counts.
_BEHIND = 15

#: Where the slider of the voltage ends before the film's end is known [V].
_USUAL = 10e3
#: What a slider of the voltage goes to, over the voltage where the film ends.
_BEYOND = 1.15


def scene_answers() -> Answer:
    """What solves views, in its own process."""
    session = Session()
    return lambda view: iter([session.scene(view)])


def curve_answers() -> Answer:
    """What follows curves, in its own process, which lets pictures go first."""
    os.nice(_BEHIND)
    return followed


class Page:
    """The state of one browser's page; ``server`` is its own trame server."""

    def __init__(self, server: Any, subject: Subject, start: FilmView) -> None:
        self.server, self.subject, self._first = server, subject, start
        self.start = start
        self.view = start
        self.controls: tuple[Control, ...] = controls(start)
        self._number = 0
        self.scene: Scene | None = None
        self.curve: FollowedCurve | None = None
        self.weights: CircleWeights | None = None
        self._written: tuple[Specimen, str] | None = None
        self._resting: asyncio.TimerHandle | None = None
        self._asked: FilmView | None = None
        self._scenes = Latest(scene_answers, self._solved, _PATIENCE)
        self._curves = Latest(curve_answers, self._followed, 0.0)
        self._listen()
        self._begin(0)

    def close(self) -> None:
        """End what works for it."""
        if self._resting is not None:
            self._resting.cancel()
        self._scenes.close()
        self._curves.close()

    def _listen(self) -> None:
        state, server = self.server.state, self.server
        for name in TRIGGERS:
            server.trigger(name)(getattr(self, f"_{name}"))
        state.change("colouring")(lambda **_: self._colour())
        state.change("depth")(lambda depth, **_: self._deepen(depth))

    def _begin(self, number: int) -> None:
        """Show a specimen as it was read."""
        self._number = number
        masses = self.subject.masses(number)
        mass = None if masses else self._first.mass
        self.start = self.subject.view(number, mass) if number else self._first
        with self.server.state as state:
            state.update({
                "title": self.subject.name, "chosen": number,
                "errors": {}, "typing": {}, "written": "",
                "names": [specimen.name for specimen in self.subject.specimens],
                "masses": [f"{mass * 1e3:.6g} g" for mass in masses],
                "colourings": [{"key": key, "label": quantity.label}
                               for key, quantity in COLOURINGS.items()],
                "colouring": "stress", "gradient": css_gradient(), "busy": False,
                "message": "", "trouble": False, "following": False, "limits": [], "numbers": [],
                "loads": "", "curve": "", "depth": 1, "actor": {"scale": [1, 1, 1]},
                "scale": {"words": "", "ticks": []}, "colour_range": [0, 1], "film_field": None,
                "described": "", "python": "", "command": "", "target": "", **picture.LOOK_OF,
                **dict.fromkeys(("film_points", "film_polys", "plate_points", "plate_polys",
                                 "edge_points", "edge_lines", "hatch_points", "hatch_lines"))})
        self.scene = self.curve = self.weights = self._asked = None
        self._show(self.start)

    def _show(self, view: FilmView) -> None:
        """Put a view on the controls and have it solved."""
        self.view = view
        with self.server.state as state:
            state.errors = {}
            state.drawn = _drawn_outlines(view)
            self._list_controls(state)
            state.sliders = {control.key: control.position(view) for control in self.controls}
        self._change()

    def _list_controls(self, state: Any) -> None:
        self.controls = controls(self.start, self._reach())
        state.controls = [{"key": control.key, "label": control.label, "unit": control.unit,
                           "low": control.low, "high": control.high, "step": control.step}
                          for control in self.controls]

    def _reach(self) -> float:
        """Where the slider of the voltage ends [V]."""
        end = self._end
        return max(_USUAL if end is None else _BEYOND * end.voltage_V, self.start.voltage)

    @property
    def _end(self) -> Limit | None:
        """Beyond what the film of the view has no equilibrium, where that is known."""
        if self.curve is None or not _same_film(self.curve.view, self.view):
            return None
        return self.curve.curve.curves[0].limits.end

    def _slid(self, key: str, text: str) -> None:
        """A slider was moved; it is where it is."""
        self._take(key, text)

    def _typed(self, key: str, text: str) -> None:
        """A number was typed; the slider follows."""
        control = self._control(key)
        if control is not None and self._take(key, text):
            with self.server.state as state:
                state.sliders = {**state.sliders, key: control.position(self.view)}

    def _control(self, key: str) -> Control | None:
        return next((control for control in self.controls if control.key == key), None)

    def _take(self, key: str, text: str) -> bool:
        """A value that a control was given, or what is wrong with it beside the control.

        A control of the specimen that was shown before is none any more.
        """
        control = self._control(key)
        if control is None:
            return False
        with self.server.state as state:
            try:
                self.view = changed(self.view, key, control.parsed(text))
            except InputError as error:
                other = "" if error.key in (key, f"--{key}", None) else f"{error.key}: "
                state.errors = {**state.errors, key: f"{other}{error.allowed}"}
                return False
            state.errors = {name: words for name, words in state.errors.items() if name != key}
        self._change()
        return True

    def _change(self) -> None:
        """Solve the view; what is not of the picture can wait until the controls rest."""
        with self.server.state as state:
            state.texts = {control.key: control.text(self.view) for control in self.controls}
        self._solve()
        if self._resting is not None:
            self._resting.cancel()
        self._resting = asyncio.get_running_loop().call_later(_REST, self._rest)

    def _solve(self) -> None:
        end = self._end
        if end is not None and self.view.voltage > end.voltage_V:
            self._scenes.drop()
            self._beyond(end)
            return
        self._scenes.ask(self.view)

    def _beyond(self, end: Limit) -> None:
        assert self.curve is not None
        self._say(f"{self.view.voltage / 1e3:.4g} kV is past the film's end: "
                  f"{self.curve.curve.curves[0].limits.ended}. {self._kept}", trouble=True)

    @property
    def _kept(self) -> str:
        return "" if self.scene is None else f"Shown is the last film, {loads_of(self.scene)}."

    def _say(self, words: str, trouble: bool = False) -> None:
        with self.server.state as state:
            state.message, state.trouble, state.busy = words, trouble, self._scenes.busy

    def _solved(self, scene: Scene | Trouble, newest: bool) -> None:
        if isinstance(scene, Trouble):
            if newest:
                self._say(f"{scene.words}. {self._kept}", trouble=True)
            return
        if scene.film is None:
            if newest:
                words = ", ".join(scene.result.warnings[:1])
                self._say(f"At {loads_of(scene).removeprefix('at ')} there is no equilibrium: "
                          f"{words}. {self._kept}", trouble=True)
            return
        first = self.scene is None
        self.scene = scene
        self._draw(scene, first)

    def _draw(self, scene: Scene, first: bool) -> None:
        with self.server.state as state:
            if first:
                state.depth = depth = usual_depth(float(np.abs(scene.plate[:, 2]).max()),
                                                  float(np.abs(scene.frame[:, :2]).max()))
                state.actor = {"scale": [1, 1, depth]}
            state.update(picture.film_state(scene))
            state.update(picture.colour_state(scene, state.colouring))
            state.loads, state.numbers = loads_of(scene), result_rows(scene)
            state.described = _described(scene)
            state.message, state.trouble = "; ".join(scene.result.warnings), False
            state.busy = False
            self._draw_curve(state)
        if first:
            self._look("oblique")

    def _draw_curve(self, state: Any) -> None:
        if self.curve is None:
            return
        here = None
        if self.scene is not None and _same_film(self.curve.view, self.scene.view):
            here = (self.scene.view.voltage / 1e3, 1e3 * (self.scene.result.deflection_m or 0.0))
        state.curve = drawn_curve(self.curve, here)
        state.limits = limit_rows(self.curve, self.weights)

    def _rest(self) -> None:
        """The controls rest: say how the view is written, and follow its curve."""
        self._resting = None
        follow = self._asked is None or not _same_film(self._asked, self.view)
        with self.server.state as state:
            state.busy, state.python = self._scenes.busy, python_of(self.view)
            state.following = state.following or follow
            self._name(state)
        if follow:
            self._asked = self.view
            self._curves.ask(Question(self.view, self.subject.static))

    def _followed(self, part: FollowedCurve | CircleWeights | Trouble, newest: bool) -> None:
        if not newest:
            return
        if isinstance(part, Trouble):
            with self.server.state as state:
                state.following, state.limits = False, []
            if self.scene is None:
                self._say(part.words, trouble=True)
            return
        if isinstance(part, CircleWeights):
            self.weights = part
        else:
            self.curve, self.weights = part, None
            self._reached()
        with self.server.state as state:
            state.following = False
            self._draw_curve(state)

    def _reached(self) -> None:
        """The film's end is known: its slider goes there, and what is beyond is not searched.

        Where the sliders stand is the page's to say: one may be moving.
        """
        with self.server.state as state:
            self._list_controls(state)
        end = self._end
        if end is not None and self.view.voltage > end.voltage_V:
            self._scenes.drop()
            self._beyond(end)

    def _colour(self) -> None:
        if self.scene is not None:
            self.server.state.update(picture.colour_state(self.scene, self.server.state.colouring))

    def _deepen(self, depth: Any) -> None:
        self.server.state.actor = {"scale": [1, 1, float(depth)]}

    def _look(self, name: str) -> None:
        if self.scene is not None:
            self.server.js_call("view", "setCamera", picture.camera(self.scene, name))

    def _choose(self, number: int) -> None:
        if 0 <= number < len(self.subject.specimens):
            self._begin(number)

    def _reset(self) -> None:
        self._show(self.start)

    def _name(self, state: Any) -> None:
        """What the file of the view is, or would be; and the command with it."""
        state.target = _free(self.view.specimen.name)
        file = self._file or state.target
        rig = self.subject.rig_file or ("" if self.view.rig == Rig() else f"rig-of-{file}")
        state.command = command_of(self.view, file, rig)

    @property
    def _file(self) -> str:
        """The file that holds the actuator as it is, if any."""
        actuator = self.view.actuator
        if self._written is not None and self._written[0] == actuator:
            return self._written[1]
        there = self._number < len(self.subject.files)
        same = there and actuator == self.subject.specimens[self._number]
        return self.subject.files[self._number] if same else ""

    def _write(self) -> None:
        """Write the actuator, and the rig where it is in no file, to the current folder."""
        file = _free(self.view.specimen.name)
        with self.server.state as state:
            try:
                write_text(Path(file), specimen_to_toml(self.view.actuator))
                words = file
                if self.view.rig != Rig() and not self.subject.rig_file:
                    write_text(Path(f"rig-of-{file}"), rig_to_toml(self.view.rig))
                    words += f", rig-of-{file}"
            except (InputError, OSError) as error:
                state.written = str(error)
                return
            self._written = self.view.actuator, file
            state.written = f"written to {Path.cwd()}: {words}"
            self._name(state)

    def _named(self) -> None:
        """The command is copied: its file must be there."""
        if not self._file:
            self._write()


def _free(name: str) -> str:
    """A file of the current folder that is not there yet."""
    names: Iterator[str] = (f"{name}{end}.toml" for end in
                            ("", *(f"-{number}" for number in range(2, 10_000))))
    return next(file for file in names if not Path(file).exists())


def _same_film(view: FilmView, other: FilmView) -> bool:
    """Whether two views differ in voltage alone."""
    return replace(view, voltage=0.0) == replace(other, voltage=0.0)


def _drawn_outlines(view: FilmView) -> str:
    """Which outlines have no controls, and where they are changed."""
    keys = [control.key for control in controls(view)]
    parts = [part for part, start in (("frame", "frame."), ("plate", "plate.outline."))
             if not any(key.startswith(start) for key in keys)]
    return (f"The outline of the {' and the '.join(parts)} is changed in its file." if parts
            else "")


def _described(scene: Scene) -> str:
    result = scene.result
    return (f"The film of {result.specimen} {loads_of(scene)}, in three dimensions: its plate has "
            f"sunk by {1e3 * (result.deflection_m or 0.0):.3f} mm")
