"""Options and outputs that commands share."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from tympan.base.errors import WORKS_STILL, InputError
from tympan.base.fields import numbers, only
from tympan.base.process.interruption import raise_again
from tympan.base.units import BENCH, quantity, suffix_of, unit_of

if TYPE_CHECKING:
    from tympan.fem.rig import Rig
    from tympan.geometry.specimen import Specimen
    from tympan.studies.case import Case, Settings
    from tympan.studies.driven import Voltages

#: Function that adds an argument, or several of which one may be given, to a command's parser.
Argument: TypeAlias = Callable[[argparse._ActionsContainer], object]
#: A file, and the function that draws moving pictures into it.
Moving: TypeAlias = tuple[Path, Callable[[Path], None]]


@dataclass(frozen=True)
class Command:
    """A command: its ``name``, the function it runs, its arguments and an example.

    ``name`` is one word, or two for a command of a group. ``example`` is what follows ``tympan``
    and the name in a valid line; ``also``: what people write instead of the name. Scripts may still
    use names that it had ``formerly``, which no list shows; then one line says the new name.
    """

    name: str
    run: Callable[[argparse.Namespace], None]
    arguments: tuple[Argument, ...]
    example: str
    also: tuple[str, ...] = ()
    formerly: tuple[str, ...] = ()

    @property
    def description(self) -> str:
        """Description of the command, in whole sentences."""
        return " ".join((self.run.__doc__ or "").split())

    @property
    def summary(self) -> str:
        """Summary of the command for a line of a list."""
        first = self.description.split(". ")[0].rstrip(".")
        return f"{first[:1].lower()}{first[1:]}"

    def begins(self, given: Sequence[str]) -> bool:
        """Check whether arguments begin with its name, or one that it had formerly."""
        group = self.name.split()[:-1]
        names = (self.name.split(), *([*group, name] for name in self.formerly))
        return any([*given[:len(name)]] == name for name in names)

    def add(self, commands: argparse._SubParsersAction[Any]) -> None:
        """Add its parser, with the function's docstring as help."""
        for name in (self.name.split()[-1], *self.formerly):
            parser = commands.add_parser(
                name, description=self.description, help=self.summary)
            parser.set_defaults(run=self._run_and_say if name in self.formerly else self.run,
                                command=self.name)
            for argument in self.arguments:
                argument(parser)
            on_rig = any("--rig" in action.option_strings for action in parser._actions)
            parser.epilog = " ".join(filter(None, (
                "Loads and rig: tympan help loads." if on_rig else "",
                f"Example: tympan {self.name} {self.example}".rstrip())))

    def _run_and_say(self, options: argparse.Namespace) -> None:
        print(f"tympan: this command is tympan {self.name} now", file=sys.stderr)
        self.run(options)


def command(name: str, *arguments: Argument, example: str, also: tuple[str, ...] = (),
            formerly: tuple[str, ...] = ()
            ) -> Callable[[Callable[[argparse.Namespace], None]], Command]:
    """Make a function a command with these arguments; its docstring is what ``--help`` shows."""
    return lambda run: Command(name, run, arguments, example, also, formerly)


def argument(*names: str, within: tuple[float, float] | None = None, formerly: str = "",
             **settings: Any) -> Argument:
    """Declare an argument as ``ArgumentParser.add_argument`` does; its help gives its default.

    A number must be ``within`` its limits, or an InputError names the option. Scripts may still use
    the name that the option had ``formerly``, which no help shows; then one line says the new name.
    """
    if within is not None:
        settings |= {"action": _Within, "limits": within}
    words = settings.get("help") or ""
    if "help" in settings and "%(" not in words:
        words = settings["help"] = words.replace("%", "%%")
    hidden = words == argparse.SUPPRESS
    if settings.get("default") not in (None, "", []) and "%(" not in words and not hidden:
        settings["help"] = f"{words} (default: %(default)s)".strip()
    if not formerly:
        return lambda parser: parser.add_argument(*names, **settings)

    def add(parser: argparse._ActionsContainer) -> None:
        kept = {key: value for key, value in settings.items()
                if key not in ("help", "default", "required")}
        option = parser.add_argument(*names, **settings)
        parser.add_argument(formerly, dest=option.dest, action=FormerOption, now=names[-1],
                            default=argparse.SUPPRESS, help=argparse.SUPPRESS, **kept)

    return add


