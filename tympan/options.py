"""Options and outputs that commands share."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tympan.fem.rig import Rig


def command(commands: Any, name: str, run: Callable[[argparse.Namespace], None], words: str
             ) -> argparse.ArgumentParser:
    """A subcommand and what runs it."""
    described = words[0].upper() + words[1:] + "."
    parser: argparse.ArgumentParser = commands.add_parser(name, help=words, description=described)
    parser.set_defaults(run=run)
    return parser


def specimen_argument(parser: argparse.ArgumentParser) -> None:
    """The specimen file."""
    parser.add_argument("specimen", type=Path, metavar="SPECIMEN.toml")


def mesh_argument(parser: argparse.ArgumentParser) -> None:
    """How fine to mesh."""
    parser.add_argument("--refine", type=float, default=1.0, metavar="X",
                        help="divide every element size by X (default: %(default)s)")


def read_settings(options: argparse.Namespace) -> Any:
    """Settings of the options that :func:`mesh_argument` adds."""
    from tympan.geometry.errors import InputError
    from tympan.geometry.mesher import MeshSettings
    from tympan.studies.case import Settings

    if not 0.5 <= options.refine <= 20:
        raise InputError("must be from 0.5 to 20", key="--refine", given=options.refine)
    return Settings(mesh=MeshSettings().refined(options.refine))


def parse_quantity(text: str, dimension: str, option: str) -> float:
    """A quantity given to an option [SI]."""
    from tympan.geometry.errors import InputError
    from tympan.geometry.units import quantity

    try:
        return quantity(text, dimension)
    except InputError as error:
        raise error.located(key=option) from None


def check_distinct(names: Sequence[str]) -> None:
    """Refuse specimens of the same name: their results would overwrite each other."""
    from tympan.geometry.errors import InputError

    if len(set(names)) < len(names):
        raise InputError("specimens must have different names", key="name", given=", ".join(names))


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


def read_rig(file: Path | None) -> Rig:
    """The rig of a file, or an ideal one."""
    from tympan.fem.rig import Rig

    return Rig() if file is None else Rig.read(file)


def show(result: dict[str, Any], as_json: bool) -> None:
    """One JSON object, or one line per entry."""
    if as_json:
        print(json.dumps(result, ensure_ascii=False, allow_nan=False))
        return
    width = max(map(len, result))
    for key, value in result.items():
        for item in value if key == "warnings" else [value]:
            print(f"{key:<{width}}  {item:.6g}" if isinstance(item, float)
                  else f"{key:<{width}}  {item}")
