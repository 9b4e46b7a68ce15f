// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/training_run.h"

#include <algorithm>
#include <memory>

#include "concurrency/seconds_since.h"
#include "image/colour.h"
#include "registration/view_quality.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kProgressInterval_s = 0.5;
constexpr double kQualityInterval = 0.1;  // of the training, between looks at the held-out views
constexpr double kPreviewSize_px = 320;

}  // namespace

void TrainingRun::run(const char* stage, const CancellationToken& cancellation) {
  double next_look = kQualityInterval;
  while (done() < 1) {
    cancellation.check();
    loss_ = trainer_->step(done());
    report(stage, [&] { return preview(cancellation); });
    if (settings_.target_psnr_db > 0 && !views_.held_out.empty() && done() >= next_look) {
      next_look += kQualityInterval;
      const auto field = backend_->load(std::make_shared<Field>(trainer_->snapshot(cancellation)));
      psnr_db_ = meanPsnr(*field, views_.held_out, cancellation);
      if (psnr_db_ >= settings_.target_psnr_db) break;
    }
  }
}

void TrainingRun::report(const char* stage, const std::function<Image8()>& preview) {
  if (!progress_) return;
  const double seconds = secondsSince(start_);
  if (seconds - last_report_s_ < kProgressInterval_s && last_stage_ == stage) return;
  last_report_s_ = seconds;
  last_stage_ = stage;
  RegistrationProgress progress;
  progress.stage = stage;
  progress.step = trainer_->stepsDone();
  progress.steps = settings_.steps;
  progress.loss = loss_;
  progress.psnr_db = psnr_db_;
  progress.seconds = seconds;
  progress.seconds_left = done() > 0 ? std::max(0.0, seconds * (1 / done() - 1)) : 0;
  progress.preview = preview;
  progress_(progress);
}

Image8 TrainingRun::preview(const CancellationToken& cancellation) {
  const PosedView& view = views_.training.front();
  const Camera& full = view.camera;
  const double scale = std::min(1.0, kPreviewSize_px / std::max(full.width, full.height));
  const auto field = backend_->load(std::make_shared<Field>(trainer_->snapshot(cancellation)));
  const Rendering rendering =
      field->render({full.scaled(scale), view.T_O_C}, RenderOptions(), cancellation);
  return toBytes(rendering.colour);  // premultiplied: on black
}

double TrainingRun::done() const {
  const double by_steps = static_cast<double>(trainer_->stepsDone()) / settings_.steps;
  const double by_time =
      settings_.max_seconds > 0 ? secondsSince(start_) / settings_.max_seconds : 0;
  return std::min(1.0, std::max(by_steps, by_time));
}

}  // namespace nerf_pose_refiner
