// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/object_metadata.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "field/model_file.h"
#include "files/atomic_file.h"
#include "files/input_file.h"

namespace nerf_pose_refiner {
namespace {

using YAML::Node;

constexpr std::uint64_t kMaxBytes = 1 << 16;  // of a file
constexpr double kUnitTolerance = 0.01;       // of the length of what is to have length 1

[[noreturn]] void fail(const Node& node, const std::string& what) {
  const int line = node.IsDefined() ? node.Mark().line : -1;
  throw std::runtime_error((line < 0 ? "" : "line " + std::to_string(line + 1) + ": ") + what);
}

std::string text(double value) {
  std::ostringstream stream;
  stream << value;
  return stream.str();
}

/// A value of the file and how errors call it.
struct Entry {
  Node node;
  std::string name;

  [[noreturn]] void fail(const std::string& what) const {
    nerf_pose_refiner::fail(node, name + " " + what);
  }

  explicit operator bool() const { return node.IsDefined(); }

  /// A map that holds no other keys than these.
  void requireKeys(const std::vector<std::string>& known) const {
    if (!node.IsMap()) fail("must be a map of " + list(known));
    std::set<std::string> seen;
    for (const auto& pair : node) {
      const std::string key = pair.first.IsScalar() ? pair.first.Scalar() : "?";
      if (std::find(known.begin(), known.end(), key) == known.end()) {
        nerf_pose_refiner::fail(pair.first,
                                "'" + key + "' is unknown: " + name + " may hold " + list(known));
      }
      if (!seen.insert(key).second)
        nerf_pose_refiner::fail(pair.first, "'" + key + "' comes twice");
    }
  }

  /// Not defined, if it is not there.
  Entry at(const std::string& key) const { return {node[key], key}; }

  Entry required(const std::string& key) const {
    if (!node[key].IsDefined()) fail("has no '" + key + "'");
    return at(key);
  }

  double number() const {
    double value = 0;
    // A number in quotes is text.
    if (!node.IsScalar() || node.Tag() == "!" || !YAML::convert<double>::decode(node, value)) {
      fail("must be a number");
    }
    if (!std::isfinite(value)) fail("must be finite");
    return value;
  }

  template <int n>
  Eigen::Matrix<double, n, 1> numbers(const char* of_what) const {
    if (!node.IsSequence() || node.size() != static_cast<std::size_t>(n)) {
      fail("must be " + std::to_string(n) + " numbers: " + of_what);
    }
    Eigen::Matrix<double, n, 1> values;
    for (int i = 0; i < n; ++i) values[i] = Entry{node[i], name}.number();
    return values;
  }

  template <int n>
  Eigen::Matrix<double, n, 1> unitVector(const char* of_what) const {
    const Eigen::Matrix<double, n, 1> vector = numbers<n>(of_what);
    if (std::abs(vector.norm() - 1) > kUnitTolerance) {
      fail("must have length 1, and has " + text(vector.norm()));
    }
    return vector.normalized();
  }

