"""Builds a shared library that forwards every call to a simulated SmarAct library.

A program written for the vendor's library loads the file instead of it, and is not changed. The
library runs Python inside the program: the interpreter that is there already, or one of its own.
"""

import argparse
import ctypes
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal

from cosmic.frame.errors import ArgumentError, NotAvailable
from cosmic.mico.hw import scu3d_ctypes, smaractctl_ctypes

Make = Literal["scu3d", "smaractctl"]
_PROTOTYPES: Final[dict[str, Mapping[str, tuple[Any, ...]]]] = {
    "scu3d": scu3d_ctypes.PROTOTYPES,
    "smaractctl": smaractctl_ctypes.PROTOTYPES,
}
FILES: Final = {"scu3d": "libscu3dcontrol.so", "smaractctl": "libsmaractctl.so"}
_C_TYPES: Final[dict[Any, str]] = {
    ctypes.c_int8: "signed char",
    ctypes.c_uint8: "unsigned char",
    ctypes.c_int32: "int",
    ctypes.c_uint32: "unsigned int",
    ctypes.c_int64: "long long",
    ctypes.c_size_t: "size_t",
}
_HEAD: Final = """\
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <stddef.h>
#include <stdio.h>

static void *table[%(count)d];
static pthread_once_t once = PTHREAD_ONCE_INIT;

static void start(void)
{
    char code[%(room)d];
    if (!dlsym(RTLD_DEFAULT, "Py_IsInitialized"))
        dlopen("%(python)s", RTLD_NOW | RTLD_GLOBAL);
    int (*initialized)(void) = dlsym(RTLD_DEFAULT, "Py_IsInitialized");
    void (*initialize)(int) = dlsym(RTLD_DEFAULT, "Py_InitializeEx");
    void *(*let_go)(void) = dlsym(RTLD_DEFAULT, "PyEval_SaveThread");
    int (*ensure)(void) = dlsym(RTLD_DEFAULT, "PyGILState_Ensure");
    void (*release)(int) = dlsym(RTLD_DEFAULT, "PyGILState_Release");
    int (*run)(const char *, void *) = dlsym(RTLD_DEFAULT, "PyRun_SimpleStringFlags");
    if (!initialized || !initialize || !let_go || !ensure || !release || !run)
        return;
    if (!initialized()) {
        initialize(0);
        let_go();
    }
    int state = ensure();
    snprintf(code, sizeof code, "%(code)s", (size_t)table);
    run(code, NULL);
    release(state);
}
"""
_BODY: Final = """\
{result} {name}({parameters})
{{
    pthread_once(&once, start);
    return table[{number}] ? (({result} (*)({types}))table[{number}])({arguments}) : {failure};
}}
"""
_COMMUNICATION_FAILED: Final = {"scu3d": 12, "smaractctl": 0xF004}
_kept: list[object] = []


def _simulated(make: Make, layout: str, rate: float, seed: int) -> object:
    from cosmic.mico.hw.sim_scu3d import load_simulated_library as load_scu3d
    from cosmic.mico.hw.sim_smaractctl import load_simulated_library as load_smaractctl

    load = load_scu3d if make == "scu3d" else load_smaractctl
    return load(layout, rate, seed)


def fill(make: Make, address: int, layout: str, rate: float, seed: int) -> None:
    """Load a simulated library and write the addresses of its functions into the table there."""
    library = _simulated(make, layout, rate, seed)
    _kept.append(library)
    names = _PROTOTYPES[make]
    table = (ctypes.c_void_p * len(names)).from_address(address)
    for number, name in enumerate(names):
        table[number] = ctypes.cast(getattr(library, name), ctypes.c_void_p).value


def source(make: Make, *, layout: str, rate: float, seed: int) -> str:
    """Return the C source of the library for `make`."""
    paths = [path for path in sys.path if path]
    begin = f"import sys; sys.path += [p for p in {paths!r} if p not in sys.path]; "
    given = f"{layout!r}, {rate!r}, {seed!r}"
    python = (  # a format of C: a folder may have a percent sign in its name
        begin.replace("%", "%%")
        + f"from cosmic.mico.hw.forwarding import fill; fill({make!r}, %zu, {given})"
    )
    code = python.replace("\\", "\\\\").replace('"', '\\"')
    folder, name = (sysconfig.get_config_var(key) for key in ("LIBDIR", "INSTSONAME"))
    head = _HEAD % {
        "count": len(_PROTOTYPES[make]),
        "room": len(python) + 100,
        "python": Path(str(folder)) / str(name),
        "code": code,
    }
    bodies = [_function(make, number, name) for number, name in enumerate(_PROTOTYPES[make])]
    return "\n".join([head, *bodies])


def _function(make: Make, number: int, name: str) -> str:
    types = [_C_TYPES.get(each, "void *") for each in _PROTOTYPES[make][name]]
    text = make == "smaractctl" and smaractctl_ctypes.result_type(name) is ctypes.c_void_p
    parameters = ", ".join(f"{each} a{at}" for at, each in enumerate(types))
    return _BODY.format(
        result="void *" if text else "unsigned int",
        name=name,
        number=number,
        parameters=parameters or "void",
        types=", ".join(types) or "void",
        arguments=", ".join(f"a{at}" for at in range(len(types))),
        failure='(void *)""' if text else _COMMUNICATION_FAILED[make],
    )


def build(make: Make, folder: Path, *, layout: str, rate: float, seed: int) -> Path:
    """Write and compile the library for `make` into `folder`; return its path.

    Raises
    ------
    ArgumentError
        Layout or rate are none.
    NotAvailable
        There is no C compiler named gcc, it failed, or the folder cannot be written.
    """
    try:
        _simulated(make, layout, rate, seed)  # what it would fail with in the program that uses it
    except ValueError as exc:
        raise ArgumentError(f"{FILES[make]} cannot be built so: {exc}") from exc
    library = folder / FILES[make]
    written = library.with_suffix(".c")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        written.write_text(source(make, layout=layout, rate=rate, seed=seed), "utf-8")
    except OSError as exc:
        raise NotAvailable(
            f"{written}: cannot be written ({exc.strerror or exc}); name another folder"
        ) from exc
    command = [
        "gcc",
        "-O2",
        "-shared",
        "-fPIC",
        "-o",
        str(library),
        str(written),
        "-ldl",
        "-lpthread",
    ]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as exc:
        raise NotAvailable(f"gcc is needed to build {library.name}: {exc}") from exc
    if done.returncode != 0:
        raise NotAvailable(f"gcc could not build {library.name}: {done.stderr.strip()}")
    return library


def main(arguments: Sequence[str] | None = None) -> None:
    """Build the library that the command line names and say where it is."""
    parser = argparse.ArgumentParser(prog="cosmic.mico.hw.forwarding", description=__doc__)
    parser.add_argument("make", choices=sorted(FILES))
    parser.add_argument("--out", type=Path, required=True, help="folder of the library")
    parser.add_argument("--layout", default="LLL,LLL,LLN,RNN", help="stages of each device")
    parser.add_argument("--rate", type=float, default=1.0, help="simulated seconds a second")
    parser.add_argument("--seed", type=int, default=0, help="of all randomness")
    asked = parser.parse_args(arguments)
    built = build(asked.make, asked.out, layout=asked.layout, rate=asked.rate, seed=asked.seed)
    sys.stdout.write(f"{built}\n")


if __name__ == "__main__":
    main()
