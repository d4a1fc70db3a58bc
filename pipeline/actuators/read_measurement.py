"""Read a measurement file: stated facts are used, missing ones are requested, contradictions are errors.

    # side: joint                                  joint or motor; with `motor` also `# gear_efficiency: 0.9`
    # source: ...                                  any other remark; `# synthetic: ...` for data that was never measured
    motor,direction,speed [rad/s],torque [N m],voltage [V],temperature [degC]
    knee,positive,0.32,60.4,48,31

Commas, semicolons or tabs separate; numbers may have a decimal comma. Rows may come in any order. Speed and torque may
be signed: a row with equal signs is driving, one with opposite signs braking; braking rows are left out.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline.actuators.motor_table import Motor
from pipeline.actuators.settings import ReadingSettings
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.files.csv_json import csv_records

SPEED_UNITS = {
    "rad/s": 1.0,
    "deg/s": math.pi / 180.0,
    "°/s": math.pi / 180.0,
    "rpm": math.pi / 30.0,
    "1/min": math.pi / 30.0,
    "r/min": math.pi / 30.0,
}
TORQUE_UNITS = {"n m": 1.0, "nm": 1.0, "n·m": 1.0, "n*m": 1.0, "mn m": 1e-3, "mnm": 1e-3}
UNITS = {
    "motor": None,
    "direction": None,
    "speed": SPEED_UNITS,
    "torque": TORQUE_UNITS,
    "voltage": {"v": 1.0},
    "temperature": {"degc": 1.0, "°c": 1.0, "c": 1.0},
}
"""Units of each column and their factors to SI (temperature stays in degrees Celsius); None for text."""

_HEADER = re.compile(r"\s*([A-Za-z_ ]+?)\s*(?:[\[(]\s*(.+?)\s*[\])])?\s*")


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """n points of one motor's driving torque over speed, at the joint, sorted by speed."""

    speed: Float[np.ndarray, " n"]
    """[rad/s], 0 or more, at the joint."""
    torque: Float[np.ndarray, " n"]
    """Largest torque in the direction of motion [N m], at the joint."""
    forward: Bool[np.ndarray, " n"]
    """Whether the joint turned in its positive direction."""
    about: dict[str, str]
    """Statements of the file's comment lines, by name."""
    notes: tuple[str, ...]
    """Changes made to the file's numbers."""

    @property
    def synthetic(self) -> bool:
        """Whether the file states that it was never measured."""
        return "synthetic" in self.about

    def direction(self, forward: bool) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
        """Speeds and torques of one direction."""
        chosen = self.forward == forward
        return self.speed[chosen], self.torque[chosen]


def read_header(cells: list[str], file: str, line: int) -> dict[str, tuple[int, float]]:
    """Index and factor to SI of each column, by name. Raises FileError for a missing column or a wrong unit."""
    columns: dict[str, tuple[int, float]] = {}
    for index, cell in enumerate(cells):
        match = _HEADER.fullmatch(cell)
        name = match.group(1).lower() if match else cell
        if name not in UNITS:
            do = f"There are: {', '.join(UNITS)}, with the unit in brackets."
            raise FileError(file, f"unknown column '{cell}'.", do, line)
        if name in columns:
            raise FileError(file, f"the column '{name}' stands there twice.", "Remove one.", line)
        columns[name] = (index, _factor(name, match.group(2) if match else None, file, line))
    missing = [name for name in UNITS if name not in columns]
    if missing:
        raise FileError(file, f"the columns {', '.join(missing)} are missing.", "See docs/actuators.md.", line)
    return columns


def _factor(name: str, unit: str | None, file: str, line: int) -> float:
    units = UNITS[name]
    if units is None:
        return 1.0
    if unit is None:
        do = f"Write it in brackets: {name} [{next(iter(units))}]. Known: {', '.join(units)}."
        raise FileError(file, f"the column '{name}' has no unit.", do, line)
    if unit.lower() not in units:
        raise FileError(file, f"the column '{name}' has the unit '{unit}'.", f"Known: {', '.join(units)}.", line)
    return units[unit.lower()]


DIRECTIONS = {"positive": True, "+": True, "negative": False, "-": False}
NEAR_LARGEST = 0.9
"""Share of the largest value above which a value counts as near it."""


@dataclass(frozen=True, kw_only=True)
class _Rows:
    """The table as in the file."""

    forward: np.ndarray
    speed: np.ndarray
    torque: np.ndarray
    voltage: np.ndarray
    temperature: np.ndarray


