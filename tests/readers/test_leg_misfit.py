"""Two maps that fit the same names and bones are distinguished by the poses, or the file is refused as ambiguous."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.errors import AmbiguousFileError
from pipeline.readers import Statement, read_motion
from pipeline.readers.skeleton_map import shipped_maps
from tests.factories import motion_files as files
from tests.factories.conventions import CONVENTIONS, Convention, write_bvh

CMU = CONVENTIONS["cmu"]


def walking(frames=60, knee_deg=50.0):
    """The figure walking with knees that bend about its left axis."""
    poses = files.upright(frames)
    swing = np.deg2rad(knee_deg) * 0.5 * (1 - np.cos(np.linspace(0, 12, frames)))
    for side, phase in (("Left", 0.0), ("Right", 1.0)):
        angle = swing if phase == 0.0 else swing[::-1]
        poses.local[:, files.NAMES.index(f"{side}Leg")] = Rotation.from_euler("x", angle[:, None]).as_matrix()
        poses.local[:, files.NAMES.index(f"{side}UpLeg")] = Rotation.from_euler("x", -0.5 * angle[:, None]).as_matrix()
    return poses


def on_pfnns_figure(text):
    """A BVH in CMU's names whose left thigh has the rest offset that identifies the figure of PFNN."""
    lines = text.split("\n")
    at = next(index for index, line in enumerate(lines) if line.endswith("LeftLeg"))
    lines[at + 2] = "OFFSET 2.44811 -6.72613 0.00000"
    return "\n".join(lines)


@pytest.mark.parametrize("prefix", ["", "Subject01:"])
@pytest.mark.parametrize("fps", [30.0, 120.0])
def test_cmu_recordings_on_pfnns_figure_are_read_as_cmu(tmp_path, prefix, fps):
    convention = Convention(names=CMU.names, between=CMU.between, prefix=prefix)
    text = write_bvh(walking(), convention, metres_per_unit=0.0254 / 0.45, fps=fps)
    (tmp_path / "clip.bvh").write_text(on_pfnns_figure(text))
    read = read_motion(tmp_path / "clip.bvh", "clip")
    assert (read.skeleton, read.clip.fps) == ("cmu", fps)


def test_the_same_names_with_pfnns_axes_are_read_as_pfnn(tmp_path):
    poses = walking()
    axes = {"Left": (0.83, 0.30, 0.41), "Right": (0.84, -0.13, -0.48)}
    for side in ("Left", "Right"):
        knee = poses.local[:, files.NAMES.index(f"{side}Leg")]
        hip = poses.local[:, files.NAMES.index(f"{side}UpLeg")]
        twist = Rotation.from_euler("y", np.arctan2(axes[side][2], axes[side][0])).as_matrix()
        poses.local[:, files.NAMES.index(f"{side}UpLeg")] = hip @ twist
        poses.local[:, files.NAMES.index(f"{side}Leg")] = twist.T @ knee @ twist
        foot = files.NAMES.index(f"{side}Foot")
        poses.local[:, foot] = twist.T @ poses.local[:, foot]
    text = write_bvh(poses, CMU, metres_per_unit=0.0254 / 0.45)
    (tmp_path / "clip.bvh").write_text(on_pfnns_figure(text))
    assert read_motion(tmp_path / "clip.bvh", "clip").skeleton == "pfnn"


def test_poses_that_do_not_tell_make_the_file_ambiguous_until_the_skeleton_is_stated(tmp_path):
    text = write_bvh(walking(knee_deg=5.0), CMU, metres_per_unit=0.0254 / 0.45)
    path = tmp_path / "clip.bvh"
    path.write_text(on_pfnns_figure(text))
    with pytest.raises(AmbiguousFileError, match=r"several skeletons fit: cmu, pfnn. State `skeleton:`"):
        read_motion(path, "clip")
    assert read_motion(path, "clip", Statement(skeleton="cmu")).skeleton == "cmu"


@pytest.mark.shared
def test_bones_along_an_axis_are_read_by_the_map_with_these_axes_under_other_names(tmp_path, mocap):
    """LAFAN1's own frames, whose rest pose nobody can stand in, under Mixamo's names."""
    text = (mocap / "lafan1_60fps" / "walk1_subject1_walk2.bvh").read_text()
    (tmp_path / "plain.bvh").write_text(text)
    renamed = (
        text.replace("JOINT ", "JOINT mixamorig:").replace("ROOT ", "ROOT mixamorig:").replace("Toe\n", "ToeBase\n")
    )
    (tmp_path / "renamed.bvh").write_text(renamed)
    plain, other = (read_motion(tmp_path / f"{name}.bvh", "clip") for name in ("plain", "renamed"))
    assert other.skeleton == "lafan1"
    np.testing.assert_array_equal(plain.clip.body_quat_w, other.clip.body_quat_w)
    assert shipped_maps()["lafan1"].joints - set(renamed.split())
