"""The states of a motion, each a frozen type, which are the only interface between stages.

    file -> HumanClip (reader) -> HumanClip (repaired window) -> RobotClip (retargeted, augmented)
         -> RobotClip (feasible) -> expert frames

A T1 recording enters as a RobotClip and skips the stages for humans.
"""
