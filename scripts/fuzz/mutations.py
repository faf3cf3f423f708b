"""Ways to break a file: bytes, numbers in text, JSON values, members of archives. Each is a function of the file and a generator alone."""

from __future__ import annotations

import io
import json
import lzma
import random
import re
import struct
import zipfile
import zlib
from typing import Any

NUMBERS = [
    *(b"nan inf -inf 1e308 -1e308 1e-308 1e400 0 -0 -1 1 2 3 255 256 65535 65536 2147483647 2147483648 -2147483648").split(),
    *(b"4294967295 4294967296 9223372036854775807 9223372036854775808 99999999999999999999 0x10 1_0 1e 1,5 .5 ++1 a").split(),
    b"",
    b"1" * 400,
    "٣".encode(),
]
INTEGERS = (0, 1, -1, 2, 127, 128, 255, 256, 32767, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1)
WORDS = ["", "a", "../../etc/passwd", "/etc/passwd", "http://192.0.2.1/x", "\x00", "é" * 50, "x" * 5000, "__class__", "union", "box"]
_NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")


def mutated(data: bytes, other: bytes, form: str, rng: random.Random) -> bytes:
    """One to four mutations of `data`; `other` is a second file of the same form, to splice with."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        special = SPECIAL.get(form)
        data = special(data, rng) if special and rng.random() < 0.6 else _blunt(data, other, rng)
    return data


def _blunt(data: bytes, other: bytes, rng: random.Random) -> bytes:
    return (
        rng.choice((_flip, _overwrite, _cut, _double, _truncate, _insert, _number, _number, _line))(data, rng)
        if rng.random() < 0.93
        else (data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :])
    )


def _flip(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data or b"\0")
    for _ in range(rng.choice((1, 2, 8))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def _overwrite(data: bytes, rng: random.Random) -> bytes:
    """An integer or a float of the usual widths, near the front half of the time: headers are there."""
    form = rng.choice(("<i", "<q", "<h", ">i", "<f", "<d"))
    value = rng.choice((float("nan"), float("inf"), 1e30, 1e300)) if form[1] in "fd" else rng.choice(INTEGERS)
    try:
        word = struct.pack(form, value)
    except (struct.error, OverflowError):
        word = b"\xff" * struct.calcsize(form)
    at = rng.randrange(max(1, min(len(data), 200) if rng.random() < 0.5 else len(data)))
    return data[:at] + word + data[at + len(word) :]


def _cut(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + data[at + rng.choice((1, 2, 4, 16, 256)) :]


def _double(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    piece = data[at : at + rng.choice((1, 8, 64, 1024))]
    return data[:at] + piece * rng.choice((2, 3, 50)) + data[at:]


def _truncate(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _insert(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice((rng.randbytes(4), b"\0" * 16, b"\n", b"\xff\xfe", b'"', b"{" * 200, b"[" * 3000, b" ")) + data[at:]


def _number(data: bytes, rng: random.Random) -> bytes:
    found = list(_NUMBER.finditer(data[:20000]))
    if not found:
        return _flip(data, rng)
    one = rng.choice(found)
    return data[: one.start()] + rng.choice(NUMBERS) + data[one.end() :]


def _line(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    change = rng.randrange(4)
    if change == 0:
        del lines[i]
    elif change == 1:
        lines.insert(i, lines[j])
    elif change == 2:
        lines[i], lines[j] = lines[j], lines[i]
    else:
        lines[i : i + 1] = lines[i].split(b" ")
    return b"\n".join(lines)


def _json(data: bytes, rng: random.Random) -> bytes:
    try:
        return json.dumps(json_mutated(json.loads(data), rng)).encode("utf-8", "surrogatepass")
    except (ValueError, RecursionError):
        return _flip(data, rng)


def json_mutated(value: Any, rng: random.Random) -> Any:
    """The same document with one value replaced, dropped, renamed, doubled or nested."""
    places = list(_places(value))
    if not places:
        return _strange(rng)
    holder, key = rng.choice(places)
    change = rng.random()
    if change < 0.5:
        holder[key] = _strange(rng)
    elif change < 0.6:
        del holder[key]
    elif change < 0.7:
        other, there = rng.choice(places)
        # a copy, or a document could hold itself
        other[there if isinstance(other, dict) else min(there, len(other) - 1)] = json.loads(json.dumps(holder[key])) if other else None
    elif change < 0.8 and isinstance(holder, dict):
        holder[rng.choice(WORDS)] = holder.pop(key)
    elif change < 0.9 and isinstance(holder, list):
        holder += [holder[key]] * rng.choice((1, 10, 2000))
    else:
        for _ in range(rng.choice((1, 3, 150, 400))):
            holder[key] = {"op": "union", "parts": [holder[key], holder[key]]} if rng.random() < 0.02 else [holder[key]]
    return value


def _places(value: Any) -> list[tuple[Any, Any]]:
    out, todo = [], [value]
    while todo:
        at = todo.pop()
        keys = list(at) if isinstance(at, dict) else range(len(at)) if isinstance(at, list) else ()
        out += [(at, key) for key in keys]
        todo += [at[key] for key in keys]
    return out


def _strange(rng: random.Random) -> Any:
    return rng.choice(
        (None, True, False, [], {}, [[]], rng.choice(WORDS), rng.choice(INTEGERS), 1e308, -1e308, 1e-300, 0.5, 10**400, -1.5, [1] * 5, "1")
    )


def _zip(data: bytes, rng: random.Random) -> bytes:
    """An archive with one member broken, renamed, dropped or doubled, or its compression changed, packed again."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [(info.filename, archive.read(info)) for info in archive.infolist()]
    except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, ValueError, OSError, RuntimeError, EOFError):
        return _flip(data, rng)
    if not members:
        return _flip(data, rng)
    i = rng.randrange(len(members))
    name, content = members[i]
    change = rng.random()
    if change < 0.7:
        members[i] = (name, (_npy if name.endswith(".npy") and rng.random() < 0.5 else _blunt_one)(content, rng))
    elif change < 0.8:
        members[i] = (rng.choice(("../" + name, "/" + name, "C:\\" + name, name.upper(), "a\nb")), content)
    elif change < 0.9:
        del members[i]
    else:
        members.append((rng.choice((name + "2", "../../escaped.txt", "/tmp/escaped.txt")), content))
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", rng.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED, zipfile.ZIP_LZMA))) as archive:
        for name, content in members:
            # a member without a time of its own: the same case is the same bytes in every second
            archive.writestr(zipfile.ZipInfo(name), content, archive.compression)
    return out.getvalue()


