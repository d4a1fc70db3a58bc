"""KP1: windows of one skill by measured motion, and the selection among them.

    clip -> planar motion -> distance of each frame from each skill -> cheapest segmentation -> windows
    all windows -> criteria of data/curation.yaml -> selected or not, and why

`process` is the stage for one clip, `choose` selects among the windows of all clips, `raised_bounds` reports the effect
of a higher limit on a skill's seconds.
"""

from pipeline.clips.outcome import LABELS, SKILLS, TRANSITION
from pipeline.selection.choose import RaisedBound, choose, idle_patterns, raised_bounds
from pipeline.selection.curation import Curation, Decision, without_excluded
from pipeline.selection.windows import find_windows, process