 private:
  static std::string list(const std::vector<std::string>& names) {
    std::string all;
    for (const std::string& each : names) all += (all.empty() ? "" : ", ") + each;
    return all;
  }
};

Pose readPose(const Entry& entry) {
  Pose pose;
  if (const Entry position = entry.at("position")) pose.t = position.numbers<3>("x, y, z");
  if (const Entry orientation = entry.at("orientation")) {
    const Eigen::Vector4d q = orientation.unitVector<4>("a quaternion x, y, z, w");
    pose.R = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).toRotationMatrix();
  }
  return pose;
}

Box readBox(const Entry& entry) {
  entry.requireKeys({"min", "max"});
  const Box box = {entry.required("min").numbers<3>("x, y, z"),
                   entry.required("max").numbers<3>("x, y, z")};
  if (!((box.max - box.min).minCoeff() > 0)) {
    entry.fail("must have a max that is greater than its min on every axis");
  }
  return box;
}

SymmetryAxis readAxis(const Entry& entry) {
  SymmetryAxis axis;
  axis.direction = entry.required("axis").unitVector<3>("its direction x, y, z");
  if (const Entry point = entry.at("point")) axis.point = point.numbers<3>("x, y, z");
  return axis;
}

Pose readDiscrete(const Entry& entry) {
  if (!entry.node.IsMap() || !entry.at("axis")) {
    entry.requireKeys({"position", "orientation"});
    return readPose(entry);
  }
  entry.requireKeys({"axis", "point", "fold"});
  const Entry fold = entry.required("fold");
  const double n = fold.number();
  if (!(n == std::floor(n) && n >= 2 && n <= Symmetries::kMaxMotions)) {
    fold.fail("must be a whole number from 2 to " + std::to_string(Symmetries::kMaxMotions));
  }
  return turnAbout(readAxis(entry), 2 * M_PI / n);
}

Symmetries readSymmetries(const Entry& entry) {
  entry.requireKeys({"continuous", "discrete"});
  std::optional<SymmetryAxis> axis;
  if (const Entry continuous = entry.at("continuous")) {
    continuous.requireKeys({"axis", "point"});
    axis = readAxis(continuous);
  }
  std::vector<Pose> discrete;
  if (const Entry list = entry.at("discrete")) {
    if (!list.node.IsSequence()) list.fail("must be a list");
    for (const Node& each : list.node) discrete.push_back(readDiscrete({each, "discrete"}));
  }
  try {
    return Symmetries(axis, discrete);
  } catch (const std::invalid_argument& e) {
    fail(entry.node, e.what());
  }
}

ObjectMetadata readDocument(const Node& document) {
  ObjectMetadata metadata;
  if (!document.IsDefined() || document.IsNull()) return metadata;
  const Entry top = {document, "the file"};
  top.requireKeys({"metres_per_unit", "frame_in_model", "bounding_box", "symmetries"});
  if (const Entry scale = top.at("metres_per_unit")) {
    metadata.metres_per_unit = scale.number();
    if (!(metadata.metres_per_unit > 0)) scale.fail("must be greater than 0");
  }
  if (const Entry frame = top.at("frame_in_model")) {
    frame.requireKeys({"position", "orientation"});
    metadata.T_O_U = readPose(frame);
  }
  if (const Entry box = top.at("bounding_box")) metadata.box = readBox(box);
  if (const Entry symmetries = top.at("symmetries")) {
    metadata.symmetries = readSymmetries(symmetries);
  }
  return metadata;
}

class IgnoredEvents final : public YAML::EventHandler {
  using Mark = YAML::Mark;
  using Text = std::string;
  using Style = YAML::EmitterStyle::value;
  void OnDocumentStart(const Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const Mark&, YAML::anchor_t) override {}
  void OnAlias(const Mark&, YAML::anchor_t) override {}
  void OnScalar(const Mark&, const Text&, YAML::anchor_t, const Text&) override {}
  void OnSequenceStart(const Mark&, const Text&, YAML::anchor_t, Style) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const Mark&, const Text&, YAML::anchor_t, Style) override {}
  void OnMapEnd() override {}
};

/// (Not by YAML::LoadAll: from text that begins with a comma it makes documents without end.)
bool hasMoreDocuments(const std::string& content) {
  std::istringstream stream(content);
  YAML::Parser parser(stream);
  IgnoredEvents ignored;
  return parser.HandleNextDocument(ignored) && parser.HandleNextDocument(ignored);
}

}  // namespace

namespace {

template <typename Vector>
void emitList(YAML::Emitter* out, const Vector& values) {
  *out << YAML::Flow << YAML::BeginSeq;
  for (Eigen::Index i = 0; i < values.size(); ++i) *out << values[i];
  *out << YAML::EndSeq;
}

void emitPose(YAML::Emitter* out, const Pose& pose) {
  *out << YAML::BeginMap << YAML::Key << "position" << YAML::Value;
  emitList(out, pose.t);
  *out << YAML::Key << "orientation" << YAML::Value;
  emitList(out, Eigen::Quaterniond(pose.R).coeffs());  // x, y, z, w
  *out << YAML::EndMap;
}

void emitSymmetries(YAML::Emitter* out, const Symmetries& symmetries) {
  *out << YAML::BeginMap;
  if (symmetries.axis()) {
    *out << YAML::Key << "continuous" << YAML::Value << YAML::BeginMap << YAML::Key << "axis";
    emitList(out, symmetries.axis()->direction);
    *out << YAML::Key << "point";
    emitList(out, symmetries.axis()->point);
    *out << YAML::EndMap;
  }
  if (symmetries.motions().size() > 1) {
    *out << YAML::Key << "discrete" << YAML::Value << YAML::BeginSeq;
    for (std::size_t i = 1; i < symmetries.motions().size(); ++i) {
      emitPose(out, symmetries.motions()[i]);
    }
    *out << YAML::EndSeq;
  }
  *out << YAML::EndMap;
}

bool nearlySame(const Pose& a, const Pose& b) {
  constexpr double kRounding = 1e-9;
  return a.R.isApprox(b.R, kRounding) && (a.t - b.t).norm() <= kRounding * (1 + a.t.norm());
}

bool sameSymmetries(const Symmetries& a, const Symmetries& b) {
  if (a.axis().has_value() != b.axis().has_value()) return false;
  if (a.axis() && !nearlySame(turnAbout(*a.axis(), 1), turnAbout(*b.axis(), 1))) return false;
  const auto has = [&](const Pose& motion) {
    return std::any_of(b.motions().begin(), b.motions().end(),
                       [&](const Pose& other) { return nearlySame(motion, other); });
  };
  return a.motions().size() == b.motions().size() &&
         std::all_of(a.motions().begin(), a.motions().end(), has);
}

}  // namespace

