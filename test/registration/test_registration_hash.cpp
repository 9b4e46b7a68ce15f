// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/registration_hash.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "support/grey_dataset.h"

namespace nerf_pose_refiner {
namespace {

using Change = std::function<void(Dataset*, RegistrationOptions*)>;

std::string hashAfter(const Change& change) {
  Dataset dataset = greyDataset(3);
  RegistrationOptions settings;
  change(&dataset, &settings);
  return registrationHash(dataset, settings);
}

TEST(RegistrationHash, ChangesWithWhateverChangesTheModelOrWhatIsMeasuredOfIt) {
  using D = Dataset;
  using S = RegistrationOptions;
  const std::vector<Change> changes = {
      [](D*, S*) {},
      [](D* d, S*) {
        auto rgba = std::make_shared<Image8>(*d->views[1].rgba);
        rgba->at(2, 3, 1) ^= 1;
        d->views[1].rgba = rgba;
      },
      [](D* d, S*) { d->views[1].T_O_C.t.y() += 1e-9; },
      [](D* d, S*) { d->views[2].T_O_C.R(0, 1) += 1e-9; },
      [](D* d, S*) { d->views[0].camera.fx += 1e-9; },
      [](D* d, S*) { d->views[0].camera.cy += 1e-9; },
      [](D* d, S*) { std::swap(d->views[0], d->views[1]); },
      [](D* d, S*) { d->views.pop_back(); },
      [](D* d, S*) { d->has_alpha = true; },
      [](D* d, S*) { d->has_box = false; },
      [](D* d, S*) { d->box_max.z() += 1e-9; },
      [](D* d, S*) { d->metres_per_unit = 1; },
      [](D*, S* s) { s->metres_per_unit = 1; },
      [](D*, S* s) { s->profile = "paper"; },
      [](D*, S* s) { ++s->steps; },
      [](D*, S* s) { s->max_seconds = 60; },
      [](D*, S* s) { s->target_psnr_db = 30; },
      [](D*, S* s) { ++s->held_out; },
      [](D*, S* s) { ++s->seed; },
      [](D*, S* s) { ++s->samples_per_step; },
      [](D*, S* s) { s->learning_rate *= 2; },
      [](D*, S* s) { s->final_learning_rate_factor *= 2; },
      [](D*, S* s) { s->refine_poses = true; },
      [](D*, S* s) { s->accept_poor_data = true; },
      [](D*, S* s) { s->keep_colours = true; },
      [](D*, S* s) { s->symmetries = Symmetries(SymmetryAxis(), {}); },
      [](D*, S* s) {
        s->symmetries = Symmetries(SymmetryAxis{{1, 0, 0}, {0, 0, 0}}, {});
      },
      [](D*, S* s) {
        s->symmetries = Symmetries(SymmetryAxis{{0, 0, 1}, {0.1, 0, 0}}, {});
      },
      [](D*, S* s) { s->symmetries = Symmetries({}, {turnAbout({}, M_PI)}); },
      [](D*, S* s) { s->symmetries = Symmetries({}, {turnAbout({}, M_PI / 2)}); },
  };
  std::set<std::string> hashes;
  for (const Change& change : changes) hashes.insert(hashAfter(change));
  EXPECT_EQ(hashes.size(), changes.size());
}

TEST(RegistrationHash, DoesNotChangeWithAnythingElse) {
  const std::string expected = hashAfter([](Dataset*, RegistrationOptions*) {});
  const auto other = [](Dataset* dataset, RegistrationOptions* settings) {
    dataset->folder = "elsewhere";
    for (PosedView& view : dataset->views) {
      view.name = "renamed";
      view.rgba = std::make_shared<Image8>(*view.rgba);
    }
    settings->threads = 3;
  };
  EXPECT_EQ(hashAfter(other), expected);
  EXPECT_FALSE(expected.empty());
}

// Computed by the version that had no list of settings: models from before stay valid.
TEST(RegistrationHash, IsThatOfEarlierVersions) {
  EXPECT_EQ(hashAfter([](Dataset*, RegistrationOptions*) {}), "51a7b3f37f48c386");
  const auto all = [](Dataset* d, RegistrationOptions* s) {
    d->metres_per_unit = 0.25;
    s->profile = "paper";
    s->steps = 17;
    s->max_seconds = 2.5;
    s->target_psnr_db = 30;
    s->held_out = 3;
    s->metres_per_unit = 0.5;
    s->refine_poses = true;
    s->samples_per_step = 2048;
    s->learning_rate = 0.02;
    s->final_learning_rate_factor = 0.5;
    s->seed = 7;
  };
  EXPECT_EQ(hashAfter(all), "8d2c78a04c8382a9");
}

TEST(RegistrationHash, CanBeStopped) {
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(registrationHash(greyDataset(3), RegistrationOptions(), cancellation), Cancelled);
}

}  // namespace
}  // namespace nerf_pose_refiner
