"""Retarget a human motion onto the T1: python examples/retarget_clip.py FILE OUT.csv."""

import sys
from pathlib import Path

from pipeline.catalog import CatalogSettings, catalogue
from pipeline.cli.retarget_command import encode_csv
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.files import settings
from pipeline.readers import read_motion
from pipeline.repair import RepairSettings
from pipeline.repair import process as repair
from pipeline.retarget import RetargetSettings
from pipeline.retarget import process as retarget
from pipeline.robot import load_robot

path, out = Path(sys.argv[1]), Path(sys.argv[2])
robot = load_robot("t1")

# Each stage takes a clip and the numbers of earlier stages, and returns an Outcome: pieces that are kept, and reasons.
read = catalogue(read_motion(path, path.stem), settings=settings.read(Path("data/catalog.yaml"), CatalogSettings))
if not read.pieces:
    sys.exit("\n".join(reason.text for reason in read.reasons))
whole = read.pieces[0]
window = {**whole.numbers, "skill": "walk", "start_frame": 0, "stop_frame": whole.clip.frame_count}
repaired = repair(whole.clip, window, settings=settings.read(Path("data/repair.yaml"), RepairSettings))
for piece in repaired.pieces[:1]:
    assert isinstance(piece.clip, HumanClip), "a robot's own motion needs no retargeting"
    numbers = {**window, **piece.numbers}
    limits = settings.read(Path("data/retarget.yaml"), RetargetSettings)
    outcome = retarget(piece.clip, numbers, settings=limits, robot=robot)
    for reason in outcome.reasons:
        print(f"{reason.effect}: {reason.text}")
    for result in outcome.pieces:
        assert isinstance(result.clip, RobotClip)
        out.write_text(encode_csv(result.clip.resampled(30.0), {"source": path.name}))
        slip, error = result.numbers["slip_m_s"], result.numbers["limb_error_deg"]
        print(f"{out}: {result.clip.duration_s:.2f} s, foot slip {slip:.3f} m/s, limb error {error:.1f} deg")
