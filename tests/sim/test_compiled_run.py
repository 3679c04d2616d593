"""Episodes that run many ticks at once: they equal those that run tick by tick."""

from __future__ import annotations

import os
import signal
from typing import Any, ClassVar, NamedTuple

import numpy as np
import orjson
import pytest

import sonata2d as s2
from sonata2d.agents.controllers.compiled import KernelController
from sonata2d.core.compiled.kernel import IS_COMPILED, kernel
from sonata2d.core.compiled.packing import Floats, unpack
from sonata2d.core.devices import DeviceEvent
from sonata2d.core.files.interruption import held_back
from sonata2d.core.geometry import Twist
from sonata2d.core.portable_math import Array, BoolArray
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Frame, Frames, Outcome, Snapshot
from sonata2d.errors import ControllerError, RecordError
from sonata2d.record import recorder as recorder_module
from sonata2d.record.files import compressed
from sonata2d.record.recorder import EpisodeRecorder
from sonata2d.scenegen.scenario.load import preset_names
from sonata2d.sim import member
from sonata2d.sim.inputs import Inputs, TickInput
from sonata2d.sim.kernel.batch import run_member


class Counting(EpisodeRecorder):
    """Counts the calls that bring many frames."""

    calls = 0

    def on_frames(self, frames: Frames) -> None:
        self.calls += 1
        super().on_frames(frames)


def both_ways(scene: Scene, controllers: tuple[s2.Controller, s2.Controller]) -> tuple[Counting, EpisodeRecorder]:
    """The recorder of an episode at once, and that of the same episode tick by tick."""
    at_once, by_tick = Counting(), EpisodeRecorder()
    episode = s2.Episode(scene, controllers[0], observers=[at_once])
    outcome = episode.run()
    other = s2.Episode(scene, controllers[1], observers=[by_tick])
    while other.step() is not None:
        pass
    assert outcome == other.outcome
    assert episode.past == other.past
    assert at_once.counts() == by_tick.counts()
    return at_once, by_tick


@pytest.mark.parametrize("name", preset_names())
def test_an_episode_at_once_equals_the_one_tick_by_tick(name: str) -> None:
    scene = s2.generate(name, seed=5)
    for kind in (s2.StraightToGoal, s2.SocialPlanner):
        at_once, by_tick = both_ways(scene, (kind(), kind()))
        assert at_once.calls > 0
        assert at_once.document() == by_tick.document()


class Hurry(NamedTuple):
    """Memory of `Faster`; its state is (1,)."""

    speed: float
    ticks: Floats


@kernel
def drive_faster(
    packed_memory: Any, tick: int, robot: Array, humans: Array, is_present: BoolArray, command: Array
) -> None:
    memory = unpack(packed_memory, Hurry)
    memory.ticks[0] += 1.0
    command[0], command[1], command[2] = memory.speed * memory.ticks[0], 0.0, 0.0


class Faster(KernelController):
    """Drives faster in every tick; a controller of a user."""

    kernel = drive_faster

    def __init__(self, speed: float = 0.01) -> None:
        self.speed = speed

    def memory(self, scene: Scene) -> Hurry:
        return Hurry(self.speed, np.zeros(1))


class Talking(Faster):
    """Labels its ticks, so that the interpreter is needed."""

    labels: ClassVar = {"tick": "number of the tick"}

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        return {"tick": snapshot.tick}


class Halved(Faster):
    """Answers with half of the command, so that the interpreter is needed."""

    def act(self, snapshot: Snapshot) -> Twist:
        return Twist(super().act(snapshot).vx / 2)


def test_a_kernel_of_a_user_drives_without_the_interpreter() -> None:
    at_once, by_tick = both_ways(s2.generate("sonata-2020", seed=2), (Faster(), Faster()))
    assert at_once.calls > 0
    assert at_once.document() == by_tick.document()
    frames = orjson.loads(at_once.document())["frames"]
    assert [frame["command"][0] for frame in frames[:3]] == [0.01, 0.02, 0.03]
    assert at_once.record().document["controller"]["settings"] == {"speed": 0.01}


