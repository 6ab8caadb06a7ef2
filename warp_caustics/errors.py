"""What the library raises: bad input, and a failure of its own."""


class WarpCausticsError(Exception):
    """Anything that this library raises on purpose."""


class InputError(WarpCausticsError, ValueError):
    """Input that cannot be used; the message says what, where, and what would be right. Exit status 2."""


class RenderError(WarpCausticsError, RuntimeError):
    """Work that failed although its input was good. Exit status 1."""
