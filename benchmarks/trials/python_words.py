"""Words of Python, which no message of tympan may have."""

from __future__ import annotations

import re

#: Names and sentences of Python and NumPy that a user who does not program cannot read.
_WORDS = re.compile(
    r"Traceback|has no attribute|invalid literal|could not convert|PosixPath|NoneType|<class |"
    r"<object|object at 0x|not subscriptable|not iterable|unsupported operand|__\w+__|\bnp\.\w|"
    r"dtype=|\barray\(|datetime\.|positional argument|keyword argument|out of range|invalid \w+ "
    r"value|\b(?:Type|Value|Key|Index|Attribute|Overflow|Runtime|OS|Unicode\w*)Error\b")
#: What a user has given is quoted, whatever it is.
_QUOTED = re.compile(r"given (?:'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\")")


def words_of_python(message: str) -> str:
    """The first words of Python in a message, but for what it quotes; empty if there are none.

    Examples
    --------
    >>> words_of_python("name: given '__init__': must be a text")
    ''
    >>> words_of_python("file: given PosixPath('a'): must be a text")
    'PosixPath'
    """
    found = _WORDS.search(_QUOTED.sub("", message))
    return found.group() if found else ""
