// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/landmark_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <stdexcept>
#include <vector>

#include "detection/field_checksum.h"
#include "files/atomic_file.h"
#include "files/input_file.h"

namespace nerf_pose_refiner {
namespace {

constexpr char kFormat[8] = {'N', 'P', 'R', 'L', 'M', 'K', '0', '1'};
constexpr float kScale = 254;  // of a descriptor's numbers, which are rarely beyond a half
constexpr std::uint32_t kMaxLandmarks = 1000000;

struct Header {
  char format[8];
  std::uint64_t key;
  std::uint64_t checksum;  // of all that follows
  std::uint64_t kind;
  std::uint32_t count;
  std::uint32_t numbers;  // of a descriptor
};

/// A landmark as it is written.
struct Place {
  float point[3];
  float R_O_F[9];  // column by column
  float size;
  std::int32_t views;
};

Place placeOf(const Landmark& landmark) {
  Place place = {};
  std::copy_n(landmark.point.data(), 3, place.point);
  std::copy_n(landmark.R_O_F.data(), 9, place.R_O_F);
  place.size = landmark.size;
  place.views = landmark.views;
  return place;
}

Landmark landmarkOf(const Place& place) {
  Landmark landmark;
  std::copy_n(place.point, 3, landmark.point.data());
  std::copy_n(place.R_O_F, 9, landmark.R_O_F.data());
  landmark.size = place.size;
  landmark.views = place.views;
  return landmark;
}

std::uint64_t checksumOf(const Header& header, const std::vector<Place>& places,
                         const std::vector<std::int8_t>& rows) {
  Checksum checksum;
  addTo(header.kind, &checksum);
  addTo(header.count, &checksum);
  addTo(header.numbers, &checksum);
  checksum.add(places.data(), places.size() * sizeof(Place));
  checksum.add(rows.data(), rows.size());
  return checksum.value();
}

/// The checksum tells damage, not a file that was made to harm: numbers that do not match those of
/// an image's features would be read beyond their end.
bool isOfKind(const Header& header) {
  constexpr std::uint32_t kSiftNumbers = 128, kKazeNumbers = 64;
  const auto is = [&](FeatureKind kind) { return header.kind == static_cast<std::uint64_t>(kind); };
  return (is(FeatureKind::kSift) && header.numbers == kSiftNumbers) ||
         (is(FeatureKind::kAkaze) && header.numbers == kKazeNumbers);
}

bool isFinite(const Place& place) {
  const auto finite = [](float number) { return std::isfinite(number); };
  return std::all_of(std::begin(place.point), std::end(place.point), finite) &&
         std::all_of(std::begin(place.R_O_F), std::end(place.R_O_F), finite) && finite(place.size);
}

/// Descriptors, a byte a number.
std::vector<std::int8_t> rowsOf(const Landmarks& landmarks) {
  std::vector<std::int8_t> rows;
  for (Eigen::Index i = 0; i < landmarks.descriptors.size(); ++i) {
    const float value = std::round(kScale * landmarks.descriptors.data()[i]);
    rows.push_back(static_cast<std::int8_t>(std::max(-127.0f, std::min(127.0f, value))));
  }
  return rows;
}

Landmarks landmarksFrom(const Header& header, const std::vector<Place>& places,
                        const std::vector<std::int8_t>& rows) {
  Landmarks landmarks;
  landmarks.kind = static_cast<FeatureKind>(header.kind);
  for (const Place& place : places) landmarks.places.push_back(landmarkOf(place));
  using Rows = Eigen::Matrix<std::int8_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  landmarks.descriptors =
      Eigen::Map<const Rows>(rows.data(), header.count, header.numbers).cast<float>() / kScale;
  return landmarks;
}

/// Its key, checksum and format are not set.
Header headerOf(const Landmarks& landmarks) {
  Header header = {};
  header.kind = static_cast<std::uint64_t>(landmarks.kind);
  header.count = static_cast<std::uint32_t>(landmarks.places.size());
  header.numbers = static_cast<std::uint32_t>(landmarks.descriptors.cols());
  return header;
}

std::vector<Place> placesOf(const Landmarks& landmarks) {
  std::vector<Place> places;
  for (const Landmark& landmark : landmarks.places) places.push_back(placeOf(landmark));
  return places;
}

Landmarks read(const InputFile& file, std::uint64_t key) {
  Header header;
  file.read(0, &header, sizeof header);
  const std::uint64_t rows_bytes = std::uint64_t{header.count} * header.numbers;
  const std::uint64_t places_bytes = std::uint64_t{header.count} * sizeof(Place);
  if (std::memcmp(header.format, kFormat, sizeof kFormat) != 0 || header.key != key ||
      header.count > kMaxLandmarks || !isOfKind(header) ||
      file.size() != sizeof header + places_bytes + rows_bytes) {
    throw std::runtime_error("no landmarks of this object");
  }
  std::vector<Place> places(header.count);
  std::vector<std::int8_t> rows(rows_bytes);
  file.read(sizeof header, places.data(), places_bytes);
  file.read(sizeof header + places_bytes, rows.data(), rows.size());
  if (checksumOf(header, places, rows) != header.checksum) throw std::runtime_error("damaged");
  if (!std::all_of(places.begin(), places.end(), isFinite)) throw std::runtime_error("not finite");
  return landmarksFrom(header, places, rows);
}

}  // namespace

std::uint64_t landmarkKey(const Field& field, const LandmarkSettings& settings) {
  constexpr std::uint32_t kVersion = 1;  // of how landmarks are made
  Checksum checksum;
  addTo(kVersion, &checksum);
  addTo(field, &checksum);
  for (const double value : {settings.features.contrast, settings.distance, settings.least_support,
                             settings.same_place, settings.same_look}) {
    addTo(value, &checksum);
  }
  for (const int value : {static_cast<int>(settings.features.kind), settings.features.max_features,
                          settings.views, settings.object_px, settings.max_landmarks}) {
    addTo(value, &checksum);
  }
  return checksum.value();
}

std::string landmarkPathOf(const std::string& model_path) {
  return std::filesystem::path(model_path).replace_extension(".landmarks").string();
}

void saveLandmarks(const Landmarks& landmarks, std::uint64_t key, const std::string& path) {
  const std::vector<Place> places = placesOf(landmarks);
  const std::vector<std::int8_t> rows = rowsOf(landmarks);
  Header header = headerOf(landmarks);
  std::copy_n(kFormat, sizeof kFormat, header.format);
  header.key = key;
  header.checksum = checksumOf(header, places, rows);
  AtomicFile file(path);
  file.write(&header, sizeof header);
  file.write(places.data(), places.size() * sizeof(Place));
  file.write(rows.data(), rows.size());
  file.commit();
}

Landmarks asStored(const Landmarks& landmarks) {
  return landmarksFrom(headerOf(landmarks), placesOf(landmarks), rowsOf(landmarks));
}

std::optional<Landmarks> loadLandmarks(const std::string& path, std::uint64_t key) {
  try {
    return read(InputFile(path), key);
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

}  // namespace nerf_pose_refiner
