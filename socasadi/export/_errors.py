class ExportError(RuntimeError):
    """A controller that cannot be exported as asked, or whose C does not agree with Python."""


class NotBuiltError(ExportError):
    """An exported controller that is written but not built, for want of a compiler or make."""
