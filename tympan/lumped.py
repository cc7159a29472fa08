"""``tympan lumped``: the paper's lumped model, simulated and identified."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan import lumped_build, lumped_paper
from tympan.options import command, parse_quantity, read_rig

if TYPE_CHECKING:
    from geometry.specimen import Specimen
    from studies.dataset import Dataset
    from studies.lumped.dynamic_search import DynamicFit
    from studies.lumped.record import Simulated
    from studies.lumped.signals import Signal
    from studies.lumped.static_search import StaticFit


def add(commands: Any) -> None:
    """The command and its subcommands."""
    words = "the paper's lumped model: a mass on circles of film"
    parser = commands.add_parser("lumped", help=words, description=words[0].upper() + words[1:] + ".")
    kinds = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    _simulate(kinds)
    _identify(kinds)
    lumped_build.add(kinds)
    lumped_paper.add(kinds)


def _simulate(kinds: Any) -> None:
    parser = command(kinds, "simulate", _run_simulate, "response to a step, ramp, sine, random steps or a CSV file")
    parser.add_argument("specimens", type=Path, nargs="*", metavar="SPECIMEN.toml")
    parser.add_argument("--model", type=Path, nargs="+", default=[], metavar="NAME.lumped.toml",
                        help="models that `tympan lumped build` made, instead of specimens or beside them")
    parser.add_argument("--signal", default="step", metavar="KIND",
                        help="step, ramp (up and down), sine, random, or a CSV file with t_s, voltage_kV "
                             "(default: %(default)s)")
    parser.add_argument("--low", default="0 kV", help="before the step; lower end of the others (default: %(default)s)")
    parser.add_argument("--high", default="3.5 kV", help="after the step; upper end (default: %(default)s)")
    parser.add_argument("--duration", default="30 s", help="of step and ramp; of each random level; period of a sine "
                                                           "(default: %(default)s)")
    parser.add_argument("--count", type=int, metavar="N", help="random levels (default: 20); cycles of a sine (3)")
    parser.add_argument("--seed", type=int, default=0, help="of the random levels (default: %(default)s)")
    parser.add_argument("--interval", default="1 ms", help="between samples written (default: %(default)s)")
    parser.add_argument("--mass", default="17.9 g", help="on the plate (default: %(default)s)")
    parser.add_argument("--alpha", metavar="A,B", help="weights of the circles with the short and the long semi-axis, "
                                                       "as `tympan alpha` finds them (default: equal)")
    parser.add_argument("--table-1", type=float, metavar="EPS_R", dest="permittivity",
                        help="the paper's Eq. (8) with Table 1's constants instead of the films' material; its ε_r, "
                             "lost in the paper, must be given")
    parser.add_argument("--rig", type=Path, metavar="RIG.toml", help="gravity, spring, amplifier and sensor")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR",
                        help="write transient.csv, simulate.json and figures")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run_simulate(options: argparse.Namespace) -> None:
    from studies.lumped.dynamics import simulate
    from studies.lumped.model import Actuator
    from studies.lumped.record import Simulated, simulated_json, write_simulated
    from studies.lumped.stored import read_model
    from tympan.progress import bar

    mass = parse_quantity(options.mass, "mass", "--mass")
    interval = _positive(options.interval, "--interval")
    signal, period = _signal(options)
    rig, weights = read_rig(options.rig), _weights(options.alpha)
    found: list[Simulated] = []
    models = [read_model(file) for file in options.model]
    for model in models:
        model.check(rig.film_voltage(signal.peak))
    actuators = [*(Actuator.of(specimen, mass, weights, rig=rig) for specimen in _specimens(options)),
                 *(model.actuator(mass, rig) for model in models)]
    _distinct([actuator.specimen.name for actuator in actuators])
    with bar(len(actuators)) as progress:
        for number, actuator in enumerate(actuators):
            progress(actuator.specimen.name)
            found.append(Simulated(simulate(actuator, signal), interval, period, options.signal == "step",
                                   weights is None and number < len(actuators) - len(models)))
    result = simulated_json(found)
    if options.output is not None:
        from reports.lumped import draw_simulated

        write_simulated(found, result, options.output)
        draw_simulated(found, options.output)
    if options.json:
        print(json.dumps(result, ensure_ascii=False, allow_nan=False))
    else:
        _show(result)


def _show(result: dict[str, Any]) -> None:
    for one in result["responses"]:
        settled = one["settling_time_s"]
        print(f"{one['specimen']}, {1e3 * one['mass_kg']:g} g: {1e3 * one['first_m']:.4f} to "
              f"{1e3 * one['last_m']:.4f} mm, range {1e3 * one['range_m']:.4f} mm"
              + ("" if settled is None else f", oscillation gone after {settled:.2f} s"))
        for words in one["warnings"]:
            print(f"warning: {words}")


def _specimens(options: argparse.Namespace) -> list[Specimen]:
    from fem.library import load_specimen
    from geometry.errors import InputError
    from studies.lumped.table1 import eq8

    specimens = [load_specimen(file) for file in options.specimens]
    if options.permittivity is None:
        return specimens
    if not 1 <= options.permittivity <= 1000:
        raise InputError("must be at least 1 (vacuum) and at most 1000", key="--table-1", given=options.permittivity)
    return [eq8(specimen, options.permittivity) for specimen in specimens]


def _distinct(names: list[str]) -> None:
    from geometry.errors import InputError

    if not names:
        raise InputError("give a specimen, or a model with --model", key="SPECIMEN.toml")
    if len(set(names)) < len(names):
        raise InputError("specimens must have different names", key="name", given=", ".join(names))


def _signal(options: argparse.Namespace) -> tuple[Signal, float | None]:
    """The signal, and the period if it has one [s]."""
    from geometry.errors import InputError
    from studies.lumped import signals

    low = parse_quantity(options.low, "voltage", "--low")
    high = parse_quantity(options.high, "voltage", "--high")
    duration = _positive(options.duration, "--duration")
    if options.count is not None and not 1 <= options.count <= 10_000:
        raise InputError("must be from 1 to 10000", key="--count", given=options.count)
    if options.signal == "step":
        return signals.step(low, high, 0.0, duration), None
    if options.signal == "ramp":
        return signals.ramp(low, high, duration), None
    if options.signal == "random":
        return signals.random_steps(low, high, duration, options.count or 20, options.seed), None
    if options.signal == "sine":
        return signals.Sine((low + high) / 2, (high - low) / 2, duration, options.count or 3), duration
    if not options.signal.endswith(".csv"):
        raise InputError("must be step, ramp, sine, random or the name of a .csv file", key="--signal",
                         given=options.signal)
    return signals.read_signal(options.signal), None


def _weights(text: str | None) -> tuple[float, ...] | None:
    from geometry.errors import InputError

    if text is None:
        return None
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError("must be numbers with a comma between them, such as 0.6,0.4", key="--alpha",
                         given=text) from None


def _positive(text: str, option: str) -> float:
    from geometry.errors import InputError

    value = parse_quantity(text, "time", option)
    if not 0 < value < 1e9:
        raise InputError("must be positive", key=option, given=text)
    return value


def _identify(kinds: Any) -> None:
    parser = command(kinds, "identify", _run_identify, "the constants behind a dataset's readings")
    parser.add_argument("dataset", type=Path, metavar="DATASET",
                        help="folder with dataset.toml and static.csv, transient.csv or both")
    parser.add_argument("--dynamic", action="store_true",
                        help="also k1, eta1 and eta2 from the responses of transient.csv, Eq. (12); the static "
                             "constants are those of static.csv or, where there is none, the films' own")
    parser.add_argument("--law", choices=("eq8", "film"), default="eq8",
                        help="the paper's Eq. (8), or one factor on the films' own material (default: %(default)s)")
    parser.add_argument("--alpha", choices=("each", "shared"), default="each",
                        help="an α of the circle with the short semi-axis for each shape, or one for all as in "
                             "Eq. (11) (default: %(default)s)")
    parser.add_argument("--weights", metavar="A,B",
                        help="both α of all shapes, for --dynamic without static.csv (default: equal)")
    parser.add_argument("--objective", choices=("deflection", "force", "printed"), default="deflection",
                        help="misfit in deflection, in force as Eq. (11) with the signs of Eq. (5), or as printed "
                             "(default: %(default)s)")
    parser.add_argument("--nelder-mead", action="store_true", help="also the paper's simplex, to compare")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="write identify.json and figures")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run_identify(options: argparse.Namespace) -> None:
    from studies.dataset import read_dataset
    from studies.store import write_json

    dataset = read_dataset(options.dataset)
    result: dict[str, Any] = {"dataset": dataset.name}
    static = _fit_static(dataset, options, result)
    dynamic = _fit_dynamic(dataset, static, options, result) if options.dynamic else None
    if options.output is not None:
        from reports.identified import draw_correlations, draw_dynamic, draw_profiles, draw_static

        write_json(options.output / "identify.json", result)
        if static is not None:
            draw_static(static, options.output)
        if dynamic is not None:
            draw_dynamic(dynamic, options.output)
        for name, fit in (("", static), ("-dynamic", dynamic)):
            if fit is not None:
                draw_profiles(fit.judgement, options.output, f"profiles{name}")
                draw_correlations(fit.judgement, options.output, f"correlations{name}")
    if options.json:
        print(json.dumps(result, ensure_ascii=False, allow_nan=False))
        return
    for kind in ("static", "dynamic"):
        if kind in result:
            _show_fit(f"{dataset.name}, {kind}", result[kind], result.get(f"nelder_mead_{kind}"))


def _fit_static(dataset: Dataset, options: argparse.Namespace, result: dict[str, Any]) -> StaticFit | None:
    from geometry.errors import InputError
    from studies.lumped.static_fit import StaticProblem, readings_of
    from studies.lumped.static_search import identify_static, nelder_mead

    if options.dynamic and dataset.static is None:
        return None
    if options.weights is not None:
        raise InputError("is for --dynamic without static.csv, whose readings tell α", key="--weights",
                         given=options.weights)
    problem = StaticProblem(readings_of(dataset), options.law, options.alpha)
    fit = identify_static(problem, options.objective)
    result["static"] = fit.json()
    if options.nelder_mead:
        result["nelder_mead_static"] = nelder_mead(problem)
    return fit


def _fit_dynamic(dataset: Dataset, static: StaticFit | None, options: argparse.Namespace, result: dict[str, Any]
                 ) -> DynamicFit:
    from studies.lumped.dynamic_fit import DynamicProblem, Exact, Held
    from studies.lumped.dynamic_search import identify_dynamic, nelder_mead_dynamic
    from studies.lumped.records import records_of

    statics = Exact(dataset.specimens, dataset.rig, _weights(options.weights)) if static is None else Held(static)
    problem = DynamicProblem(statics, dataset.rig, records_of(dataset), dataset.noise)
    fit = identify_dynamic(problem)
    result["dynamic"] = fit.json()
    if options.nelder_mead:
        result["nelder_mead_dynamic"] = nelder_mead_dynamic(problem)
    return fit


def _show_fit(title: str, found: dict[str, Any], other: dict[str, Any] | None) -> None:
    print(f"{title}: misfit {found['rmse_um']:.3g} um (noise {found['noise_um']:.3g} um); "
          f"{found['determined']} of {len(found['constants'])} numbers are determined")
    _show_constants(found)
    if other is not None:
        print(f"Nelder-Mead: misfit {other['rmse_um']:.3g} um, {other['evaluations']} evaluations, "
              f"{other['seconds']:.2f} s; least squares: {found['evaluations']}, {found['seconds']:.2f} s")


def _show_constants(found: dict[str, Any]) -> None:
    for one in found["constants"]:
        limits = "not determined by these data" if one["low"] is None else f"{one['low']:.6g} to {one['high']:.6g}"
        print(f"  {one['name']:<28}{one['value']:>14.6g} {'' if one['unit'] == '1' else one['unit']:<5}{limits}")
    for words in found["warnings"]:
        print(f"warning: {words}")
