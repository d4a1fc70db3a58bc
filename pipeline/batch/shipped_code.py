"""Install this project's code on the workers of a Dask cluster, identical to that of the scheduling process.

The memo's key of an answer contains the code version, so a worker must not use other code. This module is sent by value
(`pipeline.batch.cluster`) and imports nothing of the project, which scheduler and workers may not have.

Calls are sent as pickles, like everything in Dask: a worker executes whatever its scheduler sends, and the run trusts
the workers' answers (docs/security.md). No user file is unpickled here.
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
"""Files of the project that workers need: code, settings, and robot models without policies."""
CODE = "booster_lab_code"
"""Attribute of a Dask worker: digest of the code that it runs."""
MALLOPT = {-1: 128 * 1024**2, -3: 32 * 1024**2}
"""glibc's M_TRIM_THRESHOLD, free memory kept at the top of a heap, and M_MMAP_THRESHOLD, the allocation
size from which new pages are mapped [B]."""


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
    """Make a worker run the code of `root`, unless its own code is identical.

    A worker raises RuntimeError if it can't match the scheduling process: other library versions, several threads.
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
    """Let this process reuse the memory of large arrays.

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
    """`work` with the arguments shared by all calls, kept by a worker so that the function's caches persist.

    Args:
        function: the pickled function
        code: digest of the run's code
        probes: files in folders of the run
    """
    return functools.partial(work, cloudpickle.loads(function), code, probes)


def work(function: Callable[..., Any], code: str, probes: Sequence[str], calls: bytes) -> tuple[str, list[Any]]:
    """Why this worker can't be used for the run (empty if it can), and `function(*call)` for each call."""
    worker = get_worker()
    if getattr(worker, CODE, None) != code:
        return f"another run gave worker {worker.address} other code; let one run at a time use a cluster.", []
    for probe in map(Path, probes):
        if not probe.is_file():
            do = f"does not see the folder {probe.parent}; mount it there under the same path."
            return f"worker {worker.address} {do}", []
    return "", [function(*call) for call in cloudpickle.loads(calls)]
