// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <nerf_pose_refiner/backend.h>
#include <nerf_pose_refiner/object.h>
#include <nerf_pose_refiner/tracker.h>

#include <cstdio>
#include <memory>

/// Makes a backend and, if a model is given, a tracker of its object.
int main(int argc, char** argv) {
  using namespace nerf_pose_refiner;
  const std::shared_ptr<Backend> backend = makeBackend("cpu");
  std::printf("%s\n", backendInfo(*backend).description.c_str());
  if (argc > 1) {
    const Object object = loadObject(argv[1]);
    const Tracker tracker(backend, object);
    std::printf("%s: diameter %g\n", object.name().c_str(), object.diameter());
  }
  return 0;
}
