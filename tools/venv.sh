# Sourced by tools/demo and tools/test: a virtual environment in .venv with this package in it.
# usage: make_venv [extra]

need() { # need COMMAND-THAT-MUST-WORK PACKAGE...
    local check=$1
    shift
    if eval "$check" >/dev/null 2>&1; then
        return
    fi
    if ! command -v apt-get >/dev/null; then
        echo "missing: $* (Debian packages); install their equivalents and run this again" >&2
        exit 1
    fi
    local root=""
    [ "$(id -u)" = 0 ] || root=sudo
    echo "installing $*"
    $root apt-get update -qq || true # a stale mirror list is no reason to stop; the next line is
    $root apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

make_venv() {
    need "command -v python3" python3
    need "python3 -m venv --help && python3 -c 'import ensurepip'" python3-venv
    need "command -v cc" gcc libc6-dev
    need "python3 -c 'import os, sysconfig as s; assert os.path.exists(s.get_path(\"include\") + \"/Python.h\")'" python3-dev
    [ -x .venv/bin/python ] || python3 -m venv .venv
    echo "installing the package into .venv"
    # Python compiles what it imports; of all that is installed here that is the smaller part.
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --no-compile ".${1:+[$1]}" \
        ${1:+"./host/biotac-lab[bench]" ./host/biotac-rig}
}
