"""A shortage of memory and a fault of the disk are not reported as damage of the file that was being read."""

import errno
import logging
import os
import pickle
import zipfile

import numpy as np
import pytest
import torch

from assets.hardware import ingest_folder
from pipeline.cli import main as command
from pipeline.errors import FileError
from pipeline.files import settings
from pipeline.files.npz import read_npz_header
from pipeline.hardware_logs import LogSettings, mcap_reader
from pipeline.hardware_logs.decode import JointCount, TopicDecoder
from pipeline.hardware_logs.mcap_records import Channel, Schema
from pipeline.hardware_logs.messages import TOPICS, schema_name, schema_text
from pipeline.project import Project
from pipeline.readers.restricted_pickle import load_pickle, load_torch
from tests.factories.interrupted import WORKS

SHORTAGES = {
    "memory": MemoryError(),
    "a read error": OSError(errno.EIO, os.strerror(errno.EIO)),
    "too many open files": OSError(errno.EMFILE, os.strerror(errno.EMFILE)),
}


@pytest.fixture(params=SHORTAGES)
def shortage(request):
    """The error, and what raises it."""
    error = SHORTAGES[request.param]

    def fail(*_, **__):
        raise error

    return error, fail


def test_an_archive_is_not_called_damaged(tmp_path, monkeypatch, shortage):
    error, fail = shortage
    np.savez(tmp_path / "clip.npz", poses=np.zeros((3, 72)))
    header = read_npz_header(tmp_path / "clip.npz")
    monkeypatch.setattr(zipfile.ZipFile, "open", fail)
    with pytest.raises(type(error)) as raised:
        read_npz_header(tmp_path / "clip.npz")
    assert raised.value is error
    with pytest.raises(type(error)) as raised:
        header.array("poses")
    assert raised.value is error


def test_a_file_of_torch_is_not_called_damaged(tmp_path, monkeypatch, shortage):
    error, fail = shortage
    torch.save({"poses": torch.zeros(3, 72)}, tmp_path / "clip.pt")
    monkeypatch.setattr(zipfile.ZipFile, "read", fail)
    with pytest.raises(type(error)) as raised:
        load_torch(tmp_path / "clip.pt")
    assert raised.value is error


def test_a_damaged_member_that_ends_in_an_os_error_is_still_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "clip.pt", "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("clip/data.pkl", pickle.dumps({"a": 1}))
    data = (tmp_path / "clip.pt").read_bytes()
    at = data.index(b"BZh") + 4
    (tmp_path / "clip.pt").write_bytes(data[:at] + b"\xff" * 6 + data[at + 6 :])
    with pytest.raises(FileError, match=r"not a file of torch.save that can be read: OSError Invalid data stream"):
        load_torch(tmp_path / "clip.pt")


@pytest.mark.parametrize("claimed", [2**34, 2**50, 2**62])
def test_a_bytearray_that_claims_more_than_there_is_is_cut_off(tmp_path, claimed):
    (tmp_path / "clip.pkl").write_bytes(b"\x80\x05\x96" + claimed.to_bytes(8, "little") + b"abc.")
    with pytest.raises(FileError, match=r"EOFError it was cut off"):
        load_pickle(tmp_path / "clip.pkl")


@pytest.mark.parametrize("size", [0, 3, 200_000])
def test_a_bytearray_is_read_in_and_outside_of_a_frame(tmp_path, size):
    (tmp_path / "clip.pkl").write_bytes(pickle.dumps({"a": bytearray(b"x" * size), "b": 1}, 5))
    assert load_pickle(tmp_path / "clip.pkl") == {"a": bytearray(b"x" * size), "b": 1}


def test_a_message_is_not_counted_as_unreadable_for_lack_of_memory(monkeypatch):
    topic = "/low_state"
    message = TOPICS[topic]
    schema = Schema(name=schema_name(message), encoding="ros2msg", text=schema_text(message))
    decoder = TopicDecoder(Channel(topic=topic, encoding="cdr", schema=schema), JointCount(allowed=(23,)))

    def fail(*_):
        raise MemoryError

    monkeypatch.setattr(decoder, "_known", False)  # another schema's messages are read one by one
    store = decoder._register()
    monkeypatch.setattr(store, "deserialize_cdr", fail)
    monkeypatch.setattr(decoder, "_store", store)
    with pytest.raises(MemoryError):
        decoder.decode(bytes(100), np.array([0]), np.array([100]))


def test_a_log_that_memory_does_not_hold_is_read_again_by_the_next_run(tmp_path, monkeypatch):
    WORKS["ingest"].prepare(tmp_path)
    project = Project(tmp_path)
    values = settings.read(project.settings("hardware_logs.yaml"), LogSettings)

    def fail(*_):
        raise MemoryError

    with monkeypatch.context() as short:
        short.setattr(mcap_reader, "open_chunk", fail)
        ingested = ingest_folder(project, values, logging.getLogger())
    assert ingested.faults == 2
    texts = {row.clip: " ".join(reason["text"] for reason in row.reasons) for row in ingested.manifest.judged}
    assert "a: there is not enough memory to read it" in texts["a"]
    again = ingest_folder(project, values, logging.getLogger())
    assert again.faults == 0
    assert [row.fate for row in again.manifest.judged] == ["accepted", "rejected", "accepted"]


def test_the_command_answers_a_shortage_of_memory_in_a_sentence(monkeypatch, capsys):
    def fail(_):
        raise MemoryError

    monkeypatch.setattr("pipeline.cli.inspect_command.run", fail)
    assert command.main(["inspect", "clip.bvh"]) == 1
    assert capsys.readouterr().err.startswith("booster-lab: there is not enough memory")
