"""Point Cloud Library's PCD, version 0.7: a text header, then rows as text, as packed records, or as LZF-compressed columns."""

from __future__ import annotations

import io
import warnings

import numpy as np
from numba import njit

LZF_RATIO = 88  # at most: three bytes repeat 264


def read_pcd(data: bytes) -> tuple[np.ndarray, list[str], np.ndarray | None]:
    """The table [n, c] float64, its column names (normal_x is called nx), and the place [1, 3] from which it was scanned; None where that
    is the origin, which writers put there that know of none. Points marked missing by NaN are left out.

    Raises ValueError for a header or a body that does not fit.
    """
    header, start = _header(data)
    names, kinds = header["FIELDS"], _record(header)
    count, form = int(header["POINTS"][0]), header["DATA"][0]
    if form == "ascii":
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of no rows at all, which is said below
            table = np.loadtxt(io.BytesIO(data[start:]), ndmin=2)
        if table.shape[0] != count:
            raise ValueError(f"{table.shape[0]} rows where the header promises {count}")
        offsets = np.cumsum([0, *(int(c) for c in header.get("COUNT", ["1"] * len(names)))])[:-1]
        columns = [table[:, i] for i in offsets]
    elif form == "binary":
        rows = np.frombuffer(data, kinds, count, start)
        columns = [rows[name].reshape(count, -1)[:, 0] for name in kinds.names or ()]
    elif form == "binary_compressed":
        columns = _read_compressed(data[start:], kinds, count)
    else:
        raise ValueError(f"unknown DATA {form!r}")
    table = np.stack([c.astype(float) for c in columns], axis=1)
    names = [n.lower().replace("normal_", "n") for n in names]
    xyz = [names.index(n) for n in "xyz"]
    # organised clouds mark pixels without a return by NaN in all coordinates
    viewpoint = np.array([header.get("VIEWPOINT", ["0"] * 3)[:3]], float)
    return table[~np.isnan(table[:, xyz]).all(axis=1)], names, viewpoint if viewpoint.any() else None


def _header(data: bytes) -> tuple[dict[str, list[str]], int]:
    header: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in header:
        end = data.find(b"\n", start)
        if end < 0:
            raise ValueError("the header has no DATA line")
        key, *values = data[start:end].decode("ascii").split() or ["#"]
        header[key] = values
        start = end + 1
    return header, start


def _record(header: dict[str, list[str]]) -> np.dtype:
    counts = [int(c) for c in header.get("COUNT", ["1"] * len(header["FIELDS"]))]
    kinds = [f"<{ {'F': 'f', 'I': 'i', 'U': 'u'}[t] }{s}" for t, s in zip(header["TYPE"], header["SIZE"], strict=True)]
    # numpy refuses equal names, PCL's padding fields are all called "_"
    return np.dtype([(f"f{i}", kind, (n,)) for i, (kind, n) in enumerate(zip(kinds, counts, strict=True))])


def _read_compressed(body: bytes, kinds: np.dtype, count: int) -> list[np.ndarray]:
    packed, full = np.frombuffer(body, "<u4", 2)
    if full != kinds.itemsize * count or len(body) < 8 + packed:
        raise ValueError(f"{full} bytes of columns where {kinds.itemsize * count} are needed, {len(body) - 8} of {packed} bytes packed")
    if full > LZF_RATIO * packed:
        raise ValueError(f"{packed} bytes of an LZF stream do not unpack to {full}")
    plain = np.zeros(full, np.uint8)
    if _lzf(np.frombuffer(body, np.uint8, packed, 8), plain) != full:
        raise ValueError(f"the LZF stream does not unpack to {full} bytes")
    columns, at = [], 0
    for name in kinds.names or ():
        kind, shape = kinds[name].subdtype or (kinds[name], (1,))
        size = kind.itemsize * shape[0] * count
        columns.append(plain[at : at + size].view(kind).reshape(count, -1)[:, 0])
        at += size
    return columns


@njit(cache=True)
def _lzf(source, out):  # pragma: no cover - compiled
    """Unpack liblzf's stream; the number of bytes written, or -1 where it is broken."""
    i = o = 0
    while i < len(source):
        control = source[i]
        i += 1
        if control < 32:
            run = control + 1
            if i + run > len(source) or o + run > len(out):
                return -1
            out[o : o + run] = source[i : i + run]
            i += run
        else:
            run = control >> 5
            if i + (run == 7) >= len(source):
                return -1
            if run == 7:
                run += source[i]
                i += 1
            start = o - ((control & 31) << 8) - source[i] - 1
            i += 1
            run += 2
            if start < 0 or o + run > len(out):
                return -1
            for k in range(run):
                out[o + k] = out[start + k]
        o += run
    return o
