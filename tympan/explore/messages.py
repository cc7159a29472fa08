"""What a page's browser may say over its websocket."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any

from tympan.explore.picture import LOOKS
from tympan.reports.colouring import COLOURINGS


def _texts(value: Any) -> bool:
    """Whether it is texts or numbers by name."""
    return isinstance(value, dict) and all(
        isinstance(name, str) and isinstance(item, str | int | float)
        for name, item in value.items())


def _depth(value: Any) -> bool:
    return isinstance(value, int | float) and isfinite(value) and 0 < value <= 1000


#: What the browser may set of the page's state, and whether a value can be meant.
STATES: dict[str, Callable[[Any], bool]] = {
    "sliders": _texts, "texts": _texts, "typing": _texts, "depth": _depth,
    "colouring": lambda value: isinstance(value, str) and value in COLOURINGS}

def _text(value: Any) -> bool:
    return isinstance(value, str)


def _number(value: Any) -> bool:
    return type(value) is int


def _look(value: Any) -> bool:
    return isinstance(value, str) and value in LOOKS


#: What the browser may trigger, and what each of its arguments has to be.
TRIGGERS: dict[str, tuple[Callable[[Any], bool], ...]] = {
    "slid": (_text, _text), "typed": (_text, _text), "choose": (_number,), "look": (_look,),
    "reset": (), "write": (), "named": ()}


def _hello(args: list[Any]) -> bool:
    return len(args) == 1 and _texts(args[0])


def _nothing(args: list[Any]) -> bool:
    return args == []


def _word(args: list[Any]) -> bool:
    return len(args) == 1 and isinstance(args[0], str) and len(args[0]) < 1000


def _changes(args: list[Any]) -> bool:
    """Whether it is a list of keys with values that can be meant."""
    return (len(args) == 1 and isinstance(args[0], list) and all(
        isinstance(change, dict) and isinstance(change.get("key"), str)
        and change["key"] in STATES and STATES[change["key"]](change.get("value"))
        for change in args[0]))


def _trigger(args: list[Any]) -> bool:
    """Whether it is a name with arguments that can be meant."""
    if len(args) != 3 or not isinstance(args[0], str) or not isinstance(args[1], list):
        return False
    tests = TRIGGERS.get(args[0])
    return (tests is not None and args[2] == {} and len(args[1]) == len(tests)
            and all(test(value) for test, value in zip(tests, args[1], strict=True)))


#: Methods that the browser may call, and whether arguments can be meant.
METHODS: dict[str, Callable[[list[Any]], bool]] = {
    "wslink.hello": _hello, "trame.state.get": _nothing, "trame.state.update": _changes,
    "trame.trigger": _trigger, "trame.lifecycle.update": _word, "trame.error.client": _word}


def checked_message(message: Any) -> dict[str, Any]:
    """A message, if it is one that the page sends.

    Raises
    ------
    ValueError
        When it is none, with the reason.
    """
    if not isinstance(message, dict):
        raise ValueError("a message is a map")
    identity, method = message.get("id"), message.get("method")
    args, named = message.get("args", []), message.get("kwargs", {})
    if not isinstance(identity, str) or len(identity) > 200:
        raise ValueError("a message has an id")
    if not isinstance(args, list) or named != {}:
        raise ValueError("a message has a list of arguments")
    test = METHODS.get(method) if isinstance(method, str) else None
    if test is None or (method == "wslink.hello") != identity.startswith("system:"):
        raise ValueError("there is no such method")
    if not test(args):
        raise ValueError(f"{method}: these arguments cannot be meant")
    return message
