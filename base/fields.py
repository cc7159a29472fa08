"""Declaration of fields of input files and results: meaning, unit and limits, stated once.

A field of a dataclass is declared by its type and a :class:`Key`::

    @dataclass(frozen=True)
    class Spring:
        stiffness: Annotated[float, Key("its stiffness", "stiffness per length", NON_NEGATIVE)]
        rest: Annotated[float, Key("deflection at which it is unloaded", "length")] = 0.0

Reading, writing, the reference pages and the schemas of results follow from it. A result's field
has its unit in its name, ``deflection_m``, as the printed JSON does.

The type determines the form: a number, whole number, truth value, text or choice (``Literal``); a
pair, a list or a list of points; another declared dataclass, a tuple of them, or one of the kinds
of a :class:`Registry`. ``None`` and other defaults apply if a file omits the key. The dataclass
itself checks relations between fields, in ``__post_init__``.
"""

from __future__ import annotations

import builtins
import re
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, is_dataclass
from dataclasses import fields as dataclass_fields
from functools import cache, cached_property, wraps
from inspect import Parameter, Signature, get_annotations, signature, unwrap
from itertools import chain
from math import inf, isfinite
from numbers import Integral, Number
from operator import attrgetter
from os import PathLike
from threading import RLock
from types import MappingProxyType, NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    Self,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from tympan.base.errors import WORKS_STILL, InputError, did_you_mean, one
from tympan.base.toml_reader import A_NUMBER, FINITE, POSITIVE, WHOLE, Rule, Table, one_of
from tympan.base.units import (
    DIMENSIONS,
    LARGEST,
    bounded,
    evenly,
    quantities,
    quantities_text,
    quantity,
    quantity_text,
    span_of,
)

if TYPE_CHECKING:
    from _collections_abc import dict_items, dict_keys, dict_values

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])
Content = dict[str, Any]

#: Message for an empty text, everywhere: it counts as missing.
EMPTY = "is empty: give a value, or leave it out"

#: Special readers by dataclass and field; they are called with table and key.
Special = Mapping[tuple[type, str], Callable[[Table, str], Any]]


