# shellcheck shell=sh
# Set-up shared by ./run and ./test; sourced with $root set to the checkout.
#
# `prepare run` or `prepare dev` leaves a virtual environment in $venv that has what
# pyproject.toml asks for at the versions of constraints.txt. When nothing has changed since the
# last time this takes some hundredths of a second and no network.

venv=${root:?is set by the script that sources this}/.venv
tab=$(printf '\t')

say() { printf '%s\n' "$*" >&2; }
die() {
    say "$*"
    exit 1
}

# --- packages of the system -------------------------------------------------------------------

# File that the dynamic linker must find, and the Debian/Ubuntu package that has it. Taken from
# the libraries that PySide6's wheels are linked against and do not bring along.
QT_LIBRARIES='
libEGL.so.1 libegl1
libGL.so.1 libgl1
libX11.so.6 libx11-6
libdbus-1.so.3 libdbus-1-3
libfontconfig.so.1 libfontconfig1
libfreetype.so.6 libfreetype6
libglib-2.0.so.0 libglib2.0-0
libgssapi_krb5.so.2 libgssapi-krb5-2
libxkbcommon.so.0 libxkbcommon0
'
# What the plug-in for windows on an X display needs besides.
WINDOW_LIBRARIES='
libX11-xcb.so.1 libx11-xcb1
libxcb.so.1 libxcb1
libxcb-cursor.so.0 libxcb-cursor0
libxcb-glx.so.0 libxcb-glx0
libxcb-icccm.so.4 libxcb-icccm4
libxcb-image.so.0 libxcb-image0
libxcb-keysyms.so.1 libxcb-keysyms1
libxcb-randr.so.0 libxcb-randr0
libxcb-render.so.0 libxcb-render0
libxcb-render-util.so.0 libxcb-render-util0
libxcb-shape.so.0 libxcb-shape0
libxcb-shm.so.0 libxcb-shm0
libxcb-sync.so.1 libxcb-sync1
libxcb-util.so.1 libxcb-util1
libxcb-xfixes.so.0 libxcb-xfixes0
libxcb-xkb.so.1 libxcb-xkb1
libxkbcommon-x11.so.0 libxkbcommon-x11-0
'

on_linux() { [ "$(uname -s)" = Linux ]; }

