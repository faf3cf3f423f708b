"""A maximum flow from a source to a sink, whose other side is a minimum cut, as compiled loops (Dinic 1970).

Of n + 2 nodes the source is n and the sink n + 1.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(nogil=True, cache=True)
def source_side(tails, heads, ahead, back, n, least):
    """The nodes [n] that the source n still reaches once a maximum flow to the sink n + 1 is found (Dinic 1970).

    Arc i runs from tails[i] to heads[i] with capacity ahead[i], and back with back[i]; below `least` an arc is full.
    """
    starts, arcs = _list_arcs(tails, heads, n + 2)
    to, room = np.empty(2 * len(tails), np.int64), np.empty(2 * len(tails))
    to[::2], to[1::2], room[::2], room[1::2] = heads, tails, ahead, back
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
            depth = _fill_path(to, room, path, depth)
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
def _fill_path(to, room, path, depth):
    """Send what a path bears; the place of its first arc that is full then."""
    flow, cut = np.inf, 0
    for k in range(depth):
        if room[path[k]] < flow:
            flow, cut = room[path[k]], k
    for k in range(depth):
        room[path[k]] -= flow
        room[path[k] ^ 1] += flow
    return cut
