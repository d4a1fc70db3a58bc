"""Which requests the viewer's page and that of `booster-lab play` answer: their own, and none of another origin."""

import inspect
import socket
import urllib.error
import urllib.request

import pytest
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from pipeline.viewing.page_server import page_server
from pipeline.viewing.play_page import PlayPage
from pipeline.viewing.viewer import Viewer

PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")


@pytest.fixture(scope="module", params=["127.0.0.1", "0.0.0.0"])
def server(request):
    """A server of this machine's alone, and one that others reach, which has any name."""
    made = page_server("127.0.0.1", 0, label="Booster Lab")
    if request.param == "0.0.0.0":  # the rules of an open address, without opening one
        made.stop()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("pipeline.loopback.is_loopback", lambda host: False)
            made = page_server("127.0.0.1", 0, label="Booster Lab")
    yield request.param, made.get_port()
    made.stop()


def joins(port: int, origin: str | None, host: str) -> bool:
    """Whether a web socket of a page is accepted and gets what the page shows."""
    with socket.create_connection(("127.0.0.1", port)) as raw:
        try:
            with connect(f"ws://{host}/", sock=raw, origin=origin, subprotocols=[PROTOCOL]) as joined:  # type: ignore
                return len(joined.recv(timeout=20)) > 0
        except InvalidStatus as error:
            assert error.response.status_code == 403
            return False


def test_the_page_itself_and_programs_are_answered(server):
    _, port = server
    assert joins(port, f"http://127.0.0.1:{port}", f"127.0.0.1:{port}")
    assert joins(port, f"http://localhost:{port}", f"localhost:{port}")
    assert joins(port, None, f"localhost:{port}")


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:1", "null", "http://[", "file://"])
def test_a_page_of_another_origin_gets_no_web_socket(server, origin):
    _, port = server
    assert not joins(port, origin, f"127.0.0.1:{port}")


def test_a_foreign_name_of_this_machine_is_answered_only_on_an_open_address(server):
    address, port = server
    foreign = f"evil.example:{port}"
    assert joins(port, f"http://{foreign}", foreign) == (address == "0.0.0.0")
    request = urllib.request.Request(f"http://127.0.0.1:{port}/", headers={"Host": foreign})
    if address == "0.0.0.0":
        assert urllib.request.urlopen(request, timeout=20).status == 200
        return
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(request, timeout=20)


def test_another_way_of_making_the_server_is_refused_instead_of_unguarded(monkeypatch):
    stopped = []

    class Other:
        def __init__(self, **_):
            pass

        def stop(self):
            stopped.append(self)

    monkeypatch.setattr(viser, "ViserServer", Other)
    with pytest.raises(RuntimeError, match="requests can't be checked"):
        page_server("127.0.0.1", 0, label="x")
    assert len(stopped) == 1


def test_every_page_of_viser_is_served_that_way_and_on_this_machine_unless_asked(root):
    files = [path for folder in ("pipeline", "assets") for path in (root / folder).rglob("*.py")]
    assert [path.name for path in files if "ViserServer(" in path.read_text()] == ["page_server.py"]
    assert inspect.signature(Viewer).parameters["host"].default == "127.0.0.1"
    assert "host" not in inspect.signature(PlayPage).parameters
    assert 'page_server("127.0.0.1", ' in inspect.getsource(PlayPage)
