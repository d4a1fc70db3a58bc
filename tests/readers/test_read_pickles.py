"""Pickles of PHC, ASAP and GMR and files of torch.save: plain data is read, anything else is never made."""

import io
import os
import pickle
import resource
import shlex
import subprocess
import sys
import warnings
import zlib
from pathlib import Path

import joblib
import numpy as np
import pytest
import torch

from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers import Statement, read_motion
from pipeline.readers.restricted_pickle import PickledArray, converter, load_pickle, load_torch
from tests.factories import motion_files as files
from tests.factories import robot_files as robots

FRAMES = 20


def smpl_arrays():
    poses = np.zeros((FRAMES, 72))
    poses[:, 0] = np.pi / 2
    poses[:, 3:12] = 0.1 * np.sin(np.arange(FRAMES)[:, None] + np.arange(9))
    trans = np.stack([np.zeros(FRAMES), -0.02 * np.arange(FRAMES), np.full(FRAMES, 0.95)], axis=1)
    return poses, trans


@pytest.fixture
def truth(tmp_path):
    poses, trans = smpl_arrays()
    np.savez(tmp_path / "truth.npz", poses=poses, trans=trans, fps=30.0)
    return read_motion(tmp_path / "truth.npz", "clip").clip


def phc(poses, trans):
    return {"walk": {"pose_aa": poses, "trans_orig": trans, "beta": np.zeros(16), "gender": "neutral", "fps": 30}}


WRITERS = {
    **{
        f"protocol {number}": lambda value, path, n=number: path.write_bytes(pickle.dumps(value, n))
        for number in range(6)
    },
    "joblib": lambda value, path: joblib.dump(value, path),
    "joblib, zlib": lambda value, path: joblib.dump(value, path, compress=True),
}


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("kind", ["float64", "float32"])
def test_a_motion_of_phc_is_read_however_it_was_dumped(tmp_path, truth, writer, kind):
    poses, trans = smpl_arrays()
    value = phc(poses.astype(kind).reshape(FRAMES, 24, 3), np.asfortranarray(trans.astype(kind)))
    WRITERS[writer](value, tmp_path / "clip.pkl")
    read = read_motion(tmp_path / "clip.pkl", "clip")
    assert (read.format, read.clip.fps) == ("smpl", 30.0)
    np.testing.assert_allclose(read.clip.body_pos_w, truth.body_pos_w, atol=1e-5)


@pytest.mark.parametrize("kind", [torch.float64, torch.float32, torch.float16])
def test_the_results_of_gvhmr_are_read_at_its_rate(tmp_path, truth, kind):
    poses, trans = smpl_arrays()
    part = {
        "global_orient": poses[:, :3],
        "body_pose": poses[:, 3:66],
        "transl": trans,
        "betas": np.zeros((FRAMES, 10)),
    }
    value = {name: torch.tensor(array, dtype=kind) for name, array in part.items()}
    other = {name: tensor + 5 for name, tensor in value.items()}
    path = tmp_path / "hmr4d_results.pt"
    torch.save({"smpl_params_incam": other, "smpl_params_global": value, "K_fullimg": torch.eye(3)}, path)
    read = read_motion(path, "clip")
    assert [note.code for note in read.notes] == ["mean_skeleton", "assumed_rate"]
    np.testing.assert_allclose(read.clip.body_pos_w, truth.body_pos_w, atol=2e-3 if kind == torch.float16 else 1e-5)
    assert read_motion(path, "clip", Statement(fps=25.0)).clip.fps == 25.0


def test_tensors_are_those_that_torch_itself_loads(tmp_path):
    value = {
        "a": torch.arange(24.0).reshape(2, 3, 4)[:, 1:, ::2],
        "b": torch.tensor([1, 2]),
        "c": {"d": torch.zeros(0, 3)},
    }
    torch.save(value, tmp_path / "a.pt")
    mine, theirs = load_torch(tmp_path / "a.pt"), torch.load(tmp_path / "a.pt", weights_only=True)
    for a, b in ((mine["a"], theirs["a"]), (mine["b"], theirs["b"]), (mine["c"]["d"], theirs["c"]["d"])):
        np.testing.assert_array_equal(a.value, b.numpy())


