"""Errors of the module. Messages name the place, what was found, and what to do."""


class Error(Exception):
    """The program or the model failed."""


class InputError(Error, ValueError):
    """A file or an argument is not acceptable; nothing was written."""


class NotTrusted(UserWarning):
    """A command ran, but its result cannot be trusted (exit code 1 of the program). The document gives the reason."""
