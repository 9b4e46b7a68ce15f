// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/object_registration.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "field/model_file.h"
#include "image/io.h"
#include "support/expect_error.h"
#include "support/scripted_backend.h"
#include "support/small_field.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// Photos of an object in a box below "photos/mug", and a backend that makes believe to train.
class Registration : public testing::Test {
 protected:
  Registration() {
    settings.steps = 2;
    settings.accept_poor_data = true;  // all photos have one pose
    scene = {{"camera_angle_x", 1.0},
             {"aabb", {{-1, -1, -1}, {1, 1, 1}}},
             {"metres_per_unit", 0.1},
             {"frames", Json::array()}};
    for (int i = 0; i < 3; ++i) {
      const std::string name = std::to_string(i) + ".png";
      writePng(Image8(8, 6, 3, static_cast<std::uint8_t>(90 + i)),
               folder.file("photos/mug/" + name));
      scene["frames"].push_back(
          {{"file_path", name},
           {"transform_matrix", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 4}, {0, 0, 0, 1}}}});
    }
    request.name = "cup";
    request.dataset = "mug";
  }

  RegisteredObject run(const CancellationToken& cancellation = {}) {
    folder.write("photos/mug/transforms.json", scene.dump());
    return trainWithoutWriting(cancellation);
  }

  RegisteredObject trainWithoutWriting(const CancellationToken& cancellation = {}) {
    const auto make_backend = [this] {
      backend = std::make_shared<ScriptedBackend>();
      backend->model = smallField();
      ++backends;
      return backend;
    };
    return ObjectRegistration({dataset_root, limits}, settings, store(), make_backend,
                              [this] { return schedule; })
        .run(request, progress, cancellation);
  }

  ObjectStore store() { return ObjectStore(folder.path() + "/models", &cache); }
  bool trained() {
    const int before = backends;
    const bool loaded = run().loaded_existing;
    EXPECT_EQ(backends - before, loaded ? 0 : 1);
    return !loaded;
  }
  template <typename Error = std::invalid_argument, typename... Parts>
  void expectRefused(const Parts&... parts) {
    expectError<Error>([this] { run(); }, parts...);
    EXPECT_EQ(backends, 0);
    EXPECT_FALSE(fs::exists(folder.path() + "/models/cup.safetensors"));
  }

  TemporaryFolder folder;
  ModelCache cache;
  std::shared_ptr<ProcessorSchedule> schedule = std::make_shared<ProcessorSchedule>();
  std::string dataset_root = folder.path() + "/photos";
  DatasetLimits limits;
  RegistrationOptions settings;
  RegistrationRequest request;
  Json scene;
  std::shared_ptr<ScriptedBackend> backend;
  int backends = 0;
  RegistrationQueue::Progress progress;
};

TEST_F(Registration, TrainsSavesAndNames) {
  const RegisteredObject made = run();
  EXPECT_FALSE(made.loaded_existing);
  EXPECT_EQ(made.field->metadata.name, "cup");
  EXPECT_EQ(made.field->metadata.metres_per_unit, 0.1);
  EXPECT_EQ(backend->progress.size(), 2u);
  EXPECT_EQ(backend->box.max, Eigen::Vector3d(1, 1, 1));
  const auto saved = store().load("cup");
  EXPECT_EQ(saved->grid, made.field->grid);
  EXPECT_EQ(saved->metadata.data_hash, made.field->metadata.data_hash);
}

TEST_F(Registration, LoadsWhatIsThereAlready) {
  EXPECT_TRUE(trained());
  EXPECT_FALSE(trained());
  request.force_retrain = true;
  EXPECT_TRUE(trained());
}

TEST_F(Registration, TrainsAgainWhenSomethingIsDifferent) {
  EXPECT_TRUE(trained());
  request.metres_per_unit = 0.2;
  EXPECT_TRUE(trained());
  EXPECT_FALSE(trained());
  request.box_max.setConstant(0.5);
  EXPECT_TRUE(trained());
  EXPECT_EQ(backend->box.min, Eigen::Vector3d(0, 0, 0));
  request.max_seconds = 100;
  EXPECT_TRUE(trained());
  writePng(Image8(8, 6, 3, 0), folder.file("photos/mug/1.png"));
  EXPECT_TRUE(trained());
  settings.threads = 1;  // changes nothing
  EXPECT_FALSE(trained());
}

TEST_F(Registration, AScaleMustBeKnown) {
  scene.erase("metres_per_unit");
  expectRefused("'mug'", "set metres_per_unit");
  request.metres_per_unit = 0.25;
  EXPECT_EQ(run().field->metadata.metres_per_unit, 0.25);
}

