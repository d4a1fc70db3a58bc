"""The motion that a rollout tracked, brought to the rollout's frames.

A rollout of KP4 names its reference among the clips (`reference`) and the frame it begins at. For a recorded rollout
the catalogue names the motion by content (`tracks_content`, pipeline.readers.listing); both begin together. Where a
window, a piece or a variant of a recording is evaluated, the reference is sampled at the same times and mirrored alike.
"""

import dataclasses
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pipeline import rotation, time_series
from pipeline.batch import Store
from pipeline.clips.outcome import Numbers
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import PipelineError
from pipeline.feasibility.motion import NO_ROLLOUT
from pipeline.robot import Robot
from pipeline.robot.mirror_image import mirror_clip

CLIP = "reference"
"""Number of a rollout of KP4 that names the clip it tracked."""

FRAME = "reference_frame"
"""Number of a rollout of KP4, or of a piece of one: the frame of that clip at which it begins."""

CONTENT = "tracks_content"
"""Number of a recording that names the motion it tracked, by the digest of its file and of what is stated of it."""

PERTURBED = "a rollout that was changed on purpose"

_OWN_VARIANT = re.compile(r"original|mirror|x[0-9.]+")
"""Parts of the name of a variant that shows the recorded motion."""

References = Callable[[str], RobotClip]
"""The reference motion of a clip's name or of a content. Raises ReferenceGoneError."""


class ReferenceGoneError(PipelineError):
    """A reference that was there when the recording was catalogued."""

    def __init__(self, content: str):
        super().__init__(
            f"the motion that it tracked (content {content[:12]}) is not what the catalogue read; materialize "
            "motion_catalog again."
        )


@dataclass(frozen=True, kw_only=True)
class StoredReferences:
    """References in the store, for any process. A blob that is missing or damaged there raises StoreError."""

    store: Store
    blobs: Mapping[str, str]
    """Name or content -> blob."""

    def __call__(self, content: str) -> RobotClip:
        if content not in self.blobs:
            raise ReferenceGoneError(content)
        clip = self.store.get_clip(self.blobs[content], "reference")
        assert isinstance(clip, RobotClip)
        return clip


def no_references(content: str) -> RobotClip:
    """Where none are at hand."""
    raise ReferenceGoneError(content)


def reference_of(clip: RobotClip, numbers: Numbers, robot: Robot, references: References) -> RobotClip | None:
    """The reference at each frame of a clip; None where the clip is no tracked rollout,
    or a variant that was changed on purpose.

    Args:
        clip: the rollout, a window of it or a variant
        numbers: of earlier stages on it: `fps` and `start_frame` of the recording, `time_scale`, `mirrored`, and
            `stretch_start_s` of what left KP5 already
        robot: whose joints both have
        references: the motions by content
    """
    if numbers.get(CLIP):
        return _of_rollout(clip, numbers, references)
    content = numbers.get(CONTENT)
    if not content or is_perturbed(numbers):
        return None
    reference = references(str(content))
    start_s = float(numbers.get("start_frame") or 0) / float(numbers.get("fps") or clip.fps)
    variant_s = float(numbers.get("stretch_start_s") or 0.0) + np.arange(clip.frame_count) / clip.fps
    times_s = start_s + float(numbers.get("time_scale") or 1.0) * variant_s
    found = RobotClip(
        name=clip.name,
        fps=clip.fps,
        robot=reference.robot,
        joint_names=reference.joint_names,
        root_pos_w=time_series.resample_cubic(reference.root_pos_w, reference.fps, times_s),
        root_quat_w=time_series.resample_quat_cubic(reference.root_quat_w, reference.fps, times_s),
        joint_pos=time_series.resample_cubic(reference.joint_pos, reference.fps, times_s),
    )
    if not numbers.get("mirrored"):
        return found
    image = mirror_clip(found, robot, clip.name)
    return dataclasses.replace(image, root_quat_w=rotation.make_continuous(image.root_quat_w))


def why_none(numbers: Numbers) -> str:
    """Why a clip has no reference, where `reference_of` finds none."""
    return PERTURBED if numbers.get(CONTENT) else NO_ROLLOUT


def _of_rollout(clip: RobotClip, numbers: Numbers, references: References) -> RobotClip:
    """The frames that a rollout of KP4, or a piece of one, tracked."""
    start = int(numbers.get(FRAME) or 0)
    return references(str(numbers[CLIP])).cut(start, start + clip.frame_count, clip.name)


def is_perturbed(numbers: Numbers) -> bool:
    """Whether a variant moves otherwise than what was recorded, not just mirrored or at another speed."""
    parts = str(numbers.get("variant") or "original").split("~")
    return not all(_OWN_VARIANT.fullmatch(part) for part in parts)
