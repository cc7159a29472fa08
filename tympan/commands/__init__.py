"""The subcommands of ``tympan``, by subject; what one prints is its template in text/."""

from tympan.commands import alpha, cases, data, export, lumped, material, runs, transient

#: Every command in the order of ``tympan --help``; those of a group stand together.
COMMANDS = (
    runs.study, cases.solve, cases.limits, cases.curve, alpha.alpha, alpha.outlines,
    alpha.alpha_map, cases.modes, cases.sensitivity, runs.optimise, cases.path, transient.transient,
    transient.response,
    runs.sweep,
    data.data,
    lumped.lumped_simulate, lumped.lumped_identify, lumped.lumped_build, lumped.lumped_paper,
    data.diagnose, runs.report, export.export, material.materials, material.material_show,
    material.material_fit, data.effects,
)
#: What the groups are for.
GROUPS = {"lumped": "the paper's lumped model: a mass on circles of film",
          "material": "look at a material, or fit one to coupon tests"}
