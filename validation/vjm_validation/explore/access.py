"""Who may ask for the page: requests and messages are checked before viser, which serves everybody, sees them."""

from __future__ import annotations

import hmac
import logging
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from http import HTTPStatus
from typing import Any

import viser
import websockets.asyncio.server as server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

HOST = "127.0.0.1"
"""Only programs on this computer reach the page."""
TOKEN_BYTES = 24
"""Of the token: 192 bits cannot be guessed."""
LARGEST_MESSAGE = 4096
"""Bytes of a message from a page. The longest, that of its camera, has some 300."""
MOST_PAGES = 16
"""Open at once: each has every drawing sent to it."""


class Access:
    """The rules by which requests and messages are let through.

    A browser sends the host that it was asked for, and the origin of the page that asks. Checking them keeps out
    the pages of other sites, also those whose name leads to this computer (DNS rebinding). The token in the address
    keeps out other users of this computer. A program that is no browser sends no origin, and needs the token.

    Attributes:
        token: first part of the path of the address.
        in_force: whether a server has been started that keeps to the rules.
    """

    def __init__(self, taken: Callable[[bytes | str], bytes | None]) -> None:
        """Make a token.

        Args:
            taken: what the page takes of a message; None for nothing. It raises nothing.
        """
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        self.in_force = False
        self._taken = taken

    def refusal(self, request: Request, port: int, pages: int) -> tuple[HTTPStatus, str] | None:
        """Why a request is refused; None where it is not.

        Args:
            request: of a browser or any program.
            port: of the server.
            pages: how many are open.
        """
        hosts = [f"{name}:{port}" for name in (HOST, "localhost")]
        headers, forbidden = request.headers, HTTPStatus.FORBIDDEN
        asked = headers.get_all("Host")
        if len(asked) != 1 or asked[0] not in hosts:
            return forbidden, f"This page is at {HOST} only.\n"
        origins = headers.get_all("Origin")
        if origins not in ([], [f"http://{asked[0]}"]):
            return forbidden, "Pages of other sites may not use this one.\n"
        if not hmac.compare_digest(_parts(request)[0].encode(), self.token.encode()):
            return forbidden, "Open the whole address that the command printed.\n"
        if headers.get_all("Upgrade"):
            if f"viser-v{viser.__version__}" not in ",".join(headers.get_all("Sec-WebSocket-Protocol")).split(","):
                return HTTPStatus.BAD_REQUEST, f"This page speaks viser-v{viser.__version__}.\n"
            if pages >= MOST_PAGES:
                return HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_PAGES} pages are open already: close one.\n"
        return None

    @contextmanager
    def kept(self) -> Iterator[None]:
        """While viser starts its server: that server keeps to the rules. viser itself has no place for them."""
        access, serve = self, server.serve

        class Connection(server.ServerConnection):
            async def recv(self, decode: bool | None = None) -> Any:  # noqa: ANN401  (text or bytes)
                while True:
                    message = access._taken(await super().recv(decode))
                    if message is not None:
                        return message

        def serve_kept(handler: Any, host: str, port: int, **options: Any) -> server.serve:  # noqa: ANN401
            files = options.pop("process_request")

            def process_request(connection: server.ServerConnection, request: Request) -> Response | None:
                refused = access.refusal(request, port, len(connection.server.connections))
                if refused is not None:
                    return connection.respond(*refused)
                response: Response | None = files(connection, replace(request, path=_parts(request)[1]))
                return None if response is None else _private(response)

            options |= {"max_size": LARGEST_MESSAGE, "create_connection": Connection, "logger": _silent()}
            access.in_force = True
            return serve(handler, host, port, process_request=process_request, **options)

        server.serve = serve_kept  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            server.serve = serve  # type: ignore[misc]


def _parts(request: Request) -> tuple[str, str]:
    """The first part of a request's path, and the path behind it."""
    first, _, rest = request.path.partition("?")[0].removeprefix("/").partition("/")
    return first, f"/{rest}"


def _private(response: Response) -> Response:
    """The same, which a browser keeps for itself: neither its address nor a copy goes elsewhere."""
    headers = Headers(response.headers)
    headers["Referrer-Policy"] = "no-referrer"
    headers["Cache-Control"] = "no-store"
    return replace(response, headers=headers)


def _silent() -> logging.Logger:
    """A log that nobody reads: what foreign programs send wrongly is no news of the machine."""
    logger = logging.getLogger(f"{__name__}.connections")
    logger.propagate = False
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
    return logger
