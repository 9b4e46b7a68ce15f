// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "backend/make_backend.h"
#include "dataset/dataset.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

constexpr int kFailed = 1;      ///< exit code: the world (a file, an interrupt) or the data
constexpr int kWrongUsage = 2;  ///< exit code: the command line
constexpr const char* kExitCodes = "Exit code: 0 done, 1 failed, 2 wrong usage.";

/// Reads the command line into an app that is declared already, and runs the body; says on stderr
/// what went wrong.
/// @param body gets a token that Ctrl-C sets. It may throw; std::invalid_argument is wrong usage.
/// @return the exit code.
int runApp(CLI::App* app, int argc, char** argv,
           const std::function<void(const CancellationToken&)>& body);

/// The file name of a path, and the same without its last extension.
std::string fileName(const std::string& path);
std::string fileStem(const std::string& path);

/// A whole tool: `declare` adds its options to the app, `run` does the work.
template <typename Options>
int runTool(int argc, char** argv, void (*declare)(CLI::App*, Options*),
            void (*run)(const Options&, const CancellationToken&)) {
  CLI::App app("", fileName(argv[0]));
  Options options;
  declare(&app, &options);
  return runApp(&app, argc, argv,
                [&](const CancellationToken& cancellation) { run(options, cancellation); });
}

/// Which backend, and how much of the machine it takes.
struct BackendOptions {
  std::string backend = "auto";
  int device = 0;
  int threads = 0;
  std::string instruction_set = "auto";

  void addTo(CLI::App* app);
  std::shared_ptr<Backend> make() const {
    return makeBackend({backend, threads, instruction_set, device});
  }
  DatasetOptions datasetOptions() const;
};

/// How photos are read, for the tools that take any dataset.
struct PhotoOptions {
  DatasetOptions reading;

  void addTo(CLI::App* app);
  /// Reads the photos, and prints on stderr what was chosen or left out.
  Dataset load(const std::string& path, int threads, const CancellationToken& cancellation) const;
};

/// A line on stderr that is redrawn in place, and only on a terminal.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine() { end(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// @param share 0..1 of the work that is done.
  void show(double fraction, const std::string& text);
  void end();  ///< goes to the next line, if anything was shown

 private:
  const bool terminal_;
  bool drawn_ = false;
};

/// A transform as seven numbers: translation x y z and unit quaternion x y z w (ROS' order).
std::vector<double> poseNumbers(const Pose& pose);

/// @throws std::invalid_argument if there are not seven finite numbers or the quaternion is off
/// unit length by more than 1 %.
Pose poseFromNumbers(const std::vector<double>& numbers);

/// A pinhole camera from four numbers fx fy cx cy [px, integer pixel centres] and a size.
Camera cameraFromNumbers(const std::vector<double>& intrinsics, int width, int height);

/// Makes sure that a file can be written there before hours are spent on what it will hold.
/// @throws std::runtime_error naming the folder and the system's reason.
void requireWritable(const std::string& path);

/// Prints a document on stdout, indented.
void printJson(const nlohmann::json& document);

}  // namespace nerf_pose_refiner
