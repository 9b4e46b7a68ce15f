// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/colmap_text.h"

#include <algorithm>
#include <locale>
#include <sstream>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

/// The lines of a text, one after the other.
class Lines {
 public:
  explicit Lines(const std::string& text) : text_(text) {}

  /// The next line that is neither empty nor a comment. @return false at the end.
  bool nextEntry(std::string* line) {
    while (next(line)) {
      const std::size_t first = line->find_first_not_of(" \t");
      if (first != std::string::npos && (*line)[first] != '#') return true;
    }
    return false;
  }

  /// The next line, whatever it is.
  bool next(std::string* line) {
    if (begin_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', begin_), text_.size());
    *line = text_.substr(begin_, end - begin_);
    if (!line->empty() && line->back() == '\r') line->pop_back();
    begin_ = end + 1;
    ++number_;
    return true;
  }

  std::string where() const { return "line " + std::to_string(number_); }

 private:
  const std::string& text_;
  std::size_t begin_ = 0;
  std::size_t number_ = 0;
};

/// The fields of a line, separated by spaces, whatever the user's locale.
class Fields {
 public:
  explicit Fields(const std::string& line) : stream_(line) {
    stream_.imbue(std::locale::classic());
  }

  template <typename T>
  T next(const char* name) {
    T value;
    if (!(stream_ >> value)) {
      throw std::runtime_error(std::string(name) + " is missing or makes no sense");
    }
    return value;
  }

  /// All numbers that are left.
  std::vector<double> numbers() {
    std::vector<double> result;
    double value = 0;
    while (stream_ >> value) result.push_back(value);
    if (!stream_.eof()) throw std::runtime_error("a field is not a number");
    return result;
  }

  /// What is left of the line, for names may hold spaces.
  std::string rest() {
    std::string text;
    std::getline(stream_ >> std::ws, text);
    text.erase(text.find_last_not_of(" \t") + 1);
    return text;
  }

 private:
  std::istringstream stream_;
};

/// Reads an entry. Errors get the number of the line.
template <typename Reader>
void readEntry(const Lines& lines, const Reader& read) {
  try {
    read();
  } catch (const std::exception& error) {
    throw std::runtime_error(lines.where() + ": " + error.what());
  }
}

void requireRoom(std::size_t size, std::uint64_t limit, const char* what) {
  if (size >= limit) {
    throw std::runtime_error("it holds more than " + std::to_string(limit) + " " + what +
                             ", which is the limit");
  }
}

ColmapImage readImageLine(const std::string& line) {
  Fields fields(line);
  fields.next<std::uint32_t>("IMAGE_ID");
  std::vector<double> pose(7);
  for (double& number : pose) number = fields.next<double>("the pose");
  ColmapImage image;
  image.T_C_O = colmapPose(pose);
  image.camera = fields.next<std::uint32_t>("CAMERA_ID");
  image.name = fields.rest();
  return image;
}

ScenePoint readPoint(const std::string& line) {
  Fields fields(line);
  fields.next<std::uint64_t>("POINT3D_ID");
  ScenePoint point;
  for (int axis = 0; axis < 3; ++axis) point.position_O[axis] = fields.next<double>("XYZ");
  for (std::uint8_t& value : point.rgb) {
    const int level = fields.next<int>("RGB");
    if (level < 0 || level > 255) throw std::runtime_error("RGB is not in 0..255");
    value = static_cast<std::uint8_t>(level);
  }
  point.error_px = fields.next<double>("ERROR");
  const std::size_t track = fields.numbers().size();
  if (track % 2 != 0) throw std::runtime_error("TRACK does not hold pairs");
  point.photos = static_cast<std::uint32_t>(track / 2);
  checkColmapPoint(point);
  return point;
}

}  // namespace

ColmapCameras readColmapCamerasText(const std::string& text) {
  ColmapCameras cameras;
  Lines lines(text);
  for (std::string line; lines.nextEntry(&line);) {
    readEntry(lines, [&] {
      Fields fields(line);
      const auto id = fields.next<std::uint32_t>("CAMERA_ID");
      const ColmapLens& lens = colmapLens(fields.next<std::string>("MODEL"));
      const auto width = fields.next<double>("WIDTH"), height = fields.next<double>("HEIGHT");
      cameras[id] = colmapCamera(lens, width, height, fields.numbers());
    });
  }
  return cameras;
}

std::vector<ColmapImage> readColmapImagesText(const std::string& text,
                                              const DatasetLimits& limits) {
  std::vector<ColmapImage> images;
  Lines lines(text);
  for (std::string line; lines.nextEntry(&line); lines.next(&line)) {  // over the keypoints
    readEntry(lines, [&] {
      requireRoom(images.size(), limits.frames, "photos");
      images.push_back(readImageLine(line));
    });
  }
  return images;
}

std::vector<ScenePoint> readColmapPointsText(const std::string& text, const DatasetLimits& limits) {
  std::vector<ScenePoint> points;
  Lines lines(text);
  for (std::string line; lines.nextEntry(&line);) {
    readEntry(lines, [&] {
      requireRoom(points.size(), limits.points, "points");
      points.push_back(readPoint(line));
    });
  }
  return points;
}

}  // namespace nerf_pose_refiner