@dataclass(frozen=True, eq=False)
class Key:
    """Declaration of a key of an input file; a result's field needs only its meaning.

    * ``dimension``: one of :data:`tympan.base.units.DIMENSIONS`, "" for plain numbers.
    * ``rule``: limits of a text or of every number, from a file or from a function of the API.
    * ``made``: limits that must always hold, also during a fit: a thickness is positive.
    * ``name``: the key, if it is not the field's name.
    * ``kinds``: allowed kinds of a table, or of each table of a list.
    * ``inline``: the kind's keys are on the same level as this one.
    * ``needs``: another key. Without it, or if it is 0, this key is not allowed.
    * ``discrete``: the field has no derivatives.
    * ``least``: least number of numbers or points in a list.
    * ``default``: meaning of a missing key, if the dataclass determines it in ``completed``.
    * ``also``: other words that people write instead of the key.
    * ``doubled``: words for twice each of its numbers, for example a width for a half extent. All
      of these words together may replace the key.
    * ``repeats``: one number is used for all numbers of a list.
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
    also: tuple[str, ...] = ()
    doubled: tuple[str, ...] = ()
    repeats: bool = False
    made: Rule | None = None

    def __post_init__(self) -> None:
        if self.dimension and self.dimension not in DIMENSIONS:
            raise ValueError(f"{self.dimension!r} is no dimension: add it to "
                             "tympan.base.units.DIMENSIONS, or take one of these: "
                             f"{', '.join(sorted(DIMENSIONS))}")


@dataclass(frozen=True, eq=False)
class Printed:
    """Key of a field in the JSON of its result, if it differs from the field's name.

    ``key``: name in JSON. ``in_unit``: the key ends with the unit of the whole result, for example
    ``noise_um``. ``may_miss``: the key is omitted if the value is None; a nan is written as null.
    ``choices``: allowed values of a text, each with a ``meaning``. ``inline``: the keys of a
    mapping, which are its ``choices``, are written into the record itself. ``columns``: field of
    the records of a list by which tables have columns of each, such as ``capacitance_A_F``; of a
    mapping by names, what each name is a column of, such as ``voltage_V``.
    """

    key: str = ""
    in_unit: bool = False
    may_miss: bool = False
    choices: Mapping[str, Any] | None = None
    inline: bool = False
    columns: str = ""

    def spelled(self, name: str, unit: str = "") -> str:
        """Build the key of a field with this name in a result with this unit."""
        return (self.key or name) + f"_{unit}" * self.in_unit


#: Mark of a number in the unit of the whole result.
IN_UNIT = Printed(in_unit=True)
#: Mark of a value that a result may omit.
MAY_MISS = Printed(may_miss=True)
#: Default: the key is the field's name.
_AS_NAMED = Printed()


@dataclass(frozen=True, eq=False)
class Field:
    """A declared field: ``name`` in the dataclass, ``key`` in files, ``kind`` its type.

    The ``kind`` is without None. ``printed``: its key in the JSON of results. ``marks``: what else
    its annotation contains, for those who know the mark.
    """

    name: str
    key: str
    kind: Any
    says: Key
    default: Any
    printed: Printed = _AS_NAMED
    marks: tuple[Any, ...] = ()

    @property
    def required(self) -> bool:
        """Whether a file must contain it."""
        return self.default is MISSING and not self.says.default

    @cached_property
    def several(self) -> bool:
        """Whether it is a tuple."""
        return get_origin(self.kind) is tuple

    @cached_property
    def item(self) -> Any:
        """Type of its parts, or its own type."""
        return get_args(self.kind)[0] if self.several else self.kind

    @cached_property
    def count(self) -> int | None:
        """Number of its parts; None for one or any number."""
        parts = get_args(self.kind)
        return len(parts) if self.several and parts[-1] is not Ellipsis else None

    @cached_property
    def rule(self) -> Rule:
        """Limits of each of its numbers.

        For whole numbers the limits include that.
        """
        if self.item is not int:
            return self.says.rule
        if self.says.rule is FINITE:
            return WHOLE
        holds, words = self.says.rule
        return (lambda x: WHOLE[0](x) and holds(x)), words

    @cached_property
    def made(self) -> Rule:
        """Limits of each of its numbers when it is created in Python.

        Fits and finite differences may use numbers that a file may not contain. The functions of
        the API refuse those.
        """
        loose = self.item is float and self.rule is not POSITIVE
        return self.says.made or (A_NUMBER if loose else self.rule)

    @property
    def discrete(self) -> bool:
        """Whether there are no values between its values."""
        return self.says.discrete or self.item in (int, bool)


def fields_of(cls: Any) -> tuple[Field, ...]:
    """List the declared fields of a dataclass, in order."""
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
        printed = next((note for note in notes if isinstance(note, Printed)), _AS_NAMED)
        marks = tuple(note for note in notes if not isinstance(note, Key | Printed))
        declared += [Field(item.name, says.name or item.name, kind, says, default, printed, marks)
                     for says in notes if isinstance(says, Key)]
    return tuple(declared)


@cache
def _by_name(cls: Any) -> tuple[dict[str, Field], tuple[str, ...]]:
    """Map names to declared fields of a dataclass, and list the names of required ones."""
    declared = {field.name: field for field in fields_of(cls)}
    return declared, tuple(name for name, field in declared.items() if field.required)


def changed(value: Any, record: Any = None) -> tuple[Field, ...]:
    """List the fields of a dataclass that differ from their defaults.

    ``record``: a base class; only its fields are listed. The default is the value's own class.
    """
    return tuple(field for field in fields_of(record or type(value))
                 if getattr(value, field.name) != field.default)


def field_at(value: Any, path: tuple[str, ...]) -> Field | None:
    """Find the innermost declared field along a path of attributes and element numbers."""
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
    """Find the SI unit of a field for people; "1" for plain numbers and undeclared fields."""
    dimension = "" if field is None else field.says.dimension
    return DIMENSIONS[dimension].symbol if dimension else "1"


def asks(cls: Any) -> Any:
    """Let a declared dataclass of a request be created as :func:`takes_units` describes.

    No fit creates it, so the limits of a file apply.
    """
    return takes_units(cls, attrgetter("rule"))


def takes_units(cls: Any, limits: Callable[[Field], Rule] = attrgetter("made")) -> Any:
    """Let a declared dataclass be created from what its file may contain: ``Circle("4.5 cm")``.

    Texts have a unit, lists are used as tuples, and names of a library are replaced by their
    objects. Missing values are completed as for a file. A wrong value raises an :class:`InputError`
    that names the key: a wrong unit, a number outside its limits, an array in place of a number, an
    unknown or a missing name. The imaginary step of a number is not checked.
    """
    of_numbers = cls.__init__

    @cache
    def arguments() -> _Units:
        # Collected for the first object: a program imports many more classes than it makes.
        return _Units.of(cls, of_numbers, limits)

    @wraps(of_numbers)
    def of_texts(self: Any, *values: Any, **named: Any) -> None:
        of_numbers(self, **arguments().in_si(values, named))

    cls.__init__ = of_texts
    return cls


@dataclass(frozen=True, eq=False)
class _Units:
    """Arguments of a declared dataclass that :func:`takes_units` describes.

    ``rules``: the limits of each declared field. ``halves``: the fields that words for twice their
    numbers may replace. ``others``: types of the fields that are not declared. ``arguments``: those
    of the constructor.
    """

    cls: Any
    rules: Mapping[str, Rule]
    halves: tuple[Field, ...]
    others: Mapping[str, Any]
    arguments: Arguments

    @classmethod
    def of(cls, declared: Any, constructor: Callable[..., Any], limits: Callable[[Field], Rule]
           ) -> _Units:
        """Collect what the constructor of a declared dataclass takes."""
        fields = fields_of(declared)
        rules = {field.name: limits(field) for field in fields}
        halves = tuple(field for field in fields if field.says.doubled)
        # The dataclass itself checks numbers in fields that are not declared.
        others = {name: hint for name, hint in get_type_hints(declared).items()
                  if name not in rules and "float" not in str(hint)}
        words = (word for field in halves for word in field.says.doubled)
        return cls(declared, rules, halves, others, Arguments.of(constructor, declared, *words))

    def in_si(self, values: Sequence[Any], named: Mapping[str, Any]) -> Content:
        """Convert the arguments of one object to its fields' values."""
        declared, required = _by_name(self.cls)
        arguments = self.arguments
        given = arguments.named(values, named)
        for name in self.others.keys() & given.keys():
            arguments.require_type(self.others[name], given[name], name)
        for field in self.halves:
            given = _halved(field, given)
        given = {name: _in_si(declared[name], value, self.rules[name]) if name in declared
                 else value for name, value in given.items()}
        arguments.require(given, required)
        completed: Content = getattr(self.cls, "completed", dict)(given)
        arguments.require(completed, arguments.needed)
        return completed


