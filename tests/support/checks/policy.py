"""What of a page its own Content-Security-Policy would stop, or does not speak of."""

from __future__ import annotations

import base64
import hashlib
from html.parser import HTMLParser


def unlawful(page: str) -> list[str]:
    """Scripts, styles and references that the policy forbids, and directives that are missing."""
    reader = _Reader()
    reader.feed(page)
    if reader.policy is None:
        return ["no policy"]
    rules = {words.split()[0]: words.split()[1:] for words in reader.policy.split(";")}
    wanted = {"default-src": ["'none'"], "base-uri": ["'none'"], "form-action": ["'none'"],
              "img-src": ["data:"]}
    wrong = [f"{name}: {rules.get(name)}" for name, value in wanted.items()
             if rules.get(name) != value]
    for element, text in reader.inline:
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        if f"'sha256-{digest}'" not in rules[f"{element}-src"]:
            wrong.append(f"{element}: {text[:60]}")
    loose = {"'unsafe-inline'", "'unsafe-eval'", "'unsafe-hashes'", "*", "'self'", "https:"}
    return wrong + reader.wrong + sorted(loose & {word for rule in rules.values() for word in rule})


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.policy: str | None = None
        self.inline: list[tuple[str, str]] = []
        self.wrong: list[str] = []
        self.inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        said = dict(attrs)
        if tag == "meta" and said.get("http-equiv") == "Content-Security-Policy":
            self.policy = said["content"]
        if tag in ("script", "style"):
            if self.policy is None:
                self.wrong.append(f"{tag} before the policy")
            if tag == "style" or said.get("type", "text/javascript") != "application/json":
                self.inside = tag
                self.inline.append((tag, ""))
        self.wrong += [f"{tag} {name}" for name, value in attrs
                       if name == "style" or name.startswith("on")
                       or (name == "src" and not (value or "").startswith("data:"))]

    def handle_data(self, data: str) -> None:
        if self.inside:
            tag, text = self.inline[-1]
            self.inline[-1] = tag, text + data

    def handle_endtag(self, tag: str) -> None:
        if tag == self.inside:
            self.inside = ""
