"""What a field says about itself, once: meaning, unit, limits; reading and writing follow.

A field of a dataclass is declared by its type and a :class:`Key`::

    @dataclass(frozen=True)
    class Spring:
        stiffness: Annotated[float, Key("its stiffness", "stiffness per length", NON_NEGATIVE)]
        rest: Annotated[float, Key("heave at which it is unloaded", "length")] = 0.0

The type is the form: a number, whole number, truth, text or choice (``Literal``); a pair, a list
or a list of points; another declared dataclass, a tuple of them, or one of the kinds of a
:class:`Registry`. ``None`` and other defaults stand where a file leaves the key out. What must hold
between fields is checked by the dataclass itself, in ``__post_init__``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, is_dataclass
from dataclasses import fields as dataclass_fields
from functools import cache, wraps
from inspect import signature
from itertools import zip_longest
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from tympan.geometry.errors import InputError
from tympan.geometry.toml_reader import FINITE, WHOLE, Rule, Table
from tympan.geometry.units import DIMENSIONS, quantity, quantity_text

T = TypeVar("T")
Content = dict[str, Any]

#: Readers that know more than the declaration, by dataclass and field: they get table and key.
Special = Mapping[tuple[type, str], Callable[[Table, str], Any]]


@dataclass(frozen=True, eq=False)
class Key:
    """What a key of a file holds.

    ``dimension`` is one of :data:`tympan.geometry.units.DIMENSIONS`, "" for plain numbers; ``rule``
    the limits of every number; ``name`` the key where it is not the field's name; ``kinds`` what a
    table, or each of a list of tables, may be. ``inline``: the kind's keys stand beside this one's.
    ``needs`` names another key, without which (or where that is 0) this one has no place. A
    ``discrete`` field has no derivatives. ``default`` says what a missing key means, where the
    dataclass finds that out itself.
    """

    meaning: str
    dimension: str = ""
    rule: Rule = FINITE
    name: str = ""
    kinds: Registry[Any] | None = None
    inline: bool = False
    needs: str = ""
    discrete: bool = False
    least: int = 1
    default: str = ""


@dataclass(frozen=True, eq=False)
class Field:
    """A declared field: ``name`` in the dataclass, ``key`` in files, ``kind`` its type but None."""

    name: str
    key: str
    kind: Any
    says: Key
    default: Any

    @property
    def required(self) -> bool:
        """Whether a file must have it."""
        return self.default is MISSING and not self.says.default

    @property
    def several(self) -> bool:
        """Whether it is a tuple."""
        return get_origin(self.kind) is tuple

    @property
    def item(self) -> Any:
        """The type of its parts, or its own."""
        return get_args(self.kind)[0] if self.several else self.kind

    @property
    def count(self) -> int | None:
        """Number of its parts, None for one or any number."""
        parts = get_args(self.kind)
        return len(parts) if self.several and parts[-1] is not Ellipsis else None

    @property
    def discrete(self) -> bool:
        """Whether there are no values between its values."""
        return self.says.discrete or self.item in (int, bool)


def fields_of(cls: Any) -> tuple[Field, ...]:
    """The declared fields of a dataclass, in order."""
    return _fields_of(cls)


@cache
def _fields_of(cls: Any) -> tuple[Field, ...]:
    hints, declared = get_type_hints(cls, include_extras=True), []
    for item in dataclass_fields(cls):
        hint = hints[item.name]
        if get_origin(hint) is not Annotated:
            continue
        kind, *notes = get_args(hint)
        if get_origin(kind) in (Union, UnionType):
            kind, = (part for part in get_args(kind) if part is not NoneType)
        default = item.default if item.default_factory is MISSING else item.default_factory()
        declared += [Field(item.name, says.name or item.name, kind, says, default)
                     for says in notes if isinstance(says, Key)]
    return tuple(declared)


def field_at(value: Any, path: tuple[str, ...]) -> Field | None:
    """The innermost declared field on the way along a path of attributes and element numbers."""
    field = None
    for name in path:
        if isinstance(value, tuple):
            value = value[int(name)]
            continue
        declared = fields_of(type(value)) if is_dataclass(value) else ()
        field = next((item for item in declared if item.name == name), field)
        value = getattr(value, name, None)
    return field


def symbol(field: Field | None) -> str:
    """The SI unit of a field for people, "1" of plain numbers and of what is not declared."""
    dimension = "" if field is None else field.says.dimension
    return DIMENSIONS[dimension].symbol if dimension else "1"


def takes_units(cls: Any) -> Any:
    """Let a declared dataclass also be made of texts with their unit, ``Circle("4.5 cm")``.

    Lists serve as tuples. A text that is no quantity of the field's dimension is an
    :class:`InputError` that names the key.
    """
    of_numbers = cls.__init__
    _, *names = signature(of_numbers).parameters

    @wraps(of_numbers)
    def of_texts(self: Any, *values: Any, **named: Any) -> None:
        declared = {field.name: field for field in fields_of(cls)}
        of_numbers(self, *(_in_si(declared.get(name), value)
                           for name, value in zip_longest(names[:len(values)], values)),
                   **{name: _in_si(declared.get(name), value) for name, value in named.items()})

    cls.__init__ = of_texts
    return cls


def _in_si(field: Field | None, value: Any) -> Any:
    if field is not None and isinstance(value, list | tuple):
        # Outlines have hundreds of numbers: no call for each.
        return tuple([item if isinstance(item, float) else _in_si(field, item) for item in value])
    if field is None or not field.says.dimension or not isinstance(value, str):
        return value
    try:
        return quantity(value, field.says.dimension)
    except InputError as error:
        raise error.located(key=field.key) from None


class Registry(dict[str, T]):
    """All kinds of one thing by the name that files know them by.

    ``tag`` is the attribute of a kind that holds its name, and the key in files that chooses it.
    """

    def __init__(self, tag: str) -> None:
        super().__init__()
        self.tag = tag

    def register(self, kind: Any) -> Any:
        """Make a kind known; serves as decorator. A dataclass then takes units."""
        takes = isinstance(kind, type) and is_dataclass(kind)
        self[getattr(kind, self.tag)] = takes_units(kind) if takes else kind
        return kind

    def read(self, table: Table) -> Any:
        """What a table describes, by the kind's own ``from_table`` if it has one."""
        cls: Any = table.choice(self.tag, self)
        return cls.from_table(table) if hasattr(cls, "from_table") else read(cls, table)

    def write(self, value: Any, plain: bool = False) -> Content:
        """The table that reads back as the value."""
        return {self.tag: getattr(value, self.tag), **write(value, plain)}


