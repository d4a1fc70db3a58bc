"""Animated viser pages, and a server that refuses requests from other origins.

Browsers let any page open a web socket to 127.0.0.1, and viser checks neither `Origin` nor `Host`. Without this check,
a web site that is open on the machine could read the viewer's data and operate the controls of `booster-lab play`.
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
"""Interval between two ticks [s]."""
_ONE_AT_A_TIME = threading.Lock()


class TickedPage(ABC):
    """A page with an animated scene. `step` does the work of one tick, so tests can call it directly."""

    server: viser.ViserServer

    @abstractmethod
    def step(self, passed_s: float) -> None:
        """One tick: read the controls, advance by `passed_s` of real time [s], update the scene."""

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
        """Print the address, optionally open it in the browser, run until Ctrl-C, then stop the server."""
        try:
            print(f"{self.url} plays {what}; stop with Ctrl-C", flush=True)
            if browser:
                webbrowser.open(self.url)
            with contextlib.suppress(KeyboardInterrupt):  # the normal end
                self.run()
        finally:
            self.stop()

    def stop(self) -> None:
        """Stop the server and free its port."""
        self.server.stop()


def page_server(host: str, port: int, label: str) -> viser.ViserServer:
    """Start a server on the first free port from `port` on.

    On a loopback host, only requests with a loopback name are allowed. On another host, any host name is allowed, but
    web sockets only from the page itself.

    Args:
        host: address to listen on
        port: first port to try
        label: title of the page
    """
    local = loopback.is_loopback(f"[{host}]" if ":" in host else host)
    serve, calls = websockets.asyncio.server.serve, []

    def guarded(*arguments: Any, process_request: Any, **options: Any) -> Any:
        def process(connection: ServerConnection, request: Request) -> Any:
            if is_allowed(request, local):
                return process_request(connection, request)
            return connection.respond(http.HTTPStatus.FORBIDDEN, "requests from pages of another origin are refused\n")

        calls.append(arguments)
        return serve(*arguments, process_request=process, **options)

    # viser passes no options to `websockets`, which starts the server in a thread during the construction
    with _ONE_AT_A_TIME, mock.patch.object(websockets.asyncio.server, "serve", guarded):
        server = viser.ViserServer(host=host, port=port, label=label, verbose=False)
    if not calls:
        server.stop()
        raise RuntimeError("this version of viser starts its server differently, so its requests can't be checked")
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    return server


def is_allowed(request: Request, local: bool) -> bool:
    """Whether a request comes from this server's page or a program; with `local`, only under a loopback name."""
    hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
    if len(hosts) != 1 or len(origins) > 1 or (local and not loopback.is_loopback(hosts[0])):
        return False
    return loopback.is_same_origin(origins[0] if origins else None, hosts[0])
