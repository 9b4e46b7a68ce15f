// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/chosen_points.h"

#include <algorithm>
#include <cstddef>

namespace nerf_pose_refiner {
namespace {

bool isBetter(const PointCandidate& a, const PointCandidate& b) {
  return a.information != b.information ? a.information > b.information : a.pixel < b.pixel;
}

// The candidates of a cell that were not chosen yet.
struct Remaining {
  PointCandidate* begin = nullptr;
  PointCandidate* end = nullptr;
};

std::vector<Remaining> cellsOf(std::vector<CellCandidates>* parts) {
  std::vector<Remaining> cells;
  for (CellCandidates& part : *parts) {
    std::size_t begin = 0;
    for (const std::size_t end : part.ends) {
      cells.push_back({part.all.data() + begin, part.all.data() + end});
      begin = end;
    }
  }
  return cells;
}

// Takes the best candidate out of every cell that has any.
// (Few ranks are needed, so cells are not sorted.)
std::vector<PointCandidate> takeBest(std::vector<Remaining>* cells) {
  std::vector<PointCandidate> best;
  for (Remaining& cell : *cells) {
    if (cell.begin == cell.end) continue;
    PointCandidate* const found = std::min_element(cell.begin, cell.end, isBetter);
    best.push_back(*found);
    *found = *--cell.end;
  }
  return best;
}

class CandidateFinder {
 public:
  CandidateFinder(const Image& normalised, const std::vector<char>& shown)
      : normalised_(normalised),
        shown_(shown),
        width_(normalised.width),
        height_(normalised.height) {}

  void addRowOfCells(int y, CellCandidates* candidates) const {
    for (int x = 0; x < width_; x += kChoiceCell) {
      const std::size_t before = candidates->all.size();
      addCell(x, y, &candidates->all);
      if (candidates->all.size() > before) candidates->ends.push_back(candidates->all.size());
    }
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
  void addCell(int cell_x, int cell_y, std::vector<PointCandidate>* all) const {
    for (int y = cell_y; y < std::min(cell_y + kChoiceCell, height_); ++y) {
      for (int x = cell_x; x < std::min(cell_x + kChoiceCell, width_); ++x) {
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

CellCandidates candidatesIn(const Image& normalised, const std::vector<char>& shown, int first,
                            int last) {
  const CandidateFinder finder(normalised, shown);
  CellCandidates candidates;
  for (int y = first; y < last; y += kChoiceCell) finder.addRowOfCells(y, &candidates);
  return candidates;
}

std::vector<int> choosePoints(std::vector<CellCandidates> parts, int max_count) {
  std::vector<Remaining> cells = cellsOf(&parts);
  const auto enough = static_cast<std::size_t>(max_count);
  std::vector<int> chosen;
  while (chosen.size() < enough) {
    std::vector<PointCandidate> next = takeBest(&cells);
    if (next.empty()) break;
    std::sort(next.begin(), next.end(), isBetter);
    next.resize(std::min(next.size(), enough - chosen.size()));
    for (const PointCandidate& one : next) chosen.push_back(one.pixel);
  }
  return chosen;
}

}  // namespace nerf_pose_refiner
