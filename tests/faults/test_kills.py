"""Work killed at random moments, and work on a disk that is full from some moment on: nothing is lost or half there."""

import contextlib
import errno
import multiprocessing
import os
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.factories.interrupted import WORKS, refused, run
from tests.factories.small_disk import PAGE, ROOMY, SmallDisk, why_unavailable

KILLS = {"database swap": 9, "ingest": 9, "approval": 6, "training start": 6}
"""30 kills in all."""
FULL_DISKS = {"database swap": 3, "ingest": 3, "approval": 1, "training start": 3}
"""10 moments at which the disk is full."""
SEED = 37
SERVER = multiprocessing.get_context("forkserver")
SERVER.set_forkserver_preload(["tests.factories.interrupted", "tests.factories.small_disk"])


def started(name: str, folder: Path):
    """The work in a process of its own, from when it begins."""
    ready = SERVER.Event()
    process = SERVER.Process(target=worker, args=(name, str(folder), ready))
    process.start()
    assert ready.wait(60.0)
    return process


def worker(name: str, folder: str, ready) -> None:
    ready.set()
    run(name, Path(folder))


@pytest.fixture(scope="module")
def prepared(tmp_path_factory) -> dict[str, Path]:
    """What each work starts from."""
    folders = {name: tmp_path_factory.mktemp(name.replace(" ", "_")) for name in WORKS}
    for name, folder in folders.items():
        WORKS[name].prepare(folder)
    return folders


@pytest.mark.parametrize("name", WORKS)
def test_work_that_is_killed_leaves_a_whole_state_and_is_done_by_the_next(prepared, tmp_path, name):
    rng = np.random.default_rng([SEED, *name.encode()])
    lengths_s = []
    for number in range(3):  # the first one also loads code and fills caches
        folder = shutil.copytree(prepared[name], tmp_path / f"timed{number}", symlinks=True)
        whole = started(name, folder)
        begun = time.monotonic()
        whole.join(60.0)
        lengths_s.append(time.monotonic() - begun)
        assert whole.exitcode == 0 and WORKS[name].check(folder) == "after"
    length_s = min(lengths_s)
    killed = 0
    for number in range(4 * KILLS[name]):  # some are done before their moment
        folder = shutil.copytree(prepared[name], tmp_path / f"kill{number}", symlinks=True)
        process = started(name, folder)
        time.sleep(float(rng.uniform(0.0, length_s)))
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGKILL)
        process.join()
        killed += process.exitcode == -signal.SIGKILL
        WORKS[name].check(folder)
        assert refused(name, folder) == ""
        assert WORKS[name].check(folder) == "after"
        if killed == KILLS[name]:
            break
    assert killed == KILLS[name], "the kills came too late to test anything"


WRITES = {"open", "os.mkdir", "os.rename"}
"""Events of the interpreter's audit by which a file system changes."""


class FullDisk:
    """Counts the writes below a folder, and refuses them from a number on."""

    def __init__(self) -> None:
        self.below, self.count, self.allowed = "", 0, -1

    def hook(self, event: str, arguments: tuple) -> None:
        if not self.below or event not in WRITES or not str(arguments[0]).startswith(self.below):
            return
        reads = event == "open" and not (isinstance(arguments[1], str) and set(arguments[1]) & set("wax+"))
        if reads and not (event == "open" and arguments[1] is None and arguments[2] & (os.O_WRONLY | os.O_RDWR)):
            return
        self.count += 1
        if 0 <= self.allowed < self.count:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(arguments[0]))

    @contextlib.contextmanager
    def __call__(self, folder: Path, allowed: int) -> Iterator[None]:
        self.below, self.count, self.allowed = str(folder), 0, allowed
        try:
            yield
        finally:
            self.below = ""


DISK = FullDisk()
sys.addaudithook(DISK.hook)


@pytest.mark.parametrize("name", WORKS)
def test_where_no_file_can_be_made_work_is_a_sentence_and_what_was_there_stays(prepared, tmp_path, name):
    folder = shutil.copytree(prepared[name], tmp_path / "counted", symlinks=True)
    with DISK(folder, -1):
        assert refused(name, folder) == ""
    writes = DISK.count
    assert writes > FULL_DISKS[name]
    for number in range(FULL_DISKS[name]):
        folder = shutil.copytree(prepared[name], tmp_path / f"full{number}", symlinks=True)
        with DISK(folder, number * writes // FULL_DISKS[name]):
            sentence = refused(name, folder)
        assert sentence == "" or "No space left" in sentence, sentence
        WORKS[name].check(folder)
        assert refused(name, folder) == ""
        assert WORKS[name].check(folder) == "after"


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    """Where a small disk is mounted."""
    folder = tmp_path_factory.mktemp("disk")
    reason = why_unavailable(SERVER, folder)
    if reason:
        pytest.skip(reason)
    return folder


def on_small_disk(name: str, source: str, place: str, share: float, answers) -> None:
    """The work on a disk with room for a share of what it writes, then again with room for all of it.

    Answers the bytes that it writes, the sentence on the full disk, the state that it leaves, and the sentence and
    the state of the repetition.
    """
    disk = SmallDisk(Path(place))
    whole = shutil.copytree(source, Path(place) / "whole", symlinks=True)
    before = disk.used
    refused(name, whole)
    written = disk.used - before
    folder = shutil.copytree(source, Path(place) / "project", symlinks=True)
    disk.leave(int(share * written) // PAGE * PAGE)
    sentence = refused(name, folder)
    state = WORKS[name].check(folder)
    disk.leave(ROOMY)
    again = refused(name, folder)
    answers.put((written, sentence, state, again, WORKS[name].check(folder)))


@pytest.mark.parametrize("name", WORKS)
def test_on_a_full_disk_work_names_it_and_is_done_once_there_is_room(prepared, place, name):
    rng = np.random.default_rng([SEED, *name.encode()])
    for share in rng.uniform(0.0, 1.0, FULL_DISKS[name]):
        answers = SERVER.SimpleQueue()
        arguments = (name, str(prepared[name]), str(place), float(share), answers)
        process = SERVER.Process(target=on_small_disk, args=arguments)
        process.start()
        process.join(120.0)
        assert process.exitcode == 0
        written, sentence, state, again, state_again = answers.get()
        assert written >= PAGE
        assert "No space left" in sentence, (share, sentence, state)
        assert (again, state_again) == ("", "after")
