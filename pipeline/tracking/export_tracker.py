"""Write a tracker's folder from a training run: `python -m pipeline.tracking.export_tracker`.

    --run DIR      a run of `python -m pipeline.tracking`
    --bundle DIR   the bundle it was trained on
    --robot DIR    the adapted robot, `data/adapted_robot/<robot>`
    --out DIR      the folder, as `robots/t1/policies/tracker`
    --command TEXT, --commit TEXT   how the run was made, for the card

Every clip of the bundle is rolled out once without disturbance; the figures go into the card.
"""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from pipeline.actuators.adapted_robot import read_actuators, torque_envelope
from pipeline.batch.pool import ClipPool
from pipeline.errors import PipelineError
from pipeline.files import settings
from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint
from pipeline.learning.policy_file import write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.robot import load_robot
from pipeline.tracking.bundle import check_trained_on, read_tracking_bundle
from pipeline.tracking.nominal_rollout import clips_of, figures, nominal_rollout
from pipeline.tracking.process import Setup
from pipeline.tracking.settings import TrackingSettings
from pipeline.tracking.tracker_file import tracker_arrays
from pipeline.tracking.tracker_folder import NETWORK, TrackerCard, write_tracker_folder

SETTINGS = Path(__file__).resolve().parents[2] / "data" / "tracking.yaml"


def export_tracker(
    run: Path, bundle_folder: Path, robot_folder: Path, out: Path, made: dict[str, str], pool: ClipPool
) -> TrackerCard:
    """Roll out every clip of the bundle with the run's newest checkpoint and write the folder.

    Raises FileError and TrainingError for files that do not match, such as a run on another bundle.
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
    calls = [(clip,) for clip in clips_of(bundle.motions, robot)]
    found = list(pool.map(partial(nominal_rollout, setup=setup), calls))
    return write_tracker_folder(out, run, state["iteration"], bundle, figures(found), made)


def main(arguments: Sequence[str]) -> int:
    """Write the folder and print its figures; the exit status."""
    prog, form = "python -m pipeline.tracking.export_tracker", argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog=prog, description=__doc__, formatter_class=form)
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
