// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/model_file.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <cstring>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "math/checksum.h"
#include "support/expect_error.h"
#include "support/sanitized.h"
#include "support/small_field.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

Field describedField() {
  Field field = smallField();
  field.config.step = 0.1f;
  field.config.cone_angle = 1.0f / 256;
  field.metadata.name = "a \"cup\", blue";
  field.metadata.metres_per_unit = 0.1;
  field.metadata.diameter = 1.0 / 3;
  field.metadata.centre = {1e-9, -2.5, 1.0 / 7};
  field.metadata.psnr_db = 31.25;
  field.metadata.score = {4, 0.0123, 4.5e-6};
  field.metadata.pose = {12, 1e-4, 2e-3, 3e-4, 4e-5, 0.9, 0.25, {24, 0.125, 0.0625, 0.5}};
  field.metadata.data_hash = "00ff";
  field.metadata.seed = 0xffffffffffffffffu;
  field.metadata.training_steps = 1u << 31;
  return field;
}

/// A model file taken apart, to be changed and put together again.
struct Parts {
  Json header;
  std::string data;
};

Parts partsOf(const std::string& bytes) {
  std::uint64_t length;
  std::memcpy(&length, bytes.data(), 8);
  return {Json::parse(bytes.substr(8, length)), bytes.substr(8 + length)};
}

std::string bytesOf(const Parts& parts) {
  const std::string text = parts.header.dump();
  const std::uint64_t length = text.size();
  return std::string(reinterpret_cast<const char*>(&length), 8) + text + parts.data;
}

class ModelFile : public testing::Test {
 protected:
  ModelFile() : path(folder.file("cup.safetensors")) {
    saveModel(describedField(), path);
    bytes = readFile(path);
  }

  template <typename... Texts>
  void expectRefused(const std::string& content, const Texts&... texts) const {
    const std::string bad = folder.write("bad.safetensors", content);
    expectError<std::runtime_error>([&] { loadModel(bad); }, "'" + bad + "'", texts...);
  }

  /// What is wrong with a file whose checksum was made right again after a change.
  template <typename... Texts>
  void expectRefusedAfter(const std::function<void(Parts*, Json* description)>& change,
                          const Texts&... texts) const {
    Parts parts = partsOf(bytes);
    Json& metadata = parts.header["__metadata__"];
    Json description = Json::parse(metadata["field"].get<std::string>());
    change(&parts, &description);
    const std::string text = description.dump();
    Checksum checksum;
    checksum.add(text.data(), text.size());
    checksum.add(parts.data.data(), parts.data.size());
    metadata["field"] = text;
    metadata["checksum"] = checksum.text();
    expectRefused(bytesOf(parts), texts...);
  }

  TemporaryFolder folder;
  std::string path;
  std::string bytes;
};

