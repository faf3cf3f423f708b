"""Properties over drawn input: what is written reads back the same, and whatever else is read is refused in one line."""

from __future__ import annotations

import io
import json
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from outlined_samples import random_drafted, random_drawn

from imdim.app import edit
from imdim.export.openscad_reader import read_openscad
from imdim.program import codec
from imdim.program.tree import KINDS, OPS, OUTLINED, SIZE_NAMES, Combine, Primitive, Program, combine_all, fold, leaves, map_lengths
from imdim.reconstruction.config import ConfigError, from_arguments
from imdim.target.archives import ArchiveError, read_array
from imdim.target.pcd import _lzf
from imdim.target.readers import FORMATS, read
from imdim.target.target import InputError, load_target

SHARED = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], derandomize=True)
NUMBER = st.floats(allow_nan=False, allow_infinity=False)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)
SIZE = st.floats(min_value=1e-300, max_value=1e300)


@st.composite
def primitives(draw) -> Primitive:
    kind = draw(st.sampled_from(KINDS))
    if kind in OUTLINED:
        return draw(drawn_leaves(kind))
    size = tuple(draw(SIZE) for _ in SIZE_NAMES[kind])
    return Primitive(kind, (max(size), min(size)) if kind == "torus" else size, draw(VECTOR), draw(VECTOR))


@st.composite
def drawn_leaves(draw, kind: str) -> Primitive:
    """A drawn outline at any scale; a turned one comes round by a share of a turn, and a drafted one is as high as it bears."""
    if kind == "drafted":
        leaf = random_drafted(np.random.default_rng(draw(st.integers(0, 2**32))), draw(st.floats(0.01, 1.0)), rotation=draw(VECTOR))
        scale = draw(st.floats(min_value=1e-100, max_value=1e100))
        return map_lengths(leaf, lambda length: length * scale, draw(VECTOR))
    size = draw(SIZE if kind == "extrude" else st.floats(min_value=1e-9, max_value=1.0))
    leaf, scale = random_drawn(np.random.default_rng(draw(st.integers(0, 2**32))), kind, size, draw(VECTOR), draw(VECTOR)), draw(SIZE)
    assert leaf.outline is not None
    return replace(leaf, outline=leaf.outline.map_lengths(lambda length: length * scale))


PROGRAMS = st.recursive(primitives(), lambda part: st.builds(Combine, st.sampled_from(OPS), part, part), max_leaves=12)
WORDS = st.sampled_from(["op", "parts", "kind", "size", "outline", "program", "box", "extrude", "union", "imdim-csg"])
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | WORDS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(WORDS | st.text(max_size=4), inner),
    max_leaves=20,
)


def one_line(error: BaseException) -> bool:
    return bool(str(error)) and "\n" not in str(error) and len(str(error)) < 20_000


def clear(kind: type[BaseException], read: Callable[[], object]) -> bool:
    """Whether `read` succeeds, or fails as it may and says so in one line."""
    try:
        read()
    except kind as error:
        return one_line(error)
    return True


@SHARED
@given(PROGRAMS)
def test_a_program_reads_back_the_same_and_writes_the_same_bytes(program):
    text = codec.dumps(program)
    again = codec.loads(text)
    assert list(leaves(again)) == list(leaves(program))
    assert codec.dumps(again) == text
    # n-ary on paper: the tree may lean the other way, but means the same for every assignment of truth values to the leaves
    for bits in (0, 0b1010_1100_0101, 0b0101_0011_1010, -1):
        assert meaning(program, bits) == meaning(again, bits)


def meaning(program: Program, bits: int) -> bool:
    """Whether a point is in the program that is in leaf i where bit i is set."""
    table = {"union": lambda a, b: a | b, "intersection": lambda a, b: a & b, "difference": lambda a, b: a & (not b)}
    return fold(program, lambda i, _: bool(bits >> i & 1), table)


@SHARED
@given(JSON)
def test_any_json_is_a_program_or_refused(value):
    for document in (value, {"format": "imdim-csg", "version": 1, "program": value}):
        assert clear(ValueError, partial(codec.from_json, document))


VERTICES = st.tuples(NUMBER, NUMBER) | st.tuples(NUMBER, NUMBER, NUMBER) | st.tuples(*[st.sampled_from([-1.0, 0.0, 1e-200, 1.0])] * 3)


