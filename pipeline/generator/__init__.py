"""Generate human motions from published gait figures: first a footstep plan, then the body.

    Recipe -> Commands (speed over time, path) -> Stride (phase, stances) -> Feet -> Pelvis -> legs, trunk, arms
           -> Generated (truth as a HumanClip, the same motion as BVH)

`python -m pipeline.generator data/motions` writes the files that ship with the project; docs/motions.md
describes them.
"""

from pipeline.generator.generate import Generated, generate
from pipeline.generator.recipes import RECIPES
