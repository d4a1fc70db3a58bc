"""ONNX and TorchScript give the network's actions, bear its facts, and are refused when they are not what they say."""

import dataclasses
import io
import os
import pickle
import zipfile

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from onnx import TensorProto, helper, numpy_helper

from pipeline.deployment import deployment_task, digest, load_policy
from pipeline.errors import FileError
from pipeline.export.metadata import ExportError
from pipeline.export.networks import (
    read_onnx,
    read_torch_script,
    to_onnx,
    to_torch_script,
)
from pipeline.export.parity import TOLERANCE, measure_parity, observations_to_compare
from tests.factories.networks import network, with_robot_gains


@pytest.fixture
def policy(robot):
    return network(robot, np.random.default_rng(3))


@pytest.fixture
def task(robot):
    return deployment_task(robot)


@pytest.fixture
def files(tmp_path, task, policy):
    (tmp_path / "a.onnx").write_bytes(to_onnx(task, policy))
    (tmp_path / "a.pt").write_bytes(to_torch_script(task, policy))
    return tmp_path / "a.onnx", tmp_path / "a.pt"


def test_both_give_the_networks_actions(files, policy):
    golden = np.random.default_rng(0).normal(size=(5, 720))
    observations = observations_to_compare(policy, golden, np.random.default_rng(1))
    parity = measure_parity(policy, files[0], files[1], observations)
    assert parity.runtime == "onnxruntime"
    assert parity.observations == 5 + 256
    assert 0.0 < max(parity.onnx, parity.torch_script) <= TOLERANCE


def test_a_network_of_torch_itself_agrees(files, policy):
    """Against layers of torch built here, not by the exporter."""
    observation = torch.randn(7, 720, generator=torch.Generator().manual_seed(0))
    value = (observation - torch.tensor(policy.mean, dtype=torch.float32)) / torch.tensor(policy.scale).float()
    for index, (weight, bias) in enumerate(policy.layers):
        value = torch.nn.functional.linear(value, torch.tensor(weight).float(), torch.tensor(bias).float())
        if index < len(policy.layers) - 1:
            value = torch.where(value > 0.0, value, torch.exp(value) - 1.0)
    session = onnxruntime.InferenceSession(str(files[0]), providers=["CPUExecutionProvider"])
    (action,) = session.run(["action"], {"observation": observation.numpy()})
    assert np.abs(action - value.numpy()).max() < 1e-5
    assert np.abs(read_torch_script(files[1])[0](observation).detach().numpy() - value.numpy()).max() < 1e-5


def test_one_observation_and_many_are_taken(files):
    module, _ = read_torch_script(files[1])
    assert module(torch.zeros(720)).shape == (21,)
    assert module(torch.zeros(4, 720)).shape == (4, 21)


@pytest.mark.parametrize("wrong", ["mean", "scale", "layers"])
def test_an_export_of_another_network_is_refused(tmp_path, files, task, policy, wrong):
    """A normalizer left out, for one, is no rounding error."""
    changed = {
        "mean": np.zeros_like(policy.mean),
        "scale": np.ones_like(policy.scale),
        "layers": (*policy.layers[:-1], (policy.layers[-1][0], policy.layers[-1][1] + 1e-4)),
    }
    other = dataclasses.replace(policy, **{wrong: changed[wrong]})
    (tmp_path / "b.onnx").write_bytes(to_onnx(task, other))
    observations = observations_to_compare(policy, np.zeros((1, 720)), np.random.default_rng(1))
    with pytest.raises(ExportError, match=r"differ by .* \(ONNX, onnxruntime\)"):
        measure_parity(policy, tmp_path / "b.onnx", files[1], observations)
    (tmp_path / "b.pt").write_bytes(to_torch_script(task, other))
    with pytest.raises(ExportError, match=r"TorchScript"):
        measure_parity(policy, files[0], tmp_path / "b.pt", observations)


def test_of_large_actions_a_millionth_is_allowed(tmp_path, task, policy):
    weight, bias = policy.layers[-1]
    large = dataclasses.replace(policy, layers=(*policy.layers[:-1], (weight, bias + 100.0)))
    shifted = dataclasses.replace(policy, layers=(*policy.layers[:-1], (weight, bias + 100.0 + 5e-5)))
    observations = observations_to_compare(policy, np.zeros((1, 720)), np.random.default_rng(1))
    (tmp_path / "b.onnx").write_bytes(to_onnx(task, shifted))
    (tmp_path / "b.pt").write_bytes(to_torch_script(task, shifted))
    found = measure_parity(large, tmp_path / "b.onnx", tmp_path / "b.pt", observations)
    assert found.onnx > TOLERANCE
    assert 0.4 < found.times_allowed < 1.0
    further = dataclasses.replace(policy, layers=(*policy.layers[:-1], (weight, bias + 100.0 + 2e-4)))
    (tmp_path / "c.onnx").write_bytes(to_onnx(task, further))
    with pytest.raises(ExportError, match=r"a millionth of an action beyond 10; the largest is 10\d"):
        measure_parity(large, tmp_path / "c.onnx", tmp_path / "b.pt", observations)


def test_facts_travel_with_both(files, robot, task, policy):
    for facts in (read_onnx(files[0])[1], read_torch_script(files[1])[1]):
        assert tuple(facts["joint_names"]) == robot.joint_names
        assert tuple(facts["policy_joints"]) == task.policy_joints
        np.testing.assert_array_equal(facts["kp"], robot.kp)
        np.testing.assert_array_equal(facts["kd"], robot.kd)
        np.testing.assert_array_equal(facts["default_joint_pos"], robot.default_joint_pos)
        assert (facts["action_scale"], facts["history"], facts["control_hz"]) == (0.25, 10, 50.0)
        assert facts["digest"] == digest(policy)