@SHARED
@given(st.sampled_from([("extrude", "h"), ("revolve", "angle")]), st.lists(st.lists(VERTICES, min_size=2, max_size=5), max_size=3))
def test_loops_of_any_numbers_are_an_outline_or_refused(kind, loops):
    node = {"kind": kind[0], "size": {kind[1]: 1.0}, "outline": [[list(vertex) for vertex in loop] for loop in loops]}
    assert clear(ValueError, partial(codec.from_json, {"format": "imdim-csg", "version": 4, "program": node}))


@SHARED
@given(st.binary(max_size=200) | st.text(max_size=200).map(lambda t: t.encode("utf-8", "surrogatepass")))
def test_any_bytes_are_a_program_or_refused(data):
    assert clear(ValueError, lambda: codec.loads(data))


@pytest.mark.parametrize("suffix", sorted(FORMATS))
@settings(SHARED, max_examples=40)
@given(data=st.binary(max_size=400), head=st.booleans())
def test_any_bytes_are_a_part_or_refused(tmp_path, suffix, data, head):
    path = tmp_path / f"part{suffix}"
    path.write_bytes(HEADS.get(suffix, b"") * head + data)
    assert clear(InputError, lambda: load_target(path))


HEADS = {
    ".stl": b"solid x\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n",
    ".obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    ".off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    ".ply": b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n",
    ".3mf": b"PK\x03\x04",
    ".npz": b"PK\x03\x04",
    ".glb": b"glTF\x02\x00\x00\x00",
    ".gltf": b'{"asset":{"version":"2.0"},',
    ".npy": b"\x93NUMPY\x01\x00",
    ".pcd": b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 4\nDATA ascii\n",
    ".csv": b"x,y,z\n0,0,0\n",
    ".xyz": b"0 0 0\n1 1 1\n",
    ".txt": b"0 0 0\n1 1 1\n",
}
TABLES = st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=3, max_size=30)


@SHARED
@given(TABLES)
def test_a_cloud_reads_back_as_it_was_written(tmp_path, rows):
    table = np.array(rows, float)
    text = "\n".join(" ".join(map(repr, row)) for row in rows)
    ply = f"ply\nformat ascii 1.0\nelement vertex {len(rows)}\n" + "".join(f"property double {n}\n" for n in "xyz") + "end_header\n" + text
    pcd = f"FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {len(rows)}\nHEIGHT 1\nPOINTS {len(rows)}\nDATA ascii\n" + text + "\n"
    np.save(tmp_path / "a.npy", table)
    np.savez(tmp_path / "a.npz", points=table)
    for name, content in (("a.xyz", text), ("a.csv", text.replace(" ", ",")), ("a.ply", ply), ("a.pcd", pcd)):
        (tmp_path / name).write_text(content + "\n")
    for suffix in (".npy", ".npz", ".xyz", ".csv", ".ply", ".pcd"):
        assert read(tmp_path / f"a{suffix}").points.tolist() == table.tolist()


@SHARED
@given(st.binary(max_size=60), st.integers(0, 300))
def test_an_lzf_stream_stays_within_its_bounds(stream, size):
    """Against a reading of the format (liblzf, lzf_d.c) on Python lists, where every index is checked."""
    out = np.full(size + 64, 77, np.uint8)
    written = _lzf(np.frombuffer(stream, np.uint8), out[:size])
    assert (out[size:] == 77).all()
    expected = plain_lzf(stream, size)
    assert written == (-1 if expected is None else len(expected))
    if expected is not None:
        assert out[: len(expected)].tolist() == expected


def plain_lzf(stream: bytes, size: int) -> list[int] | None:
    out: list[int] = []
    rest = iter(stream)
    for control in rest:
        if control < 32:
            run = [byte for _, byte in zip(range(control + 1), rest, strict=False)]
            if len(run) <= control:
                return None
            out += run
        else:
            length, low = control >> 5, [next(rest, None)]
            if length == 7 and low[0] is not None:
                length, low = length + low[0], [next(rest, None)]
            if low[0] is None:
                return None
            start = len(out) - ((control & 31) << 8) - low[0] - 1
            if start < 0:
                return None
            for k in range(length + 2):
                out.append(out[start + k])
        if len(out) > size:
            return None
    return out


