"""Check a robot folder for missing data and contradictions, and compare it with another model file of the robot."""
