#!/bin/sh
# Installs the system packages that are missing, on Debian and Ubuntu; elsewhere does nothing.
set -eu
cd "$(dirname "$0")/.."

# Window and OpenGL libraries of Qt and VTK, threads and USB for numba and open3d, a font, and
# the virtual display in which tests open their windows where there is no other.
packages="
    libdbus-1-3 libegl1 libfontconfig1 libgl1 libglib2.0-0 libgomp1 libusb-1.0-0
    libxcb-cursor0 libxcb-icccm4 libxcb-keysyms1 libxcb-shape0 libxcursor1
    libxkbcommon-x11-0 libxkbcommon0 fonts-dejavu-core xauth xvfb"

if ! command -v apt-get >/dev/null; then
    exit 0
fi

is_installed() {
    # Some library packages were renamed when 64-bit time came, such as libglib2.0-0t64.
    dpkg-query -W -f '${db:Status-Abbrev}\n' "$1" "$1t64" 2>/dev/null | grep -q '^ii'
}

missing=""
for package in $packages; do
    is_installed "$package" || missing="$missing $package"
done
if python=$(installer/find-python.sh); then
    if ! "$python" -c 'import ensurepip' 2>/dev/null; then
        missing="$missing $("$python" -c 'import sys; print("python3.%d-venv" % sys.version_info[1])')"
    fi
else
    missing="$missing python3 python3-venv"
fi
if [ -z "$missing" ]; then
    exit 0
fi

if [ "$(id -u)" -eq 0 ]; then
    as_root="env"
elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    as_root="sudo -n env"
else
    echo "System packages are missing. Install them with this command, then try again:" >&2
    echo "    sudo apt-get update && sudo apt-get install --no-install-recommends$missing" >&2
    exit 1
fi

echo "Installing system packages:$missing …"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
# A repository of somebody else that does not answer is no reason to stop: installing will tell.
$as_root apt-get update >"$log" 2>&1 || true
# shellcheck disable=SC2086
if ! $as_root DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends \
    -o DPkg::Lock::Timeout=120 $missing >>"$log" 2>&1; then
    tail -n 30 "$log" >&2
    echo "The system packages could not be installed; apt's last words are above." >&2
    exit 1
fi
