#!/usr/bin/env bash
# Set up .venv: `setup.sh run` for the tool, `test` also for its tests, `dist` and `docs` only for their own programs.
set -euo pipefail
cd "$(dirname "$0")/.."
kind=${1:-run}
case $kind in
    run) extras="[viewer,video]" ;;
    test) extras="[neural,viewer,postgresql,bags,video,lerobot,ray,scan,docs,dev]" system="chromium postgresql ros" ;;
    dist | docs) ;;
    *) echo "usage: scripts/setup.sh [run|test|dist|docs]" >&2; exit 2 ;;
esac

fingerprint=$(cat pyproject.toml scripts/*.sh | sha256sum | cut -c1-16)
stamp=.venv/.set-up-for-$kind
[ -f "$stamp" ] && [ "$(cat "$stamp")" = "$fingerprint" ] && exit 0

find_python() {
    local candidate
    for candidate in "${PYTHON:-}" python3 python3.13 python3.12 python3.11; do
        [ -n "$candidate" ] && command -v "$candidate" >/dev/null || continue
        "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { echo "$candidate"; return; }
    done
    echo "vsnbench needs Python 3.11 or newer (set PYTHON=/path/to/python3.11)" >&2
    return 1
}

if [ ! -x .venv/bin/python ]; then
    python=$(find_python)
    "$python" -c 'import ensurepip, venv' 2>/dev/null || scripts/install_system.sh venv
    echo "setting up .venv (once; a few minutes)"
    "$python" -m venv .venv
fi
pip() { .venv/bin/python -m pip --disable-pip-version-check install --quiet "$@"; }
packages_of() { # a list in pyproject.toml
    .venv/bin/python -c 'import sys, tomllib
content = tomllib.load(open("pyproject.toml", "rb"))
print(*(content["project"]["optional-dependencies"] | content["dependency-groups"])[sys.argv[1]], sep="\n")' "$1"
}
case $kind in
    dist | docs)
        mapfile -t packages < <(packages_of $kind)
        pip "${packages[@]}" ;;
    run) pip --editable ".$extras" ;;
    test)
        pip torch==2.13.0 # first and alone, so that no later package selects another build
        pip --editable ".$extras"
        scripts/install_system.sh $system
        scripts/install_ros2.sh
        command -v node >/dev/null ||
            echo "node is missing: the tests of examples/node_policy are skipped (scripts/install_system.sh node)" ;;
esac
echo "$fingerprint" > "$stamp"
