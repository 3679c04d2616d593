"""Fuzzing that is guided by coverage: inputs that reach new branches of a reader are kept and damaged further.

    pip install atheris
    python -m tests.fuzz.guided tracks -runs=20000

Atheris runs libFuzzer in this process; each input is damaged by `mutations` or by libFuzzer. Options with `-` are
libFuzzer's. The corpus of each kind is kept in `fuzz-corpus`, an input that fails in `fuzz-failures`.
"""

from __future__ import annotations

import importlib
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path
from random import Random

import atheris

os.environ["NUMBA_DISABLE_JIT"] = "1"  # before the imports: instrumented kernels cannot be compiled
MODULES = [
    "sonata2d.collect.journal", "sonata2d.datasets.check.folders", "sonata2d.formats.api", "sonata2d.learning.weights",
    "sonata2d.formats.from_tracks", "sonata2d.record.reader", "sonata2d.record.shard_file", "sonata2d.study.load",
    "sonata2d.scenegen.scenario.load", "sonata2d.web.messages", "cli.main", "cli.check",
]  # fmt: skip
with atheris.instrument_imports(include=["sonata2d"]):
    import click

    from sonata2d.errors import Sonata2dError

    from .mutations import mutated
    from .runner import judged, time_limit
    from .targets import KINDS, Refusal

    for module in MODULES:
        importlib.import_module(module)

MAX_BYTES = 1 << 20  # of an input
MAX_SECONDS = 60.0  # of processor time; scenes are sampled by interpreted kernels
_CORPUS, _FAILURES = Path("fuzz-corpus"), Path("fuzz-failures")


def main() -> None:
    """Fuzz the kind of input that the first argument names."""
    if len(sys.argv) < 2 or sys.argv[1] not in KINDS:
        raise SystemExit(f"usage: python -m tests.fuzz.guided KIND [-runs=N]; kinds: {', '.join(KINDS)}")
    kind = sys.argv.pop(1)
    logging.disable(logging.CRITICAL)
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    warnings.simplefilter("error", RuntimeWarning)  # NumPy warns of numbers that the reader should have refused
    this, start = KINDS[kind], Path.cwd()
    corpus = (_CORPUS / kind).absolute()
    for folder in (corpus, _FAILURES):
        folder.mkdir(parents=True, exist_ok=True)
    samples = Path(tempfile.mkdtemp(prefix="sonata2d-fuzz-"))
    make = (
        "import sys; from pathlib import Path; from tests.fuzz.samples import make_samples as m; m(Path(sys.argv[1]))"
    )
    compiled = {key: value for key, value in os.environ.items() if key != "NUMBA_DISABLE_JIT"}
    subprocess.run([sys.executable, "-c", make, str(samples)], env=compiled, check=True)
    folder = samples / (this.folder or kind)
    files = sorted({path for pattern in this.damaged for path in folder.glob(pattern) if path.is_file()})
    for number, path in enumerate(files):
        (corpus / f"sample-{number}").write_bytes(bytes([number]) + path.read_bytes()[: MAX_BYTES - 1])
    others = [path.read_bytes() for path in files]
    work = samples / "work"

    def use(data: bytes) -> None:
        path = files[data[0] % len(files)].relative_to(folder) if data else files[0].relative_to(folder)
        shutil.rmtree(work, ignore_errors=True)
        shutil.copytree(folder, work)
        (work / path).write_bytes(data[1:])
        os.chdir(work)
        try:
            with time_limit(MAX_SECONDS):
                this.uses[len(data) % len(this.uses)](work / path)
        except (Refusal, Sonata2dError, click.ClickException) as error:
            status, detail = judged(error)
            if status == "failed":
                raise AssertionError(detail) from error
        finally:
            os.chdir(start)

    def damage(data: bytes, max_size: int, seed: int) -> bytes:
        rng = Random(seed)
        if data and rng.random() < 0.5:
            name = files[data[0] % len(files)].name
            with suppress(ValueError, IndexError):  # nothing is left that could be damaged
                return (data[:1] + mutated(rng, name, data[1:], others))[:max_size]
        damaged: bytes = atheris.Mutate(data, max_size)
        return damaged

    options = [f"-max_len={MAX_BYTES}", f"-artifact_prefix={_FAILURES.absolute()}/{kind}-", "-rss_limit_mb=4000"]
    atheris.Setup([sys.argv[0], *options, *sys.argv[1:], str(corpus)], use, custom_mutator=damage)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
