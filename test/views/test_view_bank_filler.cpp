// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/view_bank_filler.h"

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>
#include <stdexcept>
#include <thread>

#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/gated_field.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kViews = 12;

ViewBankSettings fewViews() {
  ViewBankSettings settings;
  settings.views = kViews;
  return settings;
}

class ViewBankFillerTest : public testing::Test {
 protected:
  void waitForViews(int count) const {
    while (bank_->made() < count) {
      // Leaves the core to the thread that makes them: its priority is low.
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  std::shared_ptr<GatedField> field_ =
      std::make_shared<GatedField>(makeAnalyticScene(1, cpuProcessor(1)));
  std::shared_ptr<ViewBank> bank_ = std::make_shared<ViewBank>(field_, fewViews());
};

TEST_F(ViewBankFillerTest, RendersEachViewOnce) {
  bank_->make({4}, {});
  ViewBankFiller filler(bank_);
  waitForViews(kViews);
  EXPECT_EQ(field_->arrived(), kViews);
}

TEST_F(ViewBankFillerTest, BeginsNoneWhilePaused) {
  field_->close();
  ViewBankFiller filler(bank_);
  field_->waitForArrivals(1);
  const ViewBankFiller::Pause pause(&filler);
  { const ViewBankFiller::Pause within(&filler); }  // its end is not the other's
  field_->open();
  waitForViews(1);  // what has begun is completed
  // Time enough for others.
  ViewBank(makeAnalyticScene(1, cpuProcessor(1)), fewViews()).make({0, 1, 2, 3, 4, 5}, {});
  EXPECT_EQ(field_->arrived(), 1);
}

TEST_F(ViewBankFillerTest, GoesOnAfterAPause) {
  field_->close();
  ViewBankFiller filler(bank_);
  field_->waitForArrivals(1);
  {
    const ViewBankFiller::Pause pause(&filler);
    field_->open();
  }
  waitForViews(kViews);
  const ViewBankFiller::Pause nothing(nullptr);
}

TEST_F(ViewBankFillerTest, ItsEndCancelsARendering) {
  field_->close();
  std::optional<ViewBankFiller> filler(bank_);
  field_->waitForArrivals(1);
  filler.reset();  // would wait for ever
  EXPECT_EQ(field_->arrived(), 1);
  EXPECT_EQ(bank_->made(), 0);
}

/// A field that cannot be rendered.
class BrokenField final : public LoadedField {
 public:
  explicit BrokenField(std::shared_ptr<const LoadedField> field) : field_(std::move(field)) {}
  const Field& field() const override { return field_->field(); }
  Rendering render(const View&, const RenderOptions&, const CancellationToken&) const override {
    throw std::runtime_error("out of memory");
  }
  std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                         const std::vector<ImageLevel>& levels,
                                         int capacity) const override {
    return field_->makeSolver(observation, levels, capacity);
  }

 private:
  std::shared_ptr<const LoadedField> field_;
};

TEST_F(ViewBankFillerTest, LeavesErrorsToThoseWhoNeedTheView) {
  const auto bank = std::make_shared<ViewBank>(std::make_shared<BrokenField>(field_), fewViews());
  { ViewBankFiller filler(bank); }
  EXPECT_THROW(bank->view(0, {}), std::runtime_error);
}

}  // namespace
}  // namespace nerf_pose_refiner
