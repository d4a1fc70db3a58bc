"""Random mutations of files from a seed: bytes, lines and numbers."""

from __future__ import annotations

import re

import numpy as np

NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?![\w.])")
ODD_NUMBERS = (
    *(b"nan", b"inf", b"-inf", b"1e999", b"-1e308", b"0x10", b"1_0", b"1:30", b"010", b"1,5", b"--1", b"", b"null"),
    *("１２".encode(), "٣".encode(), b"true", b"1e-400", b"9" * 400, b"{}", b"[]", b"'0'", b"-0", b"1 2", b"+"),
)
ODD_TEXTS = (
    *(b"\x00", b"\xff", b"\xef\xbb\xbf", b"\r", b"\t", b'"', b"'", b"#", b"<script>alert(1)</script>", b"../../x"),
    *(
        "\u202e".encode(),
        b"\n\n",
        b":",
        b"{",
        b"}",
        b"[",
        b"- ",
        b"&a ",
        b"*a",
        b"!!python/name:os.system",
        b"y" * 150_000,
    ),
)


def mutated_bytes(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """`data` with bits flipped, bytes replaced, a stretch removed, doubled, zeroed or inserted, or cut off."""
    kind = str(rng.choice(["flip", "replace", "remove", "double", "zero", "insert", "cut"]))
    start = int(rng.integers(0, max(len(data), 1)))
    length = int(min(rng.choice([1, 4, 16, 64, 512, 4096]), max(len(data) - start, 1)))
    stretch = data[start : start + length]
    if kind in ("flip", "replace"):
        changed = bytearray(data)
        for place in rng.integers(0, len(data), size=int(rng.integers(1, 6))).tolist():
            changed[place] = (
                changed[place] ^ (1 << int(rng.integers(0, 8))) if kind == "flip" else int(rng.integers(256))
            )
        return bytes(changed), kind
    made = {
        "remove": data[:start] + data[start + length :],
        "double": data[:start] + stretch + data[start:],
        "zero": data[:start] + bytes(len(stretch)) + data[start + length :],
        "insert": data[:start] + rng.bytes(length) + data[start:],
        "cut": data[:start],
    }
    return made[kind], f"{kind} {length} at {start}"


def mutated_lines(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """`data` with a line removed, doubled, swapped with another, cut, or with an odd text put into it."""
    lines = data.splitlines(keepends=True)
    kind = str(rng.choice(["remove", "double", "swap", "shorten", "odd text", "other ends"]))
    one, other = (int(place) for place in rng.integers(0, len(lines), size=2))
    if kind == "other ends":
        return data.replace(b"\n", [b"\r\n", b"\r", b"\n\n"][one % 3]), kind
    if kind == "remove":
        del lines[one]
    elif kind == "double":
        lines.insert(one, lines[one])
    elif kind == "swap":
        lines[one], lines[other] = lines[other], lines[one]
    else:
        place = int(rng.integers(0, len(lines[one]) + 1))
        text = b"\n" if kind == "shorten" else ODD_TEXTS[int(rng.integers(len(ODD_TEXTS)))] + lines[one][place:]
        lines[one] = lines[one][:place] + text
    return b"".join(lines), f"{kind} line {one + 1}"


def mutated_number(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """`data` with one number written in another way, scaled, negated, moved, removed or exchanged with the next."""
    found = list(NUMBER.finditer(data))
    if not found:
        return mutated_bytes(data, rng)
    place = int(rng.integers(len(found)))
    match = found[place]
    word = match.group()
    kind = str(rng.choice(["odd", "scaled", "negated", "moved", "removed", "doubled", "exchanged"]))
    if kind == "exchanged":
        after = found[min(place + 1, len(found) - 1)]
        between = data[match.end() : after.start()] if after is not match else b""
        changed = after.group() + between + word if after is not match else word
        return data[: match.start()] + changed + data[max(after.end(), match.end()) :], f"{kind} {word!r}"
    value = float(word)
    new = {
        "odd": ODD_NUMBERS[int(rng.integers(len(ODD_NUMBERS)))],
        "scaled": repr(value * float(rng.choice([0.0, 0.5, 2.0, 10.0, 57.3, 1e6]))).encode(),
        "negated": repr(-value).encode(),
        "moved": repr(value + float(rng.normal())).encode(),
        "removed": b"",
        "doubled": word + b" " + word,
    }[kind]
    return data[: match.start()] + new + data[match.end() :], f"{kind}: {word!r} to {new[:20]!r}"


def mutated_text(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """A mutation of bytes, of lines or of a number; numbers are the most."""
    return (mutated_bytes, mutated_lines, mutated_number, mutated_number)[int(rng.integers(4))](data, rng)
