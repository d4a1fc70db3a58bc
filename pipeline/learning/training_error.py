"""The error of a training run: what is wrong, where, actual and allowed value, and what to do."""


class TrainingError(Exception):
    """An error whose text is a complete message for the user."""
