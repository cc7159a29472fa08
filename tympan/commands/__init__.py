"""The subcommands of ``tympan``, one file each, in the order of ``tympan --help``."""

from tympan.commands import (
    alpha,
    export,
    map,
    modes,
    optimise,
    outlines,
    path,
    report,
    sensitivity,
    solve,
    study,
    sweep,
)
from tympan.commands.data import data, diagnose, effects, material, materials
from tympan.commands.lumped import group as lumped

#: What adds each command to the parser.
COMMANDS = (
    study.add, solve.add, alpha.add, outlines.add, map.add, modes.add, sensitivity.add,
    optimise.add, path.add, sweep.add, data.add, lumped.add, diagnose.add, report.add, export.add,
    materials.add, material.add, effects.add,
)
