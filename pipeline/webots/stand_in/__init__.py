"""Stand-in for Webots: a project's world in another engine, whose name labels the results; the same controller."""
