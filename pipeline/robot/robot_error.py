"""The error of a robot folder: every fault found, each with its file, line and what to do."""

from pipeline.errors import FileError, PipelineError


class RobotError(PipelineError):
    """An unusable robot folder; the text has one line per fault."""

    def __init__(self, faults: list[FileError]):
        self.faults = tuple(faults)
        super().__init__("\n".join(str(fault) for fault in faults))


def refuse(faults: list[FileError]) -> None:
    """Raise RobotError if there is any fault."""
    if faults:
        raise RobotError(faults)
