"""What the daemon says no to."""


class Refused(RuntimeError):
    """The daemon refused a subscription or a request; the text says why and what to do."""
