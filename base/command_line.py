"""Command lines that a user may copy: whatever a file is called, a shell runs nothing else."""

from __future__ import annotations

import shlex


def command_line(*words: str) -> str:
    """Make a ``tympan`` command from its words, each quoted for a POSIX shell where needed.

    Every command that a page, a text or a message offers is made here.

    Examples
    --------
    >>> command_line("solve", "my film;$(id).toml", "--mass", "1 g")
    "tympan solve 'my film;$(id).toml' --mass '1 g'"
    """
    return shlex.join(("tympan", *words))


def file_word(name: str) -> str:
    """Write a file's name as a word of a command that no command reads as an option.

    Examples
    --------
    >>> file_word("oval.toml"), file_word("-o.toml")
    ('oval.toml', './-o.toml')
    """
    return f"./{name}" if name.startswith("-") else name
