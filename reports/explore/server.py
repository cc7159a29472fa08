"""The server of the pages: on one port, for those who know the token, a page for each browser."""

from __future__ import annotations

import asyncio
import hmac
import os
import secrets
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aiohttp import web

from tympan.reports.explore.latest import prepared
from tympan.reports.explore.page import Page
from tympan.reports.explore.subject import Subject
from tympan.reports.explore.view import FilmView
from tympan.reports.template import template

#: How long a page whose browser went away is kept for it to come back [s].
_KEPT = 10.0
#: Pages at once; each has two processes.
_MOST = 8


@dataclass
class Explorer:
    """All pages of a subject.

    ``host`` and ``port`` are what is listened on, port 0 for any that is free; who asks without the
    ``token`` is refused.
    """

    subject: Subject
    start: FilmView
    host: str = "127.0.0.1"
    port: int = 0
    token: str = field(default_factory=lambda: secrets.token_urlsafe(16))
    pages: dict[str, _Served] = field(default_factory=dict)
    _runner: web.AppRunner | None = None
    _dropping: set[asyncio.Task[None]] = field(default_factory=set)

    @property
    def address(self) -> str:
        """What a browser opens."""
        host = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(self.host, self.host)
        return f"http://{host}:{self.port}/?token={self.token}"

    async def begin(self) -> None:
        """Listen."""
        # trame would read the command line of whoever it is in.
        os.environ["TRAME_ARGS"] = "--server"
        prepared()
        app = web.Application(middlewares=[self._guard])
        app.add_routes([web.get("/", self._new), web.get("/{page}/ws", self._connect),
                        web.get("/{page}/{path:.*}", self._asset)])
        self._runner = web.AppRunner(app)
        await self._runner.setup()
        await web.TCPSite(self._runner, self.host, self.port).start()
        self.port = self._runner.addresses[0][1]

    async def end(self) -> None:
        """Close all pages and listen no more."""
        for name in list(self.pages):
            await self._drop(name)
        if self._runner is not None:
            await self._runner.cleanup()

    @web.middleware
    async def _guard(self, request: web.Request,
                     handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
                     ) -> web.StreamResponse:
        """Refuse who does not know the token; who knew it once has it in a cookie."""
        given = request.query.get("token") or request.cookies.get(self._cookie, "")
        if not hmac.compare_digest(given.encode(), self.token.encode()):
            raise web.HTTPForbidden(text="the address needs the token that tympan printed\n")
        origin = request.headers.get("Origin")
        if origin is not None and origin.split("://")[-1] != request.host:
            raise web.HTTPForbidden(text="asked by a page from elsewhere\n")
        return await handler(request)

    @property
    def _cookie(self) -> str:
        return f"tympan-{self.port}"

    async def _new(self, request: web.Request) -> web.StreamResponse:
        if len(self.pages) >= _MOST:
            raise web.HTTPServiceUnavailable(text=f"{_MOST} pages are open: close one\n")
        name = secrets.token_hex(4)
        self.pages[name] = _Served.of(name, self.subject, self.start)
        socket = f"ws://{request.host}/{name}/ws"
        response = web.HTTPFound(f"/{name}/index.html?sessionURL={socket}")
        response.set_cookie(self._cookie, self.token, httponly=True, samesite="Strict")
        self._drop_later(name)
        raise response

    async def _connect(self, request: web.Request) -> web.StreamResponse:
        name = request.match_info["page"]
        if name not in self.pages:
            raise web.HTTPNotFound(text="this page was closed: open the address anew\n")
        served = self.pages[name]
        served.browsers += 1
        try:
            return await served.connected(request)
        finally:
            served.browsers -= 1
            self._drop_later(name)

    async def _asset(self, request: web.Request) -> web.StreamResponse:
        name, path = request.match_info["page"], request.match_info["path"]
        if name not in self.pages:
            raise web.HTTPFound("/")
        file = self.pages[name].file(path)
        if file is None:
            raise web.HTTPNotFound(text="there is no such file\n")
        return web.FileResponse(file)

    def _drop_later(self, name: str) -> None:
        async def drop() -> None:
            await asyncio.sleep(_KEPT)
            if name in self.pages and self.pages[name].browsers == 0:
                await self._drop(name)

        task = asyncio.get_running_loop().create_task(drop())
        self._dropping.add(task)
        task.add_done_callback(self._dropping.discard)

    async def _drop(self, name: str) -> None:
        await self.pages.pop(name).close()


@dataclass
class _Served:
    """A page with the trame server that it is the state of, and what connects browsers to it."""

    page: Page
    server: Any
    handler: Any
    running: Any
    browsers: int = 0

    @classmethod
    def of(cls, name: str, subject: Subject, start: FilmView) -> _Served:
        from trame_client import module
        from trame_client.ui.core import AbstractLayout
        from trame_client.widgets import html
        from trame_client.widgets.client import Style
        from trame_server import Server
        from trame_vtk.modules import common
        from wslink.backends.aiohttp import AioHttpWsHandler

        server = Server(name=name)
        server.client_type = "vue3"
        server.enable_module(module)
        server.enable_module(common)
        server.state.trame__title = f"tympan: {subject.name}"
        page = Page(server, subject, start)
        with AbstractLayout(server, html.Div(trame_server=server)) as layout:
            Style(template("reports/explore/page.css").render())
            layout.root.add_child(template("reports/explore/page.html").render())
        running = server.start(backend="generic", exec_mode="task", open_browser=False,
                               show_connection_info=False, disable_logging=True, timeout=0)
        return cls(page, server, AioHttpWsHandler(server.protocol, server._server), running)

    async def connected(self, request: web.Request) -> web.StreamResponse:
        """Talk to a browser until it goes away."""
        answer: web.StreamResponse = await self.handler.handleWsRequest(request)
        return answer

    def file(self, path: str) -> Path | None:
        """A file of trame's, None where there is none of that name."""
        head, _, tail = path.partition("/")
        folder = self.server.serve.get(head)
        if folder is None:
            folder, tail = self.server._www, path
        folder = Path(folder[0] if isinstance(folder, list | tuple) else folder).resolve()
        file = (folder / tail).resolve()
        return file if file.is_relative_to(folder) and file.is_file() else None

    async def close(self) -> None:
        """End its processes and its server."""
        self.page.close()
        await self.handler.disconnectClients()
        self.running.cancel()
        with suppress(asyncio.CancelledError):
            await self.running