@pytest.mark.parametrize("names", [("root_pos", "root_rot", "dof_pos"), ("root_trans_offset", "root_rot", "dof")])
@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
def test_a_robots_motion_of_gmr_is_read(tmp_path, names, order):
    root, quat, joints = robots.truth()
    quat = quat[:, ["wxyz".index(letter) for letter in order]]
    value = {
        **dict(zip(names, (root, quat, joints), strict=True)),
        "fps": 50,
        "local_body_pos": None,
        "link_body_list": ["a"],
    }
    (tmp_path / "clip.pkl").write_bytes(pickle.dumps(value))
    np.savez(tmp_path / "clip.npz", **{name: value[name] for name in (*names, "fps")})
    for file in ("clip.pkl", "clip.npz"):
        read = read_motion(tmp_path / file, "clip")
        assert [note.code for note in read.notes] == ([] if order == "xyzw" else ["quaternion_order"])
        robots.assert_truth(read.clip)


class Evil:
    def __reduce__(self):
        return os.system, ("touch /tmp/pickle_was_run",)


class Own:
    value = 1


@pytest.mark.parametrize(
    ("value", "match"),
    [
        (Evil(), r"it holds '(posix|os|nt)\.system', which is never loaded. If you trust it, .*numpy.savez"),
        (Own(), r"it holds 'copyreg|it holds '.*Own"),
        ({"a": Evil()}, r"system', which is never loaded"),
        (np.array([Evil()], dtype=object), r"system', which is never loaded"),
        ([1, 2], "it holds a list, expected named arrays"),
        ({"a": {"poses": np.zeros((3, 72))}, "b": {"poses": np.zeros((3, 72))}}, r"it holds 2 motions \(a, b, ...\)"),
        ({"speed": np.zeros((3, 2))}, "no known motion: it holds speed"),
        ({}, "no known motion: it holds nothing"),
    ],
)
def test_what_is_not_plain_data_or_no_motion_is_refused(tmp_path, value, match):
    (tmp_path / "clip.pkl").write_bytes(pickle.dumps(value))
    with pytest.raises(FileError, match=match):
        read_motion(tmp_path / "clip.pkl", "clip")
    assert not os.path.exists("/tmp/pickle_was_run")  # noqa: PTH110


def test_a_file_of_torch_that_holds_more_than_tensors_is_refused(tmp_path):
    torch.save({"model": torch.nn.Linear(2, 2)}, tmp_path / "clip.pt")
    with pytest.raises(FileError, match=r"it holds 'torch.nn.modules.linear.Linear', which is never loaded"):
        read_motion(tmp_path / "clip.pt", "clip")


