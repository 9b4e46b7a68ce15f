// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "dataset/dataset.h"
#include "detection/landmark_file.h"
#include "field/model_file.h"
#include "field/object_metadata.h"
#include "registration/registrar.h"
#include "registration/registration_options.h"
#include "runtime/detection_files.h"
#include "tools/tool.h"
#include "trust/look_alikes.h"

// Posed photos to a model file.

namespace nerf_pose_refiner {
namespace {

struct TrainOptions {
  std::string dataset;
  std::string model;
  std::string name;
  std::vector<double> box;  // min x y z, max x y z
  RegistrationOptions settings;
  PhotoOptions photos;
  BackendOptions backend;
  bool landmarks = false;
  bool json = false;
};

/// One option for each setting: --held-out for held_out, --target-psnr for target_psnr_db.
void addSettings(CLI::App* app, RegistrationOptions* settings) {
  visitSettings(*settings, [app](const std::string& name, auto& value, const char* meaning) {
    std::string option = "--" + name.substr(0, name.rfind("_db"));
    std::replace(option.begin(), option.end(), '_', '-');
    if constexpr (std::is_same_v<std::decay_t<decltype(value)>, bool>) {
      app->add_flag(option, value, meaning);
    } else {
      app->add_option(option, value, meaning)->capture_default_str();
    }
  });
  app->get_option("--profile")->check(CLI::IsMember(FieldConfig::profileNames()));
}

void declare(CLI::App* app, TrainOptions* options) {
  app->description(
      "Learns a model of an object from posed photos.\n\n"
      "The photos come with a transforms.json (nerfstudio, instant-ngp, NeRF Synthetic), from\n"
      "COLMAP, BOP, Polycam or Record3D: docs/photo_formats.md. They show the object alone: with\n"
      "alpha, with masks, or inside a box that is given.");
  app->footer("Example:\n  " + app->get_name() +
              " photos/mug -o mug.safetensors --metres-per-unit 0.1 --max-seconds 120\n\n" +
              kExitCodes);
  app->add_option("dataset", options->dataset, "The folder of the photos, or a transforms.json")
      ->required()
      ->check(CLI::ExistingPath);
  app->add_option("-o,--output", options->model, "Model file to write (.safetensors)")->required();
  app->add_option("--name", options->name, "Name of the object; default: the model file's");
  addSettings(app, &options->settings);
  app->add_option("--box", options->box,
                  "Bounds of the object: min x y z, max x y z [dataset units]; default: the file's")
      ->expected(6);
  options->photos.addTo(app);
  options->backend.addTo(app);
  app->add_flag(
      "--landmarks", options->landmarks,
      "Also write <name>.landmarks, for detection: features of the photos serve it better\n"
      "than those of renderings, which it makes otherwise");
  app->add_flag("--json", options->json, "Print the result as JSON");
}

void report(const TrainOptions& options, const Field& field, double seconds) {
  const FieldMetadata& metadata = field.metadata;
  if (options.json) {
    printJson({{"model", options.model},
               {"name", metadata.name},
               {"profile", field.config.profile},
               {"steps", metadata.training_steps},
               {"seconds", seconds},
               {"psnr_db", metadata.psnr_db},
               {"held_out_views", metadata.score.views},
               {"colour_error", metadata.score.mean_loss},
               {"colour_error_stddev", metadata.score.stddev_loss},
               {"exposure_spread",
                metadata.exposure_spread ? nlohmann::json(*metadata.exposure_spread) : nullptr},
               {"pose_views", metadata.pose.views},
               {"pose_error_lateral_diameters", metadata.pose.lateral},
               {"pose_error_depth_share", metadata.pose.depth},
               {"pose_error_tilt_rad", metadata.pose.tilt_rad},
               {"pose_error_roll_rad", metadata.pose.roll_rad},
               {"score_right", metadata.pose.right_score},
               {"score_wrong", metadata.pose.wrong_score},
               {"diameter", metadata.diameter},
               {"look_alikes", describe(metadata.look_alikes)},
               {"metres_per_unit", metadata.metres_per_unit}});
    return;
  }
  std::printf("%s: %llu steps in %.1f s", options.model.c_str(),
              static_cast<unsigned long long>(metadata.training_steps), seconds);
  if (metadata.score.views > 0) {
    std::printf(", PSNR %.2f dB on %d held-out views (colours of the object off by %.3f +- %.3f)",
                metadata.psnr_db, metadata.score.views, metadata.score.mean_loss,
                metadata.score.stddev_loss);
  }
  if (!metadata.exposure_spread && !options.settings.keep_colours) {
    std::printf(", the photos' exposures could not be compared");
  } else if (metadata.exposure_spread.value_or(0) > 0) {
    std::printf(", photos of different exposure (%.0f %%) made equal",
                100 * *metadata.exposure_spread);
  }
  if (metadata.look_alikes.any()) {
    std::printf(", may be taken for itself: %s", describe(metadata.look_alikes).c_str());
  }
  std::printf(", diameter %.4g units", metadata.diameter);
  if (metadata.metres_per_unit > 0) {
    std::printf(" = %.4g m\n", metadata.diameter * metadata.metres_per_unit);
  } else {
    std::printf("\nThe scale is unknown: ROS will refuse this model. See --metres-per-unit.\n");
  }
}

void train(const TrainOptions& options, const CancellationToken& cancellation) {
  requireModelWritable(FieldConfig::named(options.settings.profile), options.model);
  Dataset dataset = options.photos.load(options.dataset, options.backend.threads, cancellation);
  if (!options.box.empty()) {
    dataset.has_box = true;
    dataset.box_min = {options.box[0], options.box[1], options.box[2]};
    dataset.box_max = {options.box[3], options.box[4], options.box[5]};
  }
  RegistrationOptions settings = options.settings;
  settings.threads = options.backend.threads;
  const ObjectMetadata said = readObjectMetadata(metadataPathOf(options.model));
  settings.symmetries = said.symmetries.inFrame(said.T_O_U);
  double seconds = 0;
  Field field;
  const std::shared_ptr<Backend> backend = options.backend.make();
  {
    ProgressLine line;
    const auto show = [&](const RegistrationProgress& progress) {
      char text[120];
      std::snprintf(text, sizeof text, "%s %d/%d  loss %.5f  %.0f s, %.0f s left",
                    progress.stage.c_str(), progress.step, progress.steps, progress.loss,
                    progress.seconds, progress.seconds_left);
      line.show(progress.steps > 0 ? static_cast<double>(progress.step) / progress.steps : 0, text);
      seconds = progress.seconds;
    };
    field = learnField(backend.get(), dataset, settings, show, cancellation);
  }
  field.metadata.name = options.name.empty() ? fileStem(options.model) : options.name;
  saveModel(field, options.model);
  if (options.landmarks) {
    learnDetection(backend.get(), std::make_shared<const Field>(field), dataset,
                   landmarkPathOf(options.model), cancellation);
  }
  report(options, field, seconds);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  return nerf_pose_refiner::runTool(argc, argv, nerf_pose_refiner::declare,
                                    nerf_pose_refiner::train);
}
