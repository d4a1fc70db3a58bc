"""Requests that a server of this machine answers: those of its own pages, under a name of this machine.

A browser sends a page's origin with each web socket and each POST, and the name that the page was opened under with
every request. A foreign name that resolves to 127.0.0.1 (DNS rebinding) and a page of another origin are so told apart.
"""

from urllib.parse import urlsplit

ADDRESS = "127.0.0.1"
NAMES = (ADDRESS, "localhost", "[::1]")
"""Names of this machine in the header `Host`."""


def is_loopback(host: str) -> bool:
    """Whether the header `Host`, with or without a port, names this machine."""
    name, _, port = host.rpartition(":")
    return (name if name and port.isdecimal() else host).lower() in NAMES


def is_same_origin(origin: str | None, host: str) -> bool:
    """Whether the header `Origin` is a page of the server that `Host` names; programs send none, which is allowed."""
    if origin is None:
        return True
    try:
        return bool(host) and urlsplit(origin).netloc.lower() == host.lower()
    except ValueError:  # such as http://[
        return False
