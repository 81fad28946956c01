# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from .errors import InvalidInput


@contextlib.contextmanager
def atomic_output(path: Path | str, keep: bool = True) -> Iterator[Path]:
    """A temporary path beside `path`, with its suffix, that becomes `path` when the block ends well.

    Otherwise, or with keep=False, it is removed. Raises InvalidInput where the folder takes no file.
    """
    path = Path(path).absolute()
    remedy = "give a path that can be written"
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise InvalidInput(str(path), f"it cannot be written ({error.strerror})", remedy) from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        if keep:
            # mkstemp makes private files; what a program writes for its user is as the user's mask says.
            temporary.chmod(0o666 & ~_umask())
            os.replace(temporary, path)
    except OSError as error:
        raise InvalidInput(str(path), f"it cannot be written ({error.strerror})", remedy) from error
    finally:
        with contextlib.suppress(FileNotFoundError):
            temporary.unlink()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
