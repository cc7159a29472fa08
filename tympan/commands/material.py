"""Commands about materials: the library, a law's curve, and laws fitted to tests."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tympan.base.errors import InputError
from tympan.options import (
    FORMULA,
    JSON,
    argument,
    command,
    finish,
    naming_options,
    output,
    parse_quantity,
    print_record,
)
from tympan.progress import waiting

if TYPE_CHECKING:
    from tympan.studies.case import Case


@command("materials", JSON,
         example="")
def materials(options: argparse.Namespace) -> None:
    """List the material library with sources."""
    from dataclasses import asdict

    from tympan.fem.film.breakdown import STRENGTH_LIBRARY
    from tympan.fem.film.library import MATERIALS

    record = {name: asdict(entry) | {"law": entry.material.law}
              for name, entry in MATERIALS.items()}
    print_record(options, record, materials=MATERIALS, strengths=STRENGTH_LIBRARY)


@command("material show",
         argument("material", metavar="NAME|SPECIMEN.toml",
                  help="of the library, also a refused one; or the material of a specimen file"),
         argument("--held", type=float, metavar="X",
                  help="stretch held across in the second column (default: as mounted, else 1)"),
         JSON,
         example="vhb-4910")
def material_show(options: argparse.Namespace) -> None:
    """Tabulate true stress against stretch, and find where the law fails."""
    from tympan.fem.film.law_report import examine, subject

    examination = examine(*subject(options.material, options.held))
    print_record(options, examination.json(), examination=examination)


@command("material fit",
         argument("coupons", type=Path, nargs="+", metavar="COUPON.csv|DATASET",
                  help="columns mode, stretch, nominal_stress_kPa; also specimen, t_s, run; or a "
                       "published format, several files of which are one set of tests; or the "
                       "folder of a dataset: one factor on the stated law's stiffness, one on the "
                       "permittivity and, with transient.csv, up to two branches are fitted to all "
                       "that its actuators and coupons show, and the form of the law is not"),
         argument("--law", action="append", metavar="NAME",
                  help="may be given several times; all (default) compares every law, beside "
                       "branches those with at most one constant that stress is not linear in"),
         argument("--noise", metavar="STRESS",
                  help='standard deviation of one reading, such as "2 kPa"; without it, estimated '
                       "from the residuals"),
         argument("--branches", type=int, metavar="N", within=(0, 4),
                  help="viscous branches beside each law, where a run has several times (t_s); "
                       "left out, as few as foretell about best the runs of a stretch level or a "
                       "rate that are held out; 0 takes readings as elastic"),
         argument("--constants", action="append", metavar="KEY",
                  help="of a dataset: also fit the law's constants of this key, such as mu; "
                       "may be given several times; all fits every one"),
         argument("--film", type=Path, metavar="SPECIMEN.toml",
                  help="also say how far this film deflects by the fitted law, with 95 % "
                       "limits: what the tests leave open of it"),
         argument("--mass", help='on the plate of --film, such as "17.9 g"'),
         argument("--voltage", default="0 V", help='on --film, such as "3 kV"'),
         argument("--mode", choices=("uniaxial", "equibiaxial", "pure_shear"),
                  help="mode of tests whose table does not say it (default: the end of the file's "
                       "name)"),
         argument("--unit", metavar="UNIT", help='of stresses whose heading has none, such as "MPa"'
                  ),
         argument("--area", help="cross-section of the strip before the test, for a table with "
                                 'forces, such as "18 mm^2"'),
         argument("--length", help="length of the strip before the test, for a table with "
                                   'displacements, such as "30 mm"'),
         argument("--decimal", choices=(",", "."), help="decimal mark of the numbers (default: "
                                                         "found)"),
         output("also store the fits (JSON), their curves (CSV), a figure, and the best law for "
                "specimen files (TOML)"), FORMULA, JSON,
         example="coupon.csv -o fit", also=("fit",))
def material_fit(options: argparse.Namespace) -> None:
    """Fit laws, and viscous branches in time, to coupon tests; or a film to its actuators."""
    from tympan.studies.case import Settings
    from tympan.studies.data.coupon import coupon_layout
    from tympan.studies.material.result import fit_coupons

    if options.coupons[0].is_dir() or options.coupons[0].name == "dataset.toml":
        _fit_actuators(options)
        return
    if options.constants:
        raise InputError("is for a dataset: of coupons every constant is fitted",
                         key="--constants", given=" ".join(options.constants))
    noise = None if options.noise is None else parse_quantity(options.noise, "stress", "--noise")
    with naming_options(options):
        layout = coupon_layout(options.mode, options.unit, options.area, options.length,
                               options.decimal)
        settings = Settings(formula=options.formula)
    film = _film(options)
    with waiting("fits of laws"):
        result = fit_coupons(options.coupons, options.law, noise, options.branches, film,
                             settings, layout)
    finish(options, result)


def _fit_actuators(options: argparse.Namespace) -> None:
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.diagnosis.diagnose import by_formula
    from tympan.studies.diagnosis.film_fit import fit_film

    of_coupons = {"--law": options.law, "--noise": options.noise, "--film": options.film,
                  "--mass": options.mass, "--mode": options.mode, "--unit": options.unit,
                  "--voltage": None if options.voltage == "0 V" else options.voltage,
                  "--area": options.area, "--length": options.length,
                  "--decimal": options.decimal}
    for key, given in of_coupons.items():
        if given is not None:
            raise InputError("is for coupons: a dataset's specimens have their law and their noise",
                             key=key, given=str(given))
    folder, *others = options.coupons
    if others:
        raise InputError("must be one folder, or files of coupons", key="DATASET",
                         given=" ".join(map(str, options.coupons)))
    with naming_options(options):
        dataset = by_formula(read_dataset(folder), options.formula)
    with waiting("fit to the film's actuators"):
        result = fit_film(dataset, options.branches, constants=options.constants or ())
    if options.output is not None:
        result.save(options.output)
    print_record(options, result.json(), result=result)


def _film(options: argparse.Namespace) -> Case | None:
    """Read the film of ``--film`` with its loads, None where none is requested."""
    if options.film is None:
        if options.mass is not None or options.voltage != "0 V":
            raise InputError("is missing: --mass and --voltage are of its film", key="--film")
        return None
    from tympan.studies.case import Case
    from tympan.studies.driven import driven
    from tympan.studies.shipped import load_named

    if options.mass is None:
        raise InputError('must be given with --film, such as "17.9 g"', key="--mass")
    specimen, voltage = driven(load_named(options.film), options.voltage, "--voltage")
    return Case(specimen, mass=parse_quantity(options.mass, "mass", "--mass"),
                voltage=parse_quantity(str(voltage), "voltage", "--voltage"))
