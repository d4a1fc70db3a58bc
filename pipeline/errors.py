"""The error tree. Classes take facts and write the text: what, where, got, allowed, what to do."""

from pathlib import Path
from typing import Any


class PipelineError(Exception):
    """Base of every error that a user may see. Its text is one complete message.

    It survives pickling with text and facts, whatever arguments its class takes: errors of worker processes reach the
    user as they were raised.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self.args, vars(self))


MOST_LETTERS = 8_000
"""Of a message; files may hold names and cells of any length, which messages quote."""


def shortened(text: str) -> str:
    """`text` without its middle where it is longer than `MOST_LETTERS`."""
    return text if len(text) <= MOST_LETTERS else f"{text[: MOST_LETTERS - 1_000]} … {text[-997:]}"


def _restored(kind: type[PipelineError], arguments: tuple[Any, ...], facts: dict[str, Any]) -> PipelineError:
    """An error as it was when it was pickled. `arguments` are those of `Exception`, not of the class."""
    error = kind.__new__(kind, *arguments)
    vars(error).update(facts)
    return error


class FileError(PipelineError):
    """A file could not be used.

    Args:
        path: the file
        problem: what is wrong with it, as a sentence without the file's name
        do: what the user can do about it
        line: the line the problem was found at, counted from 1
    """

    def __init__(self, path: Path | str, problem: str, do: str = "", line: int | None = None):
        problem = shortened(problem)
        self.path, self.problem, self.do, self.line = str(path), problem, do, line
        where = f"{path}, line {line}" if line is not None else f"{path}"
        super().__init__(f"{where}: {problem}" + (f" {do}" if do else ""))


class AmbiguousFileError(FileError):
    """A file whose unit, axis or rate can be read in more than one way. `do` says how to state it."""


class SettingsError(FileError):
    """A settings file (YAML or TOML) that does not say what it must."""


class ClipError(PipelineError):
    """A clip that cannot go on. Becomes a rejected clip, never a failed run.

    Args:
        clip: name of the clip
        code: short reason code, for counting
        problem: the sentence
        frame: frame index the problem starts at
    """

    def __init__(self, clip: str, code: str, problem: str, frame: int | None = None):
        self.clip, self.code, self.problem, self.frame = clip, code, problem, frame
        where = f"clip '{clip}'" + (f" frame {frame}" if frame is not None else "")
        super().__init__(f"{where}: {problem}")


class UnknownNameError(PipelineError):
    """A name that is not in a list; lists what there is."""

    def __init__(self, kind: str, name: str, known: list[str] | tuple[str, ...]):
        there = f"there are: {', '.join(sorted(known))}" if known else "there are none"
        super().__init__(f"unknown {kind} '{name}'; {there}")
