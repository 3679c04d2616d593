"""Exceptions caused by use. A bad argument raises a plain ValueError or TypeError."""

from __future__ import annotations

from pathlib import Path


class Sonata2dError(Exception):
    """Base class of all errors of sonata2d."""


class ConfigError(Sonata2dError):
    """A scenario or settings file is invalid."""


class SceneError(Sonata2dError):
    """A scene cannot be laid out with the given settings."""


class ControllerError(Sonata2dError):
    """A controller cannot be loaded, or its answer is not a valid command."""


class BenchmarkError(Sonata2dError):
    """A benchmark cannot be run, or a row does not hold what it claims."""


class WorkerError(Sonata2dError):
    """A worker process crashed, or was killed."""


class KernelError(Sonata2dError):
    """A kernel, such as the kernel of a plug-in's pedestrian model, cannot be compiled."""


class RecordError(Sonata2dError):
    """An episode file or a data set cannot be read or written, or fails verification."""


class InvalidFileError(RecordError):
    """An episode file is complete JSON, but its content is not an episode.

    Attributes:
        findings: place and description of each problem.
    """

    def __init__(self, message: str, findings: list[tuple[str, str]]) -> None:
        super().__init__(message, findings)  # both arguments, for pickle: workers of other processes raise it
        self.findings = findings

    def __str__(self) -> str:
        return str(self.args[0])


class UnsuitableEpisode(RecordError):
    """An episode is valid, but a format cannot hold it, or readers of the format would misinterpret it.

    Args:
        path: file of the episode.
        problem: what the readers would misinterpret; may name ids, ticks and values of the episode.
        remedy: what the caller can do; the same for all episodes of the kind.

    Attributes:
        cause: the same for all episodes that a format refuses for this reason; reports are grouped by it.
    """

    def __init__(self, path: Path, problem: str, remedy: str) -> None:
        super().__init__(path, problem, remedy)  # all arguments, for pickle
        self.cause = remedy

    def __str__(self) -> str:
        return f"{self.args[0]}: {self.args[1]}; {self.args[2]}"


class NewerFormatError(RecordError):
    """A file was written by a newer version of sonata2d."""


class RenderError(Sonata2dError):
    """A picture or film cannot be rendered."""


class StudyError(Sonata2dError):
    """A study cannot be served."""


class WindowError(Sonata2dError):
    """A window cannot be opened."""


class PluginWarning(UserWarning):
    """A plug-in of another package is skipped: it does not load, or its name is taken."""


class DatasetWarning(UserWarning):
    """A statement of an author about a data set, or an edit in its folder, is not used or not kept."""


class MetricError(Sonata2dError):
    """A metric is unknown, or runs cannot be compared."""


class ControllerWarning(UserWarning):
    """A controller may not do what its author intends, or is not the one that was recorded."""