def _blunt_one(data: bytes, rng: random.Random) -> bytes:
    return _blunt(data, data, rng)


HEADS = (
    "{'descr': '|O', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 3), }",
    "{'descr': '<f8', 'fortran_order': True, 'shape': (-1, 3), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (), }",
    "{'descr': '<c16', 'fortran_order': False, 'shape': (5, 3), }",
    "{'descr': '<M8[s]', 'fortran_order': False, 'shape': (5, 3), }",
    "{'descr': [('a', '<f8', (100000, 100000))], 'fortran_order': False, 'shape': (5,), }",
    "{'descr': '<U99999999', 'fortran_order': False, 'shape': (5, 3), }",
    "{'descr': '<f2', 'fortran_order': False, 'shape': (5, 3), }",
    "{'descr': '>f8', 'fortran_order': False, 'shape': (60, 3, 1), }",
    "__import__('os').system('touch escaped')",
    "(" * 3000,
)


def _npy(data: bytes, rng: random.Random) -> bytes:
    """Another header before the same numbers."""
    head = rng.choice(HEADS).encode()
    at = data.find(b"\n") + 1
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head) + 1) + head + b"\n" + data[at:]


def _chunk(data: bytes, rng: random.Random, at: int, width: str) -> bytes:
    """The JSON that begins at `at`, its length in the word before, changed with the length right."""
    size = struct.calcsize(width)
    head = at - size if width == "<Q" else at - 8
    try:
        (length,) = struct.unpack_from(width, data, head)
        text = json.dumps(json_mutated(json.loads(data[at : at + length]), rng)).encode()
    except (ValueError, struct.error, RecursionError):
        return _flip(data, rng)
    text += b" " * (-len(text) % 4)
    return data[:head] + struct.pack(width, len(text)) + data[head + size : at] + text + data[at + length :]


def _glb(data: bytes, rng: random.Random) -> bytes:
    out = _chunk(data, rng, 20, "<I")
    return out[:8] + struct.pack("<I", len(out)) + out[12:]


def _safetensors(data: bytes, rng: random.Random) -> bytes:
    if rng.random() < 0.5:
        return _chunk(data, rng, 8, "<Q")
    # the settings of the design are JSON within JSON
    (length,) = struct.unpack_from("<Q", data)
    try:
        header = json.loads(data[8 : 8 + length])
        notes = header["__metadata__"]
        name = rng.choice(("config", "vocabulary", "max_seq_len", "design", "version"))
        notes[name] = (
            json.dumps(json_mutated(json.loads(notes[name]), rng)) if name in ("config", "vocabulary") else rng.choice([*WORDS, "7"])
        )
        text = json.dumps(header).encode()
    except (ValueError, KeyError, TypeError, RecursionError):
        return _flip(data, rng)
    return struct.pack("<Q", len(text)) + text + data[8 + length :]


SPECIAL = {"json": _json, "zip": _zip, "npy": _npy, "glb": _glb, "safetensors": _safetensors}
