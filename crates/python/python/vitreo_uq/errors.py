"""What can go wrong. Messages say where, what was found, and what to do."""


class Error(Exception):
    """The program or the model failed."""


class InputError(Error, ValueError):
    """A file or an argument is not acceptable; nothing was written."""


class NotTrusted(UserWarning):
    """A command ran, but its result is not to be trusted as it stands (exit code 1 of the program): the document says why."""
