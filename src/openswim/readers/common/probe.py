"""Run as a script: which HDF5 files are safe to open?

    python probe.py LIBNETCDF LIBHDF5

Damaged headers keep the HDF5 library busy for ever, or crash it, and a file may name other files as the
place of its data. So each file is opened by a process of its own with little time and memory. It is a fork of this
one, which opens none, loads the libraries once, and ends with its input. Names come in by standard input, one at a
time, each ended by a null byte, an empty one where it is the end; for each one byte goes out: 0 safe, 1 damaged,
3 points to other files, 4 the libraries cannot be asked, 5 no answer in time. Nothing of this package is imported, and
no numpy: this takes some hundredths of a second.
"""

import ctypes
import os
import select
import signal
import sys
from collections.abc import Iterator

SAFE, DAMAGED, POINTS_ELSEWHERE, UNKNOWN, LATE = 0, 1, 3, 4, 5
CPU_S, ADDRESSES = 5, 4 << 30
WALL_S = 120.0
_VIRTUAL = 3  # H5D_VIRTUAL
_FIRST_OTHER_LINK = 64  # H5L_TYPE_EXTERNAL; kinds above are of users' own
_MOST_NAME = 4096


def limit() -> None:
    """Little time, and no memory to speak of."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 1))
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, OSError, ValueError):
        pass


def points_elsewhere(hdf: ctypes.CDLL, name: bytes) -> bool:
    """Whether a link, or the data of a variable, lies in another file."""
    hid = ctypes.c_int64
    for function in ("H5Fopen", "H5Dopen2", "H5Dget_create_plist"):
        getattr(hdf, function).restype = hid
    hdf.H5Fopen.argtypes = [ctypes.c_char_p, ctypes.c_uint, hid]
    hdf.H5Dopen2.argtypes = [hid, ctypes.c_char_p, hid]
    for function in ("H5Dget_create_plist", "H5Pget_external_count", "H5Pget_layout", "H5Dclose", "H5Pclose"):
        getattr(hdf, function).argtypes = [hid]
    hdf.H5Eset_auto2.argtypes = [hid, ctypes.c_void_p, ctypes.c_void_p]
    hdf.H5open()
    hdf.H5Eset_auto2(0, None, None)
    file = hdf.H5Fopen(name, 0, 0)
    if file < 0:
        return False
    visit = ctypes.CFUNCTYPE(ctypes.c_int, hid, ctypes.c_char_p, ctypes.POINTER(ctypes.c_int), ctypes.c_void_p)

    @visit
    def look(group: int, link: bytes, info: "ctypes._Pointer[ctypes.c_int]", _: int) -> int:
        kind = info[0]
        if kind >= _FIRST_OTHER_LINK:
            return 1
        if kind != 0:  # soft: to what is visited by itself
            return 0
        data = hdf.H5Dopen2(group, link, 0)
        if data < 0:
            return 0
        how = hdf.H5Dget_create_plist(data)
        elsewhere = hdf.H5Pget_external_count(how) > 0 or hdf.H5Pget_layout(how) == _VIRTUAL
        hdf.H5Pclose(how)
        hdf.H5Dclose(data)
        return int(elsewhere)

    hdf.H5Lvisit2.argtypes = [hid, ctypes.c_int, ctypes.c_int, visit, ctypes.c_void_p]
    return bool(hdf.H5Lvisit2(file, 0, 2, look, None) > 0)


def opens(netcdf: ctypes.CDLL, name: bytes) -> bool:
    """Whether netCDF opens a file and finds what its variables are."""
    number, dims, variables, attributes, rest = (ctypes.c_int() for _ in range(5))
    if netcdf.nc_open(name, 0, ctypes.byref(number)):
        return False
    found = netcdf.nc_inq(number, *(ctypes.byref(n) for n in (dims, variables, attributes, rest)))
    text = ctypes.create_string_buffer(_MOST_NAME)
    for variable in (-1, *range(variables.value)):
        count = ctypes.c_int()
        netcdf.nc_inq_varnatts(number, variable, ctypes.byref(count))
        for n in range(count.value):
            netcdf.nc_inq_attname(number, variable, n, text)
    return not found


def verdict(netcdf: ctypes.CDLL, hdf: ctypes.CDLL, name: bytes) -> int:
    """What a file is; a damaged one may never let this end."""
    try:
        if points_elsewhere(hdf, name):
            return POINTS_ELSEWHERE
        return SAFE if opens(netcdf, name) else DAMAGED
    except AttributeError:
        return UNKNOWN


def probed(libraries: tuple[ctypes.CDLL, ctypes.CDLL], name: bytes) -> int:
    """The verdict of a process that does nothing else."""
    alive, held = os.pipe()  # which closes as that process ends, however it does
    try:
        child = os.fork()
    except OSError:
        return UNKNOWN
    if not child:
        _answer(libraries, name)
    os.close(held)
    ended, _, _ = select.select([0, alive], [], [], WALL_S)
    os.close(alive)
    if alive not in ended:
        os.kill(child, signal.SIGKILL)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if not ended:
        return LATE
    return code if code in (SAFE, POINTS_ELSEWHERE, UNKNOWN) else DAMAGED


def _answer(libraries: tuple[ctypes.CDLL, ctypes.CDLL], name: bytes) -> None:
    """The verdict as the code with which this process ends."""
    code = DAMAGED
    try:
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1):  # which are for the one who asks
            os.dup2(nothing, stream)
        limit()
        code = verdict(*libraries, name)
    finally:
        os._exit(code)  # closing a damaged file may never end


def names() -> Iterator[bytes]:
    """The names that come in, until whoever asks is done, or dead."""
    read = b""
    while more := os.read(0, 65536):
        *whole, read = (read + more).split(b"\0")
        if b"" in whole:
            return
        yield from whole


def main(netcdf: str, hdf: str) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever asks hears it too, and says that it is the end
    try:
        libraries = ctypes.CDLL(netcdf), ctypes.CDLL(hdf)
    except OSError:
        for _ in names():
            os.write(1, bytes([UNKNOWN]))
        return
    verdict(*libraries, b"")  # of no file: what they make ready for their first one is ready for all forks
    for name in names():
        os.write(1, bytes([probed(libraries, name)]))


if __name__ == "__main__":
    main(*sys.argv[1:])
