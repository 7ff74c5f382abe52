#!/usr/bin/env bash
# Makes sure that the browser tests have a Chromium: one that runs, or else Debian's package.
# Usage: tools/browser.sh, from anywhere. It may be run again, and interrupted, at any time.
set -euo pipefail

readonly names=(chromium chromium-browser google-chrome)
readonly packages=(chromium fonts-liberation) # without fonts, pages have no text

log=$(mktemp) # what the last command with much to say has said
trap 'rm -f "$log"' EXIT
readonly log

say() { echo "browser: $*" >&2; }
fail() { say "$*" && exit 1; }

main() {
  if has_browser; then return; fi
  install_on_system
  has_browser || fail "no Chromium that runs, even after apt-get installed one"
}

has_browser() {
  local name
  for name in "${names[@]}"; do
    if "$name" --version >/dev/null 2>&1; then return; fi
  done
  return 1
}

install_on_system() {
  local hint="the browser tests need Chromium: install it, on Debian with apt-get install chromium"
  local root=()
  command -v apt-get >/dev/null || fail "$hint"
  if [[ $(id -u) != 0 ]]; then
    sudo -n true 2>/dev/null || fail "$hint"
    root=(sudo -n)
  fi
  "${root[@]}" apt-get -qq update >"$log" 2>&1 || true # the lists that are there may do
  say "installing ${packages[*]} with apt-get"
  "${root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get -qq -y --no-install-recommends install "${packages[@]}" >"$log" 2>&1 ||
    fail "apt-get could not install ${packages[*]} ($(tail -n 1 "$log"))"
}

main
