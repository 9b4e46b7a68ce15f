// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "math/planar_descent.h"

// Draws Fig. 2 of Lin et al. as an SVG: descent in the plane on SO(2) x T(2) and on SE(2), with
// heavy-ball momentum and with Adam beside it.

namespace nerf_pose_refiner {
namespace {

constexpr PlanarPose kTarget = {3, 1, 2};
constexpr double kTolerance = 1e-6;
constexpr int kMaxSteps = 1000;

constexpr double kScale = 100;  // [px a unit]
constexpr double kPanelWidth = 520;
constexpr double kPanelHeight = 430;
constexpr double kOriginX = 70;
constexpr double kOriginY = 350;

constexpr const char* kSeparateColour = "#1b7837";
constexpr const char* kCoupledColour = "#b2182b";

/// A point of a panel [px].
std::string at(const PlanarPose& pose) {
  std::ostringstream text;
  text.precision(2);
  text << std::fixed << kOriginX + kScale * pose.x << "," << kOriginY - kScale * pose.y;
  return text.str();
}

/// The two axes of a pose, as short strokes.
std::string axes(const PlanarPose& pose, const char* colour) {
  const double length = 0.18;
  const PlanarVector x = turned({length, 0, 0}, pose.angle);
  const PlanarVector y = turned({0, length, 0}, pose.angle);
  std::ostringstream svg;
  svg << "<path d='M" << at({pose.x + x.x, pose.y + x.y, 0}) << " L" << at(pose) << " L"
      << at({pose.x + y.x, pose.y + y.y, 0}) << "' fill='none' stroke='" << colour
      << "' stroke-width='2.5'/>\n";
  return svg.str();
}

/// A path with a dot a step, and a line of the legend.
template <typename Update, typename Optimiser>
std::string path(const Optimiser& optimiser, const char* name, const char* colour, int row) {
  std::ostringstream line, dots;
  const int steps = optimiseInPlane<Update>(
      PlanarPose(), kTarget, optimiser, {kTolerance, kMaxSteps}, [&](const PlanarPose& pose) {
        line << (line.tellp() > 0 ? " " : "") << at(pose);
        const std::string point = at(pose);
        const std::size_t comma = point.find(',');
        dots << "<circle cx='" << point.substr(0, comma) << "' cy='" << point.substr(comma + 1)
             << "' r='2'/>\n";
      });
  const double y = kPanelHeight - 42 + 20 * row;
  std::ostringstream svg;
  svg << "<polyline points='" << line.str() << "' fill='none' stroke='" << colour << "'/>\n"
      << "<g fill='" << colour << "'>\n"
      << dots.str() << "<text x='" << kOriginX << "' y='" << y << "'>" << name << ": " << steps
      << " steps</text></g>\n";
  return svg.str();
}

template <typename Optimiser>
std::string panel(const Optimiser& optimiser, const char* title, double x) {
  std::ostringstream svg;
  svg << "<g transform='translate(" << x << ",0)'>\n"
      << "<text x='" << kOriginX << "' y='30' font-weight='bold'>" << title << "</text>\n"
      << "<path d='M" << at({0, 0, 0}) << " L" << at(kTarget)
      << "' stroke='#999' stroke-dasharray='4 4'/>\n"
      << path<CoupledUpdate>(optimiser, "SE(2)", kCoupledColour, 1)
      << path<SeparateUpdate>(optimiser, "SO(2) x T(2)", kSeparateColour, 0)
      << axes(PlanarPose(), "#333") << axes(kTarget, "#333") << "</g>\n";
  return svg.str();
}

void drawFigure(const std::string& file) {
  std::ofstream svg(file);
  svg << "<svg xmlns='http://www.w3.org/2000/svg' width='" << 2 * kPanelWidth << "' height='"
      << kPanelHeight << "' font-family='sans-serif' font-size='14'>\n"
      << "<rect width='100%' height='100%' fill='white'/>\n"
      << panel(PlanarHeavyBall(), "Heavy-ball momentum", 0)
      << panel(PlanarAdam(), "Adam", kPanelWidth) << "</svg>\n";
  svg.close();
  if (!svg) throw std::runtime_error("cannot write " + file);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  if (argc != 2 || argv[1][0] == '-') {
    std::fprintf(stderr, "usage: draw_figure2 OUTPUT.svg\n");
    return EXIT_FAILURE;
  }
  try {
    nerf_pose_refiner::drawFigure(argv[1]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "draw_figure2: %s\n", e.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
