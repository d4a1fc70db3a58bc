"""A simulated robot that writes logs like a real one."""
