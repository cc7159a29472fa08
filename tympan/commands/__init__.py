"""The subcommands of ``tympan``, by subject; what one prints is its template in text/."""

from tympan.commands import (
    alpha,
    cases,
    data,
    export,
    lumped,
    material,
    optimise,
    report,
    study,
    sweep,
)

#: Every command in the order of ``tympan --help``; those of a group stand together.
COMMANDS = (
    study.study, cases.solve, alpha.alpha, alpha.outlines, alpha.alpha_map, cases.modes,
    cases.sensitivity, optimise.optimise, cases.path, sweep.sweep, data.data,
    lumped.lumped_simulate, lumped.lumped_identify, lumped.lumped_build, lumped.lumped_paper,
    data.diagnose, report.report, export.export, material.materials, material.material_show,
    material.material_fit, data.effects,
)
#: What the groups are for.
GROUPS = {"lumped": "the paper's lumped model: a mass on circles of film",
          "material": "look at a material, or fit one to coupon tests"}
