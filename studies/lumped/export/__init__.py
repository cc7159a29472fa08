"""A lumped model for a controller.

It is exported as C99 (``c_source.py``), as FMU 2.0 (``fmu.py``), or as a polynomial of the voltage
followed by a slow and a fast transfer function (``slow_fast.py``). The text files of this folder
are the templates.
"""

from __future__ import annotations

from pathlib import Path

from tympan.base.errors import InputError
from tympan.studies.lumped.model_file import LumpedModel


def require_form(mass: float | None, fmu: bool, slow_fast: bool) -> None:
    """Refuse two forms at once, a missing mass [kg], and a mass for the C code."""
    if fmu and slow_fast:
        raise InputError("must be one of --fmu and --slow-fast", key="--slow-fast", given="both")
    if (fmu or slow_fast) != (mass is not None):
        raise InputError("must be given with --fmu or --slow-fast, and only with them: the C takes "
                         "any mass", key="--mass", given=None if mass is None else f"{mass:g} kg")


def export(model: LumpedModel, folder: Path, mass: float | None = None, fmu: bool = False,
           slow_fast: bool = False) -> list[Path]:
    """Write a model's files: C99, or an FMU or two transfer functions with a mass [kg]."""
    require_form(mass, fmu, slow_fast)
    if mass is None:
        from tympan.studies.lumped.export.c_source import export_c

        return export_c(model, folder)
    if fmu:
        from tympan.studies.lumped.export.fmu import export_fmu

        return [export_fmu(model, folder, mass)]
    from tympan.studies.lumped.export.slow_fast import export_slow_fast

    return [export_slow_fast(model, folder, mass)]
