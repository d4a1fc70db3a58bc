"""This project's code on the workers of a Dask cluster, the same that the scheduling process runs.

The memo's key of an answer states the code that gave it, so a worker must not answer with other code. What is here is
sent by value (`pipeline.batch.cluster`) and imports nothing of the project, which scheduler and workers may lack.

Calls come as pickles, like all that Dask sends: a worker executes what its scheduler gives it, and the run believes
what workers answer (docs/security.md). No file of a user is unpickled here.
"""

import contextlib
import ctypes
import functools
import hashlib
import importlib.util
import io
import shutil
import sys
import zipfile
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import cloudpickle
from distributed import WorkerPlugin, get_worker

PACKAGE = "pipeline"
WITH = ("pipeline/**/*", "data/*.yaml", "robots/*/*")
"""What of the project's folder workers read: code, settings, and the models of robots without their policies."""
CODE = "booster_lab_code"
"""Attribute of a Dask worker: digest of the code that it runs."""
MALLOPT = {-1: 128 * 1024**2, -3: 32 * 1024**2}
"""glibc's M_TRIM_THRESHOLD, free memory kept at the top of a heap, and M_MMAP_THRESHOLD, from which size on an
allocation gets new pages [B]."""


def files_of(root: Path) -> dict[str, Path]:
    """Files of the project in `root` that workers need, by their relative name."""
    found = (path for pattern in WITH for path in root.glob(pattern) if path.is_file())
    return {path.relative_to(root).as_posix(): path for path in sorted(found) if "__pycache__" not in path.parts}


def digest_of(root: Path) -> str:
    """Digest of the names and contents of `files_of(root)`."""
    whole = hashlib.sha256()
    for name, path in files_of(root).items():
        whole.update(f"{name}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return whole.hexdigest()


class ShippedCode(WorkerPlugin):
    """Make a worker run the code of `root`; it keeps its own where that is the same.

    A worker raises RuntimeError where it can't be as the scheduling process is: libraries of other versions, several
    threads.
    """

    name = "booster-lab code"
    idempotent = False

    def __init__(self, root: Path, libraries: Mapping[str, str]):
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, path in files_of(root).items():
                archive.write(path, name)
        self.archive, self.digest, self.libraries = stream.getvalue(), digest_of(root), dict(libraries)

    def setup(self, worker: Any) -> None:
        threads = worker.state.nthreads
        if threads != 1:
            raise RuntimeError(f"worker {worker.address} has {threads} threads; start it with --nthreads 1")
        there = {name: _installed(name) for name in self.libraries}
        wrong = [
            f"{name} {there[name] or 'missing'}, expected {wanted}"
            for name, wanted in self.libraries.items()
            if there[name] != wanted
        ]
        if wrong:
            raise RuntimeError(f"worker {worker.address} has other libraries: {'; '.join(wrong)}")
        _reuse_memory()
        if getattr(worker, CODE, None) == self.digest:
            return
        for module in [each for each in sys.modules if each.partition(".")[0] == PACKAGE]:
            del sys.modules[module]
        importlib.invalidate_caches()
        own = importlib.util.find_spec(PACKAGE)
        if own is None or not own.origin or digest_of(Path(own.origin).parent.parent) != self.digest:
            folder = Path(worker.local_directory) / f"booster_lab_{self.digest[:12]}"
            shutil.rmtree(folder, ignore_errors=True)
            with zipfile.ZipFile(io.BytesIO(self.archive)) as archive:
                archive.extractall(folder)
            sys.path.insert(0, str(folder))
            importlib.invalidate_caches()
        setattr(worker, CODE, self.digest)


def _reuse_memory() -> None:
    """Let this process use the memory of a large array again for the next one.

    Dask's nanny sets MALLOC_TRIM_THRESHOLD_, with which glibc maps new pages for every array from 128 kB on: KP5 of
    1,000 clips took 10.4 s instead of 7.2 to 8.8, with 2.5 s of each worker in the kernel instead of 0.1.
    """
    with contextlib.suppress(AttributeError, TypeError):  # not glibc
        for parameter, value in MALLOPT.items():
            ctypes.CDLL(None).mallopt(parameter, value)


def _installed(library: str) -> str:
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return ""


def load(function: bytes, code: str, probes: Sequence[str]) -> Callable[[bytes], tuple[str, list[Any]]]:
    """`work` with what is alike for all calls, which a worker keeps: what the function caches is made once.

    Args:
        function: the pickled function
        code: digest of the run's code
        probes: files in folders of the run
    """
    return functools.partial(work, cloudpickle.loads(function), code, probes)


def work(function: Callable[..., Any], code: str, probes: Sequence[str], calls: bytes) -> tuple[str, list[Any]]:
    """A sentence that says why this worker can't work for the run, or empty, and `function(*call)` of each call."""
    worker = get_worker()
    if getattr(worker, CODE, None) != code:
        return f"another run gave worker {worker.address} other code; let one run at a time use a cluster.", []
    for probe in map(Path, probes):
        if not probe.is_file():
            do = f"does not see the folder {probe.parent}; mount it there under the same path."
            return f"worker {worker.address} {do}", []
    return "", [function(*call) for call in cloudpickle.loads(calls)]