TEST_F(ModelFile, RoundTripKeepsEveryBit) {
  const Field a = describedField();
  const Field b = loadModel(path);
  EXPECT_EQ(a.config.profile, b.config.profile);
  EXPECT_EQ(a.config.levels, b.config.levels);
  EXPECT_EQ(a.config.features, b.config.features);
  EXPECT_EQ(a.config.log2_table_size, b.config.log2_table_size);
  EXPECT_EQ(a.config.base_resolution, b.config.base_resolution);
  EXPECT_EQ(a.config.finest_resolution, b.config.finest_resolution);
  EXPECT_EQ(a.config.density_width, b.config.density_width);
  EXPECT_EQ(a.config.density_hidden_layers, b.config.density_hidden_layers);
  EXPECT_EQ(a.config.geometry_features, b.config.geometry_features);
  EXPECT_EQ(a.config.colour_width, b.config.colour_width);
  EXPECT_EQ(a.config.colour_hidden_layers, b.config.colour_hidden_layers);
  EXPECT_EQ(a.config.sh_degree, b.config.sh_degree);
  EXPECT_EQ(a.config.step, b.config.step);
  EXPECT_EQ(a.config.cone_angle, b.config.cone_angle);
  EXPECT_EQ(a.config.occupancy_resolution, b.config.occupancy_resolution);
  EXPECT_EQ(a.metadata.name, b.metadata.name);
  EXPECT_EQ(a.metadata.metres_per_unit, b.metadata.metres_per_unit);
  EXPECT_EQ(a.metadata.diameter, b.metadata.diameter);
  EXPECT_EQ(a.metadata.centre, b.metadata.centre);
  EXPECT_EQ(a.metadata.psnr_db, b.metadata.psnr_db);
  EXPECT_EQ(a.metadata.score.views, b.metadata.score.views);
  EXPECT_EQ(a.metadata.score.mean_loss, b.metadata.score.mean_loss);
  EXPECT_EQ(a.metadata.score.stddev_loss, b.metadata.score.stddev_loss);
  const PoseStatistics &p = a.metadata.pose, &q = b.metadata.pose;
  EXPECT_EQ(p.views, q.views);
  EXPECT_EQ(p.lateral, q.lateral);
  EXPECT_EQ(p.depth, q.depth);
  EXPECT_EQ(p.tilt_rad, q.tilt_rad);
  EXPECT_EQ(p.roll_rad, q.roll_rad);
  EXPECT_EQ(p.right_score, q.right_score);
  EXPECT_EQ(p.wrong_score, q.wrong_score);
  EXPECT_EQ(p.keyframes.poses, q.keyframes.poses);
  EXPECT_EQ(p.keyframes.wrong_mean, q.keyframes.wrong_mean);
  EXPECT_EQ(p.keyframes.wrong_deviation, q.keyframes.wrong_deviation);
  EXPECT_EQ(p.keyframes.right_mean, q.keyframes.right_mean);
  EXPECT_EQ(p.keyframes.right_deviation, q.keyframes.right_deviation);
  EXPECT_EQ(a.metadata.data_hash, b.metadata.data_hash);
  EXPECT_EQ(a.metadata.seed, b.metadata.seed);
  EXPECT_EQ(a.metadata.training_steps, b.metadata.training_steps);
  EXPECT_EQ(a.box.min, b.box.min);
  EXPECT_EQ(a.box.max, b.box.max);
  EXPECT_EQ(a.grid, b.grid);
  EXPECT_EQ(a.density_weights, b.density_weights);
  EXPECT_EQ(a.colour_weights, b.colour_weights);
  EXPECT_EQ(a.occupancy.resolution, b.occupancy.resolution);
  EXPECT_EQ(a.occupancy.bits, b.occupancy.bits);
}

TEST_F(ModelFile, WithoutOccupancyGrid) {
  Field field = describedField();
  field.occupancy = OccupancyGrid();
  saveModel(field, path);
  EXPECT_EQ(loadModel(path).occupancy.resolution, 0);
}

TEST_F(ModelFile, SameFieldSameBytes) {
  const std::string other = folder.file("other.safetensors");
  saveModel(loadModel(path), other);
  EXPECT_EQ(readFile(other), bytes);
}

TEST_F(ModelFile, LayoutIsThatOfSafetensors) {
  // 2 levels of 128 and 256 entries with 2 features; 4 x 8 + 8 x 4 and 7 x 8 + 8 x 3 weights.
  const Parts parts = partsOf(bytes);
  EXPECT_EQ((bytes.size() - parts.data.size()) % 8, 0u);
  EXPECT_EQ(parts.header["grid"]["dtype"], "F16");
  EXPECT_EQ(parts.header["grid"]["shape"], Json({384, 2}));
  EXPECT_EQ(parts.header["grid"]["data_offsets"], Json({0, 1536}));
  EXPECT_EQ(parts.header["density_weights"]["dtype"], "F32");
  EXPECT_EQ(parts.header["density_weights"]["data_offsets"], Json({1536, 1792}));
  EXPECT_EQ(parts.header["colour_weights"]["data_offsets"], Json({1792, 2112}));
  EXPECT_EQ(parts.header["occupancy"]["dtype"], "U8");
  EXPECT_EQ(parts.header["occupancy"]["data_offsets"], Json({2112, 2176}));
  EXPECT_EQ(parts.data.size(), 2176u);
  for (const auto& entry : parts.header["__metadata__"]) EXPECT_TRUE(entry.is_string());
  std::uint16_t half;
  std::memcpy(&half, parts.data.data() + 10, 2);
  EXPECT_EQ(half, describedField().grid[5]);
}

