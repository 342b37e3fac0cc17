"""What a picture will need, by a thread of its own while the scene is read or made."""


def begin() -> None:
    """Import what renders; at the first start, have its kernels compiled."""
    from openswim import rendering  # noqa: F401
    from openswim.transport import compiling

    compiling.begin()


def load() -> None:
    """What is the same for every scene. Whatever is amiss is said by those who need it."""
    from numba.core.compiler_lock import global_compiler_lock

    from openswim.ground import earth
    from openswim.transport import detail
    from openswim.transport.sun import direct_beam

    with global_compiler_lock:  # Numba's own library, half a second
        direct_beam.targetctx.refresh()
        direct_beam.typingctx.refresh()
    earth.load()
    detail.tile()