class FormerOption(argparse.Action):
    """An option under a name that it had formerly; ``now`` is its name."""

    def __init__(self, *names: Any, now: str, **settings: Any) -> None:
        super().__init__(*names, **settings)
        self.now = now

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace,
                 value: Any, option: str | None = None) -> None:
        print(f"tympan: {option} is {self.now} now; the former name {WORKS_STILL}",
              file=sys.stderr)
        setattr(namespace, self.dest, value)


class _Within(argparse.Action):
    def __init__(self, *names: Any, limits: tuple[float, float], **settings: Any) -> None:
        super().__init__(*names, **settings)
        self.limits = limits

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace,
                 value: Any, option: str | None = None) -> None:
        low, high = self.limits
        if not low <= value <= high:
            raise InputError(f"must be from {low} to {high}", key=option, given=value)
        setattr(namespace, self.dest, value)


def either(*arguments: Argument) -> Argument:
    """Combine arguments of which only one may be given."""
    def add(parser: argparse._ActionsContainer) -> None:
        group = parser.add_mutually_exclusive_group()
        for choice in arguments:
            choice(group)

    return add


def together(*arguments: Argument) -> Argument:
    """Combine arguments that commands have together."""
    def add(parser: argparse._ActionsContainer) -> None:
        for each in arguments:
            each(parser)

    return add


def output(help_text: str | None = None, **settings: Any) -> Argument:
    """Declare the folder for results, ``options.output``."""
    return argument("-o", "--output", type=Path, metavar="DIR", help=help_text, **settings)


JSON = argument("--json", action="store_true", help="print one JSON object")
SPECIMEN = argument("specimen", type=Path, metavar="SPECIMEN.toml")
RIG = argument("--rig", type=Path, metavar="RIG.toml",
               help="gravity, springs, pressure, amplifier, sensor and what else acts (default: "
                    "the table [rig] of the specimen's file, else an ideal rig)")
PRESSURE = argument("--pressure", help='of the gas below the film, such as "200 Pa"; positive '
                                       "lifts film and plate against the weight (default: the "
                                       "rig's)")
FORMULA = argument("--formula", metavar="NAME",
                   help="film in closed form that a package registers, in place of finite elements")
#: Options of what computes the film, :func:`read_settings`.
MESH = together(argument("--refine", type=float, default=1.0, metavar="X", within=(0.5, 20),
                         help="divide every element size by X"), FORMULA)
#: Limits of the number of processes. More than any machine has would overload it.
PROCESSES = (1, 1024)
WORKERS = argument("--workers", type=int, metavar="N", within=PROCESSES,
                   help="processes on this machine (default: its processors)")
SEEDS = (0, 2**63 - 1)


def case_arguments(*, mass: str = "of plate, hook and weight",
                   voltage: str = "across the film") -> tuple[Argument, ...]:
    """Declare the options that :func:`read_case` and :func:`read_settings` read."""
    return (SPECIMEN, argument("--mass", help=f'{mass}, such as "17.9 g"; none of a film without '
                                              "plate"),
            argument("--voltage", default="0 kV", help=f'{voltage}, such as "3.5 kV", or "80 %" '
                                                         "of the first limit"), PRESSURE,
            RIG, MESH)


def read_workers(options: argparse.Namespace) -> int:
    """Count the requested processes, by default one for each processor."""
    return len(os.sched_getaffinity(0)) if options.workers is None else int(options.workers)


def read_settings(options: argparse.Namespace) -> Settings:
    """Read the settings of the options that :data:`MESH` adds."""
    from tympan.geometry.mesher import MeshSettings
    from tympan.studies.case import Settings

    with naming_options(options):
        return Settings(mesh=MeshSettings().refined(options.refine), formula=options.formula)


def read_case(options: argparse.Namespace) -> Case:
    """Read the case of the options that :func:`case_arguments` adds."""
    from tympan.studies.case import NO_MASS, Case
    from tympan.studies.limits import charged

    specimen, rig = read_mounted(options)
    if options.mass is None and specimen.plate is not None:
        raise InputError(NO_MASS, key="--mass")
    case = Case(specimen=specimen, mass=parse_quantity(options.mass or "0 g", "mass", "--mass"),
                rig=rig)
    share = options.voltage.strip().endswith("%")
    voltage = options.voltage if share else parse_quantity(options.voltage, "voltage", "--voltage")
    with naming_options(options):
        return charged(case, voltage, read_settings(options))


