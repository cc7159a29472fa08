"""Options and outputs that commands share."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from tympan.fem.rig import Rig
    from tympan.studies.case import Case, Settings

#: Where a command adds its parser.
Subcommands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def command(commands: Subcommands, name: str, run: Callable[[argparse.Namespace], None],
            help_text: str, more: str = "") -> argparse.ArgumentParser:
    """A subcommand and what runs it; ``more`` stands below the help text in its own help."""
    parser = commands.add_parser(name, help=help_text,
                                 description=_sentence(help_text) + (f" {more}" if more else ""))
    parser.set_defaults(run=run)
    return parser


def command_group(commands: Subcommands, name: str, help_text: str) -> Subcommands:
    """A command that has subcommands, and where these are added."""
    parser = commands.add_parser(name, help=help_text, description=_sentence(help_text))
    return parser.add_subparsers(title="commands", required=True, metavar="COMMAND")


def _sentence(help_text: str) -> str:
    return f"{help_text[0].upper()}{help_text[1:]}."


def specimen_argument(parser: argparse.ArgumentParser) -> None:
    """The specimen's file, ``options.specimen``."""
    parser.add_argument("specimen", type=Path, metavar="SPECIMEN.toml")


def case_arguments(parser: argparse.ArgumentParser, *, mass: str = "on the plate",
                   voltage: str = "across the film") -> None:
    """Specimen, load, voltage, rig and mesh, for :func:`read_case` and :func:`read_settings`."""
    specimen_argument(parser)
    parser.add_argument("--mass", required=True, help=f'{mass}, such as "17.9 g"')
    parser.add_argument("--voltage", default="0 kV",
                        help=f'{voltage}, such as "3.5 kV" (default: %(default)s)')
    rig_argument(parser)
    mesh_argument(parser)


def rig_argument(parser: argparse.ArgumentParser) -> None:
    """The rig's file, read by :func:`read_rig`."""
    parser.add_argument("--rig", type=Path, metavar="RIG.toml",
                        help="gravity, springs, pressure, amplifier, sensor and what else acts")


def mesh_argument(parser: argparse.ArgumentParser) -> None:
    """How fine to mesh, read by :func:`read_settings`."""
    parser.add_argument("--refine", type=float, default=1.0, metavar="X",
                        help="divide every element size by X (default: %(default)s)")


def workers_argument(parser: argparse.ArgumentParser) -> None:
    """How many processes, ``options.workers``."""
    parser.add_argument("--workers", type=int, default=2, metavar="N",
                        help="processes (default: %(default)s)")


def output_argument(parser: argparse.ArgumentParser, help_text: str | None = None, *,
                    required: bool = False, default: Path | None = None) -> None:
    """The folder for results, ``options.output``."""
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help=help_text,
                        required=required, default=default)


def json_argument(parser: argparse.ArgumentParser,
                  help_text: str = "print one JSON object") -> None:
    """Whether to print for programs, ``options.json``."""
    parser.add_argument("--json", action="store_true", help=help_text)


def read_settings(options: argparse.Namespace) -> Settings:
    """Settings of the options that :func:`mesh_argument` adds."""
    from tympan.geometry.errors import InputError
    from tympan.geometry.mesher import MeshSettings
    from tympan.studies.case import Settings

    if not 0.5 <= options.refine <= 20:
        raise InputError("must be from 0.5 to 20", key="--refine", given=options.refine)
    return Settings(mesh=MeshSettings().refined(options.refine))


def read_case(options: argparse.Namespace) -> Case:
    """The case of the options that :func:`case_arguments` adds."""
    from tympan.fem.film.library import load_specimen
    from tympan.studies.case import Case

    return Case(specimen=load_specimen(options.specimen),
                mass=parse_quantity(options.mass, "mass", "--mass"),
                voltage=parse_quantity(options.voltage, "voltage", "--voltage"),
                rig=read_rig(options.rig))


def read_rig(file: Path | None) -> Rig:
    """The rig of a file, or an ideal one."""
    from tympan.fem.rig import Rig

    return Rig() if file is None else Rig.read(file)


def parse_quantity(text: str, dimension: str, option: str) -> float:
    """A quantity given to an option [SI]."""
    from tympan.geometry.errors import InputError
    from tympan.geometry.units import quantity

    try:
        return quantity(text, dimension)
    except InputError as error:
        raise error.located(key=option) from None


def parse_numbers(text: str | None, option: str) -> tuple[float, ...] | None:
    """Numbers given to an option with commas between them; None where it was not given."""
    from tympan.geometry.errors import InputError

    if text is None:
        return None
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError("must be numbers with a comma between them, such as 0.6,0.4", key=option,
                         given=text) from None


def check_distinct(names: Sequence[str]) -> None:
    """Refuse specimens of the same name: their results would overwrite each other."""
    from tympan.geometry.errors import InputError

    if len(set(names)) < len(names):
        raise InputError("specimens must have different names", key="name", given=", ".join(names))


def print_json(value: dict[str, Any]) -> None:
    """One JSON object on a line of its own."""
    print(json.dumps(value, ensure_ascii=False, allow_nan=False))


def show(result: dict[str, Any], as_json: bool) -> None:
    """One JSON object, or one line per entry."""
    if as_json:
        print_json(result)
        return
    width = max(map(len, result))
    for key, value in result.items():
        for item in value if key == "warnings" else [value]:
            text = f"{item:.6g}" if isinstance(item, float) else str(item)
            print(f"{key:<{width}}  {text}")
