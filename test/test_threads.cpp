// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "dataset/dataset.h"
#include "image/io.h"
#include "registration/visual_hull.h"
#include "support/analytic_dataset.h"
#include "support/temporary_folder.h"

// Who asks for so many threads gets no more. The threads of OpenMP stay when their work is done, so
// they can be counted afterwards; that is why this is a program of its own.

namespace nerf_pose_refiner {
namespace {

int threadsOfThisProcess() {
  const std::filesystem::directory_iterator tasks("/proc/self/task");
  return static_cast<int>(std::distance(begin(tasks), end(tasks)));
}

/// Writes the views as files. @return the path of their transforms.json.
std::string writeDataset(const TemporaryFolder& folder, const Dataset& dataset) {
  nlohmann::json scene = {{"camera_angle_x", 1.0}, {"frames", nlohmann::json::array()}};
  for (std::size_t i = 0; i < dataset.views.size(); ++i) {
    const std::string name = std::to_string(i) + ".png";
    writePng(*dataset.views[i].rgba, folder.file(name));
    scene["frames"].push_back(
        {{"file_path", name},
         {"transform_matrix", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}}});
  }
  return folder.write("transforms.json", scene.dump());
}

TEST(Threads, NoMoreThanAskedFor) {
  if (!std::filesystem::exists("/proc/self/task")) GTEST_SKIP() << "no /proc";
  if (std::getenv("OMP_THREAD_LIMIT") != nullptr) GTEST_SKIP() << "OMP_THREAD_LIMIT is set";
  const TemporaryFolder folder;
  const Dataset photos = analyticDataset(16, 32);
  const std::string path = writeDataset(folder, photos);
  ASSERT_EQ(threadsOfThisProcess(), 1);
  for (const int threads : {1, 2, 3}) {
    DatasetOptions options;
    options.threads = threads;
    EXPECT_EQ(loadDataset(path, options).views.size(), 16u);
    EXPECT_EQ(threadsOfThisProcess(), threads) << "loading";
    visualHull(photos, 32, threads, CancellationToken());
    EXPECT_EQ(threadsOfThisProcess(), threads) << "visual hull";
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
