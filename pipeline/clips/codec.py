"""Encode clips as an Arrow stream and decode them; equal motions give equal bytes, regardless of the clip's name.

One row per frame, one fixed-size-list column of float64 per array; rate and kind are in the schema's metadata. The name
is not included: windows of one clip share its bytes, and the caller stores the name. `faults_of` checks
that a clip's frames are finite, its quaternions unit and its shapes consistent.
"""

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pyarrow as pa

from pipeline.clips.human_clip import BODIES, HumanClip
from pipeline.clips.outcome import Clip
from pipeline.clips.robot_clip import RobotClip, SimulatedForces
from pipeline.errors import PipelineError

FORMAT = "booster-lab clip 3"

SHAPES = {"body_pos_w": (-1, len(BODIES), 3), "body_quat_w": (-1, len(BODIES), 4), "foot_wrench_w": (-1, 2, 6)}
"""Shapes of arrays; (t, n) for all others."""

FORCES = tuple(field.name for field in dataclasses.fields(SimulatedForces))


class CodecError(PipelineError):
    """Raised for bytes that are not a clip of this format."""


def encode(clip: HumanClip | RobotClip) -> bytes:
    """Bytes of a clip without its name, uncompressed, as floats hardly compress. Equal motions give equal bytes."""
    head: dict = {"format": FORMAT, "fps": clip.fps}
    arrays = _motion(clip)
    if isinstance(clip, HumanClip):
        head |= {"kind": "human", "bodies": list(BODIES)}
    else:
        head |= {"kind": "robot", "robot": clip.robot, "joint_names": list(clip.joint_names)}
        if clip.forces is not None:
            arrays |= vars(clip.forces)
    if clip.contacts is not None:
        arrays["contacts"] = clip.contacts
    columns = {name: _to_column(values) for name, values in arrays.items()}
    metadata = {"booster_lab": json.dumps(head, sort_keys=True)}
    rows = pa.record_batch(list(columns.values()), names=list(columns)).replace_schema_metadata(metadata)
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, rows.schema) as stream:
        stream.write_batch(rows)
    return sink.getvalue().to_pybytes()


def decode(data: bytes, name: str) -> HumanClip | RobotClip:
    """Inverse of `encode`, with a name and read-only arrays, which windows of one clip share.

    Raises CodecError for bytes that are not a clip.
    """
    try:
        return _decoded(data, name)
    except MemoryError:
        raise
    except (pa.ArrowException, OSError, StopIteration, KeyError, ValueError, TypeError, AttributeError) as error:
        raise CodecError(f"not a clip blob, or one of an earlier version: materialize again ({error})") from error


def _decoded(data: bytes, name: str) -> HumanClip | RobotClip:
    table = pa.ipc.open_stream(data).read_next_batch()
    table.validate()
    head = json.loads((table.schema.metadata or {})[b"booster_lab"])
    if head.get("format") != FORMAT:
        raise CodecError(
            f"clip blob has format {head.get('format')!r}, this version reads {FORMAT!r}: materialize again"
        )
    arrays = {
        name: _from_column(table.column(name)).reshape(SHAPES.get(name, (table.num_rows, -1)))
        for name in table.schema.names
    }
    contacts = arrays.pop("contacts", None)
    common: dict[str, Any] = {"name": name, "fps": head["fps"], **arrays}
    common["contacts"] = None if contacts is None else _read_only(contacts > 0.5)
    if head["kind"] == "human":
        return HumanClip(**common)
    forces = {name: common.pop(name) for name in FORCES if name in common}
    return RobotClip(
        robot=head["robot"],
        joint_names=tuple(head["joint_names"]),
        forces=SimulatedForces(**forces) if forces else None,
        **common,
    )


def _motion(clip: Clip) -> dict[str, np.ndarray]:
    """The arrays of a clip's motion, without contacts and forces."""
    if isinstance(clip, HumanClip):
        return {"body_pos_w": clip.body_pos_w, "body_quat_w": clip.body_quat_w}
    return {"root_pos_w": clip.root_pos_w, "root_quat_w": clip.root_quat_w, "joint_pos": clip.joint_pos}


def _to_column(values: np.ndarray) -> pa.FixedSizeListArray:
    flat = np.ascontiguousarray(values, dtype=np.float64).reshape(len(values), -1)
    return pa.FixedSizeListArray.from_arrays(pa.array(flat.ravel()), flat.shape[1])


def _from_column(column: pa.FixedSizeListArray) -> np.ndarray:
    return _read_only(column.values.to_numpy().astype(np.float64))


def _read_only(values: np.ndarray) -> np.ndarray:
    values.flags.writeable = False
    return values


UNIT_TOLERANCE = 1e-6
"""Largest deviation of a quaternion's norm from 1."""


def faults_of(clip: Clip) -> list[str]:
    """Every fault of a clip's frames, each a sentence with the first frame it is found at; none for a sound clip.

    A human clip must have its contacts labelled, a robot's recording may lack them.
    """
    quats = clip.body_quat_w if isinstance(clip, HumanClip) else clip.root_quat_w
    faults = []
    for name, values in _motion(clip).items():
        bad = ~_by_frame(np.isfinite(values)).all(axis=1)
        if bad.any():
            faults.append(f"frame {int(np.argmax(bad))}: {name} is not finite")
    off = _by_frame(np.abs(np.linalg.norm(quats, axis=-1) - 1.0)).max(axis=1, initial=0.0)
    if (off > UNIT_TOLERANCE).any():
        frame = int(np.argmax(off > UNIT_TOLERANCE))
        faults.append(f"frame {frame}: a quaternion's length is off by {off[frame]:.1e}")
    if clip.contacts is None and isinstance(clip, HumanClip):
        faults.append("contacts are not labelled")
    if clip.frame_count < 2 or not clip.fps > 0.0:
        faults.append(f"{clip.frame_count} frames at {clip.fps} frames/s are no motion")
    return faults


def _by_frame(values: np.ndarray) -> np.ndarray:
    """An array (t, ...) as (t, n), also of no frames."""
    return values.reshape(len(values), math.prod(values.shape[1:]))