def test_overridden_methods_are_called() -> None:
    scene = s2.generate("empty", seed=2)
    at_once, by_tick = both_ways(scene, (Talking(), Talking()))
    assert at_once.calls == 0
    assert [frame["label"] for frame in orjson.loads(by_tick.document())["frames"]][:2] == [{"tick": 0}, {"tick": 1}]
    at_once, _ = both_ways(scene, (Halved(), Halved()))
    assert at_once.calls == 0
    assert orjson.loads(at_once.document())["frames"][1]["command"] == [0.01, 0.0, 0.0]


@pytest.mark.parametrize("speed", [float("nan"), float("inf"), 1e300])
def test_a_command_that_no_file_can_hold_ends_the_episode_at_its_tick(speed: float) -> None:
    class Failing(Faster):
        def memory(self, scene: Scene) -> Hurry:
            return Hurry(speed, np.zeros(1))

    recorder = EpisodeRecorder()
    episode = s2.Episode(s2.generate("empty", seed=2), Failing(), observers=[recorder])
    with pytest.raises(ControllerError, match=r"Failing\.act") as failure:
        episode.run()
    assert failure.value.__notes__ == ["at tick 0 of episode 0, seed 2"]
    assert recorder.outcome is not None
    assert recorder.outcome.status == "error"


def test_an_observer_of_single_frames_gets_all_of_them() -> None:
    class Log:
        def __init__(self) -> None:
            self.ticks: list[int] = []

        def open(self, scene: Scene, controller_info: Any) -> None: ...
        def close(self, last: Snapshot, outcome: Any) -> None: ...
        def on_frame(self, frame: Any) -> None:
            self.ticks.append(frame.snapshot.tick)

    log, recorder = Log(), Counting()
    episode = s2.Episode(s2.generate("empty", seed=1), s2.StraightToGoal(), observers=[log, recorder])
    assert log.ticks == [*range(episode.run().tick)]
    assert recorder.calls == 0


def test_an_episode_can_go_on_at_once_after_single_ticks() -> None:
    scene, recorder = s2.generate("lively", seed=3), EpisodeRecorder()
    episode = s2.Episode(scene, s2.SocialPlanner(), observers=[recorder])
    for _ in range(7):
        episode.step()
    episode.observe()
    episode.run()
    _, by_tick = both_ways(scene, (s2.SocialPlanner(), s2.SocialPlanner()))
    assert recorder.document() == by_tick.document()


def test_a_replay_at_once_keeps_labels_and_stops_where_the_past_ends() -> None:
    scene, first = s2.generate("lively", seed=3), EpisodeRecorder()
    episode = s2.Episode(scene, Talking(), observers=[first])
    episode.run()
    again = Counting()
    s2.Episode(scene, Talking(), observers=[again], past=episode.past).run()
    assert again.calls > 0
    assert again.document() == first.document()
    branch = episode.branch(10, s2.StraightToGoal())
    assert len(branch.past) == 10
    assert branch.past == episode.past[:10]
    assert branch.snapshot().tick == 10


def test_a_long_episode_has_the_bytes_of_one_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = s2.generate("crossing-flows", seed=1)
    at_once, by_tick = both_ways(scene, (s2.SocialPlanner(), s2.SocialPlanner()))
    whole, counts = at_once.document(), at_once.counts()
    assert whole == by_tick.document()
    monkeypatch.setattr(recorder_module, "_SERIALISED_AT_ONCE", 7)
    monkeypatch.setattr(recorder_module, "_IN_MEMORY", 2000)
    for recorder in both_ways(scene, (s2.SocialPlanner(), s2.SocialPlanner())):
        document = recorder.complete()
        assert document.frames is not None
        assert document.size == len(whole)
        assert b"".join(document.parts()) == recorder.document() == whole
        assert recorder.counts() == counts
        assert len(recorder.record()) == len(by_tick.record())


