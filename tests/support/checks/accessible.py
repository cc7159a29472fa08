"""What of a page says nothing to those who do not see it."""

from __future__ import annotations

from html.parser import HTMLParser

_CONTROLS = ("input", "select", "textarea")


def wordless(page: str) -> list[str]:
    """Pictures without alternative text and controls without label, as their tags."""
    reader = _Reader()
    reader.feed(page)
    return [*reader.pictures, *(tag for name, tag in reader.controls if name not in reader.labels)]


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.pictures: list[str] = []
        self.controls: list[tuple[str | None, str]] = []
        self.labels: set[str | None] = set()
        self.depth = 0  # of labels around

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        said, text = dict(attrs), (self.get_starttag_text() or "")[:120]
        words = said.get("alt") if tag == "img" else said.get("aria-label")
        self.depth += tag == "label"
        if tag == "label" and said.get("for"):
            self.labels.add(said["for"])
        if (tag in ("img", "canvas") or said.get("role") == "img") and not (words or "").strip():
            self.pictures.append(text)
        if tag in _CONTROLS and not self.depth and not words:
            self.controls.append((said.get("id"), text))

    def handle_endtag(self, tag: str) -> None:
        self.depth -= tag == "label"