def read(cls: type[T], table: Table, special: Special | None = None) -> T:
    """An instance of a declared dataclass from a table, which must hold nothing else."""
    values: Content = {}
    for field in sorted(fields_of(cls), key=lambda item: item.says.inline):
        if special and (cls, field.name) in special:
            values[field.name] = special[cls, field.name](table, field.key)
        elif _stands(field, table, values):
            values[field.name] = _read(field, table, special)
    table.done()
    try:
        return cls(**getattr(cls, "completed", dict)(values))
    except InputError as error:
        if error.file is not None:
            raise
        raw = table.data.get(error.key or "")
        raise type(error)(error.allowed, file=table.file,
                          key=table.path(error.key or "").strip(".") or None,
                          given=raw if isinstance(raw, str | float) else error.given) from None


def write(value: Any, plain: bool = False) -> Content:
    """A declared dataclass as a table that :func:`read` turns into an equal one.

    ``plain``: for a plain :class:`tympan.geometry.toml_reader.Table`.
    """
    content: Content = {}
    for field in fields_of(type(value)):
        part = getattr(value, field.name)
        needed = getattr(value, field.says.needs) if field.says.needs else True
        if part is None or part == () or not needed:
            continue
        written = _written(field.says, part, plain)
        if field.says.inline:
            content |= written
        else:
            suffix = DIMENSIONS[field.says.dimension].suffix if field.says.dimension else ""
            content[field.key + suffix * plain] = written
    return content


def require(value: Any) -> None:
    """Refuse numbers beyond their limits; an imaginary step does not count."""
    for field in fields_of(type(value)):
        holds, words = field.says.rule
        part = getattr(value, field.name)
        for number in part if field.several else (part,):
            if isinstance(number, int | float | complex) and not holds(number.real):
                raise InputError(words, key=field.key, given=part)


def _stands(field: Field, table: Table, values: Content) -> bool:
    says = field.says
    if says.needs and not values.get(says.needs):
        return False
    key = table.spelled(field.key, says.dimension)
    table.asked.add(key)
    return says.inline or key in table or field.required or bool(says.needs)


def _read(field: Field, table: Table, special: Special | None) -> Any:
    says, key, item = field.says, field.key, field.item
    if says.inline and says.kinds is not None:
        return says.kinds.read(table)
    if says.kinds is not None or is_dataclass(item):
        tables = table.tables(key) if field.several else (table.table(key),)
        parts = tuple(says.kinds.read(part) if says.kinds is not None else read(item, part, special)
                      for part in tables)
        return parts if field.several else parts[0]
    if get_origin(item) is Literal:
        return table.choice(key, {name: name for name in get_args(item)})
    if item is str:
        return table.text(key, rule=None if says.rule is FINITE else says.rule)
    if item is bool:
        return table.truth(key)
    if get_origin(item) is tuple:
        return table.places(key, says.least, field.count, says.rule)
    rule = WHOLE if item is int and says.rule is FINITE else says.rule
    numbers = (table.numbers(key, says.dimension, rule=rule, count=field.count) if field.several
               else (table.number(key, says.dimension, rule=rule),))
    whole = tuple(map(int, numbers)) if item is int else numbers
    return whole if field.several else whole[0]


def _written(says: Key, part: Any, plain: bool) -> Any:
    if isinstance(part, tuple):
        return [_written(says, item, plain) for item in part]
    if says.kinds is not None:
        return says.kinds.write(part, plain)
    if is_dataclass(part):
        return write(part, plain)
    if isinstance(part, str | bool):
        return part
    return quantity_text(part, says.dimension) if says.dimension and not plain else float(part)

