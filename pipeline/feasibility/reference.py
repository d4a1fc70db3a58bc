"""The motion that a rollout tracked, sampled at the rollout's frames.

The numbers of a KP4 rollout name its reference clip (`reference`) and the frame at which it begins. For a recorded
rollout the catalogue identifies the motion by content (`tracks_content`, pipeline.readers.listing); both begin at the
same time. For a window, piece or variant of a recording, the reference is sampled at the same times and mirrored if the
variant is.
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
"""Key of the number of a KP4 rollout with the name of the tracked clip."""

FRAME = "reference_frame"
"""Key of the number of a KP4 rollout, or a piece of one, with the frame of that clip at which it begins."""

CONTENT = "tracks_content"
"""Key of the number of a recording with the content digest of the tracked motion (file and its source entry)."""

PERTURBED = "a rollout that was changed on purpose"

_OWN_VARIANT = re.compile(r"original|mirror|x[0-9.]+")
"""Name parts of a variant that does not change the motion."""

References = Callable[[str], RobotClip]
"""Function from a clip's name or a content digest to the reference motion. Raises ReferenceGoneError."""


class ReferenceGoneError(PipelineError):
    """Raised for a reference that has disappeared since the recording was catalogued."""

    def __init__(self, content: str):
        super().__init__(
            f"the motion that it tracked (content {content[:12]}) is not what the catalogue read; materialize "
            "motion_catalog again."
        )


@dataclass(frozen=True, kw_only=True)
class StoredReferences:
    """References in the store, usable in any process. A missing or damaged blob raises StoreError."""

    store: Store
    blobs: Mapping[str, str]
    """Name or content digest -> blob digest."""

    def __call__(self, content: str) -> RobotClip:
        if content not in self.blobs:
            raise ReferenceGoneError(content)
        clip = self.store.get_clip(self.blobs[content], "reference")
        assert isinstance(clip, RobotClip)
        return clip


def no_references(content: str) -> RobotClip:
    """`References` without any motion: always raises ReferenceGoneError."""
    raise ReferenceGoneError(content)


def reference_of(clip: RobotClip, numbers: Numbers, robot: Robot, references: References) -> RobotClip | None:
    """The reference at each frame of a clip; None for a clip that is not a tracked rollout, and for a perturbed
    variant.

    Args:
        clip: the rollout, a window of it or a variant
        numbers: numbers of earlier stages: `fps` and `start_frame` of the recording, `time_scale`, `mirrored`, and
            `stretch_start_s` for a piece of KP5
        robot: robot of both motions
        references: reference motions by name or content digest
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
    """Why `reference_of` returns None for a clip."""
    return PERTURBED if numbers.get(CONTENT) else NO_ROLLOUT


def _of_rollout(clip: RobotClip, numbers: Numbers, references: References) -> RobotClip:
    """The reference frames that a KP4 rollout, or a piece of one, tracked."""
    start = int(numbers.get(FRAME) or 0)
    return references(str(numbers[CLIP])).cut(start, start + clip.frame_count, clip.name)


def is_perturbed(numbers: Numbers) -> bool:
    """Whether a variant's motion differs from the recording by more than mirroring or time scaling."""
    parts = str(numbers.get("variant") or "original").split("~")
    return not all(_OWN_VARIANT.fullmatch(part) for part in parts)
