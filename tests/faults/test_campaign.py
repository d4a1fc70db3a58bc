"""A small seeded part of `benchmarks/faults.py`: mutated inputs are read right or refused."""

import os
import signal
from pathlib import Path

import pytest

from tests.factories import campaign
from tests.factories.campaign import CAPPED, CRASHED, REFUSED, RIGHT, Case, Verdict, memory_cap_mb, run_isolated
from tests.factories.campaign_logs import log_cases
from tests.factories.campaign_motions import motion_cases
from tests.factories.campaign_policies import policy_cases
from tests.factories.campaign_settings import contradictions, settings_cases
from tests.factories.repeated_checks import make_checks

SEED = 3
FEW = {
    "motions": (motion_cases, 66),
    "logs": (log_cases, 14),
    "settings": (settings_cases, 56),
    "policies": (policy_cases, 40),
}


@pytest.mark.parametrize("kind", FEW)
def test_mutated_inputs_are_read_right_or_refused(tmp_path, kind):
    """Each in a process that is forked."""
    make_checks()
    cases, count = FEW[kind]
    found = [(case.name, run_isolated(case)) for case in cases(SEED, count, tmp_path)]
    faults = [
        f"{name}: {verdict.kind}: {verdict.text}" for name, verdict in found if verdict.kind not in (RIGHT, REFUSED)
    ]
    assert faults == [], "\n".join(["", *faults])
    assert len(found) > 0.8 * count
    assert {verdict.kind for _, verdict in found} == {RIGHT, REFUSED}


def _takes_memory(folder: Path) -> Verdict:
    taken = bytearray(1_200_000_000)
    return Verdict(RIGHT, str(len(taken)))


def _maps_too_much(folder: Path) -> Verdict:
    return Verdict(RIGHT, str(len(bytearray(campaign.ADDRESS_SPACE * 2))))


def _raises(folder: Path) -> Verdict:
    raise KeyError("a traceback")


def _dies(folder: Path) -> Verdict:
    os.kill(os.getpid(), signal.SIGKILL)
    return Verdict(RIGHT)


@pytest.mark.parametrize(
    ("run", "kind", "text"),
    [
        (_takes_memory, CAPPED, "MB of memory"),
        (_maps_too_much, CAPPED, "MemoryError"),
        (_raises, CRASHED, "KeyError"),
        (_dies, CRASHED, "SIGKILL"),
    ],
)
def test_a_process_that_fails_is_counted(run, kind, text):
    verdict = run_isolated(Case("planted", run))
    assert verdict.kind == kind
    assert text in verdict.text


def test_large_files_may_take_more_memory():
    assert memory_cap_mb(1_000) == 1_000.0
    assert memory_cap_mb(400_000_000) == 1_800.0


@pytest.mark.parametrize(
    ("found", "text", "fault"),
    [
        ({"a": 1.0, "b": 3.0}, {"a": "1", "b": "2"}, "its text did not"),
        ({"a": 90.0, "b": 2.0}, {"a": "1:30", "b": "2"}, "where the file has '1:30'"),
        ({"a": 1.0, "b": 2.0}, {"a": "1.5", "b": "2"}, "where the file has '1.5'"),
    ],
)
def test_a_setting_that_its_file_contradicts_is_found(found, text, fault):
    before, clean = {"a": 1.0, "b": 2.0}, {"a": "1", "b": "2"}
    assert contradictions(before, before, clean, clean) == []
    assert any(fault in each for each in contradictions(before, found, clean, text))
