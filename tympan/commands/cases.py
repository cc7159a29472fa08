"""Commands about one specimen: ``solve``, ``limits``, ``curve``, ``path``, ``modes`` and others."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.base.errors import InputError
from tympan.base.fields import only
from tympan.commands.lines import limits_text, solved_text
from tympan.options import (
    JSON,
    MESH,
    PRESSURE,
    RIG,
    SEEDS,
    SPECIMEN,
    Moving,
    argument,
    case_arguments,
    command,
    finish,
    naming_file,
    naming_options,
    output,
    parse_quantities,
    parse_quantity,
    print_record,
    read_case,
    read_mounted,
    read_settings,
    read_voltages,
)
from tympan.progress import waiting

if TYPE_CHECKING:
    from tympan.fem.rig import Rig
    from tympan.geometry.specimen import Specimen
    from tympan.studies.case import Settings
    from tympan.studies.tolerance.given import Tolerances


#: Option for results with the band of films within tolerances.
TOLERANCES = argument(
    "--tolerances", nargs="?", const="", metavar="FILE",
    help="also the spread between films made to tolerances: median, 5 and 95 %; by the standard "
         "deviations of a file, or without FILE by those of the film's material and assumed ones "
         "(docs/howto/tolerance.md)")


def given_tolerances(options: argparse.Namespace) -> Tolerances | None:
    """Read tolerances of a file, or the defaults; None where none are requested."""
    if options.tolerances is None:
        return None
    from tympan.studies.tolerance.given import Tolerances

    return Tolerances.read(options.tolerances) if options.tolerances else Tolerances()


def _banded(options: argparse.Namespace, result: Any, specimen: Specimen, rig: Rig) -> Any:
    """Add bands to the result, where tolerances are given."""
    given = given_tolerances(options)
    if given is None:
        return result
    from tympan.studies.tolerance.bands import banded

    with naming_file(options.tolerances or None), naming_options(options):
        return banded(result, specimen, given, rig, read_settings(options))


@command("solve", *case_arguments(),
         argument("--elapsed", default="0 s", metavar="TIME",
                  help="since the run began, for a rig whose readings drift"),
         argument("--after", metavar="TIME",
                  help="the voltage was switched on, at rest under the mass until then, for a film "
                       "with viscous branches (default: at rest again)"),
         argument("--direction", choices=("up", "down"), default="",
                  help="which way the voltage was reached, for a film that lags behind it or a "
                       "plate that rubs (default: not known, without either)"),
         TOLERANCES,
         output("also store the fields (VTU), the numbers and a picture (PNG, SVG)"), JSON,
         example='oval.toml --mass "17.9 g" --voltage "3.5 kV"',
         also=("run", "simulate", "simulation", "equilibrium", "stress"))
def solve(options: argparse.Namespace) -> None:
    """Solve one specimen under one load and voltage, and find how far the voltage can be raised.

    Deflection is positive downwards, along the load. It is 0 where the film is flat, before
    anything hangs on it. The mass is all that hangs on the film, the plate included.
    """
    from dataclasses import replace

    from tympan import solving
    from tympan.fem.rig import DIRECTIONS

    case = replace(read_case(options),
                   elapsed=parse_quantity(options.elapsed, "time", "--elapsed"),
                   direction=DIRECTIONS[options.direction])
    if options.after is not None and options.tolerances is not None:
        raise InputError("is for films at rest: --after must be left out", key="--tolerances",
                         given=options.tolerances or "defaults")
    with naming_options(options), waiting("equilibrium and limits"):
        result = solving.solve(case, read_settings(options), options.after,
                               film=options.output is not None)
    finish(options, _banded(options, result, case.specimen, case.rig), text=solved_text,
           specimen=case.specimen)


#: Option to follow a film beyond the end of any real film.
_BEYOND = argument("--beyond", action="store_true",
                   help="follow the film on to where no real one gets: far beyond its electric "
                        "strength, and, where it thins without bound, as one kept from wrinkling, "
                        "to its pull-in (a few times the work)")


@command("limits", SPECIMEN, argument("--mass", help='of plate, hook and weight, such as "17.9 g" '
                                      "(default: one that pulls the plate down a tenth of its "
                                      "gap)"),
         argument("--voltage", metavar="SEGMENTS",
                  help="proportion in which the voltages of an electrode's segments rise, such as "
                       '"A = 100 %%, B = 50 %%" (default: that of the file)'), PRESSURE,
         RIG, _BEYOND, MESH, JSON,
         example='oval.toml --mass "17.9 g"', also=("limit", "pull-in", "breakdown"))
def limits(options: argparse.Namespace) -> None:
    """Find the limits of a film: the first loss of tension, breakdown, instability and pull-in.

    Also snap-through of a plate that a mechanism of the rig makes jump, and snap-back as the
    voltage falls.
    """
    from tympan.studies.case import Case
    from tympan.studies.driven import by_segment
    from tympan.studies.limits import LimitsResult

    if options.voltage is not None and not by_segment(options.voltage):
        raise InputError('must name the segments of an electrode, such as "A = 100 %, B = 50 %": '
                         "the voltage itself is raised until the film ends", key="--voltage",
                         given=options.voltage)
    only(options.mass, "--mass")  # by default there are several, of which the first one is asked
    specimen, rig, settings, (mass, *_) = _loaded(options)
    with waiting("limits"):
        result = LimitsResult.of(Case(specimen, mass=mass, rig=rig), settings, options.beyond)
    print_record(options, result.json(), text=limits_text, limits=result.limits,
                 plate=specimen.plate, pressure=rig.gas_pressure)


@command("curve", SPECIMEN,
         argument("--mass", help='of plate, hook and weight, one or several, such as "10 g, 20 g" '
                                "(default: some that suit the film)"),
         argument("--voltage", help='voltages to mark, such as "1 kV, 2 kV" (default: none)'),
         TOLERANCES, PRESSURE, RIG, _BEYOND,
         output("also store the curves (CSV), their limits (JSON) and a picture (PNG, SVG)"), JSON,
         MESH,
         example='oval.toml --mass "10 g, 17.9 g" -o curve', also=("actuation", "stroke"))
def curve(options: argparse.Namespace) -> None:
    """Compute deflection against voltage, to the film's limit and on to its end."""
    from tympan.progress import bar
    from tympan.studies.driven import in_proportion
    from tympan.studies.limits.curve import curve

    specimen, rig, settings, masses = _loaded(options, driven=False)
    voltages = read_voltages(options)
    with naming_options(options):
        films = in_proportion(specimen, voltages.film, voltages.segments)
    with bar(len(masses) * (len(films) + len(voltages.film))) as progress:
        result = curve(specimen, masses, settings, rig, voltages.film, progress, options.beyond,
                       voltages.segments)
    finish(options, _banded(options, result, specimen, rig))


