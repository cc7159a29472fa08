"""One name for one thing: the words of commands, of Python's functions and of files.

Every option of a command and every argument of a function is one of :data:`WORDS`, with the same
meaning wherever it stands. The page ``docs/grammar.md`` is made from them, and the list of
arguments in the docstring of each function.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import wraps
from inspect import Parameter, cleandoc, get_annotations, signature, unwrap
from typing import Any, TypeVar, cast

from tympan.base.fields import names_arguments

F = TypeVar("F", bound=Callable[..., Any])

#: Default of a word that each question chooses for itself.
BY_QUESTION: Any = object()
#: Loads, and what holds the film, in the order in which they stand after the subject.
LOADS = ("mass", "voltage", "pressure", "rig")


@dataclass(frozen=True)
class Word:
    """Meaning of a name, and its ``default``; a question may also choose it by itself (None).

    ``unit``: of an SI number.
    """

    meaning: str
    unit: str = ""
    default: Any = BY_QUESTION


#: Subjects: what a command or a function is about, given first and without a name.
SUBJECTS = {
    "specimen": Word("the film in its frame: a file, or a `Specimen`"),
    "specimens": Word("several of them"),
    "models": Word("specimens, or lumped models of `lumped build`"),
    "model": Word("a lumped model: a file NAME.lumped.toml, or one of `lumped.build`"),
    "dataset": Word("a folder of measurements with its dataset.toml"),
    "coupons": Word("files of coupon tests, or one dataset"),
    "files": Word("files of coupon tests, or one dataset"),
    "file": Word("the file of a sweep, a study, or a table of measurements"),
    "requirements": Word("a file that says what is wanted, given and free"),
    "material": Word("a material of the library, or of a specimen's file"),
    "name": Word("of a material; in a file, of what it describes"),
    "folder": Word("where results are, or go"),
    "subject": Word("a specimen, a dataset, or a folder of specimens"),
    "first": Word("a result, its folder, or its file there"),
    "second": Word("the one that is compared with it, of the same kind"),
    "target": Word("axes or a file to draw on, or the file to write"),
}
#: All other words.
WORDS = SUBJECTS | {
    "mass": Word("all that hangs on the film: plate, hook and weight", "kg"),
    "voltage": Word("across the film, before an amplifier's gain", "V"),
    "pressure": Word("of the gas below the film; positive lifts it", "Pa"),
    "rig": Word("what else acts on film and plate: a file; in Python also its keys, or a `Rig`"),
    "elapsed": Word("time since the run began, for a rig that drifts", "s", "0 s"),
    "direction": Word("way on which the voltage was reached: up or down", default=""),
    "tolerances": Word("scatter between films: a file, or a `Tolerances`"),
    "settings": Word("mesh, path, and the film's formula", default=None),
    "refine": Word("divides every element size", default=1.0),
    "formula": Word("a film in closed form in place of finite elements", default=None),
    "output": Word("folder for files and pictures"),
    "json": Word("print one JSON object", default=False),
    "workers": Word("processes; in Python 1, since more need a main guard"),
    "seed": Word("of random numbers", default=0),
    "from": Word("first deflection of the plate", "m", "0 mm"),
    "to": Word("last deflection of the plate", "m", None),
    "points": Word("rows of a table over the deflection"),
    "sensing": Word("segments whose capacitances give deflection and tilts", default=()),
    "tilt": Word("tilt of the plate: the largest one along x and y that is sensed, or the radius "
                 "of the circle that its normal draws", "rad"),
    "count": Word("number of what the question lists: modes, levels, voltages"),
    "films": Word("number of random films"),
    "cycles": Word("loops of the plate", default=1),
    "rate": Word("speed of the plate, or of the voltage, in time", "m/s or V/s", None),
    "turn": Word("voltage at which a loop turns", "V", None),
    "along": Word("load that grows: voltage, charge, mass or pressure", default="voltage"),
    "beyond": Word("follow the film to where no real one gets", default=False),
    "fields": Word("store the film of every state", default=False),
    "states": Word("compute all variables of a state at each sample", default=False),
    "at": Word("times at which the film is stored", "s", None),
    "after": Word("time since the voltage was switched on", "s", None),
    "rest": Word("time at rest before a signal", "s", None),
    "frequency": Word("of a small sine, or turns of a circle a second", "Hz"),
    "sine": Word("how much of a small oscillation each segment of the electrode has, such as "
                 '"A = 1, B = -1"', default=None),
    "of": Word("quantities whose derivatives are wanted", default="heave"),
    "point_mass": Word("part of the mass in the plate's centre", "kg", "0 g"),
    "swing": Word("the plate has inertia", default=False),
    "signal": Word("step, ramp, sine, random, or a CSV file", default="step"),
    "low": Word("voltage before a step; lower end of other signals", "V", "0 kV"),
    "high": Word("voltage after a step; upper end of other signals", "V", "3.5 kV"),
    "duration": Word("of step and ramp, a random level, a period", "s", "30 s"),
    "interval": Word("between samples", "s"),
    "animate": Word("draw a moving picture", default=False),
    "circles": Word("number of circles of a lumped model", default=2),
    "radii": Word("which circles: semi_axes, sectors or fit", default="semi_axes"),
    "uncertainty": Word("how α changes with mesh, material and loads", default=False),
    "alpha_settings": Word("loads on which α is fitted", default=None),
    "basis": Word("formerly the kind of circles; both are printed", default="membrane"),
    "viscous": Word("constants of films without viscous branches", default=None),
    "exact": Word("solve all by finite elements", default=False),
    "scheduler": Word("address of a Dask cluster", default=None),
    "wait": Word("for a worker of the cluster", "s", "60 s"),
    "best": Word("result whose largest values are listed", default=None),
    "under": Word('conditions that these results keep, such as "max_true_stress < 131 kPa"',
                  default=None),
    "inp": Word("write input of CalculiX or Abaqus instead", default=False),
    "width": Word("of frame and clamp ring around the film", "m", "10 mm"),
    "frame_height": Word("of the frame", "m", "4 mm"),
    "clamp_height": Word("of the clamp ring", "m", "2 mm"),
    "plate_height": Word("of the plate", "m", "2 mm"),
    "screw": Word("diameter of the holes", "m", "3.2 mm"),
    "spacing": Word("of the holes along the frame, at most", "m", "40 mm"),
    "held": Word("stretch across, for a table of stresses", default=None),
    "markdown": Word("print a page of these docs", default=False),
    "draft": Word("write a first dataset.toml for a table", default=None),
    "kind": Word("what a table of measurements is", default=None),
    "plan": Word("say what such readings can show", default=False),
    "self_check": Word("number of synthetic sets whose verdicts are counted", default=0),
    "law": Word("laws to fit or to compare"),
    "constants": Word("constants of the law that are fitted one by one", default=None),
    "branches": Word("number of viscous branches", default=None),
    "noise": Word("standard deviation of one reading: a deflection, of coupons a stress; "
                  "to sense by a capacitance, over it", default=None),
    "film": Word("a film: to solve with a fitted law, or one that can be bought", default=None),
    "mode": Word("mode of tests whose table does not say it", default=None),
    "unit": Word("of stresses whose heading has none", default=None),
    "area": Word("cross-section of a strip before the test", "m²", None),
    "length": Word("of a strip before the test", "m", None),
    "decimal": Word("decimal mark of a table's numbers", default=None),
    "input": Word("what drives a linear model: U or U2", default="U"),
    "save": Word("file for A, B, C, D", default=None),
    "supply": Word("highest voltage of the controller", "V"),
    "turns": Word("turns of a circle, after one in which it grows", default=2),
    "reference": Word("CSV file of a path to follow", default=None),
    "method": Word("kind of controller, pi or lqg; of a sweep, the way of drawing samples"),
    "sensor": Word("what the controller reads", default="deflection"),
    "sensor_lag": Word("time by which the sensor lags", "s", None),
    "fmu": Word("write an FMU 2.0", default=False),
    "slow_fast": Word("write two transfer functions", default=False),
    "paper": Word("the source paper's cones in place of membrane circles", default=False),
    "alpha": Word("weights of circles, or how they are identified", default=None),
    "table_1": Word("relative permittivity with the paper's constants", default=None),
    "dynamic": Word("also identify the viscous constants", default=False),
    "weights": Word("both α of all shapes, of the paper's cones", default=None),
    "objective": Word("misfit that is made small", default="deflection"),
    "limits": Word("compute profiles for the 95 % limits", default=True),
    "no_limits": Word("linearised limits only", default=False),
    "nelder_mead": Word("also fit by the simplex", default=False),
    "levels": Word("number of the paper's random voltages", default=20),
    "reading": Word("how the paper's ranges are read", default=None),
    "period": Word("of the paper's sines", "s", None),
    "host": Word("address to listen on", default="127.0.0.1"),
    "port": Word("to listen on", default=0),
    "no_browser": Word("print the address only", default=False),
} | {
    # keys of files that ask
    "want": Word("bounds that films should keep, such as "
                 '"stroke = 2 mm, deflection = at most 6 mm"', default=""),
    "bounds": Word("further ones, of a quantity that is to be largest or least"),
    "vary": Word("lowest and highest value of each number that may vary"),
    "share": Word("of the films that must keep all bounds", default=0.95),
    "front": Word("two quantities between whose best films others are sought"),
    "grid": Word("values of keys, of which all combinations are solved"),
    "list": Word("values of keys, row by row"),
    "sample": Word("points drawn in ranges of keys"),
    "ranges": Word("lowest and highest value of each key of a sample"),
    "ask": Word("what a sweep also computes of each film: limits, modes and others"),
    "figures": Word("keep what a picture of each film needs", default=False),
    "curves": Word("loads of the curves of a study"),
    "alpha_fit": Word("loads on which a study fits α"),
    "alpha_held_out": Word("loads on which a study tests α"),
    "source": Word("where the data are from"),
    "voltage_noise": Word("standard deviation of the voltage of each state that was read", "V"),
    "film_scatter": Word("share by which the films of a dataset differ from each other"),
    "strip_scatter": Word("share of the stress by which strips of one film differ"),
    "effort": Word("time that each kind of measurement costs", "s"),
    "field_frame": Word("origin of places in field.csv: table or plate", default="table"),
    "coupon_reading": Word("what is judged of coupons: stress, or its drop under voltage",
                           default="stress"),
    "columns": Word("how a table of readings is laid out"),
}

#: Where the list of arguments stands in a docstring: before these sections, or at its end.
_SECTIONS = re.compile(r"\n\n(?=(?:Raises|Examples)\n-)")


def public(more: Any = None, **formerly: Any) -> Callable[[F], F]:
    """Make a public function: it names wrong arguments, and its docstring lists all of them.

    Arguments are those of :func:`~tympan.base.fields.names_arguments`.
    """
    def listed(function: F) -> F:
        made: Any = names_arguments(more, **formerly)(_with_segments(function))
        text = cleandoc(made.__doc__ or "")
        told = dict(_arguments(function, get_annotations(more) if more else {}))
        shown = [name for name in signature(made).parameters if name in told]
        lines = "\n".join(told[name] for name in dict.fromkeys((*shown, *told)))
        if lines:
            head, *rest = _SECTIONS.split(text, maxsplit=1)
            made.__doc__ = "\n\n".join([head, f"Parameters\n----------\n{lines}", *rest])
        return cast(F, made)

    return listed


#: Arguments and options whose voltages may be given by the names of an electrode's segments.
BY_SEGMENT = frozenset({"voltage", "high", "supply"})

#: Mark of a function that takes voltages by the names of segments itself.
_COMBINES = "combines_voltages"


def combining(function: F) -> F:
    """Mark a function on specimens that takes several proportions of its segments' voltages."""
    setattr(function, _COMBINES, True)
    return function


