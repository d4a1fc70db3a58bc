"""In Webots' place where Webots is missing: loads a world of ours, steps it in another engine, runs its controller.

Controller and project are those that Webots would run, to the byte. What comes of it is said of MuJoCo or of ODE, never
of Webots.
"""
