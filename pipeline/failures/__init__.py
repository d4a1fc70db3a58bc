"""Failures in a robot log: kind, time, command, evidence, confidence."""
