"""The launcher against programs that behave as badly as a simulator can."""

from __future__ import annotations

import dataclasses
import json
import os
import socket
import sys
import time
from pathlib import Path

import pytest

from pipeline.webots import launch as launcher
from pipeline.webots.booster_lab import RESULT_MARK, SCHEMA
from pipeline.webots.launch import Outcome, find_webots, free_port, launch, launch_webots
from pipeline.webots.project import Project
from pipeline.webots.result import WebotsSettings
from pipeline.webots.validate import WEBOTS, verdict
from tests.factories.webots_bars import STILL

GOOD_RESULT = """
import json, sys, pathlib
home = pathlib.Path('controllers/booster_lab')
run = json.loads((home / 'run.json').read_text())
rows = [{'name': s['name'], 'walked': True, 'forward_m_s': 0.0, 'lateral_m_s': 0.0, 'yaw_rate_rad_s': 0.0,
         'height_m': 0.68} for s in run['segments']]
result = {'schema': 'booster-lab webots result 1', 'run': run['run'], 'timestep_ms': 5.0, 'seconds': 1.2,
          'fell_s': None, 'policy': True, 'segments': rows}
text = json.dumps(result)
"""


def a_program(tmp_path: Path, code: str) -> list[str]:
    """A Python program in the place of webots."""
    path = tmp_path / "program.py"
    path.write_text(code)
    return [sys.executable, str(path)]


def run(tmp_path: Path, project: Project, settings: WebotsSettings, code: str, limit_s: float = 20.0) -> Outcome:
    return launch(a_program(tmp_path, code), project, dataclasses.replace(settings, limit_s=limit_s))


