"""The ``tympan`` command. Nothing heavy is imported before a command needs it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tympan.commands import (
    alpha,
    export,
    modes,
    optimise,
    outlines,
    path,
    sensitivity,
    sweep,
)
from tympan.commands import (
    map as maps,
)
from tympan.commands.data import data, diagnose, effects, material
from tympan.commands.lumped import group as lumped
from tympan.options import (
    command,
    mesh_argument,
    parse_quantity,
    read_rig,
    read_settings,
    show,
    specimen_argument,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; exit status 0 done, 1 failed with a message, 2 the input is wrong."""
    options = _parser().parse_args(arguments)
    from tympan.geometry.errors import InputError
    from tympan.geometry.system import MissingLibrary

    try:
        options.run(options)
    except InputError as error:
        print(f"tympan: {error}", file=sys.stderr)
        return 2
    except MissingLibrary as error:
        print(f"tympan: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt as interruption:
        print("; ".join(["tympan: interrupted", *map(str, interruption.args)]), file=sys.stderr)
        return 1
    except BrokenPipeError:
        sys.stderr.close()
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tympan", description="Shape studies of dielectric-elastomer membrane actuators.",
        epilog='Quantities carry their unit: --mass "17.9 g" --voltage "3.5 kV".')
    parser.add_argument("--version", action=_Version)
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    _study(commands)
    _solve(commands)
    alpha.add(commands)
    outlines.add(commands)
    maps.add(commands)
    modes.add(commands)
    sensitivity.add(commands)
    optimise.add(commands)
    path.add(commands)
    sweep.add(commands)
    data.add(commands)
    lumped.add(commands)
    diagnose.add(commands)
    _report(commands)
    export.add(commands)
    _materials(commands)
    material.add(commands)
    effects.add(commands)
    return parser


class _Version(argparse.Action):
    """``--version`` without asking the package metadata on every start."""

    def __init__(self, option_strings: list[str], dest: str, **_: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, help="show the version and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"tympan {version('tympan')}")
        parser.exit()


def _study(commands: Any) -> None:
    parser = command(commands, "study", _run_study,
                      "solve specimens, draw their stress, derive α, write a report; by default of the paper's three")
    parser.add_argument("file", nargs="?", type=Path, metavar="STUDY.toml",
                        help="which specimens and loads")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"), metavar="DIR",
                        help="default: %(default)s")


def _run_study(options: argparse.Namespace) -> None:
    from tympan.progress import bar
    from tympan.studies import study as job

    study = job.read_study(options.file) if options.file else job.default_study()
    with bar(job.steps(study) + 1) as progress:
        job.run(study, options.output, progress)
        progress("report")
        from tympan.reports.study.page import build

        report = build(options.output)
    print(report)


def _solve(commands: Any) -> None:
    parser = command(commands, "solve", _run_solve, "one specimen under one load and voltage")
    specimen_argument(parser)
    parser.add_argument("--mass", required=True, help='on the plate, such as "17.9 g"')
    parser.add_argument("--voltage", default="0 kV",
                        help='across the film, such as "3.5 kV" (default: %(default)s)')
    parser.add_argument("--rig", type=Path, metavar="RIG.toml",
                        help="gravity, spring, amplifier and sensor")
    parser.add_argument("--elapsed", default="0 s", metavar="TIME",
                        help="since the run began, for a rig whose readings drift (default: %(default)s)")
    parser.add_argument("--direction", choices=("up", "down"), default="",
                        help="which way the voltage was reached, for a film that lags behind it (default: not known)")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR",
                        help="also store the fields (VTU) and the numbers")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    mesh_argument(parser)


def _run_solve(options: argparse.Namespace) -> None:
    import time

    from tympan.fem.film.library import load_specimen
    from tympan.fem.results.fields import whole
    from tympan.fem.rig import DIRECTIONS
    from tympan.studies import case as cases
    from tympan.studies import files as store

    specimen = load_specimen(options.specimen)
    case = cases.Case(specimen, parse_quantity(options.mass, "mass", "--mass"),
                      parse_quantity(options.voltage, "voltage", "--voltage"),
                      read_rig(options.rig),
                      parse_quantity(options.elapsed, "time", "--elapsed"),
                      DIRECTIONS[options.direction])
    began = time.perf_counter()
    model, outcome = cases.find(case, read_settings(options))
    result = cases.summarise(case, model, outcome, time.perf_counter() - began)
    if options.output is not None:
        store.remove(options.output, f"{specimen.name}.vtu", f"{specimen.name}.json")
        if outcome.status == "equilibrium":
            store.write_fields(options.output / f"{specimen.name}.vtu",
                               *whole(model, outcome.state))
        store.write_json(options.output / f"{specimen.name}.json", result.json())
    show(result.json(), options.json)


def _report(commands: Any) -> None:
    parser = command(commands, "report", _run_report,
                     "rebuild a run's figures and report from what it stored")
    parser.add_argument("folder", type=Path, metavar="DIR")


def _run_report(options: argparse.Namespace) -> None:
    from tympan.geometry.errors import InputError
    from tympan.reports.diagnosis import page as diagnosis
    from tympan.reports.paper import page as lumped_page
    from tympan.reports.study import page as html

    builders = {"study.json": html.build, "diagnosis.json": diagnosis.build,
                "paper.json": lumped_page.build}
    found = [build for name, build in builders.items() if (options.folder / name).exists()]
    if not found:
        raise InputError(f"holds none of {', '.join(builders)}: only what tympan study, tympan diagnose and "
                         "tympan lumped paper wrote is rebuilt", file=options.folder)
    print(found[-1](options.folder))


def _materials(commands: Any) -> None:
    parser = command(commands, "materials", _run_materials,
                     "list the material library with sources")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run_materials(options: argparse.Namespace) -> None:
    from dataclasses import asdict

    from tympan.fem.film.breakdown import STRENGTHS
    from tympan.fem.film.library import MATERIALS

    if options.json:
        listed = {name: asdict(entry) | {"law": entry.material.law}
                  for name, entry in MATERIALS.items()}
        print(json.dumps(listed, ensure_ascii=False))
        return
    for name, entry in MATERIALS.items():
        print(f"{name}\n  {entry.material}\n  source: {entry.source}\n  beware: {entry.caveat}")
        if entry.film_source:
            known = {"density": entry.density, "relative permittivity": entry.relative_permittivity}
            numbers = ", ".join(f"{key} {value:g}" for key, value in known.items()
                                if value is not None)
            print(f"  film: {numbers} (kg/m³); {entry.film_source}")
    print("\nelectric strengths, for membrane.breakdown")
    for name, strength in STRENGTHS.items():
        print(f"{name}\n  {strength.strength}\n  source: {strength.source}\n  beware: {strength.caveat}")
