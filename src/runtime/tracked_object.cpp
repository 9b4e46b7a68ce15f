// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/tracked_object.h"

#include <cstdio>
#include <future>
#include <utility>

#include "runtime/heap_memory.h"

namespace nerf_pose_refiner {

std::string describe(const FieldMetadata& object) {
  char text[200];
  std::snprintf(text, sizeof text, "'%s': diameter %.3f m, PSNR %.1f dB", object.name.c_str(),
                object.diameter * object.metres_per_unit, object.psnr_db);
  return text;
}

std::string TrackedObject::track(std::shared_ptr<const Field> field) {
  std::lock_guard<std::mutex> changing(changing_);
  if (prepare_) prepare_(field);
  tracker_->offerModel(field).get();
  const std::string text = "in use: " + describe(field->metadata);
  log_(text);
  {
    std::lock_guard<std::mutex> lock(mutex_);
    field_.swap(field);
  }
  field.reset();        // the object before
  returnFreedMemory();  // its own, and that of what was made for this one
  return text;
}

void TrackedObject::renew(const std::shared_ptr<const Field>& before,
                          std::shared_ptr<const Field> field) {
  std::future<void> in_use;
  {
    std::lock_guard<std::mutex> changing(changing_);
    if (this->field() != before) return;
    in_use = tracker_->offerModel(field, /*same_appearance=*/true);
  }
  // The refinement that runs ends first, which may take long: another object need not wait for it.
  in_use.get();
  std::lock_guard<std::mutex> changing(changing_);
  if (this->field() != before) return;
  log_("new metadata in use: " + describe(field->metadata));
  std::lock_guard<std::mutex> lock(mutex_);
  field_ = std::move(field);
}

std::shared_ptr<const Field> TrackedObject::field() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return field_;
}

}  // namespace nerf_pose_refiner
