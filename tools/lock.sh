#!/usr/bin/env bash
# Writes constraints.txt: the exact version of everything that the set-up installs.
# Python must be the oldest supported one, so that every version installs on later ones too.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

python3.11 -m venv "$scratch/venv"
pip=("$scratch/venv/bin/python" -m pip --disable-pip-version-check --quiet)
"${pip[@]}" install --upgrade pip
"${pip[@]}" install . --group dev hatchling editables
{
  echo "# The exact versions that are developed and tested with; written by \`make lock\`."
  "${pip[@]}" freeze --all --exclude drpt-render --exclude setuptools
} >"$scratch/constraints.txt"
mv "$scratch/constraints.txt" constraints.txt
