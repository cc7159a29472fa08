"""``tympan explore``: a live page."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tympan.base.errors import InputError
from tympan.base.extras import needs
from tympan.commands.cases import TOLERANCES, given_tolerances
from tympan.options import RIG, argument, command, naming_file, naming_options, parse_quantity

if TYPE_CHECKING:
    from tympan.explore.server import Explorer

_PORTS = (0, 65535)


@command("explore", argument("subject", type=Path, metavar="SPECIMEN.toml|DATASET|DIR",
                             help="a specimen, a folder of readings, or a folder of specimens"),
         argument("--mass", help='on the plate at first, such as "17.9 g" (default: the one '
                                 "measured most, or one that suits the film)"),
         argument("--voltage", default="0 kV", help="across the film at first"), RIG, TOLERANCES,
         argument("--port", type=int, default=0, within=_PORTS, metavar="N",
                  help="to listen on (default: any that is free)"),
         argument("--host", default="127.0.0.1", metavar="ADDRESS",
                  help="to listen on; others than this machine's own let other machines in, who "
                       "know the token"),
         argument("--no-browser", action="store_true", help="print the address only"),
         example="oval.toml", also=("gui", "view", "interactive"))
def explore(options: argparse.Namespace) -> None:
    """Explore a film live in the browser: sliders, stress in 3-D, curve, readings, limits.

    Nothing leaves this machine; Ctrl-C ends it.
    """
    import asyncio
    import webbrowser

    explorer = _explorer(options)

    async def serve() -> None:
        try:
            await explorer.begin()
        except OSError as error:
            raise InputError(f"cannot be listened on: {error.strerror}", key="--port",
                             given=f"{options.host}:{options.port}") from None
        # The address ends the line, so that a terminal's link contains nothing else.
        print(f"tympan: exploring {explorer.subject.name} (Ctrl-C ends it) at {explorer.address}",
              file=sys.stderr, flush=True)
        if not options.no_browser:
            webbrowser.open(explorer.address)
        try:
            await asyncio.Event().wait()
        finally:
            await explorer.end()

    asyncio.run(serve())


def _explorer(options: argparse.Namespace) -> Explorer:
    needs("aiohttp", "the explorer")
    from tympan.explore.latest import prepared
    from tympan.progress import say

    prepared()  # while the rest is read
    from tympan.explore.server import Explorer
    from tympan.explore.subject import read_subject
    from tympan.explore.view import changed
    from tympan.studies.case import Settings
    from tympan.studies.driven import driven
    from tympan.studies.films.family import require_reducible
    from tympan.studies.limits.loads import usual_masses
    from tympan.studies.tolerance.given import causes

    subject = read_subject(options.subject, options.rig)
    pairs = [driven(specimen, options.voltage, "--voltage") for specimen in subject.specimens]
    subject = replace(subject, specimens=tuple(specimen for specimen, _ in pairs))
    voltage = parse_quantity(str(pairs[0][1]), "voltage", "--voltage")
    mass = None
    if options.mass is not None:
        mass = parse_quantity(options.mass, "mass", "--mass")
    elif not subject.masses(0):
        mass = usual_masses(subject.specimens[0], Settings(), subject.rig)[0]
    start = changed(subject.view(0, mass), "mass", subject.view(0, mass).mass)
    start = changed(start, "voltage", voltage)
    tolerances = given_tolerances(options)
    if tolerances is not None:
        with naming_file(options.tolerances or None), naming_options(options):
            for specimen in subject.specimens:
                require_reducible(specimen, subject.rig)
                causes(specimen, tolerances)
    return Explorer(subject, start, options.host, options.port, report=say, tolerances=tolerances)
