"""A Dask cluster gives the bytes of a local run, whatever its workers had installed and whichever of them dies."""

import ctypes
import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store, cluster, run_files, run_stage
from pipeline.batch.cluster import ClusterError
from pipeline.batch.shipped_code import CODE, ShippedCode, digest_of
from pipeline.clips.outcome import Outcome, Piece
from pipeline.errors import PipelineError, UnknownNameError
from pipeline.feasibility import FeasibilitySettings, process
from pipeline.files import settings
from pipeline.robot import load_robot
from tests.factories.robot_clips import wandering

LOG = logging.getLogger("test")
HERE = ClipPool(backend="sequential")
STARTS_WITHIN_S = 90.0
"""Of a scheduler and its workers on a busy machine."""


@contextmanager
def dask(*arguments: str, folder: Path, **environment: str) -> Iterator[subprocess.Popen]:
    """`dask <arguments>` in a process of its own, in a folder where the project is not."""
    command = [sys.executable, "-m", "dask", *arguments]
    log = (folder / f"{arguments[0]}_{time.monotonic_ns()}.log").open("w")
    process = subprocess.Popen(
        command, cwd=folder, env={**os.environ, **environment}, stdout=log, stderr=subprocess.STDOUT
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        log.close()


@contextmanager
def two_workers(folder: Path, **environment: str) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """A scheduler's address and two worker processes on loopback; the project that the workers know is an old one."""
    old = folder / "old" / "pipeline"
    old.mkdir(parents=True)
    (old / "__init__.py").write_text("raise RuntimeError('the code of the workers before they joined')\n")
    given = {"PYTHONPATH": str(old.parent), **environment}
    facts = folder / "scheduler.json"
    here = ("--host", "127.0.0.1", "--scheduler-file", str(facts))
    with dask("scheduler", *here, "--port", "0", "--no-dashboard", folder=folder, **given):
        work = ("worker", "--scheduler-file", str(facts), "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny")
        with (
            dask(*work, "--no-dashboard", folder=folder, **given) as first,
            dask(*work, "--no-dashboard", folder=folder, **given) as second,
        ):
            from distributed import Client

            end = time.monotonic() + STARTS_WITHIN_S
            while not facts.is_file() and time.monotonic() < end:
                time.sleep(0.1)
            with Client(scheduler_file=str(facts), timeout=STARTS_WITHIN_S, set_as_default=False) as client:
                client.wait_for_workers(2, timeout=STARTS_WITHIN_S)
                address = client.scheduler.address
            try:
                yield address, [first, second]
            finally:
                cluster.disconnect()


@pytest.fixture(scope="module")
def judged(root) -> Stage:
    """KP5 of the T1: a stage that takes its time, uses the robot's model and stores what it keeps."""
    values = settings.read(root / "data/feasibility.yaml", FeasibilitySettings)
    function = partial(process, settings=values, robot=load_robot(root / "robots/t1"))
    return Stage(name="judged", version="1", function=function)


def clips(store: Store, root: Path, count: int, seconds: float = 4.0) -> Manifest:
    robot = load_robot(root / "robots/t1")
    entries = []
    for seed in range(count):
        clip = wandering(robot, seconds=seconds, seed=seed)
        entries.append(Entry(clip=f"clip{seed:02d}", blob=store.put_clip(clip), numbers={"seconds": seconds}))
    return Manifest(stage="before", entries=tuple(entries), judged=())


def killing(worker: subprocess.Popen, next_done: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """`next_done` that kills a worker once the first task is done, while others are under way."""

    def done(tasks: Any) -> Any:
        found = next_done(tasks)
        if worker.poll() is None:
            worker.kill()
        return found

    return done


def test_two_workers_one_of_them_killed_give_the_bytes_of_a_local_run(tmp_path, root, judged, caplog, monkeypatch):
    here, there = Store(root=tmp_path / "here"), Store(root=tmp_path / "there")
    alone = run_stage(judged, clips(here, root, 24), here, HERE, LOG)
    before = clips(there, root, 24)
    with two_workers(tmp_path) as (address, workers):
        pool = ClipPool(backend="dask", address=address)
        monkeypatch.setattr(cluster._Tasks, "next_done", killing(workers[0], cluster._Tasks.next_done))
        with caplog.at_level(logging.INFO):
            spread = run_stage(judged, before, there, pool, LOG)
        assert workers[0].wait(10) == -signal.SIGKILL
        assert cluster.connected(address, 0).workers == 1
    assert spread.to_text() == alone.to_text()
    assert {path.name for path in there.root.glob("blobs/*/*")} == {path.name for path in here.root.glob("blobs/*/*")}
    assert f"judged: dask: 2 workers, scheduler {address}, dashboard http" in caplog.text
    assert not list(there.root.glob(".shared.*"))


def test_a_clip_that_kills_its_workers_costs_only_itself(tmp_path, root):
    def deadly(clip, numbers):
        if clip.name == "clip03":
            os.kill(os.getpid(), signal.SIGKILL)
        return Outcome(pieces=(Piece(clip=clip, numbers={}),))

    store = Store(root=tmp_path / "store")
    before = clips(store, root, 6, seconds=0.2)
    alone = {"DASK_DISTRIBUTED__SCHEDULER__WORKER_SATURATION": "1.0"}  # a worker has one task at a time
    with two_workers(tmp_path, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0", **alone) as (address, _):
        pool = ClipPool(backend="dask", address=address)
        made = run_stage(Stage(name="deadly", version="1", function=deadly), before, store, pool, LOG)
        lost = [row for row in made.judged if not row.pieces]
        assert [row.clip for row in lost] == ["clip03"]
        assert lost[0].reasons[0]["code"] == "failed"
        assert "worker processes that worked on it died" in lost[0].reasons[0]["text"]
        assert len(list(store.root.glob("memo/*/*.json"))) == 5, "the next run tries it again"
        with pytest.raises(ClusterError, match="a task is lost"):
            list(pool.map(lambda: os.kill(os.getpid(), signal.SIGKILL), [()]))


def test_calls_of_a_task_that_is_lost_are_tried_one_by_one(tmp_path):
    first = tmp_path / "died"

    def deadly_once(number):
        if number == 3 and not first.exists():
            first.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return number, os.getpid()

    alone = {"DASK_DISTRIBUTED__SCHEDULER__WORKER_SATURATION": "1.0"}  # a worker has one task at a time
    with two_workers(tmp_path, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0", **alone) as (address, workers):
        count = 2 * cluster.TASKS_PER_WORKER * cluster.MOST_A_TASK
        pool = ClipPool(backend="dask", address=address)
        done = list(pool.map(deadly_once, [(number,) for number in range(count)]))
        assert [number for number, _ in done] == list(range(count))
        lost = [process for process in workers if process.poll() is not None]
        assert len(lost) == 1 and lost[0].pid not in {pid for _, pid in done[: cluster.MOST_A_TASK]}


def test_a_worker_without_the_store_is_an_error_and_a_missing_file_is_tried_again(tmp_path, root, monkeypatch):
    clip = wandering(load_robot(root / "robots/t1"), seconds=0.2)

    def read(path, name):
        return Outcome(pieces=(Piece(clip=clip, numbers={}),))

    store = Store(root=tmp_path / "store")
    stage = Stage(name="read", version="1", function=read)
    files = [("gone", tmp_path / "gone.bvh", "0", ())]
    with two_workers(tmp_path) as (address, _):
        pool = ClipPool(backend="dask", address=address)
        (row,) = run_files(stage, files, store, pool, LOG).judged
        assert row.reasons[0]["code"] == "failed" and "mount its folder" in row.reasons[0]["text"]
        assert not list(store.root.glob("memo/*/*.json"))
        monkeypatch.setattr(cluster, "_probes", lambda folders: _elsewhere(tmp_path))
        with pytest.raises(ClusterError, match=r"does not see the folder .*/elsewhere; mount it there"):
            list(pool.map(abs, [(1,)], shared=[store.root]))


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="needs glibc")
def test_workers_use_the_memory_of_large_arrays_again(tmp_path):
    def new_pages() -> int:
        import resource

        import numpy as np

        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for _ in range(100):
            np.empty(2**20, np.uint8).fill(1)  # 256 pages
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

    as_a_nanny = {"MALLOC_TRIM_THRESHOLD_": "65536"}
    with two_workers(tmp_path, **as_a_nanny) as (address, _):
        found = list(ClipPool(backend="dask", address=address).map(new_pages, [()] * 4))
    assert max(found) < 2_560


@contextmanager
def _elsewhere(folder: Path) -> Iterator[tuple[str, ...]]:
    yield (str(folder / "elsewhere" / ".shared.0"),)


def worker(folder: Path, threads: int = 1) -> SimpleNamespace:
    address = "tcp://10.0.0.7:1"
    return SimpleNamespace(state=SimpleNamespace(nthreads=threads), address=address, local_directory=str(folder))


def test_a_worker_with_other_libraries_or_several_threads_is_refused(tmp_path):
    (tmp_path / "pipeline").mkdir()
    (tmp_path / "pipeline/__init__.py").touch()
    with pytest.raises(RuntimeError, match=r"10\.0\.0\.7:1 has other libraries: numpy .*, expected 1\.0"):
        ShippedCode(tmp_path, {"numpy": "1.0"}).setup(worker(tmp_path))
    with pytest.raises(RuntimeError, match="has 2 threads; start it with --nthreads 1"):
        ShippedCode(tmp_path, {}).setup(worker(tmp_path, threads=2))


def test_what_is_shipped_is_the_code_and_its_tables_but_nothing_compiled(tmp_path, root):
    robot = ("robots/r/robot.toml", "robots/r/policies/walk.npz")
    code = ("pipeline/a.py", "pipeline/b/names.yaml", "pipeline/__pycache__/a.pyc")
    for name in (*code, *robot, "data/x.yaml", "data/x.npz"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    first = digest_of(tmp_path)
    (tmp_path / "pipeline/__pycache__/a.pyc").write_text("other")
    (tmp_path / "data/x.npz").write_text("other")
    assert digest_of(tmp_path) == first
    (tmp_path / "robots/r/policies/walk.npz").write_text("other")
    assert digest_of(tmp_path) == first
    for changed in ("pipeline/b/names.yaml", "robots/r/robot.toml"):
        before = digest_of(tmp_path)
        (tmp_path / changed).write_text("other")
        assert digest_of(tmp_path) != before
    known = worker(tmp_path)
    setattr(known, CODE, digest_of(tmp_path))
    ShippedCode(tmp_path, {}).setup(known)
    assert not list(tmp_path.glob("booster_lab_*")), "a worker that has the code keeps it"


def test_a_scheduler_that_does_not_answer_is_one_sentence(monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT_S", 1.0)
    with pytest.raises(ClusterError, match=r"no scheduler answers at tcp://127\.0\.0\.1:9 .*start one: dask scheduler"):
        ClipPool(backend="dask", address="tcp://127.0.0.1:9").where()


def test_a_backend_that_is_none_and_an_address_without_dask_are_refused():
    with pytest.raises(UnknownNameError, match="unknown backend of clip_pool 'ray'; there are: dask, loky, sequential"):
        ClipPool(backend="ray")
    with pytest.raises(PipelineError, match="set backend to dask"):
        ClipPool(address="tcp://127.0.0.1:8786")