@pytest.mark.parametrize(
    "data",
    [
        b"\x80\x04\x8d" + (2**60).to_bytes(8, "little"),
        b"\x80\x04\x8e" + (2**62).to_bytes(8, "little"),
        b"\x80\x02" + b"(" * 100_000,
        b"\x80\x02]" + b"2" * 1000 + b".",
        zlib.compress(bytes(50_000_000)),
        b"",
        b"\x80",
        b"PK\x03\x04",
    ],
)
def test_bombs_and_rubble_are_refused_before_memory_is_taken(tmp_path, data):
    (tmp_path / "clip.pkl").write_bytes(data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(FileError):
        read_motion(tmp_path / "clip.pkl", "clip")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


def test_a_shape_that_lies_is_refused(tmp_path):
    stream = io.BytesIO()
    joblib.dump({"poses": np.zeros((3, 72))}, stream)
    data = stream.getvalue().replace(b"K\x03KH\x86", b"K\x7fKH\x86")
    (tmp_path / "clip.pkl").write_bytes(data)
    with pytest.raises(FileError, match="not a pickle that can be read"):
        load_pickle(tmp_path / "clip.pkl")


@pytest.mark.parametrize("file", ["clip.pkl", "joblib.pkl", "clip.pt"])
def test_a_mutated_file_is_read_or_refused_in_a_sentence(tmp_path, file):
    from tests.readers.test_mutated_files import MUTATIONS, mutated

    poses, trans = smpl_arrays()
    path = tmp_path / file
    if file == "clip.pt":
        torch.save({"poses": torch.tensor(poses[:3]), "trans": torch.tensor(trans[:3])}, path)
    else:
        WRITERS["joblib" if file == "joblib.pkl" else "protocol 4"](phc(poses[:3], trans[:3]), path)
    data, random, refused = path.read_bytes(), np.random.default_rng(3), 0
    for _ in range(MUTATIONS):
        path.write_bytes(mutated(data, random))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                assert read_motion(path, "clip", Statement(fps=30.0)).clip.frame_count >= 2
        except FileError as error:
            refused += 1
            assert len(str(error)) < 2_000
    assert refused > 0.2 * MUTATIONS


def test_arrays_of_objects_stay_empty(tmp_path):
    (tmp_path / "a.pkl").write_bytes(pickle.dumps(np.array([None, 1], dtype=object)))
    value = load_pickle(tmp_path / "a.pkl")
    assert isinstance(value, PickledArray) and value.value is None


def test_a_robot_of_as_many_joints_in_another_order_is_not_taken_for_ours(tmp_path):
    root, quat, _ = robots.truth()
    knees = np.full((len(root), 23), -1.2)
    value = {"root_pos": root, "root_rot": np.roll(quat, -1, axis=1), "dof_pos": knees, "fps": 30}
    (tmp_path / "clip.pkl").write_bytes(pickle.dumps(value))
    with pytest.raises(AmbiguousFileError, match=r"beyond its limits in 100% of the frames.*another robot"):
        read_motion(tmp_path / "clip.pkl", "clip")


def test_the_factory_of_motions_writes_what_was_meant(tmp_path):
    assert read_motion(files.smpl_npz(tmp_path / "clip.npz"), "clip").clip.frame_count == 20


def test_a_files_name_stays_one_word_of_the_command_that_a_person_copies():
    path = Path("/tmp/walk'); import os; os.system('echo run #.pkl")
    words = shlex.split(converter(path).split("archive: ", 1)[1])
    assert words[:2] == ["python", "-c"] and words[3:] == [path.name, f"{path.stem}.npz"]
    assert "os.system" not in words[2]


def _converted(path: Path) -> subprocess.CompletedProcess:
    """Run the printed command in the file's folder, with this Python."""
    words = shlex.split(converter(path).split("archive: ", 1)[1])
    return subprocess.run([sys.executable, *words[1:]], cwd=path.parent, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.parametrize("dump", ["pickle", "joblib"])
def test_the_printed_command_makes_an_archive_that_is_read_without_pickle(tmp_path, dump, nested):
    values = {"root_trans": np.arange(6.0).reshape(2, 3), "fps": 30, "dof": torch.ones(2, 4)}
    content = {"walk": values} if nested else values
    path = tmp_path / "a clip.pkl"
    path.write_bytes(pickle.dumps(content)) if dump == "pickle" else joblib.dump(content, path, compress=3)
    done = _converted(path)
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "a clip.npz", allow_pickle=False) as arrays:
        assert set(arrays.files) == set(values)
        np.testing.assert_array_equal(arrays["root_trans"], values["root_trans"])
        np.testing.assert_array_equal(arrays["dof"], np.ones((2, 4)))


def test_the_printed_command_names_what_is_no_array_and_writes_nothing(tmp_path):
    path = tmp_path / "clip.pkl"
    path.write_bytes(pickle.dumps({"fps": 30, "settings": {"a": None}}))
    done = _converted(path)
    assert done.returncode != 0 and "no arrays: ['settings']" in done.stderr
    assert not (tmp_path / "clip.npz").exists()