class FieldsAlone:
    """Dataclass that is pickled with its fields only; derived quantities may be much larger."""

    def __getstate__(self) -> dict[str, Any]:
        declared = {item.name for item in dataclass_fields(cast(Any, self))}
        return {name: value for name, value in vars(self).items() if name in declared}


@dataclass(frozen=True)
class Arguments:
    """Arguments of a function for messages about them.

    ``positional``: names that may be given by position. ``names``: all names. ``needed``: names
    without a default. ``known``: names, and words that people write instead, as messages spell
    them. ``meanings``: meanings of fields. ``many``: further positional arguments are allowed.
    ``blank``: names whose default is an empty text.
    """

    positional: tuple[str, ...]
    names: tuple[str, ...]
    needed: tuple[str, ...]
    known: Mapping[str, str]
    meanings: Mapping[str, str]
    many: bool = False
    blank: frozenset[str] = frozenset()

    @classmethod
    def of(cls, function: Callable[..., Any], declared: Any = None, *more: str) -> Arguments:
        """Collect the arguments of a function, or of a ``declared`` dataclass's constructor.

        ``more``: further names that the function passes on.
        """
        listed = [item for item in signature(function).parameters.values() if item.name != "self"]
        single = [item for item in listed if item.kind not in (item.VAR_POSITIONAL,
                                                                item.VAR_KEYWORD)]
        alone = [item.name for item in single if item.kind is item.KEYWORD_ONLY]
        names = (*(item.name for item in single if item.name not in alone), *more, *alone)
        also = {} if declared is None else {
            word: f"{field.name!r} ({field.says.meaning})" for field in fields_of(declared)
            for word in field.says.also}
        return cls(tuple(item.name for item in single if item.kind is not item.KEYWORD_ONLY), names,
                   tuple(item.name for item in single if item.default is item.empty),
                   also | {name: repr(name) for name in names},
                   {} if declared is None else {
                       item.name: item.says.meaning for item in fields_of(declared)},
                   any(item.kind is item.VAR_POSITIONAL for item in listed),
                   frozenset(item.name for item in listed if item.default == ""))

    def named(self, values: Sequence[Any], named: Mapping[str, Any]) -> Content:
        """Assign the values to their names."""
        if len(values) > len(self.positional) and not self.many:
            without = ", ".join(self.positional) or "none"
            raise InputError(f"of what is given without a name there may be {without}; name the "
                             f"others: {', '.join(self.names[len(self.positional):])}".rstrip(": "),
                             given=values[len(self.positional)])
        given = dict(zip(self.positional, values, strict=False))
        for name in named:
            if name not in self.names:
                raise InputError(f"unknown name: {did_you_mean(name, self.known)}known here: "
                                 f"{', '.join(self.names)}", key=name)
            if name in given:
                raise InputError("is given twice, by its place and by its name", key=name)
        return given | dict(named)

    def require_type(self, hint: Any, value: Any, name: str) -> None:
        """Raise InputError for a value of a wrong type, and for an empty text."""
        _require_type(hint, value, name)
        if (isinstance(value, str | PathLike) and not str(value).strip() and name not in self.blank
                and not {str, PathLike}.isdisjoint(get_origin(kind) or kind
                                                   for kind in _kinds(hint))):
            raise InputError(EMPTY, key=name, given=value)

    def require(self, given: Mapping[str, Any], names: Sequence[str]) -> None:
        """Raise InputError if one of these names is missing."""
        for name in names:
            if name not in given:
                meaning = self.meanings.get(name)
                raise InputError("is missing" + f" ({meaning})" * bool(meaning), key=name)


