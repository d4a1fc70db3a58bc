"""glTF animations against the same motion as BVH, and damage of every kind in a sentence."""

import base64
import json
import warnings

import numpy as np
import pytest

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.readers import Statement, read_motion
from tests.factories import motion_files as files
from tests.factories.conventions import CONVENTIONS
from tests.factories.gltf import write_gltf
from tests.readers.test_mutated_files import MUTATIONS, mutated

POSES = files.upright(30, seed=8)


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    path = tmp_path_factory.mktemp("truth") / "clip.bvh"
    path.write_text(files.bvh(POSES, files.BvhStyle(fps=30.0)))
    return read_motion(path, "clip").clip


STYLES = {
    "as Mixamo": {},
    "frames along the axes": {"seed": 0},
    "other frames": {"seed": 5},
    "an armature in centimetres": {"scale": 0.01},
    "nodes in the pose of the first frame": {"rest_is_first_frame": True},
    "without a skin": {"skin": False, "seed": 0},
    "names of Xsens": {"names": CONVENTIONS["xsens"].sided(CONVENTIONS["xsens"].names), "prefix": ""},
}


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("style", STYLES)
def test_an_animation_is_the_motion(tmp_path, truth, style, suffix):
    read = read_motion(write_gltf(tmp_path / f"clip{suffix}", POSES, **STYLES[style]), "clip")
    assert (read.format, read.unit, read.up_axis, read.clip.fps, read.notes) == ("gltf", "m", "y", 30.0, ())
    np.testing.assert_allclose(read.clip.body_pos_w, truth.body_pos_w, atol=1e-4)
    assert rotation.angle_between(read.clip.body_quat_w, truth.body_quat_w).max() < 1e-3


@pytest.mark.parametrize("fps", [24.0, 60.0, 120.0])
def test_the_rate_is_that_of_the_keys(tmp_path, fps):
    assert read_motion(write_gltf(tmp_path / "clip.glb", POSES, fps=fps), "clip").clip.fps == fps


def test_keys_far_apart_are_sampled_and_noted(tmp_path):
    read = read_motion(write_gltf(tmp_path / "clip.glb", POSES, fps=5.0), "clip")
    assert [(note.code, note.effect) for note in read.notes] == [("sampled_keys", "noted")]
    assert (read.clip.fps, read.clip.frame_count) == (30.0, 29 * 6 + 1)
    np.testing.assert_allclose(read.clip.pos("pelvis")[::6], read.clip.pos("pelvis")[::6])
    between = 0.5 * (read.clip.pos("pelvis")[0] + read.clip.pos("pelvis")[6])
    np.testing.assert_allclose(read.clip.pos("pelvis")[3], between, atol=1e-6)


def test_of_several_animations_one_is_read_and_the_others_are_noted(tmp_path):
    def twice(value):
        return {**value, "animations": [{**value["animations"][0], "name": "a"}, value["animations"][0]]}

    read = read_motion(write_gltf(tmp_path / "clip.glb", POSES, change=twice), "clip")
    (note,) = read.notes
    assert (note.code, note.value) == ("several_animations", 2.0)
    assert "'a'" in note.text


