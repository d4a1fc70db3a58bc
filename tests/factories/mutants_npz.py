"""Faults of NumPy archives, planted into an archive of SMPL poses."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tests.factories.mutant import REFUSED, Mutant, flagged, refused, understood

FRAMES = 60


def arrays() -> dict[str, np.ndarray]:
    """A standing person gliding along -y."""
    poses = np.zeros((FRAMES, 72))
    poses[:, 0] = np.pi / 2
    poses[:, 3:12] = 0.1 * np.sin(np.arange(FRAMES) / 9.0)[:, None]
    trans = np.stack([np.zeros(FRAMES), -0.02 * np.arange(FRAMES), np.full(FRAMES, 0.95)], axis=1)
    return {"poses": poses, "trans": trans, "betas": np.zeros(10), "mocap_framerate": np.array(30.0)}


def packed(values: Mapping[str, np.ndarray], allow_pickle: bool = False) -> bytes:
    """An archive of arrays."""
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=allow_pickle, **values)
    return stream.getvalue()


def with_array(name: str, value: object) -> bytes:
    """The clean archive with one array changed; None leaves it out."""
    values: dict[str, np.ndarray] = {**arrays(), name: value}  # pyright: ignore[reportAssignmentType]
    return packed({key: each for key, each in values.items() if each is not None}, allow_pickle=True)


def member(shape: tuple[int, ...], data: bytes = b"", descr: object = "<f8") -> bytes:
    """A .npy whose header says what it likes."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": descr, "fortran_order": False, "shape": shape})
    return header.getvalue() + data