def _with_segments(function: F) -> F:
    """Let a function on specimens take voltages by the names of an electrode's segments."""
    if hasattr(function, _COMBINES):
        return function
    kinds = [item.kind for item in signature(function).parameters.values()]
    # Behind one specimen other arguments may follow.
    most = None if Parameter.VAR_POSITIONAL in kinds else 1

    @wraps(function)
    def called(*subjects: Any, **named: Any) -> Any:
        for name in BY_SEGMENT:
            if isinstance(named.get(name), str | Mapping | list | tuple):
                from tympan.door import driven_together

                films, named = driven_together(subjects[:most], named, name)
                subjects = (*films, *subjects[len(films):])
        return function(*subjects, **named)

    return cast(F, called)


def _arguments(function: Callable[..., Any], passed: Any) -> Iterator[tuple[str, str]]:
    """Write each argument with its unit, its default and its meaning, by its name."""
    for item in signature(unwrap(function)).parameters.values():
        names = passed if item.kind is item.VAR_KEYWORD else (item.name,)
        for name in names:
            word = WORDS[name.rstrip("_")]
            default = item.default if item.kind is not item.VAR_KEYWORD else word.default
            known = not any(default is each for each in (Parameter.empty, BY_QUESTION, None, False,
                                                         (), ""))
            notes = [word.unit] * bool(word.unit) + [f"default {default!r}"] * known
            star = "*" * (item.kind is item.VAR_POSITIONAL)
            yield name, f"{star}{name}{' : ' * bool(notes)}{', '.join(notes)}\n    {word.meaning}"
