// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Learns an object from posed photos and writes its model.
//
//   register_object demo/data/toy_kiosk kiosk.safetensors [steps]
#include <nerf_pose_refiner/backend.h>
#include <nerf_pose_refiner/object.h>
#include <nerf_pose_refiner/registration.h>

#include <cstdio>
#include <exception>
#include <memory>

#include "numbers.h"

using namespace nerf_pose_refiner;

int main(int argc, char** argv) try {
  if (argc < 3) {
    std::fprintf(stderr, "Usage: %s PHOTOS MODEL [STEPS]\n", argv[0]);
    return 2;
  }
  RegistrationOptions settings;
  if (argc > 3) settings.steps = static_cast<int>(numberOf(argv[3]));

  const std::shared_ptr<Backend> backend = makeBackend("auto");
  std::printf("%s\n", backendInfo(*backend).description.c_str());
  const Object object =
      registerObject(*backend, argv[1], settings, [](const RegistrationProgress& progress) {
        std::printf("%-10s %d of %d, %.0f s left\n", progress.stage.c_str(), progress.step,
                    progress.steps, progress.seconds_left);
      });
  saveObject(object, argv[2]);
  std::printf("%s: diameter %.3f %s, PSNR %.1f dB\n", argv[2], object.diameter(),
              object.hasScale() ? "m" : "model units", object.psnr_db());
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "%s\n", e.what());
  return 1;
}
