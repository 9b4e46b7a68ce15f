# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
# Builds, packs and runs the programs of fuzz/. Needs common.sh.

FUZZ_TIMEOUT_S=1

# build_fuzzers DIR [cmake option]...: with clang.
build_fuzzers() {
  local build=$1 folder
  local -a generator=() wanted=()
  shift
  command -v clang++ >/dev/null || die "clang++ is not installed"
  say "building in $build"
  mkdir -p "$build"
  if [ ! -f "$build/CMakeCache.txt" ] && command -v ninja >/dev/null; then generator=(-G Ninja); fi
  cmake -S "$TOP" -B "$build" "${generator[@]}" -DNERF_POSE_REFINER_FUZZ=ON -DCMAKE_CXX_COMPILER=clang++ "$@" \
    >"$build/configure.log" 2>&1 || {
    tail -n 30 "$build/configure.log" >&2
    die "configuring failed; all of it: $build/configure.log"
  }
  # Not `all`: messages are needed for C++ alone.
  for folder in "$TOP"/fuzz/corpus/*/; do
    ! is_fuzz_target "$build" "$(basename "$folder")" || wanted+=("fuzz_$(basename "$folder")")
  done
  cmake --build "$build" -j "$(nproc)" --target "${wanted[@]}" >"$build/build.log" 2>&1 || {
    tail -n 30 "$build/build.log" >&2
    die "building failed; all of it: $build/build.log"
  }
}

is_fuzz_target() { # those of messages need ROS
  grep -q '^catkin_DIR:.*/' "$1/CMakeCache.txt" || [[ ! $2 =~ ^(bag|camera_messages|detections|initial_pose)$ ]]
}

# pack_fuzzers PROGRAMS FILE TARGET...: with their libraries, the C library among them. OpenCV's decoders, which bags of
# compressed images need, come with libraries of 150 MB: that target is left out.
pack_fuzzers() {
  local programs=$1 file=$2 folder target name path
  shift 2
  folder=$(mktemp -d)
  # shellcheck disable=SC2064 # the folder's name is known now
  trap "rm -rf '$folder'" EXIT
  mkdir -p "$folder/nerf_pose_refiner_fuzz/"{fuzz_programs/lib,fuzz/corpus,scripts/lib}
  cd "$folder/nerf_pose_refiner_fuzz" || return 1
  cp "$TOP/scripts/fuzz" scripts/
  cp "$TOP/scripts/lib/common.sh" "$TOP/scripts/lib/fuzzers.sh" scripts/lib/
  for target in "$@"; do
    if [ "$target" = bag ] || [ ! -x "$programs/fuzz_$target" ]; then continue; fi
    strip --strip-debug -o "fuzz_programs/fuzz_$target" "$programs/fuzz_$target"
    cp -r "$TOP/fuzz/corpus/$target" fuzz/corpus/
    # What was found here is where the search goes on.
    if [ -d "$(dirname "$programs")/corpus/$target" ]; then
      mkdir -p "fuzz_programs/out/corpus"
      cp -r "$(dirname "$programs")/corpus/$target" fuzz_programs/out/corpus/
    fi
  done
  ldd fuzz_programs/fuzz_* | awk '$2 == "=>" && $3 ~ /^\// { print $1, $3 }' | sort -u |
    while read -r name path; do cp -L "$path" "fuzz_programs/lib/$name"; done
  cp -L /lib64/ld-linux-x86-64.so.2 fuzz_programs/lib/
  tar caf "$file" -C "$folder" nerf_pose_refiner_fuzz
  say "packed: $file ($(du -h "$file" | cut -f 1))"
}

# run_fuzzer PROGRAMS TARGET OUT SECONDS JOBS: processes that share a folder of inputs. (No -fork: a program that was
# packed starts by a loader of its own, which libFuzzer would leave out.) Says how many inputs there were; 1: it broke.
run_fuzzer() {
  local programs=$1 target=$2 out=$3 seconds=$4 jobs=$5 job status=0
  local -a loader=() pids=() options=()
  # The search for leaks, which begins anew for each input that leaves a plugin of rosbag behind, takes nearly all time.
  [ "$target" != bag ] || options=(-detect_leaks=0)
  if [ -d "$programs/lib" ]; then loader=("$programs/lib/ld-linux-x86-64.so.2" --library-path "$programs/lib"); fi
  rm -rf "$out/log/$target"
  mkdir -p "$out/corpus/$target" "$out/crashes/$target" "$out/log/$target"
  for ((job = 1; job <= jobs; ++job)); do
    # An address space that is laid out at random collides with that of AddressSanitizer in clang 14.
    setarch --addr-no-randomize "${loader[@]}" "$programs/fuzz_$target" -max_total_time="$seconds" -print_final_stats=1 \
      -timeout="$FUZZ_TIMEOUT_S" -malloc_limit_mb=256 -rss_limit_mb=1024 -max_len=16384 -use_value_profile=1 \
      "${options[@]}" -artifact_prefix="$out/crashes/$target/" "$out/corpus/$target" "$TOP/fuzz/corpus/$target" \
      >"$out/log/$target/$job" 2>&1 &
    pids+=($!)
  done
  for job in "${pids[@]}"; do wait "$job" || status=1; done
  printf '%-16s %s: %d inputs, %d processes for %d s, %d inputs kept\n' "$target" \
    "$([ "$status" = 0 ] && echo 'nothing broke' || echo BROKEN)" \
    "$(sed -n 's/^stat::number_of_executed_units: *//p' "$out/log/$target/"* | awk '{ n += $1 } END { print n + 0 }')" \
    "$jobs" "$seconds" "$(find "$out/corpus/$target" -type f | wc -l)"
  # With what is above and below: not every end of a sanitizer says ERROR.
  [ "$status" = 0 ] || grep -h -B 30 -A 10 'Test unit written' "$out/log/$target/"* | cut -c 1-300 | head -n 200
  return "$status"
}
