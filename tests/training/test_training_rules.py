"""Commands, stalls, falls, pushes, options, checkpoints and imports of the training package."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys

import numpy as np
import pytest
import torch

from pipeline.expert.training_bundle import augmented_by
from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint, save_checkpoint
from pipeline.learning.policy_file import policy_arrays
from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import read_bundle
from pipeline.training.commands import draw_commands
from pipeline.training.option_texts import changed_by_texts
from pipeline.training.options import Options
from pipeline.training.presets import PRESETS, preset
from pipeline.training.pushes import horizontal
from pipeline.training.ramps import grown
from pipeline.training.reasons import REASONS
from pipeline.training.terminations import fallen, stands_though_told
from tests.factories.training_bundle import small_bundle

STACK = {
    "mjlab",
    "mujoco",
    "mujoco_warp",
    "warp",
    "torch",
    "tensordict",
    "rsl_rl",
    "numpy",
    "scipy",
    "pandas",
    "pyarrow",
}
"""What a GPU host has."""


def test_training_imports_nothing_but_the_stack_of_a_gpu_host():
    """Modules of ours and top-level packages that only our own files import, in a process of its own."""
    code = """
import ast, json, pathlib, sys
import pipeline.training
folder = pathlib.Path(pipeline.training.__file__).parent
named = set()
for path in folder.glob("*.py"):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            named |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            named.add(node.module)
import pipeline.training.run, pipeline.training.distilled_run, pipeline.training.export_policy
ours = sorted(name for name in sys.modules if name.split(".")[0] in ("pipeline", "assets"))
print(json.dumps({"named": sorted(named), "ours": ours, "std": sorted(sys.stdlib_module_names)}))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    told = json.loads(done.stdout.strip().splitlines()[-1])
    foreign = {name for name in told["named"] if name.split(".")[0] not in STACK | set(told["std"])}
    own = ("pipeline.training", "pipeline.learning")
    assert {name for name in foreign if not name.startswith(own)} == set()
    assert [name for name in told["ours"] if name != "pipeline" and not name.startswith(own)] == []


def test_threads_are_told_to_wait_before_they_are_made():
    """torch's pool reads how to wait as it loads: what `__main__` imports before that must not bring torch."""
    code = "import sys, pipeline.training.distil; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_the_papers_commands_are_of_three_kinds_in_its_ranges():
    torch.manual_seed(0)
    command = draw_commands(20_000, Options(), "cpu")
    stands = (command == 0.0).all(dim=1)
    fast = (command[:, 0] > 1.0) & (command[:, 1:] == 0.0).all(dim=1)
    normal = command[~stands & ~fast]
    assert stands.float().mean().item() == pytest.approx(0.10, abs=0.01)
    assert fast.float().mean().item() == pytest.approx(0.35, abs=0.01)
    assert command[fast, 0].max() <= 2.0
    for axis, (low, high) in enumerate(((-0.6, 1.0), (-0.6, 0.6), (-1.5, 1.5))):
        assert low <= normal[:, axis].min() and normal[:, axis].max() <= high
        assert normal[:, axis].mean().item() == pytest.approx((low + high) / 2.0, abs=0.03)


def test_the_balanced_mixture_turns_on_the_spot_and_steps_sideways():
    torch.manual_seed(0)
    command = draw_commands(20_000, preset("tracking_amp"), "cpu")
    alone = [((command[:, [other for other in range(3) if other != axis]] == 0.0).all(dim=1)) for axis in range(3)]
    moves = (command != 0.0).any(dim=1)
    assert (alone[2] & moves).float().mean().item() == pytest.approx(0.10, abs=0.01)
    assert (alone[1] & moves).float().mean().item() == pytest.approx(0.10, abs=0.01)
    assert (command[:, 0] > 1.0).float().mean().item() == pytest.approx(0.30, abs=0.01)


STALL_CASES = [
    ((1.0, 0.0, 0.0), (0.2, 0.0, 0.0), True, True),
    ((1.0, 0.0, 0.0), (0.4, 0.0, 0.0), False, False),
    ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), True, True),
    ((0.1, 0.0, 0.0), (0.0, 0.0, 0.0), False, False),
    ((0.0, 0.0, -1.0), (0.0, 0.0, -0.1), True, True),
    ((0.0, 0.0, -1.0), (0.0, 0.0, -0.5), False, False),
    ((1.0, 0.0, 1.0), (0.9, 0.0, 0.0), False, True),
    ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), False, False),
]


@pytest.mark.parametrize(("command", "velocity", "stalls", "strictly"), STALL_CASES)
def test_who_follows_nothing_of_a_command_stalls(command, velocity, stalls, strictly):
    given = torch.tensor([command]), torch.tensor([velocity])
    assert stands_though_told(*given, Options()).item() is stalls
    assert stands_though_told(*given, Options(stall_either=True)).item() is strictly