@SHARED
@given(st.binary(max_size=300))
def test_any_array_is_numbers_or_refused(data):
    for content in (data, b"\x93NUMPY\x01\x00" + data, b"\x93NUMPY\x01\x00\x20\x00" + data):
        assert clear(ArchiveError, partial(read_array, io.BytesIO(content), len(content)))


@SHARED
@given(st.lists(st.text(max_size=30) | st.from_regex(r"[a-z_]{1,12}=[-0-9.e\[\]{}'\"$]{0,8}", fullmatch=True), max_size=4))
def test_any_settings_are_settings_or_refused(arguments):
    assert clear(ConfigError, lambda: from_arguments(arguments))


@SHARED
@given(st.lists(st.text(max_size=30) | st.from_regex(r"[a-z_]{1,12}=[-0-9.einfa_]{0,8}", fullmatch=True), min_size=1, max_size=3))
def test_any_assignment_is_one_or_refused(given_):
    assert clear(ConfigError, lambda: edit._assignments(given_))


@pytest.mark.parametrize(
    "number", ["1" + "+1" * 5000, "-" * 5000 + "1", "(" * 5000 + "1" + ")" * 5000, "9" * 400, "1e999", "1/0", "x" * 5000]
)
def test_a_text_whose_numbers_are_hostile_is_refused_in_one_line(number):
    text = f"$fn = 96;\na = {number};\ntranslate([0, {number}, 0]) sphere(r = {number});\n"
    assert clear(ValueError, lambda: read_openscad(text))
    with pytest.raises(ValueError, match=r"line [23]|finite"):
        read_openscad(text)


@pytest.mark.parametrize("op", OPS)
def test_a_flat_program_of_thousands_is_compared_hashed_and_read(op):
    many = [Primitive("sphere", (0.4,), (float(i), 0.0, 0.0)) for i in range(3_000)]
    one, other = (combine_all(op, many) for _ in range(2))
    assert one == other
    assert hash(one) == hash(other)
    assert one != combine_all(op, [*many[:-1], Primitive("sphere", (0.5,))])
    assert one != combine_all(op, many[:-1])
    assert codec.loads(codec.dumps(one)) == one


def test_programs_that_nest_too_deep_are_refused_in_one_line(tmp_path):
    program = Primitive("sphere", (1.0,))
    for i in range(2_000):
        program = Combine(OPS[i % 2], Primitive("sphere", (1.0,)), program)
    with pytest.raises(ValueError, match="200 nested operations at most, got"):
        codec.dumps(program)
    leaf = {"kind": "sphere", "size": {"r": 1}}
    for depth in (250, 900, 100_000):
        text = '{"op": "union", "parts": [' * depth + json.dumps(leaf) + ("," + json.dumps(leaf) + "]}") * depth
        with pytest.raises(ValueError, match="200 operations inside each other") as caught:
            codec.loads('{"format": "imdim-csg", "version": 1, "program": ' + text + "}")
        assert one_line(caught.value)


def test_a_flood_of_lists_is_refused_before_it_is_parsed():
    """Eight megabytes of them would take half a minute: the garbage collector looks at all of them again and again."""
    text = "[" + ",".join(["[" * 150 + "1" + "]" * 150] * 20_000) + "]"
    start = time.process_time()
    with pytest.raises(ValueError, match="3000001 lists and objects"):
        codec.loads(text)
    assert time.process_time() - start < 2.0


def test_ten_thousand_constraints_are_checked_in_a_second(tmp_path):
    count = codec.MAX_CONSTRAINTS
    parts = [{"kind": "sphere", "size": {"r": 1}} for _ in range(count)]
    chain = [{"kind": "equal", "of": [f"{i}.r", f"{(i + 1) % count}.r"]} for i in reversed(range(count))]
    document = {"format": "imdim-csg", "version": 2, "program": {"op": "union", "parts": parts}, "constraints": chain}
    start = time.process_time()
    assert len(codec.constraints_of(document)) == count
    assert time.process_time() - start < 5.0  # 0.5 s on a free core; it was quadratic


def test_corpus_files_are_small():
    sizes = {path.name: path.stat().st_size for path in (Path(__file__).parent / "corpus").iterdir()}
    assert not [name for name, size in sizes.items() if size > 150_000]