def test_an_episode_that_stops_where_frames_were_put_away_has_them_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """The world has not executed the command of the last frame, which is not recorded."""

    def recorded(ticks: int) -> bytes:
        recorder = EpisodeRecorder()
        episode = s2.Episode(s2.generate("lively", seed=1), s2.StraightToGoal(), observers=[recorder])
        for _ in range(ticks):
            episode.step()
        snapshot = episode.snapshot()
        recorder.on_frame(Frame(snapshot, Twist()))
        recorder.close(snapshot, Outcome("stopped", "by hand", snapshot.tick, snapshot.time))
        return recorder.document()

    whole = [recorded(ticks) for ticks in range(5, 12)]
    monkeypatch.setattr(recorder_module, "_SERIALISED_AT_ONCE", 4)
    assert [recorded(ticks) for ticks in range(5, 12)] == whole


def test_a_number_that_is_not_finite_is_named_with_its_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_module, "_SERIALISED_AT_ONCE", 4)
    scene, recorder = s2.generate("lively", seed=1), EpisodeRecorder()
    episode = s2.Episode(scene, observers=[recorder])
    for _ in range(6):
        episode.apply(Twist())
    episode._world.row[0] = np.nan
    for _ in range(2):
        episode.apply(Twist())  # up to the frame at which the first ones are put away
    with pytest.raises(RecordError, match="x of the robot is nan at tick 6"):
        episode.apply(Twist())


@pytest.mark.parametrize("suffix", [".json", ".json.gz", ".json.zst"])
def test_compressed_bytes_do_not_depend_on_the_parts(suffix: str, tmp_path: Any) -> None:
    document = np.random.default_rng(1).integers(0, 30, 3_000_000, dtype=np.uint8).tobytes()
    parts = [document[:10], document[10:1_500_000], document[1_500_000:]]
    path = tmp_path / f"a{suffix}"
    at_once = b"".join(compressed([document], len(document), path))
    assert b"".join(compressed(parts, len(document), path)) == at_once


def test_inputs_are_a_sequence() -> None:
    inputs = [TickInput(Twist(n / 8, 0.0, -0.5), {"n": n} if n % 3 == 0 else None) for n in range(8)]
    past = Inputs(inputs)
    assert [*past] == inputs
    assert past == inputs
    assert past[2:7:2] == inputs[2:7:2]
    assert past[-1] == inputs[-1]
    assert past != inputs[:-1]
    with pytest.raises(IndexError):
        past[8]
    assert Inputs([TickInput(Twist(0.33333333, -0.00001))])[0].command == Twist(0.3333, 0.0)  # as in files
    longer = Inputs(past)
    longer.extend(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), [None, "b"])
    assert [*longer][8:] == [TickInput(Twist(1.0, 2.0, 3.0)), TickInput(Twist(4.0, 5.0, 6.0), "b")]


def test_a_recording_that_is_left_early_has_the_frames_so_far(tmp_path: Any) -> None:
    scene, path = s2.generate("empty", seed=3), tmp_path / "early.json"
    with s2.JsonRecorder(path) as recorder:
        s2.Episode(scene, past=[TickInput(Twist(0.3))] * 40, observers=[recorder]).replay_past()
    record = s2.read_episode(path)
    assert (len(record), record.outcome.status, record.outcome.tick) == (39, "stopped", 39)
    by_tick = tmp_path / "by-tick.json"
    with s2.JsonRecorder(by_tick, id="early") as recorder:
        episode = s2.Episode(scene, past=[TickInput(Twist(0.3))] * 40, observers=[recorder])
        for _ in range(40):
            episode.step()
    assert by_tick.read_bytes() == path.read_bytes()


