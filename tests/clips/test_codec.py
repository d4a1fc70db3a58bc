"""Clips as Parquet: back as they were, equal clips equal bytes, anything else refused."""

import dataclasses
import json

import numpy as np
import pyarrow as pa
import pytest

from pipeline.clips import codec
from tests.factories.clips import human_clip, robot_clip


@pytest.mark.parametrize("clip", [human_clip(), robot_clip(), human_clip(frames=1)])
def test_a_clip_comes_back_as_it_was(clip):
    found = codec.decode(codec.encode(clip), clip.name)
    for field in dataclasses.fields(clip):
        mine, yours = getattr(clip, field.name), getattr(found, field.name)
        if isinstance(mine, np.ndarray):
            assert mine.dtype == yours.dtype
            np.testing.assert_array_equal(mine, yours)
        else:
            assert mine == yours


def test_missing_samples_survive():
    clip = human_clip()
    clip.body_pos_w[2, 3] = np.nan
    assert np.isnan(codec.decode(codec.encode(clip), "x").body_pos_w[2, 3]).all()


def test_equal_motions_give_equal_bytes_and_a_changed_number_other_ones():
    assert codec.encode(human_clip(name="a")) == codec.encode(human_clip(name="b"))
    other = human_clip()
    other.body_pos_w[0, 0, 0] += 1e-12
    assert codec.encode(other) != codec.encode(human_clip())


@pytest.mark.parametrize("data", [b"", b"PAR1 nonsense", codec.encode(robot_clip())[:-20]])
def test_bytes_that_are_no_clip_are_refused(data):
    with pytest.raises(codec.CodecError, match="not a clip blob"):
        codec.decode(data, "x")


def changed(change) -> bytes:
    """A clip whose table was changed after it was encoded."""
    table = pa.ipc.open_stream(codec.encode(robot_clip())).read_all()
    sink = pa.BufferOutputStream()
    found = change(table)
    with pa.ipc.new_stream(sink, found.schema) as stream:
        stream.write_table(found)
    return sink.getvalue().to_pybytes()


@pytest.mark.parametrize(
    "change",
    [
        lambda table: table.set_column(0, "root_pos_w", pa.array(["a"] * len(table))),
        lambda table: table.set_column(0, "root_pos_w", pa.array([[1.0]] + [[1.0, 2.0]] * (len(table) - 1))),
        lambda table: table.drop_columns(["joint_pos"]),
        lambda table: table.replace_schema_metadata({"booster_lab": json.dumps({"format": codec.FORMAT})}),
        lambda table: table.replace_schema_metadata({"booster_lab": "[]"}),
    ],
)
def test_a_column_or_head_that_is_none_of_a_clip_is_refused(change):
    with pytest.raises(codec.CodecError, match="materialize again"):
        codec.decode(changed(change), "x")


def test_a_clip_of_another_format_says_what_to_do():
    old = {"booster_lab": json.dumps({"format": "booster-lab clip 2"})}
    data = changed(lambda table: table.replace_schema_metadata(old))
    with pytest.raises(codec.CodecError, match=r"format 'booster-lab clip 2', this version.*: materialize again"):
        codec.decode(data, "x")


def test_a_cut_clip_shares_no_memory_with_its_source():
    clip = human_clip()
    part = clip.cut(1, 3, "test/part")
    part.body_pos_w[:] = 0.0
    assert part.frame_count == 2
    assert clip.body_pos_w[1, 1, 0] == 101.0


def test_resampling_a_robot_clip_keeps_its_speed():
    found = robot_clip(frames=101, fps=100.0).resampled(50.0)
    assert found.frame_count == 51
    np.testing.assert_allclose(found.root_lin_vel_w()[:, 0], 1.0, atol=1e-9)
