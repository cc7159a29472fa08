"""The server of the pages: on one port, for those who know the token, a page for each browser."""

from __future__ import annotations

import asyncio
import hmac
import logging
import os
import re
import secrets
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aiohttp import web

from tympan.explore.door import Door, check
from tympan.explore.latest import prepared
from tympan.explore.page import Page
from tympan.explore.subject import Subject
from tympan.explore.talk import Talk
from tympan.explore.view import FilmView
from tympan.reports.template import template, text_of

#: How long a page whose browser went away is kept for it to come back [s].
_KEPT = 10.0
#: Pages at once; each has two processes.
_MOST = 8
#: How long connections may take to end with the server [s].
_GOODBYE = 2.0
#: Libraries that print what others send, with tracebacks; what is ours is reported in a line.
_CHATTY = ("aiohttp", "wslink", "trame_server")
#: Scripts that stand in trame's page itself: its picture of waiting, which its policy forbids.
_INLINE = re.compile(r"<script>.*?</script>", re.DOTALL)
_WAITING = "<p>The page is being prepared.</p>"


@dataclass
class Explorer:
    """All pages of a subject.

    ``host`` and ``port`` are what is listened on, port 0 for any that is free; who asks without the
    ``token`` is refused. ``report`` gets a line where the server itself makes a mistake.
    """

    subject: Subject
    start: FilmView
    host: str = "127.0.0.1"
    port: int = 0
    token: str = field(default_factory=lambda: secrets.token_urlsafe(16))
    report: Callable[[str], object] = print
    pages: dict[str, _Served] = field(default_factory=dict)
    _door: Door | None = None
    _runner: web.ServerRunner | None = None
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
        for name in _CHATTY:
            _silence(name)
        self._door = Door(self._answer, self.report)
        self._runner = web.ServerRunner(self._door, shutdown_timeout=_GOODBYE)
        await self._runner.setup()
        await web.TCPSite(self._runner, self.host, self.port).start()
        self.port = self._runner.addresses[0][1]

    async def end(self) -> None:
        """Close all pages and listen no more."""
        for name in list(self.pages):
            await self._drop(name)
        if self._runner is not None:
            await self._runner.cleanup()

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        """Answer a request of who knows the token; who knew it once has it in a cookie."""
        check(request, self.host)
        given = request.query.get("token") or request.cookies.get(self._cookie, "")
        if not hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode()):
            raise web.HTTPForbidden(text="the address needs the token that tympan printed\n")
        assert self._door is not None
        self._door.let_in(request)
        name, _, path = request.path.removeprefix("/").partition("/")
        if not name:
            return self._new(request)
        if path == "ws":
            return await self._connect(request, name)
        return self._asset(name, path)

    @property
    def _cookie(self) -> str:
        return f"tympan-{self.port}"

    def _new(self, request: web.BaseRequest) -> web.StreamResponse:
        if len(self.pages) >= _MOST:
            raise web.HTTPServiceUnavailable(text=f"{_MOST} pages are open: close one\n")
        name = secrets.token_hex(4)
        self.pages[name] = _Served.of(name, self.subject, self.start, self.report)
        socket = f"ws://{request.host}/{name}/ws"
        response = web.Response(status=302, headers={
            "Location": f"/{name}/index.html?sessionURL={socket}"})
        response.set_cookie(self._cookie, self.token, httponly=True, samesite="Strict")
        self._drop_later(name)
        return response

    async def _connect(self, request: web.BaseRequest, name: str) -> web.StreamResponse:
        if name not in self.pages:
            raise web.HTTPNotFound(text="this page was closed: open the address anew\n")
        served = self.pages[name]
        served.browsers += 1
        try:
            return await served.connected(request)
        finally:
            served.browsers -= 1
            self._drop_later(name)

    def _asset(self, name: str, path: str) -> web.StreamResponse:
        if name not in self.pages:
            raise web.HTTPFound("/")
        page = self.pages[name]
        if path == "index.html":
            return web.Response(text=page.index(), content_type="text/html")
        if path == "page.css":
            return web.Response(text=text_of("explore/page.css"), content_type="text/css")
        file = page.file(path)
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
    def of(cls, name: str, subject: Subject, start: FilmView,
           report: Callable[[str], object]) -> _Served:
        from trame_client import module
        from trame_client.ui.core import AbstractLayout
        from trame_client.widgets import html
        from trame_server import Server
        from trame_vtk.modules import common

        server = Server(name=name)
        server.client_type = "vue3"
        server.enable_module(module)
        server.enable_module(common)
        server.state.trame__title = f"tympan: {subject.name}"
        page = Page(server, subject, start)
        with AbstractLayout(server, html.Div(trame_server=server)) as layout:
            layout.root.add_child(template("explore/page.html").render())
        running = server.start(backend="generic", exec_mode="task", open_browser=False,
                               show_connection_info=False, disable_logging=True, timeout=0)
        server.controller.on_exception.add(
            lambda error: report(f"the explorer's page: {type(error).__name__}: {error}"))
        return cls(page, server, Talk(server.protocol, server._server), running)

    async def connected(self, request: web.BaseRequest) -> web.StreamResponse:
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
        try:
            file = (folder / tail).resolve()
            return file if file.is_relative_to(folder) and file.is_file() else None
        except (OSError, ValueError):  # too long for a file's name, or with NUL
            return None

    def index(self) -> str:
        """The page itself: trame's, with its style in a file and without scripts within."""
        html = (Path(self.server._www) / "index.html").read_text(encoding="utf-8")
        html = _INLINE.sub("", html)
        html = html.replace("</head>", '<link rel="stylesheet" href="page.css"></head>', 1)
        return html.replace('<div id="app"></div>', f'<div id="app">{_WAITING}</div>', 1)

    async def close(self) -> None:
        """End its processes and its server."""
        self.page.close()
        await self.handler.disconnectClients()
        self.running.cancel()
        with suppress(asyncio.CancelledError):
            await self.running


def _silence(name: str) -> None:
    """Let a library print nothing."""
    logger = logging.getLogger(name)
    logger.addHandler(logging.NullHandler())
    logger.propagate = False
