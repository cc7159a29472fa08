"""Pages: Jinja templates of this package, filled, and pictures embedded in them."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2


def page_template(name: str, **filters: Callable[..., str]) -> jinja2.Template:
    """A template by its path within this package, such as "study/report.html", with filters."""
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(package_text), autoescape=True,
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"sentence_list": sentence_list, **filters}
    environment.globals["css"] = package_text("page.css")
    return environment.get_template(name)


def package_text(name: str) -> str:
    """A file of this package."""
    return resources.files("tympan.reports").joinpath(name).read_text(encoding="utf-8")


def embedded_picture(file: Path) -> str:
    """A picture's file as a data URI."""
    kind = {".png": "image/png", ".svg": "image/svg+xml"}[file.suffix]
    return f"data:{kind};base64,{b64encode(file.read_bytes()).decode()}"


def sentence_list(parts: Any) -> str:
    """Parts with commas and a final "and".

    Examples
    --------
    >>> sentence_list(["a"]), sentence_list(["a", "b"]), sentence_list(["a", "b", "c"])
    ('a', 'a and b', 'a, b and c')
    """
    *first, last = parts or [""]
    return f"{', '.join(first)} and {last}" if first else last
