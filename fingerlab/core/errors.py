"""The one error that reaches a user."""


class UserError(Exception):
    """Something the user can put right.

    The message is one sentence that says what is wrong, where, and what would be right.
    The command line prints it and exits with 2; the window shows it as it is.
    """


class Cancelled(Exception):
    """The user asked a long calculation to stop."""