def names_arguments(more: Any = None, *, former: Mapping[str, str] = MappingProxyType({}),
                    placed: Sequence[str] = (), rest: str = "") -> Callable[[F], F]:
    """Make a function raise an :class:`InputError` that names a wrong argument.

    An argument is wrong if its name is unknown, if it is missing, or if it has another type than
    declared. ``more``: typed dictionary of the arguments that the function passes on to a declared
    dataclass. Its signature, which a notebook shows, has names and defaults alone.

    What scripts wrote before still works, with a :class:`FutureWarning` that says the new words:
    ``former`` names of arguments, those that were ``placed`` after the ones that still are, and
    the argument that took all values from there on, now named ``rest``.
    """
    def explained(function: F) -> F:
        @cache
        def of_function() -> tuple[Arguments, dict[str, Any], str | None]:
            declared = get_annotations(more) if more else {}
            # The dataclass that knows the unit checks a quantity that is passed on.
            hints = get_annotations(function) | {
                name: Any if "float" in str(hint) else hint for name, hint in declared.items()}
            many = next((name for name, item in signature(function).parameters.items()
                         if item.kind is item.VAR_POSITIONAL), None)
            return Arguments.of(function, None, *declared), hints, many

        @wraps(function)
        def checked(*values: Any, **named: Any) -> Any:
            arguments, hints, many = of_function()
            places = getattr(unwrap(function), "__globals__", {})
            values, named = _in_new_words(values, named, len(arguments.positional))
            given = arguments.named(values, named)
            arguments.require(given, arguments.needed)
            others = values[len(arguments.positional):] if many else ()
            for name, value in (*given.items(), *((str(many), value) for value in others)):
                arguments.require_type(_type_of(hints[name], places), value, name)
                if is_dataclass(value) and not isinstance(value, type):
                    require_of_file(value)
            try:
                return function(*values, **named)
            except InputError as error:
                option = str(error.key or "")
                if error.file is None and option.startswith("--"):
                    raise type(error)(error.allowed, key=option[2:].replace("-", "_"),
                                      given=error.given) from error.__cause__
                raise

        def _in_new_words(values: tuple[Any, ...], named: dict[str, Any], still: int
                          ) -> tuple[tuple[Any, ...], dict[str, Any]]:
            """Translate arguments as scripts wrote them before; warn about each."""
            changed = {name: former[name] for name in named if name in former}
            named = {former.get(name, name): value for name, value in named.items()}
            for name, now in changed.items():
                _advise(f"{name}= is {now}= now")
            beyond = values[still:]
            if beyond and rest:
                named[rest] = list(beyond)
                _advise(f"{rest}= has to be named now: {rest}=[...]")
                return values[:still], named
            if "settings" in placed[:1] and beyond and not is_dataclass(beyond[0]):
                return values, named  # never was right: all names are said
            for name, value in zip(placed, beyond, strict=False):
                named.setdefault(name, value)
                _advise(f"{name}= has to be named now")
            taken = min(len(beyond), len(placed))
            return values[:still] + beyond[taken:], named

        def _advise(words: str) -> None:
            warnings.warn(f"tympan.{function.__name__}: {words}; the former way {WORKS_STILL}",
                          FutureWarning, stacklevel=4)

        public: Any = checked
        public.__signature__ = _short_signature(function, get_annotations(more) if more else {})
        public.former = former, placed, rest
        return cast(F, checked)

    return explained


#: Most characters of a signature with the names that a function passes on: about three lines.
_SHORT = 200


def _short_signature(function: Callable[..., Any], passed: Iterable[str]) -> Signature:
    """Make the signature that a notebook shows: without types, with the names that are passed on.

    Loads come after the subject, all else before the settings; types stand in the docstring and in
    the source.
    """
    items = list(signature(function).parameters.values())
    plain = Signature([item.replace(annotation=Parameter.empty) for item in items])
    first = [item for item in plain.parameters.values() if item.kind not in (
        Parameter.KEYWORD_ONLY, Parameter.VAR_KEYWORD)]
    own = [item for item in plain.parameters.values() if item.kind is Parameter.KEYWORD_ONLY]
    more = [Parameter(name, Parameter.KEYWORD_ONLY, default=None) for name in passed]
    last = [item for item in own if item.name == "settings"]
    asked = [item for item in own if item.name != "settings"]
    loads = any(item.name == "mass" for item in more)
    whole = Signature([*first, *(more + asked if loads else asked + more), *last])
    return whole if len(str(whole)) < _SHORT else plain


def checks_types(cls: Any) -> Any:
    """Let a plain dataclass raise InputError for arguments of a wrong type."""
    of_any = cls.__init__

    @cache
    def of_constructor() -> tuple[Arguments, dict[str, Any]]:
        return Arguments.of(of_any), get_type_hints(cls)

    @wraps(of_any)
    def checked(self: Any, *values: Any, **named: Any) -> None:
        arguments, hints = of_constructor()
        given = arguments.named(values, named)
        arguments.require(given, arguments.needed)
        for name, value in given.items():
            arguments.require_type(hints[name], value, name)
        of_any(self, **given)

    cls.__init__ = checked
    return cls


class _Unloaded:
    """Type whose module only type checkers load; a class of the same name matches it."""


