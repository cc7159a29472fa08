"""Gas pressures that no film bears, and those that one does not bear."""

from __future__ import annotations

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import GOOD, LOADS, SOLVE, of_sweep

_RANGE = "must be from -100 to 100 MPa"


@group("gas")
def gas() -> Cases:
    """One message where the pressure makes no sense, an answer where it is merely too high."""
    for name, pressure in (("too high", "1e12 Pa"), ("too low", "-1e12 Pa")):
        yield Case(f"{name} in a rig", f"{SOLVE} --rig rig.toml",
                   GOOD | {"rig.toml": f'gas_pressure = "{pressure}"\n'},
                   rf"rig\.toml: gas_pressure: given '{pressure}': {_RANGE}")
        yield Case(f"{name} by option", f"{SOLVE} --pressure='{pressure}'", GOOD,
                   f"--pressure: given '{pressure}': {_RANGE}")
    yield Case("no number", f"{SOLVE} --pressure inf", GOOD, "--pressure: given 'inf'")
    yield Case("a length", f"{SOLVE} --pressure '2 mm'", GOOD, "--pressure: given '2 mm'")
    yield of_sweep("in a sweep", LOADS + '[rig]\ngas_pressure = "1 TPa"\n', _RANGE)
    yield Case("path", "path specimen.toml --mass '1 g' --along pressure --pressure '1 TPa'", GOOD,
               _RANGE)
    for name, pressure in (("bursts", "50 MPa"), ("sucked in", "-50 MPa")):
        yield Case(name, f"{SOLVE} --pressure='{pressure}' --json", GOOD, status=0,
                   shows='"status": "(no_equilibrium|not_converged)"')
