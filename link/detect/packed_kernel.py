"""The loops of the packed detector: one table look-up for the spikes of a pixel in a group of
symbols.

Log likelihoods are whole numbers of steps, several in a word of 64 bits, so that one addition adds
those of all symbols of a group. The kernels take arrays and not records: numba vectorises
these loops fully only for plain array arguments.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from link.detect.counting import CONTEXT, PART, STEEP, WIDE, pattern_of, place_of
from link.detect.geometry import PLACES

FIELDS: Final = 3
"""Pairs of bits with a log likelihood: off and on, on and off, on and on; off and off has 0."""
LANE: Final = 21
"""Bits of a field in a word."""
_TILE: Final = 32
"""Cells whose chains of bits are computed together, in vectors."""
RUN: Final = 8 * _TILE
"""Cells whose soft values are written together."""
_END: Final = np.uint64(2**64 - 1)
"""Ends a list of pixels. A loop up to it is not vectorised: gathers are slower for so few."""
_ZERO: Final = np.float32(0.0)


@njit(cache=True, fastmath={"contract"}, nogil=True)
def _either(a, b, most):  # type: ignore[no-untyped-def]
    """ln(e^a + e^b) in steps, linearly approximated; `most` is its largest excess.

    Written without a branch, so that it is vectorised.
    """
    return max(a, b) + max(most - STEEP * abs(a - b), _ZERO)


def _adder(lanes: int) -> Callable[..., Any]:
    """A compiled function that adds up entries of `lanes` words, in one vector.

    Its arguments are those of `_add_up`, `low` the bits by which the window is late. It returns the
    `lanes` sums. numba does not join the additions of neighbours to vectors.
    """

    def typed(context, table, law, window, low, mask, zero):  # type: ignore[no-untyped-def]
        def build(context, builder, signature, given):  # type: ignore[no-untyped-def]
            word = ir.IntType(64)
            many, null = ir.VectorType(word, lanes), ir.Constant(word, 0)
            entries, laws, windows = (
                context.make_array(kind)(context, builder, value).data
                for kind, value in zip(signature.args[:3], given[:3], strict=True)
            )
            low, mask, zero = given[3:]
            total = ir.Constant(many, ir.Undefined)
            for lane in range(lanes):
                total = builder.insert_element(total, zero, ir.Constant(ir.IntType(32), lane))
            before = builder.basic_block
            head, body, end = (builder.append_basic_block(name) for name in ("head", "body", "end"))
            builder.branch(head)
            builder.position_at_end(head)
            k, sums = builder.phi(word), builder.phi(many)
            k.add_incoming(null, before)
            sums.add_incoming(total, before)
            entry = builder.load(builder.gep(laws, [k]))
            last = builder.icmp_unsigned("==", entry, ir.Constant(word, int(_END)))
            builder.cbranch(last, end, body)
            builder.position_at_end(body)
            spikes = builder.lshr(builder.load(builder.gep(windows, [k])), low)
            place = builder.gep(entries, [builder.add(entry, builder.and_(spikes, mask))])
            words = builder.load(builder.bitcast(place, many.as_pointer()), align=8)
            k.add_incoming(builder.add(k, ir.Constant(word, 1)), body)
            sums.add_incoming(builder.add(sums, words), body)
            builder.branch(head)
            builder.position_at_end(end)
            each = [
                builder.extract_element(sums, ir.Constant(ir.IntType(32), lane))
                for lane in range(lanes)
            ]
            return cgutils.pack_array(builder, each)

        return types.UniTuple(types.uint64, lanes)(table, law, window, low, mask, zero), build

    return intrinsic(typed)


_add_two, _add_four = _adder(2), _adder(4)


@njit(cache=True, nogil=True)
def _add_up(  # type: ignore[no-untyped-def]
    flat, size, bit, groups, group, advance, at, late, law, window, table, mask, zero, sums
):
    """Adds up the table's entries of a cell's pixels, for groups of symbols.

    Args:
        flat, size: spikes as flat words, and pixels of a word.
        bit: first bit of the first group's pattern.
        groups, group, advance: groups, symbols of a group, and bits from a group to the next.
        at, late, law: place in a word of each pixel and part of a symbol, the bits that the part is
            late, and the first entry of its table; law ends in _END.
        window: memory for 64 bits of each.
        table: flat entries of `group` words.
        mask: bits of a pattern, times `group`.
        zero: value before any pixel.
        sums: (groups * group,) that are written.
    """
    one, two, three, four = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
    wide, times = np.uint64(32), np.uint64(group // 2)
    last, held, n = flat.size - size, np.int64(-1), np.uint64(0)
    for _ in range(groups):
        w = bit >> 5
        if w != held:
            held = w
            here, later = np.uint64(w * size), np.uint64(min(w * size + size, last))
            k = np.uint64(0)
            while law[k] != _END:
                both = np.uint64(flat[here + at[k]]) | (np.uint64(flat[later + at[k]]) << wide)
                # Times `group`, so that a pattern is the index of an entry.
                window[k] = (both >> late[k]) << times
                k += one
        low = np.uint64(bit & 31)
        if group == 4:
            a, b, c, d = _add_four(table, law, window, low, mask, zero)
            sums[n], sums[n + one], sums[n + two], sums[n + three] = a, b, c, d
            n += four
        elif group == 2:
            sums[n], sums[n + one] = _add_two(table, law, window, low, mask, zero)
            n += two
        else:
            a, k = zero, np.uint64(0)
            while law[k] != _END:
                a += table[law[k] + ((window[k] >> low) & mask)]
                k += one
            sums[n] = a
            n += one
        bit += advance


@njit(cache=True, fastmath={"contract"}, nogil=True)
def _chain(sums, zero, step, evidence, ahead, skipped, limit, out):  # type: ignore[no-untyped-def]
    """Computes the soft values of the chains of bits of a tile by a forward and a backward pass.

    Args:
        sums: (symbols, _TILE) uint64, three log likelihoods each, in steps from `zero` on.
        zero, step: zero and step of the sums.
        evidence: (FIELDS, symbols, _TILE) float32, memory for them.
        ahead: (symbols, _TILE) float32, memory for the forward pass.
        skipped: first symbol that is written.
        limit: largest magnitude.
        out: (n, _TILE) float32.
    """
    mask, first, second = np.uint64((1 << LANE) - 1), np.uint64(LANE), np.uint64(2 * LANE)
    most = STEEP * WIDE / step
    ratio = np.zeros(_TILE, np.float32)
    for n in range(sums.shape[0]):
        for c in range(_TILE):
            word, m = sums[n, c], ratio[c]
            rose = np.float32(np.int32(word & mask) - zero)
            fell = np.float32(np.int32((word >> first) & mask) - zero)
            stayed = np.float32(np.int32(word >> second) - zero)
            evidence[0, n, c], evidence[1, n, c], evidence[2, n, c] = rose, fell, stayed
            m = _either(rose, m + stayed, most) - _either(_ZERO, m + fell, most)
            ratio[c] = m
            ahead[n, c] = m
    ratio[:] = _ZERO
    for n in range(sums.shape[0] - 1, skipped - 1, -1):
        if n - skipped < out.shape[0]:
            for c in range(_TILE):
                value = (ahead[n, c] + ratio[c]) * step
                out[n - skipped, c] = min(max(value, -limit), limit)
        for c in range(_TILE):
            m = ratio[c]
            rose, fell, stayed = evidence[0, n, c], evidence[1, n, c], evidence[2, n, c]
            ratio[c] = _either(fell, m + stayed, most) - _either(_ZERO, m + rose, most)


@njit(cache=True, nogil=True)
def _in_part(  # type: ignore[no-untyped-def]
    words, stop, bit, ticks, x, y, dx, dy, share, single, zero, step
):
    """Word of a symbol that may lie partly outside the words, by its ticks within.

    Args:
        words, stop: (n, H, W) uint32 spikes, and the number of ticks to read.
        bit: first bit of the symbol's pattern, negative before the words.
        ticks: ticks of a symbol.
        x, y, dx, dy, share: pixel of the cell's centre, and the cell's pixels.
        single: (ticks, SHARES, contexts, 2, PAIRS) of `tables`, of the cell's region and phase.
        zero, step: zero and step as in `_chain`.
    """
    on, fell, both = _ZERO, _ZERO, _ZERO
    for k in range(dx.size):
        px, py = x + dx[k], y + dy[k]
        if px < 0 or py < 0 or px >= words.shape[2] or py >= words.shape[1]:
            continue
        for j in range(ticks):
            if bit + j + CONTEXT < 0 or bit + j + CONTEXT >= stop:
                continue
            spikes = pattern_of(words, py, px, bit + j)
            before, spike = spikes & ((1 << CONTEXT) - 1), (spikes >> CONTEXT) & 1
            on += single[j, share[k], before, spike, 1]
            fell += single[j, share[k], before, spike, 2]
            both += single[j, share[k], before, spike, 3]
    out = np.int64(zero) + np.int64(np.rint(on / step))
    out |= (np.int64(zero) + np.int64(np.rint(fell / step))) << LANE
    out |= (np.int64(zero) + np.int64(np.rint(both / step))) << 2 * LANE
    return np.uint64(out)


@njit(cache=True, nogil=True)
def soft_values(  # type: ignore[no-untyped-def]
    run0, run1, words, stop, bits, phases, tables_of, held, ends, shift, ticks, group, width,
    region_of, reach, x0, y0, count, dx, dy, share, table, single, zero, bias, step, skipped, limit,
    out,
):  # fmt: skip
    """Computes soft values of each cell's bits in a window of whole groups of symbols.

    A look is a stretch of groups for which geometry and phase are computed once.

    Args:
        run0, run1: runs of RUN cells to compute, first and stop.
        words, stop: (n, H, W) uint32 spikes, and the number of ticks to read.
        bits: (rows, looks) first bit of the pattern of a look's first group; `rows` is that of the
            camera, or 1 if all are alike.
        phases, tables_of: (rows, looks) class of phase, and index of its table.
        held: (rows, looks, 2) groups of a look, first and stop, that the words contain.
        ends: (looks,) groups at which the looks end.
        shift: (looks, 2) shift of the image, camera pixels.
        ticks, group, width: ticks of a symbol, symbols of a group, bits of a pattern.
        region_of, x0, y0: (cells,) region and centre of each cell.
        reach: farthest pixel of a cell from its centre.
        count, dx, dy, share: arrays of `geometry.Places`.
        table: (phases, regions, parts, SHARES * patterns * group) uint64, for each symbol of a
            group FIELDS log likelihoods of LANE bits, in steps from `bias` on.
        single: (regions, PHASES, ticks, SHARES, contexts, 2, PAIRS) float32 log likelihoods by
            tick, for groups only partly within the words.
        zero: value of a field without evidence.
        bias, step: bias and step of the table; a step is a log likelihood.
        skipped: symbols of the window before the first that is written.
        limit: largest magnitude of a soft value.
        out: (n, cells) float32, of symbols `skipped` to skipped + n of the window.
    """
    high, wide = words.shape[1], words.shape[2]
    cells, size, most = out.shape[1], high * wide, dx.shape[3]
    # Flat arrays: the compiler does not hoist the address computation of many indices.
    flat, flat_table, flat_count = words.reshape(-1), table.reshape(-1), count.reshape(-1)
    flat_dx, flat_dy, flat_share = dx.reshape(-1), dy.reshape(-1), share.reshape(-1)
    flat_step = flat_dy * wide + flat_dx
    looks, regions, parts, stride = ends.size, table.shape[1], table.shape[2], table.shape[3]
    symbols, advance, entries = group * ends[looks - 1], group * ticks, group << width
    mask = np.uint64(entries - group)
    every = np.uint64(1 | (1 << LANE) | (1 << 2 * LANE))
    for run in range(run0, run1):
        # Zeros, since the last tile may have fewer cells.
        sums = np.zeros((symbols, _TILE), np.uint64)
        evidence = np.empty((FIELDS, symbols, _TILE), np.float32)
        ahead = np.empty((symbols, _TILE), np.float32)
        soft = np.empty((out.shape[0], RUN), np.float32)
        window, at = np.empty(most * parts, np.uint64), np.empty(most * parts, np.uint64)
        late, law = np.empty(most * parts, np.uint64), np.empty(most * parts + 1, np.uint64)
        first_cell, last_cell = run * RUN, min((run + 1) * RUN, cells)
        for begin in range(first_cell, last_cell, _TILE):
            for c in range(min(_TILE, cells - begin)):
                cell = begin + c
                region = region_of[cell]
                for look in range(looks):
                    x, y, qx, qy = place_of(x0[cell] + shift[look, 0], y0[cell] + shift[look, 1])
                    place = (region * PLACES + qy) * PLACES + qx
                    pixels = slice(place * most, place * most + flat_count[place])
                    row = min(max(y, 0), bits.shape[0] - 1)
                    base = (tables_of[row, look] * regions + region) * parts * stride
                    clear = reach <= x < wide - reach and reach <= y < high - reach
                    used = 0
                    if clear and parts == 1:  # most cells: no tests
                        middle = y * wide + x
                        for k in range(pixels.start, pixels.stop):
                            at[used], late[used] = middle + flat_step[k], 0
                            law[used] = base + flat_share[k] * entries
                            used += 1
                    else:
                        for k in range(pixels.start, pixels.stop):
                            px, py = x + flat_dx[k], y + flat_dy[k]
                            if not (0 <= px < wide and 0 <= py < high):
                                continue
                            for part in range(parts):
                                at[used], late[used] = py * wide + px, part * PART
                                law[used] = base + part * stride + flat_share[k] * entries
                                used += 1
                    law[used] = _END
                    first = ends[look - 1] if look > 0 else 0
                    bit, low, top = bits[row, look], held[row, look, 0], held[row, look, 1]
                    _add_up(
                        flat, size, bit + (low - first) * advance, top - low, group, advance, at,
                        late, law, window, flat_table, mask, np.uint64(zero - used * bias) * every,
                        sums[low * group : top * group, c],
                    )  # fmt: skip
                    if top - low == ends[look] - first:
                        continue
                    for n in range(first * group, ends[look] * group):
                        if n < low * group or n >= top * group:
                            sums[n, c] = _in_part(
                                words, stop, bit + (n - first * group) * ticks, ticks, x, y,
                                flat_dx[pixels], flat_dy[pixels], flat_share[pixels],
                                single[region, phases[row, look]], zero, step,
                            )  # fmt: skip
            tile = soft[:, begin - first_cell : begin - first_cell + _TILE]
            _chain(sums, np.int32(zero), step, evidence, ahead, skipped, limit, tile)
        for n in range(out.shape[0]):
            out[n, first_cell:last_cell] = soft[n, : last_cell - first_cell]