def _loaded(options: argparse.Namespace, driven: bool = True
            ) -> tuple[Specimen, Rig, Settings, tuple[float, ...]]:
    """Read specimen, rig, settings, and masses that are given or suit the film."""
    from tympan.fem.rig import checked_load
    from tympan.studies.limits.loads import usual_masses

    specimen, rig = read_mounted(options, driven)
    settings = read_settings(options)
    if specimen.plate is None and options.mass is None:
        return specimen, rig, settings, (0.0,)
    if options.mass is None:
        return specimen, rig, settings, usual_masses(specimen, settings, rig)
    masses = parse_quantities(options.mass, "mass", "--mass")
    for mass in masses:
        checked_load(mass, 0.0)
    if len(set(masses)) < len(masses):
        raise InputError("must differ from each other", key="--mass", given=options.mass)
    return specimen, rig, settings, masses


@command("force", SPECIMEN,
         argument("--voltage", default="0 kV",
                  help='held across the film, one curve each, such as "0 kV, 3 kV"'),
         argument("--from", default="0 mm", metavar="LENGTH", help="first displacement"),
         argument("--to", metavar="LENGTH",
                  help='last displacement, such as "6 mm" (default: a little beyond where the '
                       "loads come to rest; without loads 0.3 of the gap)"),
         argument("--points", type=int, default=61, metavar="N", within=(2, 10000),
                  help="number of displacements"),
         argument("--mass", metavar="MASSES", formerly="--load",
                  help='weights whose equilibria are asked for, such as "10 g, 20 g"; each acts '
                       "together with what the rig has between plate and ground; the first is "
                       "that of stroke, work and blocked force of the whole result"),
         argument("--rate", metavar="SPEED",
                  help='also move the plate out and back in time at a speed such as "1 mm/s": the '
                       "loops of a film with viscous branches, and their area"),
         argument("--cycles", type=int, default=1, metavar="N", within=(1, 1000),
                  help="number of such loops"),
         TOLERANCES, PRESSURE, RIG,
         output("also store the curves (CSV), the numbers (JSON) and a picture (PNG, SVG)"), JSON,
         MESH,
         example='oval.toml --voltage "0 kV, 3 kV" --mass "20 g" -o force',
         also=("blocked", "blocked-force", "stiffness", "work"))
