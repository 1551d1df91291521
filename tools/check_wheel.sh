#!/bin/sh
# Build the wheel of this tree, install it into a new environment and characterise a fibre with it
# from an empty folder: what is in the tree, but not in the wheel, is missed here.
set -eu
unset PYTHONPATH PYTHONDONTWRITEBYTECODE
root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd -P)
python=${1:-$root/.venv/bin/python}
work=$(mktemp -d "${TMPDIR:-/tmp}/cosmic-wheel.XXXXXX")
trap 'rm -rf -- "$work"' EXIT
begun=$(date +%s)
say() { printf '%s: %s s\n' "$*" "$(($(date +%s) - begun))"; }

"$python" -m pip wheel --quiet --no-deps --wheel-dir "$work/wheel" "$root"
say "wheel built"
"$python" -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet --no-input --disable-pip-version-check \
    --no-compile --constraint "$root/constraints.txt" "$work"/wheel/cosmic-*.whl
say "wheel installed"

mkdir "$work/empty"
cd "$work/empty"
export QT_QPA_PLATFORM=offscreen
cosmic=$work/venv/bin/cosmic
"$cosmic" --version
"$cosmic" init config
"$cosmic" check config
"$cosmic" doctor --config config
"$cosmic" campaign quick --out campaign --rate 20
[ -s campaign/report.html ] && [ -s campaign/fibres.csv ]
say "campaign"
