# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
# Builds the package into BUILD_DIR, outside of the source tree. Needs common.sh.

# What the demo needs of it: no tests, no tools.
# shellcheck disable=SC2034 # used by the script
DEMO_TARGETS=(nerf_pose_refiner_nodelets nerf_pose_refiner_decode_images_node
  nerf_pose_refiner_pose_refiner_node nerf_pose_refiner_generate_messages_py)

# The one GPU architecture to build for: this machine's, or a common one where there is no GPU.
cuda_architecture() {
  local capability
  capability=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader 2>/dev/null | head -n 1) || true
  [[ $capability =~ ^[0-9]+\.[0-9]+$ ]] || capability=8.0
  printf '%s' "${capability/./}"
}

# For CMake, beside what all builds have.
BUILD_OPTIONS=()

# build_package TARGET...
build_package() {
  local -a generator=()
  say "building in $BUILD_DIR"
  mkdir -p "$BUILD_DIR"
  # A folder keeps the generator that it began with.
  if [ ! -f "$BUILD_DIR/CMakeCache.txt" ] && command -v ninja >/dev/null; then generator=(-G Ninja); fi
  cmake -S "$TOP" -B "$BUILD_DIR" "${generator[@]}" -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_CUDA_ARCHITECTURES="$(cuda_architecture)" -DNERF_POSE_REFINER_FAST_BUILD=ON \
    -DNERF_POSE_REFINER_WERROR=ON "${BUILD_OPTIONS[@]}" >"$BUILD_DIR/configure.log" 2>&1 || {
    tail -n 30 "$BUILD_DIR/configure.log" >&2
    die "configuring failed; all of it: $BUILD_DIR/configure.log"
  }
  cmake --build "$BUILD_DIR" -j "$(nproc)" --target "$@"
}

# Makes this build's package known to roslaunch, rosrun and rosbag.
use_build() {
  [ -f "$BUILD_DIR/devel/setup.bash" ] || die "no catkin was found: see $BUILD_DIR/configure.log"
  set +u # its scripts use variables that are not set
  # shellcheck disable=SC1091
  . "$BUILD_DIR/devel/setup.bash"
  set -u
}