class _Places(dict[str, Any]):
    """Names of a module and Python's own names.

    Names that only type checkers know are created as unloaded types.
    """

    def __missing__(self, name: str) -> Any:
        return vars(builtins).get(name) or type(name, (_Unloaded,), {})


def _type_of(hint: Any, places: Mapping[str, Any]) -> Any:
    """Evaluate an annotation to its type."""
    hint = getattr(hint, "__forward_arg__", hint)
    return eval(hint, {}, _Places(places)) if isinstance(hint, str) else hint


def _require_type(hint: Any, value: Any, key: str) -> None:
    """Raise InputError for a value of another type than an annotation's."""
    if get_origin(hint) is Literal:
        if value not in get_args(hint):
            raise InputError(one_of(value, dict.fromkeys(get_args(hint))), key=key,
                             given=value)
        return
    if _fits(hint, value):
        return
    kinds = [get_origin(kind) or kind for kind in _kinds(hint)]
    words = " or ".join(_TYPES.get(kind, one(kind)) for kind in kinds if kind is not NoneType)
    advice = ("; tympan.load(FILE) reads one" if words.startswith("a Specimen")
              and isinstance(value, str | PathLike) else
              "; call once for each of several" if float in kinds and hasattr(value, "__len__")
              else "")
    raise InputError(f"must be {words}{advice}", key=key, given=value)


#: Types of arguments in words.
_TYPES: dict[Any, str] = {
    float: "a number", str: "a text", int: "a whole number", bool: "True or False",
    PathLike: "a path", Sequence: "a list"}


def _kinds(hint: Any) -> tuple[Any, ...]:
    """List the types of a union, or the only type."""
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def _fits(hint: Any, value: Any) -> bool:
    """Check whether a value matches a type."""
    kinds = _kinds(hint)
    return (Any in kinds or any(get_origin(kind) is Literal for kind in kinds)
            or any(_is_a(kind, value) for kind in kinds))


def _is_a(kind: Any, value: Any) -> bool:
    """Check whether a value is of a kind; arrays count as lists, a text or number as one item."""
    item, kind = get_args(kind), get_origin(kind) or kind
    if kind is float:
        return _is_number(value)
    if kind is int:
        return isinstance(value, Integral) and not isinstance(value, bool)
    if kind is Sequence:
        single = isinstance(value, str | Number)
        # Errors of a number or text among them are reported where it is read.
        if not item or not {float, str, int, Any}.isdisjoint(_kinds(item[0])):
            return single or hasattr(value, "__len__")
        return not single and hasattr(value, "__len__") and all(
            _fits(item[0], part) for part in value)
    if isinstance(kind, type) and issubclass(kind, _Unloaded):
        return any(base.__name__ == kind.__name__ for base in type(value).__mro__)
    # Whether a value matches a protocol shows only in its use.
    return (not isinstance(kind, type) or getattr(kind, "_is_protocol", False)
            or isinstance(value, kind))


def _is_number(value: Any) -> bool:
    """Check whether a value is one number; True and a masked table cell are not numbers."""
    if getattr(value, "ndim", None) == 0:
        return value.dtype.kind in "iufc" and not _is_masked(value)
    return isinstance(value, Number) and not isinstance(value, bool)


def _is_masked(value: Any) -> bool:
    """Check whether a value is a masked cell of a NumPy table, which contains no number."""
    return getattr(value, "ndim", None) == 0 and bool(getattr(value, "mask", False))


def number(value: Any, dimension: str, key: str) -> float:
    """Convert one number [SI], given as a number or as a text with its unit.

    Examples
    --------
    >>> number("17.9 g", "mass", "mass"), number(2, "mass", "mass")
    (0.0179, 2.0)
    """
    return float(_in_si(Field(key, key, float, Key("", dimension), MISSING), value, FINITE))


def numbers(values: Any, dimension: str, key: str) -> tuple[float, ...]:
    """Convert one number [SI], several, or a range, as :func:`number` does.

    A text may have commas and ranges, as :func:`~tympan.base.units.quantities` reads them; a range
    may also be a mapping of ``from``, ``to`` and ``count``.

    Examples
    --------
    >>> numbers(["1 kV", 2e3], "voltage", "voltage"), numbers("3 kV", "voltage", "voltage")
    ((1000.0, 2000.0), (3000.0,))
    >>> numbers({"from": 0, "to": "2 kV", "count": 3}, "voltage", "voltage")
    (0.0, 1000.0, 2000.0)
    """
    if isinstance(values, Mapping):
        return _spanned(values, dimension, key)
    if isinstance(values, str) and dimension:
        try:
            found = quantities(values, dimension)
        except InputError as error:
            raise error.located(key=key) from None
        if not all(map(isfinite, found)):
            raise InputError("must be finite", key=key, given=values)
        return found
    if isinstance(values, str) or not hasattr(values, "__len__"):
        values = (values,)
    return tuple(number(value, dimension, key) for value in values)


#: What several quantities in one text have between them.
_SEVERAL = re.compile(r"\.\.|[^\W\d_]\s*,")