TEST_F(ModelFile, ItsMetadataAreReadAlone) {
  const FieldMetadata read = readModelMetadata(path), saved = describedField().metadata;
  EXPECT_EQ(read.name, saved.name);
  EXPECT_EQ(read.diameter, saved.diameter);
  EXPECT_EQ(read.metres_per_unit, saved.metres_per_unit);
  EXPECT_EQ(read.data_hash, saved.data_hash);
  folder.write("short", bytes.substr(0, bytes.size() - 1));
  expectError<std::runtime_error>([&] { readModelMetadata(folder.file("short")); }, "short",
                                  "cut short");
  expectError<std::runtime_error>([&] { readModelMetadata(folder.file("none")); }, "none");
}

TEST_F(ModelFile, CutAtEveryLength) {
  const std::string bad = folder.file("bad.safetensors");
  folder.write("bad.safetensors", bytes);
  for (std::size_t size = bytes.size(); size-- > 0;) {
    std::filesystem::resize_file(bad, size);
    EXPECT_THROW(loadModel(bad), std::runtime_error) << size << " bytes";
  }
  expectRefused(bytes.substr(0, 5), "shorter than 8 bytes");
  expectRefused(bytes.substr(0, 100), "cut short within its header");
  expectRefused(bytes.substr(0, bytes.size() - 1), "cut short", "2176", "2175");
  expectRefused(bytes + '\0', "too long", "2177");
}

TEST_F(ModelFile, EveryFlippedBitIsNoticed) {
  std::fstream file(folder.write("bad.safetensors", bytes), std::ios::in | std::ios::out);
  const auto put = [&file](std::size_t i, char byte) {
    file.seekp(static_cast<std::streamoff>(i));
    file.put(byte).flush();
  };
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    put(i, static_cast<char>(bytes[i] ^ (1 << i % 8)));
    EXPECT_THROW(loadModel(folder.file("bad.safetensors")), std::runtime_error) << "byte " << i;
    put(i, bytes[i]);
  }
  EXPECT_NO_THROW(loadModel(folder.file("bad.safetensors")));
  std::string flipped = bytes;
  flipped[flipped.size() - 500] = static_cast<char>(flipped[flipped.size() - 500] ^ 4);
  expectRefused(flipped, "damaged", "checksum");
}