def test_tilted_low_or_not_a_number_is_fallen():
    down = torch.tensor([[0.0, 0.0, -1.0], [0.9, 0.0, -0.43], [0.0, 0.0, -1.0], [torch.nan] * 3])
    height = torch.tensor([0.68, 0.68, 0.44, 0.68])
    assert fallen(down, height, 60.0, 0.45).tolist() == [False, True, True, True]


def test_pushes_are_horizontal_in_all_directions_and_grow():
    torch.manual_seed(0)
    push = 60.0 * horizontal(5000, 0.2, "cpu")
    length = push.norm(dim=1)
    assert (push[:, 2] == 0.0).all()
    assert length.max() <= 60.0 + 1e-3
    assert length.min() >= 12.0 - 1e-3
    assert push.mean(dim=0).abs().max() < 1.5
    hard = horizontal(5000, 0.75, "cpu").norm(dim=1)
    assert hard.min() == pytest.approx(0.75, abs=1e-3)
    assert hard.mean() == pytest.approx(0.875, abs=5e-3)
    assert [grown((0.0, 60.0), at, 600) for at in (0, 300, 600, 900)] == [0.0, 30.0, 60.0, 60.0]


def test_what_differs_from_the_paper_has_a_reason():
    paper = PRESETS["paper"][1]
    differ = {
        name for _, ours in PRESETS.values() for name in vars(paper) if getattr(paper, name) != getattr(ours, name)
    }
    assert differ - {"terrain"} == set(REASONS), "the plane is what the other presets are for"


@pytest.mark.parametrize("name", ["slide_of", "tracking_of", "terrain", "init_posture"])
def test_an_option_that_is_one_of_some_words_is_none_other(name):
    with pytest.raises(TrainingError, match=f"'{name}' is 'center'; it must be"):
        changed_by_texts(preset("paper"), {name: "center"})


def test_options_are_read_from_text_in_the_form_of_their_default():
    given = {"style": "0.5", "stall": "true", "hidden": "64,32", "steps": "12", "friction": "0.5,0.9"}
    options = changed_by_texts(Options(), given)
    assert (options.style, options.stall, options.hidden, options.steps) == (0.5, True, (64, 32), 12)
    assert options.friction == (0.5, 0.9)
    with pytest.raises(TrainingError, match="option 'steps' is 'many'"):
        changed_by_texts(Options(), {"steps": "many"})
    with pytest.raises(TrainingError, match=r"unknown option 'stile'; there are: .*style"):
        changed_by_texts(Options(), {"stile": "0.5"})
    with pytest.raises(TrainingError, match="unknown preset 'papr'; there are: paper"):
        preset("papr")


STATE = {"actor_state_dict": {"a": torch.ones(2)}, "critic_state_dict": {}, "optimizer_state_dict": {}}


def test_the_newest_checkpoint_is_the_one_of_most_iterations(tmp_path):
    assert newest_checkpoint(tmp_path) is None
    for iteration in (900, 1000, 100):
        save_checkpoint(tmp_path, iteration, STATE, iteration * 24)
    newest = newest_checkpoint(tmp_path)
    assert newest is not None
    state = load_checkpoint(newest, "cpu")
    assert (state["iteration"], state["environment_steps"]) == (1000, 24_000)


class _Planted:
    """Runs code where it is unpickled."""

    def __reduce__(self):
        return (open, ("planted", "w"))


def test_a_checkpoint_that_would_run_code_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "model_000100.pt"
    torch.save({**STATE, "iteration": _Planted(), "environment_steps": 0}, path)
    with pytest.raises(TrainingError, match="no checkpoint of ours and was not loaded"):
        load_checkpoint(path, "cpu")
    path.write_bytes(pickle.dumps(_Planted()))
    with pytest.raises(TrainingError, match="not loaded"):
        load_checkpoint(path, "cpu")
    assert not (tmp_path / "planted").exists()


def test_a_checkpoint_that_the_disk_refuses_is_told_and_leaves_nothing(tmp_path, monkeypatch):
    def full(state, path):
        path.write_bytes(b"half")
        raise RuntimeError("unexpected pos 64 vs 0")

    monkeypatch.setattr(torch, "save", full)
    with pytest.raises(TrainingError, match=r"model_000100\.pt: could not be written \(unexpected pos 64 vs 0\)"):
        save_checkpoint(tmp_path, 100, dict(STATE), 0)
    assert not list(tmp_path.iterdir())


