"""Compiled loops of population scoring: a single-precision leaf table, and the folds of many trees over its rows in one call.

`geometry/kernels.py` says what the leaf table holds; here it is in single precision without regard to NaN, which lets the compiler
use the widest registers, and rows are kept between calls, so that a child costs only the leaves that its parents lack. Occupancy is
packed, 64 points to a word: a boolean operation on 64 points is one instruction.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from imdim.program.tree import SIMPLE

BOX, SPHERE, CYLINDER, CONE, TORUS, ELLIPSOID = range(len(SIMPLE))
BLOCK = 512  # points folded at a time: the stack of a tree stays in the fastest cache
F = np.float32
ZERO, HALF, ONE, TINY = F(0), F(0.5), F(1), F(1e-20)


@njit(nogil=True, fastmath=True)
def _value(kind, a, b, c, x, y, z):
    if kind == BOX:
        ax, ay, az = abs(x) - a * HALF, abs(y) - b * HALF, abs(z) - c * HALF
        ox, oy, oz = max(ax, ZERO), max(ay, ZERO), max(az, ZERO)
        return math.sqrt(ox * ox + oy * oy + oz * oz) + min(max(ax, max(ay, az)), ZERO)
    if kind == SPHERE:
        return math.sqrt(x * x + y * y + z * z) - a
    if kind == ELLIPSOID:
        u, v, w = x / a, y / b, z / c
        k0 = math.sqrt(u * u + v * v + w * w)
        u, v, w = u / a, v / b, w / c
        k1 = math.sqrt(u * u + v * v + w * w)
        return max(k0 * (k0 - ONE) / max(k1, TINY), -min(a, min(b, c)))
    rho = math.sqrt(x * x + y * y)
    if kind == CYLINDER:
        side, cap = rho - a, abs(z) - b * HALF
        outer, upper = max(side, ZERO), max(cap, ZERO)
        return math.sqrt(outer * outer + upper * upper) + min(max(side, cap), ZERO)
    if kind == TORUS:
        return math.sqrt((rho - a) * (rho - a) + z * z) - b
    er, wr, wz, cap = b - a, rho - a, z + c * HALF, abs(z) - c * HALF
    length2 = er * er + c * c
    within = max((wr * c - wz * er) / math.sqrt(length2), cap)
    t = min(max((wr * er + wz * c) / length2, ZERO), ONE)
    vr, vz, beside = wr - t * er, wz - t * c, max(rho - (a if z < ZERO else b), ZERO)
    outer = math.sqrt(min(beside * beside + cap * cap, vr * vr + vz * vz))
    return outer if within > ZERO else within


def _row_of(kind):
    """The loop over points for one kind: a loop that branches on the kind is not vectorised.

    Each has a name of its own: what one process has compiled and another one loads from the cache is joined by names and running numbers,
    and the numbers differ from process to process, so that alike names could stand for different loops.
    """

    def row(a, b, c, cx, cy, cz, r00, r10, r20, r01, r11, r21, r02, r12, r22, xs, ys, zs, out):
        for j in range(len(out)):
            x, y, z = xs[j] - cx, ys[j] - cy, zs[j] - cz
            u, v, w = r00 * x + r10 * y + r20 * z, r01 * x + r11 * y + r21 * z, r02 * x + r12 * y + r22 * z
            out[j] = _value(kind, a, b, c, u, v, w)

    row.__qualname__ = f"row_of_{SIMPLE[kind]}"
    return njit(nogil=True, fastmath=True)(row)


_box_row, _sphere_row, _cylinder_row, _cone_row, _torus_row, _ellipsoid_row = (_row_of(kind) for kind in range(len(SIMPLE)))


@njit(nogil=True)
def _fill_row(kind, leaf, xs, ys, zs, out):
    # unpacked here: loads from an array inside of the loop's function keep it from being vectorised
    a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz = leaf
    if kind == BOX:
        _box_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)
    elif kind == SPHERE:
        _sphere_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)
    elif kind == CYLINDER:
        _cylinder_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)
    elif kind == CONE:
        _cone_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)
    elif kind == TORUS:
        _torus_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)
    else:
        _ellipsoid_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)


@njit(nogil=True, cache=True)
def fill_distances(kinds, leaves, xyz, rows, out):
    """Signed distances of `xyz` [3, n] float32 to the leaves, into `out` [*, n] float32 at `rows` [k].

    `leaves` [k, 15] float32 holds sizes, centre and the three local axes in world coordinates.
    """
    for i in range(len(kinds)):
        _fill_row(kinds[i], leaves[i], xyz[0], xyz[1], xyz[2], out[rows[i]])


@njit(nogil=True, cache=True)
def fill_bits(kinds, leaves, xyz, rows, out):
    """Whether each of `xyz` [3, n] float32, n a multiple of 64, lies inside of each leaf, into `out` [*, n / 64] uint64 at `rows` [k]."""
    line = np.empty(xyz.shape[1], np.float32)
    for i in range(len(kinds)):
        _fill_row(kinds[i], leaves[i], xyz[0], xyz[1], xyz[2], line)
        for w in range(out.shape[1]):
            word = np.uint64(0)
            for j in range(64):
                word |= np.uint64(line[64 * w + j] < ZERO) << np.uint64(j)
            out[rows[i], w] = word


@njit(nogil=True, cache=True, fastmath=True)
def _join(op, left, right, n):
    # `n` is an argument: arrays cut to it would be made anew for each operation, which takes longer than the loop
    if op == -1:
        for j in range(n):
            left[j] = min(left[j], right[j])
    elif op == -2:
        for j in range(n):
            left[j] = max(left[j], right[j])
    else:
        for j in range(n):
            left[j] = max(left[j], -right[j])


@njit(nogil=True, cache=True, fastmath=True)
def _copy_row(left, right, n):
    for j in range(n):
        left[j] = right[j]


@njit(nogil=True, cache=True, fastmath=True)
def _reduce(code, table, start, stop, stack):
    """The values of one tree on columns start:stop of `table`, left in stack[0]."""
    top, n, i = -1, stop - start, 0
    while i < len(code):
        op = code[i]
        if op < 0:
            top -= 1
            _join(op, stack[top], stack[top + 1], n)
        elif i + 1 < len(code) and code[i + 1] < 0:
            i += 1  # a leaf that is joined at once is not copied before
            _join(code[i], stack[top], table[op, start:stop], n)
        else:
            top += 1
            _copy_row(stack[top], table[op, start:stop], n)
        i += 1


@njit(nogil=True, cache=True, fastmath=True)
def mean_distances(code, starts, depth, table, cap):
    """Mean over the columns of `table` [*, n] of min(|value|, cap) of each tree: tree t is code[starts[t]:starts[t + 1]]."""
    out, n = np.empty(len(starts) - 1), table.shape[1]
    stack = np.empty((depth, BLOCK), np.float32)
    for t in range(len(out)):
        total = 0.0
        for start in range(0, n, BLOCK):
            stop = min(start + BLOCK, n)
            _reduce(code[starts[t] : starts[t + 1]], table, start, stop, stack)
            part = ZERO
            for j in range(stop - start):
                part += min(abs(stack[0, j]), cap)
            total += part
        out[t] = total / max(n, 1)
    return out


@njit(nogil=True, cache=True)
def _join_words(op, left, right):
    for j in range(len(left)):
        left[j] = left[j] | right[j] if op == -1 else left[j] & (right[j] if op == -2 else ~right[j])


@njit(nogil=True, cache=True)
def _copy_words(to, words):
    for w in range(len(words)):
        to[w] = words[w]


@njit(nogil=True, cache=True)
def states(code, starts, depth, table, out):
    """The words [t, w] that each tree fills, from those of its leaves in `table` [*, w]; into `out`."""
    stack = np.empty((depth, table.shape[1]), np.uint64)
    for t in range(len(starts) - 1):
        top, i, end = -1, starts[t], starts[t + 1]
        while i < end:
            op = code[i]
            if op < 0:
                top -= 1
                _join_words(op, stack[top], stack[top + 1])
            elif i + 1 < end and code[i + 1] < 0:
                i += 1
                _join_words(code[i], stack[top], table[op])
            else:
                top += 1
                _copy_words(stack[top], table[op])
            i += 1
        _copy_words(out[t], stack[0])


@njit(nogil=True, cache=True)
def wrong_weight(filled, label, weight):
    """Sum of `weight` [64 w] float64 over the bits in which each of `filled` [t, w] differs from `label` [w]."""
    out = np.zeros(len(filled))
    for t in range(len(filled)):
        total = 0.0
        for w in range(len(label)):
            word = filled[t, w] ^ label[w]
            j = 64 * w
            while word:
                if word & np.uint64(1):
                    total += weight[j]
                word >>= np.uint64(1)
                j += 1
        out[t] = total
    return out