def only(given: Any, key: str, default: Any = None) -> Any:
    """Return the load of a question about one state, where none is given a default.

    Raises
    ------
    InputError
        When several are given, or a range.

    Examples
    --------
    >>> only(["20 g"], "mass"), only("3 kV", "voltage"), only(None, "mass", 0.0)
    ('20 g', '3 kV', 0.0)
    """
    if given is None:
        return default
    if isinstance(given, str):
        if not _SEVERAL.search(given):
            return given
    elif not isinstance(given, Mapping):
        values = given if hasattr(given, "__len__") else [given]
        if len(values) == 1:
            return values[0]
    raise InputError("must be one: this question is about one state; curve, force and sweep take "
                     "several", key=key, given=given if isinstance(given, str) else str(given))


def _spanned(span: Mapping[Any, Any], dimension: str, key: str) -> tuple[float, ...]:
    """Convert a range that is a mapping."""
    try:
        _, _, count = span_of(span)
    except InputError as error:
        raise InputError(error.allowed, key=f"{key}.{error.key}" if error.key else key,
                         given=error.given) from None
    low, high = (number(span[end], dimension, f"{key}.{end}") for end in ("from", "to"))
    try:
        return tuple(evenly(low, high, count))
    except InputError as error:
        raise error.located(key=key) from None


def _in_si(field: Field, value: Any, rule: Rule) -> Any:
    """Convert a constructor argument to the value that the dataclass stores, within a rule."""
    if (type(value) is float and field.kind is float
            and -LARGEST <= value <= LARGEST and rule[0](value)):
        return value  # fast path: nearly all values, in many thousand specimens
    try:
        if isinstance(value, str) and field.says.kinds is not None and field.says.kinds.by_name:
            return field.says.kinds.by_name(value)
        if value is None and field.default is None:
            return None
        if field.item not in (float, int) and get_origin(field.item) is not tuple:
            _require_part(field, value)
            return tuple(value) if isinstance(value, list) else value
        part: Any = _numbers(field, value) if field.several else _one_number(field, value)
        _require_limits(field, part, value, rule)
        if field.item is int:
            return tuple(map(int, part)) if field.several else int(part)
        return part
    except InputError as error:
        raise error.located(key=field.key) from None


def _require_part(field: Field, value: Any) -> None:
    """Raise InputError for a value that cannot be a part of an actuator: text or number."""
    if field.several and not isinstance(value, list | tuple):
        raise InputError("must be a list", given=value)
    says, of_type = field.says, (field.item is bool or get_origin(field.item) is Literal
                                 or is_dataclass(field.item))
    if says.kinds is None and field.item is not str and not of_type:
        return  # any value is allowed, such as an outline's knots
    for part in value if field.several else (value,):
        if part is None:  # the dataclass decides whether None is allowed
            continue
        if says.kinds is not None:
            # The only requirement on a package's kind is that it is a dataclass.
            if not is_dataclass(part) or isinstance(part, type):
                kinds = [kind.__name__ for kind in says.kinds.values() if isinstance(kind, type)]
                raise InputError(f"must be one of {', '.join(kinds)}", given=part)
        elif field.item is str:
            _require_text(field, part)
        else:
            _require_type(field.item, part, field.key)


def _require_text(field: Field, text: Any) -> None:
    """Raise InputError for a value that is not a text, or outside the field's limits."""
    if not isinstance(text, str | PathLike):
        raise InputError("must be a text", given=text)
    if not str(text).strip() and field.default != text and not field.several:
        raise InputError(EMPTY, given=text)
    if field.says.rule is not FINITE and not field.says.rule[0](str(text)):
        raise InputError(field.says.rule[1], given=text)


def require_of_file(part: Any, within: str = "") -> None:
    """Raise InputError for a part of an actuator with a number that no file may contain.

    ``within`` is the start of its key. Functions of the API call this. Constructors do not, since a
    fit may use such numbers.
    """
    for field in fields_of(type(part)):
        value = getattr(part, field.name)
        if value is not None and field.made is not field.rule:
            try:
                _require_limits(field, value, value, field.rule)
            except InputError as error:
                raise error.located(key=within + field.key) from None
        inner = within if field.says.inline else f"{within}{field.key}."
        for item in value if field.several and value is not None else (value,):
            if is_dataclass(item) and not isinstance(item, type):
                require_of_file(item, inner)


def _require_limits(field: Field, part: Any, given: Any, rule: Rule) -> None:
    """Raise InputError for numbers outside their limits, or too few numbers.

    An imaginary step is ignored.
    """
    holds, words = rule
    items = part if field.several else (part,)
    if field.several and len(part) < field.says.least and part != field.default:
        what = "points" if get_origin(field.item) is tuple else "numbers"
        raise InputError(f"must be at least {field.says.least} {what}",
                         given=_told(field, part, given))
    reals = [item.real for item in
             (chain(*items) if get_origin(field.item) is tuple else items)]
    if all(map(holds, reals)) and max(map(abs, reals), default=0.0) <= LARGEST:
        return
    try:
        for real in reals:
            if not holds(real):
                raise InputError(words)
            if abs(real) != inf:
                bounded(real)
    except InputError as error:
        raise InputError(error.allowed, given=_told(field, part, given)) from None


