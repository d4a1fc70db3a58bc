"""Bounded changes of curation, randomization and motor limits, proposed from failures and approved by a person."""
