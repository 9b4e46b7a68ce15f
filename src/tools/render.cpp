// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <future>
#include <set>
#include <string>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "dataset/dataset.h"
#include "field/model_file.h"
#include "image/colour.h"
#include "image/io.h"
#include "image/resample.h"
#include "tools/tool.h"

// A model file to images, and how well they match the photos.

namespace nerf_pose_refiner {
namespace {

constexpr float kDepthAlpha = 0.5f;  // fainter pixels have no depth
constexpr const char* kDepthSuffix = "_depth";
constexpr std::size_t kWrittenTogether = 16;  // views: encoding takes longer than rendering ..
constexpr std::size_t kPixelsTogether = std::size_t{1} << 24;  // .. of so many pixels in all

struct RenderToolOptions {
  std::string model;
  std::string output;
  std::string transforms;
  std::vector<double> pose;        // T_C_O: x y z qx qy qz qw
  std::vector<double> intrinsics;  // fx fy cx cy
  std::vector<int> size;           // width height
  std::vector<float> background;   // r g b, 0..1; empty: alpha
  int max_size = 0;
  bool depth = false;
  bool psnr = false;
  bool json = false;
  BackendOptions backend;
};

void declare(CLI::App* app, RenderToolOptions* options) {
  const std::string name = app->get_name();
  app->description(
      "Renders a model: all views of a transforms.json, or one pose.\n\n"
      "Images are PNG with straight alpha unless a background is given.");
  app->footer("Examples:\n  " + name +
              " mug.safetensors --transforms photos/mug/transforms_test.json --psnr\n  " + name +
              " mug.safetensors --pose 0 0 0.6 1 0 0 0 --intrinsics 500 500 319.5 239.5"
              " --size 640 480 -o mug.png\n\n" +
              kExitCodes);
  app->add_option("model", options->model, "Model file")->required()->check(CLI::ExistingFile);
  app->add_option("-o,--output", options->output,
                  "PNG to write; with --transforms: the folder for them");
  auto* transforms =
      app->add_option("--transforms", options->transforms, "A transforms.json: renders its views")
          ->check(CLI::ExistingPath);
  app->add_option("--pose", options->pose,
                  "The object in the camera's optical frame: x y z qx qy qz qw [model units]")
      ->expected(7)
      ->excludes(transforms);
  app->add_option("--intrinsics", options->intrinsics,
                  "With --pose: fx fy cx cy [px; the centre of the first pixel is 0, 0]")
      ->expected(4);
  app->add_option("--size", options->size, "With --pose: width and height [px]")->expected(2);
  app->add_option("--max-size", options->max_size, "Largest width or height of the renderings [px]")
      ->check(CLI::PositiveNumber);
  app->add_option("--background", options->background, "Red, green, blue behind the object [0..1]")
      ->expected(3)
      ->check(CLI::Range(0.0, 1.0));
  app->add_flag("--depth", options->depth,
                "Also write NAME_depth.png: 16 bit, millimetres along the optical axis, 0 where "
                "there is no object (REP-118)");
  app->add_flag("--psnr", options->psnr, "Compare with the photos, both on black")
      ->needs(transforms);
  options->backend.addTo(app);
  app->add_flag("--json", options->json, "Print the result as JSON");
}

std::vector<PosedView> viewsOf(const RenderToolOptions& options,
                               const CancellationToken& cancellation) {
  if (!options.transforms.empty()) {
    return loadDataset(options.transforms, options.backend.datasetOptions(), cancellation).views;
  }
  if (options.pose.empty() || options.intrinsics.empty() || options.size.empty()) {
    throw std::invalid_argument("give --transforms, or --pose with --intrinsics and --size");
  }
  PosedView view;
  view.name = options.output;
  view.camera = cameraFromNumbers(options.intrinsics, options.size[0], options.size[1]);
  view.T_O_C = poseFromNumbers(options.pose).inverse();
  return {view};
}

Camera limited(const Camera& camera, int max_size) {
  const int longest = std::max(camera.width, camera.height);
  if (max_size == 0 || longest <= max_size) return camera;
  return camera.scaled(static_cast<double>(max_size) / longest);
}

/// Against the photo on black, of the size that was rendered.
double psnrOf(const Rendering& rendering, const Camera& camera, const PosedView& view) {
  const Image photo = composite(premultiply(*view.rgba), {0, 0, 0});
  return psnr(rendering.colour, resample(photo, view.camera, camera));
}

/// Depth along the optical axis [m], [h][w][1]; 0 where there is no object.
Image depthOf(const Rendering& rendering, const Pose& T_O_C, double metres_per_unit) {
  const Pose T_C_O = T_O_C.inverse();
  Image depth(rendering.alpha.width, rendering.alpha.height, 1);
  for (std::size_t i = 0; i < depth.values.size(); ++i) {
    const float alpha = rendering.alpha.values[i];
    if (alpha < kDepthAlpha) continue;
    const Eigen::Map<const Eigen::Vector3f> weighted(rendering.point.values.data() + 3 * i);
    const Eigen::Vector3d p_C = T_C_O * (weighted / alpha).cast<double>();
    depth.values[i] = static_cast<float>(p_C.z() * metres_per_unit);
  }
  return depth;
}

/// Of the images of a view, without the ending.
std::string outputStem(const RenderToolOptions& options, const PosedView& view) {
  if (!options.transforms.empty()) return options.output + '/' + fileStem(view.name);
  std::filesystem::path path(options.output);
  if (path.extension() == ".png") path.replace_extension();
  return path.string();
}

/// Views may have equal names in different folders, or depths and images may.
void requireDistinctOutputs(const RenderToolOptions& options, const std::vector<PosedView>& views) {
  if (options.output.empty()) return;
  std::set<std::string> stems;
  for (const PosedView& view : views) {
    const std::string stem = outputStem(options, view);
    const bool new_depth = !options.depth || stems.insert(stem + kDepthSuffix).second;
    if (!stems.insert(stem).second || !new_depth) {
      throw std::runtime_error("two views would be written to " + stem + ".png; one is " +
                               view.name);
    }
  }
}

void write(const RenderToolOptions& options, const Rendering& rendering, const PosedView& view,
           double metres_per_unit) {
  if (options.output.empty()) return;
  const std::string stem = outputStem(options, view);
  const PremultipliedImage image = {rendering.colour, rendering.alpha};
  const std::vector<float>& b = options.background;
  writePng(b.empty() ? straightBytes(image) : toBytes(composite(image, {b[0], b[1], b[2]})),
           stem + ".png");
  if (options.depth) {
    writeDepthPng(depthOf(rendering, view.T_O_C, metres_per_unit), stem + kDepthSuffix + ".png");
  }
}

/// Writes a rendering. @return what is said of it, beside its time.
nlohmann::json finished(const RenderToolOptions& options, const Rendering& rendering,
                        const PosedView& view, double metres_per_unit) {
  write(options, rendering, view, metres_per_unit);
  if (!options.psnr) return nlohmann::json::object();
  return {{"psnr_db", psnrOf(rendering, limited(view.camera, options.max_size), view)}};
}

void check(const RenderToolOptions& options, const Field& field) {
  if (options.output.empty() && !options.psnr) {
    throw std::invalid_argument("nothing to do: give --output or --psnr");
  }
  if (!options.output.empty() && !options.transforms.empty()) {
    std::filesystem::create_directories(options.output);
  }
  if (!options.output.empty()) {
    requireWritable(options.transforms.empty() ? options.output : options.output + '/');
  }
  if (options.depth && field.metadata.metres_per_unit == 0) {
    throw std::invalid_argument("--depth needs a model with a scale: train with --metres-per-unit");
  }
}

void report(const RenderToolOptions& options, const nlohmann::json& views) {
  double psnr_sum = 0;
  for (const auto& view : views) psnr_sum += view.value("psnr_db", 0.0);
  const double mean_psnr_db = psnr_sum / views.size();
  if (options.json) {
    nlohmann::json document = {{"model", options.model}, {"views", views}};
    if (options.psnr) document["mean_psnr_db"] = mean_psnr_db;
    printJson(document);
  } else if (options.psnr) {
    std::printf("%8s  view\n", "PSNR dB");
    for (const auto& view : views) {
      std::printf("%8.2f  %s\n", view["psnr_db"].get<double>(),
                  view["view"].get<std::string>().c_str());
    }
    std::printf("%8.2f  mean of %zu views\n", mean_psnr_db, views.size());
  }
}

void render(const RenderToolOptions& options, const CancellationToken& cancellation) {
  const auto field = std::make_shared<const Field>(loadModel(options.model));
  check(options, *field);
  const std::shared_ptr<Backend> backend = options.backend.make();
  const std::shared_ptr<const LoadedField> loaded = backend->load(field);
  const std::vector<PosedView> views = viewsOf(options, cancellation);
  requireDistinctOutputs(options, views);
  nlohmann::json rows = nlohmann::json::array();
  ProgressLine line;
  for (std::size_t first = 0; first < views.size();) {
    std::size_t pixels = 0;
    std::vector<Rendering> renderings;  // one after the other: each uses all threads
    for (std::size_t i = first;
         i < views.size() && renderings.size() < kWrittenTogether && pixels < kPixelsTogether;
         ++i) {
      line.show(static_cast<double>(i) / views.size(), views[i].name);
      const Camera camera = limited(views[i].camera, options.max_size);
      const auto start = std::chrono::steady_clock::now();
      renderings.push_back(loaded->render({camera, views[i].T_O_C}, {}, cancellation));
      const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
      rows.push_back({{"view", views[i].name}, {"seconds", elapsed.count()}});
      pixels += renderings.back().alpha.pixels();
    }
    std::vector<std::future<nlohmann::json>> written;
    for (std::size_t k = 0; k < renderings.size(); ++k) {
      written.push_back(std::async(std::launch::async, [&, k] {
        return finished(options, renderings[k], views[first + k], field->metadata.metres_per_unit);
      }));
    }
    for (std::size_t k = 0; k < written.size(); ++k) rows[first + k].update(written[k].get());
    first += renderings.size();
  }
  line.end();
  report(options, rows);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  return nerf_pose_refiner::runTool(argc, argv, nerf_pose_refiner::declare,
                                    nerf_pose_refiner::render);
}