def test_equal_policies_give_equal_bytes_without_paths_of_the_machine(task, policy, root):
    assert to_onnx(task, policy) == to_onnx(task, policy)
    script = to_torch_script(task, policy)
    assert script == to_torch_script(task, policy)
    with zipfile.ZipFile(io.BytesIO(script)) as archive:
        content = b"".join(archive.read(name) for name in archive.namelist())
    assert str(root).encode() not in content
    assert b"site-packages" not in content


@pytest.mark.shared
def test_the_published_policy_is_exported_to_within_the_tolerance(tmp_path, policies, robot, task):
    policy = with_robot_gains(load_policy(policies / "t1_walk.npz"), robot)
    assert policy.golden is not None
    (tmp_path / "a.onnx").write_bytes(to_onnx(task, policy))
    (tmp_path / "a.pt").write_bytes(to_torch_script(task, policy))
    observations = observations_to_compare(policy, policy.golden.observation, np.random.default_rng(0))
    assert measure_parity(policy, tmp_path / "a.onnx", tmp_path / "a.pt", observations).holds
    module, _ = read_torch_script(tmp_path / "a.pt")
    action = module(torch.tensor(policy.golden.observation, dtype=torch.float32))
    assert np.abs(action.detach().numpy() - policy.golden.action).max() < 1e-5


class _Payload:
    """Runs code when it is unpickled: makes the folder it was told."""

    def __init__(self, folder):
        self.folder = str(folder)

    def __reduce__(self):
        return os.mkdir, (self.folder,)


def test_a_checkpoint_that_would_run_code_is_refused_and_runs_none(tmp_path):
    ran = tmp_path / "ran"
    torch.save({"actor_state_dict": _Payload(ran)}, tmp_path / "model.pt")
    with pytest.raises(FileError, match=r"without code/"):
        read_torch_script(tmp_path / "model.pt")
    (tmp_path / "raw.pt").write_bytes(pickle.dumps(_Payload(ran)))
    with pytest.raises(FileError, match=r"no archive of torch"):
        read_torch_script(tmp_path / "raw.pt")
    with pytest.raises(pickle.UnpicklingError):
        torch.load(tmp_path / "model.pt", weights_only=True)
    with pytest.raises(FileError, match=r"is not an npz of numbers"):
        load_policy(tmp_path / "raw.pt")
    assert not ran.exists()


def test_a_payload_inside_a_torch_script_archive_is_refused_and_not_run(tmp_path, files):
    ran = tmp_path / "ran"
    with zipfile.ZipFile(files[1]) as old, zipfile.ZipFile(tmp_path / "bad.pt", "w") as new:
        for name in old.namelist():
            new.writestr(name, pickle.dumps(_Payload(ran)) if name.endswith("/data.pkl") else old.read(name))
    with pytest.raises(FileError, match=r"not a TorchScript module"):
        read_torch_script(tmp_path / "bad.pt")
    assert not ran.exists()


def test_onnx_with_numbers_in_another_file_is_refused(tmp_path, files):
    model = onnx.load(str(files[0]))
    onnx.save_model(model, str(tmp_path / "out.onnx"), save_as_external_data=True, location="weights", size_threshold=0)
    with pytest.raises(FileError, match=r"keeps .*mean.* in another file"):
        read_onnx(tmp_path / "out.onnx")


def test_onnx_with_external_numbers_in_a_node_is_refused(tmp_path):
    tensor = numpy_helper.from_array(np.zeros(2, np.float32), "hidden")
    tensor.data_location = TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value="/etc/passwd")
    node = helper.make_node("Constant", [], ["action"], value=tensor)
    graph = helper.make_graph([node], "bad", [], [helper.make_tensor_value_info("action", TensorProto.FLOAT, [2])])
    (tmp_path / "bad.onnx").write_bytes(helper.make_model(graph).SerializeToString())
    with pytest.raises(FileError, match=r"keeps hidden in another file"):
        read_onnx(tmp_path / "bad.onnx")


def test_a_disk_that_fails_is_not_called_a_damaged_onnx(files, monkeypatch):
    def fail(path):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(type(files[0]), "read_bytes", fail)
    with pytest.raises(FileError, match=r"can't be read \(Input/output error\)"):
        read_onnx(files[0])


def test_onnx_of_other_operators_is_refused(tmp_path):
    info = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", 3]) for name in ("observation", "action")]
    graph = helper.make_graph([helper.make_node("Tanh", ["observation"], ["action"])], "other", [info[0]], [info[1]])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    (tmp_path / "other.onnx").write_bytes(model.SerializeToString())
    with pytest.raises(FileError, match=r"operators Tanh; a policy has only Div, Elu, Gemm, Sub"):
        read_onnx(tmp_path / "other.onnx")


@pytest.mark.parametrize("read", [read_onnx, read_torch_script])
def test_what_is_no_network_is_refused_by_name(tmp_path, read):
    with pytest.raises(FileError, match=r"there is no such file"):
        read(tmp_path / "missing")
    (tmp_path / "noise").write_bytes(np.random.default_rng(0).bytes(500))
    with pytest.raises(FileError, match=r"noise: is (no|not a)"):
        read(tmp_path / "noise")
