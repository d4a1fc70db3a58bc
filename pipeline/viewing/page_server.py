"""A page of viser that moves, and its server, which answers no page of another origin.

A browser lets any page open a web socket to 127.0.0.1, and viser looks at neither `Origin` nor `Host`: without this,
a web site that is open on the machine could read what the viewer shows and move the controls of `booster-lab play`.
"""

import contextlib
import http
import threading
import time
import webbrowser
from abc import ABC, abstractmethod
from typing import Any, NoReturn
from unittest import mock

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request

from pipeline import loopback

TICK_S = 1.0 / 30.0
"""Time between two pictures [s]."""
_ONE_AT_A_TIME = threading.Lock()


class TickedPage(ABC):
    """A page whose scene moves. `step` does the work of a tick, so that a test drives it alone."""

    server: viser.ViserServer

    @abstractmethod
    def step(self, passed_s: float) -> None:
        """One tick: read the controls, advance by `passed_s` [s] of real time, move what is shown."""

    def run(self) -> NoReturn:
        """Tick until interrupted."""
        last = time.monotonic()
        while True:
            time.sleep(TICK_S)
            now = time.monotonic()
            self.step(now - last)
            last = now

    @property
    def url(self) -> str:
        host = self.server.get_host()
        return f"http://{'localhost' if host in ('0.0.0.0', '127.0.0.1') else host}:{self.server.get_port()}"

    def serve(self, what: str, *, browser: bool) -> None:
        """Print the address, open it in the browser if wanted, run until Ctrl-C, end the server."""
        try:
            print(f"{self.url} plays {what}; stop with Ctrl-C", flush=True)
            if browser:
                webbrowser.open(self.url)
            with contextlib.suppress(KeyboardInterrupt):  # the way to end it
                self.run()
        finally:
            self.stop()

    def stop(self) -> None:
        """End the server; its port is free again."""
        self.server.stop()


def page_server(host: str, port: int, label: str) -> viser.ViserServer:
    """A server on the first free port from `port` on, whose page has the title `label`.

    On a loopback address the page is reached under names of this machine alone; on another one under whatever name that
    has, and web sockets come from the page itself only.
    """
    local = loopback.is_loopback(f"[{host}]" if ":" in host else host)
    serve, calls = websockets.asyncio.server.serve, []

    def guarded(*arguments: Any, process_request: Any, **options: Any) -> Any:
        def process(connection: ServerConnection, request: Request) -> Any:
            if is_allowed(request, local):
                return process_request(connection, request)
            return connection.respond(http.HTTPStatus.FORBIDDEN, "a page of another origin is not answered\n")

        calls.append(arguments)
        return serve(*arguments, process_request=process, **options)

    # viser hands no option on to `websockets`, which it asks for a server in a thread of its own while it is made
    with _ONE_AT_A_TIME, mock.patch.object(websockets.asyncio.server, "serve", guarded):
        server = viser.ViserServer(host=host, port=port, label=label, verbose=False)
    if not calls:
        server.stop()
        raise RuntimeError("this version of viser makes its server in another way; its requests can't be checked")
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    return server


def is_allowed(request: Request, local: bool) -> bool:
    """Whether a request is from this server's page or a program; `local`: only this machine's names are its own."""
    hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
    if len(hosts) != 1 or len(origins) > 1 or (local and not loopback.is_loopback(hosts[0])):
        return False
    return loopback.is_same_origin(origins[0] if origins else None, hosts[0])