def zipped(members: Mapping[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """An archive of raw members."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return stream.getvalue()


def npz_mutants() -> list[Mutant]:
    """All of them but the large ones (`bombs`)."""
    return [*_archives(), *_values(), *_same(), *_flagged()]


def _archives() -> list[Mutant]:
    clean = packed(arrays())
    poses = zipped({"poses.npy": b"no array", "trans.npy": member((3,), bytes(24))})
    contents: dict[str, bytes] = {
        f"cut at {share:.0%}": clean[: int(share * len(clean))] for share in (0.01, 0.5, 0.99)
    }
    contents |= {
        "empty": b"",
        "a text": b"PK? no",
        "a .npy": member((2, 3), bytes(48)),
        "a pickle": b"\x80\x04\x95\x0b\x00\x00\x00\x00\x00\x00\x00}\x94\x8c\x01a\x94K\x01s.",
        "members that are no arrays": poses,
        "an empty archive": zipped({}),
        "300 members": zipped({f"m{index}.npy": member((0,)) for index in range(300)}),
        "shape of 2^38": zipped({"poses.npy": member((1 << 38,), bytes(64))}),
        "shape of negative length": zipped({"poses.npy": member((-5, 72), bytes(64))}),
        "shape larger than its data": zipped({"poses.npy": member((60, 72), bytes(64)), "trans.npy": member((60, 3))}),
        "a header that is code": _header("__import__('os').system('true')"),
        "a header 60,000 deep": _header("(" * 30_000 + ")" * 30_000),
        "a header without a shape": _header("{'descr': '<f8', 'fortran_order': False}"),
        "version 9": _header("{'descr': '<f8', 'fortran_order': False, 'shape': (1,)}", b"\x09\x00"),
        "damaged in the middle": clean[:3000] + bytes(200) + clean[3200:],
        "encrypted": _encrypted(clean),
        "numbers 20 MB of zeros": zipped({"poses.npy": member((2_500_000,), bytes(20_000_000))}),
        "a name that climbs": zipped({"../../poses.npy": member((60, 72), bytes(8 * 60 * 72))}),
        "an absolute name": zipped({"/etc/poses.npy": member((60, 72), bytes(8 * 60 * 72))}),
    }
    return refused("walk.npz", "archive|inflates|claims|members|empty|read|damaged|poses|robot|SMPL", contents)


def _header(text: str, version: bytes = b"\x01\x00") -> bytes:
    raw = text.encode()[:65_000] + b"\n"
    return zipped({"poses.npy": b"\x93NUMPY" + version + struct.pack("<H", len(raw)) + raw})


def _encrypted(clean: bytes) -> bytes:
    """The flag of encryption set in every header."""
    data = bytearray(clean)
    for mark, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = data.find(mark)
        while at >= 0:
            data[at + offset] |= 1
            at = data.find(mark, at + 4)
    return bytes(data)


def _values() -> list[Mutant]:
    poses, trans = arrays()["poses"], arrays()["trans"]
    contents = {
        "no poses": with_array("poses", None),
        "no trans": with_array("trans", None),
        "poses of objects": with_array("poses", np.array([{"a": 1}] * FRAMES, dtype=object)),
        "poses of text": with_array("poses", poses.astype(str)),
        "poses complex": with_array("poses", poses.astype(complex)),
        "poses true and false": with_array("poses", poses.astype(bool)),
        "poses of dates": with_array("poses", np.zeros((FRAMES, 72), dtype="datetime64[s]")),
        "poses with fields": with_array("poses", np.zeros((FRAMES, 72), dtype=[("a", "f8")])),
        "poses of one dimension": with_array("poses", poses.ravel()),
        "70 columns": with_array("poses", poses[:, :70]),
        "fewer poses than places": with_array("poses", poses[:-1]),
        "places of two numbers": with_array("trans", trans[:, :2]),
        "no frames": packed({**arrays(), "poses": poses[:0], "trans": trans[:0]}),
        "one frame": packed({**arrays(), "poses": poses[:1], "trans": trans[:1]}),
        "all nan": packed({**arrays(), "poses": np.full_like(poses, np.nan)}),
        "rate of objects": with_array("mocap_framerate", np.array([None], dtype=object)),
    }
    mutants = refused("walk.npz", "poses|trans|frame|robot|SMPL|motion|number|objects|rate", contents)
    rates = {str(rate): rate for rate in (0.0, -30.0, np.nan, np.inf, 1e9)} | {"text": "30", "two": [30.0, 60.0]}
    texts = {f"rate {name}": with_array("mocap_framerate", np.array(rate)) for name, rate in rates.items()}
    return mutants + refused("walk.npz", "rate|number|fps|Hz", texts)


def _same() -> list[Mutant]:
    clean = arrays()
    contents = {
        "columns first": packed({**clean, "poses": np.asfortranarray(clean["poses"])}),
        "big end first": packed({**clean, "poses": clean["poses"].astype(">f8")}),
        "a rate in whole numbers": with_array("mocap_framerate", np.array(30)),
        "an array that nobody asked for": packed({**clean, "dmpls": np.zeros((FRAMES, 8))}),
        "an object array beside": with_array("notes", np.array([{"a": 1}], dtype=object)),
        "a dimension for the joints": with_array("poses", clean["poses"].reshape(FRAMES, 24, 3)),
        "66 columns": with_array("poses", clean["poses"][:, :66]),
        "156 columns": packed({**clean, "poses": np.pad(clean["poses"], ((0, 0), (0, 84)))}),
    }
    return understood("walk.npz", contents)


def _flagged() -> list[Mutant]:
    poses, trans = arrays()["poses"].copy(), arrays()["trans"].copy()
    poses[30, 3], trans[30:, 0] = np.nan, 2.0
    return flagged(
        "walk.npz", {"nan in one number": with_array("poses", poses), "teleport": with_array("trans", trans)}
    )


def bombs() -> list[Mutant]:
    """Small files that ask for more memory or time than there is."""
    big = member((25_000_000,), bytes(200_000_000))
    inflating = zipped({"poses.npy": big})
    claims = zipped({"poses.npy": member((1 << 40,), bytes(64)), "trans.npy": member((1 << 40,), bytes(64))})
    nested = zipped({"poses.npy": zipped({"poses.npy": inflating}, zipfile.ZIP_STORED)})
    contents = {"200 MB of zeros": inflating, "eight terabytes": claims, "an archive in an archive": nested}
    found = refused("walk.npz", "inflates|claims|read", contents)
    found.append(_sparse("walk.bvh"))
    found.append(_sparse("walk.txt"))
    return found


def _sparse(file: str) -> Mutant:
    def put(path: Path) -> None:
        with path.open("wb") as stream:
            stream.write(b"{" if file.endswith(".txt") else b"HIERARCHY\n")
            stream.truncate(3_000_000_000)

    return Mutant(name=f"{file}: three gigabytes of holes", file=file, content=put, want=REFUSED, says="more than")