void writeObjectMetadata(const ObjectMetadata& metadata, const std::string& path) {
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  out << YAML::BeginMap;
  if (metadata.metres_per_unit > 0) {
    out << YAML::Key << "metres_per_unit" << YAML::Value << metadata.metres_per_unit;
  }
  out << YAML::Key << "frame_in_model" << YAML::Value;
  emitPose(&out, metadata.T_O_U);
  if (metadata.box) {
    out << YAML::Key << "bounding_box" << YAML::Value << YAML::BeginMap << YAML::Key << "min";
    emitList(&out, metadata.box->min);
    out << YAML::Key << "max";
    emitList(&out, metadata.box->max);
    out << YAML::EndMap;
  }
  if (metadata.symmetries.any()) {
    out << YAML::Key << "symmetries" << YAML::Value;
    emitSymmetries(&out, metadata.symmetries);
  }
  out << YAML::EndMap << YAML::Newline;
  AtomicFile file(path);
  file.write(out.c_str(), out.size());
  file.commit();
}

ObjectMetadata metadataBesideModel(const FieldMetadata& object) {
  ObjectMetadata metadata;
  metadata.T_O_U = object.T_O_U;
  metadata.box = object.box;
  metadata.symmetries = object.symmetries.inFrame(object.T_O_U.inverse());
  return metadata;
}

bool sameFrame(const ObjectMetadata& a, const ObjectMetadata& b) {
  constexpr double kRounding = 1e-9;
  const bool same_box = a.box.has_value() == b.box.has_value() &&
                        (!a.box || (a.box->min.isApprox(b.box->min, kRounding) &&
                                    a.box->max.isApprox(b.box->max, kRounding)));
  return same_box && nearlySame(a.T_O_U, b.T_O_U) && sameSymmetries(a.symmetries, b.symmetries);
}

std::string metadataPathOf(const std::string& model_path) {
  return std::filesystem::path(model_path).replace_extension(".yaml").string();
}

ObjectMetadata readObjectMetadata(const std::string& path) {
  try {
    if (!std::filesystem::exists(path)) return {};
    const std::string content = readWhole(InputFile(path), kMaxBytes);
    if (hasMoreDocuments(content)) throw std::runtime_error("it holds more than one document");
    return readDocument(YAML::Load(content));
  } catch (const YAML::Exception& e) {
    throw std::runtime_error("cannot read '" + path + "': line " + std::to_string(e.mark.line + 1) +
                             ": " + e.msg);
  } catch (const std::exception& e) {
    throw std::runtime_error("cannot read '" + path + "': " + e.what());
  }
}

void apply(const ObjectMetadata& metadata, FieldMetadata* object) {
  if (metadata.metres_per_unit > 0) object->metres_per_unit = metadata.metres_per_unit;
  object->T_O_U = metadata.T_O_U;
  object->box = metadata.box;
  object->symmetries = metadata.symmetries.inFrame(metadata.T_O_U);
}

Field loadField(const std::string& model_path) {
  Field field = loadModel(model_path);
  apply(readObjectMetadata(metadataPathOf(model_path)), &field.metadata);
  return field;
}

FieldMetadata readObject(const std::string& model_path) {
  FieldMetadata object = readModelMetadata(model_path);
  apply(readObjectMetadata(metadataPathOf(model_path)), &object);
  return object;
}

}  // namespace nerf_pose_refiner
