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
from tympan.commands.lumped import build, identify, paper, simulate

#: Every command; those of a group stand together.
COMMANDS = (
    study.run, solve.run, alpha.run, outlines.run, map.run, modes.run, sensitivity.run,
    optimise.run, path.run, sweep.run, data.run, simulate.run, identify.run, build.run, paper.run,
    diagnose.run, report.run, export.run, materials.run, material.show_material,
    material.fit_material, effects.run,
)
#: What the groups are for.
GROUPS = {"lumped": "the paper's lumped model: a mass on circles of film",
          "material": "look at a material, or fit one to coupon tests"}
