"""A robot folder from its maker's URDF or MJCF."""
