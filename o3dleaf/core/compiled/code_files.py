"""Machine code in files: each begins with the key that it was made for, and is read for that key only.

A key names Numba, Python, the processors, the function, its arguments and the source; a file under the right name
for another key, or one that was cut off, is none at all. The payload is a pickle: files come from the package's own
folder, or from where Numba keeps what it has compiled, never from a user's data.
"""

import hashlib
import tempfile
from pathlib import Path

DIGEST = hashlib.sha256().digest_size


def file_name(function: str, key: str) -> str:
    """Return the name of the file of a function, by its dotted name, for a key; without suffix.

    What depends on the source is the key's last line and not part of the name, so that new code replaces old.
    """
    lasting = key.rpartition("\n")[0]
    return f"{function}-{hashlib.sha256(lasting.encode()).hexdigest()[:16]}"


def read_code(path: Path, key: str) -> bytes | None:
    """Return the payload of a file, or None if there is none that was made for this key."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    head = key.encode() + b"\0"
    if not content.startswith(head):
        return None
    digest, payload = content[len(head) : len(head) + DIGEST], content[len(head) + DIGEST :]
    return payload if hashlib.sha256(payload).digest() == digest else None


def write_code(path: Path, key: str, payload: bytes) -> None:
    """Write a file whole or not at all; where that is not possible, leave it: it will be compiled again."""
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=path.stem, delete=False) as file:
            temporary = file.name
            file.write(key.encode() + b"\0" + hashlib.sha256(payload).digest() + payload)
        Path(temporary).replace(path)
    except OSError:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
