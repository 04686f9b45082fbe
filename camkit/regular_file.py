"""Only regular files are read: a pipe may never end, a device may never answer."""

import stat
from pathlib import Path
from typing import Final

from camkit.errors import DecodeError

_KINDS: Final = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def check_regular(path: Path) -> None:
    """Refuse what is no regular file, without opening it.

    Raises:
        DecodeError: If the path leads to anything else.
        OSError: If it leads nowhere: no such file, a loop of links, a name that is too long.
    """
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode):
        what = next((name for test, name in _KINDS if test(mode)), "something else")
        raise DecodeError(f"{what}, not a file")
