// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tools/tool.h"

#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <stdexcept>

#include "dataset/dataset_limits.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kBarWidth = 30;

// Set before the handler is installed and never changed: what a signal handler may touch.
const CancellationToken& interruptToken() {
  static const CancellationToken token;
  return token;
}

void onInterrupt(int signal) {
  interruptToken().requestCancel();
  std::signal(signal, SIG_DFL);  // a second Ctrl-C ends the process at once
}

}  // namespace

int runApp(CLI::App* app, int argc, char** argv,
           const std::function<void(const CancellationToken&)>& body) {
  try {
    app->parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app->exit(e) == 0 ? 0 : kWrongUsage;
  }
  const CancellationToken& cancellation = interruptToken();
  std::signal(SIGINT, onInterrupt);
  std::signal(SIGTERM, onInterrupt);
  try {
    body(cancellation);
    return 0;
  } catch (const std::invalid_argument& e) {
    std::cerr << app->get_name() << ": " << e.what() << "\nRun with --help for more.\n";
    return kWrongUsage;
  } catch (const std::exception& e) {
    std::cerr << app->get_name() << ": " << e.what() << '\n';
    return kFailed;
  }
}

std::string fileName(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

std::string fileStem(const std::string& path) {
  return std::filesystem::path(path).stem().string();
}

DatasetOptions BackendOptions::datasetOptions() const {
  DatasetOptions options;
  options.threads = threads;
  return options;
}

void BackendOptions::addTo(CLI::App* app) {
  app->add_option("--backend", backend,
                  "Processor: cpu, cuda, or auto (cuda where that works, else cpu)")
      ->check(CLI::IsMember({"auto", "cpu", "cuda"}))
      ->capture_default_str();
  app->add_option("--device", device, "Number of the GPU, for cuda")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app->add_option("--threads", threads, "Number of threads; 0: all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app->add_option("--instruction-set", instruction_set,
                  "Instruction set of the CPU backend: auto, baseline, avx2")
      ->check(CLI::IsMember({"auto", "baseline", "avx2"}))
      ->capture_default_str();
}

void PhotoOptions::addTo(CLI::App* app) {
  app->add_option("--object-id", reading.object_id,
                  "Which object of a BOP dataset; 0: the only one")
      ->check(CLI::Range(0, 1000000000))
      ->capture_default_str();
  visitLimits(
      &reading.limits, [this, app](const char* name, std::uint64_t value, const char* meaning) {
        std::string option = std::string("--") + name;
        std::replace(option.begin(), option.end(), '_', '-');
        const auto set = [this, limit_name = std::string(name)](const std::uint64_t& wanted) {
          visitLimits(&reading.limits, [&](const char* other, std::uint64_t& limit, const char*) {
            if (other == limit_name) limit = wanted;
          });
        };
        app->add_option_function<std::uint64_t>(option, set, meaning)
            ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1000000000}))
            ->default_str(std::to_string(value));
      });
}

Dataset PhotoOptions::load(const std::string& path, int threads,
                           const CancellationToken& cancellation) const {
  DatasetOptions options = reading;
  options.threads = threads;
  Dataset dataset = loadDataset(path, options, cancellation);
  for (const std::string& note : dataset.notes) std::fprintf(stderr, "%s\n", note.c_str());
  return dataset;
}

ProgressLine::ProgressLine() : terminal_(isatty(STDERR_FILENO) == 1) {}

void ProgressLine::end() {
  if (drawn_) std::fputc('\n', stderr);
  drawn_ = false;
}

void ProgressLine::show(double fraction, const std::string& text) {
  if (!terminal_) return;
  const int filled =
      static_cast<int>(std::lround(std::min(1.0, std::max(0.0, fraction)) * kBarWidth));
  const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
  std::fprintf(stderr, "\r\033[K[%s] %s", bar.c_str(), text.c_str());
  std::fflush(stderr);
  drawn_ = true;
}

std::vector<double> poseNumbers(const Pose& pose) {
  Eigen::Quaterniond q(pose.R);
  if (q.w() < 0) q.coeffs() *= -1;
  return {pose.t.x(), pose.t.y(), pose.t.z(), q.x(), q.y(), q.z(), q.w()};
}

Pose poseFromNumbers(const std::vector<double>& numbers) {
  if (numbers.size() != 7) throw std::invalid_argument("a pose has 7 numbers: x y z qx qy qz qw");
  for (double number : numbers) {
    if (!std::isfinite(number)) throw std::invalid_argument("a number of the pose is not finite");
  }
  const Eigen::Quaterniond q(numbers[6], numbers[3], numbers[4], numbers[5]);
  if (std::abs(q.norm() - 1) > 0.01) {
    throw std::invalid_argument("the quaternion's length is " + std::to_string(q.norm()) +
                                ", must be 1");
  }
  return {q.normalized().toRotationMatrix(), {numbers[0], numbers[1], numbers[2]}};
}

Camera cameraFromNumbers(const std::vector<double>& intrinsics, int width, int height) {
  if (intrinsics.size() != 4) throw std::invalid_argument("intrinsics are 4 numbers: fx fy cx cy");
  const Camera camera = {width, height, intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]};
  camera.validate();
  return camera;
}

void requireWritable(const std::string& path) {
  const std::size_t slash = path.find_last_of('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  if (access(folder.c_str(), W_OK) != 0) {
    throw std::runtime_error("cannot write in " + folder + ": " + std::strerror(errno));
  }
}

void printJson(const nlohmann::json& document) { std::cout << document.dump(2) << '\n'; }

}  // namespace nerf_pose_refiner
