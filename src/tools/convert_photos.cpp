// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/dataset_writer.h"
#include "tools/tool.h"

// Posed photos of any form to this package's own.

namespace nerf_pose_refiner {
namespace {

struct ConvertOptions {
  std::string dataset;
  std::string folder;
  double metres_per_unit = 0;
  std::vector<double> box;  // min x y z, max x y z
  PhotoOptions photos;
  int threads = 0;
};

void declare(CLI::App* app, ConvertOptions* options) {
  app->description(
      "Writes posed photos of any form that is read (docs/photo_formats.md) as a transforms.json\n"
      "and PNG images: undistorted, with masks as alpha.");
  app->footer("Example:\n  " + app->get_name() + " colmap_project -o photos/mug\n\n" + kExitCodes);
  app->add_option("dataset", options->dataset, "The folder of the photos, or a transforms.json")
      ->required()
      ->check(CLI::ExistingPath);
  app->add_option("-o,--output", options->folder, "Folder to make")->required();
  app->add_option("--metres-per-unit", options->metres_per_unit,
                  "Length of the unit of the poses [m]; default: as the dataset says")
      ->check(CLI::PositiveNumber);
  app->add_option("--box", options->box,
                  "Bounds of the object: min x y z, max x y z [dataset units]; default: the file's")
      ->expected(6);
  options->photos.addTo(app);
  app->add_option("--threads", options->threads, "Number of threads; 0: all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

Image8 withoutAlpha(const Image8& rgba) {
  Image8 rgb(rgba.width, rgba.height, 3);
  for (std::size_t i = 0; i < rgb.pixels(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) rgb.values[3 * i + c] = rgba.values[4 * i + c];
  }
  return rgb;
}

void convert(const ConvertOptions& options, const CancellationToken& cancellation) {
  const Dataset dataset = options.photos.load(options.dataset, options.threads, cancellation);
  DatasetHeader header;
  header.camera = dataset.views.front().camera;
  header.metres_per_unit =
      options.metres_per_unit > 0 ? options.metres_per_unit : dataset.metres_per_unit;
  header.has_box = dataset.has_box || !options.box.empty();
  header.box_min = dataset.box_min;
  header.box_max = dataset.box_max;
  if (!options.box.empty()) {
    header.box_min = {options.box[0], options.box[1], options.box[2]};
    header.box_max = {options.box[3], options.box[4], options.box[5]};
  }
  DatasetWriter writer(options.folder, header);
  for (const PosedView& view : dataset.views) {
    cancellation.check();
    writer.add(dataset.has_alpha ? *view.rgba : withoutAlpha(*view.rgba), view.T_O_C, view.camera);
  }
  std::printf("%s: %d photos\n", writer.finish().c_str(), static_cast<int>(dataset.views.size()));
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  return nerf_pose_refiner::runTool(argc, argv, nerf_pose_refiner::declare,
                                    nerf_pose_refiner::convert);
}
