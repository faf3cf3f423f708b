"""Compiled loops of the best region: curves counted wall by wall, faces tried, maximum flow (Dinic 1970), regions that touch themselves.

A region is flags [f + 1] of the faces; the last stands for what lies outside of the window, and is never in. Of n faces the flow's source
is node n and its sink n + 1. All of them stay in this one file: numba's on-disk cache does not notice a change in an imported one. A flag
that they pass is no literal (`np.bool_(True)`): numba compiles a function once for each literal.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

CUTS = 4  # minimum cuts for one region, at most
MOVES = 24  # of whole curves
FLIPS = 3  # rounds over all faces
MENDS = 32  # faces, by which a region that touches itself is changed at most
NO_FLOW = 1e-9  # of the gains' sum: an arc with less room is full
WINS = 1e-12  # what a change must win at least
EVEN = 1e-12  # of the largest bound, that tells apart what is even
SHORT = 1e-300  # no length, yet more than none
LEFT, RIGHT, NEITHER = 1, -1, 0
PAIRS = 3  # of levels between which the region is looked for, at most


class Graph(NamedTuple):
    """Segments in order, those of a wall together.

    `starts` [w + 1] of each wall, whether its curves are `free` [w]; of each segment the `wall` [s], the `nodes` [s, 2], the `faces` [s, 2]
    and the `length` [s]; `ends` [f + 2] and `segments` list the segments about each face. `sides` [s], where there are any, say on which
    side of a segment what it bounds may lie: LEFT, RIGHT or NEITHER.
    """

    starts: np.ndarray
    free: np.ndarray
    wall: np.ndarray
    nodes: np.ndarray
    faces: np.ndarray
    length: np.ndarray
    ends: np.ndarray
    segments: np.ndarray
    sides: np.ndarray


@njit(nogil=True, cache=True)
def sum_below(sums, faces, levels, sign):
    """`sign` times the sums of each face below each level [f, levels], from those of its slots, one for each level: of what lies
    right below it."""
    below = (sign * sums[: faces * levels]).reshape(faces, levels)
    for f in range(faces):
        for k in range(1, levels):
            below[f, k] += below[f, k - 1]
    return below


@njit(nogil=True, cache=True)
def add_won(sums, count, sign):
    """What the first `count` slots win that win something: four sums side by side, since one has to wait for itself."""
    a, b, c, d, whole = 0.0, 0.0, 0.0, 0.0, count // 4 * 4
    for k in range(0, whole, 4):
        a += max(sign * sums[k], 0.0)
        b += max(sign * sums[k + 1], 0.0)
        c += max(sign * sums[k + 2], 0.0)
        d += max(sign * sums[k + 3], 0.0)
    for k in range(whole, count):
        a += max(sign * sums[k], 0.0)
    return (a + b) + (c + d)


@njit(nogil=True, cache=True)
def likeliest_levels(sums, faces, levels, sign, floor):
    """The pairs of levels (lower, upper, bound) [p, 3] between which an outline may win most, by the sum of what the faces win there that
    win something by `sign` times the sums over their slots, best first; of even ones the farthest apart: what cuts ends beyond the part.
    Nothing where no bound is above `floor`. And the largest bound."""
    bounds, row = np.zeros((levels, levels)), np.empty(levels)
    for f in range(faces):
        total, some = 0.0, False
        for k in range(levels):
            some |= sums[f * levels + k] != 0.0
            total += sign * sums[f * levels + k]
            row[k] = total
        if not some:
            continue
        for lo in range(levels - 1):
            base = row[lo]
            for hi in range(lo + 1, levels):  # without a branch, so that the compiler takes several at once
                bounds[lo, hi] += max(row[hi] - base, 0.0)
    largest, out = bounds.max(), np.zeros((PAIRS, 3))
    if largest <= floor:
        return out[:0], largest
    for lo in range(levels - 1):
        for hi in range(lo + 1, levels):
            bound = bounds[lo, hi]
            if bound > 0:
                bound += EVEN * largest * (hi - lo)
            place = PAIRS
            while place > 0 and bound > out[place - 1, 2]:
                place -= 1
            for k in range(PAIRS - 1, place, -1):
                for column in range(3):
                    out[k, column] = out[k - 1, column]
            if place < PAIRS:
                out[place, 0], out[place, 1], out[place, 2] = lo, hi, bound
    return out, largest


@njit(nogil=True, cache=True)
def offer_outlines(graph, sums, faces, levels, sign, floor, price, paid):
    """The outlines of a plane that win most by `sign` times the sums over its slots, at most two, best first: (what none is above, offers,
    lower level, upper level, what each wins [2], the faces of each [2, f]). A curve costs its `price`, where `paid` (so many that are free,
    least that is charged)."""
    wins, offers = np.zeros(2), np.zeros((2, faces), np.bool_)
    most = add_won(sums, faces * levels, sign)
    if most <= floor:
        return most, 0, 0, 0, wins, offers
    pairs, most = likeliest_levels(sums, faces, levels, sign, floor)
    if not len(pairs):
        return most, 0, 0, 0, wins, offers
    below = sum_below(sums, faces, levels, sign)
    low, high, least = -1, -1, floor
    for k in range(len(pairs)):
        if pairs[k, 2] <= least:
            break
        lo, hi = int(pairs[k, 0]), int(pairs[k, 1])
        won, inside = _price_region(graph, below[:, hi] - below[:, lo], price, paid, np.bool_(False))
        if won > least:
            least, low, high = won, lo, hi
            _fill_offer(wins, offers, 0, won, inside)
    if low < 0:
        return min(most, floor), 0, 0, 0, wins, offers
    won, inside = _price_region(graph, below[:, high] - below[:, low], price, paid, np.bool_(True))
    if won <= wins[0]:
        return most, 1, low, high, wins, offers
    _fill_offer(wins, offers, 1, wins[0], offers[0])
    _fill_offer(wins, offers, 0, won, inside)
    return most, 2, low, high, wins, offers


@njit(nogil=True, cache=True)
def _fill_offer(wins, offers, row, won, inside):
    wins[row] = won
    for f in range(offers.shape[1]):
        offers[row, f] = inside[f]


@njit(nogil=True, cache=True)
def _price_region(graph, gains, price, paid, thorough):
    """What the best region wins by `gains` [f] less what its curves cost, -inf where there is none, and the region [f + 1]."""
    inside, won = find_region(graph, gains, price, thorough)
    if len(graph.sides):
        inside = _keep_sides(graph, gains, inside)
    if won <= 0 or not mend_region(graph, gains, inside):
        return -np.inf, inside
    return _sum_inside(inside, gains) - price * max(count_runs(graph, inside) - paid[0], paid[1]), inside


@njit(nogil=True, cache=True)
def _keep_sides(graph, gains, inside):
    """The region with all faces more that it takes, or else less, for it to lie on the right side of all its boundary: of both that which
    wins more."""
    best, most = np.zeros(len(inside), np.bool_), -np.inf
    for adds in (True, False):
        region = inside.copy()
        if _close_region(graph, region, adds):
            won = _sum_inside(region, gains)
            if won > most:
                best, most = region, won
    return best


@njit(nogil=True, cache=True)
def _close_region(graph, region, adds):
    """Add faces to a region, or take some away, until it lies on the right side of all its boundary; whether that ends."""
    outside, changed = len(region) - 1, True
    while changed:
        changed = False
        for s in range(len(graph.length)):
            left, right, side = graph.faces[s, 0], graph.faces[s, 1], graph.sides[s]
            if region[left] == region[right] or side == (LEFT if region[left] else RIGHT):
                continue
            within, beyond = (left, right) if region[left] else (right, left)
            if adds and beyond == outside:
                return False
            region[beyond if adds else within] = adds
            changed = True
    return True


@njit(nogil=True, cache=True)
def find_region(graph, gains, price, thorough):
    """The region that wins most by `gains` [f] and a `price` for a curve, among those tried, and what it wins.

    Tried are the faces that win something by themselves, and cuts under the curves' prices, again and again; `thorough` changes each by
    single faces and whole curves, and begins from the best face too.
    """
    n = len(gains)
    inside, best, value = np.zeros(n + 1, np.bool_), np.zeros(n + 1, np.bool_), 0.0
    side, share, curves = np.zeros(len(graph.length), np.int8), np.empty(len(graph.length)), np.zeros(len(graph.free), np.int64)
    for start in range(2 if thorough else 1):
        for f in range(n):
            inside[f] = start == 0 and gains[f] > 0
        if start:
            inside[gains.argmax()] = True
        for _ in range(CUTS):
            if not inside.any():
                break
            _find_sides(graph, inside, side)
            _share_curves(graph, side, share, curves)
            if thorough:
                _flip_faces(graph, gains, price, inside, side, curves)
                _move_curves(graph, gains, price, inside, side, curves)
                _share_curves(graph, side, share, curves)
            won = _sum_inside(inside, gains) - price * curves.sum()
            if won > value:
                value = won
                for f in range(n):
                    best[f] = inside[f]
            after = _cut(graph, gains, price * share)
            changed = False
            for f in range(n):
                changed = changed or after[f] != inside[f]
                inside[f] = after[f]
            if not changed:
                break
    return best, value


@njit(nogil=True, cache=True)
def count_runs(graph, inside):
    """The number of lines and arcs that bound a region, a full circle counted as one."""
    side, share, curves = np.empty(len(graph.length), np.int8), np.empty(len(graph.length)), np.empty(len(graph.free), np.int64)
    _find_sides(graph, inside, side)
    _share_curves(graph, side, share, curves)
    return curves.sum()


@njit(nogil=True, cache=True)
def mend_region(graph, gains, inside):
    """Change a region by its cheapest faces until its boundary passes no node twice; whether that ends, and leaves anything."""
    times = np.zeros(graph.nodes.max() + 1, np.int64)
    for _ in range(MENDS):
        node = _pinched(graph, inside, times)
        if node < 0:
            return inside.any()
        face, least = -1, np.inf
        for s in range(len(graph.length)):
            if graph.nodes[s, 0] == node or graph.nodes[s, 1] == node:
                for f in graph.faces[s]:
                    if f < len(gains):
                        loss = gains[f] if inside[f] else -gains[f]
                        if loss < least or (loss == least and f < face):
                            face, least = f, loss
        inside[face] = not inside[face]
    return False


@njit(nogil=True, cache=True)
def _pinched(graph, inside, times):
    """The first of the nodes that the boundary passes most often, -1 where it passes each once."""
    times[:] = 0
    for s in range(len(graph.length)):
        left, right = inside[graph.faces[s, 0]], inside[graph.faces[s, 1]]
        if left != right:
            times[graph.nodes[s, 0 if left else 1]] += 1
    node = times.argmax()
    return node if times[node] > 1 else -1


@njit(nogil=True, cache=True)
def _find_sides(graph, inside, side):
    """Into `side` [s] 1 where the region lies on the left of a segment alone, -1 where on its right alone, else 0."""
    for s in range(len(side)):
        side[s] = np.int8(inside[graph.faces[s, 0]]) - np.int8(inside[graph.faces[s, 1]])


@njit(nogil=True, cache=True)
def _sum_inside(inside, gains):
    total = 0.0
    for f in range(len(gains)):
        if inside[f]:
            total += gains[f]
    return total


@njit(nogil=True, cache=True)
def _flip_faces(graph, gains, price, inside, side, curves):
    """Put single faces in and out, as long as that wins."""
    which = np.empty(1, np.int64)
    touched, marked = np.empty((len(graph.free), 2), np.int64), np.zeros(len(graph.free), np.bool_)
    changed, rounds = True, 0
    while changed and rounds < FLIPS:
        changed = False
        rounds += 1
        for f in range(len(gains)):
            change = -gains[f] if inside[f] else gains[f]
            if change <= -4 * price:  # a face rarely has more than four curves of its own
                continue
            which[0] = f
            if _try_faces(graph, gains, price, inside, side, curves, which, not inside[f], touched, marked):
                changed = True


@njit(nogil=True, cache=True)
def _move_curves(graph, gains, price, inside, side, curves):
    """Move whole curves in or out by the faces beside them, as long as that wins."""
    touched, marked = np.empty((len(graph.free), 2), np.int64), np.zeros(len(graph.free), np.bool_)
    beside = np.empty(len(side), np.int64)
    for _ in range(MOVES):
        moved, i = False, 0
        while i < len(side) and not moved:
            if side[i] == 0:
                i += 1
                continue
            j = _run_end(graph, side, i)
            for column in range(2):
                count = 0
                for s in range(i, j):
                    if graph.faces[s, column] < len(gains):
                        beside[count] = graph.faces[s, column]
                        count += 1
                put_in = side[i] != (1 if column == 0 else -1)
                moved = moved or _try_faces(graph, gains, price, inside, side, curves, beside[:count], put_in, touched, marked)
            i = j
        if not moved:
            return


@njit(nogil=True, cache=True)
def _try_faces(graph, gains, price, inside, side, curves, which, put_in, touched, marked):
    """Put faces `which` in or out of the region if that wins; whether it did. Curves are counted again on the walls about them alone.

    `touched` [w, 2] and `marked` [w], all False, are room to work in.
    """
    change, flipped, walls = 0.0, 0, 0
    for k in range(len(which)):
        f = which[k]
        if inside[f] == put_in:
            continue
        which[flipped] = f
        flipped += 1
        change += gains[f] if put_in else -gains[f]
        walls = _set_face(graph, inside, side, f, put_in, touched, marked, walls)
    more = 0
    for i in range(walls):
        w = touched[i, 0]
        marked[w] = False
        touched[i, 1] = 0 if graph.free[w] else _count_runs_of(graph, side, graph.starts[w], graph.starts[w + 1])
        more += touched[i, 1] - curves[w]
    if flipped and change - price * more > WINS:
        for i in range(walls):
            curves[touched[i, 0]] = touched[i, 1]
        return True
    for k in range(flipped):
        walls = _set_face(graph, inside, side, which[k], not put_in, touched, marked, 0)
        for i in range(walls):
            marked[touched[i, 0]] = False
    return False


@njit(nogil=True, cache=True)
def _set_face(graph, inside, side, f, put_in, touched, marked, walls):
    """Put a face in or out; its walls that are not `marked` yet are listed in `touched`, which then holds the number returned."""
    inside[f] = put_in
    for k in range(graph.ends[f], graph.ends[f + 1]):
        s = graph.segments[k]
        side[s] = np.int8(inside[graph.faces[s, 0]]) - np.int8(inside[graph.faces[s, 1]])
        w = graph.wall[s]
        if not marked[w]:
            marked[w] = True
            touched[walls, 0] = w
            walls += 1
    return walls


@njit(nogil=True, cache=True)
def _run_end(graph, side, i):
    """Where the run of segments ends that begins with `i`: they lie on one wall, one after the other, with the region on one side."""
    j = i + 1
    while j < len(side) and graph.wall[j] == graph.wall[i] and side[j] == side[i] and graph.nodes[j, 0] == graph.nodes[j - 1, 1]:
        j += 1
    return j


@njit(nogil=True, cache=True)
def _count_runs_of(graph, side, first, last):
    """The number of runs on the wall whose segments are `first` to `last`; the last run of a circle may go on in its first."""
    runs, i, closing = 0, first, False
    while i < last:
        if side[i] == 0:
            i += 1
            continue
        j = _run_end(graph, side, i)
        runs += 1
        closing = i > first and j == last
        i = j
    around = closing and side[first] == side[last - 1] and graph.nodes[last - 1, 1] == graph.nodes[first, 0]
    return runs - 1 if around else runs


@njit(nogil=True, cache=True)
def _share_curves(graph, side, share, curves):
    """The number of curves on each wall into `curves` [w], and into `share` [s] what part of its curve's price each segment bears.

    A segment off the boundary would be a new curve, or prolong one: it bears what its length is of both.
    """
    share[:] = 1.0
    for w in range(len(curves)):
        first, last = graph.starts[w], graph.starts[w + 1]
        curves[w] = 0 if graph.free[w] else _count_runs_of(graph, side, first, last)
        i = first
        while i < last:
            if side[i] == 0:
                i += 1
                continue
            j, total = _run_end(graph, side, i), SHORT  # walls that all but meet in a point have segments without length
            for k in range(i, j):
                total += graph.length[k]
            for k in range(i, j):
                share[k] = 0.0 if graph.free[w] else graph.length[k] / total
            if j < last and side[j] == 0 and graph.nodes[j, 0] == graph.nodes[j - 1, 1]:
                share[j] = graph.length[j] / (total + graph.length[j])
            if i > first and side[i - 1] == 0 and graph.nodes[i, 0] == graph.nodes[i - 1, 1]:
                share[i - 1] = min(share[i - 1], graph.length[i - 1] / (total + graph.length[i - 1]))
            i = j


@njit(nogil=True, cache=True)
def _cut(graph, gains, prices):
    """The faces [f] on the source's side of the minimum cut of gains under `prices` [s]; what lies outside is on the sink's."""
    n, m = len(gains), len(prices)
    arcs = m + np.count_nonzero(gains)
    tails, heads, ahead, back = np.empty(arcs, np.int64), np.empty(arcs, np.int64), np.empty(arcs), np.zeros(arcs)
    for s in range(m):
        f, g = graph.faces[s]
        tails[s], heads[s] = n + 1 if f == n else f, n + 1 if g == n else g
        ahead[s] = back[s] = prices[s]
    for f in range(n):
        if gains[f] != 0:
            tails[m], heads[m], ahead[m] = (n, f, gains[f]) if gains[f] > 0 else (f, n + 1, -gains[f])
            m += 1
    return _source_side(tails, heads, ahead, back, n, NO_FLOW * np.abs(gains).sum())


@njit(nogil=True, cache=True)
def _source_side(tails, heads, ahead, back, n, least):
    """The nodes [n] that the source n still reaches once a maximum flow to the sink n + 1 is found (Dinic 1970).

    Arc i runs from tails[i] to heads[i] with capacity ahead[i], and back with back[i]; below `least` an arc is full.
    """
    starts, arcs = _list_arcs(tails, heads, n + 2)
    to, room = np.empty(2 * len(tails), np.int64), np.empty(2 * len(tails))
    for i in range(len(tails)):
        to[2 * i], to[2 * i + 1], room[2 * i], room[2 * i + 1] = heads[i], tails[i], ahead[i], back[i]
    level, queue = np.empty(n + 2, np.int64), np.empty(n + 2, np.int64)
    while _find_levels(starts, arcs, to, room, n, level, queue, least):
        _fill_paths(starts, arcs, to, room, n, level, queue, least)
    return level[:n] >= 0


@njit(nogil=True, cache=True)
def _list_arcs(tails, heads, nodes):
    """Where the arcs of each node start [nodes + 1] in a list [2 m]; arc i leaves its tail as 2 i and its head as 2 i + 1."""
    degree = np.zeros(nodes + 1, np.int64)
    for i in range(len(tails)):
        degree[tails[i] + 1] += 1
        degree[heads[i] + 1] += 1
    starts = np.cumsum(degree)
    fill, arcs = starts[:-1].copy(), np.empty(2 * len(tails), np.int64)
    for i in range(len(tails)):
        arcs[fill[tails[i]]] = 2 * i
        fill[tails[i]] += 1
        arcs[fill[heads[i]]] = 2 * i + 1
        fill[heads[i]] += 1
    return starts, arcs


@njit(nogil=True, cache=True)
def _find_levels(starts, arcs, to, room, source, level, queue, least):
    """The arcs from the source to each node in `level`, -1 for one out of reach; whether the sink is within."""
    level[:] = -1
    level[source], queue[0], first, last = 0, source, 0, 1
    while first < last:
        u = queue[first]
        first += 1
        for k in range(starts[u], starts[u + 1]):
            v = to[arcs[k]]
            if level[v] < 0 and room[arcs[k]] > least:
                level[v], queue[last] = level[u] + 1, v
                last += 1
    return level[source + 1] >= 0


@njit(nogil=True, cache=True)
def _fill_paths(starts, arcs, to, room, source, level, path, least):
    """Fill paths along rising levels until none is left; `path` is room for one."""
    at = starts[:-1].copy()
    u, depth = source, 0
    while True:
        if u == source + 1:
            depth = _fill_path(room, path, depth)
            u = to[path[depth] ^ 1]
        arc = -1
        while at[u] < starts[u + 1]:
            arc = arcs[at[u]]
            if room[arc] > least and level[to[arc]] == level[u] + 1:
                break
            at[u] += 1
            arc = -1
        if arc >= 0:
            path[depth] = arc
            u, depth = to[arc], depth + 1
        elif u == source:
            return
        else:
            level[u] = -1
            depth -= 1
            u = to[path[depth] ^ 1]
            at[u] += 1


@njit(nogil=True, cache=True)
def _fill_path(room, path, depth):
    """Send what a path bears; the place of its first arc that is full then."""
    flow, cut = np.inf, 0
    for k in range(depth):
        if room[path[k]] < flow:
            flow, cut = room[path[k]], k
    for k in range(depth):
        room[path[k]] -= flow
        room[path[k] ^ 1] += flow
    return cut
