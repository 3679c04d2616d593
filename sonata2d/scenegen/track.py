"""A smooth way through places at given moments, at every tick."""

from __future__ import annotations

from ..core.geometry import Point, quantised

Sighting = tuple[float, float, float]  # t, x, y: s, m
_TOLERANCE = 1e-6  # ticks, by which a moment may seem to be off a tick


def sampled(track: tuple[Sighting, ...], dt: float) -> tuple[int, list[Point]]:
    """The places at the ticks from a track's first moment to its last, at a file's precision.

    Args:
        track: two or more, times rising.
        dt: s, the tick.

    Returns:
        The first tick, and the place at each tick from there on, m; no place where no tick falls into the track.

    Source: cubic Hermite interpolation with the slopes of Catmull & Rom (Computer Aided Geometric Design, Academic
    Press 1974, 317) for uneven steps: the way leads through every place, and its velocity has no jumps.
    """
    first, last = int(track[0][0] / dt + 1.0 - _TOLERANCE), int(track[-1][0] / dt + _TOLERANCE)
    slopes = [_slope(track, k) for k in range(len(track))]
    places, k = [], 0
    for tick in range(first, last + 1):
        t = min(max(tick * dt, track[0][0]), track[-1][0])
        while k < len(track) - 2 and track[k + 1][0] <= t:
            k += 1
        places.append(_between(track, slopes, k, t))
    return first, places


def _slope(track: tuple[Sighting, ...], k: int) -> Point:
    """Velocity at a place, m/s: that of the parabola through it and its neighbours, or to the only neighbour."""
    if k == 0 or k == len(track) - 1:
        (t0, x0, y0), (t1, x1, y1) = track[max(k - 1, 0)], track[min(k + 1, len(track) - 1)]
        return (x1 - x0) / (t1 - t0), (y1 - y0) / (t1 - t0)
    (t0, x0, y0), (t1, x1, y1), (t2, x2, y2) = track[k - 1 : k + 2]
    before, after = t1 - t0, t2 - t1
    into, out = ((x1 - x0) / before, (y1 - y0) / before), ((x2 - x1) / after, (y2 - y1) / after)
    share = before / (before + after)
    return into[0] + (out[0] - into[0]) * share, into[1] + (out[1] - into[1]) * share


def _between(track: tuple[Sighting, ...], slopes: list[Point], k: int, t: float) -> Point:
    """The place at a moment between the k-th and the next."""
    (t0, x0, y0), (t1, x1, y1) = track[k], track[k + 1]
    step = t1 - t0
    s = (t - t0) / step
    a, b = s * s * (3.0 - 2.0 * s), s * (1.0 - s) * (1.0 - s) * step
    c = s * s * (s - 1.0) * step
    (u0, v0), (u1, v1) = slopes[k], slopes[k + 1]
    return quantised(x0 + (x1 - x0) * a + u0 * b + u1 * c), quantised(y0 + (y1 - y0) * a + v0 * b + v1 * c)
