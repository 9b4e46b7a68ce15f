# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
# What every script here needs. Source it first.

TOP=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
# Outside of the source tree, and one a checkout: a build folder knows where its sources lie.
CACHE_DIR=${XDG_CACHE_HOME:-$HOME/.cache}/nerf_pose_refiner/$(cksum <<<"$TOP" | cut -d ' ' -f 1)
BUILD_DIR=$CACHE_DIR/build
ASSUME_YES=${CI:-false} # continuous integration has nobody to ask

# catkin's Python modules are those of the system's Python: one of pyenv, conda or a virtual
# environment must not hide it. Folders with another python3 leave PATH, where the system has one.
path_with_systems_python() {
  local folder
  local -a folders kept=()
  IFS=: read -r -a folders <<<"$PATH"
  for folder in "${folders[@]}"; do
    if [ ! -x /usr/bin/python3 ] || [ ! -x "$folder/python3" ] || [ "$folder/python3" -ef /usr/bin/python3 ]; then
      kept+=("$folder")
    fi
  done
  (IFS=: && printf %s "${kept[*]}")
}
PATH=$(path_with_systems_python)
export PATH TOP

say() { printf '%s\n' "== $*" >&2; }
die() {
  printf '%s: %s\n' "$(basename "$0")" "$*" >&2
  exit 1
}

# Takes one of the options that all scripts have; the number of words taken is in TAKEN, or 0.
take_common_option() {
  TAKEN=0
  case $1 in
    --yes | -y) ASSUME_YES=true TAKEN=1 ;;
    --build)
      [ $# -ge 2 ] || usage_error "--build needs a folder"
      # shellcheck disable=SC2034 # used by the scripts
      BUILD_DIR=$(realpath -m "$2") TAKEN=2
      ;;
    --help | -h)
      usage
      exit 0
      ;;
  esac
}

usage_error() {
  printf '%s: %s; see --help\n' "$(basename "$0")" "$*" >&2
  exit 2
}

confirm() {
  [ "$ASSUME_YES" = true ] && return
  [ -t 0 ] || die "there is no terminal to ask on: run with --yes"
  local answer
  read -r -p "$1 [y/N] " answer
  [[ $answer =~ ^[yY] ]] || die "stopped: nothing was changed"
}

as_root() {
  if [ "$(id -u)" = 0 ]; then
    "$@"
  elif command -v sudo >/dev/null; then
    sudo "$@"
  else
    die "needs root, and there is no sudo; as root: $*"
  fi
}
