// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_descriptor_index.h"

#include <algorithm>
#include <cstdint>
#include <opencv2/flann.hpp>

#include "backend/common/descriptor_rules.h"
#include "concurrency/parallel.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kTrees = 4;
constexpr int kChecks = 64;             // leaves of the trees that a search looks at
constexpr std::uint64_t kTreeSeed = 1;  // the same descriptors make the same trees

cv::Mat view(const Descriptors& rows) {
  return {static_cast<int>(rows.rows()), static_cast<int>(rows.cols()), CV_32F,
          const_cast<float*>(rows.data())};
}

const Descriptors& indexed(const Descriptors& rows) {
  requireIndexed(rows);
  return rows;
}

}  // namespace

struct CpuDescriptorIndex::Trees {
  explicit Trees(const Descriptors& rows) {
    const std::uint64_t state = cv::theRNG().state;
    cv::theRNG().state = kTreeSeed;
    index.build(view(rows), cv::flann::KDTreeIndexParams(kTrees));
    cv::theRNG().state = state;
  }

  cv::flann::Index index;
};

CpuDescriptorIndex::CpuDescriptorIndex(const Descriptors& rows, int threads)
    : rows_(indexed(rows)), threads_(threads), trees_(std::make_unique<Trees>(rows_)) {}

CpuDescriptorIndex::~CpuDescriptorIndex() = default;

std::vector<Neighbour> CpuDescriptorIndex::nearest(const Descriptors& queries, int count) {
  requireQueries(queries, rows_.cols(), count);
  std::vector<Neighbour> found(static_cast<std::size_t>(queries.rows() * count));
  const int most = static_cast<int>(std::min<Eigen::Index>(count, rows_.rows()));
  const auto findOne = [&](int i) {
    cv::Mat numbers(1, most, CV_32S), squares(1, most, CV_32F);
    trees_->index.knnSearch(view(queries).row(i), numbers, squares, most,
                            cv::flann::SearchParams(kChecks));
    for (int rank = 0; rank < most && numbers.at<int>(rank) >= 0; ++rank) {
      found[static_cast<std::size_t>(i * count + rank)] = {numbers.at<int>(rank),
                                                           squares.at<float>(rank)};
    }
  };
  parallelFor(threads_, static_cast<int>(queries.rows()), findOne);
  return found;
}

}  // namespace nerf_pose_refiner
