"""Version number of the JSON schemas, alone here since every command that prints JSON loads it."""

from __future__ import annotations

#: Number that every object of ``--json`` has as its key ``schema``. It grows by 1 when a key is
#: removed, renamed or gets another meaning, unit or kind; a new key leaves it.
SCHEMA_NUMBER = 1