TEST_F(ModelFile, ForeignFiles) {
  expectRefused("", "shorter than 8 bytes");
  expectRefused("This is a text of more than eight bytes.\n", "not a model");
  expectRefused(std::string("\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16), "not a model");
  expectRefused(bytesOf({Json::array(), "12345678"}), "not a model", "JSON");
  Json other;
  other["w"] = {{"dtype", "F32"}, {"shape", {2}}, {"data_offsets", {0, 8}}};
  expectRefused(bytesOf({other, "12345678"}), "safetensors", "not a model");
  other["__metadata__"] = {{"format", "pt"}};
  expectRefused(bytesOf({other, "12345678"}), "safetensors", "not a model");
  other["__metadata__"] = "pt";
  expectRefused(bytesOf({other, "12345678"}), "safetensors", "not a model");
  expectError<std::runtime_error>([&] { loadModel(folder.file("none")); }, folder.file("none"),
                                  "No such file");
  expectError<std::runtime_error>([&] { loadModel(folder.path()); }, folder.path(), "directory");
}

TEST_F(ModelFile, AnotherVersion) {
  Parts parts = partsOf(bytes);
  parts.header["__metadata__"]["version"] = "2";
  expectRefused(bytesOf(parts), "version is \"2\"", "reads \"1\"");
  parts.header["__metadata__"].erase("version");
  expectRefused(bytesOf(parts), "version");
}

TEST_F(ModelFile, ClaimsOfSizesTakeNoMemory) {
  // Far more than the file holds and the test needs, far less than what is claimed.
  rlimit before;
  getrlimit(RLIMIT_AS, &before);
  const rlimit limited = {std::uint64_t{4} << 30, before.rlim_max};
  if (!kSanitized) setrlimit(RLIMIT_AS, &limited);

  std::string claim = bytes;
  const std::uint64_t length = std::uint64_t{1} << 60;
  std::memcpy(&claim[0], &length, 8);
  expectRefused(claim, "no header");
  const std::uint64_t short_length = 1 << 15;
  std::memcpy(&claim[0], &short_length, 8);
  expectRefused(claim, "cut short within its header");
  expectRefusedAfter(
      [](Parts* parts, Json* description) {
        Json& config = (*description)["config"];
        config["levels"] = 32;
        config["features"] = 8;
        config["log2_table_size"] = 24;
        config["base_resolution"] = 512;
        config["finest_resolution"] = 512;
        const std::uint64_t end = std::uint64_t{1} << 33;  // 2^29 entries of 16 bytes
        Json& header = parts->header;
        header["grid"]["shape"] = {1 << 29, 8};
        header["grid"]["data_offsets"] = {0, end};
        header["density_weights"]["shape"] = {2080};  // 256 x 8 + 8 x 4
        header["density_weights"]["data_offsets"] = {end, end + 8320};
        header["colour_weights"]["data_offsets"] = {end + 8320, end + 8640};
        header["occupancy"]["data_offsets"] = {end + 8640, end + 8704};
      },
      "cut short", "8589943296 bytes");
  expectRefusedAfter(
      [](Parts* parts, Json*) {
        parts->header["grid"]["shape"] = {std::uint64_t{1} << 60, 2};
        parts->header["grid"]["data_offsets"] = {0, std::uint64_t{1} << 62};
      },
      "the tensor 'grid'");
  setrlimit(RLIMIT_AS, &before);
}

TEST_F(ModelFile, TensorsThatDoNotFitTheConfiguration) {
  for (const char* name : {"grid", "density_weights", "colour_weights", "occupancy"}) {
    const std::string text = std::string("the tensor '") + name + "'";
    expectRefusedAfter([&](Parts* p, Json*) { p->header.erase(name); }, text);
    expectRefusedAfter([&](Parts* p, Json*) { p->header[name]["dtype"] = "BF16"; }, text);
    expectRefusedAfter([&](Parts* p, Json*) { p->header[name]["shape"][0] = 3; }, text);
    expectRefusedAfter([&](Parts* p, Json*) { p->header[name]["data_offsets"] = {8, 16}; }, text);
    expectRefusedAfter([&](Parts* p, Json*) { p->header[name] = nullptr; }, text);
  }
}

TEST_F(ModelFile, DescriptionsThatMakeNoSense) {
  expectRefusedAfter([](Parts*, Json* d) { (*d)["config"]["levels"] = 0; }, "levels is 0");
  expectRefusedAfter([](Parts*, Json* d) { (*d)["config"]["levels"] = 2.5; }, "levels");
  expectRefusedAfter([](Parts*, Json* d) { (*d)["config"].erase("step"); }, "step");
  expectRefusedAfter([](Parts*, Json* d) { (*d)["metadata"]["name"] = 7; }, "string");
  expectRefusedAfter([](Parts*, Json* d) { (*d)["box"]["max"] = {-5, -5, -5}; }, "box is empty");
  expectRefusedAfter([](Parts*, Json* d) { (*d)["box"]["max"] = {1, 2}; }, "");
  expectRefusedAfter([](Parts*, Json* d) { d->erase("has_occupancy"); }, "has_occupancy");
}

TEST_F(ModelFile, NumbersThatAreNoneInAWholeFile) {
  const auto poke = [](std::size_t offset, std::vector<unsigned char> value) {
    return
        [=](Parts* parts, Json*) { std::memcpy(&parts->data[offset], value.data(), value.size()); };
  };
  expectRefusedAfter(poke(100, {0x00, 0x7e}), "Field::grid", "not finite");
  expectRefusedAfter(poke(1540, {0, 0, 0xc0, 0x7f}), "Field::density_weights", "not finite");
  expectRefusedAfter(poke(1800, {0, 0, 0x80, 0xff}), "Field::colour_weights", "not finite");
}

TEST_F(ModelFile, AFieldThatDoesNotFitIsNotSaved) {
  Field field = describedField();
  field.grid.pop_back();
  EXPECT_THROW(saveModel(field, path), std::invalid_argument);
  EXPECT_EQ(readFile(path), bytes);
}

/// Files in a folder.
std::size_t fileCount(const TemporaryFolder& folder) {
  const std::filesystem::directory_iterator files(folder.path());
  return static_cast<std::size_t>(std::distance(begin(files), end(files)));
}

TEST_F(ModelFile, AFullDiskLeavesTheOldFileAlone) {
  // A limit on the size of files fails in the middle of the writing, as a full disk does.
  Field field = describedField();
  field.metadata.name = "new";
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  const auto old_handler = signal(SIGXFSZ, SIG_IGN);
  for (const rlim_t size : {0, 7, 1000, 3000}) {
    const rlimit limited = {size, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limited);
    expectError<std::runtime_error>([&] { saveModel(field, path); }, path, "File too large");
  }
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, old_handler);
  EXPECT_EQ(readFile(path), bytes);
  EXPECT_EQ(fileCount(folder), 1u);
}

TEST_F(ModelFile, PlacesThatCannotBeWritten) {
  const std::string nowhere = folder.path() + "/none/cup.safetensors";
  expectError<std::runtime_error>([&] { saveModel(describedField(), nowhere); }, nowhere,
                                  "No such file");
  // A folder in the way: the renaming fails, and the temporary file goes.
  const std::string folder_path = folder.path() + "/folder";
  std::filesystem::create_directories(folder_path + "/full");
  expectError<std::runtime_error>([&] { saveModel(describedField(), folder_path); }, folder_path);
  EXPECT_EQ(fileCount(folder), 2u);
}

TEST_F(ModelFile, ReplacesAnOldFileAndLeavesNothingBeside) {
  Field field = describedField();
  field.metadata.name = "new";
  saveModel(field, path);
  EXPECT_EQ(loadModel(path).metadata.name, "new");
  EXPECT_EQ(fileCount(folder), 1u);
}

TEST_F(ModelFile, OthersMayReadItAsTheUmaskSays) {
  const mode_t before = umask(022);
  saveModel(describedField(), path);
  umask(before);
  struct stat status;
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0644u);
}

TEST_F(ModelFile, LeftoversOfACrashAreNoObstacle) {
  for (int i = 0; i < 3; ++i) {
    folder.write("cup.safetensors.tmp" + std::to_string(getpid()) + "_" + std::to_string(i), "");
  }
  EXPECT_NO_THROW(saveModel(describedField(), path));
  EXPECT_NO_THROW(loadModel(path));
}

TEST_F(ModelFile, NamesThatAreNoUtf8AreMended) {
  Field field = describedField();
  field.metadata.name = "caf\xe9";
  saveModel(field, path);
  EXPECT_EQ(loadModel(path).metadata.name, "caf\xef\xbf\xbd");
}

}  // namespace
}  // namespace nerf_pose_refiner
