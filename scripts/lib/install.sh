# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
# Installs what is missing, and nothing and without the network when nothing is. Needs common.sh.

NOETIC=/opt/ros/noetic

install_dependencies() {
  if [ -f "$NOETIC/setup.bash" ]; then
    use_noetic
    install_with_rosdep
  elif is_debian_12; then
    install_with_apt
  elif command -v cmake >/dev/null; then
    say "neither Debian 12 nor $NOETIC: nothing is installed; CMake will say what is missing"
  else
    die "neither Debian 12 nor $NOETIC: install the packages that package.xml names by hand"
  fi
}

is_debian_12() {
  [ -r /etc/os-release ] && (
    # shellcheck disable=SC1091
    . /etc/os-release
    [ "${ID:-}" = debian ] && [ "${VERSION_ID:-0}" = 12 ]
  )
}

# Of the packages in scripts/packages_debian.txt, those that are not installed.
missing_packages() {
  local wanted installed
  wanted=$(grep -Ev '^(#|$)' "$TOP/scripts/packages_debian.txt" | sort)
  # shellcheck disable=SC2086 # one word a package
  installed=$({ dpkg-query -W -f='${db:Status-Status} ${Package}\n' $wanted 2>/dev/null || true; } |
    sed -n 's/^installed //p' | sort)
  comm -23 <(printf '%s\n' "$wanted") <(printf '%s\n' "$installed")
}

install_with_apt() {
  local packages
  packages=$(missing_packages)
  [ -n "$packages" ] || return 0
  say "these packages will be installed from Debian:"
  printf '%s\n' "$packages" | fmt -w 100 >&2
  confirm "Install them?"
  as_root apt-get update
  # shellcheck disable=SC2086 # one word a package
  as_root env DEBIAN_FRONTEND=noninteractive \
    apt-get install --yes --no-install-recommends $packages
}

use_noetic() {
  set +u # its scripts use variables that are not set
  # shellcheck disable=SC1091
  . "$NOETIC/setup.bash"
  set -u
}

rosdep_of_package() {
  rosdep "$1" --from-paths "$TOP" --ignore-src --rosdistro noetic "${@:2}"
}

# On a machine with Noetic only rosdep installs: it knows which ROS this is, and the
# distribution's own ROS packages would be another one.
install_with_rosdep() {
  command -v rosdep >/dev/null || die "$NOETIC is here, but rosdep is not: see wiki.ros.org/rosdep"
  rosdep_of_package check >/dev/null 2>&1 && return
  if [ ! -e /etc/ros/rosdep/sources.list.d/20-default.list ] && [ -z "${ROSDEP_SOURCE_PATH:-}" ]; then
    say "rosdep was never set up here: its list of sources will be downloaded"
    confirm "Run 'rosdep init'?"
    as_root rosdep init
  fi
  rosdep update --rosdistro noetic >&2
  rosdep_of_package check >/dev/null 2>&1 && return
  say "rosdep will run:"
  rosdep_of_package install --simulate >&2
  confirm "Run it?"
  rosdep_of_package install --default-yes
}
