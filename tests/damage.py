"""Files with random damage, and loaders that have to notice it."""

import numpy as np

PAGE = 4096


def damaged(content, *, seed, flips=1000, pages=200, cuts=200):
    """Yield descriptions and damaged contents: a bit flipped, a page zeroed, or the end cut."""
    rng = np.random.default_rng(seed)
    for bit in rng.integers(8 * len(content), size=flips):
        changed = bytearray(content)
        changed[bit // 8] ^= 1 << bit % 8
        yield f"bit {bit} flipped", bytes(changed)
    for page in rng.integers(-(-len(content) // PAGE), size=pages):
        zeros = bytes(len(content[page * PAGE : (page + 1) * PAGE]))
        changed = content[: page * PAGE] + zeros + content[page * PAGE + len(zeros) :]
        if changed != content:  # a page may be all zeros
            yield f"page {page} zeroed", changed
    for length in rng.integers(len(content), size=cuts):
        yield f"cut to {length} bytes", content[:length]


def unnoticed(path, load, error, **how):
    """Return the damages of a file for which `load` did not raise this error.

    The file is restored afterwards.
    """
    content = path.read_bytes()
    missed = []
    try:
        for what, changed in damaged(content, **how):
            path.write_bytes(changed)
            try:
                load(path)
            except error:
                continue
            missed.append(what)
    finally:
        path.write_bytes(content)
    return missed
