"""KP1: windows of one skill by measured motion, and the selection among them.

    clip -> planar motion -> distance of each frame from each skill -> cheapest segmentation -> windows
    all windows -> what data/curation.yaml asks for -> taken or not, and why

`process` is the stage for one clip, `choose` looks at the windows of all clips together, `raised_bounds` tells what
more seconds of a skill bring.
"""

from pipeline.clips.outcome import LABELS, SKILLS, TRANSITION
from pipeline.selection.choose import RaisedBound, choose, idle_patterns, raised_bounds
from pipeline.selection.curation import Curation, Decision, without_excluded
from pipeline.selection.windows import find_windows, process
