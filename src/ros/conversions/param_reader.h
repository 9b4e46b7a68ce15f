// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/node_handle.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace nerf_pose_refiner {

/// Reads a group of parameters strictly: a wrong type is an error, and so is a key that nobody
/// asked for. Values that are absent keep what they had: defaults live in the structs alone.
///
///     ParamReader read = ParamReader::ofNode(pnh);
///     read.get("publish_tf", params.publish_tf);
///     ParamReader group = read.group("tracker");
///     group.get("min_score", params.min_score);
///     group.rejectUnknown();
class ParamReader {
 public:
  /// @param values a struct, or anything invalid for "nothing is set".
  /// @param path how messages name the group, say "~tracker".
  /// @throws std::invalid_argument if `values` is neither.
  ParamReader(const XmlRpc::XmlRpcValue& values, const std::string& path);

  /// All private parameters of a node, read once.
  static ParamReader ofNode(const ros::NodeHandle& pnh);

  /// @throws std::invalid_argument naming the parameter, the type expected and the type found.
  void get(const std::string& name, bool& value);
  void get(const std::string& name, int& value);
  void get(const std::string& name, double& value);  ///< whole numbers are welcome
  void get(const std::string& name, std::string& value);
  void get(const std::string& name, std::uint64_t& value);  ///< 0 .. 2^31 - 1

  /// A list of numbers, which may be empty; nothing if it is absent.
  std::optional<std::vector<double>> numbers(const std::string& name);

  /// A group below this one; empty if it is absent.
  ParamReader group(const std::string& name);

  /// A list of groups, which may be empty; nothing if it is absent.
  std::optional<std::vector<ParamReader>> list(const std::string& name);

  /// One line for each key that nobody asked for, with the nearest name that exists.
  std::vector<std::string> unknown() const;

  /// @throws std::invalid_argument with the lines of `unknown`, if there are any.
  void rejectUnknown() const;

  /// "path/name: value" of all that was asked for here and below, in effect, in order.
  const std::vector<std::string>& log() const { return *log_; }

 private:
  const XmlRpc::XmlRpcValue* find(const std::string& name);
  std::string pathOf(const std::string& name) const;
  template <typename T>
  void note(const std::string& name, const T& value);

  XmlRpc::XmlRpcValue values_;
  std::string path_;
  std::set<std::string> asked_;
  std::shared_ptr<std::vector<std::string>> log_;  ///< shared with the groups below
};

}  // namespace nerf_pose_refiner
