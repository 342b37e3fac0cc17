"""Run as a script, in a process of its own with little time and memory: is an HDF5 file safe to open?

    python probe.py LIBNETCDF LIBHDF5 FILE

Damaged headers keep the HDF5 library busy for ever, or crash it, and a file may name other files as the
place of its data. Exit codes: 0 safe, 3 points to other files, 4 the libraries cannot be asked, anything else damaged.
Nothing of this package is imported, and no numpy: this takes some hundredths of a second.
"""

import ctypes
import os
import sys

SAFE, POINTS_ELSEWHERE, UNKNOWN = 0, 3, 4
CPU_S, ADDRESSES = 5, 4 << 30
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


def main(netcdf: str, hdf: str, name: str) -> int:
    limit()
    try:
        libraries = ctypes.CDLL(netcdf), ctypes.CDLL(hdf)
        if points_elsewhere(libraries[1], os.fsencode(name)):
            return POINTS_ELSEWHERE
    except (OSError, AttributeError):
        return UNKNOWN
    return SAFE if opens(libraries[0], os.fsencode(name)) else 1


if __name__ == "__main__":
    code = main(*sys.argv[1:])
    sys.stdout.flush()
    os._exit(code)  # closing a damaged file may never end
