"""LZF, the compression of PCD files (M. Lehmann, LibLZF): what is packed, or that it is damaged."""

MAX_RATIO = 132
"""Three bytes stand for at most 264."""
LITERAL = 32
"""Control bytes below it say how many bytes follow as they are, less one."""
LONG = 7
"""A length of which the next byte says the rest."""


def unpack(packed: bytes, size: int) -> bytes | None:
    """Return the `size` bytes that are packed, or None where it is not as many, or leads outside.

    Nothing is allocated before `size` is known to be possible.
    """
    if size > MAX_RATIO * len(packed):
        return None
    out, place = bytearray(), 0
    try:
        while place < len(packed) and len(out) <= size:
            control = packed[place]
            place += 1
            if control < LITERAL:
                if place + control >= len(packed):
                    return None
                out += packed[place : place + control + 1]
                place += control + 1
                continue
            length = control >> 5
            if length == LONG:
                length += packed[place]
                place += 1
            start = len(out) - ((control & 31) << 8) - packed[place] - 1
            place += 1
            if start < 0:
                return None
            # What is copied may reach into what it makes.
            part = out[start : start + length + 2]
            out += (part * (-(-(length + 2) // len(part))))[: length + 2]
    except IndexError:
        return None
    return bytes(out) if len(out) == size else None