def force(options: argparse.Namespace) -> None:
    """Compute the force on the plate against its displacement, and equilibria of loads.

    The plate is held as by a tensile tester, a curve for each voltage; force and displacement are
    positive along the load. With loads: equilibria, stroke, work, electrical energy.
    """
    from tympan.progress import bar
    from tympan.studies.force import ForceCase, force

    specimen, rig = read_mounted(options, driven=False)
    voltages = read_voltages(options)
    with naming_options(options):
        case = ForceCase(
            specimen, voltages=voltages.film, segment_voltages=voltages.segments, rig=rig,
            points=options.points,
            start=parse_quantity(getattr(options, "from"), "length", "--from"),
            to=None if options.to is None else parse_quantity(options.to, "length", "--to"),
            masses=parse_quantities(options.mass or "", "mass", "--mass"), cycles=options.cycles,
            rate=None if options.rate is None else parse_quantity(options.rate, "speed", "--rate"))
        with bar(len(voltages.film) * (1 if case.rate is None else 2)) as progress:
            result = force(case, read_settings(options), progress)
    finish(options, _banded(options, result, specimen, rig))


@command("sense", SPECIMEN,
         argument("--mass", metavar="MASSES",
                  help='loads whose equilibria are told, such as "10 g, 20 g"; deflections go a '
                       "little further than theirs (default: loads that suit the film)"),
         argument("--voltage", default="0 kV",
                  help='at which deflection is sensed, such as "0 kV, 2 kV, 3 kV"'),
         argument("--from", default="0 mm", metavar="LENGTH", help="first deflection"),
         argument("--to", metavar="LENGTH", help='last deflection, such as "6 mm"'),
         argument("--points", type=int, default=21, metavar="N", within=(5, 1000),
                  help="rows of the table of each voltage"),
         argument("--sensing", metavar="NAMES",
                  help='segments whose capacitances give deflection and tilts, such as "A, B, C" '
                       "(default: all, if there are three)"),
         argument("--tilt", metavar="ANGLE",
                  help='largest tilt along x and y that they sense, such as "10 mrad" (default: '
                       "the plate's edge moves by a tenth of the last deflection)"),
         argument("--noise", type=float, metavar="SHARE",
                  help="standard deviation of the capacitance of a segment, over it (default: "
                       "0.001)"),
         PRESSURE, RIG,
         output("also store the table (CSV), the numbers (JSON), the polynomial as a C function "
                "and a picture (PNG, SVG)"), JSON, MESH,
         example='oval.toml --mass "20 g" --voltage "0 kV, 3 kV" -o sense',
         also=("capacitance", "sensor", "self-sensing"))
def sense(options: argparse.Namespace) -> None:
    """Compute capacitance against deflection at several voltages, and the inverse.

    The inverse is a table and a polynomial with its largest error. The output also shows how far an
    error of the capacitance, the prestretch or the permittivity moves the sensed deflection.
    """
    from tympan.progress import bar
    from tympan.studies.sense import SenseCase, sense

    specimen, rig = read_mounted(options, driven=False)
    voltages = read_voltages(options)
    with naming_options(options):
        case = SenseCase(
            specimen, voltages=voltages.film, segment_voltages=voltages.segments, rig=rig,
            points=options.points,
            masses=parse_quantities(options.mass or "", "mass", "--mass"),
            start=parse_quantity(getattr(options, "from"), "length", "--from"),
            to=None if options.to is None else parse_quantity(options.to, "length", "--to"),
            sensing=tuple(filter(None, map(str.strip, (options.sensing or "").split(",")))),
            tilt=None if options.tilt is None else parse_quantity(options.tilt, "angle", "--tilt"),
            noise=options.noise)
        with bar(case.steps) as progress:
            result = sense(case, read_settings(options), progress)
    finish(options, result)


