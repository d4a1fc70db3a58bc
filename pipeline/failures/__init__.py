"""What went wrong in a log: kind, time, command, evidence, confidence."""
