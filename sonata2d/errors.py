"""What goes wrong in use. A bad argument is a plain ValueError or TypeError."""


class Sonata2dError(Exception):
    """Base of every error that a user of sonata2d can run into."""


class ConfigError(Sonata2dError):
    """A scenario or settings file says something that cannot be used."""


class SceneError(Sonata2dError):
    """A scene cannot be laid out as asked."""


class ControllerError(Sonata2dError):
    """A controller cannot be loaded, or answered something that is no command."""


class RecordError(Sonata2dError):
    """An episode file or a data set cannot be read, written or trusted."""


class NewerFormatError(RecordError):
    """A file was written by a newer version of sonata2d."""


class RenderError(Sonata2dError):
    """A picture or a film cannot be made."""


class WindowError(Sonata2dError):
    """A window cannot be opened."""


class PluginWarning(UserWarning):
    """A plug-in of another package is skipped: it does not load, or its name is taken."""


class MetricError(Sonata2dError):
    """A metric is unknown, or runs cannot be compared."""
