"""Stand-in for Webots: load a project's world, step it in another engine, and run its unchanged controller.

Results are labelled with MuJoCo or ODE, never with Webots.
"""
