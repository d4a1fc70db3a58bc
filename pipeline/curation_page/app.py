"""Routes of the curator's page. GET requests read; POST requests change something and are checked by `guard`."""

import json
import re
import secrets
import socket
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from pipeline import loopback
from pipeline.curation_page.clip_details import proposals
from pipeline.curation_page.clip_table import DATABASE, NoClipError, asset_of
from pipeline.curation_page.guard import Guard
from pipeline.curation_page.thumbnail_process import ThumbnailProcess
from pipeline.curation_page.workplace import Runs, Workplace
from pipeline.errors import PipelineError, UnknownNameError
from pipeline.feedback.approve import approve_proposal, decline_proposal, take_back_sections
from pipeline.files.csv_json import without_nan
from pipeline.release.page import style_source

STATIC = Path(__file__).parent / "static"
KEY = re.compile(r"[0-9a-f]{32}")
IMMUTABLE = {"Cache-Control": "private, max-age=31536000, immutable"}
"""Headers of content that is addressed by its digest and thus never changes."""
NO_STORE = {"Cache-Control": "no-store"}


class RequestError(PipelineError):
    """A request with a missing or invalid field."""


def make_app(workplace: Workplace, token: str) -> Guard:
    """The ASGI application.

    Args:
        workplace: the project to show
        token: token that each change requires
    """
    runs = Runs(workplace)
    thumbnail_process: list[ThumbnailProcess] = []

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        thumbnail_process.append(ThumbnailProcess(workplace.project.root, workplace.robot_name))
        yield
        thumbnail_process.pop().stop()
        runs.stop()

    def state(_: Mapping[str, Any]) -> dict[str, Any]:
        making = thumbnail_process[0] if thumbnail_process else None
        thumbnails = {"made": making.made, "total": making.total} if making else {"made": 0, "total": 0}
        database = asset_of(DATABASE, workplace.robot_name)
        versions = {"version": workplace.version(), "answers": workplace.answers_version()}
        return {"database": database, **versions, "thumbnails": thumbnails, **runs.state()}

    reads = {
        "clip": lambda query: workplace.clip(_text(query, "name")),
        "databases": lambda _: workplace.versions(),
        "compare": lambda query: workplace.compare(_text(query, "before"), _text(query, "after")),
        "proposals": lambda _: proposals(workplace.project.feedback),
        "decisions": lambda _: [vars(each) for each in workplace.decisions()],
        "state": state,
    }
    changes = {
        "decide": lambda value: workplace.decide(
            _texts(value, "clips"), _text(value, "verdict"), _text(value, "by"), _text(value, "why")
        ),
        "take_back": lambda value: workplace.take_back(_texts(value, "clips")),
        "run": lambda _: runs.start(),
        "rerun": lambda value: runs.start_again(_texts(value, "clips")),
        "stop": lambda _: runs.stop(),
        "approve": lambda value: approve_proposal(
            workplace.project.feedback, _text(value, "proposal"), _text(value, "by"), sections=_texts(value, "sections")
        ),
        "decline": lambda value: decline_proposal(
            workplace.project.feedback, _text(value, "proposal"), _text(value, "by"), sections=_texts(value, "sections")
        ),
        "take_back_sections": lambda value: take_back_sections(
            workplace.project.feedback, _texts(value, "sections"), _text(value, "by")
        ),
    }
    routes = [
        Route("/", _index),
        *(Route(path, _release(workplace)) for path in ("/release", "/release/{robot}")),
        Route("/api/clips", _answered(lambda *_: _bytes(workplace.clips(), "application/json"))),
        Route(
            "/api/motion", _answered(lambda request, _: _bytes(workplace.motion(_text(request.query_params, "name"))))
        ),
        Route("/thumbnails/{key}", _answered(partial(_thumbnail, workplace))),
        *(Route(f"/api/{name}", _answered(partial(_read, function))) for name, function in reads.items()),
        *(Route(f"/api/{name}", _answered(partial(_change, each)), methods=["POST"]) for name, each in changes.items()),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    return Guard(Starlette(routes=routes, lifespan=lifespan), token)


async def _index(_: Request) -> Response:
    return FileResponse(STATIC / "index.html", headers=NO_STORE)


def _release(workplace: Workplace) -> Callable[[Request], Any]:
    """Route of the release report, a self-contained page without scripts."""
    policy = f"default-src 'none'; img-src data:; style-src {style_source()}; frame-ancestors 'none'"

    async def answer(request: Request) -> Response:
        robot = request.path_params.get("robot", workplace.robot_name)
        try:
            path = workplace.release_report(robot)
        except UnknownNameError as error:
            return PlainTextResponse(f"{error}\n", status_code=404)
        if path is None:
            command = f"dagster asset materialize --select {asset_of('release_report', robot)}"
            return PlainTextResponse(f"There is no release report yet. Run: {command}\n", status_code=404)
        return FileResponse(path, headers={**NO_STORE, "Content-Security-Policy": policy})

    return answer


def _answered(work: Callable[[Request, bytes], Response]) -> Callable[[Request], Any]:
    """Route that calls `work(request, body)` in a thread and turns errors into JSON with a message."""

    async def answer(request: Request) -> Response:
        body = await request.body()
        try:
            return await run_in_threadpool(work, request, body)
        except (UnknownNameError, NoClipError) as error:
            return JSONResponse({"error": str(error)}, status_code=404)
        except PipelineError as error:
            return JSONResponse({"error": str(error)}, status_code=400)
        except OSError as error:
            return JSONResponse({"error": f"reading or writing a file failed: {error}"}, status_code=500)

    return answer


def _bytes(data: bytes, media: str = "application/octet-stream") -> Response:
    return Response(data, media_type=media, headers=NO_STORE)


def _read(function: Callable[[Mapping[str, Any]], Any], request: Request, _: bytes) -> Response:
    return JSONResponse(without_nan(function(request.query_params)), headers=NO_STORE)


def _thumbnail(workplace: Workplace, request: Request, _: bytes) -> Response:
    key = request.path_params["key"]
    data = workplace.thumbnail(key) if KEY.fullmatch(key) else None
    if data is None:
        return JSONResponse({"error": "there is no thumbnail with this name"}, status_code=404)
    return Response(data, media_type="application/octet-stream", headers=IMMUTABLE if data else NO_STORE)


def _change(function: Callable[[Mapping[str, Any]], Any], _: Request, body: bytes) -> Response:
    try:
        value = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise RequestError("the request is not valid JSON") from error
    if not isinstance(value, dict):
        raise RequestError("the request is not a JSON object")
    return JSONResponse({"done": function(value)}, headers=NO_STORE)


def _text(value: Mapping[str, Any], name: str) -> str:
    found = value.get(name)
    if not isinstance(found, str) or not found.strip():
        raise RequestError(f"'{name}' is missing")
    return found.strip()


def _texts(value: Mapping[str, Any], name: str) -> list[str]:
    found = value.get(name, [])
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise RequestError(f"'{name}' is not a list of texts")
    return found


PORTS_TRIED = 20


class CurationServer:
    """The server, on the first free port from `port` on.

    `url` contains the token of this start; anyone with this address can change the project's curation.
    """

    def __init__(self, root: Path, robot: str, port: int) -> None:
        self.token = secrets.token_urlsafe(24)
        self._socket = _free_socket(port)
        self.port = int(self._socket.getsockname()[1])
        workplace = Workplace(root, robot)
        workplace.clips()  # before the address is shown, so that the first page loads at once
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
        """Make `run` return."""
        self._server.should_exit = True


def _free_socket(port: int) -> socket.socket:
    """A socket bound to the first free loopback port. Raises PipelineError."""
    for each in range(port, min(port + PORTS_TRIED, 65536)) if port else [0]:
        found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            found.bind((loopback.ADDRESS, each))
        except OSError:
            found.close()
            continue
        return found
    raise PipelineError(f"no port from {port} to {port + PORTS_TRIED - 1} is free; choose another one with --port.")
