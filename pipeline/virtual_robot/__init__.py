"""A simulated robot that writes the logs a real one would."""
