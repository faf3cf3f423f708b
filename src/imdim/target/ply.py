"""Stanford PLY, as text and as records of either byte order: places, normals and polygons; whatever else there is is passed over."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from imdim.target.plain_numbers import read_numbers
from imdim.target.polygons import triangulate_polygons

KINDS = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"},
}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
LOOPS = ("vertex_indices", "vertex_index")
MAX_PROPERTIES = 1000


@dataclass(frozen=True)
class _Property:
    """Numbers of one `kind`; `count` is the kind of how many there are, None for one."""

    name: str
    kind: str
    count: str | None = None


@dataclass(frozen=True)
class _Element:
    name: str
    rows: int
    properties: list[_Property] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Table:
    """Of one element: columns of single numbers [rows], and lists as their numbers one after the other with their lengths [rows]."""

    single: dict[str, np.ndarray]
    lists: dict[str, tuple[np.ndarray, np.ndarray]]


def read_ply(data: bytes) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
    """Points [n, 3] float64, normals [n, 3] or None, and triangles [m, 3] int64 (none of a cloud); polygons are cut into triangles.

    Raises ValueError, one line, for a header that is none, and for less content than the header promises.
    """
    order, elements, start = _read_header(data)
    tables = dict(_read_text(data[start:], elements) if order == "" else _read_records(data[start:], elements, order))
    vertex = tables.get("vertex", _Table({}, {})).single
    if not {"x", "y", "z"} <= set(vertex):
        raise ValueError("its vertices have no x, y and z")
    points = np.stack([vertex[name].astype(float) for name in "xyz"], axis=1)
    has_normals = {"nx", "ny", "nz"} <= set(vertex)
    normals = np.stack([vertex[name].astype(float) for name in ("nx", "ny", "nz")], axis=1) if has_normals else None
    loops = next((found for name, found in tables.get("face", _Table({}, {})).lists.items() if name in LOOPS), None)
    if loops is None:
        if len(tables.get("tristrips", _Table({}, {})).lists):
            raise ValueError("its triangles are strips, which are not read")
        return points, normals, np.zeros((0, 3), np.int64)
    return points, normals, triangulate_polygons(points, loops[0], loops[1])


def _read_header(data: bytes) -> tuple[str, list[_Element], int]:
    """The byte order ("" for text), the elements and where the content begins."""
    if data[:3] != b"ply":
        raise ValueError("it does not begin with the word ply")
    end = data.find(b"end_header")
    start = data.find(b"\n", end) + 1
    if end < 0 or not start:
        raise ValueError("its header has no end")
    order, elements = "", []
    for line in data[:end].decode("ascii", "replace").splitlines()[1:]:
        words = line.split()
        match words:
            case ["format", form, _] if form in ORDERS:
                order = ORDERS[form]
            case ["element", name, rows]:
                elements.append(_Element(name, int(rows)))
            case ["property", "list", count, kind, name] if elements:
                elements[-1].properties.append(_Property(name, KINDS[kind], KINDS[count]))
            case ["property", kind, name] if elements:
                elements[-1].properties.append(_Property(name, KINDS[kind]))
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError(f"its header says {line[:60]!r}")
    most = max((len(element.properties) for element in elements), default=0)
    if min((element.rows for element in elements), default=0) < 0 or most > MAX_PROPERTIES:
        raise ValueError(f"an element of less than 0 rows or of {most} properties")
    return order, elements, start


def _read_records(data: bytes, elements: list[_Element], order: str) -> Iterator[tuple[str, _Table]]:
    content, at = np.frombuffer(data, np.uint8), 0
    for element in elements:
        sizes = np.array([np.dtype(p.kind).itemsize for p in element.properties], np.int64)
        counts = np.array([np.dtype(p.count).itemsize if p.count else 0 for p in element.properties], np.int64)
        least = int(np.where(counts > 0, counts, sizes).sum())
        if element.rows * least > len(content) - at:
            raise ValueError(f"{element.rows} rows of {element.name} need {element.rows * least} bytes, {len(content) - at} are there")
        if not counts.any():  # rows of one length: nothing has to be walked
            record = np.dtype([(f"f{i}", order + p.kind) for i, p in enumerate(element.properties)])
            rows = np.frombuffer(data, record, element.rows, at) if least and element.rows else np.zeros(element.rows, record)
            yield element.name, _Table({p.name: rows[f"f{i}"] for i, p in enumerate(element.properties)}, {})
            at += element.rows * least
            continue
        starts, lengths, at = _walk_ply_rows(content, at, element.rows, sizes, counts, order == "<")
        if at < 0:
            raise ValueError(f"the file ends within its {element.rows} rows of {element.name}")
        single, lists = {}, {}
        for i, p in enumerate(element.properties):
            kind = np.dtype(order + p.kind)
            places = np.repeat(starts[:, i], lengths[:, i]) + kind.itemsize * _count_up(lengths[:, i])
            numbers = content[places[:, None] + np.arange(kind.itemsize)].copy().view(kind).reshape(-1)
            if p.count:
                lists[p.name] = (numbers, lengths[:, i])
            else:
                single[p.name] = numbers
        yield element.name, _Table(single, lists)


def _count_up(lengths: np.ndarray) -> np.ndarray:
    """0, 1, ... for each length, one after the other."""
    ends = np.cumsum(lengths)
    return np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - lengths, lengths)


@njit(cache=True)
def _walk_ply_rows(content, at, rows, sizes, counts, little):  # pragma: no cover - compiled
    """Where each property of each row begins, and how many numbers it has; the end of the last row, or -1 where the content ends before."""
    starts = np.zeros((rows, len(sizes)), np.int64)
    lengths = np.ones((rows, len(sizes)), np.int64)
    for row in range(rows):
        for i in range(len(sizes)):
            if counts[i]:
                if at + counts[i] > len(content):
                    return starts, lengths, -1
                count = 0
                for k in range(counts[i]):
                    place = counts[i] - 1 - k if little else k
                    count = count * 256 + content[at + place]
                at += counts[i]
                lengths[row, i] = count
            starts[row, i] = at
            if lengths[row, i] > (len(content) - at) // sizes[i]:
                return starts, lengths, -1
            at += lengths[row, i] * sizes[i]
    return starts, lengths, at


def _read_text(data: bytes, elements: list[_Element]) -> Iterator[tuple[str, _Table]]:
    numbers, at = read_numbers(data, float), 0
    for element in elements:
        have = len(element.properties)
        if element.rows * have > len(numbers) - at:
            raise ValueError(f"{element.rows} rows of {element.name} need {element.rows * have} numbers, {len(numbers) - at} are there")
        is_list = np.array([p.count is not None for p in element.properties], bool)
        starts, lengths, at = _walk_ply_words(numbers, at, element.rows, is_list)
        if at < 0:
            raise ValueError(f"the file ends within its {element.rows} rows of {element.name}")
        single, lists = {}, {}
        for i, p in enumerate(element.properties):
            found = numbers[np.repeat(starts[:, i], lengths[:, i]) + _count_up(lengths[:, i])]
            if p.count:
                if (found != np.round(found)).any() and p.name in LOOPS:
                    raise ValueError("corners that are no whole numbers")
                lists[p.name] = (found, lengths[:, i])
            else:
                single[p.name] = found
        yield element.name, _Table(single, lists)


@njit(cache=True)
def _walk_ply_words(numbers, at, rows, is_list):  # pragma: no cover - compiled
    """As `_walk_ply_rows`, in numbers that stand for themselves."""
    starts = np.zeros((rows, len(is_list)), np.int64)
    lengths = np.ones((rows, len(is_list)), np.int64)
    for row in range(rows):
        for i in range(len(is_list)):
            if is_list[i]:
                if at >= len(numbers) or not 0 <= numbers[at] < 1e9:
                    return starts, lengths, -1
                lengths[row, i] = int(numbers[at])
                at += 1
            starts[row, i] = at
            at += lengths[row, i]
            if at > len(numbers):
                return starts, lengths, -1
    return starts, lengths, at
