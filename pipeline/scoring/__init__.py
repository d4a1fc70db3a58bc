"""Score a robot's motion against the human's, independent of how it was made.

    RobotClip + HumanClip -> aligned in time -> samples per figure -> figures, pooled over clips

Independent of KP3's planner; stance labels come from the human's toes.
"""

from pipeline.scoring.align import aligned
from pipeline.scoring.figures import FIGURES, Figure, Score, pooled, worst_of_bars
from pipeline.scoring.score import score, score_without_collisions