def read_mounted_all(options: argparse.Namespace, specimens: Sequence[Specimen] | None = None
                     ) -> tuple[tuple[Specimen, ...], Rig]:
    """Read specimens, whose names must differ, and the one rig that all are on.

    ``specimens``: those that have been read.
    """
    from tympan.fem.rig import mounted_together
    from tympan.geometry.specimen import require_different_names
    from tympan.studies.shipped import load_named

    if specimens is None:
        specimens = [load_named(file) for file in options.specimens]
    require_different_names(specimens)
    return mounted_together(_driven(specimens, options), _rig(options))


def read_mounted(options: argparse.Namespace, driven: bool = True) -> tuple[Specimen, Rig]:
    """Read a specimen and its rig, with the gas of :data:`PRESSURE` if the command has it.

    The rig of :data:`RIG` replaces that of the specimen's file. Unless it is ``driven``, voltages
    by the names of segments are left to the question.
    """
    from tympan.fem.rig import mounted
    from tympan.studies.shipped import load_named

    specimen, rig = mounted(load_named(options.specimen), _rig(options))
    if driven:
        (specimen,) = _driven((specimen,), options)
    given = getattr(options, "pressure", None)
    pressure = None if given is None else parse_quantity(given, "stress", "--pressure")
    with naming_options(options):
        return specimen, rig.pressed(pressure)


def _driven(specimens: Sequence[Specimen], options: argparse.Namespace) -> Sequence[Specimen]:
    """Set the shares of the segments that a voltage names, which becomes that of the film."""
    named = {name: value for name, value in vars(options).items()
             if isinstance(value, str) and "=" in value}
    if not named:
        return specimens
    from tympan.grammar import BY_SEGMENT
    from tympan.studies.driven import driven

    for name in BY_SEGMENT & named.keys():
        given = named[name]
        if not specimens:
            raise InputError("must be one voltage: the file of a lumped model keeps the proportion "
                             "of its segments' voltages", key=option_name(name), given=given)
        pairs = [driven(specimen, given, option_name(name)) for specimen in specimens]
        specimens, (voltage, *_) = zip(*pairs, strict=True)
        setattr(options, name, voltage if isinstance(voltage, str)
                else ", ".join(f"{each:.17g} V" for each in voltage))
    return specimens


def read_voltages(options: argparse.Namespace) -> Voltages:
    """Read the voltages of a question that takes several, of the film or of its segments."""
    from tympan.studies.driven import Voltages

    return Voltages.read(options.voltage or None, "--voltage")


def _rig(options: argparse.Namespace) -> Rig | None:
    from tympan.fem.rig import Rig

    return None if options.rig is None else Rig.read(options.rig)


def option_name(name: str) -> str:
    """Name the option of a setting."""
    return f"--{name.replace('_', '-')}"


@contextmanager
def naming_options(options: argparse.Namespace, **names: str) -> Iterator[None]:
    """Report errors in a setting under the option of its name, or under that in ``names``."""
    try:
        yield
    except InputError as error:
        name = names.get(str(error.key), str(error.key))
        if not hasattr(options, name):
            raise _in_its_file(error, options) from None
        given = getattr(options, name)
        raise InputError(error.allowed, key=option_name(name),
                         given=str(given) if isinstance(given, Path) else given) from None


def _in_its_file(error: InputError, options: argparse.Namespace) -> InputError:
    """Add to an error the file that contains its key: the rig's or the specimen's."""
    part, _, key = str(error.key).partition(".")
    if part == "rig" and key and not error.file:
        file = getattr(options, "rig", None)
        return InputError(error.allowed, file=file or getattr(options, "specimen", None),
                          key=key if file else f"rig.{key}", given=error.given)
    if part in ("membrane", "electrode"):
        given = getattr(options, "specimen", None) or getattr(options, "subject", None)
        return error.located(file=given)
    return error


@contextmanager
def naming_file(file: Path | None) -> Iterator[None]:
    """Add to errors the file or folder that they come from, unless they name their source."""
    try:
        yield
    except InputError as error:
        if str(error.key).startswith("--"):
            raise
        raise error.located(file=file) from None


def parse_quantity(text: str, dimension: str, option: str) -> float:
    """Read a quantity given to an option [SI]; of several masses or voltages the error says so."""
    if dimension in ("mass", "voltage"):
        only(text, option)
    try:
        value = quantity(text, dimension)
    except InputError as error:
        raise error.located(key=option) from None
    if not isfinite(value):
        raise InputError("must be finite", key=option, given=text)
    return value


def parse_quantities(text: str, dimension: str, option: str) -> tuple[float, ...]:
    """Read quantities and ranges given to an option [SI]; none if the text is empty."""
    return numbers(text, dimension, option)


