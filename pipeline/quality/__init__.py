"""Metrics that several stages need, each with its definition and source."""
