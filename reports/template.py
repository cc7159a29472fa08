"""Pages and sentences: Jinja templates, their numbers, and pictures embedded in them."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Callable
from importlib import resources
from math import isfinite
from pathlib import Path
from typing import Any

import jinja2


def template(name: str, **filters: Callable[[Any], str]) -> jinja2.Template:
    """A template by its path within tympan, such as "reports/study/report.html".

    :func:`digits`, :func:`percent` and the given filters write its numbers; text put into a page,
    not into sentences (.txt), is escaped.
    """
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(text_of), autoescape=jinja2.select_autoescape(("html",)),
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"digits": digits, "percent": percent, **filters}
    environment.globals["css"] = text_of("reports/page.css")
    return environment.get_template(name)


def sentence(words: jinja2.Template, part: str, *values: Any) -> str:
    """What the macro ``part`` of a template says about values, on one line."""
    macro = getattr(words.module, part)
    return re.sub(r"[ \n]+", " ", str(macro(*values))).strip()


def embedded_picture(file: Path) -> str:
    """A picture's file as a data URI."""
    kind = {".png": "image/png", ".svg": "image/svg+xml"}[file.suffix]
    return f"data:{kind};base64,{b64encode(file.read_bytes()).decode()}"


def text_of(name: str) -> str:
    """A file of tympan's own, by its path within it."""
    return resources.files("tympan").joinpath(name).read_text(encoding="utf-8")


def digits(value: float | None, count: int = 3) -> str:
    """A number with ``count`` significant digits; from 0.0001 to a million without powers of ten.

    Examples
    --------
    >>> digits(2.17595), digits(9.996), digits(1234.5), digits(0.0), digits(None), digits(3e-9)
    ('2.18', '10.0', '1234', '0', '—', '3.00e−9')
    """
    if value is None or not isfinite(value):
        return "\N{EM DASH}"
    if value == 0:
        return "0"
    # The power of ten after rounding: 9.996 has three digits in "10.0".
    mantissa, power = f"{value:.{count - 1}e}".split("e")
    if not 1e-4 <= abs(value) < 1e6:
        return f"{mantissa}e{int(power)}".replace("-", "\N{MINUS SIGN}")
    decimals = max(0, count - 1 - int(power))
    return f"{value:.{decimals}f}".replace("-", "\N{MINUS SIGN}")


def percent(share: float | None) -> str:
    r"""A share in per cent with two significant digits; below a millionth it is called that.

    Examples
    --------
    >>> percent(0.0278), percent(2.66e-5), percent(4e-10), percent(0.5704), percent(None)
    ('2.8\u202f%', '0.0027\u202f%', '< 0.0001\u202f%', '57\u202f%', '—')
    """
    if share is None or not isfinite(share):
        return "\N{EM DASH}"
    number = "< 0.0001" if 0 < abs(share) < 1e-6 else digits(share * 100, 2)
    return f"{number}\N{NARROW NO-BREAK SPACE}%"