def parse_numbers(text: str | None, option: str) -> tuple[float, ...] | None:
    """Read numbers given to an option, separated by commas; None where it was not given."""
    if text is None:
        return None
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError("must be numbers with a comma between them, such as 0.6,0.4", key=option,
                         given=text) from None


def save_and_draw(options: argparse.Namespace, result: Any, moving: Sequence[Moving] = ()
                  ) -> list[Path]:
    """Save and draw a result where a folder is given; return what a person looks at first.

    Files that are ``moving`` come last.
    """
    if options.output is None:
        return []
    from tympan.progress import waiting
    from tympan.reports.rebuild import draw_result
    from tympan.studies.files import replaced

    with waiting("files and pictures"), replaced(options.output, getattr(result, "pictures", ())):
        result.save(options.output)
        drawn = draw_result(result, options.output)
        for file, draw in moving:
            draw(file)
            drawn.append(file)
        return drawn


def finish(options: argparse.Namespace, result: Any, moving: Sequence[Moving] = (),
           text: Callable[..., str] | None = None, **more: Any) -> None:
    """Store a result and print it; ``more`` are values that its text needs besides the record."""
    drawn = save_and_draw(options, result, moving)
    print_record(options, result.json(), drawn, text, result=result, **more)


def print_record(options: argparse.Namespace, record: dict[str, Any], drawn: Sequence[Path] = (),
                 text: Callable[..., str] | None = None, **more: Any) -> None:
    """Print a record as one JSON object, or as ``text`` writes it from the record and ``more``.

    The object begins with the number of its schema. Without ``text`` the command's template in
    commands/text writes it. The files ``drawn`` come last, one by one.
    """
    raise_again()
    if options.json:
        from tympan.reports.schema_number import SCHEMA_NUMBER

        print(json.dumps({"schema": SCHEMA_NUMBER, **record}, allow_nan=False))
        return
    written = (text or _by_template)(record=record, options=options, entries=_entries, **more)
    if written:
        print(written.rstrip("\n"))
    for file in drawn:
        print(file)


def _by_template(options: argparse.Namespace, **more: Any) -> str:
    """Write a command's text by its template in commands/text."""
    from tympan.commands.lines import FILTERS
    from tympan.reports.template import template

    name = options.command.replace(" ", "_")
    filters = {function.__name__: function for function in FILTERS}
    page = template(f"commands/text/{name}.txt", entries=_entries, entry=_entry,
                    suffix=suffix_of, **filters)
    return page.render(options=options, **more)


#: Pair of numbers along x and y that is no place.
_SHIFT = "shift"


def _entries(record: dict[str, Any], *without: str) -> str:
    """Write one line for each entry with a value, in common units; a place takes one line."""
    from tympan.base.units import place_text

    rows = []
    for key, value in record.items():
        if key in without or value is None or key.endswith("_y_m"):
            continue
        if key.endswith("_x_m"):
            what, y = key.removesuffix("_x_m"), record[f"{key.removesuffix('_x_m')}_y_m"]
            named = what if what == _SHIFT else f"{what} place".replace("_", " ")
            rows.append((named, place_text(value, y)))
            continue
        rows += [_entry(key, item) for item in (value if key == "warnings" else [value])]
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {words}" for name, words in rows)


def _entry(key: str, value: object) -> tuple[str, str]:
    """Write name and value of an entry for people.

    Examples
    --------
    >>> _entry("max_field_V_per_m", 17767503.3), _entry("dofs", 1426)
    (('max field', '17.768 MV/m'), ('dofs', '1426'))
    >>> _entry("semi_axes_m", [0.06, 0.045])
    ('semi axes', '60, 45 mm')
    >>> _entry("frame.semi_axes.0_m", 0.06), _entry("statuses", {"equilibrium": 2, "failed": 1})
    (('frame.semi_axes.0', '60 mm'), ('statuses', '2 equilibrium, 1 failed'))
    """
    si = unit_of(key)
    name = key if si is None else key.removesuffix(suffix_of(si))
    unit, factor = BENCH.get(si or "", (si or "", 1.0))
    numbers: list[Any] = list(value) if isinstance(value, list | tuple) else [value]
    if numbers and all(isinstance(number, float) for number in numbers):
        value = f"{', '.join(f'{factor * number:.5g}' for number in numbers)} {unit}".rstrip()
    if isinstance(value, dict):
        value = ", ".join(f"{count} {word}" for word, count in value.items()).replace("_", " ")
    # The path of a key in a file is written as in the file.
    return name if "." in name else name.replace("_", " "), str(value)