@command("steer", SPECIMEN,
         argument("--mass", help='of plate, hook and weight, such as "17.9 g"'),
         argument("--voltage", help='of each segment by its name: "A = 0 kV..3 kV in 21, B = 0 kV..'
                                    '3 kV in 21, C = 1 kV"; all combinations are solved, and '
                                    "segments without a voltage have none (default: all segments "
                                    "up to 80 % of the first limit)"),
         PRESSURE, RIG,
         output("also store the map (CSV), the numbers (JSON) and a picture (PNG, SVG)"), JSON,
         MESH,
         example='quarters.toml --mass "17.9 g" --voltage "A = 0 kV..3 kV, B = 0 kV..3 kV" '
                 "-o steer",
         also=("tilt", "reach", "workspace", "map of voltages"))
def steer(options: argparse.Namespace) -> None:
    """Map the plate's deflection and tilts over the voltages of an electrode's segments.

    The map has every combination of the voltages, with the limit that a film is beyond and the
    segment where it begins. It is solved by reduced films, and has their errors.
    """
    from tympan.studies.case import NO_MASS
    from tympan.studies.steer import SteerCase, steer

    specimen, rig = read_mounted(options, driven=False)
    if options.mass is None and specimen.plate is not None:
        raise InputError(NO_MASS, key="--mass")
    with naming_options(options), waiting("films"):
        case = SteerCase(specimen, voltages=options.voltage, rig=rig,
                         mass=parse_quantity(options.mass or "0 g", "mass", "--mass"))
        result = steer(case, read_settings(options))
    finish(options, result)


@command("tolerance", SPECIMEN,
         argument("--tolerances", type=Path, metavar="FILE",
                  help="standard deviations, as docs/howto/tolerance.md has them (default: those "
                       "of the film's material, and assumed ones)"),
         argument("--want", metavar="BOUNDS", default="",
                  help='bounds of which is said how many films keep them, as in [want] of '
                       '`tympan design`: "stroke = 2 mm, deflection = at most 6 mm" (default: '
                       "those of the table [want] of the tolerances file)"),
         argument("--mass", help='of plate, hook and weight, such as "17.9 g" (default: one that '
                                 "suits the film)"),
         argument("--voltage", help='which the films must reach, such as "3.5 kV" (default: 60 % '
                                    "of the film's first limit)"),
         argument("--films", type=int, default=10_000, metavar="N", within=(100, 1_000_000),
                  help="how many are drawn, about"),
         argument("--seed", type=int, default=0, metavar="N", within=SEEDS,
                  help="of the random numbers"),
         PRESSURE, RIG,
         output("also store the numbers (JSON) and a picture (PNG, SVG)"), JSON, MESH,
         example='oval.toml --mass "17.9 g" --voltage "3.5 kV" -o tolerance',
         also=("monte-carlo", "scatter", "uncertainty", "spread"))
def tolerance(options: argparse.Namespace) -> None:
    """Compute distributions of deflection, stroke, force, frequency and others between films.

    The output has median, 5 and 95 % of the films, the share that bears the voltage, the limits of
    the others, the share that keeps wanted bounds, and each tolerance's share of the variance.
    """
    from tympan.progress import bar
    from tympan.studies.films.first_limits import label_of
    from tympan.studies.tolerance.given import Tolerances, asked_bounds
    from tympan.studies.tolerance.tolerance import ToleranceCase, tolerance
    from tympan.studies.wanted import by_column

    specimen, rig = read_mounted(options)
    given = Tolerances() if options.tolerances is None else Tolerances.read(options.tolerances)
    with naming_options(options), naming_file(options.tolerances):
        case = ToleranceCase(
            specimen, tolerances=given, films=options.films, seed=options.seed, rig=rig,
            wanted=asked_bounds(options.tolerances, options.want),
            mass=None if options.mass is None else parse_quantity(options.mass, "mass", "--mass"),
            voltage=None if options.voltage is None
            else parse_quantity(options.voltage, "voltage", "--voltage"))
    with naming_options(options), bar(1) as progress:
        result = tolerance(case, read_settings(options), progress)
    finish(options, result, quantities=by_column(), label_of=label_of)


