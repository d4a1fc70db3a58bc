"""The error of a training run that cannot start: what, where, got, allowed, do."""


class TrainingError(Exception):
    """Its text is one complete message for the user."""
