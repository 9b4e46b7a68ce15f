// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <nerf_pose_refiner/backend/backend.h>
#include <nerf_pose_refiner/field/model_file.h>
#include <nerf_pose_refiner/refine/refiner.h>

#include <cstdio>

/// The library from C++ with three includes: loads a model, if one is given, and makes a refiner.
int main(int argc, char** argv) {
  using namespace nerf_pose_refiner;
  const std::shared_ptr<Backend> backend = makeCpuBackend();
  const Refiner refiner(backend, RefinerSettings::named("align"));
  std::printf("%s\n", backend->info().description.c_str());
  if (argc > 1) {
    const auto field = std::make_shared<const Field>(loadModel(argv[1]));
    std::printf("%s: diameter %g\n", field->metadata.name.c_str(),
                backend->load(field)->field().metadata.diameter);
  }
  return 0;
}
