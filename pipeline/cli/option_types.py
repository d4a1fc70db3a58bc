"""Types of command line options: how an argument is parsed, and its name in the help."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, UseAppendAction, arg
from tyro.constructors import PrimitiveConstructorSpec


def option(metavar: str, read: Callable[[str], Any], choices: tuple[str, ...] | None = None) -> Any:
    """An argument parsed by `read`, which raises ValueError for wrong usage; a missing option is None."""
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=metavar,
        instance_from_str=lambda words: read(words[0]),
        is_instance=lambda _: True,
        str_from_instance=lambda value: ["none" if value is None else f"{value}"],
        choices=choices,
    )


def file(text: str) -> Path:
    if Path(text).is_dir():
        raise ValueError(f"{text} is a folder, expected a file")
    return Path(text)


def rate(text: str) -> float:
    value = float(text)
    if not 0.0 < value <= 1000.0:
        raise ValueError(f"{text} is not a rate in Hz, expected more than 0 and at most 1000")
    return value


def integer(what: str, low: int, high: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise ValueError(f"{text} is not {what}, expected {low} to {high}")
        return int(text)

    return read


def positive(text: str) -> float:
    value = float(text)
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{text} is not a number above 0")
    return value


def within(low: float, high: float) -> Callable[[str], float]:
    """Numbers from `low` to `high`, both allowed."""

    def read(text: str) -> float:
        value = float(text)
        if not (math.isfinite(value) and low <= value <= high):
            limits = f"{low:g} or more" if high == math.inf else f"{low:g} to {high:g}"
            raise ValueError(f"{text} is out of range, expected {limits}")
        return value

    return read


def span(text: str) -> tuple[float, ...]:
    """Start and end of a time span [s]."""
    start_s, stop_s = numbers(2)(text)
    if not 0.0 <= start_s < stop_s:
        raise ValueError(f"'{text}' is not T,UNTIL with 0 <= T < UNTIL [s]")
    return start_s, stop_s


def numbers(count: int) -> Callable[[str], tuple[float, ...]]:
    def read(text: str) -> tuple[float, ...]:
        values = tuple(float(part) for part in text.split(","))
        if len(values) != count or not all(map(math.isfinite, values)):
            raise ValueError(f"'{text}' is not {count} numbers separated by commas")
        return values

    return read


def of_joint(text: str) -> tuple[str, float]:
    joint, sign, number = text.partition("=")
    value = float(number) if sign else math.nan
    if not value > 0.0:
        raise ValueError(f"'{text}' is not JOINT=NUMBER with a number above 0")
    return joint, value


def outage(text: str) -> tuple[float, float, tuple[str, ...]]:
    start, _, rest = text.partition(",")
    until, *joints = rest.split(",")
    try:
        start_s, stop_s = float(start), math.inf if until == "end" else float(until)
    except ValueError:
        start_s = stop_s = math.nan
    if not 0.0 <= start_s < stop_s:
        raise ValueError(
            f"'{text}' is not T,UNTIL with 0 <= T < UNTIL [s] (or the word `end`), and joints after another comma"
        )
    return start_s, stop_s, tuple(joints)


Text = Annotated[str | None, option("TEXT", str)]
File = Annotated[Path | None, option("FILE", file)]
Folder = Annotated[Path | None, option("FOLDER", Path)]
Number = Annotated[float | None, option("NUMBER", float)]
Hertz = Annotated[float, option("HZ", rate)]
JointFactors = UseAppendAction[tuple[Annotated[tuple[str, float], option("JOINT=FACTOR", of_joint)], ...]]
Outages = UseAppendAction[
    tuple[Annotated[tuple[float, float, tuple[str, ...]], option("T,UNTIL[,JOINT...]", outage)], ...]
]
RobotName = Annotated[str, arg(metavar="NAME", help="robot, a folder of robots/")]
PolicyFile = Annotated[Positional[Path], arg(metavar="POLICY", help="npz file, or folder of an exported policy")]
AnkleKd = Annotated[
    Number,
    arg(help="ankle damping of the deployed policy [N m s/rad], if its file does not contain it"),
]
Naming = Annotated[
    Text, arg(help="joint names in the output: a column of the robot's aliases.csv; default: the robot's names")
]
Workers = Annotated[
    int, option("N", integer("a number of processes", 0, 1000)), arg(help="number of processes; 0: one per core")
]
