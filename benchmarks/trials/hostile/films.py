"""Films that are legal and extreme: every command ends soon, with an answer or a reason."""

from __future__ import annotations

from benchmarks.trials.hostile.case import Case, Cases, group

_STIFF = """name = "stiff"
frame = { shape = "circle", radius = "45 mm" }
plate = { shape = "circle", radius = "1 cm" }
[membrane]
thickness = "2 mm"
prestretch = [1.05, 1.05]
relative_permittivity = 4.7
material = { law = "neo_hooke", mu = "100 MPa" }
"""
_GENT = """name = "gent"
frame = { shape = "circle", radius = "45 mm" }
plate = { shape = "circle", radius = "1 cm" }
[membrane]
thickness = "1 mm"
prestretch = [2.9, 2.9]
relative_permittivity = 4.7
material = { law = "gent", mu = "20 kPa", j_lim = 15 }
"""
_DISK = """name = "disk"
frame = { shape = "circle", radius = "12.5 mm" }
plate = { shape = "circle", radius = "5 mm" }
electrode = { margin_frame = "1 mm" }
[membrane]
thickness = "50 um"
prestretch = [1.2, 1.2]
relative_permittivity = 2.8
material = { law = "ogden", mu = ["0.4 MPa"], alpha = [2] }
"""
_MAGNET = """guide = "vertical"
[[bias]]
law = "magnet"
force = "0.3 N"
gap = "1.5 mm"
decay = "1 mm"
"""


def _slender(frame: str, plate: str, offset: str, film: str, law: str) -> str:
    return (f'name = "slender"\n[frame]\n{frame}\n'
            f'[plate]\nshape = "ellipse"\nsemi_axes = {plate}\noffset = ["{offset}", "0 mm"]\n'
            f"[membrane]\n{film}\nmaterial = {law}\n")


#: Films whose load took more than 100 s of processor time to raise, with their command's loads.
_ENDLESS = {
    "--mass '10 kg' --voltage '100 kV'": _slender(
        'shape = "ellipse"\nsemi_axes = ["20 mm", "1 mm"]', '["0.242898 mm", "0.169971 mm"]',
        "0 mm", 'thickness = "1 mm"\nprestretch = [1, 3]\nrelative_permittivity = 12',
        '{ law = "mooney_rivlin", c10 = "20 kPa", c01 = "0.1 kPa" }'),
    "--mass '10 kg' --voltage '30 kV' --pressure '200 Pa'": _slender(
        'shape = "ellipse"\nsemi_axes = ["45 mm", "2.25 mm"]', '["1.32989 mm", "1.08173 mm"]',
        "0.276032 mm",
        'thickness = "100 um"\nprestretch = [1.05, 1.05]\nrelative_permittivity = 1000',
        '{ law = "ogden", mu = ["100 MPa"], alpha = [1.8] }'),
    "--mass '0 g' --voltage '8 kV'": _slender(
        'shape = "ellipse"\nsemi_axes = ["100 mm", "5 mm"]', '["1.05998 mm", "0.627615 mm"]',
        "1.18201 mm", 'thickness = "1 mm"\nprestretch = [1, 3]\nrelative_permittivity = 12',
        '{ law = "neo_hooke", mu = "20 kPa" }'),
    "--mass '1 kg' --voltage '8 kV'": _slender(
        'shape = "circle"\nradius = "45 mm"', '["17.8832 mm", "8.90225 mm"]', "-24.4051 mm",
        'thickness = "100 um"\nprestretch = [4, 2]\nrelative_permittivity = 2.8',
        '{ law = "arruda_boyce", mu = "20 kPa", lambda_lock = 7.0 }\n'
        '[electrode]\nmargin_frame = "2.25 mm"'),
}
#: Not a number in a result, a negative zero, or a place that rounding alone moved off an axis.
_ODD = r"Traceback|NaN|\bnan\b|-0\.0+ mm|e-1\d mm"


@group("extreme films")
def extreme_films() -> Cases:
    stiff = {"stiff.toml": _STIFF}
    for command in ("solve", "limits", "curve"):
        yield Case(f"stiff, {command}", f"{command} stiff.toml --mass '100 g'", stiff, status=0,
                   never=f"{_ODD}|given '")
    gas = 'gas_pressure = "1e12 Pa"\n'
    yield Case("gas of 1e12 Pa", "limits stiff.toml --mass '1 g' --rig rig.toml",
               {**stiff, "rig.toml": gas}, "rig.toml: gas_pressure: .*must be from -100 to 100 MPa")
    yield Case("Gent near its lock", "limits gent.toml --mass '1 kg'", {"gent.toml": _GENT},
               status=0, never=f"{_ODD}|ValueError", seconds=60.0)
    for loads, film in _ENDLESS.items():
        yield Case(f"endless, {loads}", f"solve film.toml {loads}", {"film.toml": film}, status=0,
                   never=_ODD, seconds=60.0)
    yield Case("aspect 20 at 100 kV, lumped", "lumped build film.toml -o out --mass '10 kg' "
               "--voltage '0 kV..100 kV'", {"film.toml": next(iter(_ENDLESS.values()))},
               "the field model", never=_ODD, seconds=60.0)
    yield Case("magnet before any voltage", "solve disk.toml --mass '10 g' --voltage '2.5 kV' "
               "--rig mag.toml", {"disk.toml": _DISK, "mag.toml": _MAGNET}, status=0,
               never=f"{_ODD}|no pull-in was found: the film pulls in")
    for command in ("solve", "limits"):
        yield Case(f"places, {command}", f"{command} disk.toml --mass '1 g'", {"disk.toml": _DISK},
                   status=0, never=_ODD)
