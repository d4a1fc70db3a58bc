"""Serve the page to this machine alone."""

from __future__ import annotations

import secrets
import socket
from pathlib import Path

import uvicorn

from pipeline import loopback
from pipeline.curation_page.app import make_app
from pipeline.curation_page.workplace import Workplace
from pipeline.errors import PipelineError

PORTS_TRIED = 20


class CurationServer:
    """The server on the first free port from `port` on.

    `url` opens it with the token of this start; whoever has that address may change the project's curation.
    """

    def __init__(self, root: Path, robot: str, port: int) -> None:
        self.token = secrets.token_urlsafe(24)
        self._socket = _free_socket(port)
        self.port = int(self._socket.getsockname()[1])
        workplace = Workplace(root, robot)
        workplace.clips()  # before the address is shown, so that the first page has nothing to wait for
        workplace.make_first_thumbnails()
        app = make_app(workplace, self.token)
        config = uvicorn.Config(app, log_level="warning", access_log=False, server_header=False, ws="none")
        self._server = uvicorn.Server(config)

    @property
    def url(self) -> str:
        return f"http://{loopback.ADDRESS}:{self.port}/#token={self.token}"

    def run(self) -> None:
        """Serve until interrupted."""
        self._server.run(sockets=[self._socket])

    def stop(self) -> None:
        """Let `run` return."""
        self._server.should_exit = True


def _free_socket(port: int) -> socket.socket:
    """A socket bound to the first free port of this machine's loopback. Raises PipelineError."""
    for each in range(port, min(port + PORTS_TRIED, 65536)) if port else [0]:
        found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            found.bind((loopback.ADDRESS, each))
        except OSError:
            found.close()
            continue
        return found
    raise PipelineError(f"no port from {port} to {port + PORTS_TRIED - 1} is free; name another one with --port.")
