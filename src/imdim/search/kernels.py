"""Compiled inner loops of the search: the interval, and the box, with the largest sum of gains.

The gain of a candidate is the sum of a per-cell field over the cells that the candidate covers. Sums over intervals between
parallel planes are Kadane's maximum subarray (Bentley 1984); a box is that over the third axis for each pair of ranges of the
first two, so every box that the planes allow is examined without being listed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

PAIRWISE = 128  # values, that are added up eight abreast
TABLE = 1024  # even steps between the first and the last edge of slabs, and how many points pay for them


@njit(nogil=True, cache=True)
def best_interval(sums: np.ndarray) -> tuple[float, int, int]:
    """The largest sum of a run of `sums` [n], with its half-open bounds; the longest of equal runs to the left is kept."""
    best, lo, hi = -np.inf, 0, 1
    run, start = 0.0, 0
    for i in range(len(sums)):
        if run < 0.0 or i == 0:
            run, start = sums[i], i
        else:
            run += sums[i]
        if run > best:
            best, lo, hi = run, start, i + 1
    return best, lo, hi


@njit(nogil=True, cache=True)
def _step_at(edges: np.ndarray, steps: np.ndarray, x: float) -> float:
    """The value at `x` of what is `steps` [n] between `edges` [n + 1], and 0 beyond them."""
    if not edges[0] <= x <= edges[-1]:
        return 0.0
    low, high = 0, len(steps)
    while high - low > 1:
        middle = (low + high) // 2
        if edges[middle] <= x:
            low = middle
        else:
            high = middle
    return steps[low]


@njit(nogil=True, cache=True)
def add_box_density(total, points, axes, x_edges, x_steps, y_edges, y_steps, z_edges, z_steps) -> None:
    """Add to `total` [n] the density at `points` [n, 3] that is a product of steps along three `axes` [3, 3], in rows."""
    for i in range(len(points)):
        p = points[i]
        value = _step_at(x_edges, x_steps, p[0] * axes[0, 0] + p[1] * axes[0, 1] + p[2] * axes[0, 2])
        if value > 0.0:
            value *= _step_at(y_edges, y_steps, p[0] * axes[1, 0] + p[1] * axes[1, 1] + p[2] * axes[1, 2])
        if value > 0.0:
            value *= _step_at(z_edges, z_steps, p[0] * axes[2, 0] + p[1] * axes[2, 1] + p[2] * axes[2, 2])
        total[i] += value


@njit(nogil=True, cache=True)
def add_axial_density(total, points, origin, frame, radii, radial_steps, heights, height_steps) -> None:
    """Add to `total` [n] the density at `points` [n, 3] that is a product of steps in the distance from an axis, the third row of `frame`
    [3, 3] through `origin` [3], and along it from the world's origin, the same all about the axis."""
    farthest2 = radii[-1] * radii[-1]
    for i in range(len(points)):
        p = points[i]
        x, y, z = p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]
        u = x * frame[0, 0] + y * frame[0, 1] + z * frame[0, 2]
        v = x * frame[1, 0] + y * frame[1, 1] + z * frame[1, 2]
        if u * u + v * v > farthest2:  # as most points are from the axis of a hole
            continue
        value = _step_at(heights, height_steps, p[0] * frame[2, 0] + p[1] * frame[2, 1] + p[2] * frame[2, 2])
        if value > 0.0:
            rho = max(np.hypot(u, v), 1e-12)
            total[i] += value * _step_at(radii, radial_steps, rho) / (2 * np.pi * rho)


