#!/bin/sh
# Prepare everything `make demo` and `make test` need: find a Python, make .venv, install the package into it,
# and install the few system libraries its binary dependencies load.  Does nothing when all is in place.
#
#   PYTHON=...   use this interpreter instead of searching for one
set -eu
CDPATH= cd -- "$(dirname -- "$0")/.."

VENV=.venv
STAMP=$VENV/.setup-done
PYTHONPATH=
export PYTHONPATH

# The last error in what pip said that gives a reason, or else its last line.
last_said() {
    words=$(grep 'ERROR: ' "$1" | grep -v 'ERROR: Failed to build' | tail -n 1 | sed 's/.*ERROR: //')
    [ -n "$words" ] || words=$(grep '[^[:space:]]' "$1" | tail -n 1)
    printf '%s\n' "${words:-nothing}"
}
say() { printf '%s\n' "setup: $*"; }
die() { printf '%s\n' "setup: $*" >&2; exit 1; }

# ---- nothing to do? --------------------------------------------------------------------------------------------
# The stamp names what the environment was made from; the folder is part of it, for an environment cannot be moved.
state() { pwd; cksum pyproject.toml tools/setup.sh; }
if [ -z "${PYTHON:-}" ] && [ -f "$STAMP" ] && [ "$(cat "$STAMP")" = "$(state)" ] &&
    "$VENV/bin/python" -c '' 2>/dev/null; then
    exit 0
fi

# ---- an interpreter Drake has wheels for -----------------------------------------------------------------------
case "$(uname -s)/$(uname -m)" in
    Darwin/*) VERSIONS="3.13" ;;
    Linux/x86_64) VERSIONS="3.13 3.12 3.11" ;;
    *) VERSIONS="3.13 3.12" ;;
esac
version_of() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null || :; }
supported() { case " $VERSIONS " in *" $(version_of "$1") "*) [ -n "$(version_of "$1")" ] ;; *) return 1 ;; esac; }
has_venv() { "$1" -c 'import ensurepip, venv' 2>/dev/null; }

python=
if [ -n "${PYTHON:-}" ]; then
    supported "$PYTHON" || die "PYTHON=$PYTHON does not run one of the Python versions Drake supports here: $VERSIONS."
    python=$PYTHON
else
    candidates=python3
    for v in $VERSIONS; do candidates="$candidates python$v"; done
    for p in $candidates; do # best: one that can make an environment as it is
        if supported "$p" && has_venv "$p"; then python=$p; break; fi
    done
    if [ -z "$python" ]; then
        for p in $candidates; do
            if supported "$p"; then python=$p; break; fi
        done
    fi
    [ -n "$python" ] ||
        die "no suitable Python found; please install one that Drake supports here ($VERSIONS), then run make again."
fi
version=$(version_of "$python")

# ---- system libraries ------------------------------------------------------------------------------------------
# Each is looked for by asking the interpreter to load it, so a library that came by another way counts as present.
packages=  # Debian/Ubuntu names of what is missing
missing=   # the same for a reader on another system
loads() { "$python" -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1])' "$1" 2>/dev/null; }
need() {
    case " $packages " in *" $1 "*) ;; *) packages="${packages:+$packages }$1" ;; esac
    missing="${missing:+$missing, }$2"
}
look() {
    packages= missing=
    has_venv "$python" || need "python$version-venv" "the venv and ensurepip modules of Python $version"
    [ "$(uname -s)" = Linux ] || return 0
    loads libglib-2.0.so.0 || need libglib2.0-0 libglib-2.0.so.0       # Drake, Graphviz
    loads libgobject-2.0.so.0 || need libglib2.0-0 libgobject-2.0.so.0 # Graphviz
    loads libX11.so.6 || need libx11-6 libX11.so.6                     # Graphviz
    loads libXext.so.6 || need libxext6 libXext.so.6                   # Graphviz
    loads libXrender.so.1 || need libxrender1 libXrender.so.1          # Graphviz
}
fonts() { [ "$(uname -s)" != Linux ] || [ -e /etc/fonts/fonts.conf ]; } # Graphviz measures text with them

root= # how to become root; empty: already root; "no": not possible
if [ "$(id -u)" != 0 ]; then
    if sudo -n true 2>/dev/null; then root="sudo -n"; else root=no; fi
fi
install_packages() {
    # shellcheck disable=SC2086
    $root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$@" </dev/null
}

look
wanted=$packages
fonts || wanted="${wanted:+$wanted }fontconfig-config fonts-dejavu-core"
if [ -n "$wanted" ] && [ "$root" != no ] && command -v apt-get >/dev/null 2>&1; then
    say "installing system packages: $wanted"
    log=$(mktemp)
    # shellcheck disable=SC2086
    { $root apt-get update -qq && install_packages $wanted || { [ -n "$packages" ] && install_packages $packages; }; } \
        >"$log" 2>&1 || cat "$log" >&2
    rm -f "$log"
    look
fi
if [ -n "$missing" ]; then
    if command -v apt-get >/dev/null 2>&1; then
        die "please run this as root, then make again: apt-get install $packages"
    fi
    die "please install $missing (Debian calls them: $packages), then run make again."
fi

# ---- the environment -------------------------------------------------------------------------------------------
if ! supported "$VENV/bin/python" || ! "$VENV/bin/python" -m pip --version >/dev/null 2>&1 ||
    { [ -n "${PYTHON:-}" ] && [ "$(version_of "$VENV/bin/python")" != "$version" ]; } ||
    { [ -f "$STAMP" ] && [ "$(head -n 1 "$STAMP")" != "$(pwd)" ]; }; then
    say "making $VENV with $python ($version)"
    rm -rf "$VENV"
    "$python" -m venv "$VENV"
fi
if ! [ -f "$STAMP" ] || [ "$(cat "$STAMP")" != "$(state)" ]; then
    say "installing the package and what it depends on (a few minutes the first time)"
    rm -f "$STAMP"
    log=$(mktemp)
    PIP_DISABLE_PIP_VERSION_CHECK=1 "$VENV/bin/python" -m pip install --quiet --editable '.[test]' \
        </dev/null >"$log" 2>&1 || {
        cat "$log" >&2
        last=$(last_said "$log")
        rm -f "$log"
        die "pip could not install the package; it said last: $last"
    }
    rm -f "$log"
    error=$("$VENV/bin/python" -c 'import pydrake.systems.framework, pygraphviz, cv2, numba' 2>&1) ||
        die "the installed packages do not load: $(printf '%s\n' "$error" | tail -n 1)"
    state >"$STAMP"
fi
