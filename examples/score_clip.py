"""Score how well the T1 reproduces a human motion: python examples/score_clip.py FILE.

The score is independent of the retargeting: it takes any robot motion and the human motion that it should show.
"""

import sys
from pathlib import Path

from pipeline.cli.chain import Chain
from pipeline.cli.retarget_command import retarget_file
from pipeline.cli.score_command import piece_of
from pipeline.clips.robot_clip import RobotClip
from pipeline.project import Project
from pipeline.readers import Statement
from pipeline.robot import load_robot
from pipeline.scoring import FIGURES, score

path, project, robot = Path(sys.argv[1]), Project(Path.cwd()), load_robot("t1")
clip = retarget_file(project, path, Statement(), robot).pieces[0].clip
assert isinstance(clip, RobotClip)
human = piece_of(Chain(project), path, Statement(), clip)
figures = score(human, clip, robot).figures()
for figure in FIGURES:
    print(f"{figure.title:45} {figures[figure.key]:10.4g} {figure.unit}")
