"""KP3: retarget a human motion onto the robot.

    HumanClip -> (resampled by time) -> stances -> foot plan -> targets -> two passes of IK -> RobotClip

`process` is the stage. Everything before the solver works on whole clips with numpy; the solver (placo)
works frame by frame.
"""

from pipeline.retarget.process import process
from pipeline.retarget.settings import RetargetSettings
