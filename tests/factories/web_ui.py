"""`dagster dev` in a checkout, and what its pages ask it through GraphQL."""

import json
import os
import signal
import socket
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.factories.checkout import PATIENCE_S, Checkout


@dataclass(frozen=True)
class WebUi:
    """A running web UI."""

    url: str
    log: Path

    def ask(self, query: str, **variables: Any) -> dict[str, Any]:
        """The data of a GraphQL answer; an error in it fails the test."""
        body = json.dumps({"query": query, "variables": variables}).encode()
        request = urllib.request.Request(f"{self.url}/graphql", body, {"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=60) as answer:
            value = json.load(answer)
        assert "errors" not in value, value
        return value["data"]

    def stale_causes(self) -> dict[str, list[str]]:
        """Asset key -> why the page calls it unsynced; assets without a cause are left out."""
        nodes = self.ask("{assetNodes {assetKey {path} staleStatus staleCauses {reason}}}")["assetNodes"]
        found = {"/".join(node["assetKey"]["path"]): [each["reason"] for each in node["staleCauses"]] for node in nodes}
        return {key: causes for key, causes in found.items() if causes}

    def materialize(self, *path: str) -> str:
        """What the button `Materialize` of an asset's page does; the status its run ends with."""
        return self._launched("__ASSET_JOB", {}, assetSelection=[{"path": list(path)}])

    def launch(self, job: str, config: dict[str, Any]) -> str:
        """What the button `Launch run` of a job's launchpad does; the status its run ends with."""
        return self._launched(job, config)

    def _launched(self, job: str, config: dict[str, Any], **more: Any) -> str:
        repository = self.ask("{repositoriesOrError {... on RepositoryConnection {nodes {name location {name}}}}}")[
            "repositoriesOrError"
        ]["nodes"][0]
        selector = {
            "pipelineName": job,
            "repositoryName": repository["name"],
            "repositoryLocationName": repository["location"]["name"],
            **more,
        }
        launched = self.ask(
            "mutation($p: ExecutionParams!) {launchPipelineExecution(executionParams: $p) "
            "{__typename ... on LaunchRunSuccess {run {runId}}}}",
            p={"selector": selector, "runConfigData": json.dumps(config), "mode": "default"},
        )["launchPipelineExecution"]
        assert launched["__typename"] == "LaunchRunSuccess", launched
        return self._end_of(launched["run"]["runId"])

    def _end_of(self, run: str) -> str:
        stop = time.monotonic() + PATIENCE_S
        while time.monotonic() < stop:
            status = self.ask("query($r: ID!) {runOrError(runId: $r) {... on Run {status}}}", r=run)["runOrError"]
            if status["status"] in ("SUCCESS", "FAILURE", "CANCELED"):
                return status["status"]
            time.sleep(0.5)
        raise TimeoutError(f"run {run} did not end in {PATIENCE_S} s")


@contextmanager
def web_ui(checkout: Checkout) -> Iterator[WebUi]:
    """`dagster dev` on a free port, stopped with all its processes at the end."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    log = checkout.root / "dev.log"
    with log.open("w") as stream:
        process = subprocess.Popen(
            ["dagster", "dev", "-h", "127.0.0.1", "-p", str(port)],
            cwd=checkout.root,
            env=checkout.environment(),
            stdout=stream,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            _wait_for(f"http://127.0.0.1:{port}/server_info", process, log)
            yield WebUi(f"http://127.0.0.1:{port}", log)
        finally:
            os.killpg(process.pid, signal.SIGTERM)
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)


def _wait_for(url: str, process: subprocess.Popen, log: Path) -> None:
    stop = time.monotonic() + PATIENCE_S
    while time.monotonic() < stop and process.poll() is None:
        try:
            with urllib.request.urlopen(url, timeout=5):
                return
        except OSError:
            time.sleep(0.5)
    raise TimeoutError(f"dagster dev did not answer at {url}:\n{log.read_text()[-3000:]}")
