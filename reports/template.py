"""Pages and sentences: Jinja templates, their numbers, and pictures embedded in them."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Callable
from hashlib import sha256
from importlib import resources
from math import isfinite
from pathlib import Path
from typing import Any

import jinja2


def template(name: str, **filters: Callable[..., Any]) -> jinja2.Template:
    """Load a template by its path within tympan, such as "reports/study/report.html".

    :func:`digits`, :func:`percent` and the given filters write its numbers. Text put into a page,
    but not into sentences (.txt), is escaped. A whole page gets its security policy.
    """
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(text_of), autoescape=jinja2.select_autoescape(("html",)),
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"digits": digits, "percent": percent, **filters}
    environment.template_class = _Page
    environment.globals["css"] = text_of("reports/page.css")
    return environment.get_template(name)


class _Page(jinja2.Template):
    """A template that adds a content security policy to its result, if that is a whole page."""

    def render(self, *args: Any, **kwargs: Any) -> str:
        return with_policy(super().render(*args, **kwargs))


#: Elements of a page whose text a browser runs or applies; JSON within a script is neither.
_INLINE = re.compile(r"<(script|style)>(.*?)</\1>", re.DOTALL)
#: Place of the policy: before everything that it governs.
_HEAD = '<meta charset="utf-8">\n'


def with_policy(page: str) -> str:
    """Add a Content-Security-Policy to a page, which lets it run only its own scripts.

    Nothing is loaded from elsewhere, and text from a file that looks like a script or a style is
    not applied. A text that is no whole page is not changed.
    """
    if _HEAD not in page:
        return page
    allowed: dict[str, list[str]] = {"script": [], "style": []}
    for element, text in _INLINE.findall(page):
        digest = b64encode(sha256(text.encode()).digest()).decode()
        allowed[element].append(f"'sha256-{digest}'")
    sources = {name: " ".join(sorted(set(hashes))) or "'none'" for name, hashes in allowed.items()}
    rules = (f"default-src 'none'; script-src {sources['script']}; style-src {sources['style']}; "
             "img-src data:; base-uri 'none'; form-action 'none'")
    meta = f'<meta http-equiv="Content-Security-Policy" content="{rules}">\n'
    return page.replace(_HEAD, _HEAD + meta, 1)


def sentence(words: jinja2.Template, part: str, *values: Any) -> str:
    """Fill the macro ``part`` of a template with values, to a sentence on one line."""
    macro = getattr(words.module, part)
    return re.sub(r"[ \n]+", " ", str(macro(*values))).strip()


def embedded_picture(file: Path) -> str:
    """Encode a picture's file as a data URI."""
    kind = {".png": "image/png", ".svg": "image/svg+xml"}[file.suffix]
    return f"data:{kind};base64,{b64encode(file.read_bytes()).decode()}"


def text_of(name: str) -> str:
    """Read a file of tympan's own, by its path within it."""
    return resources.files("tympan").joinpath(name).read_text(encoding="utf-8")


def digits(value: float | None, count: int = 3) -> str:
    """Write ``count`` significant digits; from 0.0001 to a million without powers of ten.

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
    r"""Write a share in per cent with two significant digits; below a millionth "< 0.0001 %".

    Examples
    --------
    >>> percent(0.0278), percent(2.66e-5), percent(4e-10), percent(0.5704), percent(None)
    ('2.8\u202f%', '0.0027\u202f%', '< 0.0001\u202f%', '57\u202f%', '—')
    """
    if share is None or not isfinite(share):
        return "\N{EM DASH}"
    number = "< 0.0001" if 0 < abs(share) < 1e-6 else digits(share * 100, 2)
    return f"{number}\N{NARROW NO-BREAK SPACE}%"
