"""Signals, forks, exits and threads end a command in an orderly way, and never make it look complete."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from sonata2d.datasets import verify

from .conftest import Run, one_line, started, wait_until


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
@pytest.mark.parametrize(("number", "word"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")])
def test_a_stopped_batch_says_how_to_resume(here: Path, number: signal.Signals, word: str) -> None:
    line = "generate out --scenario quick.yaml --episodes 2000 --workers 1"
    with started(line) as process:
        wait_until((here / "out/000001.json").exists, process)
        process.send_signal(number)
        _, output = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert one_line(output).startswith(f"{word}; complete episodes are in out")
    assert "--resume" in output
    assert b'"outcome":"interrupted"' in (here / "out/run.jsonl").read_bytes()


WRAPPING = """
import os, signal, sys
import sonata2d as s2
class Wrapping(s2.Controller):
    def act(self, snapshot):
        try:
            if snapshot.tick == 3 and snapshot.scene.episode == 2:
                os.kill(os.getpid(), {signal})
                for _ in range(1000):
                    pass
        except BaseException as error:
            raise ValueError("as libraries do") from error
        return s2.Twist()
"""


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
@pytest.mark.parametrize(("number", "word"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")])
def test_an_interruption_that_a_library_turns_into_an_error_stops_the_batch(
    here: Path, number: signal.Signals, word: str
) -> None:
    (here / "wrapping.py").write_text(WRAPPING.format(signal=int(number)))
    done = run_alone("generate out --scenario quick.yaml --controller ./wrapping.py:Wrapping --episodes 9 --workers 1")
    assert done.returncode == 128 + number
    assert one_line(done.stderr).startswith(f"{word}; complete episodes are in out")
    assert not (here / "out/failed").exists()


WRAPPED = """
import importlib, os, signal
from sonata2d.errors import ConfigError
def stopped(*arguments):
    try:
        os.kill(os.getpid(), signal.SIGTERM)
        for _ in range(1000):
            pass
    except BaseException as error:
        raise ConfigError("as pydantic does") from error
setattr(importlib.import_module({module!r}), {name!r}, stopped)
"""


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
@pytest.mark.parametrize(
    ("line", "module", "name"),
    [
        ("run --scenario quick.yaml -o again.json", "sonata2d.scenegen.scenario.load", "parse_settings"),
        ("check run.json --replay", "sonata2d.datasets.check.replay", "generate"),
        ("doctor", "sonata2d_cli.doctor", "_trial_episode"),
    ],
)
def test_an_interruption_that_a_library_turns_into_an_error_is_no_fault_of_a_file(
    sonata2d: Run, line: str, module: str, name: str
) -> None:
    sonata2d("run --scenario quick.yaml -o run.json")
    with started(line, preparation=WRAPPED.format(module=module, name=name)) as process:
        _, output = process.communicate(timeout=100)
    assert process.returncode == 128 + signal.SIGTERM
    assert one_line(output) == "terminated"


IN_FINALIZER = """
import os, signal
import sonata2d as s2
class Interrupting:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):
            pass  # Python calls the handler here, and ignores what it raises
class Fatal(s2.Controller):
    def act(self, snapshot):
        if snapshot.tick == 3 and snapshot.scene.episode == 2:
            Interrupting()
        return s2.Twist()
"""


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
def test_an_interruption_that_python_ignores_in_a_finalizer_still_stops_the_batch(here: Path) -> None:
    (here / "fatal.py").write_text(IN_FINALIZER)
    done = run_alone("generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 2000 --workers 1")
    assert "Exception ignored in" in done.stderr
    assert done.returncode == 128 + signal.SIGINT
    assert len([*(here / "out").glob("0*.json")]) == 3


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc")
@pytest.mark.parametrize("started_processes", [0, 1, 3])
def test_ctrl_c_while_the_workers_start_gives_no_traceback(here: Path, started_processes: int) -> None:
    line = "generate out --scenario quick.yaml --episodes 20000 --workers 2"
    with started(line) as process:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")  # two workers, and a tracker of resources
        wait_until((here / "out").exists, process)  # made just before the workers start
        wait_until(lambda: len(children.read_text().split()) >= started_processes, process)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all processes of the command
        _, output = process.communicate(timeout=60)
    assert process.returncode == 130
    assert output.strip().splitlines()[-1].startswith("interrupted")
    assert "Traceback" not in output


def run_alone(line: str) -> subprocess.CompletedProcess[str]:
    """Run the words of a command line in a process of its own."""
    words = [sys.executable, "-m", "sonata2d_cli", *line.split()]
    return subprocess.run(words, capture_output=True, text=True, timeout=100)


FATAL = """
import os, signal, sys
import sonata2d as s2
{at_import}
class Fatal(s2.Controller):
    def act(self, snapshot):
        if snapshot.tick == 3 and snapshot.scene.episode == 2:
            {in_act}
        return s2.Twist()
