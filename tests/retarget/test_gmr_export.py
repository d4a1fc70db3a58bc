"""What GMR is given of a clip: the joints of the BVH file, whatever canonical frames the clip is in."""

import numpy as np
import pytest

from benchmarks import retarget
from benchmarks.gmr import BODIES, FEET, joints_of
from benchmarks.gmr_worker import without_meshes
from pipeline import rotation
from pipeline.readers import read_motion
from pipeline.readers.bvh import read_bvh
from pipeline.readers.human_motion import TO_Z_UP
from pipeline.readers.match_skeleton import match_skeleton


def test_canonical_frames_go_back_to_the_joints_of_the_file(root):
    file = root / "data/motions/walk.bvh"
    motion = read_motion(file, "walk")
    raw = read_bvh(file)
    names, pos_w, quat_w = joints_of(motion.clip, file)
    skeleton, axes = match_skeleton(raw)[0], TO_Z_UP[motion.up_axis]
    sources = {**{name: (body, body) for name, body in BODIES.items()}, **FEET}
    assert names == list(sources)
    for column, (place, orientation) in enumerate(sources.values()):
        at, turned = (raw.joint_names.index(skeleton.bodies[body].joint) for body in (place, orientation))
        wanted = rotation.multiply(rotation.from_matrix(axes), raw.joint_quat_w[:, turned])
        assert rotation.angle_between(quat_w[:, column], wanted).max() < 1e-6, names[column]
        expected_w = raw.joint_pos_w[:, at] @ axes.T * motion.metres_per_unit
        np.testing.assert_allclose(pos_w[:, column], expected_w, atol=1e-6, err_msg=names[column])


def test_meshes_and_what_shows_them_are_taken_out_of_a_model_and_nothing_else():
    model = without_meshes(
        "<mujoco><asset><mesh name='a' file='a.STL'/></asset><worldbody><body name='b'><inertial pos='0 0 0' mass='1'/>"
        "<geom type='mesh' mesh='a'/><geom type='box' size='1 1 1'/></body></worldbody></mujoco>"
    )
    assert "STL" not in model and "mesh=" not in model
    assert model.count("<geom") == 1 and "<inertial" in model


def test_a_speed_without_a_run_is_refused(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["retarget.py", "walk.bvh", "--repeat", "0"])
    with pytest.raises(SystemExit):
        retarget.main()
    assert "--repeat must be 1 or more" in capsys.readouterr().err
