"""Exceptions. Each carries the one line that the command line prints: the place, the cause and the remedy."""

__all__ = ["ComputationError", "Error", "FileError", "InputError", "LinkError"]


class Error(Exception):
    """The base of all exceptions of this package."""


class InputError(Error, ValueError):
    """An argument, a model or a law that cannot be used."""


class FileError(Error, OSError, ValueError):
    """A file, or a recording made of arrays, that cannot be read, written or used."""


class ComputationError(Error, ArithmeticError):
    """A computation that has no result, such as a film that is pulled in."""


class LinkError(Error, ConnectionError):
    """A controller that does not answer, or refuses."""
