#!/bin/sh
# Makes or renews .venv with the packages of requirements.lock, and in it the library and the app,
# editable.
set -eu
cd "$(dirname "$0")/.."
export PIP_DISABLE_PIP_VERSION_CHECK=1

if ! .venv/bin/python -c '' 2>/dev/null; then
    if ! python=$(installer/find-python.sh); then
        echo "PipeGUI needs Python 3.11 to 3.14, and there is none here." >&2
        exit 1
    fi
    echo "Making the Python environment .venv with $python …"
    rm -rf .venv
    "$python" -m venv .venv
fi
if ! .venv/bin/python -c 'import pip' 2>/dev/null; then
    .venv/bin/python -m ensurepip >/dev/null
fi

# Both kinds of open3d bring the same files: the one with CUDA has to leave before the other comes.
if [ "$(uname -sm)" = "Linux x86_64" ]; then
    .venv/bin/python -m pip uninstall --quiet --quiet --yes open3d
fi
echo "Installing the Python packages of requirements.lock (some minutes the first time) …"
.venv/bin/python -m pip install --quiet --no-deps --require-hashes -r requirements.lock
.venv/bin/python -m pip install --quiet --no-deps --no-build-isolation --no-index \
    --editable core --editable .