def read_measurement(text: str, file: str, motor: Motor, settings: ReadingSettings) -> Measurement:
    """Read the sweep of a motor. Raises FileError, for ambiguous data AmbiguousFileError.

    Args:
        text: content of the file
        file: name of the file, for messages
        motor: motor of the table
        settings: limits on the file
    """
    about, table = _split(text, file)
    rows = _read_table(table, file, motor.name, about.get("decimal"))
    speed_factor, torque_factor = _to_joint(about, file, motor)
    _check(rows, file, settings)
    speed, torque, notes = _driving(rows, file, settings)
    kept = np.isfinite(speed)
    speed, torque, forward = speed[kept] * speed_factor, torque[kept] * torque_factor, rows.forward[kept]
    _refuse_implausible(speed, torque, file, settings)
    order = np.lexsort((torque, speed, ~forward))
    order = order[np.argsort(speed[order], kind="stable")]
    return Measurement(speed=speed[order], torque=torque[order], forward=forward[order], about=about, notes=notes)


def _split(text: str, file: str) -> tuple[dict[str, str], list[tuple[int, str]]]:
    """Statements of comment lines, and the other lines with their numbers. Raises FileError for one that is no text."""
    about: dict[str, str] = {}
    table = []
    for line, content in enumerate(text.removeprefix("\ufeff").splitlines(), start=1):
        if content.lstrip().startswith("#"):
            name, colon, value = content.lstrip("# \t").partition(":")
            if colon:
                about[name.strip().lower()] = value.strip()
        elif content.strip():
            if "\ufffd" in content or "\0" in content:
                do = "Save it as UTF-8 (in a spreadsheet: 'CSV UTF-8'); unpack it if it is packed."
                raise FileError(file, "the line is no UTF-8 text.", do, line)
            table.append((line, content))
    return about, table


def _read_table(table: list[tuple[int, str]], file: str, motor: str, decimal: str | None) -> _Rows:
    if len(table) < 2:
        raise FileError(file, "it has no rows.", "See docs/actuators.md for what a measurement file holds.")
    first, header = table[0]
    separator = next((each for each in (";", "\t") if each in header), ",")
    columns = read_header(_cells(header, separator, file, first), file, first)
    records = [(line, _cells(content, separator, file, line)) for line, content in table[1:]]
    for line, cells in records:
        if len(cells) != len(columns):
            problem = f"the row has {len(cells)} values, the header {len(columns)}."
            do = "Decimal commas need another separator: use semicolons." if separator == "," else "Write one a column."
            raise FileError(file, problem, do, line)
        if cells[columns["motor"][0]] != motor:
            problem = f"the row is of motor '{cells[columns['motor'][0]]}'."
            raise FileError(file, problem, f"A file holds the sweeps of the motor it is named by: '{motor}'.", line)
    numeric = ("speed", "torque", "voltage", "temperature")
    sign = decimal_sign([cells[columns[name][0]] for _, cells in records for name in numeric], decimal, file)
    values = {}
    for name in numeric:
        index, factor = columns[name]
        values[name] = factor * np.array([number(cells[index], sign, name, file, line) for line, cells in records])
    forward = [_direction(cells[columns["direction"][0]], file, line) for line, cells in records]
    return _Rows(forward=np.array(forward), **values)


def _cells(content: str, separator: str, file: str, line: int) -> list[str]:
    return [cell.strip() for cell in next(csv_records([content], file, separator, line))]


def _direction(text: str, file: str, line: int) -> bool:
    if text.lower() not in DIRECTIONS:
        raise FileError(file, f"the direction is '{text}'.", f"Write one of: {', '.join(DIRECTIONS)}.", line)
    return DIRECTIONS[text.lower()]


def _to_joint(about: dict[str, str], file: str, motor: Motor) -> tuple[float, float]:
    """Factors of speed and torque from the side that was measured to the joint."""
    side = about.get("side")
    if side == "joint":
        return 1.0, 1.0
    if side != "motor":
        problem = "it does not say on which side of the gear was measured."
        raise AmbiguousFileError(file, problem, "Write a line '# side: joint' or '# side: motor'.")
    if motor.gear_ratio is None:
        problem = f"torque at the motor needs the gear to be one at the joint, and motor '{motor.name}' has none."
        raise FileError(file, problem, "Write gear_ratio and rotor_inertia into motors.csv.")
    text = about.get("gear_efficiency", "")
    efficiency = number(text, ".", "gear_efficiency", file, 1) if text else 0.0
    if not 0.0 < efficiency <= 1.0:
        do = "Write a line '# gear_efficiency: ...' with a number above 0, at most 1."
        raise AmbiguousFileError(file, "torque at the motor needs the gear's efficiency to be one at the joint.", do)
    return 1.0 / motor.gear_ratio, motor.gear_ratio * efficiency


