"""The states that motion goes through, each a frozen type; stages meet here and nowhere else.

    file -> HumanClip (reader) -> HumanClip (repaired window) -> RobotClip (retargeted, augmented)
         -> RobotClip (feasible) -> expert frames

A T1 recording enters as a RobotClip and skips what is for humans.
"""
