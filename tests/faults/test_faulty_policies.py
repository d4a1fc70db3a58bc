"""Policies, golden vectors and cards with a planted fault: refused in one sentence, in bounded memory."""

import io
import json
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch

from pipeline.deployment import deployment_task, load_policy, save_policy
from pipeline.errors import FileError
from pipeline.export.card import FILE, SCHEMA, ModelCard, page, read_card
from pipeline.export.parity import GoldenVectors, read_golden, write_golden
from pipeline.files import digest
from pipeline.learning.checkpoint import load_checkpoint
from pipeline.learning.training_error import TrainingError
from pipeline.robot import Robot
from tests.factories.policies import random_policy

CARD = ModelCard(
    name="walk",
    robot="t1",
    digest="ab" * 32,
    run={},
    data={},
    shippable=False,
    why="nobody asked.",
    network={},
    parity={},
    task={},
    files={"policy.npz": "cd" * 32},
)


PARITY = {"onnx": 0.0, "torch_script": 0.0, "runtime": "none", "observations": 1}


@pytest.fixture
def arrays(robot: Robot, tmp_path: Path) -> dict[str, np.ndarray]:
    """The arrays of a sound policy."""
    save_policy(tmp_path / "sound.npz", random_policy(deployment_task(robot), np.random.default_rng(3), gains=True))
    with np.load(tmp_path / "sound.npz") as sound:
        return dict(sound)


