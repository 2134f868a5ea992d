"""The error of files that cannot be read."""


class ReadError(Exception):
    """Names a file and says in one sentence what is wrong with it, or which version it has that this reader does not know."""
