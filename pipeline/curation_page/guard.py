"""Access control of the server: only this machine's browser on the server's own pages; changes require a token.

- `Host` must be a loopback name of this server. This prevents DNS rebinding: a foreign name that resolves to 127.0.0.1
  is refused.
- GET and HEAD only read. POST changes something and requires the header `X-Booster-Lab-Token`, a JSON body and, if the
  browser sends `Origin`, the origin of this server. A page of another origin can't send that header without a CORS
  preflight, which is never granted.
- The token is generated at each start and shown only on the terminal, in the fragment of the address, which browsers
  do not send to servers.
"""

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from starlette.datastructures import Headers
from starlette.responses import JSONResponse, Response

from pipeline import loopback

TOKEN_HEADER = "x-booster-lab-token"
READING = ("GET", "HEAD")
MAX_BODY_BYTES = 2_000_000
"""Maximum size of a request's body."""

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
    """ASGI middleware that refuses requests and adds security headers to every response."""

    def __init__(self, app: App, token: str) -> None:
        self._app, self._token = app, token

    async def __call__(self, scope: Scope, receive: Callable[[], Awaitable[Any]], send: Callable[[Any], Any]) -> None:
        """Forward a request to the application, or refuse it."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return  # web sockets are not supported
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
        """The response that refuses a request; None if it is allowed."""
        host = headers.get("host", "")
        if not loopback.is_loopback(host):
            return _refused(421, f"this server answers only to {', '.join(loopback.NAMES)}")
        if method in READING:
            return None
        if method != "POST":
            return _refused(405, f"{method} is not allowed")
        if not loopback.is_same_origin(headers.get("origin"), host):
            return _refused(403, "pages of another origin can't change anything here")
        if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
            return _refused(403, "pages of another site can't change anything here")
        if headers.get("content-type", "").split(";")[0].strip() != "application/json":
            return _refused(415, "the body of a change must be a JSON object")
        if not hmac.compare_digest(headers.get(TOKEN_HEADER, "").encode(), self._token.encode()):
            return _refused(403, "the token is missing or old; open the address that the terminal shows")
        length = headers.get("content-length", "")
        if not length.isdecimal() or int(length) > MAX_BODY_BYTES:
            return _refused(413, f"a change requires the header Content-Length, of at most {MAX_BODY_BYTES} bytes")
        return None


def _refused(status: int, why: str) -> JSONResponse:
    return JSONResponse({"error": why}, status_code=status)