def test_an_interruption_takes_effect_between_blocks(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = s2.generate("lively", seed=3)
    whole = EpisodeRecorder()
    s2.Episode(scene, s2.StraightToGoal(), observers=[whole]).run()
    calls, path = 0, tmp_path / "stopped.json"

    def interrupted(*arguments: Any) -> int:
        nonlocal calls
        need = run_member(*arguments)
        calls += 1
        if calls == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return need

    monkeypatch.setattr(member, "run_member", interrupted)
    recorder = s2.JsonRecorder(path)
    episode = s2.Episode(scene, s2.StraightToGoal(), observers=[recorder])
    with pytest.raises(KeyboardInterrupt), recorder:
        episode.run()
    record = s2.read_episode(path)
    assert len(record) == len(episode.past) - 1
    expected = orjson.loads(whole.document())["frames"][: len(record)]
    assert record.document["frames"] == expected


@pytest.mark.parametrize("sets_its_own", [False, True])
def test_signal_handlers_are_as_before_after_a_run(sets_its_own: bool) -> None:
    def own(*_: object) -> None: ...

    class Setting(EpisodeRecorder):
        def on_frames(self, frames: Frames) -> None:
            super().on_frames(frames)
            if sets_its_own:
                signal.signal(signal.SIGTERM, own)

    before = signal.signal(signal.SIGTERM, lambda *_: None)
    handler = signal.getsignal(signal.SIGTERM)
    try:
        s2.Episode(s2.generate("lively", seed=3), s2.StraightToGoal(), observers=[Setting()]).run()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        assert signal.getsignal(signal.SIGTERM) is (own if sets_its_own else handler)
    finally:
        signal.signal(signal.SIGTERM, before)


def test_all_signals_of_a_block_take_effect_after_it() -> None:
    seen: list[int] = []
    before = {number: signal.signal(number, lambda n, _: seen.append(n)) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with held_back() as blocks:
            with blocks:
                for number in before:
                    signal.raise_signal(number)
                assert seen == []
            assert seen == [*before]
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_an_error_of_an_observer_keeps_the_frames_of_the_others() -> None:
    class Failing(EpisodeRecorder):
        def on_frames(self, frames: Frames) -> None:
            raise OSError("no space")

    recorder = EpisodeRecorder()
    episode = s2.Episode(s2.generate("lively", seed=3), s2.StraightToGoal(), observers=[Failing(), recorder])
    with pytest.raises(OSError, match="no space"):
        episode.run()
    record = recorder.record()
    assert record.outcome.status == "error"
    assert len(record) == record.outcome.tick == len(episode.past) > 0


def test_a_label_that_no_file_can_hold_ends_the_recording_before_it() -> None:
    past = [TickInput(Twist(0.3), object() if n == 20 else {"n": n}) for n in range(41)]
    recorder = EpisodeRecorder()
    episode = s2.Episode(s2.generate("empty", seed=3), past=past, observers=[recorder])
    with pytest.raises(RecordError, match="label at tick 20"):
        episode.replay_past()
    record = recorder.record()
    assert (len(record), record.outcome.tick, record.labels[-1]) == (20, 20, {"n": 19})


def test_a_subclass_that_overrides_on_frame_gets_every_frame() -> None:
    class Counted(EpisodeRecorder):
        frames = 0

        def on_frame(self, frame: Frame) -> None:
            self.frames += 1
            super().on_frame(frame)

    recorder = Counted()
    outcome = s2.Episode(s2.generate("empty", seed=3), s2.StraightToGoal(), observers=[recorder]).run()
    assert recorder.frames == outcome.tick

    class Slow(s2.Episode):
        steps = 0

        def step(self, events: Any = ()) -> Any:
            self.steps += 1
            return super().step(events)

    slow = Slow(s2.generate("empty", seed=3), s2.StraightToGoal())
    assert slow.run().tick == slow.steps - 1
    controller = s2.StraightToGoal()
    controller.act = lambda snapshot: Twist(0.01)  # type: ignore[method-assign]
    episode = s2.Episode(s2.generate("empty", seed=3), controller)
    episode.run()
    assert episode.past[0].command == Twist(0.01)


def test_a_past_that_begins_with_a_command_beyond_files_is_replayed_as_tick_by_tick() -> None:
    past = [TickInput(Twist(1e300, 0.0, 0.1))] + [TickInput(Twist(0.1))] * 10
    scene = s2.generate("empty", seed=3)
    at_once, by_tick = (s2.Episode(scene, past=past) for _ in range(2))
    at_once.replay_past()
    for _ in past:
        by_tick.step()
    assert at_once.snapshot().tick == 11
    assert at_once.snapshot().state.row.tobytes() == by_tick.snapshot().state.row.tobytes()


def test_events_before_a_run_are_kept() -> None:
    event = DeviceEvent("gamepad", "a", 1.0)
    episode = s2.Episode(s2.generate("empty", seed=3), s2.StraightToGoal())
    episode.observe([event])
    episode.run()
    assert episode.past[0].events == (event,)


def test_a_temporary_file_that_cannot_be_written_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, whole, recorder = s2.generate("lively", seed=1), EpisodeRecorder(), EpisodeRecorder()
    s2.Episode(scene, s2.StraightToGoal(), observers=[whole]).run()
    monkeypatch.setattr(recorder_module, "_SERIALISED_AT_ONCE", 10)
    episode = s2.Episode(scene, s2.StraightToGoal(), observers=[recorder])
    for _ in range(15):
        episode.step()
    assert recorder._frames is not None

    def full(data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(recorder._frames, "write", full)
    with pytest.raises(RecordError, match="temporary file: No space left on device"):
        episode.run()
    frames = orjson.loads(recorder.document())["frames"]
    assert len(frames) >= 19
    assert frames == orjson.loads(whole.document())["frames"][: len(frames)]


def test_a_first_write_to_the_temporary_file_that_fails_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(file: Any, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(recorder_module, "_SERIALISED_AT_ONCE", 10)
    monkeypatch.setattr(recorder_module.SpooledTemporaryFile, "write", full)
    recorder = EpisodeRecorder()
    with pytest.raises(RecordError, match="temporary file: No space left on device"):
        s2.Episode(s2.generate("lively", seed=1), s2.StraightToGoal(), observers=[recorder]).run()
    assert len(orjson.loads(recorder.document())["frames"]) >= 10


def test_a_compiled_controller_acts_on_snapshots_without_reset() -> None:
    snapshot = s2.Episode(s2.generate("empty", seed=3)).observe()
    assert s2.StraightToGoal().act(snapshot) != Twist()
    assert s2.SocialPlanner().act(snapshot) != Twist()


def without_decorator(packed_memory: Any, tick: int, robot: Any, humans: Any, is_present: Any, command: Any) -> None:
    command[0] = 0.1


@kernel
def with_few_arguments(packed_memory: Any, command: Any) -> None:
    command[0] = 0.1


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"kernel": None}, r"Wrong needs a kernel"),
        ({"kernel": with_few_arguments}, r"Wrong\.kernel takes 2 arguments; it must take packed_memory, tick"),
        ({"memory": lambda self, scene: (1.0, 2.0)}, r"Wrong\.memory must return a NamedTuple, got \(1\.0, 2\.0\)"),
        pytest.param(
            {"kernel": without_decorator}, r"Wrong\.kernel is an ordinary function; write @kernel",
            marks=pytest.mark.skipif(not IS_COMPILED, reason="without numba, kernels are ordinary functions"),
        ),
    ],
)  # fmt: skip
def test_a_controller_whose_kernel_cannot_be_called_says_why(attributes: dict[str, Any], message: str) -> None:
    wrong = type("Wrong", (Faster,), attributes)
    with pytest.raises(TypeError, match=message):
        s2.Episode(s2.generate("empty", seed=1), wrong()).run()
