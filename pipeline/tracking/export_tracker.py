"""Write a tracker's folder from a training run: `python -m pipeline.tracking.export_tracker`.

    --run DIR      a run of `python -m pipeline.tracking`
    --bundle DIR   the bundle it was trained on
    --robot DIR    the adapted robot, `data/adapted_robot/<robot>`
    --out DIR      the folder, as `robots/t1/policies/tracker`
    --command TEXT, --commit TEXT   how the run was made, for the card

Every clip of the bundle is rolled out once without disturbance; the figures go into the card.
"""

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from pipeline.actuators.adapted_robot import read_actuators, torque_envelope
from pipeline.batch.pool import ClipPool
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import PipelineError
from pipeline.files import settings
from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint
from pipeline.learning.policy_file import write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.robot import Robot, load_robot
from pipeline.tracking.bundle import Motions, check_trained_on, read_tracking_bundle
from pipeline.tracking.process import Setup, process
from pipeline.tracking.settings import TrackingSettings
from pipeline.tracking.task import CONTROL_HZ
from pipeline.tracking.tracker_file import tracker_arrays
from pipeline.tracking.tracker_folder import NETWORK, TrackerCard, write_tracker_folder

SETTINGS = Path(__file__).resolve().parents[2] / "data" / "tracking.yaml"


def export_tracker(
    run: Path, bundle_folder: Path, robot_folder: Path, out: Path, made: dict[str, str], pool: ClipPool
) -> TrackerCard:
    """Take the run's newest checkpoint, roll out every clip of the bundle with it and write the folder.

    Raises FileError and TrainingError for files that do not fit, as a run on another bundle.
    """
    robot, bundle = load_robot(robot_folder), read_tracking_bundle(bundle_folder)
    envelope = torque_envelope(read_actuators(robot_folder))
    values = settings.read(SETTINGS, TrackingSettings)
    newest = newest_checkpoint(run / "checkpoints")
    if newest is None:
        raise TrainingError(f"{run}: has no checkpoint. Train first: python -m pipeline.tracking --help.")
    check_trained_on(bundle, run)
    state = load_checkpoint(newest, "cpu")
    write_policy(run / NETWORK, tracker_arrays(state, bundle.robot))
    setup = Setup(settings=values, robot=robot, envelope=envelope, tracker=run / NETWORK)
    found = nominal_rollouts(clips_of(bundle.motions, robot), setup, pool)
    return write_tracker_folder(out, run, state["iteration"], bundle, figures(found), made)


def clips_of(motions: Motions, robot: Robot) -> list[RobotClip]:
    """The motions of a bundle as clips."""
    return [
        RobotClip(
            name=name,
            fps=CONTROL_HZ,
            robot=robot.name,
            joint_names=robot.joint_names,
            root_pos_w=motions.root_pos_w[start:stop],
            root_quat_w=motions.root_quat_w[start:stop],
            joint_pos=motions.joint_pos[start:stop],
        )
        for name, start, stop in zip(motions.names, motions.clip_start[:-1], motions.clip_start[1:], strict=True)
    ]


@dataclass(frozen=True, kw_only=True)
class NominalRollout:
    """One clip's nominal rollout."""

    clip: str
    survived: bool
    """From the first frame to the last."""
    body_error_m: float
    joint_error_rad: float
    path_error_m: float
    seconds: float


def nominal_rollouts(clips: Sequence[RobotClip], setup: Setup, pool: ClipPool) -> list[NominalRollout]:
    """The nominal rollout of each clip, in the clips' order."""
    work = partial(_nominal, setup=dataclasses.replace(setup, settings=setup.settings.nominal()))
    return list(pool.map(work, [(clip,) for clip in clips]))


def figures(rollouts: Sequence[NominalRollout]) -> dict[str, float]:
    """Share that survives, and errors: mean over clips, mean over all frames, and the worst clip's."""
    seconds = np.array([each.seconds for each in rollouts])
    body_cm = np.array([100.0 * each.body_error_m for each in rollouts])
    path_cm = np.array([100.0 * each.path_error_m for each in rollouts])
    joint_deg = np.degrees([each.joint_error_rad for each in rollouts])
    values = {
        "clips": float(len(rollouts)),
        "survived": np.mean([each.survived for each in rollouts]),
        "body_error_cm": body_cm.mean(),
        "body_error_cm_over_frames": np.average(body_cm, weights=seconds),
        "body_error_cm_worst_clip": body_cm.max(),
        "joint_error_deg": joint_deg.mean(),
        "joint_error_deg_over_frames": np.average(joint_deg, weights=seconds),
        "path_error_cm": path_cm.mean(),
        "path_error_cm_worst_clip": path_cm.max(),
    }
    return {name: round(float(value), 3) for name, value in values.items()}


def _nominal(clip: RobotClip, *, setup: Setup) -> NominalRollout:
    numbers = process(clip, {"variant": ""}, setup=setup).numbers
    errors = {name: float(numbers[name] or 0.0) for name in ("body_error_m", "joint_error_rad", "path_error_m")}
    return NominalRollout(clip=clip.name, survived=bool(numbers["survived"]), seconds=clip.duration_s, **errors)


def main(arguments: Sequence[str]) -> int:
    """Write the folder and print its figures; the exit status."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.tracking.export_tracker")
    for name in ("run", "bundle", "robot", "out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--command", default="")
    parser.add_argument("--commit", default="")
    given = parser.parse_args(arguments)
    made = {"command": given.command, "commit": given.commit}
    try:
        card = export_tracker(given.run, given.bundle, given.robot, given.out, made, ClipPool())
    except (PipelineError, TrainingError) as error:
        print(error, file=sys.stderr)
        return 2
    print(", ".join(f"{name} {value:g}" for name, value in card.figures.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