TEST_F(Registration, RefusesRequestsThatMakeNoSense) {
  const RegistrationRequest good = request;
  request.name = "../cup";
  expectRefused("../cup");
  request = good;
  request.dataset = "../mug";
  expectRefused("../mug");
  request.dataset = "tub";
  expectRefused<std::runtime_error>("tub");
  request = good;
  request.max_seconds = -1;
  expectRefused("max_seconds");
  request = good;
  request.metres_per_unit = std::nan("");
  expectRefused("metres_per_unit");
  request = good;
  request.box_min.y() = 1;
  expectRefused("box_max");
  request = good;
  dataset_root.clear();
  expectRefused("root folder of datasets");
}

// A request comes over the network: the transforms.json it names must not read all files there are.
TEST_F(Registration, ReadsNoPhotosOutsideOfTheirFolder) {
  writePng(Image8(8, 6, 3, 7), folder.file("secret.png"));
  fs::create_symlink(folder.path() + "/secret.png", folder.file("photos/mug/link.png"));
  const std::string ways_out[] = {folder.path() + "/secret.png", "../../secret.png", "link.png"};
  for (const std::string& path : ways_out) {
    scene["frames"][1]["file_path"] = path;
    expectRefused<std::runtime_error>("frame 1", path);
    scene["frames"][1]["file_path"] = "1.png";
    scene["frames"][1]["mask_path"] = path;
    expectRefused<std::runtime_error>("frame 1", path);
    scene["frames"][1].erase("mask_path");
  }
}

TEST_F(Registration, AFullDiskIsNamedAndLeavesTheOldModel) {
  const std::shared_ptr<const Field> old = run().field;
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  const auto ignored = signal(SIGXFSZ, SIG_IGN);
  const rlimit little = {1000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &little);
  request.force_retrain = true;
  expectError<std::runtime_error>([&] { trainWithoutWriting(); }, "cannot write",
                                  "models/cup.safetensors", "File too large");
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, ignored);
  EXPECT_EQ(store().load("cup"), old) << "in memory";
  EXPECT_EQ(loadModel(folder.path() + "/models/cup.safetensors").grid, old->grid);
  int files = 0;
  for (const auto& file : fs::directory_iterator(folder.path() + "/models")) files += file.exists();
  EXPECT_EQ(files, 1) << "nothing half";
}

TEST_F(Registration, DataThatCannotBeAnObjectIsRefused) {
  settings.accept_poor_data = false;
  expectError<std::runtime_error>([this] { run(); }, "1 different poses", "accept_poor_data");
  EXPECT_FALSE(fs::exists(folder.path() + "/models/cup.safetensors"));
}

// Found out before the training, which may take minutes.
TEST_F(Registration, AFolderThatTakesNoModelIsFoundBeforeTheTraining) {
  folder.write("models", "a file");
  expectError<std::runtime_error>([this] { run(); }, "models");
  EXPECT_EQ(backends, 0);
}

TEST_F(Registration, OtherSymmetriesAreMeasuredAnew) {
  EXPECT_TRUE(trained());
  EXPECT_FALSE(trained());
  folder.write("models/cup.yaml", "symmetries: {continuous: {axis: [0, 0, 1]}}\n");
  EXPECT_TRUE(trained());
  EXPECT_FALSE(trained());
}

TEST_F(Registration, AStopAtTheLastMomentWritesNothing) {
  const CancellationToken cancellation;
  progress = [&](const RegistrationProgress& now) {
    if (now.stage == "quality") cancellation.requestCancel();
  };
  EXPECT_THROW(run(cancellation), Cancelled);
  EXPECT_FALSE(fs::exists(folder.path() + "/models/cup.safetensors"));
  EXPECT_TRUE(cache.list().empty());
}

TEST_F(Registration, LimitsOfTheDataset) {
  limits.frames = 1;
  expectRefused<std::runtime_error>("at most 1");
}

TEST_F(Registration, JobsAreTheSameIfAllThatCountsIs) {
  const auto key = [this] {
    return ObjectRegistration({dataset_root, limits}, settings, store(), {}, {}).jobOf(request).key;
  };
  const std::string first = key();
  settings.threads = 3;
  EXPECT_EQ(key(), first);
  settings.steps = 3;
  EXPECT_NE(key(), first);
  settings.steps = 2;
  request.box_max.z() = 1e-9;
  EXPECT_NE(key(), first);
  request.box_max.z() = 0;
  request.force_retrain = true;
  EXPECT_NE(key(), first);
  request.force_retrain = false;
  EXPECT_EQ(key(), first);
  dataset_root += "/mug";
  EXPECT_NE(key(), first);
}

TEST_F(Registration, CanBeStoppedWhileItReads) {
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(run(cancellation), Cancelled);
  EXPECT_EQ(backends, 0);
}

}  // namespace
}  // namespace nerf_pose_refiner
