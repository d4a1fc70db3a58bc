"""Create a robot folder from the manufacturer's URDF or MJCF."""
