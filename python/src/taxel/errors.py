"""What the daemon says no to."""

from typing import Optional


class Refused(RuntimeError):
    """The daemon refused a subscription or a request; the text says why and what to do."""

    def __init__(self, text: str, held_by: Optional[int] = None) -> None:
        super().__init__(text)
        self.held_by = held_by
        """The process that holds the motor; None where that is not why, or not known."""
