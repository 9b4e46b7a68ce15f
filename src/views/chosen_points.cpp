// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/chosen_points.h"

#include <algorithm>
#include <cstddef>

namespace nerf_pose_refiner {
namespace {

constexpr int kCellSide = 8;  // points are distributed evenly over cells of this size [px]

// A pixel that may be chosen as a point.
struct Candidate {
  int pixel = 0;
  float information = 0;
};

// The candidates of a cell that were not chosen yet.
struct CellCandidates {
  Candidate* begin = nullptr;
  Candidate* end = nullptr;
};

bool isBetter(const Candidate& a, const Candidate& b) {
  return a.information != b.information ? a.information > b.information : a.pixel < b.pixel;
}

// Takes the best candidate out of every cell that has any.
// (Few ranks are needed, so cells are not sorted.)
std::vector<Candidate> takeBest(std::vector<CellCandidates>* cells) {
  std::vector<Candidate> best;
  for (CellCandidates& cell : *cells) {
    if (cell.begin == cell.end) continue;
    Candidate* const found = std::min_element(cell.begin, cell.end, isBetter);
    best.push_back(*found);
    *found = *--cell.end;
  }
  return best;
}

class PointChoice {
 public:
  PointChoice(const Image& normalised, const std::vector<char>& shown)
      : normalised_(normalised),
        shown_(shown),
        width_(normalised.width),
        height_(normalised.height) {}

  // Those of every cell that has any, row by row. @param all becomes their memory.
  std::vector<CellCandidates> candidates(std::vector<Candidate>* all) const {
    all->reserve(shown_.size());  // so that they stay where they are
    std::vector<CellCandidates> cells;
    for (int y = 0; y < height_; y += kCellSide) {
      for (int x = 0; x < width_; x += kCellSide) {
        Candidate* const begin = all->data() + all->size();
        addCandidates(x, y, all);
        Candidate* const end = all->data() + all->size();
        if (begin != end) cells.push_back({begin, end});
      }
    }
    return cells;
  }

 private:
  float informationAt(int x, int y) const {
    if (x == 0 || y == 0 || x + 1 == width_ || y + 1 == height_) return 0;
    const char* const shown = shown_.data() + y * width_ + x;
    if (!shown[0] || !shown[-1] || !shown[1] || !shown[-width_] || !shown[width_]) return 0;
    const float* const here = normalised_.pixel(x, y);
    const int right = 3, down = 3 * width_;
    float sum = 0;
    for (int c = 0; c < 3; ++c) {
      const float du = here[c + right] - here[c - right];
      const float dv = here[c + down] - here[c - down];
      sum += du * du + dv * dv;
    }
    return sum;
  }

  // Appends the pixels of a cell that say something.
  void addCandidates(int cell_x, int cell_y, std::vector<Candidate>* all) const {
    for (int y = cell_y; y < std::min(cell_y + kCellSide, height_); ++y) {
      for (int x = cell_x; x < std::min(cell_x + kCellSide, width_); ++x) {
        const float information = informationAt(x, y);
        if (information > 0) all->push_back({y * width_ + x, information});
      }
    }
  }

  const Image& normalised_;
  const std::vector<char>& shown_;
  int width_, height_;
};

}  // namespace

std::vector<int> choosePoints(const Image& normalised, const std::vector<char>& shown,
                              int max_count) {
  std::vector<Candidate> all;
  std::vector<CellCandidates> cells = PointChoice(normalised, shown).candidates(&all);
  const auto enough = static_cast<std::size_t>(max_count);
  std::vector<int> chosen;
  while (chosen.size() < enough) {
    std::vector<Candidate> next = takeBest(&cells);
    if (next.empty()) break;
    std::sort(next.begin(), next.end(), isBetter);
    next.resize(std::min(next.size(), enough - chosen.size()));
    for (const Candidate& one : next) chosen.push_back(one.pixel);
  }
  return chosen;
}

}  // namespace nerf_pose_refiner
