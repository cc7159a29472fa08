"""Messages between a page and its browsers, as JSON over websockets."""

from __future__ import annotations

import asyncio
import json
from contextlib import aclosing, suppress
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from tympan.explore.page import Page

#: Messages of a browser, with the types of the words after each.
SAID: dict[str, tuple[type, ...]] = {
    "slid": (str, str), "typed": (str, str), "choose": (int,), "reset": (), "shape": (str, str),
    "save": (str, str)}


def checked_message(text: str) -> tuple[str, list[Any]]:
    """Check a browser's message; return its kind, and the words after it.

    Raises
    ------
    ValueError
        When no page sends such a message, with the reason.
    """
    message = json.loads(text)
    if not isinstance(message, list) or not message or message[0] not in list(SAID):
        raise ValueError("a message is a list that begins with what is said")
    name, *words = message
    # isinstance would accept true as a number.
    if tuple(map(type, words)) != SAID[name]:
        raise ValueError(f"{name}: these words cannot be meant")
    return name, words


async def talk(page: Page, socket: web.WebSocketResponse) -> None:
    """Talk to a browser until it goes away or sends a message that no page sends."""
    telling = asyncio.create_task(_tell(page, socket))
    try:
        async for frame in socket:
            try:
                if frame.type is not WSMsgType.TEXT:
                    raise ValueError("a frame is text")
                name, words = checked_message(frame.data)
            except (ValueError, RecursionError) as error:
                reason = str(error).encode()[:100].decode(errors="ignore")
                await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=reason.encode())
                return
            page.hear(name, *words)
    finally:
        telling.cancel()


async def _tell(page: Page, socket: web.WebSocketResponse) -> None:
    with suppress(ConnectionError):  # the browser goes away
        async with aclosing(page.news()) as parts:
            async for news in parts:
                await socket.send_str(news)
