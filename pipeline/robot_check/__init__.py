"""What a robot folder lacks or contradicts, and how it differs from another model file of the robot."""