def _check(rows: _Rows, file: str, settings: ReadingSettings) -> None:
    """Refuse swapped columns (torques cluster on the plateau, speeds do not), and points of several curves."""
    near = [float(np.mean(np.abs(each) > NEAR_LARGEST * np.abs(each).max())) for each in (rows.speed, rows.torque)]
    if near[0] > settings.clustered and near[0] > near[1]:
        problem = f"{100 * near[0]:.0f} % of the speeds are near the largest and {100 * near[1]:.0f} % of the torques."
        raise AmbiguousFileError(file, problem, "Speed and torque seem to be swapped: correct the header.")
    voltage, temperature = rows.voltage, rows.temperature
    if np.ptp(voltage) > settings.voltage_spread * abs(float(voltage.mean())):
        problem = f"the supply voltage goes from {voltage.min():g} to {voltage.max():g} V: these are several curves."
        raise FileError(file, problem, "Write one file for the curve at the robot's voltage.")
    if np.ptp(temperature) > settings.temperature_spread:
        problem = f"the temperature goes from {temperature.min():g} to {temperature.max():g} degC; torque derates."
        raise FileError(file, problem, "Repeat the sweep with pauses.")


def _driving(rows: _Rows, file: str, settings: ReadingSettings) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Magnitudes of speed and torque, NaN for braking rows, and notes on what was done."""
    speed, torque = rows.speed, rows.torque
    largest = float(np.abs(torque).max())
    for forward in (True, False):
        signed = np.sign(speed[rows.forward == forward])
        if {1.0, -1.0} <= set(signed.tolist()):
            name = "positive" if forward else "negative"
            raise FileError(file, f"rows of the {name} direction have speeds of both signs.", "Correct the direction.")
    # points at rest have the sign of the others of their direction
    usual = {way: float(np.sign(speed[rows.forward == way].sum())) or 1.0 for way in (True, False)}
    turning = np.where(speed != 0.0, np.sign(speed), np.where(rows.forward, usual[True], usual[False]))
    if np.any((turning < 0.0) & rows.forward):
        raise FileError(file, "rows of the positive direction have negative speeds.", "Correct the direction.")
    along = np.where(speed == 0.0, np.abs(torque), torque * turning)
    braking = along < -settings.braking_torque * largest
    if braking.mean() > 0.5:
        problem = f"{int(braking.sum())} of {len(braking)} rows have a torque against the motion."
        raise FileError(file, problem, "A sweep of a driving motor has speed and torque of the same sign.")
    notes = (f"{int(braking.sum())} braking points left out",) if braking.any() else ()
    return np.where(braking, np.nan, np.abs(speed)), along, notes


def _refuse_implausible(speed: np.ndarray, torque: np.ndarray, file: str, settings: ReadingSettings) -> None:
    fastest, strongest = float(speed.max(initial=0.0)), float(np.abs(torque).max(initial=0.0))
    if fastest > settings.max_speed:
        problem = f"the joint would turn at {fastest:.0f} rad/s; at most {settings.max_speed:g} are possible."
        raise AmbiguousFileError(file, problem, "Is it rpm, deg/s or the motor's side? Correct the unit or the side.")
    if strongest > settings.max_torque:
        problem = f"the joint would give {strongest:.0f} N m; at most {settings.max_torque:g} are possible."
        raise AmbiguousFileError(file, problem, "Correct the unit or the side.")


DECIMALS = {"point": ".", "comma": ","}
"""Allowed values of `decimal`."""

_POINT = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?(\d+(,\d*)?|,\d+)([eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[,.]\d{3}")


def decimal_sign(texts: Sequence[str], stated: str | None, file: str) -> str:
    """`.` or `,`: the decimal sign of all these numbers. Raises FileError if ambiguous.

    "1,234" may be 1234 or 1.234: if all numbers with a comma are ambiguous, the file must state the decimal sign.
    """
    if stated is not None:
        if stated not in DECIMALS:
            raise FileError(file, f"it states the decimal sign '{stated}'.", "Write '# decimal: point' or ': comma'.")
        return DECIMALS[stated]
    with_comma = [text for text in texts if "," in text]
    with_point = [text for text in texts if "." in text]
    if with_comma and with_point:
        problem = f"it has numbers with a comma ('{with_comma[0]}') and with a point ('{with_point[0]}')."
        raise AmbiguousFileError(file, problem, "Write all with the same decimal sign and no thousands separator.")
    if with_comma and all(_THOUSANDS.fullmatch(text) for text in with_comma):
        problem = f"the comma in '{with_comma[0]}' may separate thousands or decimals."
        raise AmbiguousFileError(file, problem, "Write a line '# decimal: comma', or use decimal points.")
    return "," if with_comma else "."


def number(text: str, sign: str, what: str, file: str, line: int) -> float:
    """The finite number in `text`. Raises FileError with the line."""
    pattern = _COMMA if sign == "," else _POINT
    if pattern.fullmatch(text):
        value = float(text.replace(",", "."))
        if math.isfinite(value):
            return value
    raise FileError(file, f"{what} is '{text}'.", "Write a finite number or remove the row.", line)