@njit(nogil=True, cache=True)
def slabs_of(edges: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The slab [n] between consecutive `edges` [e >= 2], sorted, that holds each of `at` [n], an edge being in the one before it; the first
    and the last slab hold what is beyond. A table of even steps says where to begin, which takes a fifth of the time of halving."""
    out = np.empty(len(at), np.int64)
    last = len(edges) - 2
    if len(at) < TABLE:
        for i in range(len(at)):
            out[i] = min(max(np.searchsorted(edges, at[i]) - 1, 0), last)
        return out
    low, steps = edges[0], TABLE / max(edges[-1] - edges[0], 1e-300)
    table = np.empty(TABLE + 1, np.int64)
    for k in range(TABLE + 1):
        # a step early, so that rounding passes no edge
        table[k] = max(np.searchsorted(edges, low + (k - 1) / steps) - 1, 0)
    for i in range(len(at)):
        slab = min(table[min(max(int((at[i] - low) * steps), 0), TABLE)], last)
        while slab < last and edges[slab + 1] < at[i]:
            slab += 1
        out[i] = slab
    return out


@njit(nogil=True, cache=True)
def mark_inside_cylinder(inside, points, origin, axis, radius) -> None:
    """Write to `inside` [n] which of `points` [n, 3] lie nearer than `radius` to the line through `origin` [3] along a unit `axis` [3]."""
    for i in range(len(points)):
        x, y, z = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
        h = x * axis[0] + y * axis[1] + z * axis[2]
        inside[i] = x * x + y * y + z * z - h * h < radius * radius


@njit(nogil=True, cache=True)
def group_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first index [g] of each distinct row of whole numbers [n, k] of 64 bits, in order, and the row's group [n]; by a table of hashes
    with open addresses (Knuth, volume 3, section 6.4)."""
    size = 64
    while size < 2 * len(rows):
        size *= 2
    table, mask = np.full(size, -1, np.int64), np.uint64(size - 1)
    first, group, count = np.empty(len(rows), np.int64), np.empty(len(rows), np.int64), 0
    for i in range(len(rows)):
        h = np.uint64(0xCBF29CE484222325)
        for k in range(rows.shape[1]):
            h = (h ^ rows[i, k]) * np.uint64(0x9E3779B97F4A7C15)
            h ^= h >> np.uint64(32)
        # rows may differ in their highest byte alone, which one product brings nowhere else
        h *= np.uint64(0x9E3779B97F4A7C15)
        h ^= h >> np.uint64(29)
        at = h & mask
        while table[at] >= 0 and _order_rows(rows, first[table[at]], rows, i) != 0:
            at = (at + np.uint64(1)) & mask
        if table[at] < 0:
            table[at] = count
            first[count] = i
            count += 1
        group[i] = table[at]
    return first[:count].copy(), group


@njit(nogil=True, cache=True)
def merge_rows(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As `group_rows` for the rows of `a` [m, k] and then those of `b` [n, k], each distinct and in order; so are the groups."""
    first, group, count = np.empty(len(a) + len(b), np.int64), np.empty(len(a) + len(b), np.int64), 0
    i, j = 0, 0
    while i < len(a) or j < len(b):
        order = 1 if i == len(a) else -1 if j == len(b) else _order_rows(a, i, b, j)
        first[count] = i if order <= 0 else len(a) + j
        if order <= 0:
            group[i] = count
            i += 1
        if order >= 0:
            group[len(a) + j] = count
            j += 1
        count += 1
    return first[:count].copy(), group


@njit(nogil=True, cache=True)
def _order_rows(a, i, b, j):
    """-1 where row `i` of `a` [m, k] comes before row `j` of `b` [n, k], 0 where they are equal, else 1."""
    for k in range(a.shape[1]):
        if a[i, k] != b[j, k]:
            return -1 if a[i, k] < b[j, k] else 1
    return 0


@njit(nogil=True, cache=True)
def add_to_slots(sums: np.ndarray, slots: np.ndarray, cells: np.ndarray, values: np.ndarray) -> None:
    """Add to `sums` [s] the `values` [k] in the slots of `cells` [k], of all whose `slots` [m]."""
    for i in range(len(cells)):
        sums[slots[cells[i]]] += values[i]


@njit(nogil=True, cache=True)
def add_to_some_slots(sums: np.ndarray, starts: np.ndarray, slots: np.ndarray, cells: np.ndarray, values: np.ndarray) -> None:
    """As `add_to_slots`, where cell c is in the slots `slots[starts[c]:starts[c+1]]`."""
    for i in range(len(cells)):
        for k in range(starts[cells[i]], starts[cells[i] + 1]):
            sums[slots[k]] += values[i]


@njit(nogil=True, cache=True)
def axial_best(sums: np.ndarray, ends: np.ndarray, out: np.ndarray) -> None:
    """Best interval of each axial family by the sums over the slabs along its axis, sums[ends[f] : ends[f + 1]].

    Writes (sum, lo, hi) into out [f, 3].
    """
    for f in range(len(ends) - 1):
        out[f, 0], out[f, 1], out[f, 2] = best_interval(sums[ends[f] : ends[f + 1]])


@njit(nogil=True, cache=True)
def best_box(sums: np.ndarray, places: np.ndarray, shape: tuple[int, int, int], sign: float, floor: float, out: np.ndarray) -> float:
    """The box that wins most by `sign` times the grid of `merge_slabs`, into out [7] as (sum, i, j, k, l, m, n) if it is above `floor`,
    else a sum of -inf; what no box is above."""
    out[0] = -np.inf
    most = 0.0
    for k in range(len(sums)):
        most += max(sign * sums[k], 0.0)
    if most <= floor:
        return most
    grid, first_a, first_b, first_c = merge_slabs(sign * sums, places, shape)
    na, nb, nc = grid.shape
    # fewest slabs first is cheapest
    a, b, c = 8 * na, 8 * nb + 1, 8 * nc + 2
    order = np.empty(3, np.int64)
    order[int(a > b) + int(a > c)], order[int(b > a) + int(b > c)], order[int(c > a) + int(c > b)] = 0, 1, 2
    turned = np.empty((grid.shape[order[0]], grid.shape[order[1]], grid.shape[order[2]]))
    at = np.empty(3, np.int64)
    for i in range(turned.shape[0]):
        at[order[0]] = i
        for k in range(turned.shape[1]):
            at[order[1]] = k
            for c in range(turned.shape[2]):
                at[order[2]] = c
                turned[i, k, c] = grid[at[0], at[1], at[2]]
    table = np.empty((len(turned) * (len(turned) + 1) // 2, 7))
    one = min(len(out), 1)  # for a 1 that is written here the compiler would make a second kernel
    box_best(turned, floor, one, table)
    row = table[table[:, 0].argmax()]
    if not row[0] > floor:
        return floor
    out[0] = row[0]
    for position in range(3):
        axis = order[position]
        first = first_a if axis == 0 else first_b if axis == 1 else first_c
        out[1 + 2 * axis], out[2 + 2 * axis] = first[int(row[1 + 2 * position])], first[int(row[2 + 2 * position])]
    return out[0]


@njit(nogil=True, cache=True)
def merge_slabs(sums: np.ndarray, places: np.ndarray, shape: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The grid of this `shape` that has `sums` [s] at `places` [s, 3] and nothing elsewhere, with adjoining slabs that win nothing anywhere
    summed into one along each axis, and where the new slabs begin.

    The box with the largest sum neither begins nor ends in a slab without a positive cell, so that it can still be told, by the
    beginnings [a' + 1], [b' + 1], [c' + 1], each with the old length at its end.
    """
    wins_a, wins_b, wins_c = np.zeros(shape[0], np.bool_), np.zeros(shape[1], np.bool_), np.zeros(shape[2], np.bool_)
    for k in range(len(sums)):
        if sums[k] > 0.0:
            wins_a[places[k, 0]], wins_b[places[k, 1]], wins_c[places[k, 2]] = True, True, True
    group_a, first_a = _runs(wins_a)
    group_b, first_b = _runs(wins_b)
    group_c, first_c = _runs(wins_c)
    out = np.zeros((len(first_a) - 1, len(first_b) - 1, len(first_c) - 1))
    for k in range(len(sums)):
        out[group_a[places[k, 0]], group_b[places[k, 1]], group_c[places[k, 2]]] += sums[k]
    return out, first_a, first_b, first_c


@njit(nogil=True, cache=True)
def _runs(wins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The group [n] of each slab, one for each that wins and one for each run that does not, and the first slab of each group."""
    group = np.zeros(len(wins), np.int64)
    for i in range(1, len(wins)):
        group[i] = group[i - 1] + (1 if wins[i] or wins[i - 1] else 0)
    first = np.full(group[-1] + 2, len(wins), np.int64)
    for i in range(len(wins) - 1, -1, -1):
        first[group[i]] = i
    return group, first


@njit(nogil=True, cache=True)
def _most_of_rows(slab: np.ndarray, most: np.ndarray) -> float:
    """What any run of each row of `slab` [b, c] wins at most into `most` [b], nothing at least; returns the sum, which no rectangle is
    above, or that of the columns if it is less."""
    rows = 0.0
    for k in range(len(slab)):
        best, run = 0.0, 0.0
        for c in range(slab.shape[1]):
            run = max(run, 0.0) + slab[k, c]
            best = max(best, run)
        most[k] = best
        rows += best
    columns = 0.0
    for c in range(slab.shape[1]):
        best, run = 0.0, 0.0
        for k in range(len(slab)):
            run = max(run, 0.0) + slab[k, c]
            best = max(best, run)
        columns += best
    return min(rows, columns)


@njit(nogil=True, cache=True)
def _best_of_slab(slab: np.ndarray, most: np.ndarray, line: np.ndarray, floor: float, row: np.ndarray) -> float:
    """The largest sum of a rectangle of `slab` [b, c], if above `floor`, else -inf; writes its bounds into row[3:7].

    `most` [b] is what any run of a row wins, `line` [c] is scratch.
    """
    top, least, rest = -np.inf, floor, most.sum()
    for k in range(len(slab)):
        if rest <= least:
            break
        # a rectangle that begins or ends with a row that wins nothing is not better than without it
        if most[k] > 0.0:
            line[:] = 0.0
            bound, behind = 0.0, rest
            for m in range(k, len(slab)):
                bound += most[m]
                behind -= most[m]
                if bound <= least or most[m] == 0.0:
                    line += slab[m]
                    continue
                # best_interval, run while the line is summed
                run, start, best = 0.0, 0, -np.inf
                for c in range(len(line)):
                    line[c] += slab[m, c]
                    if run < 0.0 or c == 0:
                        run, start = line[c], c
                    else:
                        run += line[c]
                    if run > best:
                        best = run
                        if run > least:
                            top = run
                            least = run
                            row[3], row[4], row[5], row[6] = k, m + 1, start, c + 1
                bound = min(bound, max(best, 0.0))
                if best + behind <= least:
                    break
        rest -= most[k]
    return top


@njit(nogil=True, cache=True)
def box_best(grid: np.ndarray, floor: float, count: int, out: np.ndarray) -> None:
    """Best box of `grid` [a, b, c] for each range of the first axis, where it is above `floor` and may be among the `count` best ranges.

    Writes (sum, i, j, k, l, m, n) into out [a(a+1)/2, 7]: the box is grid[i:j, k:l, m:n]; the sum is -inf where no box is above the floor,
    which follows the best sums so far. Runs of rows and of columns bound the boxes, so most are never summed.
    """
    na, nb, nc = grid.shape
    out[:, 0] = -np.inf
    slab, line, most = np.empty((nb, nc)), np.empty(nc), np.empty(nb)
    layers, best = np.empty(na), np.full(count, floor)
    for i in range(na):
        layers[i] = _most_of_rows(grid[i], most)
    rest = layers.sum()
    for i in range(na):
        if rest <= floor:
            break
        # a box that begins or ends with a layer that wins nothing is not better than without it
        if layers[i] > 0.0:
            slab[:] = 0.0
            bound, behind = 0.0, rest
            for j in range(i, na):
                slab += grid[j]
                bound += layers[j]
                behind -= layers[j]
                if layers[j] == 0.0 or bound <= floor:
                    continue
                bound = min(bound, _most_of_rows(slab, most))
                if bound > floor:
                    row = i * na - i * (i - 1) // 2 + j - i
                    top = _best_of_slab(slab, most, line, floor, out[row])
                    out[row, 0], out[row, 1], out[row, 2] = top, i, j + 1
                    if top > floor:
                        best[best.argmin()] = top
                        bound = top
                        floor = best.min()
                    else:
                        bound = min(bound, floor)
                if bound + behind <= floor:
                    break
        rest -= layers[i]


@njit(nogil=True, cache=True)
def sum_where(values, flags, wanted):
    """The sum of those `values` [m] whose flags [m] are as `wanted`, pairwise as numpy adds them up (Higham 1993), to the same bits."""
    chosen, count = np.empty(len(values) + 1), 0
    for i in range(len(values)):
        chosen[count] = values[i]
        count += flags[i] == wanted
    return _sum_pairwise(chosen[:count])


@njit(nogil=True, cache=True)
def _sum_pairwise(values):
    """Halves are added up each by itself, and where there are few, eight abreast; without recursion, which numba's cache does not bear."""
    rest, counts, sums, is_left = np.empty(64, np.int64), np.empty(64, np.int64), np.empty(64), np.empty(64, np.bool_)
    first, count, depth = 0, len(values), 0
    while True:
        while count > PAIRWISE:
            half = count // 2 // 8 * 8
            rest[depth], counts[depth], is_left[depth] = first + half, count - half, True
            count, depth = half, depth + 1
        total = _sum_abreast(values[first : first + count])
        while depth and not is_left[depth - 1]:
            depth -= 1
            total = sums[depth] + total
        if not depth:
            return total
        sums[depth - 1], is_left[depth - 1] = total, False
        first, count = rest[depth - 1], counts[depth - 1]


@njit(nogil=True, cache=True)
def _sum_abreast(values):
    total, whole = 0.0, len(values) // 8 * 8
    if whole:
        a, b, c, d, e, f, g, h = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(0, whole, 8):
            a, b, c, d = a + values[i], b + values[i + 1], c + values[i + 2], d + values[i + 3]
            e, f, g, h = e + values[i + 4], f + values[i + 5], g + values[i + 6], h + values[i + 7]
        total = ((a + b) + (c + d)) + ((e + f) + (g + h))
    for i in range(whole, len(values)):
        total += values[i]
    return total


@njit(nogil=True, cache=True)
def pick_flags(which: np.ndarray, flags: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The `flags` [m] where `which` [m] says so, elsewhere the `others` [m]."""
    out = np.empty(len(which), np.bool_)
    for i in range(len(which)):
        out[i] = (which[i] & flags[i]) | (which[i] < others[i])
    return out
