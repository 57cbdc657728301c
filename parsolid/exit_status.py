"""Exit statuses of `parsolid`; `commands.cli` says what each means."""

DONE, FAILED, BAD_INPUT, WENT_WRONG, NOT_REACHED, TO_BE_CONTINUED = 0, 1, 2, 3, 4, 75
INTERRUPTED, UNREAD = 130, 141
