#!/usr/bin/env bash
# Install system packages that are missing: `install_system.sh venv chromium postgresql node ros`. Needs root or sudo if
# something is missing.
set -euo pipefail
cd "$(dirname "$0")/.."

as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then sudo "$@"
    else echo "a package is missing and needs root. Run as root: $*" >&2; exit 1
    fi
}

updated=""
apt_install() {
    command -v apt-get >/dev/null || { echo "this system has no apt-get. Install by hand: $*" >&2; exit 1; }
    [ -n "$updated" ] || { as_root apt-get update -qq; updated=yes; }
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

for part in "$@"; do
    case $part in
        venv) apt_install python3-venv ;;
        chromium)
            command -v chromium >/dev/null || command -v chromium-browser >/dev/null || apt_install chromium ;;
        postgresql)
            command -v postgres >/dev/null || ls /usr/lib/postgresql/*/bin/postgres >/dev/null 2>&1 || apt_install postgresql ;;
        node) command -v node >/dev/null || apt_install nodejs ;;
        ros) [ ! -x scripts/install_ros.sh ] || scripts/install_ros.sh ;;
        *) echo "install_system.sh: unknown part $part" >&2; exit 2 ;;
    esac
done