def test_a_checkpoint_that_is_not_there_is_not_called_damaged(tmp_path):
    with pytest.raises(TrainingError, match=r"gone\.pt: can't be read \(No such file"):
        load_checkpoint(tmp_path / "gone.pt", "cpu")


@pytest.mark.parametrize("error", [torch.OutOfMemoryError("CUDA out of memory. Tried 2 MiB\nmore"), MemoryError()])
def test_a_checkpoint_for_which_there_is_no_memory_is_not_called_damaged(tmp_path, monkeypatch, error):
    def full(*_, **__):
        raise error

    monkeypatch.setattr(torch, "load", full)
    with pytest.raises(TrainingError, match=r"good\.pt: there is no memory left on cpu to load it") as told:
        load_checkpoint(tmp_path / "good.pt", "cpu")
    assert "no checkpoint of ours" not in str(told.value)


def test_a_file_of_other_contents_is_no_checkpoint(tmp_path):
    path = tmp_path / "model_000001.pt"
    torch.save({"weights": torch.ones(1)}, path)
    with pytest.raises(TrainingError, match="lacks actor_state_dict, critic_state_dict"):
        load_checkpoint(path, "cpu")


def test_a_bundle_says_how_its_variants_were_made():
    made = augmented_by(["original", "mirror", "mirror~x0.9", "x1.1", "trunk_lean-2", "step_width0.02"])
    assert made == ["mirror", "time-scale", "step width", "trunk lean"]
    assert augmented_by(["original"]) == []


def test_a_bundle_has_what_it_states_and_can_do_without_augmented_clips(tmp_path, root, robot):
    folder = small_bundle(tmp_path, root, robot)
    both, plain = read_bundle(folder), read_bundle(folder, use_augmented=False)
    assert len(both.expert.clip_weight) == 2
    assert len(plain.expert.clip_weight) == 1
    assert len(plain.expert.frames) == plain.expert.clip_start[-1] < len(both.expert.frames)
    assert np.all(plain.expert.command == 0.0)
    assert both.robot.policy_joints[:3] == ("Left_Shoulder_Pitch", "Right_Shoulder_Pitch", "Waist")
    robot_xml = folder / "robot.xml"
    robot_xml.write_text(robot_xml.read_text() + " ")
    with pytest.raises(TrainingError, match=r"robot\.xml: its digest is not the one"):
        read_bundle(folder)
    robot_xml.unlink()
    with pytest.raises(TrainingError, match=r"robot\.xml: the file is missing"):
        read_bundle(folder)


def test_a_damaged_checkpoint_gives_one_sentence_or_a_whole_state(tmp_path):
    """Cut short anywhere, or with bits turned over: what PyTorch's parsers raise is told plainly, whatever it is."""
    rng = np.random.default_rng(0)
    tensors = {"mlp.0.weight": torch.ones(4, 3), "std": torch.ones(2)}
    whole = save_checkpoint(tmp_path, 5, {name: dict(tensors) for name in STATE}, 120).read_bytes()
    path, refused = tmp_path / "model_000001.pt", 0
    cuts = [whole[:size] for size in np.linspace(0, len(whole) - 1, 60).astype(int)]
    flipped = []
    for count in (1, 8, 64) * 60:
        damaged = np.frombuffer(whole, dtype=np.uint8).copy()
        damaged[rng.integers(len(damaged), size=count)] ^= np.uint8(1 << rng.integers(8))
        flipped.append(damaged.tobytes())
    for content in (*cuts, *flipped, b"", b"PK", b"\x80\x02.", b"\x80\x04K\x01."):
        path.write_bytes(content)
        try:
            state = load_checkpoint(path, "cpu")
        except TrainingError as error:
            refused += 1
            assert "\n" not in str(error)
            assert str(path) in str(error)
        else:
            assert isinstance(state["iteration"], int)
    assert refused > 150


@pytest.mark.parametrize(
    ("part", "value"), [("iteration", -1), ("iteration", "9"), ("actor_state_dict", torch.ones(1))]
)
def test_a_checkpoint_whose_parts_are_of_another_kind_is_refused(tmp_path, part, value):
    path = tmp_path / "model_000001.pt"
    torch.save({**STATE, "iteration": 1, "environment_steps": 24, part: value}, path)
    with pytest.raises(TrainingError, match=f"{part} of another kind"):
        load_checkpoint(path, "cpu")


def test_a_checkpoint_of_another_network_becomes_no_policy(tmp_path, root, robot):
    facts = read_bundle(small_bundle(tmp_path, root, robot)).robot
    with pytest.raises(TrainingError, match=r"actor is no network of ours \(KeyError"):
        policy_arrays({"actor_state_dict": {"weights": torch.ones(2)}}, facts)