@command("path",
         *case_arguments(mass="of plate, hook and weight at the start",
                         voltage="across the film at the start"),
         argument("--along", choices=("voltage", "charge", "mass", "pressure"), default="voltage",
                  help="what grows; a gas pressure lifts the film, one below 0 falls further"),
         argument("--rate", metavar="RATE",
                  help='in time instead, up and down again at a rate such as "100 V/s": the loop '
                       "of a film with viscous branches"),
         argument("--turn", metavar="VOLTAGE", formerly="--to",
                  help="where such a loop turns (default: 95 % of the film's first limit at "
                       "rest)"),
         argument("--fields", action="store_true",
                  help="also store the film at every station, or at 25 moments of a loop, as a "
                       "series for ParaView (VTU, PVD)"),
         _BEYOND,
         output("also store the stations (CSV), a picture (PNG, SVG), the numbers, fields and "
                "critical mode at each limit point (VTU)"), JSON,
         example='oval.toml --mass "17.9 g" -o path', also=("hysteresis", "loop", "snap-through"))
def path(options: argparse.Namespace) -> None:
    """Follow equilibria through limit points, stable or not, by arc length; or a loop in time."""
    from tympan import solving
    from tympan.progress import bar

    case = read_case(options)
    if options.fields and options.output is None:
        raise InputError("must be given to say where the fields go", key="-o")
    with naming_options(options), bar(1) as progress:
        result = solving.follow(case, read_settings(options), options.along, options.rate,
                                options.turn, options.fields, options.beyond, progress)
    if options.rate is not None:
        options.command = "transient"  # stored, drawn and printed as one
    finish(options, result)


@command("modes",
         *case_arguments(mass="of the plate with its weight", voltage="held across the film"),
         argument("--point-mass", default="0 g", metavar="MASS",
                  help="part of the mass that sits in the plate's centre; the rest is spread "
                       "evenly over the plate"),
         argument("--count", type=int, default=6, metavar="N", within=(1, 100), help="how many"),
         argument("--animate", action="store_true",
                  help="also draw them swinging, with -o (GIF; MP4 where FFmpeg is)"),
         output("also store shapes (VTU), a picture (PNG, SVG) and the numbers"), JSON,
         example='oval.toml --mass "17.9 g" --voltage "3.5 kV" -o modes',
         also=("frequency", "resonance", "vibration", "eigenfrequencies"))
def modes(options: argparse.Namespace) -> None:
    """Solve natural frequencies and shapes under one load and voltage."""
    from tympan.studies.modes import modes

    point_mass = parse_quantity(options.point_mass, "mass", "--point-mass")
    if options.animate and options.output is None:
        raise InputError("must be given to say where the pictures go", key="-o")
    case, settings = read_case(options), read_settings(options)
    with waiting("equilibrium and modes"):
        result = modes(case, settings, options.count, point_mass)
    moving: list[Moving] = []
    if options.animate and result.film is not None:
        from tympan.reports.figures.modes import animate_modes

        moving = [(options.output / f"{result.specimen}-modes.gif", partial(animate_modes, result))]
    finish(options, result, moving)


@command("sensitivity", *case_arguments(),
         argument("--of", default="heave", metavar="NAMES",
                  help="results, with commas between: heave, tilt, reaction, capacitance, energy, "
                       "max_stretch, max_true_stress, max_field (default: %(default)s); past "
                       "pull-in, the pull-in load"), JSON,
         example='oval.toml --mass "17.9 g" --voltage "3.5 kV" --of heave,max_field')
def sensitivity(options: argparse.Namespace) -> None:
    """Differentiate results exactly by every number that they depend on."""
    from tympan.studies.sensitivity import sensitivity

    names = tuple(name.strip() for name in options.of.split(","))
    case, settings = read_case(options), read_settings(options)
    with waiting("equilibrium and derivatives"):
        result = sensitivity(case, settings, names)
    # A quantity that is zero has no percentage, and comes last.
    strongest_first = {quantity: sorted(answers.by.items(),
                                        key=lambda item: -abs(item[1].elasticity or 0.0))
                       for quantity, answers in result.quantities.items()}
    print_record(options, result.json(), result=result, strongest_first=strongest_first)
