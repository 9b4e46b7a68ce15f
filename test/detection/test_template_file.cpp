// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>

#include "detection/detection_model.h"
#include "field/field.h"
#include "support/cpu_processor.h"
#include "support/temporary_folder.h"
#include "support/textured_scene.h"

namespace nerf_pose_refiner {
namespace {

/// Two views, of which one shows nothing.
TemplateBank someBank() {
  TemplateBank bank;
  bank.views.resize(2);
  bank.views[0].R_O_V = expSO3({0.1, 0.2, 0.3});
  bank.views[1].R_O_V = expSO3({0.3, 0.2, 0.1});
  for (int i = 0; i < TemplateView::kRun; ++i) {
    bank.views[1].features.push_back({{0.1f * i, 0.2f, -0.3f}, 0.4f * i});
  }
  return bank;
}

class TemplateFileTest : public testing::Test {
 protected:
  void SetUp() override { saveTemplates(someBank(), 7, path_); }

  std::string bytes() const {
    std::ifstream file(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void write(const std::string& content) const {
    std::ofstream(path_, std::ios::binary) << content;
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.path() + "/mug.templates";
};

TEST_F(TemplateFileTest, ReadsWhatWasWritten) {
  const auto read = loadTemplates(path_, 7);
  ASSERT_TRUE(read);
  const TemplateBank written = someBank();
  ASSERT_EQ(read->views.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read->views[i].R_O_V, written.views[i].R_O_V);
    ASSERT_EQ(read->views[i].features.size(), written.views[i].features.size());
    for (std::size_t k = 0; k < written.views[i].features.size(); ++k) {
      EXPECT_EQ(read->views[i].features[k].point, written.views[i].features[k].point);
      EXPECT_EQ(read->views[i].features[k].normal_rad, written.views[i].features[k].normal_rad);
    }
  }
}

// Kernels would read beyond the features.
TEST_F(TemplateFileTest, EdgesThatAreNoWholeRunsAreNone) {
  TemplateBank bank = someBank();
  bank.views[1].features.resize(TemplateView::kRun / 2);
  saveTemplates(bank, 7, path_);
  EXPECT_FALSE(loadTemplates(path_, 7));
}

TEST_F(TemplateFileTest, OfAnotherObjectIsNone) { EXPECT_FALSE(loadTemplates(path_, 8)); }

TEST_F(TemplateFileTest, AMissingFileIsNone) { EXPECT_FALSE(loadTemplates(path_ + "x", 7)); }

TEST_F(TemplateFileTest, ADamagedFileIsNone) {
  const std::string good = bytes();
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x10);
    write(bad);
    EXPECT_FALSE(loadTemplates(path_, 7)) << "byte " << i;
  }
  for (const std::size_t length : {std::size_t{0}, std::size_t{10}, good.size() - 1}) {
    write(good.substr(0, length));
    EXPECT_FALSE(loadTemplates(path_, 7)) << length;
  }
  TemplateBank bank = someBank();
  bank.views[1].features[0].normal_rad = std::numeric_limits<float>::quiet_NaN();
  saveTemplates(bank, 7, path_);
  EXPECT_FALSE(loadTemplates(path_, 7)) << "not finite";
}

TEST_F(TemplateFileTest, WhereItCannotBeWrittenIsSaid) {
  EXPECT_THROW(saveTemplates(someBank(), 7, folder_.path() + "/no/mug.templates"),
               std::runtime_error);
}

TEST(DetectionModel, OfAPlainObjectHasTemplates) {
  const auto scene = std::make_shared<TexturedScene>(cpuProcessor(2));
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/mug.landmarks";
  DetectionModelSettings settings;
  settings.landmarks.views = 4;
  settings.landmarks.object_px = 64;
  settings.templates.views = 8;
  settings.templates.object_px = 32;
  settings.plain_landmarks = 0;
  const DetectionModel textured = detectionModelFor(*scene, settings, path, {});
  EXPECT_FALSE(textured.templates);
  EXPECT_FALSE(textured.is_plain);
  EXPECT_TRUE(std::filesystem::exists(path));
  EXPECT_FALSE(std::filesystem::exists(templatePathOf(path)));

  settings.templates_for_all = true;  // where a GPU scans them
  const DetectionModel both = detectionModelFor(*scene, settings, path, {});
  EXPECT_TRUE(both.templates);
  EXPECT_FALSE(both.is_plain);
  settings.templates_for_all = false;
  std::filesystem::remove(templatePathOf(path));

  settings.plain_landmarks = 100000;
  const DetectionModel plain = detectionModelFor(*scene, settings, path, {});
  ASSERT_TRUE(plain.templates);
  EXPECT_TRUE(plain.is_plain);
  EXPECT_EQ(plain.templates->views.size(), 8u);
  EXPECT_EQ(plain.landmarks.size(), textured.landmarks.size());
  // Nothing is rendered when both are read.
  const CancellationToken cancelled;
  cancelled.requestCancel();
  const DetectionModel read = detectionModelFor(*scene, settings, path, cancelled);
  ASSERT_TRUE(read.templates);
  EXPECT_EQ(read.templates->views[3].features.size(), plain.templates->views[3].features.size());
  EXPECT_THROW(detectionModelFor(*scene, settings, "", cancelled), Cancelled);
}

TEST(DetectionModel, TemplatesAreBesideLandmarks) {
  EXPECT_EQ(templatePathOf("/a.b/mug.landmarks"), "/a.b/mug.templates");
  EXPECT_EQ(templatePathOf("/a.b/mug"), "/a.b/mug.templates");
}

}  // namespace
}  // namespace nerf_pose_refiner
