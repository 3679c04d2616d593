"""People of a recording, as a scenario lists them: carried along their tracks, or simulated from start and goal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..exact import Array
from ..geometry import quantised
from ..record.layout import Tree
from .tracks import Tracks

FASTEST = 8.0  # m/s, beyond which nobody runs: a jump in the file
WALKS = 0.3  # m/s; slower steps tell nothing of how fast somebody wants to go
STANDS = 0.5  # m, who never gets farther than this from where they came stands
SHORT = 2.0  # s of walking, from which a track shows how fast somebody wants to go
ONWARD = 0.8  # s, over which the velocity at the start is taken
ROUND = 2.0  # m, who comes back from farther off than this to nearer than half of it has gone a round
SLOWEST, QUICKEST = 0.3, 2.5  # m/s, of desired speeds


@dataclass(frozen=True, slots=True)
class Track:
    """One person's way: `time` (K,), s, rising, and `place` (K, 2), m; `group`: 0 for nobody's."""

    id: int
    time: Array
    place: Array
    group: int = 0

    def within(self, start: float, end: float) -> Track | None:
        """The part between two moments, as if the first were 0; None if there are not two sightings in it."""
        inside = (self.time >= start - 1e-9) & (self.time <= end + 1e-9)
        if np.count_nonzero(inside) < 2:
            return None
        return Track(self.id, np.maximum(self.time[inside] - start, 0.0), self.place[inside], self.group)


def tracks_of(tracks: Tracks) -> tuple[list[Track], float]:
    """Everybody's track, times from the first frame on, and the usual time between sightings, s.

    Ids are the file's, or one more if they begin at 0. Frames need be on no grid.

    Raises:
        ValueError: nobody is seen twice, or somebody is lost in between, in two places at once, or jumps.
    """
    order = np.lexsort((tracks.frame, tracks.ped))
    ped, place = tracks.ped[order], tracks.place[order]
    time = (tracks.frame[order] - tracks.frame.min()) * tracks.frame_time
    cuts = np.flatnonzero(np.diff(ped)) + 1
    steps = np.concatenate([np.diff(part) for part in np.split(time, cuts)])
    if not len(steps):
        raise ValueError("it must tell of somebody in two frames or more")
    usual = float(np.median(steps))
    shift, group = 1 - min(1, int(ped[0])), tracks.group or {}
    parts = zip(np.split(ped, cuts), np.split(time, cuts), np.split(place, cuts), strict=True)
    found = [Track(int(who[0]) + shift, when, where, group.get(int(who[0]), 0)) for who, when, where in parts]
    for track in found:
        _refuse_gaps(track, usual)
    return found, usual


def _refuse_gaps(track: Track, usual: float) -> None:
    steps = np.diff(track.time)
    if (steps < 1e-9).any():
        raise ValueError(f"person {track.id} is in two places at {track.time[int(np.argmin(steps))]:g} s")
    lost = np.flatnonzero(steps > 1.5 * usual)
    if len(lost):
        before, after = track.time[lost[0]], track.time[lost[0] + 1]
        raise ValueError(
            f"person {track.id} is lost from {before:g} to {after:g} s; fill the gap, or give whoever comes back"
            " a number of their own"
        )
    speed = speeds(track)
    if len(speed) and speed.max() > FASTEST:
        k = int(np.argmax(speed))
        raise ValueError(
            f"person {track.id} jumps at {speed[k]:.1f} m/s at {track.time[k]:g} s, faster than people run"
            f" ({FASTEST:g} m/s); mend the track, or check the units (m)"
        )


def speeds(track: Track) -> Array:
    """(K - 1,), m/s, from sighting to sighting."""
    way = np.diff(track.place, axis=0)
    return np.asarray(np.hypot(way[:, 0], way[:, 1]) / np.diff(track.time), dtype=float)


def replayed(track: Track, whole: Track, usual: float | None) -> Tree:
    """Somebody who is carried along their track."""
    rows = [
        [quantised(t), quantised(x), quantised(y)]
        for t, (x, y) in zip(track.time.tolist(), track.place.tolist(), strict=True)
    ]
    return {"id": track.id} | _group(track) | _speed(whole, usual) | {"track": rows}


def simulated(track: Track, whole: Track, end: float, usual: float | None) -> Tree:
    """Somebody who starts as recorded, and then goes their own way to where they went.

    Args:
        track: the part that is in the window.
        whole: from when they came to when they left.
        end: s, of the window; who leaves later is there to its end.
        usual: desired speed, m/s, of those whose tracks are too short to show it; None: it is drawn.
    """
    enters = float(track.time[0])
    told: Tree = {"id": track.id} | dict(zip("xy", map(quantised, track.place[0].tolist()), strict=True))
    if enters > 0.0:
        told["enters"] = quantised(enters)
    far = np.hypot(*(whole.place - whole.place[0]).T)
    if far.max() < STANDS:
        gone = {"leaves": quantised(float(track.time[-1]))} if track.time[-1] < end - 1e-6 else {}
        return told | gone
    goals = [whole.place[-1]]
    if far.max() > ROUND and far[-1] < ROUND / 2:  # there and back again
        goals.insert(0, whole.place[int(np.argmax(far))])
    onward = track.time <= track.time[0] + ONWARD + 1e-9
    onward[1] = True
    last = int(np.flatnonzero(onward)[-1])
    velocity = (track.place[last] - track.place[0]) / (track.time[last] - track.time[0])
    told["velocity"] = [quantised(v) for v in velocity.tolist()]
    told["goals"] = [[quantised(v) for v in goal.tolist()] for goal in goals]
    return told | {"exits": True} | _group(track) | _speed(whole, usual)


def _group(track: Track) -> Tree:
    return {"group": track.group} if track.group > 0 else {}


def _speed(whole: Track, usual: float | None) -> Tree:
    """Their desired speed: the mean while they walk, where that is long enough to tell."""
    speed, lasted = speeds(whole), np.diff(whole.time)
    walks = speed > WALKS
    if lasted[walks].sum() < SHORT:
        return {} if usual is None else {"desired_speed": usual}
    mean = float((speed * lasted)[walks].sum() / lasted[walks].sum())
    return {"desired_speed": quantised(min(max(mean, SLOWEST), QUICKEST))}