def is_running(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_a_good_program_is_finished_and_passes(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    code = GOOD_RESULT + "(home / run['result']).write_text(text)"
    outcome = run(tmp_path, project, short_walk, code)
    assert outcome.status == "finished"
    assert verdict(WEBOTS, outcome, short_walk, STILL).status == "passed"


def test_a_result_that_is_only_printed_counts(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    code = GOOD_RESULT + f"print('noise'); print({RESULT_MARK!r} + text); print('more noise')"
    assert run(tmp_path, project, short_walk, code).status == "finished"


def test_it_is_given_webots_flags_the_world_and_a_port(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    outcome = run(tmp_path, project, short_walk, "import sys; print(sys.argv[1:])")
    for flag in ("--batch", "--mode=fast", "--no-rendering", "--minimize", "--stdout", "--stderr", "--port="):
        assert flag in outcome.tail
    assert str(project.world) in outcome.tail


def test_a_missing_webots_is_not_run_and_never_passed(
    project: Project, short_walk: WebotsSettings, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("WEBOTS_HOME", raising=False)
    outcome = launch_webots(project, short_walk)
    said = verdict(WEBOTS, outcome, short_walk, STILL)
    assert said.status == "not run: webots not found"
    assert not said.judged and not said.failed_to_run and said.result is None


def test_webots_is_found_on_the_path_or_in_its_home(tmp_path: Path):
    program = tmp_path / "home" / "webots"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    assert find_webots({"PATH": str(program.parent)}) == program
    assert find_webots({"PATH": str(tmp_path), "WEBOTS_HOME": str(program.parent)}) == program
    assert find_webots({"PATH": str(tmp_path)}) is None


def test_webots_itself_is_started_where_it_is_found(
    project: Project, short_walk: WebotsSettings, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    """A script of that name on the path, which does what a good run does."""
    program = tmp_path / "webots"
    program.write_text(f"#!{sys.executable}\n" + GOOD_RESULT + "(home / run['result']).write_text(text)")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("DISPLAY", ":0")
    assert verdict(WEBOTS, launch_webots(project, short_walk), short_walk, STILL).status == "passed"
    said = (project.controller / "runtime.ini").read_text()
    assert said == f"[python]\nCOMMAND = {sys.executable}\n"  # one that has numpy


def test_a_program_that_does_not_start_failed_to_run(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    """It was found, so it is not missing."""
    program = tmp_path / "webots"
    program.write_bytes(b"no program")
    program.chmod(0o755)
    outcome = launch([str(program)], project, short_walk)
    assert (outcome.status, outcome.reason) == ("did not start", f"{program}: Exec format error")
    said = verdict(WEBOTS, outcome, short_walk, STILL)
    assert said.status == f"failed to run: did not start, {program}: Exec format error"
    assert said.failed_to_run and not said.judged


def test_a_program_that_hangs_is_ended_with_all_that_it_started(
    tmp_path: Path, project: Project, short_walk: WebotsSettings, monkeypatch: pytest.MonkeyPatch
):
    """The child ignores being asked to end, as does the program."""
    monkeypatch.setattr(launcher, "GRACE_S", 0.3)
    pids = tmp_path / "pids"
    code = f"""
import os, signal, subprocess, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
stubborn = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(1, flush=True); time.sleep(600)"
child = subprocess.Popen([sys.executable, '-c', stubborn], stdout=subprocess.PIPE)
child.stdout.readline()
open({str(pids)!r}, 'w').write(f'{{os.getpid()}} {{child.pid}}')
time.sleep(600)
"""
    outcome = run(tmp_path, project, short_walk, code, limit_s=3.0)
    assert outcome.status == "timed out"
    assert outcome.reason == "it was terminated after 3 s"
    started = [int(pid) for pid in pids.read_text().split()]
    assert len(started) == 2
    until = time.monotonic() + 5.0
    while any(is_running(pid) for pid in started) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(is_running(pid) for pid in started)
    assert verdict(WEBOTS, outcome, short_walk, STILL).status == "failed to run: timed out, it was terminated after 3 s"


def test_children_do_not_outlive_a_program_that_ends(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    pids = tmp_path / "pids"
    code = (
        GOOD_RESULT
        + f"""
import subprocess
child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])
open({str(pids)!r}, 'w').write(str(child.pid))
(home / run['result']).write_text(text)
"""
    )
    assert run(tmp_path, project, short_walk, code).status == "finished"
    until = time.monotonic() + 5.0
    while is_running(int(pids.read_text())) and time.monotonic() < until:
        time.sleep(0.05)
    assert not is_running(int(pids.read_text()))


def test_a_result_counts_where_the_program_hangs_after_it(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    code = GOOD_RESULT + "import time; (home / run['result']).write_text(text); time.sleep(600)"
    assert run(tmp_path, project, short_walk, code, limit_s=2.0).status == "finished"


@pytest.mark.parametrize(
    ("code", "status", "reason"),
    [
        ("import os; os.abort()", "crashed", "it was killed by SIGABRT"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGRTMIN + 6)", "crashed", "it was killed by signal 40"),
        ("raise SystemExit(7)", "crashed", "it ended with status 7: nothing printed"),
        ("import sys; print('no display'); sys.exit(1)", "crashed", "it ended with status 1: no display"),
        ("pass", "no result", "it ended without a result"),
        ("print('hello')", "no result", "it ended without a result"),
    ],
)
def test_what_went_wrong_is_said(
    tmp_path: Path, project: Project, short_walk: WebotsSettings, code: str, status: str, reason: str
):
    outcome = run(tmp_path, project, short_walk, code)
    assert (outcome.status, outcome.reason) == (status, reason)
    said = verdict(WEBOTS, outcome, short_walk, STILL)
    assert said.status == f"failed to run: {status}, {reason}"
    assert said.failed_to_run and not said.judged and said.result is None


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "is empty"),
        ("\\x00\\xff garbage {", "is not JSON"),
        ("{" * 100_000, "is not JSON"),
        ("[]", "not an object of schema"),
        (json.dumps({"schema": "another"}), "not an object of schema"),
    ],
)
def test_garbage_is_called_garbage(
    tmp_path: Path, project: Project, short_walk: WebotsSettings, text: str, reason: str
):
    code = f"open('controllers/booster_lab/result.json', 'w').write({text!r})"
    outcome = run(tmp_path, project, short_walk, code)
    assert outcome.status == "garbage"
    assert reason in outcome.reason
    assert verdict(WEBOTS, outcome, short_walk, STILL).failed_to_run


def test_garbage_bytes_are_called_garbage(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    code = "open('controllers/booster_lab/result.json', 'wb').write(bytes(range(256)))"
    assert run(tmp_path, project, short_walk, code).status == "garbage"


def test_of_a_program_that_prints_without_end_the_end_is_read(
    tmp_path: Path, project: Project, short_walk: WebotsSettings
):
    code = GOOD_RESULT + f"print(('x' * 99 + chr(10)) * 100_000); print({RESULT_MARK!r} + text)"
    outcome = run(tmp_path, project, short_walk, code)
    assert outcome.status == "finished" and len(outcome.tail) == launcher.TAIL_CHARACTERS


def test_a_result_of_before_is_not_taken(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    """A file left over is removed; one that a late program writes names another run."""
    project.result.write_text(json.dumps({"schema": SCHEMA, "run": "yesterday"}))
    assert run(tmp_path, project, short_walk, "pass").status == "no result"
    code = GOOD_RESULT + "result['run'] = 'yesterday'; (home / run['result']).write_text(json.dumps(result))"
    outcome = run(tmp_path, project, short_walk, code)
    assert outcome.status == "stale result"
    assert outcome.reason.startswith("the result is of another run ('yesterday', expected '")


def test_a_port_that_was_taken_meanwhile_is_tried_again(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    """The first two starts find their port in use."""
    tries = tmp_path / "tries"
    code = (
        GOOD_RESULT
        + f"""
with open({str(tries)!r}, 'a') as stream:
    stream.write(next(a for a in sys.argv if a.startswith('--port=')) + '\\n')
if len(open({str(tries)!r}).read().split()) < 3:
    print('bind: Address already in use')
    sys.exit(1)
(home / run['result']).write_text(text)
"""
    )
    assert run(tmp_path, project, short_walk, code).status == "finished"
    assert len(tries.read_text().split()) == 3


def test_ports_that_stay_taken_end_it(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    outcome = run(tmp_path, project, short_walk, "import sys; print('Address already in use'); sys.exit(1)")
    assert outcome.status == "crashed"
    assert "Address already in use" in outcome.reason


def test_a_free_port_can_be_listened_on():
    port = free_port()
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", port))


def test_the_environment_reaches_the_program(tmp_path: Path, project: Project, short_walk: WebotsSettings):
    program = a_program(tmp_path, "import os; print('got', os.environ['A'], os.environ['PATH'] != '')")
    outcome = launch(program, project, short_walk, {"A": "b"})
    assert "got b True" in outcome.tail
    assert "A" not in os.environ
