// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "cuda_test.h"
#include "test_object.h"

namespace nerf_pose_refiner {

/// A learned object in the memory of both backends, and a camera before it.
class LearnedObjectTest : public CudaTest {
 protected:
  void SetUp() override {
    CudaTest::SetUp();
    if (cuda == nullptr) return;
    field = std::make_shared<Field>(learnedObject());
    truth = cameraBefore(*field, 2.5 * field->metadata.diameter);
    on_cpu = cpu->load(field);
    on_cuda = cuda->load(field);
  }

  const LoadedField& loaded(const Backend& backend) const {
    return &backend == cuda.get() ? *on_cuda : *on_cpu;
  }

  std::shared_ptr<const Field> field;
  Pose truth;
  std::shared_ptr<const LoadedField> on_cpu, on_cuda;
};

}  // namespace nerf_pose_refiner