def _told(field: Field, part: Any, given: Any) -> Any:
    """Format a value for a message: a text as it was written, numbers with their unit."""
    return given if isinstance(given, str) else _shown(field, part)


def _one_number(field: Field, value: Any) -> Any:
    """Convert a number, or a text with its unit [SI]."""
    if isinstance(value, str) and field.says.dimension:
        return quantity(value, field.says.dimension)
    if _is_masked(value):
        raise InputError("is masked, so that it holds no number: give one, or leave it out",
                         given="a masked cell")
    if not _is_number(value):
        unit = f" with its unit or in {symbol(field)}" if field.says.dimension else ""
        several = hasattr(value, "__len__") and not isinstance(value, str)
        raise InputError(f"must be one number{unit}"
                         + "; call once for each of several" * several, given=value)
    if getattr(value, "ndim", None) == 0:
        return value.item()
    return value if isinstance(value, int | float | complex) else float(value)


def _numbers(field: Field, value: Any) -> tuple[Any, ...]:
    """Convert numbers or points, or one number that is used for all [SI]."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if field.says.repeats and field.count and not isinstance(value, list | tuple):
        value = (value,) * field.count
    if (not isinstance(value, list | tuple)
            or (field.count is not None and len(value) != field.count)):
        what = "numbers" if get_origin(field.item) is not tuple else "pairs of numbers"
        raise InputError(f"must be {field.count or 'a list of'} {what}", given=value)
    types, of_pairs = set(map(type, value)), get_origin(field.item) is tuple
    if of_pairs and not (all(issubclass(kind, list | tuple) for kind in types)
                         and {2} >= set(map(len, value))):
        raise InputError("must be pairs of numbers", given=value)
    # Outlines have hundreds of numbers; a call for each one would be slow.
    if {float} >= (set(map(type, chain(*value))) if of_pairs else types):
        return tuple(map(tuple, value)) if of_pairs else tuple(value)
    return tuple([tuple([_one_number(field, part) for part in item]) if of_pairs else
                  _one_number(field, item) for item in value])


def _halved(field: Field, given: Content) -> Content:
    """Replace the words for twice a field's numbers by the field."""
    words = [word for word in field.says.doubled if word in given]
    if not words:
        return given
    if field.name in given:
        raise InputError(_either(field), key=words[0], given=given[words[0]])
    lacking = next((word for word in field.says.doubled if word not in given), None)
    if lacking is not None:
        raise InputError("is missing", key=lacking)
    half = tuple(number(given[word], field.says.dimension, word) / 2 for word in words)
    return {name: value for name, value in given.items() if name not in words} | {field.name: half}


def _either(field: Field) -> str:
    return f"give {' and '.join(field.says.doubled)}, or {field.key}, not both"


#: Lock of :attr:`Registry.more`: other threads wait until all kinds are registered.
_FILLING = RLock()


class Registry(dict[str, T]):
    """All kinds of one part by their names in files.

    ``tag`` is the attribute of a kind that contains its name, and the key in files that chooses it.
    The ``usual`` kind, if there is one, needs no name in files. ``by_name`` maps a name of a
    library to an object, in place of a kind. ``more`` registers the kinds of users' packages; it is
    called once, when a name is unknown or all kinds are listed. ``broken`` contains the errors of
    packages whose kinds could not be loaded.
    """

    by_name: Callable[[str], Any] | None = None
    more: Callable[[Registry[T]], None] | None = None

    def __init__(self, tag: str, usual: str = "") -> None:
        super().__init__()
        self.tag, self.usual = tag, usual
        self.broken: list[InputError] = []

    def _filled(self) -> dict[str, T]:
        """Register the kinds of users' packages, once."""
        with _FILLING:
            more, self.more = self.more, None
            if more is not None:
                more(self)
        return self

    def __missing__(self, name: str) -> T:
        if self.more is None:
            raise KeyError(name)
        return self._filled()[name]

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or dict.__contains__(self._filled(), name)

    def __iter__(self) -> Iterator[str]:
        return dict.__iter__(self._filled())

    def __len__(self) -> int:
        return dict.__len__(self._filled())

    def get(self, name: str, default: Any = None) -> Any:
        known: dict[str, T] = self if name in self else {}
        return dict.get(known, name, default)

    def keys(self) -> dict_keys[str, T]:
        return dict.keys(self._filled())

    def values(self) -> dict_values[str, T]:
        return dict.values(self._filled())

    def items(self) -> dict_items[str, T]:
        return dict.items(self._filled())

    def whole(self, name: str = "") -> Self:
        """Return the registry if no package is broken.

        Raises
        ------
        InputError
            If a package is broken; the error of the kind ``name`` comes first.
        """
        self._filled()
        for error in sorted(self.broken, key=lambda error: f"{name!r}" not in str(error.key)):
            raise error
        return self

    @property
    def synonyms(self) -> dict[str, str]:
        """Synonyms (``also``) of the kinds, with the words that messages use instead."""
        return {word: repr(name) for name, kind in self.items()
                for word in getattr(kind, "also", ())}

    def register(self, kind: Any) -> Any:
        """Register a kind; usable as a decorator. A dataclass then takes units.

        Raises
        ------
        ValueError
            When a class of another name is registered under its name.
        """
        name = getattr(kind, self.tag)
        known, own = (getattr(each, "__qualname__", None) for each in
                      (dict.get(self, name), kind))
        if known and own and known != own:  # a class that is defined again takes its own place
            raise ValueError(f"{name!r} is registered already: {known}")
        takes = isinstance(kind, type) and is_dataclass(kind)
        self[name] = takes_units(kind) if takes else kind
        return kind

    def read(self, table: Table) -> Any:
        """Read the object in a table, with the kind's own ``from_table`` if it has one."""
        name = table.data.get(self.tag)
        if isinstance(name, str) and name not in self:
            self.whole(name)
        cls: Any = table.choice(self.tag, self, self.usual or MISSING)
        return cls.from_table(table) if hasattr(cls, "from_table") else read(cls, table)

    def write(self, value: Any, plain: bool = False) -> Content:
        """Write a value as a table that reads back equal."""
        name = getattr(value, self.tag)
        return ({} if name == self.usual else {self.tag: name}) | write(value, plain)


