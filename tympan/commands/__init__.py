"""The subcommands of ``tympan``, by subject.

What each prints has its template in text/, or its function in ``lines.py``.
"""

from tympan.commands import (
    alpha,
    cases,
    data,
    doctor,
    drawing,
    explore,
    export,
    material,
    runs,
    transient,
)
from tympan.commands.lumped import build as lumped_build
from tympan.commands.lumped import control as lumped_control
from tympan.commands.lumped import export as lumped_export
from tympan.commands.lumped import identify as lumped_identify
from tympan.commands.lumped import paper as lumped_paper
from tympan.commands.lumped import response as lumped_response

#: Every command in the order of ``tympan --help``, by heading.
HEADINGS = {
    "simulate and design": (
        cases.solve, cases.limits, cases.curve, cases.force, cases.sense, cases.steer,
        cases.tolerance, cases.path, cases.modes, cases.sensitivity, transient.transient,
        transient.response, alpha.alpha, runs.study, runs.sweep, runs.design, alpha.outlines,
        alpha.alpha_map),
    "draw, look up, export": (
        drawing.draw, explore.explore, export.export, runs.compare, runs.report, material.materials,
        material.material_show, data.effects, doctor.doctor),
    "measured data": (data.data, data.diagnose, material.material_fit),
    "lumped models": (
        lumped_build.lumped_build, lumped_response.lumped_simulate,
        lumped_response.lumped_linearise, lumped_control.lumped_control,
        lumped_control.lumped_steer, lumped_identify.lumped_identify, lumped_export.lumped_export,
        lumped_paper.lumped_paper),
}
#: Commands that ``tympan --help`` shows, by what one wants; ``tympan help all`` shows all.
FIRST = {
    "one film": (cases.solve, cases.limits, cases.curve, cases.force, explore.explore),
    "many films": (runs.sweep, cases.tolerance, runs.design),
    "your measurements": (data.data, data.diagnose),
}
#: Words of the trade for which there is no command, with what there is.
ELSEWHERE = {
    "fatigue": "no lifetime is predicted; tympan limits finds where a rising voltage ends the film",
    "lifetime": "no lifetime is predicted; tympan limits finds where a rising voltage ends the "
                "film",
    "temperature": "the effect of temperature is a key of the rig, and one that tympan diagnose "
                   "looks for",
}
COMMANDS = tuple(command for commands in HEADINGS.values() for command in commands)
#: Purpose of each group of commands with two words.
GROUPS = {"lumped": "the lumped model: a mass on circles of film",
          "material": "look at a material, or fit one to coupon tests"}