FAULTS = {
    "0-d joint names": lambda arrays: arrays.update(joint_names=np.array("knee")),
    "joint names of numbers": lambda arrays: arrays.update(joint_names=np.arange(23.0)),
    "joint names in rows": lambda arrays: arrays.update(joint_names=arrays["joint_names"][None]),
    "0-d mean": lambda arrays: arrays.update(mean=np.array(1.0)),
    "0-d bias": lambda arrays: arrays.update(L0_b=np.array(1.0)),
    "bias in rows": lambda arrays: arrays.update(L0_b=arrays["L0_b"][None]),
    "0-d weight": lambda arrays: arrays.update(L0_w=np.array(1.0)),
    "empty weight": lambda arrays: arrays.update(L0_w=np.zeros((0, 0))),
    "eps of another length": lambda arrays: arrays.update(eps=np.zeros(3)),
    "std below zero": lambda arrays: arrays.update(std=-arrays["std"]),
    "a layer taken out": lambda arrays: arrays.pop("L1_w"),
    "NaN": lambda arrays: arrays["L0_w"].__setitem__((0, 0), np.nan),
    "complex numbers": lambda arrays: arrays.update(L0_w=arrays["L0_w"].astype(complex)),
    "text for numbers": lambda arrays: arrays.update(L0_w=arrays["L0_w"].astype(str)),
    "gains of another length": lambda arrays: arrays.update(kp=arrays["kp"][:-1]),
    "0-d gains": lambda arrays: arrays.update(kp=np.array(1.0)),
    "examples of unequal number": lambda arrays: arrays.update(
        golden_observation=np.zeros((3, arrays["mean"].size)), golden_action=np.zeros((2, 21))
    ),
    "examples of another network": lambda arrays: arrays.update(
        golden_observation=np.zeros((2, arrays["mean"].size)), golden_action=np.full((2, 21), 9.0)
    ),
    "0-d examples": lambda arrays: arrays.update(golden_observation=np.array(1.0), golden_action=np.array(1.0)),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_policy_is_refused_in_one_sentence(tmp_path, arrays, fault):
    FAULTS[fault](arrays)
    path = tmp_path / "policy.npz"
    np.savez(path, **arrays)
    with pytest.raises(FileError, match=r"policy\.npz") as raised:
        load_policy(path)
    assert "\n" not in str(raised.value)


def bomb(path: Path, inflated: int, member: str) -> None:
    """An archive with an array of zeros of so many bytes."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": (inflated // 8,)})
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open(member, "w") as written,
    ):
        written.write(stream.getvalue())
        for _ in range(inflated // 1_000_000):
            written.write(bytes(1_000_000))


def members(path: Path, inflated: int, names: list[str]) -> None:
    """An archive with members of so many bytes, each of which alone is allowed."""
    data = bytes(1_000_000)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in names:
            with archive.open(name, "w") as written:
                for _ in range(inflated // len(data)):
                    written.write(np.random.default_rng(0).bytes(3_000) + data[3_000:])


READERS = {
    "policy.npz": ("pipeline.deployment", "load_policy(path)", "L0_w.npy"),
    "golden.npz": ("pipeline.export.parity", "read_golden(path)", "command.npy"),
    "checkpoint.pt": ("pipeline.learning.checkpoint", "load_checkpoint(path, 'cpu')", "model/data/0"),
    "script.pt": ("pipeline.export.networks", "read_torch_script(path)", "script/code/0"),
}
"""File -> the module of its reader, the call, and a member that the archive has."""

READ = """
import json, sys
from importlib import import_module
from pathlib import Path

for name, module, call in json.loads(sys.argv[1]):
    path, said = Path(name), ""
    try:
        eval(call, {**vars(import_module(module)), "path": path})
    except Exception as error:
        said = str(error)
    peak_kb = next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1]
    print(json.dumps([said, int(peak_kb) // 1024]))
"""
"""Prints, for each file, what its reader said and the most memory until then [MB]; `ru_maxrss` begins with the
parent's."""


def test_bombs_are_refused_before_they_inflate(tmp_path, root):
    """By each reader, in one member and in many; one process reads them all, so their memory would add up."""
    read = []
    for file, (module, call, member) in READERS.items():
        for folder in ("one", "many"):
            (tmp_path / folder).mkdir(exist_ok=True)
            read.append((str(tmp_path / folder / file), module, call))
        bomb(tmp_path / "one" / file, 800_000_000, member)
        members(tmp_path / "many" / file, 60_000_000, [f"{member}{number}" for number in range(7)])
    command = [sys.executable, "-c", READ, json.dumps(read)]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == len(read)
    for (file, *_), (sentence, peak_mb) in zip(read, found, strict=True):
        assert "inflates" in sentence and Path(file).name in sentence, file
        assert peak_mb < 600, file


def test_a_file_of_early_torch_is_refused_unread(tmp_path):
    """torch before 1.6 wrote no archive: its reader takes the memory that the pickle claims before it reads."""
    path = tmp_path / "model_000001.pt"
    torch.save({"a": torch.zeros(2)}, path, _use_new_zipfile_serialization=False)
    with pytest.raises(TrainingError, match=r"model_000001\.pt: .*no archive of torch"):
        load_checkpoint(path, "cpu")


def golden(path: Path, **changes: np.ndarray) -> Path:
    """Golden vectors of two steps beside a card that states them."""
    shapes = dict(gyro_b=3, gravity_b=3, command=3, joint_pos=23, joint_vel=23, observation=720, action=21, targets=23)
    write_golden(path, GoldenVectors(**{name: np.zeros((2, width)) for name, width in shapes.items()}))
    if changes:
        with np.load(path) as sound:
            np.savez(path, **{**sound, **changes})
    return path


def card(folder: Path, **files: str) -> Path:
    made = ModelCard(**{**vars(CARD), "files": files})
    (folder / FILE).write_text(made.to_text())
    return folder / FILE


def test_golden_vectors_are_those_that_the_card_beside_them_states(tmp_path):
    path = golden(tmp_path / "golden.npz")
    assert read_golden(path).command.shape == (2, 3)
    card(tmp_path, **{"golden.npz": digest.of_file(path)})
    assert read_golden(path).command.shape == (2, 3)
    golden(path, command=np.ones((2, 3)))
    with pytest.raises(FileError, match=r"golden.npz: does not match its digest in card.json beside it"):
        read_golden(path)
    card(tmp_path)
    with pytest.raises(FileError, match=r"golden.npz: does not match its digest in card.json beside it"):
        read_golden(path)


@pytest.mark.parametrize(
    "changes",
    [
        {"command": np.array(1.0)},
        {"command": np.zeros((3, 3))},
        {"command": np.full((2, 3), np.nan)},
        {"command": np.array([["a", "b", "c"]] * 2)},
    ],
    ids=["0-d", "unequal", "NaN", "text"],
)
def test_faulty_golden_vectors_are_refused(tmp_path, changes):
    with pytest.raises(FileError, match=r"golden\.npz: has"):
        read_golden(golden(tmp_path / "golden.npz", **changes))


def test_a_card_carries_a_digest_of_itself(tmp_path):
    path = card(tmp_path, **{"policy.npz": "cd" * 32})
    assert read_card(tmp_path).files == {"policy.npz": "cd" * 32}
    value = json.loads(path.read_text())
    assert value["schema"] == SCHEMA
    for change in ({"shippable": True}, {"sha256": None}, {"files": {}}, {"sha256": "ab" * 32}):
        path.write_text(json.dumps({**value, **change}))
        with pytest.raises(FileError, match="was changed: its content does not match its own digest"):
            read_card(tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        {"files": None},
        {"files": []},
        {"files": {"../../outside": "ab" * 32}},
        {"files": {"/etc/passwd": "ab" * 32}},
        {"files": {"policy.npz": 3}},
        {"name": None},
        {"shippable": "yes"},
        {"run": "walk"},
    ],
    ids=str,
)
def test_a_card_of_other_kinds_of_values_is_refused(tmp_path, change):
    value = {"schema": SCHEMA, **vars(CARD), **change}
    (tmp_path / FILE).write_text(json.dumps({**value, "sha256": digest.of_json(value)}))
    with pytest.raises(FileError, match=r"card\.json: "):
        read_card(tmp_path)


def test_the_page_of_a_card_has_no_markup_of_its_values():
    hostile = "<script>x</script> ![a](http://b) `c` | d\ne"
    run = {"command": hostile + " --seed 1" * 100}
    lines = page(ModelCard(**{**vars(CARD), "name": hostile, "run": run, "parity": PARITY})).splitlines()
    assert lines[0] == "# &lt;script&gt;x&lt;/script&gt; !\\[a](http://b) 'c' \\| d e"
    (command,) = [line for line in lines if line.startswith("| command ")]
    assert command.endswith("--seed 1 |") and "<" not in command


def test_a_page_shows_figures_of_any_form_without_markup_and_before_the_facts():
    hostile = "<script>x</script> | [a](http://b)"
    figures = {"figures": {hostile: hostile, "may ship": 1.0, "cells": [3]}, "other seeds": {hostile: 4}, "held-out": 5}
    lines = page(ModelCard(**{**vars(CARD), "figures": figures, "parity": PARITY})).splitlines()
    assert not [line for line in lines if "<" in line or " [a]" in line]
    assert [line for line in lines if line.startswith("| may ship |")] == ["| may ship | no. nobody asked. |"]


NO_CARD = f"is not a card of schema '{SCHEMA}'"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("null", NO_CARD),
        ("[]", NO_CARD),
        ("3", NO_CARD),
        ('{"schema": null}', NO_CARD),
        ("{", "not JSON"),
        ("[" * 5_000 + "]" * 5_000, "not JSON .*recursion"),
        (json.dumps({"schema": SCHEMA, "x": " " * 5_000_000}), "the file is larger than the 5000000 bytes allowed"),
    ],
    ids=["null", "list", "number", "no schema", "cut off", "deep", "large"],
)
def test_what_is_no_card_is_refused(tmp_path, text, says):
    (tmp_path / FILE).write_text(text)
    with pytest.raises(FileError, match=rf"card\.json: {says}.* Export the policy again\."):
        read_card(tmp_path)
