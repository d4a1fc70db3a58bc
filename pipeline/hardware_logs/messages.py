"""Message definitions of a Booster robot: fields, ros2msg text, and CDR layout as numpy types.

The fields are those of the published interface (booster_interface). Messages have no timestamp; the time is the
recorder's receipt time.
"""

import functools
from dataclasses import dataclass

import numpy as np

ENCAPSULATION = b"\x00\x01\x00\x00"
"""First bytes of a payload: CDR, little-endian."""

PACKAGE = "booster_interface"


@dataclass(frozen=True)
class Field:
    """A field: a primitive or message, single, as array of `length`, or (`None`) as variable-length sequence."""

    kind: str
    name: str
    length: int | None = 1


PRIMITIVES = {"int8": "i1", "uint8": "u1", "bool": "u1", "int32": "<i4", "uint32": "<u4", "float32": "<f4"}
"""numpy's code of each primitive. A bool is read as a byte, so that values other than 0 and 1 are
detected."""

BUTTONS = ("a", "b", "x", "y", "lb", "rb", "lt", "rt", "ls", "rs", "back", "start")
HATS = ("hat_c", "hat_u", "hat_d", "hat_l", "hat_r", "hat_lu", "hat_ld", "hat_ru", "hat_rd")

MESSAGES: dict[str, tuple[Field, ...]] = {
    "LowState": (
        Field("ImuState", "imu_state"),
        Field("MotorState", "motor_state_parallel", None),
        Field("MotorState", "motor_state_serial", None),
    ),
    "ImuState": (Field("float32", "rpy", 3), Field("float32", "gyro", 3), Field("float32", "acc", 3)),
    "MotorState": (
        Field("int8", "mode"),
        *(Field("float32", name) for name in ("q", "dq", "ddq", "tau_est")),
        Field("int8", "temperature"),
        Field("uint32", "lost"),
        Field("uint32", "reserve", 2),
    ),
    "LowCmd": (Field("int8", "cmd_type"), Field("MotorCmd", "motor_cmd", None)),
    "MotorCmd": (
        Field("int8", "mode"),
        *(Field("float32", name) for name in ("q", "dq", "tau", "kp", "kd", "weight")),
    ),
    "FallDownState": (Field("uint32", "fall_down_state"), Field("bool", "is_recovery_available")),
    "Odometer": tuple(Field("float32", name) for name in ("x", "y", "theta")),
    "RemoteControllerState": (
        Field("int32", "event"),
        *(Field("float32", name) for name in ("lx", "ly", "rx", "ry")),
        *(Field("bool", name) for name in (*BUTTONS, *HATS)),
        Field("uint8", "hat_pos"),
    ),
}

TOPICS = {
    "/low_state": "LowState",
    "/joint_ctrl": "LowCmd",
    "/fall_down": "FallDownState",
    "/odometer_state": "Odometer",
    "/remote_controller_state": "RemoteControllerState",
}
"""Topic -> message type, for the topics that are read; others are ignored."""


def schema_name(message: str) -> str:
    """Full name of a message, as in a schema."""
    return f"{PACKAGE}/msg/{message}"


def schema_text(message: str) -> str:
    """The ros2msg definition of a message and of all nested messages."""
    blocks = [_block(message)]
    blocks += [f"{'=' * 80}\nMSG: {PACKAGE}/{name}\n{_block(name)}" for name in _held(message)]
    return "".join(blocks)


def _block(message: str) -> str:
    lines = []
    for field in MESSAGES[message]:
        kind = field.kind if field.kind in PRIMITIVES else f"{PACKAGE}/{field.kind}"
        count = {1: "", None: "[]"}.get(field.length, f"[{field.length}]")
        lines.append(f"{kind}{count} {field.name}\n")
    return "".join(lines)


def _held(message: str) -> list[str]:
    """Nested messages of a message, each once, in the order of first use."""
    found: list[str] = []
    for field in MESSAGES[message]:
        if field.kind in MESSAGES:
            found += [name for name in (field.kind, *_held(field.kind)) if name not in found]
    return list(dict.fromkeys(found))


def is_known_text(message: str, text: str) -> bool:
    """Whether a schema's text agrees with our definition, ignoring comments, blanks and constants."""
    return _lines(text) == _lines(schema_text(message))


def _lines(text: str) -> list[str]:
    lines = []
    for line in text.splitlines():
        words = line.partition("#")[0].replace(f"{PACKAGE}/msg/", f"{PACKAGE}/").split()
        if words and not (words[0].startswith("====") or "=" in "".join(words)):
            lines.append(" ".join([words[0].replace(f"{PACKAGE}/", ""), *words[1:]]).replace(f"{PACKAGE}/", ""))
    return lines


@functools.lru_cache(maxsize=64)
def payload_dtype(message: str, *counts: int) -> np.dtype:
    """Numpy type of a payload with encapsulation header; `counts` are the lengths of its sequences, each also a field
    `<name>_count`.

    Alignment as in CDR, relative to the end of the encapsulation header.
    """
    return _structure(message, list(counts), {"encapsulation": (np.dtype("V4"), 0)})


@functools.cache
def _element(kind: str) -> np.dtype:
    """A primitive, or a message of fixed size that starts at its alignment."""
    return np.dtype(PRIMITIVES[kind]) if kind in PRIMITIVES else _structure(kind, [], {})


def _structure(message: str, counts: list[int], placed: dict[str, tuple[np.dtype, int]]) -> np.dtype:
    """Fields of a message after those already `placed`: name -> type and offset."""
    end = sum(kind.itemsize for kind, _ in placed.values())
    for field in MESSAGES[message]:
        length = field.length
        if length is None:
            end, length = _aligned(end, 4), counts.pop(0)
            placed[f"{field.name}_count"] = np.dtype("<u4"), end
            end += 4
        end = _aligned(end, _alignment(field.kind)) if length else end
        inner = _element(field.kind)
        placed[field.name] = inner if field.length == 1 else np.dtype((inner, (length,))), end
        end += inner.itemsize * length
    formats, offsets = zip(*placed.values(), strict=True)
    return np.dtype({"names": list(placed), "formats": formats, "offsets": offsets, "itemsize": end})


def _alignment(kind: str) -> int:
    if kind in PRIMITIVES:
        return np.dtype(PRIMITIVES[kind]).itemsize
    return max(_alignment(field.kind) for field in MESSAGES[kind])


def _aligned(offset: int, alignment: int) -> int:
    return -(-offset // alignment) * alignment
