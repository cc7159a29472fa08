"""Pages and sentences: Jinja templates of this package, filled, and pictures embedded in them."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2

from tympan.reports.scales import digits, percent


def template(name: str, **filters: Callable[[Any], str]) -> jinja2.Template:
    """A template by its path within this package, such as "study/report.html".

    ``digits`` and ``percent`` and the given filters write its numbers; text put into a page, not
    into sentences (.txt), is escaped.
    """
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_text), autoescape=jinja2.select_autoescape(("html",)),
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"digits": digits, "percent": percent, **filters}
    environment.globals["css"] = _text("page.css")
    return environment.get_template(name)


def sentence(words: jinja2.Template, part: str, *values: Any) -> str:
    """What the macro ``part`` of a template says about values, on one line."""
    macro = getattr(words.module, part)
    return re.sub(r"[ \n]+", " ", str(macro(*values))).strip()


def embedded_picture(file: Path) -> str:
    """A picture's file as a data URI."""
    kind = {".png": "image/png", ".svg": "image/svg+xml"}[file.suffix]
    return f"data:{kind};base64,{b64encode(file.read_bytes()).decode()}"


def _text(name: str) -> str:
    return resources.files("tympan.reports").joinpath(name).read_text(encoding="utf-8")