CHANGES = {
    "no animation": (lambda v: {**v, "animations": []}, "no animation moves the skeleton"),
    "no version": (lambda v: {**v, "asset": {"version": "1.0"}}, "it is not glTF 2.0"),
    "an accessor that reaches beyond": (
        lambda v: {**v, "accessors": [{**each, "count": 10**6} for each in v["accessors"]]},
        "reaches beyond its buffer",
    ),
    "an accessor of terabytes": (
        lambda v: {**v, "accessors": [{**each, "count": 10**12} for each in v["accessors"]]},
        "more than are allowed",
    ),
    "a negative offset": (
        lambda v: {**v, "bufferViews": [{**each, "byteOffset": -9} for each in v["bufferViews"]]},
        "reaches beyond its buffer",
    ),
    "a circle": (lambda v: {**v, "nodes": [{**each, "children": [1]} for each in v["nodes"]]}, "two parents"),
    "a shear": (
        lambda v: {**v, "nodes": [{**v["nodes"][0], "scale": [1, 2, 1]}, *v["nodes"][1:]]},
        "scaled differently along its axes",
    ),
    "a buffer elsewhere": (lambda v: {**v, "buffers": [{"uri": "../../etc/passwd"}]}, "not a file beside it"),
    "no skeleton": (lambda v: {**v, "nodes": [], "skins": []}, "there is no skeleton"),
    "a skeleton of nobody": (
        lambda v: {**v, "nodes": [{**each, "name": f"bone_{n}"} for n, each in enumerate(v["nodes"])]},
        "unknown skeleton of 22 joints",
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_what_can_not_be_read_is_refused_in_a_sentence(tmp_path, name):
    change, match = CHANGES[name]
    path = write_gltf(tmp_path / "clip.glb", POSES, change=change)
    with pytest.raises(FileError, match=match):
        read_motion(path, "clip")


@pytest.mark.parametrize("data", [b"glTF", b"{}", b"[1]", b"\xff\xfe", b"[" * 100_000])
def test_rubble_is_refused(tmp_path, data):
    for suffix in (".glb", ".gltf"):
        (tmp_path / f"clip{suffix}").write_bytes(data)
        with pytest.raises(FileError):
            read_motion(tmp_path / f"clip{suffix}", "clip")


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_a_mutated_file_is_read_or_refused_in_a_sentence(tmp_path, suffix):
    path = write_gltf(tmp_path / f"clip{suffix}", files.upright(4, seed=1))
    data, random = path.read_bytes(), np.random.default_rng(9)
    head = len(json.dumps({})) + 6000
    for number in range(MUTATIONS):
        part = data if number % 2 else data[:head]
        path.write_bytes(mutated(part, random) + (b"" if number % 2 else data[head:]))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                assert read_motion(path, "clip", Statement(unit="m", up="y")).clip.frame_count >= 2
        except FileError as error:
            assert len(str(error)) < 2_000


def with_bind_matrix(path, change):
    """A glTF whose first bind matrix was changed by `change(matrix)`, column-major."""
    path = write_gltf(path, POSES)
    value = json.loads(path.read_text())
    accessor = value["accessors"][value["skins"][0]["inverseBindMatrices"]]
    head, _, packed = value["buffers"][0]["uri"].partition(",")
    data = bytearray(base64.b64decode(packed))
    start = value["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    matrix = np.frombuffer(bytes(data[start : start + 64]), "<f4").copy()
    data[start : start + 64] = change(matrix).astype("<f4").tobytes()
    value["buffers"][0]["uri"] = f"{head},{base64.b64encode(data).decode()}"
    path.write_text(json.dumps(value))
    return path


def sheared(matrix):
    matrix[4:7] += 0.5 * matrix[0:3]
    return matrix


def mirrored(matrix):
    matrix[0:3] *= -1.0
    return matrix


@pytest.mark.parametrize("change", [sheared, mirrored])
def test_a_bind_matrix_that_is_no_rotation_is_refused(tmp_path, change):
    assert read_motion(with_bind_matrix(tmp_path / "a.gltf", lambda matrix: matrix), "clip").clip.frame_count == 30
    with pytest.raises(FileError, match=r"b\.gltf: a bind matrix of the skin is no rotation"):
        read_motion(with_bind_matrix(tmp_path / "b.gltf", change), "clip")


def test_a_buffer_that_is_not_ascii_is_refused(tmp_path):
    path = write_gltf(tmp_path / "clip.gltf", POSES)
    path.write_text(path.read_text().replace("base64,", "base64,\u202e", 1))
    with pytest.raises(FileError, match=r"buffers\[0\] is not base64"):
        read_motion(path, "clip")
