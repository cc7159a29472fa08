"""The websockets of a page; whatever comes that the page never says ends its websocket."""

from __future__ import annotations

from contextlib import suppress
from secrets import token_hex
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web
from wslink.backends.aiohttp import AioHttpWsHandler
from wslink.chunking import HEADER_LENGTH, UnChunker

from tympan.explore.door import safe
from tympan.explore.messages import checked_message

#: Bytes of a message, and of all messages of which only parts have come. The page's longest are
#: the texts of all its fields, some 1,000 bytes.
_MOST_BYTES = 65_536
#: Messages at once of which only parts have come; browsers send one after the other.
_MOST_PARTS = 4
#: Seconds between signs of life.
_HEART_BEAT = 30.0
#: Seconds that a browser has to say goodbye, too.
_GOODBYE = 1.0
#: Websockets of one page; a browser has one, and two while it comes back.
MOST_SOCKETS = 4


class _Parts(UnChunker):  # type: ignore[misc]  # wslink has no types
    """Messages put together from their parts, which are few and short."""

    def __init__(self) -> None:
        super().__init__()
        self.max_message_size = _MOST_BYTES

    def set_max_message_size(self, size: int) -> None:
        """Who has said hello needs no longer messages."""

    def process_chunk(self, chunk: bytes) -> Any:
        if len(chunk) <= HEADER_LENGTH:
            raise ValueError("a part without content")
        if len(self.pending_messages) > _MOST_PARTS:
            raise ValueError("too many messages in parts")
        return super().process_chunk(chunk)


class Talk(AioHttpWsHandler):  # type: ignore[misc]  # wslink has no types
    """The websockets of a page."""

    async def handleWsRequest(self, request: web.BaseRequest) -> web.StreamResponse:
        """Talk to a browser until it goes away or says what is not of the page."""
        if len(self.connections) >= MOST_SOCKETS:
            raise web.HTTPServiceUnavailable(text="this page is open too often\n")
        socket = web.WebSocketResponse(
            timeout=_GOODBYE, max_msg_size=_MOST_BYTES, heartbeat=_HEART_BEAT,
            compress=self.web_app.ws_compress)
        safe(socket, request.headers["Host"])
        await socket.prepare(request)
        name = token_hex(8)
        self.connections[name] = socket
        self.web_app.shutdown_cancel()
        try:
            await self.onConnect(request, name)
            self.unchunkers[name] = _Parts()
            with suppress(ConnectionError):  # the browser goes away
                await self._listen(socket, name)
        finally:
            await self.onClose(name)
            del self.connections[name]
            self.authentified_client_ids.discard(name)
        return socket

    def getAuthenticatedWebsockets(self, *args: Any, **kwargs: Any) -> list[Any]:
        """Those that are open: what is meant for a closed one would keep the others waiting."""
        sockets = super().getAuthenticatedWebsockets(*args, **kwargs)
        return [socket for socket in sockets if socket is not None and not socket.closed]

    async def sendWrappedMessage(self, *args: Any, **kwargs: Any) -> None:
        """Send to browsers; one may go away meanwhile."""
        with suppress(ConnectionError, KeyError):
            await super().sendWrappedMessage(*args, **kwargs)

    async def sendWrappedError(self, *args: Any, **kwargs: Any) -> None:
        """Send to browsers; one may go away meanwhile."""
        with suppress(ConnectionError, KeyError):
            await super().sendWrappedError(*args, **kwargs)

    async def _listen(self, socket: web.WebSocketResponse, name: str) -> None:
        async for frame in socket:
            try:
                if frame.type is not WSMsgType.BINARY:
                    raise ValueError("a frame is binary")
                whole = self.unchunkers[name].process_chunk(frame.data)
                message = None if whole is None else checked_message(whole)
            except Exception as error:  # whatever its reader raises, the frame is malformed
                reason = str(error).encode()[:100].decode(errors="ignore")
                await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=reason.encode())
                return
            if message is not None:
                with self.network_monitor:
                    await self.onCompleteMessage(message, name)