"""


@pytest.mark.parametrize("workers", [1, 2])
def test_a_controller_that_exits_is_an_error_of_its_episode(sonata2d: Run, here: Path, workers: int) -> None:
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act="sys.exit(0)"))
    line = f"generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers {workers}"
    output = one_line(sonata2d(line, code=1).output)
    assert "episode 2 of seed 0: SystemExit: 0; at tick 3 of episode 2, seed 0 (fatal.py, line 8)" in output
    assert "--resume" in output
    assert (here / "out/failed/000002.json").exists()
    again = one_line(sonata2d(f"{line} --overwrite", code=1).output)
    assert "continue with the same command and --resume in place of --overwrite, or" in again


def test_a_controller_that_ends_the_process_is_an_error_of_its_episode(sonata2d: Run, here: Path) -> None:
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act="os._exit(0)"))
    line = "generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers 1"
    output = one_line(sonata2d(line, code=1).output)
    assert "episode 2 of seed 0: SystemExit: 0; at tick 3 of episode 2, seed 0 (fatal.py, line 8)" in output
    assert os._exit.__name__ == "_exit"  # as before


@pytest.mark.parametrize("act", ["sys.exit(0)", "os._exit(0)"])
def test_a_controller_cannot_end_a_command_with_its_exit_code(sonata2d: Run, here: Path, act: str) -> None:
    (here / "fatal.py").write_text(
        FATAL.format(at_import="", in_act=act).replace("snapshot.scene.episode == 2", "True")
    )
    line = "scenarios check quick.yaml --situation narrow-doorway --controller ./fatal.py:Fatal"
    output = one_line(sonata2d(line, code=1).output)
    assert output.startswith("Error: SystemExit: 0; ")
    assert output.endswith("(fatal.py, line 8)")


@pytest.mark.skipif(os.name != "posix", reason="os._exit ends the process of the tests otherwise")
def test_os_exit_in_another_thread_ends_the_process(here: Path) -> None:
    thread = "t = __import__('threading').Thread(target=os._exit, args=(7,)); t.start(); t.join()"
    (here / "fatal.py").write_text(FATAL.format(at_import=thread, in_act="pass"))
    assert run_alone("generate out --controller ./fatal.py:Fatal").returncode == 7


def test_the_exit_of_a_controller_is_left_to_programs_that_use_the_library(here: Path) -> None:
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act="os._exit(7)"))
    code = (
        "import sonata2d as s2; from sonata2d.datasets.generate.run import generate_dataset; "
        "generate_dataset('out', s2.ScenarioConfig(standing=1), './fatal.py:Fatal', episodes=3)"
    )
    assert subprocess.run([sys.executable, "-c", code], timeout=100).returncode == 7


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.parametrize("workers", [1, 2])
def test_a_process_that_a_controller_forks_does_not_run_the_batch_again(here: Path, workers: int) -> None:
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act="os.fork() or setattr(self, '_x', 1)"))
    line = f"generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers {workers}"
    done = run_alone(line)
    assert done.returncode == 0
    assert "by the controller, and is ended because it went on with the batch" in one_line(done.stderr)
    assert done.stdout.count("6 episodes of quick") == 1
    assert verify(here / "out", replay=True) == []


def starting(count: int, seconds: float) -> str:
    """An expression that starts threads, which sleep."""
    threading, time = "__import__('threading')", "__import__('time')"
    names = ", ".join(f"'sensor{k}'" for k in range(count))
    return f"[{threading}.Thread(target={time}.sleep, args=({seconds},), name=name).start() for name in ({names},)]"


@pytest.mark.parametrize("workers", [1, 2])
def test_threads_of_a_controller_do_not_keep_a_command_alive(here: Path, workers: int) -> None:
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act=starting(12, 300)))
    done = run_alone(
        f"generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers {workers}"
    )
    assert done.returncode == 0
    assert "6 episodes of quick" in done.stdout
    are_named = "are ended: sensor0, sensor1, " in done.stderr
    assert are_named == (workers == 1)  # else they run in a worker, which ends silently
    assert verify(here / "out") == []


def test_threads_that_end_by_themselves_give_no_warning(here: Path) -> None:
    at_exit = "import atexit; atexit.register(print, 'atexit ran')"
    (here / "fatal.py").write_text(FATAL.format(at_import=at_exit, in_act=starting(1, 0.3)))
    done = run_alone("generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 3 --workers 1")
    assert done.returncode == 0
    assert done.stderr == ""
    assert done.stdout.endswith("atexit ran\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_threads_do_not_keep_a_command_alive_whose_output_cannot_be_written(here: Path) -> None:
    (here / "fatal.py").write_text(FATAL.format(at_import=starting(1, 300), in_act="pass"))
    words = ["scenarios", "check", "quick.yaml", "--situation", "narrow-doorway", "--controller", "./fatal.py:Fatal"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([sys.executable, "-m", "sonata2d_cli", *words], stdout=full, stderr=full, timeout=100)
    assert done.returncode != 0


def test_a_controller_file_that_exits_when_it_is_imported_is_an_error(sonata2d: Run, here: Path) -> None:
    (here / "fatal.py").write_text(FATAL.format(at_import="sys.exit(0)", in_act="pass"))
    output = one_line(sonata2d("generate out --controller ./fatal.py:Fatal --episodes 1", code=1).output)
    assert "fatal.py cannot be imported: SystemExit: 0" in output


@pytest.mark.skipif(os.name != "posix", reason="SIGKILL exists on POSIX systems only")
def test_a_killed_worker_is_reported_with_the_way_to_go_on(sonata2d: Run, here: Path) -> None:
    kill = "os.path.exists('enough memory') or os.kill(os.getpid(), signal.SIGKILL)"
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act=kill))
    line = "generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers 2"
    output = one_line(sonata2d(line, code=1).output)
    assert "WorkerError: a worker process crashed or was killed" in output
    assert "of 6 episodes are complete in out, continue with the same command and --resume" in output
    (here / "enough memory").touch()
    sonata2d(f"{line} --resume --workers 1")
    sonata2d("check out --replay --workers 1")


@pytest.mark.parametrize(
    ("raised", "message", "workers"),
    [
        ("raise type('Own', (BaseException,), {})('no wall')", "Own: no wall", 1),
        ("raise type('Own', (BaseException,), {})('no wall')", "Own: no wall", 2),  # a class that no pickle holds
        ("raise type('OwnScene', (s2.errors.SceneError,), {})('no wall')", "no wall", 1),
        ("raise GeneratorExit", "GeneratorExit; at tick 3", 1),
        ("raise GeneratorExit", "GeneratorExit; at tick 3", 2),
        ("raise type('Mute', (Exception,), {'__str__': None})", "Mute", 1),
        ("raise type('MuteScene', (s2.errors.SceneError,), {'__str__': None})", "MuteScene", 1),
        ("raise type('MuteScene', (s2.errors.SceneError,), {'__str__': None})", "MuteScene", 2),
        ("raise ValueError('x' * 5000)", f"ValueError: {'x' * 285}...;", 1),
    ],
)
def test_whatever_a_controller_raises_is_an_error_of_its_episode(
    sonata2d: Run, here: Path, raised: str, message: str, workers: int
) -> None:
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act=raised))
    line = f"generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers {workers}"
    output = one_line(sonata2d(line, code=1).output)
    assert f"episode 2 of seed 0: {message}" in output
    assert len(output) < 600


def test_a_keyboard_interrupt_that_a_controller_raises_in_a_worker_is_an_error_of_its_episode(
    sonata2d: Run, here: Path
) -> None:
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act="raise KeyboardInterrupt"))
    line = "generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers"
    assert "episode 2 of seed 0: KeyboardInterrupt" in one_line(sonata2d(f"{line} 2", code=1).output)
    assert "interrupted; complete episodes" in sonata2d(f"{line} 1 --overwrite", code=130).output


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
def test_a_controller_that_never_answers_does_not_keep_a_stopped_command_alive(here: Path) -> None:
    forever = "open('stuck', 'w').close() or [__import__('time').sleep(1) for _ in iter(int, 1)]"
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act=forever))
    line = "generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers 2"
    impatient = "from sonata2d.workers import processes; processes.STOP_GRACE = 0.5"
    with started(line, preparation=impatient) as process:
        wait_until((here / "stuck").exists, process)
        process.terminate()
        _, output = process.communicate(timeout=100)
    assert process.returncode == 128 + signal.SIGTERM
    assert output.strip().splitlines()[-1].startswith("terminated; complete episodes are in out")


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
def test_a_second_ctrl_c_ends_the_workers_at_once(here: Path) -> None:
    forever = "open('stuck', 'w').close() or [__import__('time').sleep(1) for _ in iter(int, 1)]"
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act=forever))
    line = "generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers 2"
    patient = "from sonata2d.workers import processes; processes.STOP_GRACE = 1000"
    with started(line, preparation=patient) as process:
        wait_until((here / "stuck").exists, process)
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        while "stopping" not in process.stderr.readline():
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, output = process.communicate(timeout=100)
    assert process.returncode == 128 + signal.SIGINT
    assert one_line(output).startswith("interrupted; complete episodes are in out")


@pytest.mark.parametrize("workers", [1, 2])
def test_a_controller_that_prints_does_not_spoil_the_json_output(here: Path, workers: int) -> None:
    act = "print('noise', flush=True); os.write(1, b'more'); sys.__stdout__.write('buffered')"
    (here / "fatal.py").write_text(FATAL.format(at_import="print('import')", in_act=act))
    line = f"generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers {workers} --json"
    done = run_alone(line)
    assert done.returncode == 0
    assert len(json.loads(done.stdout)["files"]) == 6
    assert all(text in done.stderr for text in ("import", "noise", "more"))


@pytest.mark.parametrize(
    ("act", "option"),
    [
        ("sys.stdout.close()", ""),
        ("sys.stdout.close()", "--json"),
        ("sys.stderr.close()", ""),
        ("sys.stdout = sys.stderr = open('log.txt', 'w')", "--json"),
    ],
)
def test_a_controller_that_closes_or_replaces_standard_streams_does_not_silence_the_command(
    here: Path, act: str, option: str
) -> None:
    fatal = FATAL.format(at_import="", in_act=act)
    (here / "fatal.py").write_text(fatal.replace("and snapshot.scene.episode == 2", ""))
    line = f"generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers 1 {option}"
    done = run_alone(line)
    assert done.returncode == 0
    assert ('"000005.json"' if option else "6 episodes of quick") in done.stdout


@pytest.mark.parametrize("workers", [1, 2])
def test_a_controller_that_changes_the_working_folder_does_not_move_the_data_set(
    sonata2d: Run, here: Path, workers: int
) -> None:
    (here / "elsewhere").mkdir()
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act="os.chdir('elsewhere')"))
    sonata2d(f"generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 9 --workers {workers}")
    assert list((here / "elsewhere").iterdir()) == []
    assert verify(here / "out") == []
    sonata2d("check out --rerun --controller ./fatal.py:Fatal --workers 1")


@pytest.mark.parametrize("workers", [1, 2])
def test_a_manifest_and_a_scenario_file_that_a_controller_removes_are_written_again(
    sonata2d: Run, here: Path, workers: int
) -> None:
    remove = "[os.unlink(f'out/{name}.json') for name in ('manifest', 'scenario')]"
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act=remove))
    sonata2d(f"generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers {workers}")
    assert verify(here / "out") == []
    assert (here / "out/scenario.json").exists()


def test_episodes_that_a_controller_removes_are_counted_and_can_be_generated_again(sonata2d: Run, here: Path) -> None:
    once = "os.path.exists('done') or open('done', 'w').close() or __import__('shutil').rmtree('out')"
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act=once))
    line = "generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 6 --workers 1"
    output = one_line(sonata2d(line, code=1).output)
    assert "2 of 6 episodes in out were removed while it was generated; 4 of 6 episodes are complete in out, " in output
    assert len(json.loads((here / "out/manifest.json").read_bytes())["files"]) == 4
    sonata2d(f"{line} --resume")
    assert verify(here / "out") == []


def test_a_data_set_is_generated_by_one_program_at_a_time(sonata2d: Run, here: Path) -> None:
    waits = "[__import__('time').sleep(0.01) for _ in iter(lambda: os.path.exists('go on'), True)]"
    (here / "fatal.py").write_text(FATAL.format(at_import="", in_act=waits))
    with started("generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 3") as process:
        wait_until((here / "out/000001.json").exists, process)
        output = one_line(sonata2d("generate out --scenario quick.yaml --overwrite --episodes 1", code=1).output)
        assert "another program is generating out; wait for it, or choose another folder" in output
        (here / "go on").touch()
        process.communicate(timeout=100)
    assert verify(here / "out") == []
    assert not [path for path in (here / "out").iterdir() if path.name.startswith(".")]


def test_a_signal_waits_until_pymunk_has_freed_its_memory(here: Path) -> None:
    """The controller makes a finalizer of pymunk's that sends the signal, and goes on for a moment."""
    (here / "fatal.py").write_text(
        FATAL.format(at_import="", in_act="free()")
        + '\ntext = \'def spacefree():\\n os.kill(os.getpid(), signal.SIGTERM)\\n open("freed", "w").close()\'\n'
        + "space = {'os': os, 'signal': signal}\n"
        + "exec(compile(text, '/lib/pymunk/space.py', 'exec'), space)\nfree = space['spacefree']\n"
    )
    line = "generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 2000 --workers 1"
    with started(line) as process:
        _, output = process.communicate(timeout=100)
    assert process.returncode == 128 + signal.SIGTERM
    assert one_line(output).startswith("terminated")
    assert (here / "freed").exists()


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
@pytest.mark.parametrize("module", ["sonata2d_cli.main", "click", "sonata2d.core.wording"])
@pytest.mark.parametrize(("number", "word"), [("SIGINT", "interrupted"), ("SIGTERM", "terminated")])
def test_a_signal_while_the_program_starts_is_one_line(here: Path, module: str, number: str, word: str) -> None:
    """The signal comes when a module is looked for."""
    code = (
        "import os, signal, sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name == {module!r}:\n"
        "            sys.meta_path.remove(self)\n"
        f"            os.kill(os.getpid(), signal.{number})\n"
        "sys.meta_path.insert(0, Finder())\n"
        "sys.argv = ['sonata2d', 'describe', 'out']\n"
        "from sonata2d_cli import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stderr.split()) == (128 + getattr(signal, number), [word])


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
@pytest.mark.parametrize(("number", "word"), [("SIGINT", "interrupted"), ("SIGTERM", "terminated")])
def test_a_signal_waits_for_the_end_of_an_import(here: Path, number: str, word: str) -> None:
    stop = f"os.kill(os.getpid(), signal.{number})\nopen('loaded', 'w').close()"
    (here / "fatal.py").write_text(FATAL.format(at_import=stop, in_act="pass"))
    line = "generate out --scenario quick.yaml --controller ./fatal.py:Fatal --episodes 2000 --workers 1"
    with started(line) as process:
        _, output = process.communicate(timeout=100)
    assert process.returncode == 128 + getattr(signal, number)
    assert one_line(output).startswith(word)
    assert (here / "loaded").exists()
