"""Real-to-sim: torque-speed measurements of the motors, their knees and armatures, and the adapted robot."""
