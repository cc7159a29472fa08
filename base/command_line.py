"""Command lines that a user may copy: whatever a file is called, a shell runs nothing else."""

from __future__ import annotations

import shlex


def command_line(*words: str) -> str:
    """A ``tympan`` command made from its words, each quoted for a POSIX shell where needed.

    Every command that a page, a text or a message offers is made here.

    Examples
    --------
    >>> command_line("solve", "my film;$(id).toml", "--mass", "1 g")
    "tympan solve 'my film;$(id).toml' --mass '1 g'"
    """
    return shlex.join(("tympan", *words))


def file_word(name: str) -> str:
    """A file's name as a word of a command, which no command takes for an option.

    Examples
    --------
    >>> file_word("oval.toml"), file_word("-o.toml")
    ('oval.toml', './-o.toml')
    """
    return f"./{name}" if name.startswith("-") else name
