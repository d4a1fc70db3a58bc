"""Who may talk to the server: this machine's browser on its own pages, and for changes only with the token.

- A request whose `Host` is not this server's loopback name is refused, so that a foreign name that resolves to
  127.0.0.1 (DNS rebinding) reaches nothing.
- Only GET and HEAD read, and they change nothing. POST changes something and needs the header `X-Booster-Lab-Token`, an
  `Origin` that is this server's if the browser sends one, and a JSON body. A page of another origin can't send that
  header without a preflight, which is never answered.
- The token is made at each start and shown on the terminal alone, in the fragment of the address, which browsers send
  to no server.
"""

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from starlette.datastructures import Headers
from starlette.responses import JSONResponse, Response

from pipeline import loopback

TOKEN_HEADER = "x-booster-lab-token"
READING = ("GET", "HEAD")
MOST_BYTES = 2_000_000
"""Of a request's body."""

SECURITY_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}

Scope = MutableMapping[str, Any]
App = Callable[[Scope, Callable[[], Awaitable[Any]], Callable[[Any], Awaitable[None]]], Awaitable[None]]


class Guard:
    """ASGI middleware that refuses what is not allowed and adds the security headers to every answer."""

    def __init__(self, app: App, token: str) -> None:
        self._app, self._token = app, token

    async def __call__(self, scope: Scope, receive: Callable[[], Awaitable[Any]], send: Callable[[Any], Any]) -> None:
        """Pass a request on, or answer it with a refusal."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return  # no web sockets here
        refusal = self._refusal(str(scope["method"]), Headers(scope=scope))

        async def send_with_headers(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                own = list(message.get("headers", []))
                stated = {name.lower() for name, _ in own}
                more = [(name.lower().encode(), value.encode()) for name, value in SECURITY_HEADERS.items()]
                message = {**message, "headers": [*own, *(each for each in more if each[0] not in stated)]}
            await send(message)

        await (refusal or self._app)(scope, receive, send_with_headers)

    def _refusal(self, method: str, headers: Headers) -> Response | None:
        """The answer to a request that is not allowed; None if it is."""
        host = headers.get("host", "")
        if not loopback.is_loopback(host):
            return _refused(421, f"this server answers only to {', '.join(loopback.NAMES)}")
        if method in READING:
            return None
        if method != "POST":
            return _refused(405, f"{method} is not allowed")
        if not loopback.is_same_origin(headers.get("origin"), host):
            return _refused(403, "a page of another origin may change nothing here")
        if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
            return _refused(403, "a page of another site may change nothing here")
        if headers.get("content-type", "").split(";")[0].strip() != "application/json":
            return _refused(415, "a change is a JSON object")
        if not hmac.compare_digest(headers.get(TOKEN_HEADER, "").encode(), self._token.encode()):
            return _refused(403, "the token is missing or old; open the address that the terminal shows")
        length = headers.get("content-length", "")
        if not length.isdecimal() or int(length) > MOST_BYTES:
            return _refused(413, f"a change has a length, of at most {MOST_BYTES} bytes")
        return None


def _refused(status: int, why: str) -> JSONResponse:
    return JSONResponse({"error": why}, status_code=status)