def read(cls: type[T], table: Table, special: Special | None = None) -> T:
    """Read an instance of a declared dataclass from a table, which must contain nothing else."""
    values: Content = {}
    for field in fields_of(cls):
        if not field.says.inline:
            table.knows(table.spelled(field.key, field.says.dimension), field.says.also,
                        field.says.meaning)
            for word in field.says.doubled:
                table.knows(table.spelled(word, field.says.dimension))
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


def read_some(cls: type, table: Table, names: Collection[str]) -> Content:
    """Read fields of these names from a table where they stand, of a declared dataclass.

    The table may contain its other fields, too, which are not read.
    """
    values = {field.name: _read(field, table, None) for field in fields_of(cls)
              if field.name in names and table.spelled(field.key, field.says.dimension) in table}
    table.asked |= {table.spelled(word, field.says.dimension) for field in fields_of(cls)
                    for word in (field.key, *field.says.doubled)}
    table.done()
    return values


def write(value: Any, plain: bool = False) -> Content:
    """Write a declared dataclass as a table that :func:`read` converts to an equal one.

    ``plain``: for a plain :class:`tympan.base.toml_reader.Table`.
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


def _shown(field: Field, part: Any) -> Any:
    """Format a number or numbers of a field for people, with their unit."""
    if not field.says.dimension:
        return part
    try:
        return quantities_text([item.real for item in (part if field.several else (part,))],
                               field.says.dimension)
    except (InputError, OverflowError):  # nan, or more than any quantity
        return part


def _stands(field: Field, table: Table, values: Content) -> bool:
    says = field.says
    if says.needs and not values.get(says.needs):
        return False
    keys = {table.spelled(word, says.dimension) for word in (field.key, *says.doubled)}
    table.asked |= keys
    return (says.inline or not keys.isdisjoint(table.data) or field.required or bool(says.needs))


def _read(field: Field, table: Table, special: Special | None) -> Any:
    says, key, item = field.says, field.key, field.item
    if says.inline and says.kinds is not None:
        return says.kinds.read(table)
    if says.kinds is not None and says.kinds.by_name and isinstance(table.data.get(key), str):
        return table.named(key, says.kinds.by_name)
    if says.kinds is not None or is_dataclass(item):
        tables = table.tables(key) if field.several else (table.table(key),)
        parts = tuple(says.kinds.read(part) if says.kinds is not None else read(item, part, special)
                      for part in tables)
        return parts if field.several else parts[0]
    if get_origin(item) is Literal:
        return table.choice(key, {name: name for name in get_args(item)})
    if item is str and field.several:
        return table.texts(key)
    if item is str:
        return table.text(key, rule=None if says.rule is FINITE else says.rule)
    if item is bool:
        return table.truth(key)
    if get_origin(item) is tuple:
        return table.places(key, says.least, field.count, says.rule)
    rule = field.rule
    doubled = [table.spelled(word, says.dimension) for word in says.doubled]
    for word in doubled:
        if word in table and key in table:
            raise table.error(word, _either(field), table.data[word])
    if any(word in table for word in doubled):
        half: Rule = (lambda size: rule[0](size / 2), f"half of it {rule[1]}")
        return tuple(table.number(word, says.dimension, rule=half) / 2 for word in says.doubled)
    single = says.repeats and not isinstance(table.value(key), list | tuple)
    if single and field.count:
        return (table.number(field.key, says.dimension, rule=rule),) * field.count
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