opens_window() { [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; }

any_font() {
    for font in /usr/share/fonts/*/*.[ot]t[cf] /usr/share/fonts/*/*/*.[ot]t[cf] \
        /usr/local/share/fonts/*.[ot]t[cf] "${HOME:-/nonexistent}"/.local/share/fonts/*.[ot]t[cf]; do
        [ -e "$font" ] && return 0
    done
    return 1
}

# find_missing FILE PACKAGE...: sets $missing to the packages whose file is not there.
find_missing() {
    missing=
    on_linux && [ -x /sbin/ldconfig ] || return 0
    known=$(/sbin/ldconfig -p 2>/dev/null) || return 0
    while [ $# -gt 1 ]; do
        case $known in
            *"$tab$1 ("*) ;;
            *) missing="$missing $2" ;;
        esac
        shift 2
    done
    missing=${missing# }
}

# find_needed run|dev: sets $needed to the packages without which nothing works, and $offered to
# those for windows, which a display that appears later needs.
find_needed() {
    # shellcheck disable=SC2086
    find_missing $QT_LIBRARIES
    needed=$missing
    if on_linux && ! any_font; then needed="$needed fonts-dejavu-core"; fi
    offered=
    [ "$1" = run ] || return 0
    # shellcheck disable=SC2086
    find_missing $WINDOW_LIBRARIES
    if opens_window; then needed="$needed $missing"; else offered=$missing; fi
}

# Installs packages with apt where that needs no password; otherwise ends with the command to give.
install_packages() {
    if ! command -v apt-get >/dev/null 2>&1; then
        die "CoSMic needs what Debian calls $*: install it with your system's package manager."
    fi
    as_root=
    if [ "$(id -u)" != 0 ]; then
        sudo -n true >/dev/null 2>&1 ||
            die "CoSMic needs packages of the system; please run: sudo apt-get install $*"
        as_root='sudo -n'
    fi
    say "Installing packages of the system: $* ..."
    export DEBIAN_FRONTEND=noninteractive
    $as_root apt-get -qq update >/dev/null ||
        say "The package lists could not be brought up to date; going on with the old ones."
    $as_root apt-get -qq install -y --no-install-recommends "$@" >/dev/null ||
        die "These packages could not be installed; please run: sudo apt-get install $*"
}

# --- Python -----------------------------------------------------------------------------------

# Sets $python to an interpreter that is new enough.
find_python() {
    found=
    for python in python3 python3.11 python3.12 python3.13 python3.14; do
        command -v "$python" >/dev/null 2>&1 || continue
        version=$("$python" -c 'import platform, sys
print(platform.python_version())
sys.exit(sys.version_info < (3, 11))' 2>/dev/null) && return 0
        found="$found $python is ${version:-broken},"
    done
    found=${found%,}
    die "CoSMic needs Python 3.11 or newer:${found:- there is no python3 here}; install it first."
}

# Installs Debian's python3.x-venv where a Python came without it.
ensure_venv_module() {
    "$python" -c 'import ensurepip, venv' >/dev/null 2>&1 && return 0
    install_packages "$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"
    "$python" -c 'import ensurepip, venv' >/dev/null 2>&1 ||
        die "$python has no module 'ensurepip' or 'venv'; CoSMic needs both."
}

# True when $venv was made for this place and its Python and pip still work.
venv_works() {
    [ -x "$venv/bin/python" ] && [ -f "$venv/bin/pip" ] &&
        grep -qF "$venv/bin/" "$venv/bin/pip" &&
        "$venv/bin/python" -m pip --version >/dev/null 2>&1
}

make_venv() {
    if [ -e "$venv" ] || [ -h "$venv" ]; then
        say "The virtual environment .venv does not fit this place or this Python; making it anew."
        rm -rf -- "$venv"
    fi
    find_python
    ensure_venv_module
    say "Making the virtual environment .venv with Python $version ..."
    "$python" -m venv "$venv" || die "The virtual environment could not be made in $root."
}

# Sets $python_now to the version of the environment's Python, empty when something is not there.
find_venv_version() {
    python_now=$("$venv/bin/python" -c 'import sys
from importlib.util import find_spec
print("Python %d.%d" % sys.version_info[:2])
sys.exit(not all(map(find_spec, ("cosmic", "PySide6", "numpy", "pydantic"))))' 2>/dev/null) ||
        python_now=
}

# What an installation depends on, in one text: compared with the stamp that it left.
installation_key() {
    printf '%s\n' "$root" "$python_now"
    cksum "$root/pyproject.toml" "$root/constraints.txt"
}

# pip_install WHAT...: into the environment, at the versions of constraints.txt.
pip_install() {
    "$venv/bin/python" -m pip install --quiet --no-input --disable-pip-version-check \
        --constraint "$root/constraints.txt" "$@"
}

# --- both -------------------------------------------------------------------------------------

# prepare run|dev
prepare() {
    find_needed "$1"
    # shellcheck disable=SC2086
    [ -z "${needed# }" ] || install_packages $needed

    find_venv_version
    key=$(installation_key)
    stamp=$venv/.cosmic-$1
    if [ -n "$python_now" ] && [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$key" ]; then
        return 0
    fi

    # Once, and no reason to end: there may never be a display here.
    # shellcheck disable=SC2086
    [ -z "$offered" ] || (install_packages $offered) ||
        say "Without them no window opens, should there be a display some day; going on."

    venv_works || make_venv
    rm -f -- "$venv"/.cosmic-*
    if [ "$1" = dev ]; then what="${root}[dev]"; else what=$root; fi
    say "Installing what CoSMic needs into .venv (the first time takes a minute or more) ..."
    pip_install --editable "$what" ||
        die "The installation did not succeed: see above; it needs the network the first time."
    if [ "$1" = run ]; then "$venv/bin/python" "$root/tools/install_extras.py"; fi
    find_venv_version
    installation_key >"$venv/.cosmic-run"
    if [ "$1" = dev ]; then cp -- "$venv/.cosmic-run" "$stamp"; fi
}
