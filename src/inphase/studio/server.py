"""The studio's server: for this computer alone, and there only for those who know its address."""

from __future__ import annotations

import errno
import logging
import secrets
import signal
import socket
import tempfile
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.resources import Resources
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.server.views.static_handler import StaticHandler
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPHeaders
from tornado.ioloop import IOLoop
from tornado.web import OutputTransform, StaticFileHandler

from inphase.errors import OptionError
from inphase.studio.desk import Choice, Desk
from inphase.studio.memory import Memory
from inphase.studio.page import fill
from inphase.studio.worker import Worker

HOST = "127.0.0.1"
FORGOTTEN = 60_000  # [ms] from when a page is closed until its commands are ended: it may only be loaded again
HEADERS = {
    "Referrer-Policy": "no-referrer",  # the token stands in the address
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    # Nothing from elsewhere, and no attribute that is a script: what a name holds is never run.
    "Content-Security-Policy": (
        "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; script-src-attr 'none'; "
        "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; object-src 'none'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
    ),
}


class Studio:
    """A server of the page of one folder, to be used as a context; raises OptionError where its port is taken."""

    def __init__(self, folder: Path, port: int = 0) -> None:
        self.folder = folder.resolve()
        self._token = secrets.token_urlsafe(24)
        _log_without(self._token)
        self._choice, self._memory = Choice(), Memory()
        self._workers: list[Worker] = []
        self._exits = ExitStack()
        try:
            listening = socket.create_server((HOST, port))
        except OSError as error:
            taken = "is taken" if error.errno == errno.EADDRINUSE else f"cannot be used: {error.strerror}"
            raise OptionError(f"--port: {port} {taken}; 0 takes one that is free") from None
        listening.setblocking(False)
        self.port: int = listening.getsockname()[1]
        self.address = f"http://{HOST}:{self.port}/{self._token}/"
        self._pages = Path(self._exits.enter_context(tempfile.TemporaryDirectory(prefix="inphase-studio-")))
        self._loop = IOLoop.current()
        web = _Web(
            {"/": Application(FunctionHandler(self._fill))},
            prefix=self._token,
            extra_websocket_origins=[f"{HOST}:{self.port}", f"localhost:{self.port}"],
            extra_patterns=[(r"/pages/(.*)", StaticFileHandler, {"path": str(self._pages)})],
            ico_path="none",
            use_index=False,
            unused_session_lifetime_milliseconds=FORGOTTEN,
            check_unused_sessions_milliseconds=5_000,
            include_headers=[],
            include_cookies=[],
            transforms=[_Headers],
            log_function=lambda handler: None,  # the address is a secret
        )
        http = HTTPServer(web)
        http.add_sockets([listening])
        self._server = BaseServer(self._loop, web, http)

    def __enter__(self) -> Studio:
        self._server.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for worker in self._workers:
            self._loop.asyncio_loop.run_until_complete(worker.closed())  # type: ignore[attr-defined]
        self._server.unlisten()
        self._server.stop()
        self._exits.close()

    def run(self) -> None:
        """Serve until Ctrl-C, or until the process is told to end."""
        asyncio_loop = self._loop.asyncio_loop  # type: ignore[attr-defined]
        for sent in (signal.SIGINT, signal.SIGTERM):
            with suppress(NotImplementedError):  # Windows: KeyboardInterrupt, below
                asyncio_loop.add_signal_handler(sent, self._loop.stop)
        with suppress(KeyboardInterrupt):
            self._loop.start()

    def _fill(self, document: Document) -> None:
        worker = Worker(self.folder, document.add_next_tick_callback)
        address, every = f"/{self._token}/pages", document.add_periodic_callback
        desk = Desk(self.folder, worker, self._pages, address, self._choice, self._memory, every)
        self._workers.append(worker)

        def remember() -> None:
            self._choice = desk.choice  # for when the page is loaded again

        def forget(context: Any) -> None:
            worker.close()
            self._workers.remove(worker)

        desk.listen(" ".join(Choice.__dataclass_fields__), remember)
        document.on_session_destroyed(forget)
        fill(document, desk)


def _log_without(secret: str) -> None:
    """What goes wrong in the server is printed on standard error, less the secret."""

    class Discreet(logging.Formatter):
        def format(self, record: logging.LogRecord) -> str:
            return super().format(record).replace(secret, "…")

    handler = logging.StreamHandler()
    handler.setFormatter(Discreet("%(levelname)s: %(message)s"))
    for name in ("bokeh", "tornado"):
        logger = logging.getLogger(name)
        logger.handlers, logger.propagate = [handler], False
        logger.setLevel(logging.ERROR)  # that a page was closed is no news


class _Web(BokehTornado):
    """It serves all that the page needs itself."""

    def resources(self, absolute_url: str | bool | None = None) -> Resources:
        return Resources(mode="server", root_url=f"{self.prefix}/", path_versioner=StaticHandler.append_version)


class _Headers(OutputTransform):
    """What every answer says to the browser."""

    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> tuple[int, HTTPHeaders, bytes]:
        for name in ("Server", "Access-Control-Allow-Origin", "Access-Control-Allow-Credentials"):
            headers.pop(name, None)
        headers.update(HEADERS)
        if headers.get("Content-Type", "").startswith("text/html"):
            headers["Cache-Control"] = "no-store"
        return status_code, headers, chunk
